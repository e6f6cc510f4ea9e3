"""Observables and statistics of a linkage, by names of joints, slides, bodies and points."""

import functools
from typing import Any, NamedTuple

import jax.numpy as jnp
from jaxtyping import Scalar

from jaxcrusher.basics.checks import require
from jaxcrusher.basics.plane import Vector
from jaxcrusher.basics.smooth import norm
from jaxcrusher.mechanism.arms import or_zero, plus
from jaxcrusher.mechanism.linkage_statistics import (
    LEAST,
    OF_MACHINE,
    OF_SUPPORTS,
    PEAK,
    always_at,
    further_at,
)
from jaxcrusher.mechanism.named import before
from jaxcrusher.mechanism.observables import (
    FORCE_WIDTH,
    crank_speed,
    drive_torque,
    force_at,
    observables_at,
    on_bore,
)
from jaxcrusher.mechanism.observables import OF_MACHINE as SEEN_OF_MACHINE
from jaxcrusher.mechanism.observables import OF_SUPPORTS as SEEN_OF_SUPPORTS
from jaxcrusher.mechanism.reductions import PowerMean, Statistic
from jaxcrusher.mechanism.snapshot import Observable, OfPart, Snapshot

# Smooths the length of an acceleration (m/s2) where it vanishes.
ACCELERATION_WIDTH = 1e-9


class Parts(NamedTuple):
    """What a linkage has by name, and whether it has supports and a crank that may rest."""

    joints: tuple[str, ...]
    loose: tuple[str, ...]
    rubbing: tuple[str, ...]
    slides: tuple[str, ...]
    points: tuple[str, ...]
    supports: bool
    rests: bool


def _position(s: Snapshot, scene: Any, name: str) -> Vector:
    return s.motion.position(scene.point(name))


def _velocity(s: Snapshot, scene: Any, name: str) -> Vector:
    return s.motion.velocity(scene.point(name))


def _acceleration(s: Snapshot, scene: Any, name: str) -> Vector:
    """Return r_S'' + phi'' perp(arm) - phi'^2 arm past the ground, in the frame's axes."""
    point = scene.point(name)
    centre = s.accelerations.centres[point.body]
    assert centre is not None, point.body
    arm = (point.arm - scene.linkage.body(point.body).mass_centre).along(s.motion.axis(point.body))
    if arm is None:
        return centre
    spin = plus(s.motion.spin(point.body), None if s.frame is None else s.frame.spin)
    spin_up = s.accelerations.spin_ups[point.body]
    turned = None if spin_up is None else spin_up * arm.perp()
    inward = None if spin is None else -(spin**2) * arm
    return centre + or_zero(plus(turned, inward))


def _acceleration_size(s: Snapshot, scene: Any, name: str) -> Scalar:
    return norm(_acceleration(s, scene, name), ACCELERATION_WIDTH)


def _slide_force(s: Snapshot, scene: Any, slide: str) -> Scalar:
    guiding = s.accelerations.slides[slide]
    assert guiding is not None, slide
    return guiding.force


def _slide_moment(s: Snapshot, scene: Any, slide: str) -> Scalar:
    guiding = s.accelerations.slides[slide]
    assert guiding is not None, slide
    return guiding.moment


def _slide_size(s: Snapshot, scene: Any, slide: str) -> Scalar:
    return norm(Vector(_slide_force(s, scene, slide), jnp.zeros(())), FORCE_WIDTH)


@functools.cache
def observables_of(parts: Parts) -> dict[str, Observable]:
    """Return what can be observed of a linkage, vectors with x to the right and y up.

    Raises ValueError for names of parts of which two observables would have one name.
    """
    of_joints: dict[str, Observable] = {}
    for joint in parts.loose:
        of_joints |= observables_at(joint, before(joint), joint)
    for joint in parts.joints:
        of_joints[f"{joint}_reaction"] = _seen(on_bore, joint, "N", f"force on the bore of {joint}")
    found: dict[str, Observable] = {}
    for slide in parts.slides:
        found[f"{slide}_force"] = _seen(
            _slide_force, slide, "N", f"force on the slide {slide}, to the left of its direction"
        )
        found[f"{slide}_moment"] = _seen(
            _slide_moment, slide, "N m", f"moment on the slide {slide} about its body's origin"
        )
    for point in parts.points:
        found[f"{point}_position"] = _seen(
            _position, point, "m", f"place of {point}, from the frame"
        )
        found[f"{point}_velocity"] = _seen(
            _velocity, point, "m/s", f"velocity of {point}, past the frame"
        )
        found[f"{point}_acceleration"] = _seen(
            _acceleration, point, "m/s2", f"acceleration of {point}, past the ground"
        )
    speed = {"crank_speed": Observable(crank_speed, "rad/s", "speed of the crank")}
    others = SEEN_OF_MACHINE | speed | (SEEN_OF_SUPPORTS if parts.supports else {})
    twice = ", ".join(sorted(found.keys() & {*of_joints, *others}))
    must = "have other names than to be seen as what joints, machine or supports have"
    require(not twice, "slides and points", must, f"seen as {twice}")
    return of_joints | found | others


def _seen(function: Any, part: str, unit: str, meaning: str) -> Observable:
    return Observable(OfPart(function, part), unit, meaning)


@functools.cache
def _usual(parts: Parts) -> dict[str, Statistic]:
    seen, found = observables_of(parts), {"shaking_rms": OF_MACHINE["shaking_rms"]}
    for joint in parts.loose:
        found |= always_at(joint, before(joint), joint, seen)
    return found | ({"crank_speed_least": _SPEED_LEAST} if parts.rests else {})


def usual_of(parts: Parts) -> tuple[str, ...]:
    """Return the names of the statistics that are computed without being asked for."""
    return tuple(_usual(parts))


@functools.cache
def statistics_of(parts: Parts) -> dict[str, Statistic]:
    """Return the statistics of a linkage."""
    found = _usual(parts) | OF_MACHINE | _OF_DRIVE
    for joint in parts.loose:
        wear = further_at(joint, before(joint), joint)
        found |= {name: one for name, one in wear.items() if not name.endswith("joint_peak")}
        if joint not in parts.rubbing:
            del found[f"{before(joint)}sliding_power"]
    for joint in parts.joints:
        found |= _sizes(f"{joint}_force", "N", f"force in {joint}", OfPart(force_at, joint))
    for slide in parts.slides:
        found |= _sizes(f"{slide}_force", "N", f"force on {slide}", OfPart(_slide_size, slide))
    for point in parts.points:
        size = OfPart(_acceleration_size, point)
        found |= _sizes(f"{point}_acceleration", "m/s2", f"acceleration of {point}", size)
    return found | (OF_SUPPORTS if parts.supports else {})


def _sizes(name: str, unit: str, meaning: str, size: OfPart) -> dict[str, Statistic]:
    """Return RMS and peak of the size of a quantity."""
    return {
        f"{name}_rms": Statistic(unit, f"RMS of the {meaning}", size, PowerMean(2)),
        f"{name}_peak": Statistic(unit, f"peak of the {meaning}", size, PEAK),
    }


_OF_DRIVE = {
    "drive_torque_rms": Statistic("N m", "RMS of the drive torque", drive_torque, PowerMean(2)),
    "drive_torque_peak": Statistic("N m", "peak of the drive torque", drive_torque, PEAK),
}
_SPEED_LEAST = Statistic(
    "rad/s", "least speed of a free crank, which friction does not hold at rest", crank_speed, LEAST
)

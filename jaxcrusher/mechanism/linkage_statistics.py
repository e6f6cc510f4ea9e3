"""Statistics and observables of any linkage: of joints, slides, bodies and points, by their names.

And of its drive, of what it shakes, and of its supports.
"""

import functools
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float, Scalar

from jaxcrusher.basics.checks import require
from jaxcrusher.basics.plane import Vector, or_zero, plus
from jaxcrusher.basics.smooth import norm
from jaxcrusher.joint.rollers import RollerBearing
from jaxcrusher.mechanism.named import before
from jaxcrusher.mechanism.observables import OF_MACHINE as SEEN_OF_MACHINE
from jaxcrusher.mechanism.observables import OF_SUPPORTS as SEEN_OF_SUPPORTS
from jaxcrusher.mechanism.observables import (
    acceleration_width,
    crank_speed,
    drive_power,
    drive_torque,
    force_at,
    force_width,
    frame_displacement,
    frame_speed,
    ground_moment,
    observables_at,
    on_bore,
    shaking_size,
    support_size,
    torque_width,
    transmitted_size,
)
from jaxcrusher.mechanism.reductions import (
    LARGEST,
    LEAST,
    PEAK,
    Deviation,
    PowerMean,
    Sampled,
    ShareAboveZero,
    Statistic,
    top,
)
from jaxcrusher.mechanism.scene import AbstractScene
from jaxcrusher.mechanism.snapshot import Observable, OfPart, Snapshot

Statistics = dict[str, Statistic]


def _winding(s: Snapshot, scene: AbstractScene, joint: str) -> Scalar:
    """Revolutions of the pin round the bore over those of the shaft, as long as they touch.

    In flight past the bore's centre the angle jumps, and no step of the integration sees that.
    """
    contact = s.contacts[joint]
    if contact is None:
        return jnp.zeros_like(scene.drive.speed)
    touching = jnp.where(contact.penetration > 0, contact.orbit_speed, 0.0)
    return touching / scene.drive.speed


def _sliding_power(s: Snapshot, scene: AbstractScene, joint: str) -> Scalar:
    """F_n times the slip of the surfaces, whatever slip the friction law reads: Archard's rate."""
    contact = s.contacts[joint]
    if contact is None or contact.surface_speed is None:
        raise ValueError(
            f"Argument `outputs` must not ask for the sliding_power of {joint}, which has no "
            "friction, but does."
        )
    return contact.normal_force * jnp.abs(contact.surface_speed)


def _largest_excursion(samples: Float[Array, "n 2"]) -> Scalar:
    """Return how far a point comes from its mean place."""
    x, y = (samples[:, i] - jnp.mean(samples[:, i]) for i in (0, 1))
    return top(jnp.sqrt(x**2 + y**2))


def _place_of_frame(s: Snapshot, scene: AbstractScene) -> Float[Array, "2"]:
    return frame_displacement(s, scene).array()


# A place is smooth where forces are impacts, and 1024 instants a turn resolve it.
_EXCURSION = Sampled(_largest_excursion, jnp.max)
_CONTACT = ShareAboveZero()


def always_at(joint: str, place: str, seen: Mapping[str, Observable]) -> Statistics:
    """Return the statistics of a joint that are computed without being asked for."""
    prefix = before(joint)
    depth, rate = seen[f"{prefix}penetration_ratio"], seen[f"{prefix}penetration_rate"]
    winding = OfPart(_winding, joint)
    return {
        prefix + name: Statistic(unit, f"{meaning}, at {place}", quantity, reduction)
        for name, unit, meaning, quantity, reduction in (
            ("contact_fraction", "1", "share of time in contact", depth, _CONTACT),
            ("penetration_ratio", "1", "largest penetration / clearance", depth, LARGEST),
            ("impact_speed", "m/s", "fastest approach of pin and bore", rate, LARGEST),
            ("winding", "1", "revolutions round the bore a turn, in contact", winding, PowerMean()),
        )
    }


def further_at(joint: str, place: str) -> Statistics:
    """Return the statistics of a joint that are computed if they are asked for."""
    prefix, force, wear = before(joint), OfPart(force_at, joint), OfPart(_sliding_power, joint)
    return {
        f"{prefix}joint_peak": Statistic("N", f"largest force at {place}", force, PEAK),
        f"{prefix}sliding_power": Statistic(
            "W", f"mean of F_n |surface slip| at {place}: wear", wear, PowerMean()
        ),
    }


# Of the machine as a whole.
OF_MACHINE = {
    # The force on the ground less its mean. Over a period the momentum comes back to itself, so
    # that the mean of -sum of m a is zero; over turns of a transient the mean is the momentum's
    # change over their time, and is not taken off.
    "shaking_rms": Statistic("N", "RMS of the shaking force", shaking_size, PowerMean(2)),
    "shaking_peak": Statistic("N", "peak of the shaking force", shaking_size, PEAK),
    # About the point of the foundation, and about its mean: a moment of weight stays.
    "shaking_moment_rms": Statistic(
        "N m", "RMS of what moves of the moment on the ground", ground_moment, Deviation()
    ),
    "drive_power": Statistic("W", "mean power of the drive", drive_power, PowerMean()),
}
# Of a frame on supports, when asked. The moving part of a force is what it has beside all weight,
# its mean over a period; a support carries its whole force.
OF_SUPPORTS = {
    "transmitted_rms": Statistic(
        "N", "RMS of what moves of the force on the ground", transmitted_size, PowerMean(2)
    ),
    "transmitted_peak": Statistic(
        "N", "peak of what moves of the force on the ground", transmitted_size, PEAK
    ),
    **{
        f"{side}_peak": Statistic(
            "N", f"largest force of the {side} support", OfPart(support_size, side), PEAK
        )
        for side in ("left", "right")
    },
    "frame_displacement_peak": Statistic(
        "m", "how far the frame's G comes from its mean place", _place_of_frame, _EXCURSION
    ),
    "frame_velocity_rms": Statistic("m/s", "RMS of the speed of G", frame_speed, PowerMean(2)),
}
# Of a free shaft under friction.
OF_SHAFT = {
    "shaft_speed_least": Statistic(
        "rad/s",
        "least speed of a free shaft, which friction does not hold at rest",
        crank_speed,
        LEAST,
    ),
}


def may_rest(scene: AbstractScene) -> bool:
    """Return whether a free shaft turns under friction, also of rollers, which might hold it."""
    rubs = any(
        joint.friction is not None or isinstance(joint, RollerBearing)
        for joint in scene.joints.values
    )
    return rubs and scene.drive.initial() is not None


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
    centre = s.accelerations.centres.at(point.body)
    arm = (point.arm - scene.linkage.body(point.body).mass_centre).along(s.motion.axis(point.body))
    if arm is None:
        return centre
    spin = plus(s.motion.spin(point.body), None if s.frame is None else s.frame.spin)
    spin_up = s.accelerations.spin_ups[point.body]
    turned = None if spin_up is None else spin_up * arm.perp()
    inward = None if spin is None else -(spin**2) * arm
    return centre + or_zero(plus(turned, inward))


def _acceleration_size(s: Snapshot, scene: Any, name: str) -> Scalar:
    return norm(_acceleration(s, scene, name), acceleration_width(scene))


def _slide_force(s: Snapshot, scene: Any, slide: str) -> Scalar:
    return s.accelerations.slides.at(slide).force


def _slide_moment(s: Snapshot, scene: Any, slide: str) -> Scalar:
    return s.accelerations.slides.at(slide).moment


def _size(number: Scalar, width: Scalar) -> Scalar:
    """Return the size of a force or a torque, with a derivative at zero too."""
    return norm(Vector(number, jnp.zeros(())), width)


def _slide_size(s: Snapshot, scene: Any, slide: str) -> Scalar:
    return _size(_slide_force(s, scene, slide), force_width(s, scene))


@functools.cache
def observables_of(parts: Parts) -> dict[str, Observable]:
    """Return what can be observed of a linkage, vectors with x to the right and y up.

    Raises ValueError for names of parts of which two observables would have one name.
    """
    of_joints: dict[str, Observable] = {}
    for joint in parts.loose:
        of_joints |= observables_at(joint, joint)
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
        found |= always_at(joint, joint, seen)
    return found | ({"crank_speed_least": _SPEED_LEAST} if parts.rests else {})


def usual_of(parts: Parts) -> tuple[str, ...]:
    """Return the names of the statistics that are computed without being asked for."""
    return tuple(_usual(parts))


@functools.cache
def statistics_of(parts: Parts) -> dict[str, Statistic]:
    """Return the statistics of a linkage."""
    found = _usual(parts) | OF_MACHINE | _OF_DRIVE
    for joint in parts.rubbing:
        name = f"{before(joint)}sliding_power"
        found[name] = further_at(joint, joint)[name]
    for joint in parts.joints:
        found |= _sizes(f"{joint}_force", "N", f"force in {joint}", OfPart(force_at, joint))
    for slide in parts.slides:
        found |= _sizes(f"{slide}_force", "N", f"force on {slide}", OfPart(_slide_size, slide))
    for point in parts.points:
        size = OfPart(_acceleration_size, point)
        found |= _sizes(f"{point}_acceleration", "m/s2", f"acceleration of {point}", size)
    return found | (OF_SUPPORTS if parts.supports else {})


def _sizes(
    name: str, unit: str, meaning: str, size: Callable[[Snapshot, Any], Scalar]
) -> dict[str, Statistic]:
    """Return RMS and peak of the size of a quantity."""
    return {
        f"{name}_rms": Statistic(unit, f"RMS of the {meaning}", size, PowerMean(2)),
        f"{name}_peak": Statistic(unit, f"peak of the {meaning}", size, PEAK),
    }


def _torque_size(s: Snapshot, scene: AbstractScene) -> Scalar:
    return _size(drive_torque(s, scene), torque_width(s, scene))


_OF_DRIVE = _sizes("drive_torque", "N m", "size of the drive torque", _torque_size)
_SPEED_LEAST = Statistic(
    "rad/s", "least speed of a free crank, which friction does not hold at rest", crank_speed, LEAST
)

"""Observables of an instant: forces, powers, and what the main bearing stands."""

from collections.abc import Container

import jax
import jax.numpy as jnp
from jaxtyping import Scalar

from jaxcrusher.basics.checks import require, require_own_process, require_positive
from jaxcrusher.basics.plane import Vector
from jaxcrusher.basics.smooth import norm
from jaxcrusher.crusher.loads import JawMotion
from jaxcrusher.crusher.machine import JOINTS, LETTERS
from jaxcrusher.joint.clearance import AbstractBearing
from jaxcrusher.joint.rollers import LIFE_EXPONENT, RollerBearing
from jaxcrusher.mechanism.acting import Stretched
from jaxcrusher.mechanism.observables import (
    OF_MACHINE,
    OF_SUPPORTS,
    crank_speed,
    force_at,
    force_width,
    observables_at,
    on_bore,
    on_pin,
)
from jaxcrusher.mechanism.scene import AbstractScene
from jaxcrusher.mechanism.snapshot import Observable, OfPart, Snapshot

# The force of the shaft on the jaw at A, of the frame on the shaft (R_O), of the toggle on the jaw
# (R_B), and of the frame on the toggle (R_C), N.
joint_force = OfPart(on_bore, "main")
bearing_reaction = OfPart(on_pin, "shaft_bearing")
elbow_reaction = OfPart(on_bore, "elbow")
toggle_reaction = OfPart(on_pin, "pivot")


def foundation_force(s: Snapshot, scene: AbstractScene) -> Scalar:
    """|R_O| + |R_C|, N: the only definition of seven that meets the paper's numbers."""
    at_bearing = norm(bearing_reaction(s, scene), force_width(s, scene))
    return at_bearing + norm(toggle_reaction(s, scene), force_width(s, scene))


def net_foundation_force(s: Snapshot, scene: AbstractScene) -> Scalar:
    """|R_O + R_C|, N: the length of the resultant on the foundation."""
    return norm(bearing_reaction(s, scene) + toggle_reaction(s, scene), force_width(s, scene))


def load_position(s: Snapshot, scene: AbstractScene) -> Vector:
    """Where the crushing load acts on the jaw, m; S2 where there is none."""
    if not s.applied.pushes:
        return JawMotion(s.motion).position()
    ((point, _),) = s.applied.pushes
    return s.motion.position(point)


def elbow_position(s: Snapshot, scene: AbstractScene) -> Vector:
    """B, the jaw's lower end, m; C is the origin."""
    return s.motion.position(scene.linkage.joint("elbow").bore)


def elbow_velocity(s: Snapshot, scene: AbstractScene) -> Vector:
    """Return the velocity of B, the jaw's lower end, m/s."""
    return s.motion.velocity(scene.linkage.joint("elbow").bore)


def pin_position(s: Snapshot, scene: AbstractScene) -> Vector:
    """Return the centre A of the shaft's pin, m."""
    return s.motion.position(scene.linkage.joint("main").pin)


def jaw_mass_centre(s: Snapshot, scene: AbstractScene) -> Vector:
    """S2, m."""
    return s.motion.centre("jaw")


def _rod(s: Snapshot, name: str) -> Stretched:
    """Return the tension rod as it is stretched."""
    if not s.applied.springs:
        raise ValueError(f"Argument `outputs` must not ask for {name} without a rod, but does.")
    (rod,) = s.applied.springs
    return rod


def rod_tension(s: Snapshot, scene: AbstractScene) -> Scalar:
    """Return the tension of the rod, N; ValueError without one."""
    return _rod(s, "rod_tension").pull


def rod_margin(s: Snapshot, scene: AbstractScene) -> Scalar:
    """Return the tension that a rod would have that can push, N: it is slack where negative."""
    return _rod(s, "rod_margin").wanted


def _crushing_load(s: Snapshot, scene: AbstractScene) -> Vector:
    return s.applied.pushes[0][1] if s.applied.pushes else Vector(0.0, 0.0)


_AT = {joint: observables_at(joint, place) for joint, place in LETTERS.items()}
OF_ROD = {"rod_tension": Observable(rod_tension, "N", "tension of the rod")}

# Name -> function, unit and meaning of what can be observed of an instant.
OBSERVABLES = {
    **_AT["main"],
    "foundation_force": Observable(foundation_force, "N", "|R_O| + |R_C|"),
    "net_foundation_force": Observable(net_foundation_force, "N", "|R_O + R_C|"),
    "shaking_force": OF_MACHINE["shaking_force"],
    "ground_force": OF_MACHINE["ground_force"],
    "ground_moment": OF_MACHINE["ground_moment"],
    "joint_force": Observable(joint_force, "N", "force on the jaw at A"),
    "bearing_reaction": Observable(bearing_reaction, "N", "reaction R_O"),
    "elbow_reaction": Observable(elbow_reaction, "N", "reaction R_B"),
    "toggle_reaction": Observable(toggle_reaction, "N", "reaction R_C"),
    "drive_torque": OF_MACHINE["drive_torque"],
    "drive_power": OF_MACHINE["drive_power"],
    "shaft_speed": Observable(crank_speed, "rad/s", "shaft speed"),
    "crushing_load": Observable(_crushing_load, "N", "crushing load on the jaw"),
    "load_position": Observable(load_position, "m", "where the load acts on the jaw"),
    "pin_position": Observable(pin_position, "m", "centre A of the pin"),
    "jaw_position": Observable(elbow_position, "m", "lower end B"),
    "jaw_mass_centre": Observable(jaw_mass_centre, "m", "mass centre S2 of the jaw"),
    "jaw_velocity": Observable(elbow_velocity, "m/s", "velocity of B"),
    "constraint_residual": OF_MACHINE["constraint_residual"],
    **_AT["elbow"],
    **_AT["pivot"],
    **_AT["shaft_bearing"],
    **OF_SUPPORTS,
    **OF_ROD,
}


def observables_with(loose: Container[str], supports: bool, rod: bool) -> tuple[str, ...]:
    """Return the names of what a crusher has: of loose joints, and of supports and rod if any."""
    absent = [joint for joint in JOINTS[1:] if joint not in loose]
    left_out = {name for joint in absent for name in _AT[joint]}
    left_out |= set() if supports else set(OF_SUPPORTS)
    left_out |= set() if rod else set(OF_ROD)
    return tuple(name for name in OBSERVABLES if name not in left_out)


# Turns that a bearing at its dynamic rating lasts (ISO 281), and seconds an hour.
RATED_TURNS, HOUR = 1e6, 3600.0


def bearing_stiffness(scene: AbstractScene, force: float | Scalar) -> Scalar:
    """Return dF/de of the main bearing at rest under a force (N, > 0), N/m.

    Raises ValueError for an ideal bearing.
    """
    require_own_process()
    require_positive("force", force, "N")
    law = _main(scene, "scene").normal
    return jax.grad(law.elastic_force)(law.penetration_under(jnp.asarray(force, float)))


def stiffness_now(s: Snapshot, scene: AbstractScene) -> Scalar:
    """Return dF/de of the main bearing where it is, N/m; ValueError for an ideal one."""
    joint = _main(scene, "outputs")
    return jax.grad(joint.normal.elastic_force)(s.contacts.at("main").penetration)


def roller_pressure(s: Snapshot, scene: AbstractScene) -> Scalar:
    """Return Hertz's pressure of the most loaded roller, Pa; ValueError without rollers."""
    return _rollers(scene).pressure(s.contacts.at("main").penetration)


def static_load(s: Snapshot, scene: AbstractScene) -> Scalar:
    """Return the load of a bearing over its static rating; ValueError without rollers."""
    bearing = _rollers(scene)
    return force_at(s, scene, "main") / (bearing.bearings * bearing.static_rating)


def fatigue(s: Snapshot, scene: AbstractScene) -> Scalar:
    """Return the share of its life L10 that a bearing uses in an hour; ValueError without rollers.

    ISO 281 with the exponent 10/3, without its factor of lubrication and cleanness. The rings turn
    against each other once in a turn of the shaft.
    """
    bearing = _rollers(scene)
    load = force_at(s, scene, "main") / (bearing.bearings * bearing.dynamic_rating)
    turns = jnp.abs(s.motion.crank.speed) / (2 * jnp.pi) * HOUR
    return turns / RATED_TURNS * load**LIFE_EXPONENT


def _main(scene: AbstractScene, name: str) -> AbstractBearing:
    joint = scene.joints["main"]
    require(joint is not None, name, "go with a main bearing with clearance", "with an ideal one")
    assert joint is not None
    return joint


def _rollers(scene: AbstractScene) -> RollerBearing:
    joint = scene.joints["main"]
    if not isinstance(joint, RollerBearing):
        raise ValueError("Argument `outputs` must not ask for rollers where A has none, but does.")
    return joint

"""Observables of an instant: forces, powers, energies, as functions of a snapshot."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Scalar

from jaxcrusher.basics.plane import Vector
from jaxcrusher.basics.smooth import norm
from jaxcrusher.crusher import linkage
from jaxcrusher.crusher.joints import JOINTS, LETTERS, before
from jaxcrusher.crusher.scene import Scene
from jaxcrusher.crusher.snapshot import (
    Snapshot,
    moment_on_shaft,
    pin_position,
    shaft_inertia,
)
from jaxcrusher.joint.clearance import ClearanceJoint, Contact

# Smooths the length of a reaction (N) where it vanishes.
FORCE_WIDTH = 1e-6


def _momentum_rates(s: Snapshot, scene: Scene) -> tuple[Vector, Vector, Vector]:
    """Mass times acceleration of shaft, jaw and toggle, N."""
    machine = scene.machine
    centre = machine.shaft.mass_centre.along(s.shaft.crank)
    shaft = linkage.turning(centre, s.shaft.speed, s.shaft.acceleration)
    jaw = linkage.mass_centre_acceleration(machine, s.chain, s.chain_acceleration)
    toggle = linkage.toggle_centre_acceleration(machine, s.chain, s.chain_acceleration)
    return machine.shaft.mass * shaft, machine.jaw.mass * jaw, machine.toggle.mass * toggle


def _weight(mass: Scalar, scene: Scene) -> Vector:
    return Vector(0.0, -mass * scene.machine.gravity)


def bearing_reaction(s: Snapshot, scene: Scene) -> Vector:
    """R_O, the frame's force on the shaft at the main bearing, N."""
    if s.multipliers is not None:
        return -s.multipliers.bearing
    rate, _, _ = _momentum_rates(s, scene)
    return rate - _weight(scene.machine.shaft.mass, scene) + s.joint_force


def elbow_reaction(s: Snapshot, scene: Scene) -> Vector:
    """R_B, the toggle's force on the jaw, N."""
    if s.multipliers is not None and s.multipliers.elbow is not None:
        return -s.multipliers.elbow
    _, rate, _ = _momentum_rates(s, scene)
    reaction = rate - _weight(scene.machine.jaw.mass, scene) - s.joint_force
    return reaction if s.load is None else reaction - s.load


def toggle_reaction(s: Snapshot, scene: Scene) -> Vector:
    """R_C, the frame's force on the toggle, N.

    In (13) the multipliers of S3's rows are not R_C: the rows of B lead to C through
    theta3, so that R_C is minus the sum of both.
    """
    if s.multipliers is not None and s.multipliers.toggle_pivot is not None:
        pivot = -s.multipliers.toggle_pivot
        return pivot if s.multipliers.elbow is None else pivot - s.multipliers.elbow
    _, _, rate = _momentum_rates(s, scene)
    return rate - _weight(scene.machine.toggle.mass, scene) + elbow_reaction(s, scene)


def foundation_force(s: Snapshot, scene: Scene) -> Scalar:
    """|R_O| + |R_C|, N: the only definition of seven that meets the paper's numbers."""
    at_bearing = norm(bearing_reaction(s, scene), FORCE_WIDTH)
    return at_bearing + norm(toggle_reaction(s, scene), FORCE_WIDTH)


def net_foundation_force(s: Snapshot, scene: Scene) -> Scalar:
    """|R_O + R_C|, N: the length of the resultant on the foundation."""
    return norm(bearing_reaction(s, scene) + toggle_reaction(s, scene), FORCE_WIDTH)


def shaking_force(s: Snapshot, scene: Scene) -> Vector:
    """Return -sum of m a, N: the moving part of the force on the ground.

    The machine stands on the ground by bearing, pivot and fixed jaw. The crushing load closes
    between jaw and fixed jaw, inside the machine, and the weight stands still: neither shakes.
    """
    shaft, jaw, toggle = _momentum_rates(s, scene)
    return -(shaft + jaw + toggle)


def shaking_size(s: Snapshot, scene: Scene) -> Scalar:
    """Return the length of the shaking force, N."""
    return norm(shaking_force(s, scene), FORCE_WIDTH)


def ground_force(s: Snapshot, scene: Scene) -> Vector:
    """Return the machine's force on the ground, N: weights of the three bodies less sum of m a.

    It equals -(R_O + R_C) less the load on the jaw, whose reaction the fixed jaw carries.
    """
    machine = scene.machine
    mass = machine.shaft.mass + machine.jaw.mass + machine.toggle.mass
    return shaking_force(s, scene) + _weight(mass, scene)


def ground_moment(s: Snapshot, scene: Scene) -> Scalar:
    """Return the machine's moment on the ground, N m, about the point of the scene's foundation.

    Each body adds (r - p) x m (g - a) - J alpha; without a foundation p is C. The load and its
    reaction on the fixed jaw lie in one line and add nothing, nor does a drive that stands on the
    frame.
    """
    machine, rates = scene.machine, _momentum_rates(s, scene)
    places = (
        machine.bearing + machine.shaft.mass_centre.along(s.shaft.crank),
        jaw_mass_centre(s, scene),
        linkage.toggle_centre(machine, s.chain),
    )
    turning = s.shaft.acceleration, s.chain_acceleration.jaw, s.chain_acceleration.toggle
    point = Vector(0.0, 0.0) if scene.foundation is None else scene.foundation.point
    total = jnp.zeros_like(s.shaft.speed)
    bodies = machine.shaft, machine.jaw, machine.toggle
    for body, place, rate, spin_up in zip(bodies, places, rates, turning, strict=True):
        total = total + (place - point).cross(_weight(body.mass, scene) - rate)
        total = total if spin_up is None else total - body.inertia * spin_up
    return total


def drive_torque(s: Snapshot, scene: Scene) -> Scalar:
    """M0, counterclockwise on the shaft, N m."""
    if s.multipliers is not None and s.multipliers.drive is not None:
        return -s.multipliers.drive
    others = moment_on_shaft(scene.machine, s.shaft.crank, s.joint_force, s.shaft_moment)
    if s.shaft.acceleration is None:
        return -others
    return shaft_inertia(scene.machine) * s.shaft.acceleration - others


def drive_power(s: Snapshot, scene: Scene) -> Scalar:
    """M0 times the shaft's speed, W."""
    return drive_torque(s, scene) * s.shaft.speed


def load_power(s: Snapshot, scene: Scene) -> Scalar:
    """The power of the crushing load, W."""
    if s.load is None:
        return jnp.zeros_like(s.shaft.speed)
    return s.load.dot(linkage.mass_centre_velocity(scene.machine, s.chain))


def contact_loss(s: Snapshot, scene: Scene) -> Scalar:
    """Power dissipated by the damping of the contact, W."""
    return _over_joints(ClearanceJoint.normal_loss, s, scene)


def friction_loss(s: Snapshot, scene: Scene) -> Scalar:
    """Power dissipated by friction, W; may be negative where slip is that of the centres."""
    return _over_joints(ClearanceJoint.friction_loss, s, scene)


def elbow_position(s: Snapshot, scene: Scene) -> Vector:
    """B, the jaw's lower end, m; C is the origin."""
    return linkage.elbow_position(scene.machine, s.chain)


def jaw_mass_centre(s: Snapshot, scene: Scene) -> Vector:
    """S2, where the crushing load acts, m."""
    return elbow_position(s, scene) + linkage.mass_centre_arm(scene.machine, s.chain)


def kinetic_energy(s: Snapshot, scene: Scene) -> Scalar:
    """Return the kinetic energy of the three bodies, J."""
    machine = scene.machine
    jaw_velocity = linkage.mass_centre_velocity(machine, s.chain)
    toggle_velocity = linkage.toggle_centre_velocity(machine, s.chain)
    return 0.5 * (
        shaft_inertia(machine) * s.shaft.speed**2
        + machine.jaw.mass * jaw_velocity.dot(jaw_velocity)
        + machine.jaw.inertia * s.chain.jaw_spin**2
        + machine.toggle.mass * toggle_velocity.dot(toggle_velocity)
        + machine.toggle.inertia * s.chain.toggle_spin**2
    )


def potential_energy(s: Snapshot, scene: Scene) -> Scalar:
    """Return the potential energy of weight, zero at C's height, J."""
    machine = scene.machine
    shaft = machine.bearing + machine.shaft.mass_centre.along(s.shaft.crank)
    toggle = linkage.toggle_centre(machine, s.chain)
    jaw = jaw_mass_centre(s, scene)
    return machine.gravity * (
        machine.shaft.mass * shaft.y + machine.jaw.mass * jaw.y + machine.toggle.mass * toggle.y
    )


def elastic_energy(s: Snapshot, scene: Scene) -> Scalar:
    """Stored in the contacts, J."""
    return _over_joints(ClearanceJoint.elastic_energy, s, scene)


def _over_joints(
    part: Callable[[ClearanceJoint, Contact], Scalar | None], s: Snapshot, scene: Scene
) -> Scalar:
    """The sum of a number of each contact; zero where there is none."""
    known: list[Scalar] = [one for _, one in scene.joints.map(part, s.contacts).present()]
    return sum(known[1:], known[0]) if known else jnp.zeros_like(s.shaft.speed)


# The force between pin and bore of each joint; of the frame on the toggle at C.
_FORCES: dict[str, Callable[[Snapshot, Scene], Vector]] = {
    "main": lambda s, _: s.joint_force,
    "elbow": elbow_reaction,
    "pivot": toggle_reaction,
}


def force_at(s: Snapshot, scene: Scene, joint: str) -> Scalar:
    """The length of the force in a joint, N."""
    return norm(_FORCES[joint](s, scene), FORCE_WIDTH)


def _normal_force(s: Snapshot, scene: Scene, joint: str) -> Scalar:
    contact = s.contacts[joint]
    return force_at(s, scene, joint) if contact is None else contact.normal_force


def _friction_force(s: Snapshot, scene: Scene, joint: str) -> Scalar:
    contact = s.contacts[joint]
    force = None if contact is None else contact.friction_force
    return jnp.zeros_like(s.shaft.speed) if force is None else force


def _eccentricity(s: Snapshot, scene: Scene, joint: str) -> Vector:
    found = s.eccentricities[joint]
    return Vector(0.0, 0.0) if found is None else found


def _crushing_load(s: Snapshot, scene: Scene) -> Vector:
    return Vector(0.0, 0.0) if s.load is None else s.load


def _penetration_ratio(s: Snapshot, scene: Scene, joint: str) -> Scalar:
    contact, clearance = s.contacts[joint], scene.joints[joint]
    if contact is None:
        return jnp.zeros_like(s.shaft.speed)
    return contact.penetration / clearance.clearance


def _penetration_rate(s: Snapshot, scene: Scene, joint: str) -> Scalar:
    contact = s.contacts[joint]
    return jnp.zeros_like(s.shaft.speed) if contact is None else contact.penetration_rate


def _constraint_residual(s: Snapshot, scene: Scene) -> Scalar:
    return jnp.zeros_like(s.shaft.speed) if s.multipliers is None else s.multipliers.residual


@dataclass(frozen=True)
class OfJoint:
    """A function of an instant at one joint.

    It equals its copies, also of another process: programs are kept for it.
    """

    function: Callable[[Snapshot, Scene, str], Any]
    joint: str

    def __call__(self, snapshot: Snapshot, scene: Scene) -> Any:
        """The value at the joint."""
        return self.function(snapshot, scene, self.joint)


class Observable(NamedTuple):
    """A named function of an instant, a scalar or a vector."""

    function: Callable[[Snapshot, Scene], Scalar | Vector]
    unit: str
    meaning: str

    def __call__(self, snapshot: Snapshot, scene: Scene) -> Array:
        """The value, a vector as an array of shape (2,)."""
        value = self.function(snapshot, scene)
        return value.array() if isinstance(value, Vector) else value


def _at(joint: str) -> dict[str, Observable]:
    """Return the observables of a joint, with its prefix before their names."""
    return {
        before(joint) + name: Observable(
            OfJoint(function, joint), unit, f"{meaning} at {LETTERS[joint]}"
        )
        for name, function, unit, meaning in (
            ("normal_force", _normal_force, "N", "normal force"),
            ("friction_force", _friction_force, "N", "friction force"),
            ("eccentricity", _eccentricity, "m", "eccentricity of the pin"),
            ("penetration_ratio", _penetration_ratio, "1", "penetration / clearance"),
            ("penetration_rate", _penetration_rate, "m/s", "penetration rate"),
        )
    }


# Name -> function, unit and meaning of what can be observed of an instant.
OBSERVABLES = {
    **_at("main"),
    "foundation_force": Observable(foundation_force, "N", "|R_O| + |R_C|"),
    "net_foundation_force": Observable(net_foundation_force, "N", "|R_O + R_C|"),
    "shaking_force": Observable(shaking_force, "N", "shaking force"),
    "ground_force": Observable(ground_force, "N", "force on the ground"),
    "ground_moment": Observable(ground_moment, "N m", "moment on the ground"),
    "joint_force": Observable(lambda s, _: s.joint_force, "N", "force on the jaw at A"),
    "bearing_reaction": Observable(bearing_reaction, "N", "reaction R_O"),
    "elbow_reaction": Observable(elbow_reaction, "N", "reaction R_B"),
    "toggle_reaction": Observable(toggle_reaction, "N", "reaction R_C"),
    "drive_torque": Observable(drive_torque, "N m", "drive torque"),
    "drive_power": Observable(drive_power, "W", "drive power"),
    "shaft_speed": Observable(lambda s, _: s.shaft.speed, "rad/s", "shaft speed"),
    "crushing_load": Observable(_crushing_load, "N", "load on the jaw at S2"),
    "pin_position": Observable(
        lambda s, scene: pin_position(scene.machine, s.shaft.crank), "m", "centre A of the pin"
    ),
    "jaw_position": Observable(elbow_position, "m", "lower end B"),
    "jaw_mass_centre": Observable(jaw_mass_centre, "m", "mass centre S2 of the jaw"),
    "jaw_velocity": Observable(
        lambda s, scene: linkage.elbow_velocity(scene.machine, s.chain), "m/s", "velocity of B"
    ),
    "constraint_residual": Observable(_constraint_residual, "m", "largest constraint residual"),
    **_at("elbow"),
    **_at("pivot"),
}


def observables_of(scene: Scene) -> tuple[str, ...]:
    """All but those of an elbow and a pivot that are ideal."""
    absent = [joint for joint in JOINTS[1:] if scene.joints[joint] is None]
    left_out = {before(joint) + name for joint in absent for name in _at("main")}
    return tuple(name for name in OBSERVABLES if name not in left_out)

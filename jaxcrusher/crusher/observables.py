"""Observables of an instant: forces, powers, energies, as functions of a snapshot."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Scalar

from jaxcrusher.basics.plane import Vector
from jaxcrusher.basics.smooth import norm
from jaxcrusher.crusher.joints import JOINTS, LETTERS, before
from jaxcrusher.crusher.loads import JawMotion
from jaxcrusher.crusher.rod import Rod, RodPull
from jaxcrusher.crusher.scene import Scene
from jaxcrusher.files.table import Column
from jaxcrusher.joint.clearance import AbstractBearing, Contact
from jaxcrusher.mechanism.energies import kinetic_energy as kinetic_energy
from jaxcrusher.mechanism.energies import potential_energy as potential_energy
from jaxcrusher.mechanism.snapshot import FrameMotion, Snapshot
from jaxcrusher.mechanism.supports import OnSupports

# Smooths the length of a reaction (N) where it vanishes.
FORCE_WIDTH = 1e-6
# Smooths the speed of a frame (m/s) where it stands still.
SPEED_WIDTH = 1e-12


def _on_bore(s: Snapshot, scene: Scene, joint: str) -> Vector:
    """Return the force on the bore of a joint, N."""
    force = s.accelerations.forces[joint]
    assert force is not None
    return force


def _on_pin(s: Snapshot, scene: Scene, joint: str) -> Vector:
    """Return the force on the pin of a joint, N."""
    return -_on_bore(s, scene, joint)


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


# The force of the shaft on the jaw at A, of the frame on the shaft (R_O), of the toggle on the jaw
# (R_B), and of the frame on the toggle (R_C), N.
joint_force = OfJoint(_on_bore, "main")
bearing_reaction = OfJoint(_on_pin, "shaft_bearing")
elbow_reaction = OfJoint(_on_bore, "elbow")
toggle_reaction = OfJoint(_on_pin, "pivot")


def foundation_force(s: Snapshot, scene: Scene) -> Scalar:
    """|R_O| + |R_C|, N: the only definition of seven that meets the paper's numbers."""
    at_bearing = norm(bearing_reaction(s, scene), FORCE_WIDTH)
    return at_bearing + norm(toggle_reaction(s, scene), FORCE_WIDTH)


def net_foundation_force(s: Snapshot, scene: Scene) -> Scalar:
    """|R_O + R_C|, N: the length of the resultant on the foundation."""
    return norm(bearing_reaction(s, scene) + toggle_reaction(s, scene), FORCE_WIDTH)


def _total_weight(scene: Scene) -> Vector:
    """Return the weight of the three bodies, N."""
    linkage = scene.linkage
    masses = [body.mass for body in linkage.bodies.values]
    return Vector(0.0, -sum(masses[1:], masses[0]) * linkage.gravity)


def shaking_force(s: Snapshot, scene: Scene) -> Vector:
    """Return -sum of m a, N: the moving part of what shaft, jaw and toggle pass to the frame.

    The machine stands on the ground by bearing, pivot and fixed jaw. The crushing load closes
    between jaw and fixed jaw, inside the machine, and the weight stands still: neither shakes.
    """
    one, *others = (rate for _, rate in _momentum_rates(s, scene))
    total = -sum(others, one)
    return total if s.frame is None else total.along(s.frame.axis)


def _momentum_rates(s: Snapshot, scene: Scene) -> list[tuple[str, Vector]]:
    """Return mass times acceleration of each body, in the frame's axes, N."""
    linkage, rates = scene.linkage, []
    for name, body in linkage.bodies.items():
        acceleration = s.accelerations.centres[name]
        assert acceleration is not None
        rates.append((name, body.mass * acceleration))
    return rates


def shaking_size(s: Snapshot, scene: Scene) -> Scalar:
    """Return the length of the shaking force, N."""
    return norm(shaking_force(s, scene), FORCE_WIDTH)


def ground_force(s: Snapshot, scene: Scene) -> Vector:
    """Return the force of shaft, jaw and toggle on the frame, N: their weight less sum of m a.

    A clamped frame passes it to the ground. It equals -(R_O + R_C) less the load on the jaw, whose
    reaction the fixed jaw carries.
    """
    return shaking_force(s, scene) + _total_weight(scene)


def ground_moment(s: Snapshot, scene: Scene) -> Scalar:
    """Return the moment of shaft, jaw and toggle on the frame, N m, about the foundation's point.

    Each body adds (r - p) x m (g - a) - J alpha; without a foundation p is C. The load and its
    reaction on the fixed jaw lie in one line and add nothing, nor does a drive that stands on the
    frame.
    """
    point = Vector(0.0, 0.0) if scene.foundation is None else scene.foundation.point
    fall = Vector(0.0, -scene.linkage.gravity)
    fall = fall if s.frame is None else fall.seen_from(s.frame.axis)
    total = jnp.zeros_like(s.motion.crank.speed)
    for name, rate in _momentum_rates(s, scene):
        body, spin_up = scene.linkage.body(name), s.accelerations.spin_ups[name]
        assert spin_up is not None
        force = body.mass * fall - rate
        total = total + (s.motion.centre(name) - point).cross(force) - body.inertia * spin_up
    return total


def drive_torque(s: Snapshot, scene: Scene) -> Scalar:
    """M0, counterclockwise on the shaft, N m."""
    return s.accelerations.torque


def drive_power(s: Snapshot, scene: Scene) -> Scalar:
    """M0 times the shaft's speed, W."""
    return drive_torque(s, scene) * s.motion.crank.speed


def load_power(s: Snapshot, scene: Scene) -> Scalar:
    """The power of the crushing load, W."""
    load = s.applied.load
    if load is None:
        return jnp.zeros_like(s.motion.crank.speed)
    return load.force.dot(JawMotion(s.motion).velocity(load.along))


def load_position(s: Snapshot, scene: Scene) -> Vector:
    """Where the crushing load acts on the jaw, m; S2 where there is none."""
    along = None if s.applied.load is None else s.applied.load.along
    return JawMotion(s.motion).position(along)


def contact_loss(s: Snapshot, scene: Scene) -> Scalar:
    """Power dissipated by the damping of the contact, W."""
    return _over_joints(lambda _, contact: contact.normal_loss, s, scene)


def friction_loss(s: Snapshot, scene: Scene) -> Scalar:
    """Power dissipated by friction, W; may be negative where slip is that of the centres."""
    return _over_joints(lambda _, contact: contact.friction_loss, s, scene)


def elbow_position(s: Snapshot, scene: Scene) -> Vector:
    """B, the jaw's lower end, m; C is the origin."""
    return s.motion.position(scene.linkage.joint("elbow").bore)


def elbow_velocity(s: Snapshot, scene: Scene) -> Vector:
    """Return the velocity of B, the jaw's lower end, m/s."""
    return s.motion.velocity(scene.linkage.joint("elbow").bore)


def pin_position(s: Snapshot, scene: Scene) -> Vector:
    """Return the centre A of the shaft's pin, m."""
    return s.motion.position(scene.linkage.joint("main").pin)


def jaw_mass_centre(s: Snapshot, scene: Scene) -> Vector:
    """S2, m."""
    return s.motion.centre("jaw")


def elastic_energy(s: Snapshot, scene: Scene) -> Scalar:
    """Stored in the contacts, in the rod and in the springs of the supports, J."""
    stored = _over_joints(AbstractBearing.elastic_energy, s, scene)
    if s.applied.rod is not None and scene.rod is not None:
        stored = stored + scene.rod.elastic_energy(s.applied.rod)
    if s.frame is None or scene.supports is None:
        return stored
    return stored + scene.supports.elastic_energy(s.frame)


def support_loss(s: Snapshot, scene: Scene) -> Scalar:
    """Power that the dampers of the supports take, W; ValueError for a clamped frame."""
    frame, foundation = _on_supports(s, scene, "support_loss")
    return foundation.loss(frame)


def _pull(s: Snapshot, scene: Scene, name: str) -> tuple[RodPull, Rod]:
    """Return what the tension rod does, and the rod."""
    if s.applied.rod is None or scene.rod is None:
        raise ValueError(f"Argument `outputs` must not ask for {name} without a rod, but does.")
    return s.applied.rod, scene.rod


def rod_tension(s: Snapshot, scene: Scene) -> Scalar:
    """Return the tension of the rod, N; ValueError without one."""
    return _pull(s, scene, "rod_tension")[0].tension


def rod_margin(s: Snapshot, scene: Scene) -> Scalar:
    """Return the tension that a rod would have that can push, N: it is slack where negative."""
    return _pull(s, scene, "rod_margin")[0].wanted


def rod_loss(s: Snapshot, scene: Scene) -> Scalar:
    """Power that the damper of the rod takes, W; ValueError without one."""
    pull, rod = _pull(s, scene, "rod_loss")
    return rod.loss(pull)


def _on_supports(s: Snapshot, scene: Scene, name: str) -> tuple[FrameMotion, OnSupports]:
    """Return the frame's motion and its supports."""
    if s.frame is None or scene.supports is None:
        raise ValueError(
            f"Argument `outputs` must not ask for {name} of a clamped frame, but does."
        )
    return s.frame, scene.supports


def left_force(s: Snapshot, scene: Scene) -> Vector:
    """Return the force of the left support on the ground, N."""
    frame, foundation = _on_supports(s, scene, "left_force")
    return foundation.support_forces(frame)[0]


def right_force(s: Snapshot, scene: Scene) -> Vector:
    """Return the force of the right support on the ground, N."""
    frame, foundation = _on_supports(s, scene, "right_force")
    return foundation.support_forces(frame)[1]


def transmitted_force(s: Snapshot, scene: Scene) -> Vector:
    """Return the force of both supports on the ground, N."""
    frame, foundation = _on_supports(s, scene, "transmitted_force")
    left, right = foundation.support_forces(frame)
    return left + right


def frame_displacement(s: Snapshot, scene: Scene) -> Vector:
    """Return the displacement of G from where the frame is drawn, m."""
    return _on_supports(s, scene, "frame_displacement")[0].displacement


def frame_velocity(s: Snapshot, scene: Scene) -> Vector:
    """Return the velocity of G, m/s."""
    return _on_supports(s, scene, "frame_velocity")[0].velocity


def transmitted_size(s: Snapshot, scene: Scene) -> Scalar:
    """Return the length of what moves of the force on the ground, N: all but the weight."""
    _, foundation = _on_supports(s, scene, "transmitted_force")
    weight = Vector(0.0, -foundation.mass * scene.machine.gravity) + _total_weight(scene)
    return norm(transmitted_force(s, scene) - weight, FORCE_WIDTH)


def left_size(s: Snapshot, scene: Scene) -> Scalar:
    """Return the length of the force of the left support, N."""
    return norm(left_force(s, scene), FORCE_WIDTH)


def right_size(s: Snapshot, scene: Scene) -> Scalar:
    """Return the length of the force of the right support, N."""
    return norm(right_force(s, scene), FORCE_WIDTH)


def frame_speed(s: Snapshot, scene: Scene) -> Scalar:
    """Return the speed of G, m/s."""
    return norm(frame_velocity(s, scene), SPEED_WIDTH)


def frame_rotation(s: Snapshot, scene: Scene) -> Scalar:
    """Return the rotation of the frame, rad."""
    return _on_supports(s, scene, "frame_rotation")[0].rotation


def _over_joints(
    part: Callable[[AbstractBearing, Contact], Scalar | None], s: Snapshot, scene: Scene
) -> Scalar:
    """The sum of a number of each contact; zero where there is none."""
    known: list[Scalar] = list(scene.joints.map(part, s.contacts).values)
    return sum(known[1:], known[0]) if known else jnp.zeros_like(s.motion.crank.speed)


def force_at(s: Snapshot, scene: Scene, joint: str) -> Scalar:
    """The length of the force in a joint, N."""
    return norm(_on_bore(s, scene, joint), FORCE_WIDTH)


def _normal_force(s: Snapshot, scene: Scene, joint: str) -> Scalar:
    contact = s.contacts[joint]
    return force_at(s, scene, joint) if contact is None else contact.normal_force


def _friction_force(s: Snapshot, scene: Scene, joint: str) -> Scalar:
    contact = s.contacts[joint]
    force = None if contact is None else contact.friction_force
    return jnp.zeros_like(s.motion.crank.speed) if force is None else force


def _eccentricity(s: Snapshot, scene: Scene, joint: str) -> Vector:
    eccentricity = s.motion.eccentricities[joint]
    return Vector(0.0, 0.0) if eccentricity is None else eccentricity


def _crushing_load(s: Snapshot, scene: Scene) -> Vector:
    return Vector(0.0, 0.0) if s.applied.load is None else s.applied.load.force


def _penetration_ratio(s: Snapshot, scene: Scene, joint: str) -> Scalar:
    contact, clearance = s.contacts[joint], scene.joints[joint]
    if contact is None:
        return jnp.zeros_like(s.motion.crank.speed)
    return contact.penetration / clearance.clearance


def _penetration_rate(s: Snapshot, scene: Scene, joint: str) -> Scalar:
    contact = s.contacts[joint]
    return jnp.zeros_like(s.motion.crank.speed) if contact is None else contact.penetration_rate


def _constraint_residual(s: Snapshot, scene: Scene) -> Scalar:
    return jnp.zeros_like(s.motion.crank.speed) if s.residual is None else s.residual


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


# What only a frame on supports has; x to the right and y up, in the ground's axes.
OF_SUPPORTS = {
    "left_force": Observable(left_force, "N", "force of the left support on the ground"),
    "right_force": Observable(right_force, "N", "force of the right support on the ground"),
    "transmitted_force": Observable(transmitted_force, "N", "force of the supports on the ground"),
    "frame_displacement": Observable(frame_displacement, "m", "displacement of the frame's G"),
    "frame_velocity": Observable(frame_velocity, "m/s", "velocity of the frame's G"),
    "frame_rotation": Observable(frame_rotation, "rad", "rotation of the frame"),
}

OF_ROD = {"rod_tension": Observable(rod_tension, "N", "tension of the rod")}

# Name -> function, unit and meaning of what can be observed of an instant.
OBSERVABLES = {
    **_at("main"),
    "foundation_force": Observable(foundation_force, "N", "|R_O| + |R_C|"),
    "net_foundation_force": Observable(net_foundation_force, "N", "|R_O + R_C|"),
    "shaking_force": Observable(shaking_force, "N", "shaking force"),
    "ground_force": Observable(ground_force, "N", "force on the ground"),
    "ground_moment": Observable(ground_moment, "N m", "moment on the ground"),
    "joint_force": Observable(joint_force, "N", "force on the jaw at A"),
    "bearing_reaction": Observable(bearing_reaction, "N", "reaction R_O"),
    "elbow_reaction": Observable(elbow_reaction, "N", "reaction R_B"),
    "toggle_reaction": Observable(toggle_reaction, "N", "reaction R_C"),
    "drive_torque": Observable(drive_torque, "N m", "drive torque"),
    "drive_power": Observable(drive_power, "W", "drive power"),
    "shaft_speed": Observable(lambda s, _: s.motion.crank.speed, "rad/s", "shaft speed"),
    "crushing_load": Observable(_crushing_load, "N", "crushing load on the jaw"),
    "load_position": Observable(load_position, "m", "where the load acts on the jaw"),
    "pin_position": Observable(pin_position, "m", "centre A of the pin"),
    "jaw_position": Observable(elbow_position, "m", "lower end B"),
    "jaw_mass_centre": Observable(jaw_mass_centre, "m", "mass centre S2 of the jaw"),
    "jaw_velocity": Observable(elbow_velocity, "m/s", "velocity of B"),
    "constraint_residual": Observable(_constraint_residual, "m", "largest constraint residual"),
    **_at("elbow"),
    **_at("pivot"),
    **_at("shaft_bearing"),
    **OF_SUPPORTS,
    **OF_ROD,
}


def columns(values: Mapping[str, Any]) -> dict[str, Column]:
    """Return the columns of observables in a table; vectors have the dim `direction`."""
    return {
        name: Column(of.unit, of.meaning, dims=("direction",)[: np.ndim(values[name]) - 1])
        for name, of in OBSERVABLES.items()
        if name in values
    }


def observables_of(scene: Scene) -> tuple[str, ...]:
    """All but those of ideal elbow and pivot, and of supports and a rod that are not there."""
    absent = [joint for joint in JOINTS[1:] if scene.joints[joint] is None]
    left_out = {before(joint) + name for joint in absent for name in _at("main")}
    left_out |= set() if scene.supports else set(OF_SUPPORTS)
    left_out |= set() if scene.rod else set(OF_ROD)
    return tuple(name for name in OBSERVABLES if name not in left_out)

"""Everything known of one instant of the motion: positions, velocities, accelerations, forces."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import PyTree, Scalar

from jaxcrusher.basics.plane import Vector, direction, optional_scalar
from jaxcrusher.crusher import linkage
from jaxcrusher.crusher.joints import AtJoints
from jaxcrusher.crusher.linkage import AtJaw, Chain, ChainAcceleration, InertialForces, Play
from jaxcrusher.crusher.machine import Jaw, Machine, Shaft, Toggle
from jaxcrusher.joint.clearance import Contact


class ShaftMotion(eqx.Module):
    """The shaft: angle since time zero (rad), crank direction O-A, speed (rad/s), acceleration."""

    angle: Scalar
    crank: Vector
    speed: Scalar
    acceleration: Scalar | None  # rad/s2; None: zero


class FrameMotion(eqx.Module):
    """A frame on supports: motion of its mass centre in the ground's axes, and of its angle."""

    displacement: Vector  # from where it is drawn, m
    rotation: Scalar  # rad
    axis: Vector  # unit vector of its x axis
    velocity: Vector  # m/s
    spin: Scalar  # rad/s
    acceleration: Vector | None = None  # m/s2; None: not known yet
    spin_up: Scalar | None = None  # rad/s2


class Multipliers(eqx.Module):
    """Lagrange multipliers of the constraints (13), with the signs of (16); N and N m."""

    bearing: Vector
    elbow: Vector | None  # None: loose
    toggle_pivot: Vector | None
    drive: Scalar | None
    residual: Scalar  # largest |Phi|, m or rad
    acceleration: PyTree[Scalar]  # q'' of the formulation's coordinates


class JawForce(eqx.Module):
    """A force on the jaw, and how far from A towards B its line meets the jaw's axis."""

    force: Vector  # N
    along: Scalar | None = eqx.field(converter=optional_scalar, default=None)  # m; None: at S2


class RodPull(eqx.Module):
    """What the tension rod does to the jaw; its other end pulls at the frame by the opposite."""

    force: Vector  # on the jaw, N
    arm: Vector  # of its end on the jaw, from S2, m
    tension: Scalar  # N
    wanted: Scalar  # N, negative where the rod is slack
    stretch: Scalar  # L - L0, m
    rate: Scalar  # m/s


class Applied(eqx.Module):
    """Forces on the jaw by their source, None where there is none, and their sum at S2."""

    load: JawForce | None
    rod: RodPull | None
    total: AtJaw | None


class Snapshot(eqx.Module):
    """One instant; `joint_force` (N) and the moments (N m) act at the main joint A.

    What is at a joint is None where that is ideal. All is relative to the frame and in its axes,
    except `frame` itself, which is None where the frame is clamped.
    """

    shaft: ShaftMotion
    chain: Chain
    chain_acceleration: ChainAcceleration
    contacts: AtJoints[Contact]
    eccentricities: Play  # m
    joint_force: Vector  # on the jaw, at A
    jaw_moment: Scalar | None
    shaft_moment: Scalar | None
    applied: Applied  # on the jaw
    multipliers: Multipliers | None
    frame: FrameMotion | None = None
    inertial: InertialForces | None = None

    @property
    def load(self) -> Vector | None:
        """Return the crushing load on the jaw, N."""
        return None if self.applied.load is None else self.applied.load.force


def pin_position(machine: Machine, crank: Vector) -> Vector:
    """The centre of the shaft's pin, A_shaft, m."""
    return machine.bearing + machine.shaft.eccentricity * crank


def crank_motion(angle: Scalar, speed: Scalar) -> ShaftMotion:
    """The shaft at `angle` (rad), its acceleration still unknown or zero."""
    return ShaftMotion(angle, direction(angle), speed, None)


def pin_velocity(machine: Machine, shaft: ShaftMotion) -> Vector:
    """The velocity of the pin's centre, m/s."""
    return machine.shaft.eccentricity * shaft.speed * shaft.crank.perp()


def chain_of(machine: Machine, shaft: ShaftMotion, e: Play, rate: Play) -> Chain:
    """Toggle and jaw, from the shaft and the eccentricities with their rates."""
    a, velocity = pin_position(machine, shaft.crank), pin_velocity(machine, shaft)
    if e.main is not None and rate.main is not None:
        a, velocity = a - e.main, velocity - rate.main
    return linkage.assemble(machine, a, velocity, e, rate)


def pin_acceleration(machine: Machine, shaft: ShaftMotion) -> Vector:
    """The acceleration of the pin's centre, m/s2."""
    return machine.shaft.eccentricity * linkage.turning(
        shaft.crank, shaft.speed, shaft.acceleration
    )


def shaft_inertia(machine: Machine) -> Scalar:
    """The shaft's moment of inertia about O, kg m2."""
    centre = machine.shaft.mass_centre
    return machine.shaft.inertia + machine.shaft.mass * centre.dot(centre)


def moment_on_shaft(
    machine: Machine,
    crank: Vector,
    joint_force: Vector,
    shaft_moment: Scalar | None,
    inertial: InertialForces | None = None,
) -> Scalar:
    """The moment about O of gravity and of the joint's reaction, without the drive, N m."""
    reaction = -(machine.shaft.eccentricity * crank).cross(joint_force)
    centre = machine.shaft.mass_centre.along(crank)
    total = reaction - machine.shaft.mass * machine.gravity * centre.x
    if inertial is not None:
        total = total + centre.cross(inertial.shaft.force) + inertial.shaft.moment
    return total if shaft_moment is None else total + shaft_moment


def bodies_of(machine: Machine) -> tuple[Shaft, Jaw, Toggle]:
    """Shaft, jaw and toggle, in the order of the functions below."""
    return machine.shaft, machine.jaw, machine.toggle


def mass_centres(machine: Machine, shaft: ShaftMotion, chain: Chain) -> tuple[Vector, ...]:
    """S1, S2 and S3, m."""
    return (
        machine.bearing + machine.shaft.mass_centre.along(shaft.crank),
        linkage.elbow_position(machine, chain) + linkage.mass_centre_arm(machine, chain),
        linkage.toggle_centre(machine, chain),
    )


def mass_centre_velocities(
    machine: Machine, shaft: ShaftMotion, chain: Chain
) -> tuple[Vector, ...]:
    """The velocities of S1, S2 and S3, m/s."""
    return (
        shaft.speed * machine.shaft.mass_centre.along(shaft.crank).perp(),
        linkage.mass_centre_velocity(machine, chain),
        linkage.toggle_centre_velocity(machine, chain),
    )


def momentum_rates(machine: Machine, s: Snapshot) -> tuple[Vector, ...]:
    """Mass times acceleration of shaft, jaw and toggle, N."""
    centre = machine.shaft.mass_centre.along(s.shaft.crank)
    shaft = linkage.turning(centre, s.shaft.speed, s.shaft.acceleration)
    jaw = linkage.mass_centre_acceleration(machine, s.chain, s.chain_acceleration)
    toggle = linkage.toggle_centre_acceleration(machine, s.chain, s.chain_acceleration)
    return machine.shaft.mass * shaft, machine.jaw.mass * jaw, machine.toggle.mass * toggle


def forces_on_frame(machine: Machine, s: Snapshot) -> tuple[Vector, ...]:
    """Return the forces of shaft, jaw and toggle on the frame, each as if alone, N.

    The load and its reaction are inside, whatever it is. All three act at the mass centres.
    """
    found = []
    for body, rate in zip(bodies_of(machine), momentum_rates(machine, s), strict=True):
        found.append(Vector(0.0, -body.mass * machine.gravity) - rate)
    if s.inertial is None:
        return tuple(found)
    return tuple(one + added.force for one, added in zip(found, s.inertial.all(), strict=True))


def moment_on_frame(
    machine: Machine, s: Snapshot, forces: tuple[Vector, ...], point: Vector
) -> Scalar:
    """The moment about a point (m) of what the three bodies pass to the frame, N m.

    `forces` are those of `forces_on_frame`. A drive that stands on the frame adds nothing, as its
    reaction is the frame's too.
    """
    places = mass_centres(machine, s.shaft, s.chain)
    turning = s.shaft.acceleration, s.chain_acceleration.jaw, s.chain_acceleration.toggle
    total = jnp.zeros_like(s.shaft.speed)
    for place, force in zip(places, forces, strict=True):
        total = total + (place - point).cross(force)
    for body, spin_up in zip(bodies_of(machine), turning, strict=True):
        total = total if spin_up is None else total - body.inertia * spin_up
    return total if s.inertial is None else total + sum(one.moment for one in s.inertial.all())

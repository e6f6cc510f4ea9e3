"""Everything known of one instant of the motion: positions, velocities, accelerations, forces."""

import equinox as eqx
from jaxtyping import PyTree, Scalar

from jaxcrusher.basics.plane import Vector, direction
from jaxcrusher.crusher import linkage
from jaxcrusher.crusher.joints import AtJoints
from jaxcrusher.crusher.linkage import Chain, ChainAcceleration, Play
from jaxcrusher.crusher.machine import Machine
from jaxcrusher.joint.clearance import Contact


class ShaftMotion(eqx.Module):
    """The shaft: crank direction O-A, speed (rad/s), acceleration (rad/s2; None: zero)."""

    crank: Vector
    speed: Scalar
    acceleration: Scalar | None


class Multipliers(eqx.Module):
    """Lagrange multipliers of the constraints (13), with the signs of (16); N and N m."""

    bearing: Vector
    elbow: Vector | None  # None: loose
    toggle_pivot: Vector | None
    drive: Scalar | None
    residual: Scalar  # largest |Phi|, m or rad
    acceleration: PyTree[Scalar]  # q'' of the formulation's coordinates


class Snapshot(eqx.Module):
    """One instant; `joint_force` (N) and the moments (N m) act at the main joint A.

    What is at a joint is None where that is ideal.
    """

    shaft: ShaftMotion
    chain: Chain
    chain_acceleration: ChainAcceleration
    contacts: AtJoints[Contact]
    eccentricities: Play  # m
    joint_force: Vector  # on the jaw, at A
    jaw_moment: Scalar | None
    shaft_moment: Scalar | None
    load: Vector | None  # on the jaw, at S2
    multipliers: Multipliers | None


def pin_position(machine: Machine, crank: Vector) -> Vector:
    """The centre of the shaft's pin, A_shaft, m."""
    return machine.bearing + machine.shaft.eccentricity * crank


def crank_motion(angle: Scalar, speed: Scalar) -> ShaftMotion:
    """The shaft at `angle` (rad), its acceleration still unknown or zero."""
    return ShaftMotion(direction(angle), speed, None)


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
    machine: Machine, crank: Vector, joint_force: Vector, shaft_moment: Scalar | None
) -> Scalar:
    """The moment about O of gravity and of the joint's reaction, without the drive, N m."""
    reaction = -(machine.shaft.eccentricity * crank).cross(joint_force)
    centre = machine.shaft.mass_centre.along(crank)
    total = reaction - machine.shaft.mass * machine.gravity * centre.x
    return total if shaft_moment is None else total + shaft_moment

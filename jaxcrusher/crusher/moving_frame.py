"""The motion of a frame on supports, with whatever mechanism stands in it.

The mechanism is written in the frame's axes. A frame that moves adds inertial forces to its bodies:
with p from G to a body's mass centre, A the acceleration of G and phi the rotation, all in the
frame's axes, m (g - A - phi'' perp(p) + phi'^2 p - 2 phi' perp(rho')) replaces its weight, and
-J phi'' is its moment. Accelerations of the mechanism are linear in A and phi''. So Newton's and
Euler's equations of the frame are three linear ones for these, whatever formulation solves for the
mechanism: what it passes to the frame at rest and for a unit of each makes their matrix.
"""

import dataclasses
from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.lax import stop_gradient
from jaxtyping import Scalar

from jaxcrusher.basics.linear import solve_positive_definite
from jaxcrusher.basics.plane import Vector
from jaxcrusher.crusher.foundation import OnSupports, frame_at
from jaxcrusher.crusher.interfaces import AbstractScene
from jaxcrusher.crusher.linkage import Chain, InertialForces, Wrench
from jaxcrusher.crusher.snapshot import (
    FrameMotion,
    ShaftMotion,
    Snapshot,
    bodies_of,
    chain_of,
    crank_motion,
    forces_on_frame,
    mass_centre_velocities,
    mass_centres,
    moment_on_frame,
)

# Unit of a displacement on springs that do not give way, in eccentricities.
LEAST = 1e-6


class FrameState(eqx.Module):
    """State of a frame on supports, scaled to order one by `FrameUnits`."""

    displacement: Vector  # of G from where all weight would push it straight down
    rotation: Scalar
    velocity: Vector  # m/s
    spin: Scalar  # at the radius of gyration, m/s


class FrameUnits(eqx.Module):
    """Units of the coordinates of a frame: what its state is counted in."""

    x: Scalar  # m
    y: Scalar  # m
    angle: Scalar  # rad
    radius: Scalar  # of gyration, m
    sag: Scalar  # by which springs give way straight down under all weight, m

    def state(self, frame: FrameMotion) -> FrameState:
        """Return the state of a motion."""
        moved = Vector(frame.displacement.x / self.x, (frame.displacement.y + self.sag) / self.y)
        rotation = frame.rotation / self.angle
        return FrameState(moved, rotation, frame.velocity, self.radius * frame.spin)

    def motion(self, state: FrameState) -> FrameMotion:
        """Return the motion of a state, without accelerations."""
        moved = Vector(self.x * state.displacement.x, self.y * state.displacement.y - self.sag)
        spin = state.spin / self.radius
        return frame_at(moved, self.angle * state.rotation, state.velocity, spin)


def frame_units(scene: AbstractScene) -> FrameUnits:
    """Return units in which a frame moves by numbers of order one, stiff or soft, light or heavy.

    The unit of a displacement is the eccentricity over 1 + (natural / running frequency)^2, and a
    millionth of it more: so that the tolerance of an orbit stays above rounding where springs are
    stiffer still. Units are no part of the model and have no slopes.
    """
    foundation, speed = scene.supports, scene.drive.speed
    assert foundation is not None
    throw = scene.machine.shaft.eccentricity
    horizontal, vertical = foundation.horizontal_stiffness, foundation.vertical_stiffness

    def unit(stiffness: Scalar, inertia: Scalar) -> Scalar:
        return throw * (LEAST + 1 / (1 + stiffness / (inertia * speed**2)))

    radius = jnp.sqrt(foundation.inertia / foundation.mass)
    units = FrameUnits(
        unit(2 * horizontal, foundation.mass),
        unit(2 * vertical, foundation.mass),
        unit(foundation.rotational_stiffness(), foundation.inertia) / radius,
        radius,
        _weight(scene) / (2 * vertical),
    )
    return stop_gradient(units)


def _weight(scene: AbstractScene) -> Scalar:
    """Return the weight of frame, shaft, jaw and toggle, N."""
    foundation, machine = scene.supports, scene.machine
    assert foundation is not None
    return machine.gravity * sum((body.mass for body in bodies_of(machine)), foundation.mass)


def initial_frame(scene: AbstractScene) -> FrameState | None:
    """Return the frame at rest where its supports carry all weight, or None if it is clamped.

    The shaft is at angle zero, its pins are in the middle of their bores. Rotations are small here.
    """
    foundation, machine = scene.supports, scene.machine
    if foundation is None:
        return None
    still = jnp.zeros_like(scene.drive.speed)
    shaft = crank_motion(still, still)
    chain = chain_of(machine, shaft, *(scene.joints.map(lambda _: Vector(0.0, 0.0)),) * 2)
    moment = still
    for body, place in zip(bodies_of(machine), mass_centres(machine, shaft, chain), strict=True):
        moment = moment - body.mass * machine.gravity * (place.x - foundation.point.x)
    (left, right), rigid = foundation.arms(), {}
    horizontal, vertical = foundation.horizontal_stiffness, foundation.vertical_stiffness
    rigid[0, 0], rigid[1, 1] = 2 * horizontal, 2 * vertical
    rigid[2, 0], rigid[2, 1] = -horizontal * (left.y + right.y), vertical * (left.x + right.x)
    rigid[2, 2] = foundation.rotational_stiffness()
    x, y, angle = solve_positive_definite(rigid, [still, -_weight(scene), moment])
    frame = frame_at(Vector(x, y), angle, Vector(still, still), still)
    return frame_units(scene).state(frame)


def frame_rate(frame: FrameMotion | None, scene: AbstractScene) -> FrameState | None:
    """Return the time derivative of the frame's state, or None if it is clamped."""
    if frame is None:
        return None
    units = frame_units(scene)
    assert frame.acceleration is not None and frame.spin_up is not None
    velocity = Vector(frame.velocity.x / units.x, frame.velocity.y / units.y)
    turning = frame.spin / units.angle, units.radius * frame.spin_up
    return FrameState(velocity, turning[0], frame.acceleration, turning[1])


def with_frame(
    scene: AbstractScene,
    state: FrameState | None,
    shaft: ShaftMotion,
    chain: Chain,
    mechanism: Callable[[InertialForces | None], Snapshot],
) -> Snapshot:
    """Return an instant of the mechanism in its frame, clamped or on supports.

    `mechanism` solves for the accelerations under given inertial forces, in which it is linear.
    """
    foundation, machine = scene.supports, scene.machine
    if foundation is None or state is None:
        return mechanism(None)
    frame = frame_units(scene).motion(state)
    own, turned = _on_frame(foundation, frame, machine.gravity)
    under = _inertial(scene, frame, shaft, chain)

    def residual(*unknown: Scalar) -> list[Scalar]:
        now = under(*unknown)
        now = dataclasses.replace(mechanism(now), inertial=now)
        forces = forces_on_frame(machine, now)
        moment = moment_on_frame(machine, now, forces, foundation.point) + turned
        left = foundation.mass * Vector(*unknown[:2]) - sum(forces, own)
        return [left.x, left.y, foundation.inertia * unknown[2] - moment]

    zero, one = jnp.zeros_like(shaft.speed), jnp.ones_like(shaft.speed)
    at_rest, linear = jax.linearize(residual, zero, zero, zero)

    def column(i: int) -> list[Scalar]:
        def along(unknown: Scalar) -> list[Scalar]:
            return linear(*(unknown if k == i else zero for k in range(3)))

        # By its derivative, which has no terms of the other two unknowns.
        return jax.jvp(along, (zero,), (one,))[1]

    columns = [column(i) for i in range(3)]
    # The matrix is symmetric: what the frame feels of the mechanism's inertia.
    lower = {(i, j): columns[j][i] for i in range(3) for j in range(i + 1)}
    a_x, a_y, spin_up = solve_positive_definite(lower, [-one for one in at_rest])
    inertial = under(a_x, a_y, spin_up)
    acceleration = Vector(a_x, a_y).along(frame.axis)
    moving = dataclasses.replace(frame, acceleration=acceleration, spin_up=spin_up)
    return dataclasses.replace(mechanism(inertial), frame=moving, inertial=inertial)


def _on_frame(foundation: OnSupports, frame: FrameMotion, gravity: Scalar) -> tuple[Vector, Scalar]:
    """Return force (N, in the frame's axes) and moment (N m, about G) of supports and weight."""
    force, moment = Vector(0.0, -foundation.mass * gravity), jnp.zeros_like(frame.spin)
    for arm, on_ground in zip(foundation.arms(), foundation.support_forces(frame), strict=True):
        force = force - on_ground
        moment = moment - arm.along(frame.axis).cross(on_ground)
    return force.seen_from(frame.axis), moment


def _inertial(
    scene: AbstractScene, frame: FrameMotion, shaft: ShaftMotion, chain: Chain
) -> Callable[[Scalar, Scalar, Scalar], InertialForces]:
    """Return what the frame's motion adds to the bodies, as a function of its accelerations.

    These are the two of G, in the frame's axes, and that of the rotation.
    """
    machine, foundation = scene.machine, scene.supports
    assert foundation is not None
    upright = Vector(0.0, -machine.gravity)
    lean = upright.seen_from(frame.axis) - upright
    places = mass_centres(machine, shaft, chain)
    rates = mass_centre_velocities(machine, shaft, chain)
    arms = [place - foundation.point for place in places]
    felt = [
        lean + frame.spin**2 * arm - 2 * frame.spin * rate.perp()
        for arm, rate in zip(arms, rates, strict=True)
    ]

    def under(a_x: Scalar, a_y: Scalar, spin_up: Scalar) -> InertialForces:
        found = [
            Wrench(
                body.mass * (steady - Vector(a_x, a_y) - spin_up * arm.perp()),
                -body.inertia * spin_up,
            )
            for body, arm, steady in zip(bodies_of(machine), arms, felt, strict=True)
        ]
        return InertialForces(*found)

    return under

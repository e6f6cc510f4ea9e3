"""The paper's formulation: nine coordinates, multipliers, Baumgarte's stabilisation, (13)-(20).

q = (S1, theta1, S2, theta2, S3, theta3), theta3 clockwise. (13) lacks the drive's row, added
here; the first term of (15) is (Phi_q q')_q q'; and the contact acts with its moments, which
(19) omits.
"""

import functools

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Scalar

from jaxcrusher.basics.linear import SparseRow, solve_constrained
from jaxcrusher.basics.plane import Vector, direction, scalar
from jaxcrusher.crusher import linkage
from jaxcrusher.crusher.drives import from_nearest_turn
from jaxcrusher.crusher.formulations.eccentricity import clearance_joint
from jaxcrusher.crusher.interfaces import AbstractFormulation, AbstractScene
from jaxcrusher.crusher.linkage import Chain, ChainAcceleration
from jaxcrusher.crusher.machine import Machine
from jaxcrusher.crusher.snapshot import (
    Multipliers,
    ShaftMotion,
    Snapshot,
    pin_position,
    pin_velocity,
)

# The unit of time of the velocities in the state: as long as a contact, so that the error
# of a velocity weighs as much as that of the position it leads to.
CONTACT_TIME = 1e-4  # s


class Body(eqx.Module):
    """Mass centre (m) and angle (rad), or their derivatives."""

    centre: Vector
    angle: Scalar

    def __mul__(self, factor) -> "Body":
        return Body(self.centre * factor, self.angle * factor)


class Coordinates(eqx.Module):
    """q of the paper, or a derivative of it."""

    shaft: Body
    jaw: Body
    toggle: Body

    def __mul__(self, factor) -> "Coordinates":
        return Coordinates(self.shaft * factor, self.jaw * factor, self.toggle * factor)

    def entries(self) -> list[Scalar]:
        """The nine scalars in the paper's order."""
        bodies = (self.shaft, self.jaw, self.toggle)
        return [entry for b in bodies for entry in (b.centre.x, b.centre.y, b.angle)]


def from_entries(q: list[Scalar]) -> Coordinates:
    """The inverse of `Coordinates.entries`."""
    return Coordinates(*(Body(Vector(q[i], q[i + 1]), q[i + 2]) for i in (0, 3, 6)))


class MultiplierState(eqx.Module):
    """q (m, rad), and q' in units per CONTACT_TIME."""

    position: Coordinates
    velocity: Coordinates
    impact_velocity: Scalar | None  # the normal law's memory, m/s


class _Arms(eqx.Module):
    """Where things are, from the three angles; m."""

    crank: Vector  # unit vector O-A
    shaft: Vector  # S1 from O
    jaw_axis: Vector  # unit vector B-A
    jaw: Vector  # S2 from B
    toggle_axis: Vector  # unit vector C-B


def _arms(machine: Machine, q: Coordinates) -> _Arms:
    crank = direction(q.shaft.angle)
    jaw_axis = direction(q.jaw.angle).perp()
    return _Arms(
        crank,
        machine.shaft.mass_centre.along(crank),
        jaw_axis,
        machine.jaw.length * jaw_axis + machine.jaw.mass_centre.along(jaw_axis),
        direction(-q.toggle.angle),
    )


class MultiplierFormulation(AbstractFormulation):
    """The index-1 equations (20); Baumgarte's alpha and beta in 1/s, 20 each in Table 2."""

    alpha: Scalar = eqx.field(converter=scalar, default=20.0)
    beta: Scalar = eqx.field(converter=scalar, default=20.0)

    def initial(self, scene: AbstractScene) -> MultiplierState:
        """The scene's start, on the constraints to rounding."""
        machine, (joint, start) = scene.machine, clearance_joint(scene)
        angle, speed = scene.drive.motion(scalar(0.0), scene.drive.initial())
        shaft = ShaftMotion(direction(angle), speed, None)
        eccentricity, rate = start.eccentricity(scene)
        chain = linkage.assemble(
            machine,
            pin_position(machine, shaft.crank) - eccentricity,
            pin_velocity(machine, shaft) - rate,
        )
        arm = linkage.mass_centre_arm(machine, chain)
        elbow = machine.toggle.length * chain.toggle
        centre = machine.shaft.mass_centre.along(shaft.crank)
        jaw_angle = jnp.arctan2(-chain.jaw.x, chain.jaw.y)
        toggle_angle = jnp.arctan2(-chain.toggle.y, chain.toggle.x)
        position = Coordinates(
            Body(machine.bearing + centre, angle),
            Body(elbow + arm, jaw_angle),
            Body(elbow / 2, toggle_angle),
        )
        velocity = Coordinates(
            Body(speed * centre.perp(), speed),
            Body(linkage.mass_centre_velocity(machine, chain), chain.jaw_spin),
            Body(linkage.elbow_velocity(machine, chain) / 2, -chain.toggle_spin),
        )
        memory = joint.normal.impact_velocity.initial()
        return MultiplierState(position, velocity * CONTACT_TIME, memory)

    def snapshot(self, time: Scalar, state: MultiplierState, scene: AbstractScene) -> Snapshot:
        """Solve (20) for the accelerations and the multipliers."""
        machine, (joint, _) = scene.machine, clearance_joint(scene)
        q, velocity = state.position, state.velocity * (1 / CONTACT_TIME)
        arms = _arms(machine, q)
        pin_arm = machine.shaft.eccentricity * arms.crank - arms.shaft  # A_shaft from S1
        bearing_arm = machine.jaw.length * arms.jaw_axis - arms.jaw  # A_jaw from S2
        eccentricity = q.shaft.centre + pin_arm - q.jaw.centre - bearing_arm
        rate = (
            velocity.shaft.centre
            + velocity.shaft.angle * pin_arm.perp()
            - velocity.jaw.centre
            - velocity.jaw.angle * bearing_arm.perp()
        )
        contact = joint.contact(
            eccentricity, rate, velocity.jaw.angle, velocity.shaft.angle, state.impact_velocity
        )
        load = None
        if scene.load is not None:
            load = scene.load.force(arms.jaw_axis, velocity.jaw.centre)
        prescribed = scene.drive.initial() is None
        forces = _applied_forces(scene, contact, load, pin_arm, bearing_arm)
        rows, violation, violation_rate, right = _constraints(scene, time, q, velocity, arms)
        stabilised = [
            gamma - 2 * self.alpha * dphi - self.beta**2 * phi
            for gamma, dphi, phi in zip(right, violation_rate, violation, strict=True)
        ]
        accelerations, multipliers = solve_constrained(_masses(machine), rows, forces, stabilised)
        acceleration = from_entries(accelerations)
        bearing, elbow, pivot = (Vector(multipliers[i], multipliers[i + 1]) for i in (0, 2, 4))
        residual = functools.reduce(jnp.maximum, [jnp.abs(phi) for phi in violation])
        return Snapshot(
            ShaftMotion(
                arms.crank, velocity.shaft.angle, None if prescribed else acceleration.shaft.angle
            ),
            Chain(arms.toggle_axis, arms.jaw_axis, -velocity.toggle.angle, velocity.jaw.angle),
            ChainAcceleration(-acceleration.toggle.angle, acceleration.jaw.angle),
            contact,
            eccentricity,
            contact.force,
            contact.bearing_moment,
            contact.journal_moment,
            load,
            Multipliers(
                bearing,
                elbow,
                pivot,
                multipliers[6] if prescribed else None,
                residual,
                acceleration,
            ),
        )

    def rate(
        self, snapshot: Snapshot, state: MultiplierState, scene: AbstractScene
    ) -> MultiplierState:
        """Velocities and accelerations, q' and q''."""
        joint, _ = clearance_joint(scene)
        assert snapshot.contact is not None and snapshot.multipliers is not None
        return MultiplierState(
            state.velocity * (1 / CONTACT_TIME),
            snapshot.multipliers.acceleration * CONTACT_TIME,
            joint.memory_rate(snapshot.contact, state.impact_velocity),
        )

    def unwound(self, state: MultiplierState) -> MultiplierState:
        """theta1 stands in the drive's constraint."""
        angle = from_nearest_turn(state.position.shaft.angle)
        return eqx.tree_at(lambda s: s.position.shaft.angle, state, angle)

    def tolerance(self, scene: AbstractScene, rtol: Scalar | float) -> Scalar | float:
        """Positions of the order of 1 m count against the clearance, down to their rounding."""
        joint, _ = clearance_joint(scene)
        return jnp.maximum(rtol * joint.clearance, 2e-14)


def _masses(machine: Machine) -> list[Scalar]:
    """The diagonal of M, (17)."""
    bodies = (machine.shaft, machine.jaw, machine.toggle)
    return [entry for b in bodies for entry in (b.mass, b.mass, b.inertia)]


def _applied_forces(scene, contact, load, pin_arm: Vector, bearing_arm: Vector) -> list[Scalar]:
    """Q of (18) and the contact's forces with their moments, for the nine coordinates.

    A prescribed drive's torque is its multiplier; a given one stands here.
    """
    machine, force = scene.machine, contact.force
    weights = [
        Vector(0.0, -b.mass * machine.gravity) for b in (machine.shaft, machine.jaw, machine.toggle)
    ]
    on_shaft = weights[0] - force
    on_jaw = weights[1] + force if load is None else weights[1] + force + load
    shaft_moment = -pin_arm.cross(force)
    jaw_moment = bearing_arm.cross(force)
    if contact.bearing_moment is not None:
        shaft_moment = shaft_moment + contact.journal_moment
        jaw_moment = jaw_moment + contact.bearing_moment
    # acceleration(moment, 1) is torque + moment, or None where the speed is prescribed.
    driven = scene.drive.acceleration(shaft_moment, scalar(1.0))
    shaft_moment = shaft_moment if driven is None else driven
    no_moment = jnp.zeros_like(shaft_moment)
    return [
        on_shaft.x,
        on_shaft.y,
        shaft_moment,
        on_jaw.x,
        on_jaw.y,
        jaw_moment,
        weights[2].x,
        weights[2].y,
        no_moment,
    ]


def _constraints(
    scene: AbstractScene, time: Scalar, q: Coordinates, velocity: Coordinates, arms: _Arms
) -> tuple[list[SparseRow], list[Scalar], list[Scalar], list[Scalar]]:
    """Phi_q, Phi, Phi' and gamma of (13)-(15): O, B, C, and the drive."""
    machine, one = scene.machine, jnp.ones_like(time)
    elbow, middle = (machine.toggle.length * s * arms.toggle_axis for s in (1.0, 0.5))
    shaft_turn, jaw_turn = arms.shaft.perp(), arms.jaw.perp()
    # theta3 counts clockwise: d(elbow)/d(theta3) = -perp(elbow)
    elbow_turn, middle_turn = -elbow.perp(), -middle.perp()
    rows: list[SparseRow] = [
        {0: one, 2: -shaft_turn.x},
        {1: one, 2: -shaft_turn.y},
        {3: one, 5: -jaw_turn.x, 8: -elbow_turn.x},
        {4: one, 5: -jaw_turn.y, 8: -elbow_turn.y},
        {6: one, 8: -middle_turn.x},
        {7: one, 8: -middle_turn.y},
    ]
    closures = [
        q.shaft.centre - machine.bearing - arms.shaft,
        q.jaw.centre - elbow - arms.jaw,
        q.toggle.centre - middle,
    ]
    gammas = [
        -(velocity.shaft.angle**2) * arms.shaft,
        -(velocity.jaw.angle**2) * arms.jaw - velocity.toggle.angle**2 * elbow,
        -(velocity.toggle.angle**2) * middle,
    ]
    violation = [component for closure in closures for component in (closure.x, closure.y)]
    right = [component for gamma in gammas for component in (gamma.x, gamma.y)]
    entries = velocity.entries()
    if scene.drive.initial() is None:
        angle, speed = scene.drive.motion(time, None)
        rows.append({2: one})
        violation.append(q.shaft.angle - angle)
        right.append(jnp.zeros_like(time))
    violation_rate = [
        sum((entry * entries[column] for column, entry in row.items()), jnp.zeros_like(time))
        for row in rows
    ]
    if scene.drive.initial() is None:
        violation_rate[-1] = violation_rate[-1] - speed
    return rows, violation, violation_rate, right

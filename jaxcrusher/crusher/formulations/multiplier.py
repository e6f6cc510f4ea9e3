"""The paper's formulation: nine coordinates, multipliers, Baumgarte's stabilisation, (13)-(20).

q = (S1, theta1, S2, theta2, S3, theta3), theta3 clockwise. (13) lacks the drive's row, added
here; the first term of (15) is (Phi_q q')_q q'; and the contact acts with its moments, which
(19) omits. The rows of a loose B or C make way for its contact; an ideal A has rows.
"""

import dataclasses
import functools

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Scalar

from jaxcrusher.basics.linear import solve_constrained
from jaxcrusher.basics.plane import Vector, scalar
from jaxcrusher.crusher import linkage
from jaxcrusher.crusher.applied import applied
from jaxcrusher.crusher.drives import from_nearest_turn
from jaxcrusher.crusher.formulations.constraints import Constraint, Gap, constraints_of, gaps_of
from jaxcrusher.crusher.formulations.coordinates import Body, Coordinates, arms_of, from_entries
from jaxcrusher.crusher.formulations.eccentricity import contacts_of, start_of
from jaxcrusher.crusher.interfaces import AbstractFormulation, AbstractScene
from jaxcrusher.crusher.joints import AtJoints
from jaxcrusher.crusher.linkage import AtJaw, Chain, ChainAcceleration, InertialForces
from jaxcrusher.crusher.machine import Machine
from jaxcrusher.crusher.moving_frame import FrameState, frame_rate, initial_frame, with_frame
from jaxcrusher.crusher.snapshot import Multipliers, ShaftMotion, Snapshot, chain_of, crank_motion
from jaxcrusher.joint.clearance import Contact

# The unit of time of the velocities in the state: as long as a contact, so that the error
# of a velocity weighs as much as that of the position it leads to.
CONTACT_TIME = 1e-4  # s


class MultiplierState(eqx.Module):
    """q (m, rad), and q' in units per CONTACT_TIME."""

    position: Coordinates
    velocity: Coordinates
    impact_velocities: AtJoints[Scalar]  # the normal laws' memories, m/s
    frame: FrameState | None = None


class MultiplierFormulation(AbstractFormulation):
    """The index-1 equations (20); Baumgarte's alpha and beta in 1/s, 20 each in Table 2."""

    alpha: Scalar = eqx.field(converter=scalar, default=20.0)
    beta: Scalar = eqx.field(converter=scalar, default=20.0)

    def initial(self, scene: AbstractScene) -> MultiplierState:
        """The scene's start, on the constraints to rounding."""
        machine = scene.machine
        angle, speed = scene.drive.motion(scalar(0.0), scene.drive.initial())
        shaft = crank_motion(angle, speed)
        chain = chain_of(machine, shaft, *start_of(scene).eccentricities(scene))
        arm = linkage.mass_centre_arm(machine, chain)
        centre = machine.shaft.mass_centre.along(shaft.crank)
        jaw_angle = jnp.arctan2(-chain.jaw.x, chain.jaw.y)
        toggle_angle = jnp.arctan2(-chain.toggle.y, chain.toggle.x)
        position = Coordinates(
            Body(machine.bearing + centre, angle),
            Body(linkage.elbow_position(machine, chain) + arm, jaw_angle),
            Body(linkage.toggle_centre(machine, chain), toggle_angle),
        )
        velocity = Coordinates(
            Body(speed * centre.perp(), speed),
            Body(linkage.mass_centre_velocity(machine, chain), chain.jaw_spin),
            Body(linkage.toggle_centre_velocity(machine, chain), -chain.toggle_spin),
        )
        memories = scene.joints.map(lambda joint: joint.normal.impact_velocity.initial())
        return MultiplierState(position, velocity * CONTACT_TIME, memories, initial_frame(scene))

    def snapshot(self, time: Scalar, state: MultiplierState, scene: AbstractScene) -> Snapshot:
        """Solve (20) for the accelerations and the multipliers."""
        machine = scene.machine
        q, velocity = state.position, state.velocity * (1 / CONTACT_TIME)
        arms = arms_of(machine, q)
        gaps = gaps_of(q, velocity, arms, scene.joints)
        e = gaps.map(lambda gap: gap.position)
        rate = gaps.map(lambda gap: gap.change(velocity.entries()))
        spins = -velocity.toggle.angle, velocity.jaw.angle
        chain = Chain(arms.toggle_axis, arms.jaw_axis, *spins, e, rate)
        contacts = contacts_of(scene, e, rate, chain, velocity.shaft.angle, state.impact_velocities)
        shaft = ShaftMotion(q.shaft.angle, arms.crank, velocity.shaft.angle, None)
        on_jaw = applied(scene, shaft, chain)
        constraints = constraints_of(scene, time, q, velocity, arms)
        stabilised = [
            one.gamma - 2 * self.alpha * one.rate - self.beta**2 * one.violation
            for one in constraints
        ]

        def mechanism(inertial: InertialForces | None) -> Snapshot:
            accelerations, found = solve_constrained(
                _masses(machine),
                [one.row for one in constraints],
                _applied_forces(scene, contacts, on_jaw.total, gaps, inertial),
                stabilised,
            )
            held = _by_name(constraints, found)
            acceleration, drive = from_entries(accelerations), held.get("drive")
            multipliers = Multipliers(
                Vector(*held["bearing"]),
                Vector(*held["elbow"]) if "elbow" in held else None,
                Vector(*held["pivot"]) if "pivot" in held else None,
                None if drive is None else drive[0],
                functools.reduce(jnp.maximum, [jnp.abs(one.violation) for one in constraints]),
                acceleration,
            )
            main, further = contacts.main, AtJoints(None, gaps.elbow, gaps.pivot)
            return Snapshot(
                dataclasses.replace(
                    shaft, acceleration=acceleration.shaft.angle if drive is None else None
                ),
                chain,
                ChainAcceleration(
                    -acceleration.toggle.angle,
                    acceleration.jaw.angle,
                    further.map(lambda gap: gap.acceleration(accelerations)),
                ),
                contacts,
                e,
                Vector(*held["main"]) if main is None else main.force,
                None if main is None else main.bearing_moment,
                None if main is None else main.journal_moment,
                on_jaw,
                multipliers,
            )

        return with_frame(scene, state.frame, shaft, chain, mechanism)

    def rate(
        self, snapshot: Snapshot, state: MultiplierState, scene: AbstractScene
    ) -> MultiplierState:
        """Velocities and accelerations, q' and q''."""
        assert snapshot.multipliers is not None
        memories = scene.joints.map(
            lambda joint, contact, memory: joint.memory_rate(contact, memory),
            snapshot.contacts,
            state.impact_velocities,
        )
        return MultiplierState(
            state.velocity * (1 / CONTACT_TIME),
            snapshot.multipliers.acceleration * CONTACT_TIME,
            memories,
            frame_rate(snapshot.frame, scene),
        )

    def unwound(self, state: MultiplierState) -> MultiplierState:
        """theta1 stands in the drive's constraint."""
        angle = from_nearest_turn(state.position.shaft.angle)
        return eqx.tree_at(lambda s: s.position.shaft.angle, state, angle)

    def tolerance(self, scene: AbstractScene, rtol: Scalar | float) -> Scalar | float:
        """Positions of the order of 1 m count against the clearance, down to their rounding."""
        clearances = [joint.clearance for _, joint in scene.joints.present()]
        return jnp.maximum(rtol * functools.reduce(jnp.minimum, clearances), 2e-14)


def _masses(machine: Machine) -> list[Scalar]:
    """The diagonal of M, (17)."""
    bodies = (machine.shaft, machine.jaw, machine.toggle)
    return [entry for b in bodies for entry in (b.mass, b.mass, b.inertia)]


def _by_name(constraints: list[Constraint], multipliers: list[Scalar]) -> dict[str, list[Scalar]]:
    """The multipliers of what is held."""
    found: dict[str, list[Scalar]] = {}
    for constraint, multiplier in zip(constraints, multipliers, strict=True):
        found.setdefault(constraint.of, []).append(multiplier)
    return found


# The coordinates that are the angles of pin and bore of each joint, and which way they count.
_ANGLES = {"main": ((2, 1), (5, 1)), "elbow": ((8, -1), (5, 1)), "pivot": ((8, -1), None)}


def _applied_forces(
    scene: AbstractScene,
    contacts: AtJoints[Contact],
    on_jaw: AtJaw | None,
    gaps: AtJoints[Gap],
    inertial: InertialForces | None,
) -> list[Scalar]:
    """Q of (18) and the contacts' forces with their moments, for the nine coordinates.

    A prescribed drive's torque is its multiplier; a given one stands here.
    """
    machine = scene.machine
    none = jnp.zeros_like(machine.gravity)
    forces = [none] * 9
    for y, body in zip((1, 4, 7), (machine.shaft, machine.jaw, machine.toggle), strict=True):
        forces[y] = -body.mass * machine.gravity
    if on_jaw is not None:
        forces[3], forces[4] = on_jaw.force.x, forces[4] + on_jaw.force.y
        forces[5] = none if on_jaw.moment is None else on_jaw.moment
    for name, contact in contacts.present():
        gap = gaps[name]
        assert gap is not None
        # Of the force on the bore and its reaction on the pin, by virtual work.
        for row, component in zip(gap.rows, (contact.force.x, contact.force.y), strict=True):
            for i, entry in row.items():
                forces[i] = forces[i] - entry * component
        moments = contact.journal_moment, contact.bearing_moment
        for angle, moment in zip(_ANGLES[name], moments, strict=True):
            if angle is not None and moment is not None:
                i, sense = angle
                forces[i] = forces[i] + sense * moment
    if inertial is not None:
        for first, added in zip((0, 3, 6), inertial.all(), strict=True):
            # theta3 counts clockwise.
            moment = -added.moment if first == 6 else added.moment
            for i, one in enumerate((added.force.x, added.force.y, moment), first):
                forces[i] = forces[i] + one
    # acceleration(moment, 1) is torque + moment, or None where the speed is prescribed.
    driven = scene.drive.acceleration(forces[2], scalar(1.0))
    forces[2] = forces[2] if driven is None else driven
    return forces

"""Accelerations where elbow or pivot is loose: jaw and toggle as free bodies (Newton and Euler).

Contacts push at loose joints; at ideal ones act the forces that keep pin and bore together, the
unknowns of a small system: none if all three joints are loose, two for each ideal one. Nothing
drifts, for positions come from the eccentricities.
"""

import dataclasses

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Scalar

from jaxcrusher.basics.linear import SparseRow, solve_constrained
from jaxcrusher.basics.plane import Vector, scalar
from jaxcrusher.crusher import linkage
from jaxcrusher.crusher.drives import AbstractDrive
from jaxcrusher.crusher.joints import AtJoints
from jaxcrusher.crusher.linkage import AtJaw, Chain, ChainAcceleration, InertialForces
from jaxcrusher.crusher.machine import Machine
from jaxcrusher.crusher.snapshot import ShaftMotion, moment_on_shaft, shaft_inertia
from jaxcrusher.joint.clearance import Contact

# The first coordinates of jaw and toggle (mass centre x, y and angle) and of a free shaft (angle).
JAW, TOGGLE, SHAFT = 0, 3, 6


class _Point(eqx.Module):
    """A centre of a pin or bore: its acceleration is columns . coordinates'' + centripetal."""

    columns: tuple[SparseRow, SparseRow]  # of x and of y
    turns: int | None = eqx.field(static=True)  # the coordinate that is its body's angle
    centripetal: Vector

    def acceleration(self, found: list[Scalar]) -> Vector:
        """In m/s2, from those of the coordinates."""
        x, y = (sum(entry * found[i] for i, entry in row.items()) for row in self.columns)
        return Vector(x, y) + self.centripetal

    def push(self, forces: list[Scalar], force: Vector, moment: Scalar | None) -> None:
        """Add what a force (N) and a moment (N m) do to the coordinates."""
        for row, component in zip(self.columns, (force.x, force.y), strict=True):
            for i, entry in row.items():
                forces[i] = forces[i] + entry * component
        if moment is not None and self.turns is not None:
            forces[self.turns] = forces[self.turns] + moment


def _on_body(first: int, arm: Vector, spin: Scalar) -> _Point:
    """At `arm` from the mass centre of jaw or toggle."""
    one = jnp.ones_like(spin)
    columns = {first: one, first + 2: -arm.y}, {first + 1: one, first + 2: arm.x}
    return _Point(columns, first + 2, linkage.turning(arm, spin, None))


def _on_shaft(machine: Machine, shaft: ShaftMotion, free: bool) -> _Point:
    """The pin A, which a shaft of given speed carries along a given path."""
    arm = machine.shaft.eccentricity * shaft.crank
    columns = ({SHAFT: -arm.y}, {SHAFT: arm.x}) if free else ({}, {})
    return _Point(columns, SHAFT if free else None, linkage.turning(arm, shaft.speed, None))


def _joints(
    machine: Machine, shaft: ShaftMotion, chain: Chain, free: bool
) -> AtJoints[tuple[_Point, _Point]]:
    """The centres of pin and bore of each joint."""
    lower, half = -linkage.mass_centre_arm(machine, chain), machine.toggle.length / 2 * chain.toggle
    upper = machine.jaw.length * chain.jaw + lower
    frame = _Point(({}, {}), None, Vector(0.0, 0.0))
    return AtJoints(
        (_on_shaft(machine, shaft, free), _on_body(JAW, upper, chain.jaw_spin)),
        (_on_body(TOGGLE, half, chain.toggle_spin), _on_body(JAW, lower, chain.jaw_spin)),
        (_on_body(TOGGLE, -half, chain.toggle_spin), frame),
    )


def accelerations(
    machine: Machine,
    shaft: ShaftMotion,
    drive: AbstractDrive,
    chain: Chain,
    applied: AtJaw | None,
    contacts: AtJoints[Contact],
    inertial: InertialForces | None = None,
) -> tuple[ShaftMotion, ChainAcceleration, Vector]:
    """Return the accelerations of shaft and chain, and the force on the jaw at A (N).

    `applied` acts on the jaw at S2.
    """
    none = jnp.zeros_like(chain.jaw_spin)
    bodies = machine.jaw, machine.toggle
    masses = [entry for body in bodies for entry in (body.mass, body.mass, body.inertia)]
    forces = [none, -machine.jaw.mass * machine.gravity, none]
    forces += [none, -machine.toggle.mass * machine.gravity, none]
    if applied is not None:
        at_s2 = applied.force
        forces[JAW], forces[JAW + 1] = forces[JAW] + at_s2.x, forces[JAW + 1] + at_s2.y
        forces[JAW + 2] = none if applied.moment is None else applied.moment
    if inertial is not None:
        for first, added in ((JAW, inertial.jaw), (TOGGLE, inertial.toggle)):
            for i, one in enumerate((added.force.x, added.force.y, added.moment), first):
                forces[i] = forces[i] + one
    # acceleration(moment, 1) is torque + moment, or None where the speed is prescribed.
    weight = moment_on_shaft(machine, shaft.crank, Vector(0.0, 0.0), None, inertial)
    turning = drive.acceleration(weight, scalar(1.0))
    if turning is not None:
        masses.append(shaft_inertia(machine))
        forces.append(turning)
    joints = _joints(machine, shaft, chain, turning is not None)
    rows, right = [], []
    for name, (pin, bore) in joints.present():
        contact = contacts[name]
        if contact is not None:
            bore.push(forces, contact.force, contact.bearing_moment)
            pin.push(forces, -contact.force, contact.journal_moment)
            continue
        known = bore.centripetal - pin.centripetal
        for of_pin, of_bore in zip(pin.columns, bore.columns, strict=True):
            rows.append(of_pin | {i: -entry for i, entry in of_bore.items()})
        right += [known.x, known.y]
    found, multipliers = solve_constrained(masses, rows, forces, right)
    if turning is not None:
        shaft = dataclasses.replace(shaft, acceleration=found[SHAFT])
    play = contacts.map(
        lambda _, joint: joint[0].acceleration(found) - joint[1].acceleration(found), joints
    )
    acceleration = ChainAcceleration(found[TOGGLE + 2], found[JAW + 2], play)
    force = Vector(*multipliers[:2]) if contacts.main is None else contacts.main.force
    return shaft, acceleration, force


def forces_for(
    machine: Machine, chain: Chain, applied: AtJaw | None, acceleration: ChainAcceleration
) -> AtJoints[Vector]:
    """Inverse dynamics without friction: the forces on the bores (N) that give `acceleration`."""
    jaw, toggle = machine.jaw, machine.toggle
    arm = linkage.mass_centre_arm(machine, chain)
    fall = Vector(0.0, -machine.gravity)
    on_jaw = jaw.mass * (linkage.mass_centre_acceleration(machine, chain, acceleration) - fall)
    on_jaw = on_jaw if applied is None else on_jaw - applied.force
    on_toggle = toggle.mass * (
        linkage.toggle_centre_acceleration(machine, chain, acceleration) - fall
    )
    # Moments of the jaw about A and of the toggle about its foot: of the force at B alone.
    from_a = arm - jaw.length * chain.jaw
    at_jaw = from_a.cross(on_jaw) + jaw.inertia * acceleration.jaw
    if applied is not None and applied.moment is not None:
        at_jaw = at_jaw - applied.moment
    at_toggle = toggle.length / 2 * chain.toggle.cross(on_toggle)
    at_toggle = at_toggle + toggle.inertia * acceleration.toggle
    # -l2 jaw x elbow = at_jaw, -l3 toggle x elbow = at_toggle
    across_jaw, across_toggle = -at_jaw / jaw.length, -at_toggle / toggle.length
    lever = chain.toggle.cross(chain.jaw)
    elbow = (across_toggle * chain.jaw - across_jaw * chain.toggle) / lever
    return AtJoints(on_jaw - elbow, elbow, -(on_toggle + elbow))

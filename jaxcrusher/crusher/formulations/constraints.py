"""Constraints between pins and bores in nine coordinates: equations (13)-(15) of the paper."""

from collections.abc import Callable, Sequence

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Scalar

from jaxcrusher.basics.linear import SparseRow
from jaxcrusher.basics.plane import Vector
from jaxcrusher.crusher.formulations.coordinates import Arms, Coordinates
from jaxcrusher.crusher.interfaces import AbstractScene
from jaxcrusher.crusher.joints import JOINTS, AtJoints


class Gap(eqx.Module):
    """The vector from one point to another, by the nine coordinates."""

    position: Vector  # m
    rows: tuple[SparseRow, SparseRow]  # its derivatives, of x and of y
    centripetal: Vector  # its second time derivative less rows . q''

    def change(self, entries: Sequence[Scalar]) -> Vector:
        """The rows times nine rates."""
        products = ([entry * entries[i] for i, entry in row.items()] for row in self.rows)
        return Vector(*(sum(rest, first) for first, *rest in products))

    def acceleration(self, entries: Sequence[Scalar]) -> Vector:
        """From those of the coordinates."""
        return self.change(entries) + self.centripetal

    def __neg__(self) -> "Gap":
        x, y = ({i: -entry for i, entry in row.items()} for row in self.rows)
        return Gap(-self.position, (x, y), -self.centripetal)


def gaps_of(q: Coordinates, velocity: Coordinates, arms: Arms, wanted: AtJoints) -> AtJoints[Gap]:
    """Pin less bore, of the joints where something is wanted."""
    one = jnp.ones_like(q.jaw.angle)
    half = arms.toggle / 2
    shaft, jaw, toggle = (b.angle**2 for b in (velocity.shaft, velocity.jaw, velocity.toggle))

    def main() -> Gap:
        rows = (
            {0: one, 2: -arms.pin.y, 3: -one, 5: arms.bearing.y},
            {1: one, 2: arms.pin.x, 4: -one, 5: -arms.bearing.x},
        )
        apart = q.shaft.centre + arms.pin - q.jaw.centre - arms.bearing
        return Gap(apart, rows, jaw * arms.bearing - shaft * arms.pin)

    # theta3 counts clockwise.
    def elbow() -> Gap:
        rows = (
            {3: -one, 5: -arms.jaw.y, 6: one, 8: half.y},
            {4: -one, 5: arms.jaw.x, 7: one, 8: -half.x},
        )
        apart = q.toggle.centre + half - q.jaw.centre + arms.jaw
        return Gap(apart, rows, -toggle * half - jaw * arms.jaw)

    def pivot() -> Gap:
        rows = {6: one, 8: -half.y}, {7: one, 8: half.x}
        return Gap(q.toggle.centre - half, rows, toggle * half)

    made: AtJoints[Callable[[], Gap]] = AtJoints(main, elbow, pivot)
    return wanted.map(lambda _, make: make(), made)


class Constraint(eqx.Module):
    """A row of (13): of what it is, Phi_q, Phi, Phi' and gamma."""

    of: str = eqx.field(static=True)  # "bearing", the drive, or a joint's name
    row: SparseRow
    violation: Scalar
    rate: Scalar
    gamma: Scalar


def constraints_of(
    scene: AbstractScene, time: Scalar, q: Coordinates, velocity: Coordinates, arms: Arms
) -> list[Constraint]:
    """O, the ideal ones of A, B and C, and a prescribed drive."""
    joints, entries = scene.joints, velocity.entries()
    ideal = AtJoints(*(None if joints[name] else True for name in JOINTS))
    held = {"bearing": _at_bearing(scene, q, velocity, arms)}
    held |= dict(gaps_of(q, velocity, arms, ideal).present())
    if "elbow" in held:
        # Both count from the toggle to the jaw.
        held["elbow"] = -held["elbow"] if joints.pivot else _from_pivot(q, velocity, arms)
    found = []
    for name, gap in held.items():
        vectors = gap.position, gap.change(entries), -gap.centripetal
        parts = zip(*((vector.x, vector.y) for vector in vectors), strict=True)
        found += [Constraint(name, row, *one) for row, one in zip(gap.rows, parts, strict=True)]
    if scene.drive.initial() is None:
        angle, speed = scene.drive.motion(time, None)
        row = {2: jnp.ones_like(time)}
        violation, rate = q.shaft.angle - angle, velocity.shaft.angle - speed
        found.append(Constraint("drive", row, violation, rate, jnp.zeros_like(time)))
    return found


def _at_bearing(scene: AbstractScene, q: Coordinates, velocity: Coordinates, arms: Arms) -> Gap:
    """From the frame's O to the shaft's."""
    one = jnp.ones_like(q.jaw.angle)
    rows = {0: one, 2: arms.shaft.y}, {1: one, 2: -arms.shaft.x}
    apart = q.shaft.centre - scene.machine.bearing - arms.shaft
    return Gap(apart, rows, velocity.shaft.angle**2 * arms.shaft)


def _from_pivot(q: Coordinates, velocity: Coordinates, arms: Arms) -> Gap:
    """B of (13): to the jaw's from the toggle's, whose foot is at C."""
    one = jnp.ones_like(q.jaw.angle)
    rows = (
        {3: one, 5: arms.jaw.y, 8: -arms.toggle.y},
        {4: one, 5: -arms.jaw.x, 8: arms.toggle.x},
    )
    centripetal = velocity.jaw.angle**2 * arms.jaw + velocity.toggle.angle**2 * arms.toggle
    return Gap(q.jaw.centre - arms.toggle - arms.jaw, rows, centripetal)

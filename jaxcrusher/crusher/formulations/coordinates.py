"""The nine coordinates of the paper, (12), and where they put things."""

import equinox as eqx
from jaxtyping import Scalar

from jaxcrusher.basics.plane import Vector, direction
from jaxcrusher.crusher.machine import Machine


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


class Arms(eqx.Module):
    """Where things are, from the three angles; m."""

    crank: Vector  # unit vector O-A
    shaft: Vector  # S1 from O
    pin: Vector  # A_shaft from S1
    jaw_axis: Vector  # unit vector B-A
    jaw: Vector  # S2 from B
    bearing: Vector  # A_jaw from S2
    toggle_axis: Vector  # unit vector C-B
    toggle: Vector  # B from C, both of the toggle


def arms_of(machine: Machine, q: Coordinates) -> Arms:
    """At some coordinates."""
    crank, jaw_axis = direction(q.shaft.angle), direction(q.jaw.angle).perp()
    toggle_axis = direction(-q.toggle.angle)
    shaft = machine.shaft.mass_centre.along(crank)
    jaw = machine.jaw.length * jaw_axis + machine.jaw.mass_centre.along(jaw_axis)
    return Arms(
        crank,
        shaft,
        machine.shaft.eccentricity * crank - shaft,
        jaw_axis,
        jaw,
        machine.jaw.length * jaw_axis - jaw,
        toggle_axis,
        machine.toggle.length * toggle_axis,
    )

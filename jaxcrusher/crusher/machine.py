"""The crusher's bodies and their geometry (Wang, Cui, Wang 2023, Tables 1 and 2).

Origin at the toggle plate's frame pivot C, x to the right, y up. The main bearing is at
O, the shaft's eccentric pin at A_shaft, the jaw's bearing at A_jaw, the elbow at B.
"""

import equinox as eqx
import numpy as np
from jaxtyping import Scalar

from jaxcrusher.basics.checks import primal, require, require_positive
from jaxcrusher.basics.plane import Arm, Vector, arm_to, scalar
from jaxcrusher.basics.record import Record
from jaxcrusher.mechanism.linkage import Body, Joint, Linkage, Point
from jaxcrusher.mechanism.named import Named
from jaxcrusher.mechanism.topology import FRAME

# The joints and their letters: the main bearing A (bore in the jaw, pin of the shaft), the elbow B
# (bore in the jaw, pin of the toggle), the pivot C (bore in the frame, pin of the toggle), and the
# shaft's own bearing O (bore in the frame).
LETTERS = {"main": "A", "elbow": "B", "pivot": "C", "shaft_bearing": "O"}
JOINTS = tuple(LETTERS)


class Shaft(Record):
    """The eccentric shaft, turning about O.

    `mass_centre` is S1 relative to O in the shaft's axes: x along O-A, y 90 deg ahead.
    """

    mass: Scalar = eqx.field(converter=scalar)  # m1, kg
    inertia: Scalar = eqx.field(converter=scalar)  # J1 about S1, kg m2
    eccentricity: Scalar = eqx.field(converter=scalar)  # l1, m
    mass_centre: Vector  # m


class Jaw(Record):
    """The moving jaw from B to A.

    `mass_centre` is S2 relative to A in the jaw's axes: x along B-A, y 90 deg ahead.
    """

    mass: Scalar = eqx.field(converter=scalar)  # m2, kg
    inertia: Scalar = eqx.field(converter=scalar)  # J2 about S2, kg m2
    length: Scalar = eqx.field(converter=scalar)  # l2, m
    mass_centre: Vector  # m


class Toggle(Record):
    """The toggle (elbow) plate from C to B; its mass centre S3 lies in its middle."""

    mass: Scalar = eqx.field(converter=scalar)  # m3, kg
    inertia: Scalar = eqx.field(converter=scalar)  # J3 about S3, kg m2
    length: Scalar = eqx.field(converter=scalar)  # l3, m


class Machine(Record):
    """A single-toggle jaw crusher: three bodies on a frame.

    Raises ValueError (concrete values only) for a mass, inertia or length that is not
    positive, and for links that cannot assemble or pass a dead point within a turn.
    """

    shaft: Shaft
    jaw: Jaw
    toggle: Toggle
    bearing: Vector  # O, m
    gravity: Scalar = eqx.field(converter=scalar, default=9.81)  # m/s2
    # Which side of the line C-A the elbow B lies on: -1 right, +1 left.
    elbow_side: int = eqx.field(static=True, default=-1)

    def __check_init__(self):
        for name, body in (("shaft", self.shaft), ("jaw", self.jaw), ("toggle", self.toggle)):
            require_positive(f"{name}.mass", body.mass, "kg")
            require_positive(f"{name}.inertia", body.inertia, "kg m2")
        require_positive("shaft.eccentricity", self.shaft.eccentricity, "m")
        require_positive("jaw.length", self.jaw.length, "m")
        require_positive("toggle.length", self.toggle.length, "m")
        require(self.elbow_side in (-1, 1), "elbow_side", "be -1 or 1", self.elbow_side)
        self.require_assembly(0.0)

    @property
    def linkage(self) -> Linkage:
        """Return bodies and joints; the jaw's axis is that of B-A, the toggle's that of C-B."""
        shaft, jaw, toggle = self.shaft, self.jaw, self.toggle
        bodies = {
            "shaft": Body(shaft.mass, shaft.inertia, arm_to(shaft.mass_centre)),
            "toggle": Body(toggle.mass, toggle.inertia, Arm(toggle.length / 2)),
            "jaw": Body(jaw.mass, jaw.inertia, arm_to(jaw.mass_centre)),
        }
        throw, lower = Point("shaft", Arm(shaft.eccentricity)), Point("jaw", Arm(-jaw.length))
        joints = {
            "main": Joint(bore=Point("jaw"), pin=throw),
            "elbow": Joint(bore=lower, pin=Point("toggle", Arm(toggle.length))),
            "pivot": Joint(bore=Point(FRAME), pin=Point("toggle")),
            "shaft_bearing": Joint(bore=Point(FRAME, arm_to(self.bearing)), pin=Point("shaft")),
        }
        at = "shaft", "shaft_bearing"
        return Linkage(Named(bodies), Named(joints), *at, (self.elbow_side,), self.gravity)

    def require_assembly(self, clearance) -> None:
        """Check that the linkage closes with room to spare for every shaft angle.

        The distance C-A runs over |O| -+ (l1 + clearance); the toggle and the jaw lie in
        one line (a dead point) where it reaches l2 + l3 or |l2 - l3|.
        """
        links = (self.bearing.x, self.bearing.y, self.shaft.eccentricity, self.jaw.length)
        known = [primal(v) for v in (*links, self.toggle.length, clearance)]
        if any(value is None for value in known):
            return
        x, y, l1, l2, l3, c = (np.asarray(value, dtype=float) for value in known)
        nearest, farthest = np.hypot(x, y) - l1 - c, np.hypot(x, y) + l1 + c
        good = bool(np.all((nearest > abs(l2 - l3)) & (farthest < l2 + l3)))
        require(
            good,
            "jaw.length`, `toggle.length` and `bearing.distance",
            "let the links close in every turn: the distance, less and plus shaft.eccentricity and "
            f"clearance, must stay between {1e3 * abs(l2 - l3).max():g} mm, jaw less toggle, and "
            f"{1e3 * (l2 + l3).min():g} mm, jaw plus toggle",
            f"{1e3 * nearest.min():g} to {1e3 * farthest.max():g} mm",
        )


def with_counterweight(shaft: Shaft, mass, position: Vector) -> Shaft:
    """The shaft with a point mass (kg) at `position` (m), in the shaft's axes about O."""
    total = shaft.mass + scalar(mass)
    centre = (shaft.mass * shaft.mass_centre + mass * position) / total
    apart = position - shaft.mass_centre
    inertia = shaft.inertia + shaft.mass * mass / total * apart.dot(apart)
    return Shaft(total, inertia, shaft.eccentricity, centre)

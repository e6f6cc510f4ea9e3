"""The crusher's bodies and their geometry (Wang, Cui, Wang 2023, Tables 1 and 2).

Origin at the toggle plate's frame pivot C, x to the right, y up. The main bearing is at
O, the shaft's eccentric pin at A_shaft, the jaw's bearing at A_jaw, the elbow at B.
"""

from collections.abc import Mapping

import numpy as np
from jaxtyping import Scalar

from jaxcrusher.basics.checks import primal, require, require_positive
from jaxcrusher.basics.plane import Arm, Vector, arm_to, scalar
from jaxcrusher.mechanism.linkage import Body, Joint, Linkage, Point
from jaxcrusher.mechanism.named import Named
from jaxcrusher.mechanism.topology import FRAME

# The joints and their letters: the main bearing A (bore in the jaw, pin of the shaft), the elbow B
# (bore in the jaw, pin of the toggle), the pivot C (bore in the frame, pin of the toggle), and the
# shaft's own bearing O (bore in the frame).
LETTERS = {"main": "A", "elbow": "B", "pivot": "C", "shaft_bearing": "O"}
JOINTS = tuple(LETTERS)


def crusher_linkage(
    shaft: Body,
    jaw: Body,
    toggle: Body,
    *,
    eccentricity: Scalar,
    jaw_length: Scalar,
    toggle_length: Scalar,
    bearing: Vector,
    gravity: Scalar | float = 9.81,
    elbow_side: int = -1,
) -> Linkage:
    """Return the linkage of a single-toggle jaw crusher: three bodies on a frame.

    **Arguments:**

    - `shaft`: the eccentric shaft about O; its x axis is that of O-A.
    - `jaw`: the moving jaw about A; its x axis is that of B-A.
    - `toggle`: the toggle (elbow) plate about C; its x axis is that of C-B.
    - `eccentricity`, `jaw_length`, `toggle_length`: O-A (l1), A-B (l2) and B-C (l3), m.
    - `bearing`: O, m.
    - `gravity`: m/s2.
    - `elbow_side`: which side of the line C-A the elbow B lies on: -1 right, +1 left.

    Raises ValueError as `require_crusher` and `Linkage` do.
    """
    arm = Arm(scalar(eccentricity))
    joints = {
        "main": Joint(bore=Point("jaw"), pin=Point("shaft", arm)),
        "elbow": Joint(Point("jaw", Arm(-jaw_length)), Point("toggle", Arm(toggle_length))),
        "pivot": Joint(bore=Point(FRAME), pin=Point("toggle")),
        "shaft_bearing": Joint(bore=Point(FRAME, arm_to(bearing)), pin=Point("shaft")),
    }
    bodies = {"shaft": shaft, "toggle": toggle, "jaw": jaw}
    _require_bodies(bodies)
    at = "shaft", "shaft_bearing"
    found = Linkage(Named(bodies), Named(joints), *at, (elbow_side,), scalar(gravity))
    require_crusher(found)
    return found


def lengths_of(linkage: Linkage) -> dict[str, Scalar]:
    """Return l1, l2 and l3 of a crusher, m, by their names in a description."""
    main, elbow = linkage.joints.at("main"), linkage.joints.at("elbow")
    return {
        "shaft.eccentricity": main.pin.arm.vector().x,
        "jaw.length": -elbow.bore.arm.vector().x,
        "toggle.length": elbow.pin.arm.vector().x,
    }


def _require_bodies(bodies: Mapping[str, Body]) -> None:
    for name, body in bodies.items():
        require_positive(f"{name}.mass", body.mass, "kg")
        require_positive(f"{name}.inertia", body.inertia, "kg m2")


def require_crusher(linkage: Linkage, clearance: Scalar | float = 0.0) -> None:
    """Check masses and lengths, and that the links close with room to spare at every angle.

    The distance C-A runs over |O| -+ (l1 + clearance), with all clearances at once; the toggle and
    the jaw lie in one line (a dead point) where it reaches l2 + l3 or |l2 - l3|. Raises ValueError
    (concrete values only).
    """
    _require_bodies(dict(linkage.bodies.items()))
    lengths, place = lengths_of(linkage), linkage.joints.at("shaft_bearing").bore.arm.vector()
    for name, length in lengths.items():
        require_positive(name, length, "m")
    known = [primal(value) for value in (*lengths.values(), place.x, place.y, clearance)]
    if any(value is None for value in known):
        return
    l1, l2, l3, x, y, c = (np.asarray(value, dtype=float) for value in known)
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


def with_counterweight(shaft: Body, mass: Scalar | float, position: Vector) -> Body:
    """The shaft with a point mass (kg) at `position` (m), in the shaft's axes about O."""
    before = shaft.mass_centre.vector()
    total = shaft.mass + scalar(mass)
    centre = (shaft.mass * before + mass * position) / total
    apart = position - before
    inertia = shaft.inertia + shaft.mass * mass / total * apart.dot(apart)
    return Body(total, inertia, arm_to(centre))

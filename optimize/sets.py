"""Sets of free numbers by one word: `--design balance` and `--design machine`."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from optimize.completions import CounterweightMoment

LINKS = ("toggle.length", "bearing.distance", "bearing.inclination", "jaw.length")
# What `machine` frees beside the numbers of `balance`.
PARTS = (
    "shaft.mass",
    "shaft.inertia",
    "shaft.mass_centre_radius",
    "shaft.mass_centre_angle",
    "jaw.mass",
    "jaw.inertia",
    "toggle.mass",
    "toggle.inertia",
    "load",
    "bore_radius",
    "young",
    "restitution",
)
SETS = ("balance", "machine")
# A number of links or parts may change by this share of itself. Beyond 5 % of the links the toggle
# can come so flat that no eccentricity gives the stroke; beyond 10 % the restitution passes 1.
OF_LINKS, OF_PARTS = 0.05, 0.1
# A flywheel of the PE250x400 has room for it; both at 14 kg m are 200 kg at the smallest radius.
COUNTERWEIGHT = {
    **dict.fromkeys(CounterweightMoment.inputs, (-14.0, 14.0)),
    "counterweight.radius": (0.1, 0.35),
}
# The mass centre of the jaw may move by this share of its distance, and by this angle (rad).
DISTANCE, ANGLE = 0.1, float(np.radians(10))


def set_bounds(word: str, values: Mapping[str, Any]) -> dict[str, tuple[float, float]]:
    """Return the 9 free numbers of `balance` or the 21 of `machine`, with their bounds.

    Bounds lie about the numbers of a whole description, but for those of the counterweight.
    """
    angle = values["jaw.mass_centre_angle"]
    found = {**COUNTERWEIGHT, "jaw.mass_centre_angle": (angle - ANGLE, angle + ANGLE)}
    shares = {"jaw.mass_centre_distance": DISTANCE, **dict.fromkeys(LINKS, OF_LINKS)}
    if word == "machine":
        shares |= dict.fromkeys(PARTS, OF_PARTS)
    for name, share in shares.items():
        low, high = sorted((values[name] * (1 - share), values[name] * (1 + share)))
        found[name] = low, high
    return found

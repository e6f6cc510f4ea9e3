"""The crusher with clearance in O, A, B and C, or in any of them, as free bodies.

Jaw, toggle and shaft are bodies of `any_linkage`, and so is the frame if it is on supports. The
shaft turns at constant speed. Origin at C; vectors of the plane are complex numbers; SI units.

Positions of 1 m carry penetrations of 1e-6 m. By `scipy_peer` at rtol 1e-13 the eccentricities of
three loose joints are within 2e-9 clearances after 10 ms, and 2e-7 after 20 ms.
"""

import cmath
import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from benchmarks.peers.any_linkage import AnyLinkage

# The prefix of a joint's numbers: the main bearing's have none.
PREFIXES = {"A": "", "B": "elbow.", "C": "pivot.", "O": "shaft_bearing."}
JOINTS = (
    ("A", "jaw", "shaft"),
    ("B", "jaw", "toggle"),
    ("C", "frame", "toggle"),
    ("O", "frame", "shaft"),
)
# Radius of the bore at O where a description has none, m.
SHAFT_BORE = 0.07
# For the others where a description has none; the numbers of `OF_A` are then those of A.
DEFAULTS = {"bore_radius": 0.04, "friction": 0.1, "restitution": 0.9, "impact_velocity": 0.5}
OF_A = ("young", "poisson", "slip")
FILM = ("film.viscosity", "film.width")
# The only ones here.
LAWS = {
    "contact_law": "lankarani_nikravesh",
    "friction_law": "ambrosio",
    "impact_law": "constant",
}
# In the axes of the jaw, whose x points from B to A; y points away from the fixed jaw.
DIRECTIONS = {"along_jaw": -1 + 0j, "normal_to_jaw": 1j}
# The joints' forces as others call them, and the sign that makes them of that on the bore.
REACTIONS = {
    "A": ("joint_force", 1),  # on the jaw
    "B": ("elbow_reaction", 1),  # on the jaw
    "C": ("toggle_reaction", -1),  # of the frame on the toggle
    "O": ("bearing_reaction", -1),  # R_O on the shaft
}


def crusher(
    numbers: Mapping[str, Any],
    e: Mapping[str, complex] | None = None,
    rates: Mapping[str, complex] | None = None,
    frame: np.ndarray | None = None,
) -> AnyLinkage:
    """Return the motion from eccentricities `e` (m) and `rates` (m/s) by joint, else 0.

    `numbers` are those of a description, by name. A joint without a `clearance` is ideal, and A
    is if its `joint` is "ideal". `frame` is that of `AnyLinkage`.
    """
    of = numbers
    known = {"load_law": tuple(DIRECTIONS)}
    known |= {prefix + name: (law,) for prefix in PREFIXES.values() for name, law in LAWS.items()}
    for name, choices in known.items():
        if of.get(name, choices[0]) not in choices:
            raise ValueError(f"Argument `{name}` must be one of {choices}, but is {of[name]!r}.")
    shaft, weight = of["shaft.mass"], of["counterweight.mass"]
    s1 = cmath.rect(of["shaft.mass_centre_radius"], of["shaft.mass_centre_angle"])
    apart = cmath.rect(of["counterweight.radius"], of["counterweight.angle"]) - s1
    mass = shaft + weight
    bodies = {
        "shaft": (mass, of["shaft.inertia"] + shaft * weight / mass * abs(apart) ** 2),
        "jaw": (of["jaw.mass"], of["jaw.inertia"]),
        "toggle": (of["toggle.mass"], of["toggle.inertia"]),
    }
    crank, jaw, toggle = of["shaft.eccentricity"], of["jaw.length"], of["toggle.length"]
    bearing = 1j * cmath.rect(of["bearing.distance"], -of["bearing.inclination"])
    to_a = cmath.rect(of["jaw.mass_centre_distance"], of["jaw.mass_centre_angle"])
    points = {
        "joints.A.bore": to_a,
        "joints.A.pin": crank,
        "joints.B.bore": to_a - jaw,
        "joints.B.pin": toggle / 2,
        "joints.C.pin": -toggle / 2,
        "joints.O.bore": bearing,
        "bodies.shaft.mass_centre": s1 + weight / mass * apart,
        "forces.load.force": of["load"] * DIRECTIONS[of.get("load_law", "along_jaw")],
    }
    values = dict(of)
    for name, place in points.items():
        values |= {f"{name}.x": complex(place).real, f"{name}.y": complex(place).imag}
    for body, (mass, inertia) in bodies.items():
        values |= {f"bodies.{body}.mass": mass, f"bodies.{body}.inertia": inertia}
    for joint, prefix in PREFIXES.items():
        if prefix + "clearance" in of and (prefix or of.get("joint") != "ideal"):
            usual = DEFAULTS | {name: of[name] for name in OF_A}
            if joint == "O":
                usual["bore_radius"] = SHAFT_BORE
            law = {name: of.get(prefix + name, value) for name, value in usual.items()}
            law["clearance"] = of[prefix + "clearance"]
            law |= {name: of[prefix + name] for name in FILM if prefix + name in of}
            values |= {f"joints.{joint}.{name}": value for name, value in law.items()}
    # Toggle and jaw are two sides of a triangle, the elbow to the right of the third.
    third = bearing + crank
    cosine = (abs(third) ** 2 + toggle**2 - jaw**2) / (2 * abs(third) * toggle)
    to_b = cmath.rect(toggle, cmath.phase(third) - math.acos(cosine))
    angles = np.array([0.0, cmath.phase(third - to_b), cmath.phase(to_b)])
    # The load is in the axes of the jaw.
    loads = (("load", "jaw", True),)
    return AnyLinkage(values, tuple(bodies), JOINTS, (), loads, angles, e or {}, rates or {}, frame)


def observe(motion: AnyLinkage, times, states) -> dict[str, np.ndarray]:
    """Return histories at `times` (s), with the prefixes of the joints' numbers.

    `eccentricity` (m) and `normal_force` (N) of each loose joint, and the forces of `REACTIONS`.
    """
    found, known = motion.observe(times, states), {}
    for joint, prefix in PREFIXES.items():
        name, sign = REACTIONS[joint]
        known[name] = sign * found[f"{joint}_reaction"]
        for name in ("eccentricity", "normal_force"):
            if f"{joint}_{name}" in found:
                known[prefix + name] = found[f"{joint}_{name}"]
    return known

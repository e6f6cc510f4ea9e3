"""Whether the numbers of a crusher can be meant: ratios that a slip of units throws far off.

A clearance of 100 mm in a bore of 130 mm, or a jaw of 0.5 kg, has a unit and lies inside its
limits, and is a slip all the same.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from jaxcrusher.basics.checks import concrete
from jaxcrusher.basics.setup import UnusualNumbers, warn_once
from jaxcrusher.files.messages import tell
from jaxcrusher.scenes.parameters import CHAMBER, NUMBERS, WORN_JOINTS, complete, readable

STANDARD_GRAVITY = 9.80665  # m/s2


@dataclass(frozen=True)
class Ratio:
    """A number that crushers have alike, small and large: where it usually lies, and where it can.

    `ratio` takes the numbers named `of`, in SI units.
    """

    words: str
    unit: str
    of: tuple[str, ...]
    ratio: Callable[..., float]
    usual: tuple[float, float]
    possible: tuple[float, float]
    source: str  # of the usual range


RATIOS = (
    Ratio(
        "clearance / bore_radius",
        "",
        ("clearance", "bore_radius"),
        lambda c, bore: c / bore,
        (1e-4, 5e-3),
        (0.0, 0.1),
        "journal bearings have about 0.001 (Hamrock, Schmid and Jacobson)",
    ),
    *(
        Ratio(
            f"{joint}.clearance / {joint}.bore_radius",
            "",
            (f"{joint}.clearance", f"{joint}.bore_radius"),
            lambda c, bore: c / bore,
            (1e-4, 0.02),
            (0.0, 0.3),
            "judged: a toggle's seat is no bearing, and wears",
        )
        for joint in WORN_JOINTS
    ),
    Ratio(
        "clearance / shaft.eccentricity",
        "",
        ("clearance", "shaft.eccentricity"),
        lambda c, eccentricity: c / eccentricity,
        (1e-4, 0.1),
        (0.0, 1.0),
        "the paper's box has 0.003 to 0.012; at 1 the play swallows the throw",
    ),
    Ratio(
        "jaw.mass_centre_distance / jaw.length",
        "",
        ("jaw.mass_centre_distance", "jaw.length"),
        lambda distance, length: distance / length,
        (0.2, 0.7),
        (-1.0, 1.0),
        "the PE250x400 has 0.43; at 1 the jaw's mass centre is beyond its end",
    ),
    Ratio(
        "shaft.eccentricity / jaw.length",
        "",
        ("shaft.eccentricity", "jaw.length"),
        lambda eccentricity, length: eccentricity / length,
        (3e-3, 0.05),
        (0.0, 0.5),
        "the PE250x400 has 0.014, and the range is judged from it",
    ),
    Ratio(
        "bore_radius / jaw.length",
        "",
        ("bore_radius", "jaw.length"),
        lambda bore, length: bore / length,
        (0.04, 0.35),
        (0.0, 1.0),
        "the PE250x400 has 0.19, and the range is judged from it",
    ),
    Ratio(
        "mass of the jaw over its cubed length",
        "kg/m3",
        ("jaw.mass", "jaw.length"),
        lambda mass, length: mass / length**3,
        (300.0, 5000.0),
        (20.0, 5e4),
        "the PE250x400 has 1561, and the range is judged from it",
    ),
    Ratio(
        "mass of the toggle over its squared length and the chamber's width",
        "kg/m3",
        ("toggle.mass", "toggle.length", "chamber.width"),
        lambda mass, length, width: mass / (length**2 * width),
        (50.0, 8000.0),
        (1.0, 5e4),
        "the PE250x400 has 611; solid steel as thick as it is long has 7850",
    ),
    Ratio(
        "mass of the shaft over that of a steel cylinder as wide as bore and chamber",
        "",
        ("shaft.mass", "bore_radius", "chamber.width"),
        lambda mass, radius, width: mass / (7850 * np.pi * radius**2 * width),
        (0.1, 30.0),
        (1e-3, 1e3),
        "the PE250x400 has 0.57; flywheels on it count",
    ),
    *(
        Ratio(
            f"radius of gyration of the {body} / {body}.length",
            "",
            (f"{body}.inertia", f"{body}.mass", f"{body}.length"),
            lambda inertia, mass, length: (inertia / mass) ** 0.5 / length,
            (0.15, 0.8),
            (0.01, 3.0),
            f"a uniform bar has 0.29, the PE250x400 as printed {printed}",
        )
        for body, printed in (("jaw", "0.71"), ("toggle", "0.60"))
    ),
    Ratio(
        "acceleration of the eccentric / 9.81 m/s2",
        "",
        ("speed", "shaft.eccentricity"),
        lambda speed, eccentricity: speed**2 * eccentricity / STANDARD_GRAVITY,
        (0.1, 4.0),
        (0.0, 100.0),
        "the paper's box has 0.64 to 1.63: what is crushed has to fall meanwhile",
    ),
    Ratio(
        "speed of the bore's surface",
        "m/s",
        ("speed", "bore_radius"),
        lambda speed, radius: speed * radius,
        (0.3, 15.0),
        (0.0, 200.0),
        "the paper's box has 3.3 to 5.2",
    ),
    Ratio(
        "young",
        "GPa",
        ("young",),
        lambda young: 1e-9 * young,
        (40.0, 700.0),
        (1e-3, 1300.0),
        "tin alloys have 50, steel 207, cemented carbide 650, diamond 1200",
    ),
    Ratio(
        "load over width and height of the chamber",
        "MPa",
        ("load", "chamber.width", "chamber.height"),
        lambda load, width, height: 1e-6 * load / (width * height),
        (0.0, 3.0),
        (0.0, 100.0),
        "the PE250x400 has 0.04 in the paper; jaw crushers are built for some 2.7",
    ),
    Ratio(
        "preload of the rod / weight of the jaw",
        "",
        ("rod.preload", "jaw.mass", "gravity"),
        lambda preload, mass, gravity: preload / (mass * max(gravity, 1e-3)),
        (0.0, 10.0),
        (0.0, 1e4),
        "judged: 0.6 keeps the PE250x400's toggle in its seats at idle",
    ),
    Ratio(
        "chamber.bed_modulus",
        "MPa",
        ("chamber.bed_modulus",),
        lambda modulus: 1e-6 * modulus,
        (0.5, 1000.0),
        (0.0, 1e6),
        "judged: 20 makes a mean of the paper's load, 500 the power of a motor of 15 kW",
    ),
    Ratio(
        "static rating of the rollers over that of their size",
        "",
        (
            "rollers.static_rating",
            "rollers.diameter",
            "rollers.pitch_diameter",
            "rollers.count",
            "rollers.length",
        ),
        # 44 of ISO 76 is for N and mm.
        lambda rating, roller, pitch, count, length: (
            rating / (44e6 * max(1 - roller / pitch, 1e-3) * count * length * roller)
        ),
        (0.7, 1.4),
        (1e-2, 100.0),
        "ISO 76 for radial roller bearings",
    ),
    Ratio(
        "rollers.dynamic_rating / rollers.static_rating",
        "",
        ("rollers.dynamic_rating", "rollers.static_rating"),
        lambda dynamic, static: dynamic / static,
        (0.35, 1.6),
        (1e-2, 100.0),
        "judged: catalogues have 0.4 for large and 1.3 for small roller bearings",
    ),
    Ratio(
        "gravity",
        "m/s2",
        ("gravity",),
        lambda gravity: gravity,
        (9.76, 9.84),
        (0.0, 100.0),
        "that of the Earth's surface",
    ),
    Ratio(
        "vertical natural frequency of the block without the mechanism",
        "Hz",
        ("foundation.vertical_stiffness", "foundation.mass"),
        lambda stiffness, mass: (2 * stiffness / mass) ** 0.5 / (2 * np.pi),
        (2.0, 80.0),
        (0.01, 1e6),
        "judged: springs have 2 to 8, a block on soil 10 to 50",
    ),
    Ratio(
        "vertical damping ratio of the block",
        "",
        ("foundation.vertical_damping", "foundation.vertical_stiffness", "foundation.mass"),
        lambda damping, stiffness, mass: damping / (2 * stiffness * mass) ** 0.5,
        (5e-3, 0.9),
        (0.0, 1e3),
        "judged: steel springs have 0.01, soil under a block up to 0.7",
    ),
    Ratio(
        "radius of gyration of the block over the distance of its supports",
        "",
        ("foundation.inertia", "foundation.mass", "foundation.left", "foundation.right"),
        lambda inertia, mass, left, right: (inertia / mass) ** 0.5 / max(abs(right - left), 1e-3),
        (0.2, 1.2),
        (0.01, 1e4),
        "judged: a square block as wide as its supports has 0.41",
    ),
    Ratio(
        "chamber.nip_angle",
        "deg",
        ("chamber.nip_angle",),
        lambda angle: np.degrees(angle),
        (14.0, 27.0),
        (0.0, 45.0),
        "jaw crushers have 18 to 24; rock is squeezed out above twice its angle of friction",
    ),
    Ratio(
        "chamber.height / jaw.length",
        "",
        ("chamber.height", "jaw.length"),
        lambda height, length: height / length,
        (0.4, 1.5),
        (0.05, 5.0),
        "the PE250x400 has 0.86",
    ),
    Ratio(
        "chamber.discharge / chamber.height",
        "",
        ("chamber.discharge", "chamber.height"),
        lambda discharge, height: discharge / height,
        (0.015, 0.3),
        (0.0, 1.0),
        "the PE250x400 has 0.06, and offers 20 to 60 mm in 0.6 m",
    ),
)


def _unusual(values: Mapping[str, Any]) -> Iterator[tuple[Ratio, str, str, bool]]:
    """Yield each ratio that is unusual, what is said of it, its numbers, and if it can be."""
    defaults = {name: parameter.default for name, parameter in CHAMBER.items()}
    v = {**defaults, **complete(values)}
    for one in RATIOS:
        ideal = v["joint"] == "ideal" and "clearance" in one.of
        there = (concrete(v[name]) for name in one.of if name in v)
        numbers = [float(number) for number in there if number is not None and number.ndim == 0]
        if ideal or len(numbers) < len(one.of):
            continue
        ratio = float(one.ratio(*numbers))
        if one.usual[0] <= ratio <= one.usual[1]:
            continue
        given = ", ".join(f"{name} {readable(name, v[name])}" for name in one.of)
        is_, low, high = (_number(value, one.unit) for value in (ratio, *one.usual))
        said = f"{one.words} is {is_}, usually {low} to {high} ({one.source})"
        yield one, said, given, one.possible[0] <= ratio <= one.possible[1]


def remarks(values: Mapping[str, Any]) -> list[str]:
    """Say what is unusual in a description, a line each, with the usual range and its source.

    `values` as in `jaxcrusher.build_scene`; a ratio of traced numbers is passed over. Raises
    ValueError for what cannot be.
    """
    found = []
    for one, said, given, possible in _unusual(values):
        if not possible:
            raise ValueError(
                f"Argument `{one.of[0]}` must be one of a crusher, but {said}, with {given}."
            )
        found.append(f"{said}: is {given} meant?")
    return found


def warn_of_unusual(values: Mapping[str, Any]) -> None:
    """Warn of what is unusual or cannot be in a description, of each ratio once in a process."""
    for one, said, given, _ in _unusual(values):
        warn_once(one.words, f"{said}: is {given} meant?", UnusualNumbers)


def require_possible(values: Mapping[str, Any], axes: Mapping[str, Sequence[Any]]) -> None:
    """ValueError as `remarks`, of a description at either end of each axis, one at a time."""
    for name, axis in axes.items():
        for end in (axis[0], axis[-1]):
            remarks({**values, name: end})


def _number(value: float, unit: str) -> str:
    return f"{value:.3g} {unit}".rstrip()


# The numbers that differ from machine to machine.
OF_A_MACHINE = (
    *("bore_radius", "shaft.", "jaw.", "toggle.", "bearing.", "chamber.", "rod."),
    *("elbow.bore_radius", "pivot.bore_radius", "foundation.", "rollers."),
)
# The laws that have a force of their own, or none.
WITHOUT_LOAD = ("none", "by_angle", "chamber")


def borrowed(given: Mapping[str, Any]) -> list[str]:
    """Return which numbers of a machine are the PE250x400's in a description.

    Those of a part that it need not have, such as rollers or supports, count where it has it.
    """
    known = set(given) | ({"load"} if given.get("load_law") in WITHOUT_LOAD else set())
    left = (CHAMBER.keys() | complete(given).keys()) - known
    return [n for n in NUMBERS if n in left and (n == "load" or n.startswith(OF_A_MACHINE))]


def tell_borrowed(given: Mapping[str, Any], path: Path | None) -> None:
    """Print on standard error which numbers of a machine a scene file leaves to the PE250x400."""
    if path is not None and (names := borrowed(given)):
        listed = ", ".join(f"{name} {readable(name, NUMBERS[name].default)}" for name in names)
        tell(f"{path} leaves {len(names)} numbers to the PE250x400: {listed}.")


def tell_unusual(values: Mapping[str, Any]) -> None:
    """Print the `remarks` on a machine on standard error; ValueError as they do."""
    for line in remarks(values):
        tell(f"unusual: {line}")

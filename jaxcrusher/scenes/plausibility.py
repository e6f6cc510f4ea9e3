"""Whether a crusher's numbers are plausible: ratios that are far off after a mistake in units.

A clearance of 100 mm in a bore of 130 mm, or a jaw of 0.5 kg, has a unit and lies inside its
limits, but is still a mistake. So is a throw given as an eccentricity, and a diameter given as a
radius.
"""

import operator
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from jaxcrusher.basics.checks import concrete
from jaxcrusher.basics.setup import UnusualNumbers, warn_once
from jaxcrusher.crusher.loads import AbstractConstantLoad
from jaxcrusher.files.text import digits_apart
from jaxcrusher.scenes.parameters import (
    CHAMBER,
    LAWS,
    LOOSE_JOINTS,
    NUMBERS,
    PAPER_CHAMBER,
    PREFIXES,
    Parameter,
    complete,
    readable,
)

STANDARD_GRAVITY = 9.80665  # m/s2


@dataclass(frozen=True)
class Ratio:
    """A ratio that is alike in small and large crushers, with its usual and its possible range.

    `ratio` takes the numbers named `of`, in SI units. Without `words` it is called by these names.
    """

    of: tuple[str, ...]
    limits: tuple[float, float, float, float]  # least possible, usual from and to, most possible
    source: str  # of the usual range
    ratio: Callable[..., float] = operator.truediv
    words: str = ""
    unit: str = ""
    may_be_zero: bool = False


RATIOS = (
    Ratio(
        ("clearance", "bore_radius"),
        (0.0, 1e-4, 5e-3, 0.1),
        "journal bearings have about 0.001 (Hamrock, Schmid and Jacobson)",
    ),
    *(
        Ratio(
            (f"{joint}.clearance", f"{joint}.bore_radius"),
            (0.0, 1e-4, 0.02, 0.3),
            "judged: a toggle's seat is no bearing, and wears",
        )
        for joint in LOOSE_JOINTS
    ),
    *(
        Ratio(
            (f"{prefix}film.width", f"{prefix}bore_radius"),
            (1e-3, 0.1, 3.0, 20.0),
            "judged: plain bearings are half as wide as their diameter, to once and a half",
        )
        for prefix in PREFIXES
    ),
    Ratio(
        ("clearance", "shaft.eccentricity"),
        (0.0, 1e-4, 0.1, 1.0),
        "the paper's box has 0.003 to 0.012; at 1 the play swallows the throw",
    ),
    Ratio(
        ("jaw.mass_centre_distance", "jaw.length"),
        (-1.0, 0.2, 0.7, 1.0),
        "the PE250x400 has 0.43; at 1 the jaw's mass centre is beyond its end",
    ),
    Ratio(
        ("shaft.eccentricity", "jaw.length"),
        (0.0, 3e-3, 0.05, 0.5),
        "the PE250x400 has 0.014, and the range is judged from it",
    ),
    Ratio(
        ("bore_radius", "jaw.length"),
        (0.0, 0.04, 0.35, 1.0),
        "the PE250x400 has 0.19, and the range is judged from it",
    ),
    Ratio(
        ("jaw.mass", "jaw.length"),
        (20.0, 300.0, 5000.0, 5e4),
        "the PE250x400 has 1561, and the range is judged from it",
        lambda mass, length: mass / length**3,
        words="mass of the jaw over its cubed length",
        unit="kg/m3",
    ),
    Ratio(
        ("toggle.mass", "toggle.length", "chamber.width"),
        (1.0, 50.0, 8000.0, 5e4),
        "the PE250x400 has 611; solid steel as thick as it is long has 7850",
        lambda mass, length, width: mass / (length**2 * width),
        words="mass of the toggle over its squared length and the chamber's width",
        unit="kg/m3",
    ),
    Ratio(
        ("shaft.mass", "bore_radius", "chamber.width"),
        (1e-3, 0.1, 30.0, 1e3),
        "the PE250x400 has 0.57; flywheels on it count",
        lambda mass, radius, width: mass / (7850 * np.pi * radius**2 * width),
        words="mass of the shaft over that of a steel cylinder as wide as bore and chamber",
    ),
    *(
        Ratio(
            (f"{body}.inertia", f"{body}.mass", f"{body}.length"),
            (0.01, 0.15, 0.8, 3.0),
            f"a uniform bar has 0.29, the PE250x400 as printed {printed}",
            lambda inertia, mass, length: (inertia / mass) ** 0.5 / length,
            words=f"radius of gyration of the {body} / {body}.length",
        )
        for body, printed in (("jaw", "0.71"), ("toggle", "0.60"))
    ),
    Ratio(
        ("speed", "shaft.eccentricity"),
        (0.0, 0.1, 4.0, 100.0),
        "the paper's box has 0.64 to 1.63: what is crushed has to fall meanwhile",
        lambda speed, eccentricity: speed**2 * eccentricity / STANDARD_GRAVITY,
        words="acceleration of the eccentric / 9.81 m/s2",
    ),
    Ratio(
        ("speed", "bore_radius"),
        (0.0, 0.3, 15.0, 200.0),
        "the paper's box has 3.3 to 5.2",
        lambda speed, radius: speed * radius,
        words="speed of the bore's surface",
        unit="m/s",
    ),
    Ratio(
        ("young",),
        (1e-3, 40.0, 700.0, 1300.0),
        "tin alloys have 50, steel 207, cemented carbide 650, diamond 1200",
        lambda young: 1e-9 * young,
        unit="GPa",
    ),
    Ratio(
        ("shaft.eccentricity", "chamber.discharge", "chamber.height", "chamber.nip_angle"),
        (0.0, 0.03, 0.15, 2.0),
        "judged: the PE250x400 has 0.08, others 0.07 to 0.14; eccentricity is half of the throw",
        lambda eccentricity, discharge, height, nip: (
            2 * eccentricity / (discharge + 2 * height * np.tan(nip / 2))
        ),
        words="twice the eccentricity over the width of the mouth",
    ),
    Ratio(
        ("bore_radius", "shaft.eccentricity"),
        (0.0, 5.0, 18.0, 1e3),
        "judged: the PE250x400 has 13, machines with roller bearings 6 to 14",
    ),
    Ratio(
        ("load", "chamber.width", "chamber.height"),
        (0.0, 0.01, 3.0, 100.0),
        "the PE250x400 has 0.04 in the paper; jaw crushers are built for some 2.7",
        lambda load, width, height: 1e-6 * load / (width * height),
        words="load over width and height of the chamber",
        unit="MPa",
    ),
    Ratio(
        ("load", "shaft.eccentricity", "speed", "motor_power"),
        (0.0, 0.02, 5.0, 1e3),
        "judged: machines have 1.5 to 1.7, the PE250x400 with the paper's load 0.06",
        lambda load, eccentricity, speed, power: load * eccentricity * speed / (np.pi * power),
        words="power of the load over twice the eccentricity in each turn / motor_power",
    ),
    Ratio(
        ("rod.preload", "jaw.mass", "gravity"),
        (0.0, 0.0, 10.0, 1e4),
        "judged: 0.6 keeps the PE250x400's toggle in its seats at idle",
        lambda preload, mass, gravity: preload / (mass * max(gravity, 1e-3)),
        words="preload of the rod / weight of the jaw",
    ),
    Ratio(
        ("chamber.bed_modulus",),
        (0.0, 0.5, 1000.0, 1e6),
        "judged: 20 makes a mean of the paper's load, 500 the power of a motor of 15 kW",
        lambda modulus: 1e-6 * modulus,
        unit="MPa",
    ),
    Ratio(
        (
            "rollers.static_rating",
            "rollers.diameter",
            "rollers.pitch_diameter",
            "rollers.count",
            "rollers.length",
        ),
        (1e-2, 0.7, 1.4, 100.0),
        "ISO 76 for radial roller bearings",
        # 44 of ISO 76 is for N and mm.
        lambda rating, roller, pitch, count, length: (
            rating / (44e6 * max(1 - roller / pitch, 1e-3) * count * length * roller)
        ),
        words="static rating of the rollers over that of their size",
    ),
    Ratio(
        ("rollers.dynamic_rating", "rollers.static_rating"),
        (1e-2, 0.35, 1.6, 100.0),
        "judged: catalogues have 0.4 for large and 1.3 for small roller bearings",
    ),
    Ratio(
        ("bore_radius", "rollers.pitch_diameter"),
        (0.1, 0.55, 0.8, 10.0),
        "judged: spherical roller bearings have 0.63, of half of their outer diameter",
    ),
    Ratio(
        ("rollers.pitch_diameter", "rollers.bore"),
        (0.1, 1.15, 1.8, 10.0),
        "judged: spherical roller bearings have 1.3 to 1.6",
    ),
    Ratio(
        ("gravity",),
        (0.0, 9.76, 9.84, 100.0),
        "that of the Earth's surface",
        lambda gravity: gravity,
        unit="m/s2",
    ),
    Ratio(
        ("foundation.vertical_stiffness", "foundation.mass"),
        (0.01, 2.0, 80.0, 1e6),
        "judged: springs have 2 to 8, a block on soil 10 to 50",
        lambda stiffness, mass: (2 * stiffness / mass) ** 0.5 / (2 * np.pi),
        words="vertical natural frequency of the block without the mechanism",
        unit="Hz",
    ),
    Ratio(
        ("foundation.vertical_damping", "foundation.vertical_stiffness", "foundation.mass"),
        (0.0, 5e-3, 0.9, 1e3),
        "judged: steel springs have 0.01, soil under a block up to 0.7",
        lambda damping, stiffness, mass: damping / (2 * stiffness * mass) ** 0.5,
        words="vertical damping ratio of the block",
    ),
    Ratio(
        ("foundation.inertia", "foundation.mass", "foundation.left", "foundation.right"),
        (0.01, 0.2, 1.2, 1e4),
        "judged: a square block as wide as its supports has 0.41",
        lambda inertia, mass, left, right: (inertia / mass) ** 0.5 / max(abs(right - left), 1e-3),
        words="radius of gyration of the block over the distance of its supports",
    ),
    Ratio(
        ("foundation.y", "foundation.base", "foundation.left", "foundation.right"),
        (-10.0, 0.0, 2.0, 50.0),
        "judged: a block stands on its base, below its mass centre",
        lambda y, base, left, right: (y - base) / max(abs(right - left), 1e-3),
        words="height of the block's mass centre above its base over the distance of its supports",
    ),
    Ratio(
        ("foundation.soil.shear_modulus",),
        (0.1, 5.0, 5000.0, 1e5),
        "soft clay has 5, dense gravel 300, weak rock some thousands (of small strains, judged)",
        lambda modulus: 1e-6 * modulus,
        unit="MPa",
    ),
    Ratio(
        ("foundation.soil.shear_wave_speed",),
        (5.0, 50.0, 1500.0, 5000.0),
        "soft clay has 60, dense gravel 400, weak rock 1000 (judged)",
        lambda speed: speed,
        unit="m/s",
    ),
    Ratio(
        ("foundation.soil.density",),
        (100.0, 1200.0, 2700.0, 1e4),
        "soils have 1500 to 2200, rock up to 2700",
        lambda density: density,
        unit="kg/m3",
    ),
    Ratio(
        ("foundation.mass", "foundation.soil.length", "foundation.soil.width", "gravity"),
        (1e-2, 3.0, 400.0, 1e5),
        "judged: soils are asked to carry 50 to 300",
        lambda mass, length, width, gravity: 1e-3 * mass * gravity / (length * width),
        words="weight of the block over its base",
        unit="kPa",
    ),
    Ratio(
        ("chamber.nip_angle",),
        (0.0, 14.0, 27.0, 45.0),
        "jaw crushers have 18 to 24; rock is squeezed out above twice its angle of friction",
        lambda angle: np.degrees(angle),
        unit="deg",
    ),
    Ratio(
        ("chamber.height", "jaw.length"),
        (0.05, 0.4, 1.5, 5.0),
        "the PE250x400 has 0.86",
    ),
    Ratio(
        ("chamber.discharge", "chamber.height"),
        (0.0, 0.015, 0.3, 1.0),
        "the PE250x400 has 0.06, and offers 20 to 60 mm in 0.6 m",
    ),
)


# Those of what any machine may have: the frame that it stands on, and gravity if it is upright.
RULES_OF_FRAME = tuple(
    replace(rule, may_be_zero=rule.of == ("gravity",))
    for rule in RATIOS
    if all(name == "gravity" or name.startswith("foundation.") for name in rule.of)
)
_JOINT = Ratio(
    ("clearance", "bore_radius"),
    (0.0, 1e-4, 0.06, 0.3),
    "journal bearings have about 0.001, joints of papers up to 0.05 (judged)",
)


def rules_of_joint(prefix: str) -> list[Ratio]:
    """Return the ratios of a loose joint whose names have a prefix."""
    parts = "clearance", "bore_radius", "young", "rollers."
    shared = (rule for rule in RATIOS[1:] if all(name.startswith(parts) for name in rule.of))
    return [replace(rule, of=tuple(prefix + n for n in rule.of)) for rule in (_JOINT, *shared)]


def has_constant_load(values: Mapping[str, Any]) -> bool:
    """Return whether the load is the number `load`; other laws have their own force, or none."""
    law = LAWS["load_law"].get(values.get("load_law", ""), AbstractConstantLoad)
    return law is not None and issubclass(law, AbstractConstantLoad)


def _unusual(
    rules: Iterable[Ratio], values: Mapping[str, Any], known: Mapping[str, Parameter]
) -> Iterator[tuple[Ratio, str, str, bool]]:
    """Yield each ratio that is unusual, what is said of it, its numbers, and if it can be."""
    for rule in rules:
        there = (concrete(values[name]) for name in rule.of if name in values)
        numbers = [float(number) for number in there if number is not None and number.ndim == 0]
        if len(numbers) < len(rule.of):
            continue
        ratio = float(rule.ratio(*numbers))
        least, low, high, most = rule.limits
        if low <= ratio <= high or (rule.may_be_zero and ratio == 0):
            continue
        told = zip(rule.of, numbers, strict=True)
        given = ", ".join(f"{name} {readable(name, number, known)}" for name, number in told)
        count = digits_apart(ratio, low if ratio < low else high, 3)
        rounded = (float(f"{value:.{count}g}") for value in (ratio, low, high))
        texts = (f"{value:.15g} {rule.unit}".rstrip() for value in rounded)
        title = rule.words or " / ".join(rule.of)
        said = "{} is {}, usually {} to {} ({})".format(title, *texts, rule.source)
        yield rule, said, given, least <= ratio <= most


def _of_crusher(values: Mapping[str, Any]) -> tuple[list[Ratio], dict[str, Any]]:
    """Return the ratios of a crusher whose numbers are all used, and its numbers."""
    v = {**PAPER_CHAMBER, **complete(values)}
    load = concrete(v["load"])
    without = not has_constant_load(v) or (load is not None and not np.any(load))
    # What the motion is not made of nobody means.
    unused = ({"load"} if without else set()) | ({"clearance"} if v["joint"] == "ideal" else set())
    return [rule for rule in RATIOS if not unused & set(rule.of)], v


def remarks(values: Mapping[str, Any]) -> list[str]:
    """Say what is unusual in a description, a line each, with the usual range and its source.

    `values` as in `jaxcrusher.build_scene`; a ratio of traced numbers is left out. Raises
    ValueError for impossible numbers.
    """
    return remarks_by(*_of_crusher(values), NUMBERS)


def remarks_by(
    rules: Iterable[Ratio], values: Mapping[str, Any], known: Mapping[str, Parameter]
) -> list[str]:
    """Return the remarks of any machine by given ratios; `known` describes its numbers."""
    lines = []
    for rule, said, given, possible in _unusual(rules, values, known):
        if not possible:
            raise ValueError(f"Argument `{rule.of[0]}` must be possible, but {said}, with {given}.")
        lines.append(f"{said}: is {given} meant?")
    return lines


def warn_of_unusual(values: Mapping[str, Any]) -> None:
    """Warn of unusual or impossible numbers of a description, once in a process for each value."""
    for _, said, given, _ in _unusual(*_of_crusher(values), NUMBERS):
        text = f"{said}: is {given} meant?"
        warn_once(text, text, UnusualNumbers)


# The numbers that differ from machine to machine.
OF_A_MACHINE = (
    *("bore_radius", "shaft.", "jaw.", "toggle.", "bearing.", "chamber.", "rod."),
    *(*(f"{joint}.bore_radius" for joint in LOOSE_JOINTS), "foundation.", "rollers."),
)


def borrowed(given: Mapping[str, Any]) -> list[str]:
    """Return which numbers of a machine are the PE250x400's in a description.

    Those of a part that it need not have, such as rollers or supports, count where it has it.
    """
    known = set(given) | (set() if has_constant_load(given) else {"load"})
    left = (CHAMBER.keys() | complete(given).keys()) - known
    return [n for n in NUMBERS if n in left and (n == "load" or n.startswith(OF_A_MACHINE))]

"""Crushers whose numbers are all drawn at random, three times as widely as crushers have them."""

import math
import random
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from jaxcrusher.scenes.parameters import PARAMETERS
from jaxcrusher.scenes.plausibility import RATIOS, STANDARD_GRAVITY

WIDE = 3.0
USUAL = {(one.words or " / ".join(one.of)): one.limits[1:3] for one in RATIOS}
LENGTH, ACROSS = (
    "jaw.length",
    "mass of the shaft over that of a steel cylinder as wide as bore and chamber",
)
POINTS = 12  # of a load curve


@dataclass(frozen=True)
class Kind:
    """Crushers of one structure: their loose joints, their choices, and their further parts."""

    name: str
    choices: dict[str, Any]
    loose: tuple[str, ...] = ()
    parts: tuple[str, ...] = ()  # "foundation", "rod", "feed"


KINDS = (
    Kind("A", {}),
    Kind("A, multipliers", {"formulation": "multiplier", "slip": "surface"}),
    Kind("A, Flores, on supports", {"contact_law": "flores"}, parts=("foundation",)),
    Kind("A, tracked, closing stroke", {"impact_law": "tracked", "load_law": "closing_stroke"}),
    Kind("A, Gonthier, rod", {"contact_law": "gonthier", "load_law": "none"}, parts=("rod",)),
    Kind("A, rough load curve", {"contact_law": "hu_guo", "load_law": "by_angle"}, parts=("feed",)),
    Kind("rollers, chamber", {"contact_law": "rollers", "load_law": "chamber"}),
    Kind("A, B, C", {"load_law": "normal_to_jaw", "slip": "surface"}, ("elbow", "pivot")),
    Kind("B, C", {"joint": "ideal"}, ("elbow", "pivot")),
    Kind(
        "A, B, C, on supports, rod, chamber",
        {"contact_law": "zhiying_qishao", "load_law": "chamber", "elbow.contact_law": "flores"},
        ("elbow", "pivot"),
        ("foundation", "rod"),
    ),
)


def numbers(kind: Kind, seed: str, spread: float = WIDE) -> dict[str, Any]:
    """Draw a description, `spread` times as widely as usual; its numbers may make no crusher."""
    chance = random.Random(seed)

    def between(low: float, high: float) -> float:
        return math.exp(chance.uniform(math.log(low), math.log(high)))

    def wide(words: str) -> float:
        low, high = USUAL[words]
        return between(low / spread, spread * high) if low > 0 else chance.uniform(0, spread * high)

    def times(name: str) -> float:
        return PARAMETERS[name].default * between(1 / spread, spread)

    length, gravity = times(LENGTH), times("gravity")
    width, height = (
        0.6 * length * between(1 / spread, spread),
        length * wide("chamber.height / jaw.length"),
    )
    throw = length * min(0.3, wide("shaft.eccentricity / jaw.length"))
    bore = length * wide("bore_radius / jaw.length")
    toggle = 0.43 * length * chance.uniform(0.7, 1.4)
    jaw_mass = length**3 * wide("mass of the jaw over its cubed length")
    toggle_mass = (
        toggle**2
        * width
        * wide("mass of the toggle over its squared length and the chamber's width")
    )
    v: dict[str, Any] = {
        **kind.choices,
        "start": chance.choice(("centred", "contact")),
        "gravity": gravity,
        "speed": math.sqrt(
            wide("acceleration of the eccentric / 9.81 m/s2") * STANDARD_GRAVITY / throw
        ),
        "shaft.eccentricity": throw,
        "shaft.mass": 7850 * math.pi * bore**2 * width * wide(ACROSS),
        "shaft.mass_centre_radius": chance.uniform(0, spread) * 0.6 * throw,
        "shaft.mass_centre_angle": chance.uniform(-math.pi, math.pi),
        "jaw.length": length,
        "jaw.mass": jaw_mass,
        "jaw.inertia": jaw_mass
        * (length * wide("radius of gyration of the jaw / jaw.length")) ** 2,
        "jaw.mass_centre_distance": length
        * min(1.0, wide("jaw.mass_centre_distance / jaw.length")),
        "jaw.mass_centre_angle": chance.uniform(-0.8, 0.8),
        "toggle.length": toggle,
        "toggle.mass": toggle_mass,
        "toggle.inertia": toggle_mass
        * (toggle * wide("radius of gyration of the toggle / toggle.length")) ** 2,
        "bearing.distance": 0.92 * length * chance.uniform(0.85, 1.15),
        "bearing.inclination": chance.uniform(-0.2, spread * 0.39),
        "counterweight.mass": chance.choice((0.0, 0.1 * jaw_mass * chance.random())),
        "counterweight.radius": 0.3 * length,
        "counterweight.angle": chance.uniform(-math.pi, math.pi),
        "load": 1e6 * width * height * wide("load over width and height of the chamber"),
    }
    if kind.choices.get("joint") != "ideal":
        v |= {"bore_radius": bore, "clearance": bore * wide("clearance / bore_radius")}
        v |= _steel("", chance, between, wide)
    for joint in kind.loose:
        seat = bore * between(0.1, 1.0)
        ratio = wide(f"{joint}.clearance / {joint}.bore_radius")
        v |= {f"{joint}.bore_radius": seat, f"{joint}.clearance": seat * ratio}
        v |= _steel(f"{joint}.", chance, between, wide)
    if "foundation" in kind.parts:
        v |= _foundation(jaw_mass, length, times, wide, chance)
    if "rod" in kind.parts:
        preload = wide("preload of the rod / weight of the jaw") * jaw_mass * gravity
        v |= {"rod.preload": preload, "rod.stiffness": preload / (0.1 * length)}
        v |= {"rod.damping": 0.01 * preload * chance.random()}
        v |= {"rod.jaw_along": 0.93 * length, "rod.jaw_across": -0.07 * length}
        v |= {"rod.x": -0.43 * length, "rod.y": -0.2 * length}
    if v.get("load_law") == "by_angle":
        angle = 2 * np.pi * np.arange(POINTS) / POINTS
        force = [v["load"] * chance.random() for _ in angle]
        v["load_curve"] = np.stack([angle, np.array(force)], axis=1)
    if "feed" in kind.parts:
        v |= {"load_scatter": chance.random(), "load_seed": float(chance.randrange(10**6))}
        v |= {"load_bandwidth": between(1, 30)}
    if v.get("load_law") == "chamber":
        v |= {"chamber.width": width, "chamber.height": height}
        v["chamber.discharge"] = height * wide("chamber.discharge / chamber.height")
        v["chamber.bed_modulus"] = 1e6 * wide("chamber.bed_modulus")
        v["chamber.bed_exponent"] = chance.uniform(1, 6)
    if v.get("contact_law") == "rollers":
        v |= _rollers(bore, times, wide, chance)
    return v


def _steel(
    prefix: str,
    chance: random.Random,
    between: Callable[[float, float], float],
    wide: Callable[[str], float],
) -> dict[str, float]:
    """Draw what a joint's contact is made of."""
    return {
        f"{prefix}young": 1e9 * wide("young"),
        f"{prefix}poisson": chance.uniform(0, 0.5),
        f"{prefix}restitution": chance.uniform(0.01, 1),
        f"{prefix}friction": between(1e-3, 1),
        f"{prefix}impact_velocity": between(0.02, 10),
    }


def _foundation(
    jaw: float,
    length: float,
    times: Callable[[str], float],
    wide: Callable[[str], float],
    chance: random.Random,
) -> dict[str, float]:
    """Draw a frame on supports."""
    mass = 11 * jaw * times("foundation.mass") / PARAMETERS["foundation.mass"].default
    pulse = 2 * np.pi * wide("vertical natural frequency of the block without the mechanism")
    ratio = wide("vertical damping ratio of the block")
    sideways = chance.uniform(0.2, 2)
    stiffness, damping = mass * pulse**2 / 2, ratio * mass * pulse
    return {
        "foundation.mass": mass,
        "foundation.inertia": mass * (length * chance.uniform(0.3, 2)) ** 2,
        "foundation.x": length * chance.uniform(-1, 1),
        "foundation.y": length * chance.uniform(-1, 1),
        "foundation.left": -length * chance.uniform(0.5, 3),
        "foundation.right": length * chance.uniform(0.5, 3),
        "foundation.base": -length * chance.uniform(0, 3),
        "foundation.vertical_stiffness": stiffness,
        "foundation.horizontal_stiffness": sideways * stiffness,
        "foundation.vertical_damping": damping,
        "foundation.horizontal_damping": sideways * damping,
    }


def _rollers(
    bore: float,
    times: Callable[[str], float],
    wide: Callable[[str], float],
    chance: random.Random,
) -> dict[str, float]:
    """Draw the rollers of a bearing that fits the bore; friction and ratings as of others."""
    pitch = 1.5 * bore * chance.uniform(0.8, 1.2)
    wheel = pitch * chance.uniform(0.05, 0.4)
    count, long = float(round(times("rollers.count"))), wheel * chance.uniform(0.5, 2)
    size = 44e6 * (1 - wheel / pitch) * count * long * wheel
    return {
        "rollers.bearings": float(chance.randint(1, 4)),
        "rollers.count": count,
        "rollers.length": long,
        "rollers.diameter": wheel,
        "rollers.pitch_diameter": pitch,
        "rollers.damping": times("rollers.damping"),
        "rollers.friction": times("rollers.friction"),
        "rollers.static_rating": size
        * wide("static rating of the rollers over that of their size"),
    }

"""The problem that the options of the design study describe."""

from dataclasses import asdict
from typing import Any

import numpy as np

from jaxcrusher.basics.checks import require, require_whole, require_within
from jaxcrusher.scenes.parameters import PE250X400
from jaxcrusher.scenes.plausibility import tell_borrowed, tell_unusual
from jaxcrusher.scenes.scene_file import read_overrides, read_scene_file, scene_of
from optimize.balance.options import MOST_LINKS, MOST_MACHINE, Options
from optimize.design import CounterweightMoment, Design
from optimize.stroke import EqualStroke

LINKS = ("toggle.length", "bearing.distance", "bearing.inclination", "jaw.length")
# What is free as well with `--machine`.
MACHINE = (
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
# What the machine meets and does not choose, unless it is free; each has a tolerance.
CONDITIONS: tuple[str, ...] = ("clearance", "friction", "load")
# A flywheel of the PE250x400 has room for it; 14 kg m at the smallest radius are 200 kg.
COUNTERWEIGHT = {
    "counterweight.moment_along": (-14.0, 14.0),
    "counterweight.moment_across": (-14.0, 14.0),
    "counterweight.radius": (0.1, 0.35),
}
# The mass centre of the jaw may move by this share of its distance, and by this angle (rad).
DISTANCE, ANGLE = 0.1, float(np.radians(10))


def check(options: Options) -> None:
    """Raise ValueError for a value outside its limits, before anything is compiled.

    What is unusual of the machine, and what a scene file leaves to the paper, is told.
    """
    values = machine(options)
    require(values["joint"] != "ideal", "scene", "have a joint with clearance", "ideal")
    scene_of(values, options.scene)
    tell_unusual(values)
    if options.scene is not None:
        tell_borrowed(read_scene_file(options.scene), options.scene)
    good = 0 < options.links <= MOST_LINKS
    require(good, "links", f"lie in (0, {MOST_LINKS:g}] percent", options.links)
    good = 0 <= options.machine <= MOST_MACHINE
    require(good, "machine", f"lie in [0, {MOST_MACHINE:g}] percent", options.machine)
    for name, least in (
        ("starts", 1),
        ("budget", 1),
        ("samples", 2),
        ("settle", 2),
        ("seed", 0),
    ):
        require_whole(name, getattr(options, name), least)
    for width in options.tolerance:
        require_within("tolerance", width, 0.0, 0.9)
    require_within("sigmas", options.sigmas, 0.0, 10.0)


def settings(options: Options) -> dict[str, Any]:
    """Return the settings that decide the answer."""
    kept, apart = asdict(options), ("name", "out", "scene", "overrides")
    return {name: kept[name] for name in kept if name not in apart} | {"scene": machine(options)}


def machine(options: Options) -> dict[str, Any]:
    """Return the description of the machine to begin with, at rest in contact."""
    given = {} if options.scene is None else read_scene_file(options.scene)
    return {**PE250X400, **given, **read_overrides(options.overrides), "start": "contact"}


def title(options: Options) -> str:
    """Return what the machine to begin with is called."""
    return "paper" if options.scene is None else options.scene.stem


def reference(options: Options) -> dict[str, Any]:
    """Return the machine to begin with, its counterweight by its moment as in the design."""
    values = machine(options)
    moment = values["counterweight.mass"] * values["counterweight.radius"]
    angle = values["counterweight.angle"]
    return values | {
        "counterweight.moment_along": moment * np.cos(angle),
        "counterweight.moment_across": moment * np.sin(angle),
    }


def conditions(options: Options) -> dict[str, float]:
    """The clearance (m), friction and load (N, unless it is free) that the machine is meant for."""
    described, free = machine(options), free_percent(options)
    return {name: float(described[name]) for name in CONDITIONS if name not in free}


def free_percent(options: Options) -> dict[str, float]:
    """Names of what may change by a share of itself, with the percent."""
    machine = dict.fromkeys(MACHINE, options.machine) if options.machine else {}
    return {**dict.fromkeys(LINKS, options.links), **machine}


def design(options: Options) -> Design:
    """Nine free parameters, or 21; the eccentricity follows from the machine's stroke."""
    values = machine(options)
    distance, angle = values["jaw.mass_centre_distance"], values["jaw.mass_centre_angle"]
    bounds = {
        **COUNTERWEIGHT,
        "jaw.mass_centre_distance": (distance * (1 - DISTANCE), distance * (1 + DISTANCE)),
        "jaw.mass_centre_angle": (angle - ANGLE, angle + ANGLE),
    }
    for name, percent in free_percent(options).items():
        value = values[name]
        bounds[name] = (value * (1 - percent / 100), value * (1 + percent / 100))
    follows = ("shaft.eccentricity", "counterweight.mass", "counterweight.angle")
    kept = {name: value for name, value in values.items() if name not in (*bounds, *follows)}
    return Design(bounds, kept, (CounterweightMoment(), EqualStroke.of(values)))

"""The problem that the options of the design study describe."""

from dataclasses import asdict
from typing import Any

import numpy as np

from jaxcrusher.basics.checks import require, require_whole, require_within
from jaxcrusher.crusher.scene import require_clearance
from jaxcrusher.scenes.parameters import PARAMETERS, PE250X400
from jaxcrusher.scenes.scene_file import read_text
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
# A flywheel of this crusher has room for it; 14 kg m at the smallest radius are 200 kg.
COUNTERWEIGHT = {
    "counterweight.moment_along": (-14.0, 14.0),
    "counterweight.moment_across": (-14.0, 14.0),
    "counterweight.radius": (0.1, 0.35),
}
# No counterweight: the paper's machine, at the radius of the description.
PAPER = {**PE250X400, "counterweight.moment_along": 0.0, "counterweight.moment_across": 0.0}


def check(options: Options) -> None:
    """Raise ValueError for a value outside its limits, before anything is compiled."""
    read_text("speed", options.speed)
    require_clearance(read_text("clearance", options.clearance), PE250X400["bore_radius"])
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
    kept = asdict(options)
    return {name: kept[name] for name in kept if name not in ("name", "out")}


def conditions(options: Options) -> dict[str, float]:
    """The clearance (m), friction and load (N, unless it is free) that the machine is meant for."""
    described = {**PE250X400, "clearance": read_text("clearance", options.clearance)}
    free = free_percent(options)
    return {name: float(described[name]) for name in CONDITIONS if name not in free}


def free_percent(options: Options) -> dict[str, float]:
    """Names of what may change by a share of itself, with the percent."""
    machine = dict.fromkeys(MACHINE, options.machine) if options.machine else {}
    return {**dict.fromkeys(LINKS, options.links), **machine}


def design(options: Options) -> Design:
    """Nine free parameters, or 21; the eccentricity follows from the paper's stroke."""
    bounds = {
        **COUNTERWEIGHT,
        "jaw.mass_centre_distance": (0.27, 0.33),
        "jaw.mass_centre_angle": (float(np.radians(5)), float(np.radians(25))),
    }
    for name, percent in free_percent(options).items():
        value = PARAMETERS[name].default
        bounds[name] = (value * (1 - percent / 100), value * (1 + percent / 100))
    fixed = {"speed": read_text("speed", options.speed), "start": "contact", **conditions(options)}
    return Design(bounds, fixed, (CounterweightMoment(), EqualStroke.of({})))

"""The least force on the ground for a given amplitude of the block, by two ways of search."""

import itertools
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import matplotlib.pyplot as plt
import numpy as np
import scipy.optimize
from matplotlib.figure import Figure

import jaxcrusher as jc
from benchmarks.pages import publish, table
from jaxcrusher.files.progress import progress
from jaxcrusher.files.results import results_folder
from jaxcrusher.pictures.page import WIDTH
from jaxcrusher.scenes.build import build_chamber
from optimize import smooth
from optimize.design import Design
from optimize.evaluate import Case
from optimize.limits import OF_ORBIT
from optimize.local import Smooth, descend, once
from optimize.objectives import OBJECTIVES

# The block of docs/foundation.md on steel springs, whose dampers are small.
FIXED = {
    "speed": 30.0,
    "clearance": 0.06e-3,
    "foundation.mass": 6e3,
    "foundation.inertia": 2.5e3,
    "foundation.x": 0.3,
    "foundation.y": 0.2,
    "foundation.left": -0.7,
    "foundation.right": 0.9,
    "foundation.base": -0.6,
    "foundation.horizontal_damping": 2e4,
    "foundation.vertical_damping": 2e4,
}
SPRINGS = {
    "foundation.horizontal_stiffness": (0.5e6, 20e6),
    "foundation.vertical_stiffness": (0.5e6, 20e6),
}
COUNTERWEIGHT = {
    "counterweight.mass": (0.0, 60.0),
    "counterweight.angle": (np.radians(120.0), np.radians(240.0)),
}
LIMITS = (0.05e-3, 0.1e-3, 0.15e-3, 0.2e-3, 0.3e-3, 0.5e-3, 0.8e-3, 1.2e-3, 2e-3)  # m
COMPARED_AT = 0.15e-3
STEPS = 60
# The rival works on numbers of order one. What it gets where there is no orbit is worse than any.
FORCE, NO_FORCE = 1e3, 1e5  # N
ALONE, BALANCED = "springs alone", "springs and counterweight"
# Corners of the springs' box, from which every search starts.
CORNERS = (0.1, 0.9)


class End(NamedTuple):
    """The end of a search: force (N), point of the unit box, orbits solved, CPU seconds."""

    force: float  # NaN where the limit is not kept
    point: np.ndarray
    orbits: int
    seconds: float


class Search:
    """The force on the ground and the block's amplitude as functions of what is free.

    The springs are, and the counterweight too if `balanced`.
    """

    def __init__(self, balanced: bool):
        free = SPRINGS | (COUNTERWEIGHT if balanced else {})
        chamber = build_chamber(jc.PE250X400)
        case = Case(Design(free, FIXED), OBJECTIVES["transmitted_rms"], chamber)
        amplitude = replace(case, objective=OBJECTIVES["frame_displacement_peak"])
        self.design, self.upper = case.design, case.upper
        self.force, self.amplitude = smooth.objective(case), smooth.objective(amplitude)
        rest = [0.5] * (len(free) - len(SPRINGS))
        corners = itertools.product(CORNERS, repeat=len(SPRINGS))
        self.starts = [np.array([*corner, *rest]) for corner in corners]

    def end(self, limit: float, way: Callable[[Smooth, Smooth], np.ndarray]) -> End:
        """Return the end of a search, which `way` makes of the force and of what the limit spares.

        Each is solved for once at a point.
        """
        seen: tuple[dict, dict] = {}, {}
        spares = smooth.above(smooth.negative(self.amplitude), -limit)
        force, spare = once(self.force, seen[0]), once(spares, seen[1])
        began = time.process_time()
        point = way(force, spare)
        seconds, orbits = time.process_time() - began, sum(map(len, seen))
        kept = spare(point)[0] >= -OF_ORBIT
        return End(force(point)[0] if kept else np.nan, point, orbits, seconds)


def by_gradients(search: Search, limit: float, start: np.ndarray) -> End:
    """Search by SLSQP with the slopes of the orbits."""

    def way(force: Smooth, spare: Smooth) -> np.ndarray:
        return descend(force, start, search.upper, STEPS, (spare,)).path[-1]

    return search.end(limit, way)


def without_gradients(search: Search, limit: float, start: np.ndarray) -> End:
    """Search by COBYQA, the successor of BOBYQA that takes constraints (Ragonneau, Zhang 2024)."""

    def way(force: Smooth, spare: Smooth) -> np.ndarray:
        def value(of: Smooth, point: np.ndarray, nothing: float) -> float:
            found = of(np.clip(point, 0, 1))[0]
            return found if np.isfinite(found) else nothing

        found = scipy.optimize.minimize(
            lambda point: value(force, point, NO_FORCE) / FORCE,
            start,
            method="COBYQA",
            bounds=[(0.0, 1.0)] * len(start),
            constraints=scipy.optimize.NonlinearConstraint(
                lambda point: value(spare, point, -NO_FORCE / FORCE), 0, np.inf
            ),
            options={"initial_tr_radius": 0.2, "final_tr_radius": 1e-6, "maxfev": 1000},
        )
        return np.clip(found.x, 0, 1)

    return search.end(limit, way)


def best(search: Search, limit: float) -> End:
    """Return the least force that descents from all starts come to."""
    ends = [by_gradients(search, limit, start) for start in search.starts]
    return min(ends, key=lambda end: end.force if np.isfinite(end.force) else np.inf)


def run(out: Path) -> None:
    """Search at every limit, compare the ways at one of them; write the page and the figure."""
    folder = results_folder(out)
    springs, both = Search(balanced=False), Search(balanced=True)
    with progress() as bars:
        found = {
            name: [best(one, limit) for limit in bars.track(LIMITS, description=name)]
            for name, one in ((ALONE, springs), (BALANCED, both))
        }
        ends = [
            (
                start,
                by_gradients(both, COMPARED_AT, start),
                without_gradients(both, COMPARED_AT, start),
            )
            for start in bars.track(both.starts, description="two ways")
        ]
    tables = {"limits": limits_table(found, springs.design, both.design), "ways": ways_table(ends)}
    publish(folder, "isolation.md", tables, "scipy", draw=lambda: draw(found))


def limits_table(found: dict[str, list[End]], springs: Design, both: Design) -> str:
    """Return the table of all limits."""
    rows = []
    for limit, with_it, alone in zip(LIMITS, found[BALANCED], found[ALONE], strict=True):
        values, others = both.numbers(with_it.point), springs.numbers(alone.point)
        weight = values["counterweight.mass"], np.degrees(values["counterweight.angle"])
        rows.append(
            [
                f"{1e3 * limit:g}",
                *_cells(with_it, values),
                *(f"{one:.1f}" if np.isfinite(with_it.force) else "" for one in weight),
                *_cells(alone, others),
            ]
        )
    headings = (
        "limit of the amplitude, mm",
        "force, N",
        "horizontal spring, MN/m",
        "vertical spring, MN/m",
        "counterweight, kg",
        "its angle, deg",
        "force without counterweight, N",
        "horizontal spring, MN/m",
        "vertical spring, MN/m",
    )
    return table(headings, rows)


def _cells(end: End, values: dict[str, float]) -> list[str]:
    """Return the force and the springs of an end, nothing of one that does not keep its limit."""
    stiffness = (f"{1e-6 * values[name]:.3g}" for name in SPRINGS)
    return [_force(end), *(text if np.isfinite(end.force) else "" for text in stiffness)]


def _force(end: End) -> str:
    return f"{end.force:.0f}" if np.isfinite(end.force) else "none"


def ways_table(ends: list[tuple[np.ndarray, End, End]]) -> str:
    """Return the table of both ways from every start."""
    rows = [
        [
            ", ".join(f"{share:g}" for share in start[: len(SPRINGS)]),
            *(cell for end in pair for cell in (_force(end), end.orbits, f"{end.seconds:.1f}")),
        ]
        for start, *pair in ends
    ]
    ways = ("SLSQP", "COBYQA")
    headings = [f"{way}: {of}" for way in ways for of in ("force, N", "orbits", "CPU seconds")]
    return table(("springs at the start, shares of the box", *headings), rows)


def draw(found: dict[str, list[End]]) -> Figure:
    """Draw the least force over the limit of the amplitude, with and without a counterweight."""
    fig, ax = plt.subplots(figsize=(WIDTH * 0.7, 3.4), layout="constrained")
    for name, ends in found.items():
        ax.plot(1e3 * np.array(LIMITS), [1e-3 * end.force for end in ends], "o-", label=name)
    ax.set(xscale="log", xlabel="limit of the block's amplitude, mm", ylim=(0, None))
    ax.set(ylabel="RMS of what moves of\nthe force on the ground, kN")
    ticks = [1e3 * limit for limit in LIMITS]
    ax.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    ax.minorticks_off()
    ax.grid(alpha=0.3)
    ax.legend()
    return fig

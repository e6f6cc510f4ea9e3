"""The contest on both problems, its tables and its figure."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
from jaxtyping import Array, Float, Scalar
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import jaxcrusher as jc
from benchmarks.optimisers.methods import METHODS, Objective, Searched, search
from benchmarks.pages import publish, table
from jaxcrusher.files.progress import progress
from jaxcrusher.files.results import results_folder
from jaxcrusher.pictures.plots import WIDTH
from optimize.options import Options
from optimize.problem import resolve
from optimize.sets import SETS

PACKAGES = ("scipy", "optax", "cma", "Py-BOBYQA")
# Random starts of every method, and the work of a search, in values of the objective.
STARTS, BUDGET = 10, 1000
# Nodes a turn: the steady-state RMS of the designs is right to 1e-9 (`PeriodicOrbit.error`).
NODES = 96
# A search has arrived when this share of the gain of the best one is all it still lacks.
ARRIVED = 1e-3


@dataclass(frozen=True)
class Contest:
    """The searches of a problem. `scale` is the RMS (N) of the machine to begin with."""

    word: str  # of --design
    scale: float
    objective: Objective
    searches: Sequence[Searched]

    def of(self, method: str) -> list[Searched]:
        """Return the searches of a method."""
        return [one for one in self.searches if one.method == method]

    @property
    def least(self) -> float:
        """The best value that any search found."""
        return float(np.nanmin([one.best for one in self.searches]))

    @property
    def goal(self) -> float:
        """The value at which a search has arrived; the machine to begin with has 1."""
        return self.least + ARRIVED * max(1 - self.least, 0)


def run(out: Path) -> None:
    """Search both problems by every method, and write the page, its rows and its figure."""
    folder, contests = results_folder(out), []
    with progress(remaining=False) as bars:
        for word in SETS:
            objective, scale, count = orbit_objective(word)
            bar = bars.add_task(word, total=STARTS * len(METHODS))
            searches = []
            for number, start in enumerate(starts(objective, STARTS, count)):
                for method in METHODS:
                    searches.append(search(method, objective, start, BUDGET, number))
                    bars.advance(bar)
            contests.append(Contest(word, scale, objective, searches))
    tables = {"cost": cost_table(contests)} | {one.word: methods_table(one) for one in contests}
    publish(folder, "balance.md", tables, *PACKAGES, draw=lambda: draw(contests))


def orbit_objective(word: str) -> tuple[Objective, float, int]:
    """Return the RMS of the orbit over that of the machine to begin with, and that one's, N.

    Also the number of free numbers.
    """
    problem = resolve(Options(design=((word,),)))
    design = problem.case.design

    def rms(unit: Float[Array, " n"]) -> Scalar:
        return jc.periodic_orbit(design.scene(unit), nodes=NODES).foundation_rms

    plain, both = jax.jit(rms), jax.jit(jax.value_and_grad(rms))
    first = design.unit(problem.reference)
    scale = float(plain(jnp.asarray(first)))

    def value(point: np.ndarray) -> float:
        return float(plain(jnp.asarray(point))) / scale

    def gradient(point: np.ndarray) -> tuple[float, np.ndarray]:
        found, slope = both(jnp.asarray(point))
        return float(found) / scale, np.asarray(slope) / scale

    costs = _seconds(value, first), _seconds(gradient, first)
    return Objective(value, gradient, *costs), scale, len(design.names)


def _seconds(function: Callable[[np.ndarray], Any], point: np.ndarray) -> float:
    """CPU time of a call: the least of a few, after one that compiles."""
    function(point)
    spent = []
    for _ in range(10):
        began = time.process_time()
        function(point)
        spent.append(time.process_time() - began)
    return min(spent)


def starts(objective: Objective, count: int, dimension: int) -> list[np.ndarray]:
    """Random machines that move: from links that do not close no slope leads anywhere."""
    generator, found = np.random.default_rng(0), []
    while len(found) < count:
        point = generator.uniform(size=dimension)
        if np.isfinite(objective.value(point)):
            found.append(point)
    return found


def cost_table(contests: Sequence[Contest]) -> str:
    """Return the table of what an evaluation costs."""
    headings = ("design", "value, ms", "gradient, ms", "gradient, values")
    cells = []
    for one in contests:
        of = one.objective
        milliseconds = (f"{1e3 * spent:.1f}" for spent in (of.value_seconds, of.gradient_seconds))
        cells.append((one.word, *milliseconds, f"{of.gradient_work:.1f}"))
    return table(headings, cells)


def methods_table(contest: Contest) -> str:
    """Return the table of the methods, each a column."""
    columns = []
    for method in METHODS:
        found = contest.of(method)
        until = [one.until(contest.goal) for one in found]
        columns.append(
            (
                _range([contest.scale * one.best for one in found], 2),
                f"{sum(one is not None for one in until)} of {len(found)}",
                _range([np.inf if one is None else one.work for one in until]),
                _range([np.inf if one is None else one.seconds for one in until], 2),
                f"{np.median([one.evaluations for one in found]):.0f}",
            )
        )
    headings = (
        "RMS at the end, N: median (range)",
        "arrived",
        "work until then, values",
        "CPU seconds until then",
        "evaluations: median",
    )
    return table(("method", *METHODS), list(zip(headings, *columns, strict=True)))


def _range(numbers: Sequence[float], digits: int = 0) -> str:
    """Median and range; a search that never arrived, or had no number, counts as infinite."""
    ordered = np.sort(np.nan_to_num(numbers, nan=np.inf, posinf=np.inf))
    # Not `np.median`, which has no number between a finite and an infinite one.
    middle = ordered[[(len(ordered) - 1) // 2, len(ordered) // 2]].max()
    low, middle, high = (
        f"{value:.{digits}f}" if np.isfinite(value) else "never"
        for value in (ordered[0], middle, ordered[-1])
    )
    return f"{middle} ({low} to {high})"


def draw(contests: Sequence[Contest]) -> Figure:
    """Draw what is still above the best found, over the work."""
    fig, axes = plt.subplots(1, len(contests), figsize=(WIDTH, 3.4), layout="constrained")
    for contest, ax in zip(contests, axes, strict=True):
        _draw_searches(ax, contest)
    fig.legend(*axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=5)
    return fig


def _draw_searches(ax: Axes, contest: Contest) -> None:
    """Median and range over the starts of what is still above the best, in N."""
    for colour, method in zip(("C0", "C3", "C1", "C2"), METHODS, strict=True):
        found = [one for one in contest.of(method) if one.improvements]
        if not found:
            continue
        first = min(one.improvements[0].work for one in found)
        at = np.geomspace(first, max(one.work for one in found), 300)
        above = contest.scale * np.array([best_so_far(one, at) for one in found])
        # The best of all has nothing above it: it ends at a tenth of a newton.
        above = np.maximum(above - contest.scale * contest.least, 0.1)
        every = np.isfinite(above).all(axis=0)
        low, middle, high = np.quantile(above[:, every], (0, 0.5, 1), axis=0)
        ax.fill_between(at[every], low, high, color=colour, alpha=0.2)
        ax.plot(at[every], middle, color=colour, label=method)
    gain = contest.scale * (1 - contest.least)
    ax.axhline(max(gain, 0.1), color="0.5", linestyle=":", label="the paper's machine")
    ax.set(xscale="log", yscale="log", ylabel="RMS above the best, N", xlabel="work, values")
    ax.set_title(f"--design {contest.word}")
    # The raised exponent of a power is small type.
    for axis in (ax.xaxis, ax.yaxis):
        axis.set_major_formatter("{x:g}")
    ax.grid(alpha=0.3)


def best_so_far(found: Searched, at: np.ndarray) -> np.ndarray:
    """The best value when so much work `at` was done; NaN before the first."""
    spent = [one.work for one in found.improvements]
    best = np.array([one.best for one in found.improvements])
    index = np.searchsorted(spent, at, side="right") - 1
    return np.where(index >= 0, best[np.maximum(index, 0)], np.nan)

"""A bound of how far below the optimum the least objective of its box may lie."""

import numpy as np
import xarray as xr
from jaxtyping import Float

from optimize.answer import Bound, Confirmed, OpenPoint
from optimize.case import Case
from optimize.forces import quantity
from optimize.landscape import GRID_DIMENSIONS

# Second derivatives within a cell may exceed those measured around it by this factor.
ROUGHER = 2.0


def optimality_bound(
    case: Case,
    orbits: xr.Dataset | None,
    best: Confirmed,
    by_runs: tuple[OpenPoint, ...] = (),
) -> Bound:
    """Bound the objective between the map's points by the values and slopes there.

    Long runs speak for points without a stable orbit: `by_runs`, where they have a number.
    """
    unit = case.objective.unit
    if orbits is None or not best.settles or not orbits.counts.any():
        return Bound(
            None,
            None,
            0 if orbits is None else int((~orbits.counts).sum()),
            0.0,
            "The best of what was tried: no periodic orbits could be mapped.",
        )
    counts = orbits.counts.to_numpy()
    values = np.where(counts, orbits.objective.to_numpy(), np.nan)
    gain, unsolved = float(np.nanmin(values) - best.objective), int((~counts).sum())
    if len(case.design.names) > GRID_DIMENSIONS:
        statement = (
            f"The best of {values.size} points of a Sobol sequence and of the descents from them, "
            f"known to {best.half_width:.2g} {unit}; nothing is said of what lies between."
        )
        return Bound(None, None, unsolved, gain, statement)
    sizes = 1 / (np.array(values.shape) - 1)
    widths = [high - low for low, high in case.design.bounds.values()]
    slopes = np.where(counts[..., None], orbits.slope.to_numpy() * widths, np.nan)
    lowest, hidden = cell_bounds(values, slopes, sizes)
    # Also of a point without a neighbour to measure by.
    unsolved = int(np.isnan(lowest).sum())
    if unsolved == values.size:
        statement = (
            "The best of what was tried: no two points of the map beside each other have a stable "
            "orbit that counts, and nothing is said of what lies between."
        )
        return Bound(None, None, unsolved, gain, statement)
    of_orbits = max(0.0, best.objective - float(np.nanmin(lowest)))
    least = np.unravel_index(np.nanargmin(lowest), lowest.shape)
    curvature = float(hidden[least])
    statement = (
        f"No other periodic orbit of the box is more than {_about(of_orbits, unit)} below the "
        f"optimum, of which {_about(curvature, unit)} are what second derivatives can hide: these "
        f"are assumed to be at most {ROUGHER:g} times those between neighbours on the map."
    )
    falls = values - lowest
    by_runs = tuple(point for point in by_runs if np.isfinite(point.least))
    for point in by_runs:
        at = np.unravel_index(point.place, values.shape)
        lowest[at] = point.least - ROUGHER * _steepest_beside(falls, at)
    within = max(0.0, best.objective - float(np.nanmin(lowest)))
    if by_runs:
        least = min(point.least for point in by_runs)
        statement += (
            f" At {len(by_runs)} of {values.size} points no stable orbit of one turn is known: "
            f"long runs there come to {least:.6g} {unit} or more, {_against(best, least, unit)}. "
            f"Half a cell away they are assumed to be lower by at most {ROUGHER:g} times what the "
            "objective may fall about the points beside."
        )
    unsolved = int(np.isnan(lowest).sum())
    if unsolved:
        statement += (
            f" Nothing is said of {unsolved} of {values.size} points. At such a point, or at "
            "all points beside it, no stable orbit in contact was found, or a constraint is broken."
        )
    else:
        statement += f" So the optimum is global within the box to {_about(within, unit)}."
    return Bound(within, curvature, unsolved, gain, statement, by_runs)


def _steepest_beside(falls: Float[np.ndarray, "*points"], at: tuple[np.intp, ...]) -> float:
    """Return the largest fall about the points beside one, NaN where none is known."""
    around = falls[tuple(slice(max(0, int(i) - 1), int(i) + 2) for i in at)]
    known = around[np.isfinite(around)]
    return float(known.max()) if known.size else float("nan")


def _about(value: float, unit: str) -> str:
    """Return two digits of a number, and its unit."""
    return quantity(float(f"{value:.2g}"), unit)


def _against(best: Confirmed, least: float, unit: str) -> str:
    """Return where the least of long runs lies, and what that says of the optimum."""
    above = least - best.objective
    if above >= 0:
        return f"{_about(above, unit)} above the optimum"
    return (
        f"{_about(-above, unit)} below the optimum: they scatter too much to tell whether a better "
        "motion is there, and more --runs tell more"
    )


def cell_bounds(
    values: Float[np.ndarray, "*points"],
    slopes: Float[np.ndarray, "*points n"],
    sizes: Float[np.ndarray, " n"],
) -> tuple[np.ndarray, np.ndarray]:
    """The least that a function can be near each point of a grid, and what of it is curvature.

    Every place of the grid is within half a cell of a point, along each axis. There the function
    is at least its tangent less half the second derivatives times the offsets; these are measured
    by differences of the slopes of neighbouring points, the largest of those around, times
    `ROUGHER`. A point without a number leaves its neighbours' differences unknown, and itself NaN.
    """
    count = values.ndim
    half = sizes / 2
    fall = np.zeros(values.shape)
    hidden = np.zeros(values.shape)
    for i in range(count):
        # The tangent falls on one side of a point; on the box's edge only inwards.
        downhill = np.abs(slopes[..., i])
        edge = np.zeros(values.shape, bool)
        ends = np.moveaxis(edge, i, 0), np.moveaxis(slopes[..., i], i, 0)
        ends[0][0], ends[0][-1] = ends[1][0] >= 0, ends[1][-1] <= 0
        fall += np.where(edge, 0.0, downhill) * half[i]
        for j in range(count):
            second = np.abs(np.diff(slopes[..., i], axis=j)) / sizes[j]
            before, after = _beside(second, j, 1, 0), _beside(second, j, 0, 1)
            around = np.fmax(before, after)
            hidden += ROUGHER * around * half[i] * half[j] / 2
    return values - fall - hidden, hidden


def _beside(second: np.ndarray, axis: int, before: int, after: int) -> np.ndarray:
    """Differences, one fewer than points along `axis`, beside each point; NaN beyond the ends."""
    pad = [(0, 0)] * second.ndim
    pad[axis] = (before, after)
    return np.pad(second, pad, constant_values=np.nan)

"""Points of the map without a stable orbit of one turn: what long runs say of the motions there."""

import numpy as np
import xarray as xr
from jaxtyping import Float

from jaxcrusher.files.journal import Journal
from optimize.answer import OpenPoint
from optimize.confirm import interval, long_runs
from optimize.evaluate import Case, Progress, Window

# More points than these are of a box whose motions are of another kind: none of them is run.
MOST = 64


def unstable(mapped: xr.Dataset | None) -> np.ndarray:
    """Return the numbers of the map's points without a stable orbit, none if they are too many."""
    if mapped is None:
        return np.zeros(0, int)
    found = np.flatnonzero(~mapped.stable.to_numpy())
    return found if len(found) <= MOST else found[:0]


def run_open_points(
    case: Case,
    units: Float[np.ndarray, "points n"],
    mapped: xr.Dataset,
    runs: int,
    window: Window,
    seed: int,
    progress: Progress | None = None,
    journal: Journal | None = None,
) -> tuple[OpenPoint, ...]:
    """Return the objective of the motions at the points of the map that have no stable orbit."""
    which = unstable(mapped)
    rows = long_runs(case, units[which], runs, window, seed, progress, journal)
    failures, largest = (
        mapped[name].to_numpy().ravel()[which] for name in ("failure", "largest_multiplier")
    )
    return tuple(
        OpenPoint(
            case.design.numbers(unit),
            why or f"The orbit of one turn is unstable: its largest multiplier is {modulus:.4g}.",
            _least(row["objective"], case.objective.lowest),
        )
        for unit, why, modulus, row in zip(units[which], failures, largest, rows, strict=True)
    )


def _least(objective: Float[np.ndarray, "starts runs"], lowest: float) -> float:
    """Return the lower end of the intervals of all starts, NaN where a run has no number.

    The interval of two runs is so wide that it may reach below the `lowest` that there can be.
    """
    ends = [mean - width for mean, width in map(interval, objective)]
    return float(np.maximum(np.min(ends), lowest))

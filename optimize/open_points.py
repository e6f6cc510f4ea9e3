"""Points of the map without a stable orbit of one turn: what long runs say of the motions there."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from jaxtyping import Float

from jaxcrusher.dynamics.many_orbits import MOTION
from optimize.answer import OpenPoint
from optimize.case import Case
from optimize.confirm import Repeats, interval, long_runs
from optimize.evaluate import NOWHERE, Tracking

# What a map says of a point.
SAID = ("failure", "largest_multiplier", *MOTION)
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
    repeats: Repeats,
    tracking: Tracking = NOWHERE,
) -> tuple[OpenPoint, ...]:
    """Return the objective of the motions at the points of the map that have no stable orbit."""
    which = unstable(mapped)
    rows = long_runs(case, units[which], repeats, tracking)
    said = [{name: mapped[name].to_numpy().ravel()[place] for name in SAID} for place in which]
    return tuple(
        OpenPoint(
            case.design.numbers(units[place]),
            _motion(of_map),
            _least(row["objective"], case.objective.lowest),
            int(place),
        )
        for place, of_map, row in zip(which, said, rows, strict=True)
    )


def _motion(said: Mapping[str, Any]) -> str:
    """Say why a point has no stable orbit, and what the motion from rest is."""
    why = said["failure"] or (
        "The orbit of one turn is unstable: its largest multiplier is "
        f"{said['largest_multiplier']:.4g}."
    )
    if not said["motion"]:
        return why
    rms = f"{said['run_rms']:.7g} ± {said['run_rms_error']:.1g} N"
    return f"{why} The motion from rest: {said['motion']}, with an RMS of {rms}."


def _least(objective: Float[np.ndarray, "starts runs"], lowest: float) -> float:
    """Return the lower end of the intervals of all starts, NaN where a run has no number.

    The interval of two runs is so wide that it may reach below the `lowest` that there can be.
    """
    ends = [mean - width for mean, width in map(interval, objective)]
    return float(np.maximum(np.min(ends), lowest))

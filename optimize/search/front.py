"""Pareto fronts by exact gradients: what the least of one number costs in another."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import xarray as xr
from jaxtyping import Float

from optimize.answer import Confirmed, Front
from optimize.ask.case import Case
from optimize.search import orbits as periodic
from optimize.search import smooth
from optimize.search.descents import Smooth, descend
from optimize.search.pareto import nondominated

# Points of a front, from the least of one number to the least of the other.
POINTS = 9
# A gain in the second number of less than this share is none.
NO_GAIN = 1e-6


def fronts(
    case: Case, optimum: Confirmed, units: np.ndarray, orbits: xr.Dataset, steps: int
) -> tuple[Front, ...]:
    """Return the fronts against the capacity of a crusher, and against the rival of the case.

    `units` are the points of the map `orbits`, of which one counts at least; where none of them
    gains anything in the other number, the optimum is all there is.
    """

    def down(function: Smooth, start: np.ndarray, *further: Smooth) -> np.ndarray:
        return descend(function, start, case.upper, steps, (*spares, *further)).path[-1]

    assert optimum.orbit is not None
    least = np.clip(case.design.unit(optimum.values), 0, case.upper)
    rival = case.rival
    (statistic,) = rival.outputs
    counts = orbits.counts.to_numpy().ravel()
    over_map = orbits[statistic].to_numpy().ravel()
    value, spares, found = smooth.objective(case), smooth.constraints(case), []
    numbers = [
        (
            (statistic, rival.unit, rival.meaning),
            1,
            smooth.objective(replace(case, objective=rival)),
            float(optimum.orbit.solution[statistic]),
            over_map,
        )
    ]
    if optimum.crushing is not None:
        of_capacity = smooth.capacity(case), optimum.crushing.capacity, case.capacity(units)
        numbers.insert(0, (("capacity", "m3/h", "capacity"), -1, *of_capacity))
    for of, sign, number, here, there in numbers:
        costs = np.where(counts, sign * there, np.nan)
        points, rows = least[None], [[optimum.orbit.objective], [here]]
        if sign * here - np.nanmin(costs) > NO_GAIN * abs(here):
            best = units[int(np.nanargmin(costs))]
            small = number if sign > 0 else smooth.negative(number)
            points = front(value, small, least, best, down)
            rows = [[f(point)[0] for point in points] for f in (value, number)]
        objective, other = map(np.array, rows)
        solved = periodic.solve(case, points)
        forces = {force: solved[force] for force in case.forces}
        found.append(Front(*of, objective, other, case.design.values(points), forces))
    return tuple(found)


def front(
    one: Smooth,
    other: Smooth,
    least: Float[np.ndarray, " n"],
    best: Float[np.ndarray, " n"],
    down: Callable[..., Float[np.ndarray, " n"]],
) -> Float[np.ndarray, "points n"]:
    """Points of the unit box where `one` is least for what `other` is, both to be small.

    From `least`, where `one` is, to where `other` is, which a descent from `best` finds. From
    there on `other` is bounded by equal steps, and `one` goes down from the point before.
    `down(function, start, *spares)` returns the end of a descent, where no spare is below 0. What
    another point beats in both, as where descents may take few steps, is left out.
    """
    end = down(other, best)
    highest, lowest = other(least)[0], other(end)[0]
    # What `other` does not depend on is free at its least too.
    levels = np.linspace(highest, lowest + NO_GAIN * (highest - lowest), POINTS)

    def bounded(level: float, start: np.ndarray) -> np.ndarray:
        return down(one, start, smooth.above(smooth.negative(other), -level))

    points = [least]
    for level in levels[1:-1]:
        points.append(bounded(float(level), points[-1]))
    found = np.stack([*points, bounded(float(levels[-1]), end)])
    return found[nondominated(np.array([[one(point)[0], other(point)[0]] for point in found]))]

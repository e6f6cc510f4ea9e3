"""Pareto fronts of two numbers by exact gradients."""

from collections.abc import Callable

import numpy as np
import xarray as xr
from jaxtyping import Bool, Float

from optimize.answer import Confirmed, Front
from optimize.ask.problem import DesignProblem
from optimize.search import orbits as periodic
from optimize.search.descents import Smooth, above, descend, negative

# Number of points of a front, from the minimum of one number to the minimum of the other.
POINTS = 9
# A gain in the second number below this share does not count.
NO_GAIN = 1e-6


def fronts(
    problem: DesignProblem, optimum: Confirmed, places: np.ndarray, orbits: xr.Dataset, steps: int
) -> tuple[Front, ...]:
    """Return the fronts against the capacity of a crusher, and against the rival of the problem.

    `places` are the points of the map `orbits`, of which at least one counts. If no point is better
    in the other number, the front is the optimum alone.
    """

    def down(function: Smooth, start: np.ndarray, *further: Smooth) -> np.ndarray:
        return descend(function, start, problem.upper, steps, (*spares, *further)).path[-1]

    assert optimum.orbit is not None
    least = np.clip(problem.design.unit(optimum.values), 0, problem.upper)
    rival, known = problem.rival, periodic.numbers(problem)
    (statistic,) = rival.outputs
    counts, spares = orbits.counts.to_numpy().ravel(), periodic.spares(problem, known)
    here, there = float(optimum.orbit.solution[statistic]), orbits[statistic].to_numpy().ravel()
    against = [((statistic, rival.unit, rival.meaning), 1, here, there)]
    if optimum.crushing is not None:
        sizes = optimum.crushing.capacity, problem.capacity(places)
        against.insert(0, (("capacity", "m3/h", "capacity"), -1, *sizes))
    found = []
    for of, sign, here, there in against:
        costs = np.where(counts, sign * there, np.nan)
        points, rows = least[None], [[optimum.orbit.objective], [here]]
        if sign * here - np.nanmin(costs) > NO_GAIN * abs(here):
            best, number = places[int(np.nanargmin(costs))], known[of[0]]
            small = number if sign > 0 else negative(number)
            points = front(known["objective"], small, least, best, down)
            rows = [[f(point)[0] for point in points] for f in (known["objective"], number)]
        solved = periodic.solve(problem, points)
        forces = {force: solved[force] for force in problem.forces}
        objective, other = map(np.array, rows)
        found.append(Front(*of, objective, other, problem.design.values(points), forces))
    return tuple(found)


def front(
    one: Smooth,
    other: Smooth,
    least: Float[np.ndarray, " n"],
    best: Float[np.ndarray, " n"],
    down: Callable[..., Float[np.ndarray, " n"]],
) -> Float[np.ndarray, "points n"]:
    """Return points of the unit box on the Pareto front of `one` and `other`, both minimised.

    The front goes from `least`, the minimum of `one`, to the minimum of `other`, which a descent
    from `best` finds. Between them an upper bound of `other` falls in equal steps, and `one`
    descends from the previous point. `down(function, start, *spares)` returns the end of a descent,
    where no spare is below 0. Dominated points, as after few steps of descents, are left out.
    """
    end = down(other, best)
    highest, lowest = other(least)[0], other(end)[0]
    # Parameters that do not influence `other` are free at its minimum too.
    levels = np.linspace(highest, lowest + NO_GAIN * (highest - lowest), POINTS)

    def bounded(level: float, start: np.ndarray) -> np.ndarray:
        return down(one, start, above(negative(other), -level))

    points = [least]
    for level in levels[1:-1]:
        points.append(bounded(float(level), points[-1]))
    found = np.stack([*points, bounded(float(levels[-1]), end)])
    return found[nondominated(np.array([[one(point)[0], other(point)[0]] for point in found]))]


def nondominated(costs: Float[np.ndarray, "points 2"]) -> Bool[np.ndarray, " points"]:
    """Tell which points no other point dominates in both columns, which are minimised.

    Points with NaN are never chosen. Equal points all stay.
    """
    finite = np.isfinite(costs).all(axis=1)
    front = np.zeros(len(costs), dtype=bool)
    for i in np.flatnonzero(finite):
        others = costs[finite]
        no_worse = (others <= costs[i]).all(axis=1)
        front[i] = not (no_worse & (others < costs[i]).any(axis=1)).any()
    return front

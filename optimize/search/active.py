"""The active constraints at an optimum, by the conditions of Karush, Kuhn and Tucker."""

import numpy as np
import scipy.optimize
from jaxtyping import Float

from optimize.answer import Active, Confirmed
from optimize.ask.limits import OF_ORBIT
from optimize.ask.problem import DesignProblem
from optimize.search.orbits import values_and_slopes, widths

# A coordinate of the unit box this near to its end is at the end: the rest is rounding.
AT_LIMIT = 1e-12
# A capacity this near to its floor, as a share of it, is at the floor: the error of a descent.
AT_FLOOR = 1e-8


def active_constraints(
    problem: DesignProblem, best: Confirmed
) -> tuple[tuple[Active, ...], dict[str, float]]:
    """Return the active constraints with their multipliers, and the remaining slopes.

    A multiplier is the decrease of the objective per unit of the constrained quantity. The slopes,
    per unit of each parameter that is not at an active bound, are those of the Lagrangian with the
    capacity and the limited statistics. They vanish at a minimum. Without an orbit both are empty.
    """
    if best.orbit is None:
        return (), {}
    at, names = problem.design.unit(best.values), problem.design.names
    width = widths(problem)
    slopes = np.array([best.orbit.slopes[name] for name in names]) * width
    lowest, highest = at <= AT_LIMIT, at >= problem.upper - AT_LIMIT
    free, found = ~(lowest | highest), []
    standing = _standing(problem, best, at)
    if standing:
        # The multipliers are not negative, and make the remaining free slopes least.
        normals = np.stack([normal for _, _, normal, _ in standing], axis=1)
        if not np.isfinite(np.column_stack([normals, slopes])).all():  # no multipliers exist
            return (), dict.fromkeys(names, float("nan"))
        sizes = np.linalg.norm(normals[free], axis=0)
        sizes = np.where(sizes > 0, sizes, np.inf)
        multipliers = np.zeros(len(standing))
        if free.any():  # for zero rows SciPy returns uninitialised memory
            multipliers = scipy.optimize.nnls(normals[free] / sizes, slopes[free])[0] / sizes
        slopes = slopes - normals @ multipliers
        found += [
            Active(name, end, float(multiplier), unit)
            for (name, end, _, unit), multiplier in zip(standing, multipliers, strict=True)
        ]
    slopes = slopes / width
    for i, (name, top) in enumerate(zip(names, problem.upper, strict=True)):
        if lowest[i] and slopes[i] > 0:
            found.append(Active(name, "lowest", float(slopes[i])))
        elif highest[i] and slopes[i] < 0:
            found.append(Active(name, "highest" if top == 1 else "capacity", -float(slopes[i])))
    limits = {one.parameter for one in found}
    left = {n: float(s) for n, s in zip(names, slopes, strict=True) if n not in limits}
    return tuple(found), left


def _standing(
    problem: DesignProblem, best: Confirmed, at: Float[np.ndarray, " n"]
) -> list[tuple[str, str, Float[np.ndarray, " n"], str]]:
    """Return the quantities at their floor or limit: name, end, slope inwards, and unit.

    Slopes are by the axes of the unit box.
    """
    highest, crushing = problem.capacity_floor * (1 + AT_FLOOR), best.crushing
    floor = problem.links_free and crushing is not None and crushing.capacity <= highest
    if not floor and not problem.limits:
        return []
    found, numbers = [], values_and_slopes(problem, at)
    if floor:
        found.append(("capacity", "lowest", numbers["capacity"][1], "m3/h"))
    for limit in problem.limits:
        value, slope = numbers[limit.statistic]
        if value >= limit.most * (1 - OF_ORBIT):
            found.append((limit.statistic, "highest", -slope, limit.unit))
    return found

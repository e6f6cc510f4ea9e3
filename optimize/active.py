"""The active constraints at an optimum, by the conditions of Karush, Kuhn and Tucker."""

import numpy as np

from optimize.answer import Active, Confirmed
from optimize.evaluate import Case
from optimize.orbits import widths

# A coordinate of the unit box this near its end is at it: rounding.
AT_LIMIT = 1e-12
# A capacity this near its floor, as a share of it, stands at it: what a descent leaves.
AT_FLOOR = 1e-8


def active_constraints(case: Case, best: Confirmed) -> tuple[tuple[Active, ...], dict[str, float]]:
    """Return the active constraints with their multipliers, and the slopes that remain.

    A multiplier is by how much the objective would fall per unit. The slopes, per unit of each
    free parameter, are those left after the constraint on the capacity has taken its part. At a
    minimum they vanish.
    """
    if best.orbit is None:
        return (), {}
    at, names = case.design.unit(best.values), case.design.names
    slopes = np.array([best.orbit.slopes[name] for name in names])
    lowest, highest = at <= AT_LIMIT, at >= case.upper - AT_LIMIT
    free, found = ~(lowest | highest), []
    if case.links_free and best.capacity <= case.capacity_floor * (1 + AT_FLOOR):
        by_capacity = case.capacity_slope(at) / widths(case)
        # The least multiplier of the floor that leaves the free slopes nearest to zero.
        norm = by_capacity[free] @ by_capacity[free]
        multiplier = max(0.0, float(slopes[free] @ by_capacity[free] / norm)) if norm > 0 else 0.0
        slopes = slopes - multiplier * by_capacity
        found.append(Active("capacity", "lowest", multiplier))
    for i, (name, top) in enumerate(zip(names, case.upper, strict=True)):
        if lowest[i] and slopes[i] > 0:
            found.append(Active(name, "lowest", float(slopes[i])))
        elif highest[i] and slopes[i] < 0:
            found.append(Active(name, "highest" if top == 1 else "capacity", -float(slopes[i])))
    limits = {one.parameter for one in found}
    left = {n: float(s) for n, s in zip(names, slopes, strict=True) if n not in limits}
    return tuple(found), left

"""Conditions under which a design counts, for integrated motions and for periodic orbits."""

from typing import Any

import numpy as np
from jaxtyping import Float

from jaxcrusher.orbits.result import PeriodicOrbit
from optimize.ask.limits import OF_ORBIT, OF_RUN, Found
from optimize.ask.problem import DesignProblem


def broken(problem: DesignProblem, found: Found, share: float) -> dict[str, np.ndarray]:
    """Return each constraint on motions in words, and where the statistics `found` break it.

    A statistic may exceed its limit by a `share` of the limit.
    """
    lost = {}
    if problem.inside_model:
        of_orbit = isinstance(found, PeriodicOrbit)
        inside = found.validity.inside if of_orbit else found["inside_model"]
        lost["leave the contact model"] = ~_logical(inside)
    for limit in problem.limits:
        beyond = f"have a {limit.statistic} above {limit.most:.4g} {limit.unit}"
        lost[beyond] = ~limit.kept(found, share)
    return lost


def keeps(problem: DesignProblem, found: Found, share: float) -> np.ndarray:
    """Tell which motions break none of the constraints that `broken` checks."""
    return ~np.any(list(broken(problem, found, share).values()), axis=0)


def end_well(found: Found) -> np.ndarray:
    """Tell which motions succeeded without friction whirl.

    The numbers of a whirl are outside the contact theory, so its objective means nothing.
    """
    return _logical(found["success"]) & ~_logical(found["whirl"])


def of_runs(
    problem: DesignProblem, found: Found, capacity: Float[np.ndarray, " designs"]
) -> np.ndarray:
    """Tell for each start which motions ended well and keep the constraints."""
    return end_well(found) & problem.reaches(capacity) & keeps(problem, found, OF_RUN)


def of_orbits(
    problem: DesignProblem, found: Found, capacity: Float[np.ndarray, " designs"]
) -> np.ndarray:
    """Tell which orbits may be stable, have a finite objective, and keep the constraints."""
    good = may_be_stable(found) & np.isfinite(found["objective"])
    return good & problem.reaches(capacity) & keeps(problem, found, OF_ORBIT)


def usable(problem: DesignProblem, found: Found) -> np.ndarray:
    """Tell which orbits may be stable, and are inside the contact model if the problem asks so.

    Descents need only these conditions; they follow the slopes of the other constraints.
    """
    inside = _logical(found["inside_model"]) if problem.inside_model else True
    return may_be_stable(found) & inside


def may_be_stable(found: Found) -> np.ndarray:
    """Tell which orbits are stable or undecided.

    The orbit of the optimum is later checked in further ways, and confirmed by runs.
    """
    return _logical(found["stable"]) | _logical(found["undecided"])


def losses(
    problem: DesignProblem, found: Found, capacity: Float[np.ndarray, " designs"], designs: str
) -> str:
    """Say why none of the `designs` counts, and how many designs each reason excludes.

    Arrays of `found` have the shape (starts, designs, ...), as from `evaluate` or from long runs.
    """
    shape = len(found["success"]), len(capacity), -1
    limited = (limit.statistic for limit in problem.limits)
    names = ("success", "whirl", "inside_model", "objective", *limited)
    seen = {name: np.asarray(found[name]).reshape(shape) for name in names}
    failed = ~_logical(seen["success"])
    lost = {"failed to integrate": failed, "come to a friction whirl": _logical(seen["whirl"])}
    of_motions = broken(problem, seen, OF_RUN)
    of_motions["have no number of the objective"] = np.isnan(seen["objective"])
    lost |= {why: where & ~failed for why, where in of_motions.items()}
    counts = {why: int(where.any(axis=(0, 2)).sum()) for why, where in lost.items()}
    short = f"are below the capacity of {problem.capacity_floor:.4g} m3/h"
    if len(capacity):
        short += f" (the highest is {np.max(capacity):.4g} m3/h)"
    counts[short] = int((~problem.reaches(capacity)).sum())
    told = [f"{count} {why}" for why, count in counts.items() if count]
    return f"of {len(capacity)} {designs} {', '.join(told)}"


def _logical(values: Any) -> np.ndarray:
    return np.asarray(values).astype(bool)

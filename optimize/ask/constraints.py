"""What makes a design count: of motions that are integrated, and of periodic orbits."""

from typing import Any

import numpy as np
from jaxtyping import Float

from jaxcrusher.orbits.result import PeriodicOrbit
from optimize.ask.limits import OF_ORBIT, OF_RUN, Found
from optimize.ask.problem import DesignProblem


def broken(problem: DesignProblem, found: Found, share: float) -> dict[str, np.ndarray]:
    """Return the constraints on motions in words, and where `found` breaks them.

    A statistic may exceed its limit by a `share` of it.
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
    """Whether motions break none of the constraints on them, as `broken` tells."""
    return ~np.any(list(broken(problem, found, share).values()), axis=0)


def end_well(found: Found) -> np.ndarray:
    """Whether each motion succeeded, without whirl.

    A whirl's numbers are outside the contact theory, whatever the objective says of it.
    """
    return _logical(found["success"]) & ~_logical(found["whirl"])


def of_runs(
    problem: DesignProblem, found: Found, capacity: Float[np.ndarray, " designs"]
) -> np.ndarray:
    """Whether the motion of each start ended well, within the constraints."""
    return end_well(found) & problem.reaches(capacity) & keeps(problem, found, OF_RUN)


def of_orbits(
    problem: DesignProblem, found: Found, capacity: Float[np.ndarray, " designs"]
) -> np.ndarray:
    """Whether each orbit may be stable, has a number of the objective, and keeps constraints."""
    good = may_be_stable(found) & np.isfinite(found["objective"])
    return good & problem.reaches(capacity) & keeps(problem, found, OF_ORBIT)


def usable(problem: DesignProblem, found: Found) -> np.ndarray:
    """Whether each orbit may be stable, and is inside the contact model if asked.

    Descents need that much: what else is a constraint has a slope, which they follow.
    """
    inside = _logical(found["inside_model"]) if problem.inside_model else True
    return may_be_stable(found) & inside


def may_be_stable(found: Found) -> np.ndarray:
    """Whether each orbit is not known to be unstable.

    The one that is chosen in the end is looked at by further ways, and confirmed by runs.
    """
    return _logical(found["stable"]) | _logical(found["undecided"])


def losses(
    problem: DesignProblem, found: Found, capacity: Float[np.ndarray, " designs"], designs: str
) -> str:
    """Say why none of some `designs` counts, and of how many each reason is true.

    What is `found` has the shape (starts, designs, ...), as of `evaluate` or of long runs.
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

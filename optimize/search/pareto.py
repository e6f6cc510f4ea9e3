"""The Pareto set: designs of a landscape that no other design beats in two numbers."""

import numpy as np
from jaxtyping import Bool, Float


def nondominated(costs: Float[np.ndarray, "points 2"]) -> Bool[np.ndarray, " points"]:
    """The points that no other beats in both columns, which are to be small; NaN never wins.

    Of equal points all stay.
    """
    finite = np.isfinite(costs).all(axis=1)
    front = np.zeros(len(costs), dtype=bool)
    for i in np.flatnonzero(finite):
        others = costs[finite]
        no_worse = (others <= costs[i]).all(axis=1)
        front[i] = not (no_worse & (others < costs[i]).any(axis=1)).any()
    return front

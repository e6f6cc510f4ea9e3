"""How far motions part from one."""

from collections.abc import Mapping, Sequence

import numpy as np

Histories = Mapping[str, np.ndarray]


def parted(still: Histories, moved: Sequence[Histories]) -> dict[str, np.ndarray]:
    """Return by quantity and time the largest distance up to each time, over its largest value."""
    found = {}
    for name, values in still.items():
        apart = [abs(one[name] - values).reshape(len(values), -1).max(axis=1) for one in moved]
        # A quantity that is zero all the time, as the force of a pin in flight, has no share.
        found[name] = np.maximum.accumulate(np.max(apart, axis=0)) / (abs(values).max() or 1.0)
    return found

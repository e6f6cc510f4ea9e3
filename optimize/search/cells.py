"""Cells of the unit box, and lower bounds of a function in each cell.

At the corners of a cell the function's value and its exact slopes are known.
"""

import itertools
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

# Assumed factor of the second derivatives in a cell over those measured in it and its neighbours.
ROUGHER = 2.0


class Cells(NamedTuple):
    """Cells by their lowest corners and their sizes."""

    low: Float[np.ndarray, "cells n"]
    sizes: Float[np.ndarray, "cells n"]

    @classmethod
    def of_grid(cls, shape: tuple[int, ...]) -> "Cells":
        """Return the cells between the points of a grid."""
        steps = [points - 1 for points in shape]
        low = np.stack([index.ravel() for index in np.indices(steps)], axis=1) / steps
        return cls(low, np.broadcast_to(1 / np.array(steps), low.shape))

    @property
    def corners(self) -> Float[np.ndarray, "cells corners n"]:
        """Return the places of the corners; the last axis varies fastest."""
        return self.low[:, None] + self.sizes[:, None] * self._ends

    @property
    def _ends(self) -> Int[np.ndarray, "corners n"]:
        return np.array([*itertools.product((0, 1), repeat=self.low.shape[1])])

    def halved(self, which: Bool[np.ndarray, " cells"]) -> "Cells":
        """Return the cells with some halved along each axis; the halves follow the other cells."""
        half = self.sizes[which, None] / 2
        low = self.low[which, None] + half * self._ends
        halves = (part.reshape(-1, low.shape[2]) for part in (low, half + 0 * low))
        return Cells(*(np.concatenate([a[~which], b]) for a, b in zip(self, halves, strict=True)))

    def hold(self, place: Float[np.ndarray, " n"]) -> Bool[np.ndarray, " cells"]:
        """Tell which cells contain a place, inside or at an edge."""
        apart = np.abs(place - self.low - self.sizes / 2)
        return np.all(apart <= self.sizes * (0.5 + 1e-6), axis=1)

    def bends(self, slopes: Float[np.ndarray, "cells corners n"]) -> Float[np.ndarray, "cells n n"]:
        """Return the absolute second derivatives, from differences of slopes along the edges.

        The largest value of parallel edges counts. It is NaN if no edge has slopes at both ends.
        """
        count = self.low.shape[1]
        square = slopes.reshape(-1, *count * (2,), count)
        edges = [
            np.abs(np.diff(square, axis=1 + axis)).reshape(len(square), -1, count)
            for axis in range(count)
        ]
        by_axis = [np.fmax.reduce(one, axis=1) for one in edges]
        return np.stack(by_axis, axis=2) / self.sizes[:, None]

    def hidden(self, bends: Float[np.ndarray, "cells n n"]) -> Float[np.ndarray, " cells"]:
        """Return the greatest effect of such second derivatives within half a cell on each axis."""
        half = self.sizes / 2
        return np.einsum("cij,ci,cj->c", bends, half, half) / 2

    def lowest(
        self,
        at: Int[np.ndarray, "cells corners"],
        values: Float[np.ndarray, " points"],
        slopes: Float[np.ndarray, "points n"],
    ) -> tuple[Float[np.ndarray, "cells corners"], Float[np.ndarray, " cells"]]:
        """Return a lower bound of the function near each corner, and its part due to curvature.

        Every place of a cell lies within half a cell of a corner, along each axis. There the
        function is at least the corner's tangent minus the quadratic term. Its second derivatives
        are at most `ROUGHER` times those of this cell and of all cells that share a corner with it.
        """
        bends = beside(self.bends(slopes[at]), at, len(values))
        hidden = self.hidden(ROUGHER * bends)
        # Only a slope that falls into the cell lowers the tangent.
        inwards = np.maximum(0.0, (2 * self._ends - 1) * slopes[at])
        fall = np.einsum("cki,ci->ck", inwards, self.sizes / 2)
        return values[at] - fall - hidden[:, None], hidden


def beside(
    numbers: Float[np.ndarray, "cells ..."], at: Int[np.ndarray, "cells corners"], points: int
) -> Float[np.ndarray, "cells ..."]:
    """Return for each cell the largest number of itself and of all cells that share a corner.

    NaN is ignored.
    """
    largest = np.full((points, *numbers.shape[1:]), np.nan)
    np.fmax.at(largest, at, numbers[:, None])
    return np.fmax.reduce(largest[at], axis=1)

"""Limits of a search: upper bounds of statistics of a design's motion."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from jaxcrusher.basics.checks import require, require_known
from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.orbits.result import PeriodicOrbit
from jaxcrusher.scenes.units import typed_in

# Statistics by name; the arrays may have any shape.
Found = Mapping[str, Any] | xr.Dataset | PeriodicOrbit
# On a periodic orbit a statistic may exceed its limit by this share, the error of a descent.
OF_ORBIT = 1e-6
# A time average may exceed its limit by this share, because it contains part of the transient.
OF_RUN = 0.01


@dataclass(frozen=True)
class Limit:
    """An upper bound of a statistic, in the statistic's unit."""

    statistic: str
    most: float
    unit: str

    def kept(self, found: Found, share: float) -> np.ndarray:
        """Tell whether the statistics `found` exceed the limit by no more than a `share` of it."""
        return np.asarray(found[self.statistic]) <= self.most * (1 + share)


def read_limits(written: Iterable[tuple[str, str]], scene: Scene) -> tuple[Limit, ...]:
    """Return the limits from pairs of a statistic's name and its greatest value with unit.

    Raises ValueError for a name that is not a statistic of the scene, for a repeated name, and for
    a value that is not finite, positive and of the statistic's unit.
    """
    found: dict[str, Limit] = {}
    for name, text in written:
        require_known(name, scene.statistics)
        unit = scene.statistics[name].unit
        require(name not in found, "limit", "name every statistic once", name)
        most = typed_in(unit, name, text)
        require(0 < most < np.inf, f"limit of {name}", "be finite and > 0", text)
        found[name] = Limit(name, most, unit)
    return tuple(found.values())

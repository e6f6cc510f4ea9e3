"""Which stable motions a grid of crushers comes to from random starts, and how often."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from jaxcrusher.basics.setup import require_set_up
from jaxcrusher.batch.layout import Layout
from jaxcrusher.batch.points import make_grid
from jaxcrusher.batch.store import opened
from jaxcrusher.dynamics.coexisting_orbits import CoexistingOrbits, coexisting_orbits
from jaxcrusher.files.table import COLUMNS
from jaxcrusher.mechanism.scene import AbstractScene
from jaxcrusher.orbits.forced import unknowns

# What a design holds.
HELD = (
    "worst_rms",
    "likeliest_rms",
    "unsettled",
    "share",
    "share_error",
    "orbit_rms",
    "orbit_period",
    "label",
    "start_state",
)


def basin_map(
    axes: Mapping[str, Any],
    *,
    base: Mapping[str, Any] | None = None,
    scene: Callable[..., AbstractScene] | None = None,
    starts: int = 32,
    spread: float = 0.5,
    turns: int = 1000,
    seed: int = 0,
    store: str | Path | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> xr.Dataset:
    """Find the stable orbits of every design of a grid, and how many random starts come to each.

    Each design is looked at as by `jaxcrusher.coexisting_orbits`, with the same starts about its
    own: differences between designs are not those of their starts. A design takes some seconds.

    **Arguments:**

    - `axes`, `base`, `scene`: as in `jaxcrusher.orbit_map`.
    - `starts`, `spread`, `turns`, `seed`: as in `jaxcrusher.coexisting_orbits`.
    - `store`: None, or a folder in which each finished design is kept, as a Zarr store. Killed at
      any moment and called again with the same arguments, the map goes on where it was.
    - `progress`: called with the number of finished and of all designs, first at the start.

    **Returns:** an `xarray.Dataset` with a dimension for each axis: `worst_rms` and `likeliest_rms`
    (N; of the loudest orbit that any start came to, and of that to which most came), `unsettled`
    (the share of starts that came to none). With a dimension `orbit`, the most frequent first:
    `share`, `share_error` (its standard error), `orbit_rms` (N), `orbit_period` (turns); NaN and 0
    where there are fewer orbits. With a dimension `start`: `label`, the place of the orbit to which
    it came, -1 for none, and `start_state`, its section point.

    Raises ValueError for bad arguments, and as `jaxcrusher.coexisting_orbits` does.
    """
    require_set_up()
    grid = make_grid(axes, base, scene)
    report = progress or (lambda finished, of: None)
    report(0, grid.size)
    asked = {"starts": starts, "spread": spread, "turns": turns, "seed": seed}
    columns = {name: COLUMNS[name] for name in HELD}
    # The quiet orbit is among them without a start that came to it.
    sizes = {"orbit": starts + 1, "start": starts, "coordinate": 2 * unknowns(grid.scene(0))}
    layout = Layout(grid, columns, (1,) * len(grid.shape), sizes)
    title = "Coexisting periodic orbits of jaw crushers over a grid of parameters"
    with opened(layout, store, title, grid.settings() | asked, asked) as kept:
        for design in range(grid.size):
            if design not in kept.done:
                row = _row(coexisting_orbits(grid.scene(design), **asked), starts + 1)
                cell = {name: np.reshape(v, layout.chunk + np.shape(v)) for name, v in row.items()}
                kept.write(design, cell, {})
            report(design + 1, grid.size)
        found = kept.dataset()
        most = int((found.orbit_period > 0).sum("orbit").max())
        return found.isel(orbit=slice(0, most))


def _row(found: CoexistingOrbits, most: int) -> dict[str, Any]:
    """Return the columns of one design, filled up to `most` orbits."""
    fill = (0, most - len(found.orbits))
    rms = np.array([float(orbit.foundation_rms) for orbit in found.orbits])
    shares = np.array(found.shares)
    reached = [*rms[shares > 0]]
    return {
        "share": np.pad(shares, fill, constant_values=np.nan),
        "share_error": np.pad(np.array(found.share_errors), fill, constant_values=np.nan),
        "orbit_rms": np.pad(rms, fill, constant_values=np.nan),
        "orbit_period": np.pad(np.array([orbit.period for orbit in found.orbits], int), fill),
        "label": found.labels,
        "start_state": found.starts,
        "worst_rms": max(reached, default=np.nan),
        "likeliest_rms": reached[0] if reached else np.nan,
        "unsettled": np.mean(found.labels < 0),
    }

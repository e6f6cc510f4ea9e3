"""Sweep driving speed and clearance: labelled statistics over a grid."""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr
from jaxtyping import ArrayLike

from jaxcrusher.basics.checks import require, require_positive, require_x64
from jaxcrusher.batch.engines import Engine, map_chunks
from jaxcrusher.crusher.scene import Scene, require_clearance
from jaxcrusher.motion.statistic import STATISTIC, STATISTICS
from jaxcrusher.motion.statistics import Statistics, statistics
from jaxcrusher.scenes.paper import paper_scene
from jaxcrusher.scenes.parameters import PE250X400

# Name -> unit and meaning of the variables of a sweep.
VARIABLES = {
    **{name: (STATISTIC[name].unit, STATISTIC[name].meaning) for name in STATISTICS},
    "foundation_rms_error": ("N", "standard error of the RMS"),
    "half_width_ratio": ("1", "Hertz's half-width / bore radius"),
    "impact_speed_ratio": ("1", "fastest approach / elastic limit"),
    "delivered_restitution": ("1", "restitution of the fastest impact"),
    "inside_model": ("1", "Hertzian contact and elastic impacts"),
    "whirl": ("1", "friction whirl"),
    "success": ("1", "integrated to the end"),
    "reached": ("rad", "shaft angle at the end, or at the failure"),
}
LOGICAL = ("whirl", "success", "inside_model")


def sweep(
    speeds: ArrayLike,
    clearances: ArrayLike,
    settle_turns: int,
    turns: int,
    *,
    chunk: int = 64,
    rtol: float = 1e-9,
    progress: Callable[[int, int], None] | None = None,
    engine: Engine | None = None,
    **options: Any,
) -> xr.Dataset:
    """Statistics of the paper's crusher over a grid of speeds and clearances.

    **Arguments:**

    - `speeds`, `clearances`: shapes (n,) and (m,), rad/s and m.
    - `settle_turns`, `turns`, `rtol`: as in `jaxcrusher.statistics`.
    - `chunk`: designs between two reports of progress.
    - `progress`: called with the number of finished and of all designs.
    - `engine`: as in `jaxcrusher.map_chunks`.
    - `options`: those of `jaxcrusher.paper_scene`.

    **Returns:** an `xarray.Dataset` with dims `speed` and `clearance`. A failed design has
    `success` False and NaN; it does not stop the others.

    Raises ValueError as `paper_scene` and `statistics` do.
    """
    require_x64()
    grid = {}
    for name, values, unit in (("speeds", speeds, "rad/s"), ("clearances", clearances, "m")):
        grid[name] = np.asarray(values, dtype=float)
        require(
            grid[name].ndim == 1 and grid[name].size > 0,
            name,
            "have shape (n,), n > 0",
            grid[name].shape,
        )
        require_positive(name, grid[name], unit)
    require_clearance(grid["clearances"], PE250X400["bore_radius"])
    pairs = np.stack(np.meshgrid(grid["speeds"], grid["clearances"], indexing="ij"), axis=-1)
    pairs = pairs.reshape(-1, 2)
    paper_scene(*pairs[0], **options)  # checks the options before anything is compiled
    scenes = jax.vmap(lambda pair: paper_scene(pair[0], pair[1], **options))(jnp.asarray(pairs))
    function = eqx.Partial(statistics_row, settle_turns=settle_turns, turns=turns, rtol=rtol)
    columns = {name: np.full(len(pairs), np.nan) for name in VARIABLES}
    for rows, values in map_chunks(function, scenes, chunk, engine):
        for name, column in columns.items():
            column[rows] = values[name]
        if progress is not None:
            progress(rows.stop, len(pairs))
    return _dataset(grid["speeds"], grid["clearances"], columns, settle_turns, turns, options)


def statistics_row(
    scene: Scene, settle_turns: int, turns: int, rtol: float
) -> dict[str, jax.Array]:
    """One design's `VARIABLES`; an ideal joint is inside the limits of contact."""
    return row_of(statistics(scene, settle_turns, turns, rtol=rtol))


def row_of(result: Statistics) -> dict[str, jax.Array]:
    """The `VARIABLES` of one design's statistics."""
    row = {name: result[name] for name in STATISTICS}
    row |= {name: getattr(result, name) for name in ("foundation_rms_error", "whirl", "success")}
    limits = ("half_width_ratio", "impact_speed_ratio", "delivered_restitution")
    row |= {name: getattr(result.validity, name) for name in limits}
    return row | {"inside_model": result.validity.inside, "reached": result.outcome.reached}


def _dataset(speeds, clearances, columns, settle_turns, turns, options) -> xr.Dataset:
    shape = (len(speeds), len(clearances))
    data = {}
    for name, (unit, meaning) in VARIABLES.items():
        values = columns[name].reshape(shape)
        if name in LOGICAL:
            values = values == 1
        attributes = {"units": unit, "long_name": meaning}
        data[name] = (("speed", "clearance"), values, attributes)
    coordinates = {
        "speed": ("speed", speeds, {"units": "rad/s", "long_name": "driving speed"}),
        "clearance": ("clearance", clearances, {"units": "m", "long_name": "radial clearance"}),
    }
    attributes = {name: str(value) for name, value in options.items()}
    attributes |= {"settle_turns": settle_turns, "turns": turns}
    return xr.Dataset(data, coordinates, attributes)

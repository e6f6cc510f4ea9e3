"""The global stage: every cell of a grid, or a Sobol sequence where a grid has too many."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
import scipy.spatial
import xarray as xr
from jaxtyping import Float
from scipy.stats import qmc

import jaxcrusher as jc
from jaxcrusher.batch.rows import LOGICAL
from jaxcrusher.batch.rows import meanings as meanings_of
from optimize.design import Design
from optimize.evaluate import STARTS, Case, Window, evaluate, judged

# More parameters than these get a Sobol sequence instead of a grid.
GRID_DIMENSIONS = 2


def points(design: Design, grid: tuple[int, int], samples: int, seed: int) -> np.ndarray:
    """Points of the unit box, shape (points, n): a grid of one or two parameters, or Sobol's."""
    count = len(design.names)
    if count > GRID_DIMENSIONS:
        return qmc.Sobol(count, rng=seed).random_base2(max(samples - 1, 1).bit_length())
    axes = [np.linspace(0, 1, cells) for cells in grid[:count]]
    return np.stack([axis.ravel() for axis in np.meshgrid(*axes, indexing="ij")], axis=-1)


def mapped(
    case: Case, units: np.ndarray, grid: tuple[int, int], window: Window, *, chunk: int = 64
) -> Iterator[tuple[int, xr.Dataset]]:
    """The landscape after each chunk of its `points`: how many are finished, and the dataset.

    Dims are `start` and the parameters of a grid, or `sample`; what is not finished is NaN and
    has `counts` 0. Variables as in `jaxcrusher.sweep`, with `objective`, `counts`, `steps` and
    the `state` at the end, whose last dim is `coordinate`.
    """
    columns: dict[str, np.ndarray] = {}
    for part, rows in evaluate(case, units, window, chunk=chunk):
        for name, values in rows.items():
            shape = (len(STARTS), len(units), *values.shape[2:])
            columns.setdefault(name, np.full(shape, np.nan))[:, part] = values
        yield part.stop, dataset(case, units, grid, columns)


def dataset(case: Case, units: np.ndarray, grid: tuple[int, int], columns: dict) -> xr.Dataset:
    """Columns of shape (starts, points, ...) as a labelled landscape."""
    meanings = meanings_of() | {
        "objective": (case.objective.unit, case.objective.meaning),
        "counts": ("1", "may be chosen: succeeded, no whirl, inside the constraints"),
        "steps": ("1", "integration steps"),
        "state": ("1, m/s", "state at the end, as in jaxcrusher.Section"),
    }
    columns = {
        name: column == 1 if name in (*LOGICAL, "counts") else column
        for name, column in columns.items()
    }
    starts = {"start": list(STARTS)}
    return labelled(case.design, units, grid, columns, meanings, {"state": "coordinate"}, starts)


def labelled(
    design: Design,
    units: Float[np.ndarray, "points n"],
    grid: tuple[int, int],
    columns: Mapping[str, np.ndarray],
    meanings: Mapping[str, tuple[str, str]],
    last: Mapping[str, str],
    first: Mapping[str, Sequence[str]] | None = None,
) -> xr.Dataset:
    """Columns over points of the unit box, whose dims become the grid's, or `sample`.

    `meanings` has unit and meaning of each; `last` names the last dim of those with one more,
    `first` a dim before the points' with its labels.
    """
    values = {name: np.asarray(numbers) for name, numbers in design.values(units).items()}
    coordinates: dict = dict(first or {})
    if len(design.names) > GRID_DIMENSIONS:
        dims: tuple[str, ...] = ("sample",)
        coordinates |= {name: ("sample", numbers) for name, numbers in values.items()}
        sizes = [len(units)]
    else:
        dims = design.names
        sizes = list(grid[: len(dims)])
        for i, name in enumerate(dims):
            axis = np.moveaxis(values[name].reshape(sizes), i, 0)
            coordinates[name] = axis.reshape(sizes[i], -1)[:, 0]
    data = {}
    for name, column in columns.items():
        before, after = len(first or {}), [last[name]] if name in last else []
        shape = [*column.shape[:before], *sizes, *column.shape[before + 1 :]]
        unit, meaning = meanings[name]
        every = (*(first or {}), *dims, *after)
        data[name] = (every, column.reshape(shape), {"units": unit, "long_name": meaning})
    result = xr.Dataset(data, coordinates)
    for name in design.names:
        parameter = jc.PARAMETERS[name]
        result[name].attrs = {"units": parameter.unit, "long_name": parameter.meaning}
    return result


def worst(landscape: xr.Dataset) -> xr.DataArray:
    """The objective of the worse start; NaN where a start does not count."""
    rows = {name: landscape[name].to_numpy() for name in ("objective", "counts")}
    values = landscape.objective.isel(start=0, drop=True).copy(data=judged(rows))
    values.attrs["long_name"] = f"{values.attrs['long_name']}, worse start"
    return values


def counting(
    landscape: xr.Dataset,
    units: Float[np.ndarray, "cells n"],
    points: Float[np.ndarray, "points n"],
) -> np.ndarray:
    """Whether both starts count in the cell of the landscape nearest to each of `points`."""
    counts = landscape.counts.all("start").to_numpy().ravel()
    return counts[scipy.spatial.KDTree(units).query(points)[1]]


def best_points(values: np.ndarray, units: np.ndarray, count: int) -> np.ndarray:
    """Of `units` (points, n) those with the least of `values` (points,), best first; NaN never."""
    order = np.argsort(values, kind="stable")  # NaN comes last
    return units[order[np.isfinite(values[order])][:count]]

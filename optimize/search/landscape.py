"""The global stage: the points of a grid, or of a Sobol sequence for many parameters."""

from collections.abc import Mapping, Sequence

import numpy as np
import scipy.spatial
import xarray as xr
from jaxtyping import Float

from jaxcrusher.files import table
from jaxcrusher.files.table import Column
from jaxcrusher.scenes.parameters import NUMBERS
from optimize.ask.constraints import end_well
from optimize.ask.design import GRID_DIMENSIONS, Design
from optimize.ask.problem import DesignProblem
from optimize.search.evaluate import STARTS, Rows, judged


def points(design: Design, grid: tuple[int, int], samples: int, seed: int) -> np.ndarray:
    """Return points (points, n) of the unit box: a grid of up to two parameters, or Sobol's."""
    count = len(design.names)
    if count > GRID_DIMENSIONS:
        from scipy.stats import qmc  # takes a second to import

        return qmc.Sobol(count, rng=seed).random(samples)
    axes = [np.linspace(0, 1, cells) for cells in grid[:count]]
    return np.stack([axis.ravel() for axis in np.meshgrid(*axes, indexing="ij")], axis=-1)


def spread(places: Float[np.ndarray, "points n"], count: int) -> Float[np.ndarray, "some n"]:
    """Return `count` points, evenly chosen by their index, or all points if there are fewer."""
    which = np.linspace(0, len(places) - 1, min(count, len(places))).round().astype(int)
    return places[which]


def dataset(
    problem: DesignProblem, places: Float[np.ndarray, "points n"], grid: tuple[int, int], rows: Rows
) -> xr.Dataset:
    """Return rows of shape (starts, points, ...) as a labelled landscape.

    Dims are `start` and the parameters of a grid, or `start` and `sample`. The columns are those
    of `jaxcrusher.sweep`, with `objective`, `counts`, `steps` and the final `state`.
    """
    return labelled(problem.design, places, grid, rows, problem.columns, {"start": list(STARTS)})


def labelled(
    design: Design,
    places: Float[np.ndarray, "points n"],
    grid: tuple[int, int],
    rows: Rows,
    columns: Mapping[str, Column],
    first: Mapping[str, Sequence[str]] | None = None,
) -> xr.Dataset:
    """Return the rows of places of the unit box with the dims of the grid, or with dim `sample`.

    `first` is a dim before those of the points, with its labels.
    """
    values = design.values(places)
    known = {**NUMBERS, **design.machine.numbers}
    labels = {
        name: {"units": known[name].unit, "long_name": known[name].meaning} for name in design.names
    }
    coordinates: dict = dict(first or {})
    if len(design.names) > GRID_DIMENSIONS:
        dims: tuple[str, ...] = ("sample",)
        sizes = [len(places)]
        coordinates |= {name: ("sample", v, labels[name]) for name, v in values.items()}
    else:
        dims = design.names
        sizes = list(grid[: len(dims)])
        for i, name in enumerate(dims):
            axis = np.moveaxis(values[name].reshape(sizes), i, 0)
            coordinates[name] = (name, axis.reshape(sizes[i], -1)[:, 0], labels[name])
    before = len(first or {})
    shaped = {
        name: column.reshape(*column.shape[:before], *sizes, *column.shape[before + 1 :])
        for name, column in rows.items()
    }
    return table.dataset((*(first or {}), *dims), shaped, columns, coordinates)


def rows_of(dataset: xr.Dataset, points: int) -> Rows:
    """Return the columns of a dataset as rows, with one axis for all `points`."""
    columns = {name: values.to_numpy() for name, values in dataset.items()}
    shape = dataset.counts.shape
    return {
        str(name): column.reshape(points, *column.shape[len(shape) :])
        for name, column in columns.items()
    }


def worst(landscape: xr.Dataset) -> xr.DataArray:
    """Return the objective of the worse start; NaN where a start does not count."""
    values = landscape.objective.isel(start=0, drop=True).copy(data=judged(landscape))
    values.attrs["long_name"] = f"{values.attrs['long_name']}, worse start"
    return values


def counting(
    landscape: xr.Dataset,
    places: Float[np.ndarray, "cells n"],
    points: Float[np.ndarray, "points n"],
) -> np.ndarray:
    """Tell for each of `points` whether both starts end well in the nearest cell of the landscape.

    Constraints apply to the orbits of these points, not to the transients of starts.
    """
    well = end_well(landscape).all(axis=0).ravel()
    return well[scipy.spatial.KDTree(places).query(points)[1]]


def best_points(values: np.ndarray, places: np.ndarray, count: int) -> np.ndarray:
    """Return the `places` (points, n) of the least finite `values` (points,), best first."""
    order = np.argsort(values, kind="stable")  # NaN comes last
    return places[order[np.isfinite(values[order])][:count]]

"""The global stage: every cell of a grid, or a Sobol sequence where a grid has too many."""

from collections.abc import Iterator

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import xarray as xr
from jaxtyping import Array, Float
from scipy.stats import qmc

import jaxcrusher as jc
from jaxcrusher.batch.engines import in_turn, map_all
from jaxcrusher.batch.rows import LOGICAL, VARIABLES
from jaxcrusher.dynamics.indicators import lyapunov_spectrum
from optimize.design import Design
from optimize.evaluate import STARTS, Case, Progress, Window, evaluate, judged, stacked_scenes

# More parameters than these get a Sobol sequence instead of a grid.
GRID_DIMENSIONS = 2
# Turns that the exponents of the map come from, and pieces of each: enough to tell 6 a turn
# from none, which is what there is (`jaxcrusher.regime` looks closer at the few that matter).
EXPONENT_TURNS, EXPONENT_SLICES = 6, 8
# An exponent below this (per turn) may be a swing that hardly damps: its tangent grows like the
# number of turns, ln(6) / 6 a turn, times what shear there is.
CHAOTIC = 1.0


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
    design = case.design
    values = {name: np.asarray(numbers) for name, numbers in design.values(units).items()}
    meanings = VARIABLES | {
        "objective": (case.objective.unit, case.objective.meaning),
        "counts": ("1", "may be chosen: succeeded, no whirl, inside the constraints"),
        "steps": ("1", "integration steps"),
        "state": ("1, m/s", "state at the end, as in jaxcrusher.Section"),
    }
    coordinates: dict = {"start": list(STARTS)}
    if len(design.names) > GRID_DIMENSIONS:
        dims: tuple[str, ...] = ("sample",)
        coordinates |= {name: ("sample", numbers) for name, numbers in values.items()}
    else:
        dims = design.names
        shape = grid[: len(dims)]
        for i, name in enumerate(dims):
            axis = np.moveaxis(values[name].reshape(shape), i, 0)
            coordinates[name] = axis.reshape(shape[i], -1)[:, 0]
    data = {}
    sizes = [len(coordinates[name]) for name in dims] if dims != ("sample",) else [len(units)]
    for name, column in columns.items():
        numbers = column.reshape(len(STARTS), *sizes, *column.shape[2:])
        if name in (*LOGICAL, "counts"):
            numbers = numbers == 1
        unit, meaning = meanings[name]
        every = ("start", *dims, "coordinate")[: numbers.ndim]
        data[name] = (every, numbers, {"units": unit, "long_name": meaning})
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


def best_points(values: np.ndarray, units: np.ndarray, count: int) -> np.ndarray:
    """Of `units` (points, n) those with the least of `values` (points,), best first; NaN never."""
    order = np.argsort(values, kind="stable")  # NaN comes last
    return units[order[np.isfinite(values[order])][:count]]


def exponents(
    case: Case,
    units: np.ndarray,
    states: Float[np.ndarray, "starts points dims"],
    rtol: float,
    progress: Progress,
    *,
    chunk: int = 64,
) -> tuple[np.ndarray, int]:
    """The largest Lyapunov exponent a turn of points going on from `states`, (starts, points).

    NaN where the motion failed. Also the integration steps taken.
    """
    scenes = stacked_scenes(case, jnp.asarray(units))
    batch = (scenes, states.reshape(-1, states.shape[-1]))
    function = eqx.Partial(_jacobians, rtol=rtol)
    jacobians, steps = map_all(function, batch, chunk, in_turn, progress)
    largest = np.full(states.shape[:2], np.nan)
    for i, products in enumerate(jacobians):
        if np.isfinite(products).all():
            spectrum = lyapunov_spectrum(products, slices=EXPONENT_SLICES)
            largest.flat[i] = spectrum.exponents[0]
    return largest, int(steps.sum())


def _jacobians(batch: tuple[jc.Scene, Array], rtol: float):
    scene, state = batch
    turns, slices = EXPONENT_TURNS, EXPONENT_SLICES
    section = jc.poincare_section(scene, 0, turns, slices=slices, state=state, rtol=rtol)
    return section.jacobians, section.outcome.steps


def spacing_bound(values: xr.DataArray) -> float:
    """How much the objective may change within half a cell of a grid, as far as it can tell.

    The largest difference of neighbouring cells beside the best one, halved and added up over
    the parameters: a bound if the objective is no rougher between cells than among them.
    """
    numbers = values.to_numpy()
    best = np.unravel_index(np.nanargmin(numbers), numbers.shape)
    total = 0.0
    for axis, i in enumerate(best):
        line = np.moveaxis(numbers, axis, 0)[(slice(None), *np.delete(best, axis))]
        near = [abs(line[j] - line[i]) for j in (i - 1, i + 1) if 0 <= j < len(line)]
        total += np.nanmax(near) / 2 if np.isfinite(near).any() else np.nan
    return float(total)

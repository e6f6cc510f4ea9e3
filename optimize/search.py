"""The search: map the box, refine by exact gradients, confirm by long independent runs.

A design is judged by the worse of two starts, since a machine may start either way: with its
pin centred in the bore (hard impacts, then chaos or not) and resting in contact (quiet). The
gradient is that of the quiet motion: the other's exists but says nothing after 30 ms of
impacts.
"""

from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optax
import xarray as xr
from jaxtyping import Array, Float

import jaxcrusher as jc
from jaxcrusher.batch import map_chunks, stack

STARTS = ("centred", "contact")
# Turns of a gradient run: the quiet start has no transient to wait for.
GRADIENT_TURNS = 4
# Tolerances of the landscape, of the gradient and of the confirmation, in clearances.
MAP_RTOL, GRADIENT_RTOL, CONFIRM_RTOL = 1e-6, 1e-8, 1e-9

Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class Box:
    """Bounds on speed (rad/s) and clearance (m); the search works on the unit square."""

    speed: tuple[float, float]
    clearance: tuple[float, float]

    def design(self, unit: Float[Array | np.ndarray, "*batch 2"]) -> tuple[Array, Array]:
        """Speed and clearance at a point of the unit square."""
        low = jnp.array([self.speed[0], self.clearance[0]])
        high = jnp.array([self.speed[1], self.clearance[1]])
        values = low + unit * (high - low)
        return values[..., 0], values[..., 1]

    def unit(self, speed, clearance) -> np.ndarray:
        """The inverse of `design`."""
        low = np.array([self.speed[0], self.clearance[0]])
        high = np.array([self.speed[1], self.clearance[1]])
        return (np.stack([speed, clearance], axis=-1) - low) / (high - low)


def map_block(
    box: Box, grid: tuple[int, int], rows: slice, settle: int, turns: int, options: dict
) -> xr.Dataset:
    """The landscape of both starts on some of the grid's speeds, with dim `start`."""
    speeds = np.linspace(*box.speed, grid[0])[rows]
    clearances = np.linspace(*box.clearance, grid[1])
    parts = [
        jc.sweep(speeds, clearances, settle, turns, start=start, rtol=MAP_RTOL, **options)
        for start in STARTS
    ]
    return xr.concat(parts, dim=xr.DataArray(list(STARTS), dims="start", name="start"))


def worst(landscape: xr.Dataset) -> xr.DataArray:
    """The RMS of the worse start; NaN where a run failed or whirls in any of them.

    A whirl's numbers are outside the contact theory: they rank as nothing.
    """
    valid = landscape.success.all("start") & ~landscape.whirl.any("start")
    rms = landscape.foundation_rms.max("start", skipna=False).where(valid)
    rms.attrs = {"units": "N", "long_name": r"worse RMS of $|R_O| + |R_C|$"}
    return rms


def best_cells(rms: xr.DataArray, count: int) -> list[tuple[float, float]]:
    """Speed and clearance of the cells of least RMS, best first."""
    flat = rms.stack(cell=("speed", "clearance")).dropna("cell")
    order = np.argsort(flat.to_numpy(), kind="stable")[:count]
    return [(float(flat.speed[i]), float(flat.clearance[i])) for i in order]


def _quiet_rms(unit: Float[Array, "2"], box: Box, options: dict) -> Array:
    speed, clearance = box.design(unit)
    scene = jc.paper_scene(speed, clearance, start="contact", **options)
    result = jc.statistics(
        scene, 0, GRADIENT_TURNS, outputs=("foundation_rms",), rtol=GRADIENT_RTOL
    )
    assert result.foundation_rms is not None
    return result.foundation_rms


def _value_and_gradient(unit, box: Box, options: dict) -> tuple[Array, Array]:
    return jax.value_and_grad(_quiet_rms)(unit, box, options)


def refine(
    box: Box, starts: np.ndarray, steps: int, options: dict, progress: Progress
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Adam with projection on the box, from every start (n, 2) of the unit square at once.

    Returns the paths, shape (steps + 1, n, 2), the quiet RMS (N) along them, (steps + 1, n),
    and its gradient by the unit square's coordinates at their ends, (n, 2). A point whose
    gradient is not finite stays where it is.
    """
    function = eqx.Partial(_value_and_gradient, box=box, options=options)
    optimiser = optax.adam(optax.cosine_decay_schedule(0.1, steps))
    unit = jnp.asarray(starts)
    state = optimiser.init(unit)
    path, values = [np.asarray(unit)], []
    gradient = np.zeros_like(starts)
    for step in range(steps + 1):
        ((_, (value, gradient)),) = map_chunks(function, unit, len(starts))
        values.append(value)
        if step == steps:
            break
        usable = np.isfinite(gradient).all(axis=-1, keepdims=True)
        # Adam divides by the gradient's own size; the mean RMS only makes it a number near 1.
        scaled = jnp.where(usable, gradient / np.nanmean(value), 0.0)
        updates, state = optimiser.update(scaled, state, unit)
        unit = optax.projections.projection_box(optax.apply_updates(unit, updates), 0.0, 1.0)
        path.append(np.asarray(unit))
        progress(step + 1, steps)
    return np.stack(path), np.stack(values), np.asarray(gradient)


def confirm(
    designs: list[tuple[float, float]], settle: int, turns: int, options: dict
) -> list[dict[str, dict]]:
    """Long runs of designs (rad/s, m) from both starts, at a tighter tolerance."""
    results: list[dict[str, dict]] = [{} for _ in designs]
    for start in STARTS:
        scenes = [jc.paper_scene(*design, start=start, **options) for design in designs]
        stacked = stack(scenes)
        function = eqx.Partial(_long_run, settle=settle, turns=turns)
        ((_, rows),) = map_chunks(function, stacked, len(designs))
        for i, result in enumerate(results):
            result[start] = jax.tree.map(lambda values, i=i: values[i].item(), rows)
    return results


def _long_run(scene: jc.Scene, settle: int, turns: int) -> dict[str, Any]:
    result = jc.statistics(scene, settle, turns, rtol=CONFIRM_RTOL)
    names = (*jc.STATISTICS, "foundation_rms_error", "whirl", "success")
    limits = {field.name: getattr(result.validity, field.name) for field in fields(jc.Validity)}
    return {name: getattr(result, name) for name in names} | {"validity": limits}

"""Sweeps of any parameters, in memory or into a Zarr store, here or on a Dask cluster.

What a chunk of a sweep holds depends on its ensemble and number only: each design is a scalar
program of its own numbers, and knows neither its neighbours nor how many there are.
"""

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr

from jaxcrusher.basics.checks import require_whole
from jaxcrusher.basics.setup import require_set_up
from jaxcrusher.batch.cluster import connected, worker_environment
from jaxcrusher.batch.engines import (
    CARD_CHUNK,
    Engine,
    chunk_of,
    computing,
    default_engine,
    name_of,
    run_all,
    run_of,
)
from jaxcrusher.batch.points import Grid, make_grid
from jaxcrusher.batch.store import Layout, chunk_shape, opened
from jaxcrusher.crusher.template import ALWAYS
from jaxcrusher.files.provenance import environment, now
from jaxcrusher.files.provenance import machine as computer
from jaxcrusher.files.table import COLUMNS, Column, columns_of
from jaxcrusher.mechanism.reductions import Chosen
from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.motion.method import require_tolerance, resolve
from jaxcrusher.motion.statistics import Statistics, over_turns
from jaxcrusher.scenes.earlier import axes_first
from jaxcrusher.scenes.machine import AbstractStructure, Machine, machine_of, scene_by

if TYPE_CHECKING:
    import distributed

# What a motion has besides its statistics, and what each loose joint has of it.
_MOTION = ("settled", "whirl", "success", "inside_model", "reached")
_LIMITS = ("half_width_ratio", "impact_speed_ratio", "delivered_restitution")


@axes_first
def sweep(
    machine: Machine | Callable[..., Scene],
    axes: Mapping[str, Any],
    settle_turns: int,
    turns: int,
    *,
    outputs: Sequence[str] = (),
    store: str | Path | None = None,
    chunk: int | None = None,
    rtol: float = 1e-9,
    progress: Callable[[int, int], None] | None = None,
    engine: Engine | None = None,
    scheduler: "str | distributed.Client | None" = None,
) -> xr.Dataset:
    """Compute statistics over the grid product of any parameters, in memory or in a Zarr store.

    Both give the same bits. A sweep into a store is kept chunk by chunk: killed at any moment and
    called again with the same arguments, it goes on where it was and ends with the same bits as an
    unbroken run. Called on a finished store, it verifies it.

    **Arguments:**

    - `machine`: what does not vary, as `jaxcrusher.paper_machine(start="contact")` or
      `jaxcrusher.read_machine("pump.toml")`; or a function of your own that makes a scene of the
      names of `axes`, which may then be any.
    - `axes`: names of the machine's numbers -> values, shape (n,), in SI units, or choices.
    - `settle_turns`, `turns`, `rtol`: as in `jaxcrusher.statistics`.
    - `outputs`: names of further statistics, besides those that are always computed.
    - `store`: None, or the store's folder; new, or one of an earlier call with the same arguments.
      Of a function of your own the name and the laws and numbers that it makes are compared, not
      its code.
    - `chunk`: the most designs in a chunk. A chunk lies between two reports of progress, can be
      lost by a kill, and is one file of each variable. None is as in `jaxcrusher.map_chunks`.
    - `progress`: called with the number of finished and of all designs, first at the start.
    - `engine`: as in `jaxcrusher.map_chunks`, but None is "lanes" on a cluster. Store and dataset
      name it in their attribute `engine`, and a store goes on with its own engine only.
    - `scheduler`: None for this machine; else a `distributed.Client` or a scheduler's address.

    **Returns:** an `xarray.Dataset` with a dimension for each axis, opened from the store if there
    is one. A failed design has `success` False and NaN; it does not stop the others. Each statistic
    has an `_error`, and `settled` says whether the motion has settled (see
    `jaxcrusher.motion.statistics.Statistics`). If some designs have not, the attribute `remark`
    says how many.

    Motions begin with the scene's start. The usual one is the paper's, "centred": it begins with
    impacts, as after a standstill, which leave a swing of the pin for thousands of turns.
    `machine.replace(start="contact")` begins close to the quiet motion that a design settles on,
    and `jaxcrusher.orbit_map` solves for it.

    Raises ValueError for bad arguments and for a store with other settings, naming what differs;
    RuntimeError for a store in use, for corrupt chunks and for workers that fail; OSError for what
    cannot be written, naming the chunk; ImportError for `scheduler` without the extra `cluster`.
    """
    require_set_up()
    title = "Statistics of machines over a grid of parameters"
    if engine is None and scheduler is not None:
        engine = "lanes"  # Its workers may differ in their devices.
    grid = make_grid(machine_of(machine), axes)
    made = plan(grid, settle_turns, turns, rtol, chunk, engine, outputs)
    return made.run(title, store, progress, scheduler)


@dataclass(frozen=True)
class Window:
    """The statistics of a motion over `turns` turns, after `settle_turns` of them.

    `statistics` are the entries of all scenes of a grid; one scene has some of them or all.
    """

    settle_turns: int
    turns: int
    rtol: float
    statistics: Chosen

    def __call__(self, scene: Scene) -> dict[str, jax.Array]:
        """Return the values of `columns_of_row` for one design."""
        method = resolve(scene, self.rtol)
        table = scene.statistics
        own = tuple((name, one) for name, one in self.statistics if name in table)
        found = over_turns(scene, None, self.settle_turns, self.turns, own, method)
        return row_of(found, [name for name, _ in own], scene.watched)

    def settings(self) -> dict[str, Any]:
        """Return what decides the values, as JSON keeps it."""
        window = {"settle_turns": self.settle_turns, "turns": self.turns, "rtol": self.rtol}
        added = {name: one.meaning for name, one in self.statistics if name not in ALWAYS}
        return window | ({"further statistics": added} if added else {})


@dataclass(frozen=True)
class Ensemble:
    """A window of every design of a layout's grid, by an engine of `jaxcrusher.map_chunks`."""

    layout: Layout
    window: Window
    engine: Engine

    def compute(self, number: int) -> tuple[int, dict[str, np.ndarray], dict[str, Any]]:
        """Compute a chunk: values of the shape of its region, and how they were computed."""
        started, designs = perf_counter(), self.layout.designs(number)
        grid, most = self.layout.grid, math.prod(self.layout.chunk)
        function = eqx.Partial(
            _statistics_of,
            structure=grid.structure,
            choices=grid.choices(int(designs.flat[0])),
            window=self.window,
        )
        columns = run_all(function, grid.numbers(designs.ravel()), most, self.engine, whole=most)
        # What other choices alone have, as the pressure of rollers, is not there.
        values = {
            name: np.reshape(columns.get(name, np.full(designs.size, one.missing)), designs.shape)
            for name, one in self.layout.columns.items()
        }
        record = {
            "machine": computer(),
            "designs": designs.size,
            "seconds": round(perf_counter() - started, 3),
            "finished": now(),
        }
        return number, values, record

    def settings(self) -> dict[str, Any]:
        """Return everything that decides the results, as JSON keeps it."""
        further = {"shape of a chunk": list(self.layout.chunk), "engine": name_of(self.engine)}
        return self.layout.grid.settings() | self.window.settings() | further

    def run(
        self,
        title: str,
        store: str | Path | None,
        progress: Callable[[int, int], None] | None,
        scheduler: "str | distributed.Client | None",
    ) -> xr.Dataset:
        """Fill the table, or the missing part of a store: chunks are written as they come."""
        layout, report = self.layout, progress or (lambda finished, of: None)
        about = self.window.settings() | {"engine": name_of(self.engine)}
        with connected(scheduler) as client:
            program = environment()
            if client is not None:  # which waits for the first worker
                program = client.submit(worker_environment, pure=False).result()
            with opened(layout, store, title, self.settings(), about, program) as kept:
                finished = sum(map(layout.size, kept.done))
                report(finished, layout.grid.size)
                missing = [n for n in range(layout.count) if n not in kept.done]
                compute = computing(
                    self.compute, missing, self.engine, client, layout.name, program
                )
                with compute as results:
                    for number, values, record in results:
                        kept.write(number, values, record)
                        finished += layout.size(number)
                        report(finished, layout.grid.size)
                found = kept.dataset()
        unsettled = int((found.success & ~found.settled).sum())
        remark = (
            f"{unsettled} of {found.success.size} designs have not settled within their turns: see "
            "their errors. The start `contact` begins near the motion that a design settles on, "
            "and `orbit_map` solves for it."
        )
        return found.assign_attrs(remark=remark) if unsettled else found


def _statistics_of(
    numbers: dict[str, jax.Array],
    structure: AbstractStructure,
    choices: Mapping[str, Any],
    window: Window,
) -> dict[str, jax.Array]:
    return window(scene_by(structure, {**numbers, **choices}))


def plan(
    grid: Grid,
    settle_turns: int,
    turns: int,
    rtol: float,
    designs: int | None,
    engine: Engine | None = None,
    outputs: Sequence[str] = (),
) -> Ensemble:
    """Return a checked sweep of a grid with at most `designs` designs a chunk.

    None takes as many as suit the engine.
    """
    require_whole("settle_turns", settle_turns, 0)
    require_whole("turns", turns, 1)
    require_tolerance(rtol)
    if designs is not None:
        require_whole("chunk", designs, 1)
    if engine is not None:
        run_of(engine)
    at_once = math.prod(chunk_shape(grid, designs or CARD_CHUNK))
    engine = engine or default_engine(at_once)
    designs = designs or chunk_of(at_once, engine)
    scenes = [grid.scene(alike[0]) for _, alike in grid.alike()]
    known = {name: one for scene in scenes for name, one in scene.statistics.items()}
    scenes[0].require_outputs(outputs, known)
    entries, joints = {}, {}
    for scene in scenes:
        asked = [name for name in outputs if name in scene.statistics]
        entries |= scene.entries((*scene.usual_statistics, *asked))
        joints |= scene.watched
    window = Window(settle_turns, turns, float(rtol), tuple(entries.items()))
    columns = columns_of_row(joints, window.statistics)
    layout = Layout(grid, columns, chunk_shape(grid, designs))
    return Ensemble(layout, window, engine)


def columns_of_row(joints: Mapping[str, str], statistics: Chosen) -> dict[str, Column]:
    """Return the columns of `row_of`."""
    found = columns_of(dict(statistics), (name for name, _ in statistics))
    found |= {
        f"{name}_error": Column(one.unit, f"error of the {one.meaning}")
        for name, one in found.items()
    }
    for joint, prefix in joints.items():
        at = f", {joint}" if prefix else ""
        for name in _LIMITS:
            one = COLUMNS[name]
            found[prefix + name] = one._replace(meaning=one.meaning + at)
    return found | {name: COLUMNS[name] for name in _MOTION}


def row_of(
    result: Statistics, statistics: Sequence[str], joints: Mapping[str, str]
) -> dict[str, jax.Array]:
    """Return the values of one design; an ideal joint is inside the limits of contact."""
    limits = {"main": result.validity, **result.validity.others}
    row = {name: result[name] for name in statistics}
    for (joint, prefix), name in itertools.product(joints.items(), _LIMITS):
        value = getattr(limits[joint], name)
        row[prefix + name] = jnp.full((), jnp.nan) if value is None else value
    errors = {f"{name}_error": result.error(name) for name in statistics}
    motion = {
        "settled": result.settled,
        "whirl": result.whirl,
        "success": result.success,
        "inside_model": result.validity.inside,
        "reached": result.outcome.reached,
    }
    return row | errors | motion

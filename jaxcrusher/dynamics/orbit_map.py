"""Periodic orbits of a grid of crushers, each solved for from its neighbours."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import equinox as eqx
import numpy as np
import xarray as xr
from jaxtyping import Array, PyTree, Scalar

from jaxcrusher.basics.checks import require, require_choice, require_names, require_whole
from jaxcrusher.basics.setup import require_set_up
from jaxcrusher.batch.cluster import connected
from jaxcrusher.batch.engines import Engine, name_of, without_lanes
from jaxcrusher.batch.points import Grid, make_grid
from jaxcrusher.batch.store import Layout, opened
from jaxcrusher.dynamics.many_orbits import MOTION, SEEN, Rows, Sought, beside, solve_orbits
from jaxcrusher.files.table import COLUMNS, Column, columns_of
from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.orbits.effort import EFFORTS
from jaxcrusher.orbits.forced import refusal, unknowns
from jaxcrusher.orbits.result import PeriodicOrbit
from jaxcrusher.scenes.earlier import axes_first
from jaxcrusher.scenes.machine import AbstractStructure, Machine, machine_of, scene_by

if TYPE_CHECKING:
    import distributed


@axes_first
def orbit_map(
    machine: Machine | Callable[..., Scene],
    axes: Mapping[str, Any],
    *,
    period: int | None = None,
    slopes: Sequence[str] = (),
    metric: str | None = None,
    nodes: int | None = None,
    effort: Literal["quick", "usual", "thorough"] = "usual",
    store: str | Path | None = None,
    engine: Engine | None = None,
    scheduler: "str | distributed.Client | None" = None,
    progress: Callable[[int, int], None] | None = None,
) -> xr.Dataset:
    """Find the periodic orbit of every design of a grid, as `jaxcrusher.periodic_orbit` finds it.

    Every cell is solved from the pin resting in its bore, on all cores. Where that leads to no
    orbit that is surely stable, the cell's orbit is searched for as for a single design, with the
    same effort and the same answer; lanes integrate the turns of many searches. A cell that has no
    orbit then is tried from neighbours along the axes, up to four steps away and the nearest first,
    for as long as that helps. `found` says by which way a cell was found. It may lie on another
    branch than the next cell's.

    **Arguments:**

    - `machine`: what does not vary, as in `jaxcrusher.sweep`.
    - `axes`: names of the machine's numbers -> values, shape (n,), in SI units, or choices.
      Neighbours are cells some steps along a number, so their order should be increasing.
    - `period`, `nodes`, `effort`: as in `periodic_orbit`; with `nodes` nothing is searched for.
    - `slopes`: names of numbers by which `metric`, a statistic of `PeriodicOrbit`, is
      differentiated: any number of them costs about as much as one.
    - `store`: None, or a folder in which the map is kept while it is computed, and then as a Zarr
      store. Killed at any moment and called again with the same arguments, it goes on where it was
      and ends with the same bits.
    - `engine`: as in `jaxcrusher.map_chunks`; None takes lanes only for turns of searches. The
      attribute `engine` names the one that solves for orbits.
    - `scheduler`: as in `jaxcrusher.sweep`. Its workers must have this process's environment, and
      the map has the same bits as without.
    - `progress`: called with the number of finished and of all designs, first at the start; a
      failed cell is finished when its neighbours have been tried.

    **Returns:** an `xarray.Dataset` with a dimension for each axis: all statistics, the `period`
    (turns), the estimated `error` of the RMS (a share of it), `least_penetration` (clearances),
    `largest_multiplier`, `multipliers_error`, `settling_turns`, `slope` (with a dimension
    `parameter`, in the unit of `metric` per unit of the parameter), and `multiplier_real`,
    `multiplier_imag` (with a dimension `multiplier`, in no order). `success`, `stable` and
    `undecided` are logical, `found` is in words. Where there is no success every number is NaN, and
    `failure` says why. Where the motion from rest leads to no stable orbit, `motion` says what it
    does, in the words of `PeriodicOrbit.instability`; `run_rms` is its RMS over the last half of
    the integrated turns, and `run_rms_error` the standard error of this RMS.

    Raises ValueError for bad arguments, and in one line for scenes that have no such orbit;
    RuntimeError for workers that fail, and ImportError as `jaxcrusher.sweep` does.
    """
    require_set_up()
    require_whole("period", 1 if period is None else period, 1)
    require_choice("effort", effort, tuple(EFFORTS))
    if nodes is not None:
        require_whole("nodes", nodes, 4)
        require(nodes % 2 == 0, "nodes", "be even", nodes)
    grid, slopes = make_grid(machine_of(machine), axes), tuple(slopes)
    require_names("slopes", slopes, tuple(grid.names_of_numbers))
    require(len(set(slopes)) == len(slopes), "slopes", "name every number once", slopes)
    groups = list(grid.alike())
    first = [grid.scene(designs[0]) for _, designs in groups]
    metric = first[0].headline if metric is None else metric
    require_choice("metric", metric, tuple(first[0].statistics))
    for one in first:
        if refused := refusal(one):
            raise ValueError(f"Argument `scene` must {refused}.")
    report = progress or (lambda finished, of: None)
    report(0, grid.size)
    asked = {"period": period, "slopes": list(slopes), "metric": metric}
    asked |= {"nodes": nodes, "effort": effort}
    settings = grid.settings() | asked | ({} if engine is None else {"engine": name_of(engine)})
    layout, done = _layout(grid, first, slopes, metric), 0
    title = "Periodic orbits of machines over a grid of parameters"
    told = asked | {"engine": name_of(engine or without_lanes())}
    with (
        connected(scheduler) as client,
        opened(layout, store, title, settings, told) as kept,
    ):
        if 0 not in kept.done:
            found = {}
            for (choices, designs), one in zip(groups, first, strict=True):
                sought = Sought(
                    eqx.Partial(_scene, slopes=slopes, structure=grid.structure, choices=choices),
                    (eqx.Partial(_metric, name=metric),),
                    period,
                    unknowns(one),
                    nodes,
                )
                found[tuple(designs)] = _solve_designs(
                    grid,
                    designs,
                    sought,
                    slopes,
                    effort=effort if nodes is None else None,
                    engine=engine,
                    journal=kept.journal,
                    scheduler=client,
                    progress=lambda finished, _, before=done: report(before + finished, grid.size),
                )
                done += len(designs)
            kept.write(0, _joined(layout, found), {})
        return kept.dataset()


def _scene(
    free: Array,
    rest: dict[str, Array],
    slopes: tuple[str, ...],
    structure: AbstractStructure,
    choices: Mapping[str, str],
) -> Scene:
    numbers = rest | {name: free[i] for i, name in enumerate(slopes)}
    return scene_by(structure, {**numbers, **choices})


def _metric(orbit: PeriodicOrbit, scene: Scene, free: Array, rest: PyTree, name: str) -> Scalar:
    return orbit[name]


def _solve_designs(
    grid: Grid, designs: list[int], sought: Sought, slopes: tuple[str, ...], **how: Any
) -> Rows:
    """Solve for the orbits of designs of the same choices, with settings of `solve_orbits`."""
    numbers, place = grid.numbers(designs), {design: i for i, design in enumerate(designs)}
    free = [numbers.pop(name) for name in slopes]
    near = beside(grid.shape, [not grid.chooses(name) for name in grid.axes])
    rows = solve_orbits(
        sought,
        (np.stack(free, axis=1) if free else np.empty((len(designs), 0)), numbers),
        neighbours=lambda case: [place[design] for design in near(designs[case])],
        **how,
    )
    return rows | {"slope": rows.pop("slopes")[:, 0]}


def _layout(grid: Grid, scenes: list[Scene], slopes: tuple[str, ...], metric: str) -> Layout:
    """Return the columns that all designs have: of an ideal joint there are fewer."""
    held = set.intersection(*(set(scene.statistics) for scene in scenes))
    table = scenes[0].statistics
    columns = columns_of(table, (name for name in table if name in held))
    columns |= {name: COLUMNS[name] for name in (*SEEN, "failure", "found", *MOTION)}
    further: dict[str, np.ndarray | int] = {}
    if slopes:
        meaning = f"slope of {metric} by the parameter, per its unit"
        columns["slope"] = Column(table[metric].unit, meaning, dims=("parameter",))
        further["parameter"] = np.array(slopes, object)
    counts = {unknowns(scene) for scene in scenes}
    if len(counts) == 1 and (count := counts.pop()):
        columns |= {name: COLUMNS[name] for name in ("multiplier_real", "multiplier_imag")}
        further["multiplier"] = 2 * count
    return Layout(grid, columns, grid.shape, further)


def _joined(layout: Layout, found: Mapping[tuple[int, ...], Rows]) -> Rows:
    """Return the columns of the whole grid."""
    values, shape = Rows(), layout.grid.shape
    for name, column in layout.columns.items():
        kind = object if column.kind is str else column.kind
        whole = np.empty((layout.grid.size, *layout.inner(column)), kind)
        for designs, rows in found.items():
            whole[list(designs)] = rows[name]
        values[name] = whole.reshape(*shape, *whole.shape[1:])
    return values

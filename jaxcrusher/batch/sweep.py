"""Sweeps of any parameters, in memory or into a Zarr store, here or on a Dask cluster."""

import contextlib
import functools
import math
from collections.abc import Callable, Generator, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from jaxcrusher.basics.setup import require_set_up
from jaxcrusher.batch.cluster import compute_on, connect, worker_environment
from jaxcrusher.batch.engines import CHUNK, Engine
from jaxcrusher.batch.plan import Plan, Result, compute_chunk, make_plan
from jaxcrusher.batch.rows import LOGICAL
from jaxcrusher.batch.store import ChunkStore
from jaxcrusher.files.provenance import environment, provenance
from jaxcrusher.scenes.parameters import PARAMETERS

if TYPE_CHECKING:
    import distributed

# Computes chunks by their numbers, and yields them as they finish.
Compute = Callable[[list[int]], Generator[Result, None, None]]


def sweep(
    axes: Mapping[str, Any],
    settle_turns: int,
    turns: int,
    *,
    base: Mapping[str, Any] | None = None,
    store: str | Path | None = None,
    chunk: int = CHUNK,
    rtol: float = 1e-9,
    progress: Callable[[int, int], None] | None = None,
    engine: Engine | None = None,
    scheduler: "str | distributed.Client | None" = None,
) -> xr.Dataset:
    """Statistics over the grid product of any parameters, in memory or in a Zarr store.

    Both give the same bits. A sweep into a store is kept chunk by chunk: killed at any moment and
    called again with the same arguments, it goes on where it was and ends with the same bits as an
    unbroken run. Called on a finished store, it verifies it.

    **Arguments:**

    - `axes`: names of `jaxcrusher.PE250X400` -> values, shape (n,), in SI units, or choices.
    - `settle_turns`, `turns`, `rtol`: as in `jaxcrusher.statistics`.
    - `base`: names -> values of what does not vary, where it is not the paper's.
    - `store`: None, or the store's folder; new, or one of an earlier call with the same arguments.
    - `chunk`: designs at most in a chunk: between two reports of progress, what a kill can lose,
      and a file of each variable.
    - `progress`: called with the number of finished and of all designs, first at the start.
    - `engine`: as in `jaxcrusher.map_chunks`.
    - `scheduler`: None for this machine; else a `distributed.Client` or a scheduler's address.

    **Returns:** an `xarray.Dataset` with a dimension for each axis, opened from the store if there
    is one. A failed design has `success` False and NaN; it does not stop the others.

    Raises ValueError for bad arguments and for a store with other settings, naming what differs;
    RuntimeError for a store in use, for corrupt chunks and for workers that fail; OSError for what
    cannot be written, naming the chunk; ImportError for `scheduler` without the extra `cluster`.
    """
    require_set_up()
    plan = make_plan(axes, base or {}, settle_turns, turns, rtol, chunk, engine)
    with _workers(plan, scheduler) as (settings, compute):
        attributes = _attributes(plan, settings)
        if store is None:
            memory = Memory(plan)
            _fill(memory, plan, compute, progress)
            return memory.dataset(attributes)
        attributes["machine"] += "; that of each chunk stands in .sweep/done"
        with ChunkStore(Path(store), plan, plan.settings() | settings, attributes) as kept:
            _fill(kept, plan, compute, progress)
        return xr.open_zarr(store)


class Memory:
    """What a `ChunkStore` keeps on the disk, as arrays."""

    def __init__(self, plan: Plan):
        self._plan, self.done = plan, set()
        self._columns = {
            name: np.full(plan.shape, False if name in LOGICAL else np.nan)
            for name in plan.variables
        }

    def write(self, number: int, values: dict[str, np.ndarray], record: dict[str, Any]) -> None:
        """Keep a chunk; its record is not."""
        for name, column in self._columns.items():
            column[self._plan.region(number)] = values[name]
        self.done.add(number)

    def dataset(self, attributes: dict[str, Any]) -> xr.Dataset:
        """The same as that of the store."""
        data = {
            name: (tuple(self._plan.axes), column, {"units": unit, "long_name": meaning})
            for (name, column), (unit, meaning) in zip(
                self._columns.items(), self._plan.variables.values(), strict=True
            )
        }
        coordinates = {
            name: (name, values, labels)
            for name, (values, labels) in self._plan.coordinates().items()
        }
        return xr.Dataset(data, coordinates, attributes)


def _fill(
    kept: Memory | ChunkStore,
    plan: Plan,
    compute: Compute,
    progress: Callable[[int, int], None] | None,
) -> None:
    """Compute what is missing, and write it as it comes."""
    report = progress or (lambda finished, of: None)
    finished, total = sum(map(plan.size, kept.done)), math.prod(plan.shape)
    report(finished, total)
    missing = [n for n in range(math.prod(plan.chunks)) if n not in kept.done]
    with contextlib.closing(compute(missing)) as results:
        for number, values, record in results:
            kept.write(number, values, record)
            finished += plan.size(number)
            report(finished, total)


@contextlib.contextmanager
def _workers(
    plan: Plan, scheduler: "str | distributed.Client | None"
) -> Iterator[tuple[dict[str, Any], Compute]]:
    """The environment that computes, and how."""
    if scheduler is None:
        yield environment(), functools.partial(_compute_here, plan)
        return
    client = connect(scheduler) if isinstance(scheduler, str) else scheduler
    try:
        # Waits for the first worker.
        settings = client.submit(worker_environment, pure=False).result()
        yield settings, functools.partial(compute_on, client, plan, settings)
    finally:
        if client is not scheduler:
            client.close()


def _compute_here(plan: Plan, numbers: list[int]) -> Generator[Result, None, None]:
    for number in numbers:
        yield number, *compute_chunk(plan, number)


def _attributes(plan: Plan, settings: dict[str, Any]) -> dict[str, Any]:
    """Provenance, for the reader."""
    numbers = {
        name: [value, PARAMETERS[name].unit]
        for name, value in plan.base.items()
        if name in PARAMETERS
    }
    return provenance(
        "Statistics of jaw crushers over a grid of parameters",
        settings,
        parameters=numbers,
        choices={name: value for name, value in plan.base.items() if name not in PARAMETERS},
        settle_turns=plan.settle_turns,
        turns=plan.turns,
        rtol=plan.rtol,
    )

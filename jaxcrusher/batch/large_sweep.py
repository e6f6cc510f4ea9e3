"""Sweeps of any parameters into a Zarr store: on this machine or on a Dask cluster."""

import contextlib
import functools
import math
from collections.abc import Callable, Generator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import xarray as xr

from jaxcrusher.basics.checks import require_x64
from jaxcrusher.batch.cluster import compute_on, connect, worker_environment
from jaxcrusher.batch.plan import Plan, Result, compute_chunk, make_plan
from jaxcrusher.batch.store import ChunkStore
from jaxcrusher.files.provenance import environment, machine, provenance
from jaxcrusher.scenes.parameters import PARAMETERS

if TYPE_CHECKING:
    import distributed


def sweep_to_store(
    store: str | Path,
    axes: Mapping[str, Any],
    settle_turns: int,
    turns: int,
    *,
    base: Mapping[str, Any] | None = None,
    chunk: int = 1024,
    rtol: float = 1e-9,
    progress: Callable[[int, int], None] | None = None,
    scheduler: "str | distributed.Client | None" = None,
) -> xr.Dataset:
    """Statistics over the grid product of any parameters, kept chunk by chunk in a Zarr store.

    Killed at any moment and called again with the same arguments, it goes on where it was and
    ends with the same bits as an unbroken run. Called on a finished store, it verifies it.

    **Arguments:**

    - `store`: the store's folder; new, or one of an earlier call with the same arguments.
    - `axes`: names of `jaxcrusher.PE250X400` -> values, shape (n,), in SI units, or choices.
    - `settle_turns`, `turns`, `rtol`: as in `jaxcrusher.statistics`.
    - `base`: names -> values of what does not vary, where it is not the paper's.
    - `chunk`: designs at most in a chunk: what a kill can lose, and a file of each variable.
    - `progress`: called with the number of finished and of all designs, first at the start.
    - `scheduler`: None for this machine; else a `distributed.Client` or a scheduler's address.

    **Returns:** an `xarray.Dataset` opened from the store, with a dimension for each axis. A
    failed design has `success` False and NaN; it does not stop the others.

    Raises ValueError for bad arguments and for a store with other settings, naming what differs;
    RuntimeError for a store in use, for corrupt chunks and for workers that fail; OSError for what
    cannot be written, naming the chunk; ImportError for `scheduler` without the extra `cluster`.
    """
    require_x64()
    plan = make_plan(axes, base or {}, settle_turns, turns, rtol, chunk)
    path = Path(store)
    if scheduler is None:
        return _fill(path, plan, environment(), functools.partial(_compute_here, plan), progress)
    client = connect(scheduler) if isinstance(scheduler, str) else scheduler
    try:
        # Waits for the first worker.
        settings = client.submit(worker_environment, pure=False).result()
        compute = functools.partial(compute_on, client, plan, settings)
        return _fill(path, plan, settings, compute, progress)
    finally:
        if client is not scheduler:
            client.close()


def _fill(
    path: Path,
    plan: Plan,
    settings: dict[str, Any],
    compute: Callable[[list[int]], Generator[Result, None, None]],
    progress: Callable[[int, int], None] | None,
) -> xr.Dataset:
    """Compute what is missing, and write it as it comes."""
    report = progress or (lambda finished, of: None)
    with ChunkStore(path, plan, plan.settings() | settings, _attributes(plan, settings)) as store:
        finished, total = sum(map(plan.size, store.done)), math.prod(plan.shape)
        report(finished, total)
        missing = [n for n in range(math.prod(plan.chunks)) if n not in store.done]
        with contextlib.closing(compute(missing)) as results:
            for number, values, record in results:
                store.write(number, values, record)
                finished += plan.size(number)
                report(finished, total)
    return xr.open_zarr(path)


def _compute_here(plan: Plan, numbers: list[int]) -> Generator[Result, None, None]:
    for number in numbers:
        yield number, *compute_chunk(plan, number)


def _attributes(plan: Plan, settings: dict[str, Any]) -> dict[str, Any]:
    """Provenance of a store, for its reader."""
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
        machine=f"{machine()}; that of each chunk stands in .sweep/done",
    )

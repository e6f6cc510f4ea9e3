"""Many designs, each looked at alike: chunk by chunk, in memory or in a store, here or elsewhere.

What a chunk holds depends on its ensemble and number only: each design is a scalar program of its
own numbers, run by a sequential loop, and knows neither its neighbours nor how many there are.
"""

import contextlib
import functools
from collections.abc import Callable, Generator, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

import equinox as eqx
import numpy as np
import xarray as xr
from jaxtyping import Array

from jaxcrusher.batch.cluster import compute_on, connect, worker_environment
from jaxcrusher.batch.engines import Engine, in_order, name_of, run_all
from jaxcrusher.batch.layout import Layout, Memory
from jaxcrusher.batch.points import SceneFunction, scene_by
from jaxcrusher.batch.store import ChunkStore
from jaxcrusher.crusher.scene import Scene
from jaxcrusher.files.provenance import environment, machine, now, provenance

if TYPE_CHECKING:
    import distributed

# A chunk's number, its values by column, and a record of how they were computed.
Result = tuple[int, dict[str, np.ndarray], dict[str, Any]]
# Computes chunks by their numbers, and yields them as they finish.
Compute = Callable[[list[int]], Generator[Result, None, None]]
Progress = Callable[[int, int], None]


@runtime_checkable
class Look(Protocol):
    """A function of a scene: pure, hashable, and the same wherever it is pickled to."""

    def __call__(self, scene: Scene) -> dict[str, Array]:
        """Return named values, each of a column of the table."""
        ...

    def settings(self) -> dict[str, Any]:
        """Return what decides the values besides the scene, as JSON keeps it."""
        ...


@dataclass(frozen=True)
class Ensemble:
    """A look at every design of a layout's grid, by an engine of `jaxcrusher.map_chunks`."""

    layout: Layout
    look: Look
    engine: Engine

    def compute(self, number: int) -> Result:
        """Compute a chunk: values of the shape of its region, and how they were computed."""
        started, layout = perf_counter(), self.layout
        designs = layout.designs(number)
        function = eqx.Partial(
            _seen,
            make=layout.grid.function,
            choices=layout.grid.choices(int(designs[0])),
            look=self.look,
        )
        columns = run_all(function, layout.grid.numbers(designs), len(designs), self.engine)
        kept = tuple(slice(part.stop - part.start) for part in layout.region(number))
        values = {
            name: column.reshape(*layout.chunk, *column.shape[1:])[kept]
            for name, column in columns.items()
        }
        record = {
            "machine": machine(),
            "designs": layout.size(number),
            "seconds": round(perf_counter() - started, 3),
            "finished": now(),
        }
        return number, values, record

    def settings(self) -> dict[str, Any]:
        """Return everything that decides the results, as JSON keeps it."""
        further = {"shape of a chunk": list(self.layout.chunk), "engine": name_of(self.engine)}
        return self.layout.grid.settings() | self.look.settings() | further

    def run(
        self,
        title: str,
        store: str | Path | None,
        progress: Progress | None,
        scheduler: "str | distributed.Client | None",
    ) -> xr.Dataset:
        """Fill the table, or what a store lacks of it."""
        with _workers(self, scheduler) as (program, compute):
            about = self.look.settings() | {"engine": name_of(self.engine)}
            with opened(self.layout, store, title, self.settings(), about, program) as kept:
                fill(kept, self.layout, compute, progress)
                return kept.dataset()


def _seen(
    numbers: dict[str, Array], make: SceneFunction | None, choices: Mapping[str, Any], look: Look
) -> dict[str, Array]:
    return look(scene_by(make, numbers, choices))


def fill(
    kept: Memory | ChunkStore, layout: Layout, compute: Compute, progress: Progress | None
) -> None:
    """Compute the chunks that are missing, and write them as they come."""
    report = progress or (lambda finished, of: None)
    finished, total = sum(map(layout.size, kept.done)), layout.grid.size
    report(finished, total)
    missing = [n for n in range(layout.count) if n not in kept.done]
    with contextlib.closing(compute(missing)) as results:
        for number, values, record in results:
            kept.write(number, values, record)
            finished += layout.size(number)
            report(finished, total)


@contextlib.contextmanager
def opened(
    layout: Layout,
    store: str | Path | None,
    title: str,
    settings: Mapping[str, Any],
    about: Mapping[str, Any],
    program: dict[str, Any] | None = None,
) -> Iterator[Memory | ChunkStore]:
    """Open the table: in memory, or the store at a path, whose settings must be the same.

    `about` is told in the attributes, and `program` is the `environment` that computes.
    """
    program = environment() if program is None else program
    attributes = provenance(title, program, **layout.grid.attributes(), **about)
    if store is None:
        yield Memory(layout, attributes)
        return
    attributes["machine"] += "; that of each chunk stands in .sweep/done"
    with ChunkStore(Path(store), layout, {**settings, **program}, attributes) as kept:
        yield kept


@contextlib.contextmanager
def _workers(
    ensemble: Ensemble, scheduler: "str | distributed.Client | None"
) -> Iterator[tuple[dict[str, Any], Compute]]:
    """Yield the environment that computes, and how."""
    if scheduler is None:
        yield environment(), lambda numbers: in_order(ensemble.compute, numbers, ensemble.engine)
        return
    client = connect(scheduler) if isinstance(scheduler, str) else scheduler
    try:
        # Waits for the first worker.
        program = client.submit(worker_environment, pure=False).result()
        yield program, functools.partial(compute_on, client, ensemble, program)
    finally:
        if client is not scheduler:
            client.close()

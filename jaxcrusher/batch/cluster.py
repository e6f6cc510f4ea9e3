"""Chunks of a sweep on a Dask cluster: workers compute, the caller writes.

The workers get an ensemble's method and a number, and send back its columns, some 100 kB a chunk.
They need no shared file system and no lock, and a worker that dies holds nothing but its chunk in
progress, which Dask gives to another one. A worker may be new at any chunk. So it gets the method
as bytes, and opens them when it is set up: they import Equinox, which reads its settings then.
"""

import contextlib
from collections.abc import Callable, Generator, Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from jaxcrusher.basics.checks import require
from jaxcrusher.basics.setup import set_up
from jaxcrusher.files.provenance import environment

if TYPE_CHECKING:
    import distributed

# A chunk's number, its values by column, and a record of how they were computed.
Result = tuple[int, dict[str, np.ndarray], dict[str, Any]]
# Computes chunks by their numbers, and yields them as they finish.
Compute = Callable[[list[int]], Generator[Result, None, None]]


@contextlib.contextmanager
def workers(
    scheduler: "str | distributed.Client",
    compute: Callable[[int], Result],
    name: Callable[[int], str],
) -> Iterator[tuple[dict[str, Any], Compute]]:
    """Yield the environment of a cluster's workers, and how they `compute` chunks of such a `name`.

    `scheduler` is a client or an address. Raises ValueError for anything else, and ImportError if
    Dask is not installed.
    """
    try:
        import distributed
    except ImportError:
        raise ImportError(
            "Argument `scheduler` needs Dask: pip install 'jaxcrusher[cluster]'."
        ) from None
    own = not isinstance(scheduler, distributed.Client)
    if own:
        # Before a client tries it, which would hold the process for a minute at its end.
        must = 'be a client of Dask, or the address of a scheduler such as "tcp://host:8786"'
        require(_is_address(scheduler), "scheduler", must, repr(scheduler))
    client = distributed.Client(scheduler, set_as_default=False) if own else scheduler
    try:
        # Waits for the first worker.
        program = client.submit(worker_environment, pure=False).result()
        yield program, lambda numbers: compute_on(client, compute, name, program, numbers)
    finally:
        if own:
            client.close()


def _is_address(given: Any) -> bool:
    from distributed.comm.addressing import get_address_host

    try:
        get_address_host(given)
    except (TypeError, ValueError):
        return False
    return True


def worker_environment() -> dict[str, Any]:
    """A worker's `environment`, after it was set up: each process has a JAX of its own."""
    set_up()
    return environment()


def compute_on(
    client: "distributed.Client",
    compute: Callable[[int], Result],
    name: Callable[[int], str],
    program: dict[str, Any],
    numbers: list[int],
) -> Generator[Result, None, None]:
    """Yield the chunks as they finish; RuntimeError names a chunk that workers failed on.

    `program` is the environment that each worker must have.
    """
    from distributed import as_completed
    from distributed.protocol.pickle import dumps

    todo, packed = iter(numbers), dumps(compute)
    pending = {}
    finished = as_completed(loop=client.loop)

    def submit() -> None:
        # Two chunks a thread keep every worker busy, and no results pile up unwritten.
        threads: dict[str, int] = client.nthreads()  # pyright: ignore
        wanted = max(1, 2 * sum(threads.values()))
        for number in todo:
            future = client.submit(_work, packed, number, program, pure=False)
            pending[future] = number
            finished.add(future)
            if len(pending) >= wanted:
                break

    try:
        submit()
        for future in finished:
            number = pending.pop(future)
            try:
                result = future.result()
            except Exception as error:
                raise RuntimeError(f"Chunk {name(number)} was not computed: {error}") from error
            submit()
            yield result
    finally:
        client.cancel(list(pending))


def _work(packed: bytes, number: int, program: dict[str, Any]) -> Result:
    here = worker_environment()
    if here != program:
        raise RuntimeError(f"this worker has {here}, the store is made with {program}")
    from distributed.protocol.pickle import loads

    return loads(packed)(number)

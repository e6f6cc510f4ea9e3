"""Chunks on a Dask cluster: workers compute, the caller writes.

A worker gets a function and its arguments for a chunk, and sends back the results, some 100 kB.
Workers need no shared file system and no lock. If one dies, Dask gives its chunk to another one. A
worker may be new at any chunk. So it gets function and arguments as bytes, and opens them after it
is set up: they import Equinox, which reads its settings then.
"""

import contextlib
import functools
import logging
from collections.abc import Callable, Generator, Iterable, Iterator
from typing import TYPE_CHECKING, Any, TypeVar

from jaxcrusher.basics.checks import require
from jaxcrusher.basics.setup import set_up
from jaxcrusher.files.provenance import environment

if TYPE_CHECKING:
    import distributed

Item = TypeVar("Item")
Found = TypeVar("Found")
_WITHOUT_DASK = "Argument `scheduler` needs Dask: pip install 'jaxcrusher[cluster]'."


@contextlib.contextmanager
def connected(
    scheduler: "str | distributed.Client | None",
) -> "Iterator[distributed.Client | None]":
    """Yield the client of a scheduler: a new one for an address, and None for this machine.

    Raises ValueError for anything else, and ImportError if Dask is not installed.
    """
    if scheduler is None:
        yield None
        return
    try:
        import distributed
    except ImportError:
        raise ImportError(_WITHOUT_DASK) from None
    own = not isinstance(scheduler, distributed.Client)
    if own:
        # Before a client tries it, which would hold the process for a minute at its end.
        must = 'be a client of Dask, or the address of a scheduler such as "tcp://host:8786"'
        require(_is_address(scheduler), "scheduler", must, repr(scheduler))
    client = distributed.Client(scheduler, set_as_default=False) if own else scheduler
    try:
        yield client
    finally:
        if own:
            client.close()


@contextlib.contextmanager
def local_workers(scheduler: str | None) -> "Iterator[str | distributed.Client | None]":
    """Yield a client of so many local processes for a number; an address, or None, as it is."""
    if scheduler is None or not scheduler.isdecimal():
        yield scheduler
        return
    require(int(scheduler) >= 1, "scheduler", "be an address or a number >= 1", scheduler)
    try:
        import distributed
    except ImportError:
        raise ValueError(_WITHOUT_DASK) from None
    cluster = distributed.LocalCluster(
        n_workers=int(scheduler),
        threads_per_worker=1,
        dashboard_address=None,  # pyright: ignore
        silence_logs=logging.ERROR,
    )
    with cluster, distributed.Client(cluster, set_as_default=False) as client:
        yield client


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
    compute: Callable[[Item], Found],
    name: Callable[[Item], str],
    program: dict[str, Any],
    items: Iterable[Item],
) -> Generator[Found, None, None]:
    """Yield what workers `compute` of items as they finish; RuntimeError names one that fails.

    `program` is the environment that each worker must have.
    """
    from distributed import as_completed
    from distributed.protocol.pickle import dumps

    todo, packed = iter(items), dumps(compute)
    pending = {}
    finished = as_completed(loop=client.loop)

    def submit() -> None:
        # Two chunks a thread keep every worker busy, and no results pile up unwritten.
        threads: dict[str, int] = client.nthreads()  # pyright: ignore
        wanted = max(1, 2 * sum(threads.values()))
        for item in todo:
            future = client.submit(_work, packed, dumps(item), program, pure=False)
            pending[future] = name(item)
            finished.add(future)
            if len(pending) >= wanted:
                break

    try:
        submit()
        for future in finished:
            called = pending.pop(future)
            try:
                result = future.result()
            except Exception as error:
                raise RuntimeError(f"Chunk {called} was not computed: {error}") from error
            submit()
            yield result
    finally:
        client.cancel(list(pending))


def _work(packed: bytes, item: bytes, program: dict[str, Any]) -> Any:
    here = worker_environment()
    if other := [name for name in here if here[name] != program[name]]:
        own, theirs = ({name: one[name] for name in other} for one in (here, program))
        raise RuntimeError(f"this worker has {own}, the other chunks are made with {theirs}")
    from distributed.protocol.pickle import loads

    return _opened(packed)(loads(item))


@functools.lru_cache(maxsize=8)
def _opened(packed: bytes) -> Callable[[Any], Any]:
    """Return the function of all its chunks: what compares its parts by identity compiles once."""
    from distributed.protocol.pickle import loads

    return loads(packed)

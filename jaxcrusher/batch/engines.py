"""Run a function over many scenes, on all cores, in chunks.

Integrations are compiled to loops over lanes of designs (see `lanes.program`), on a CPU or, of many
designs, on a GPU of NVIDIA's. What lanes cannot do, each core does for one design after the other:
a batch under `jax.vmap` costs its slowest lane, and XLA compiles a sequential loop to one kernel if
it is asked to (see `basics.loop_kernels`). Where the user lets JAX compute on a GPU or TPU, what
lanes cannot do runs side by side under `jax.vmap`.
"""

import contextlib
import functools
import warnings
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.sharding import Mesh, PartitionSpec
from jaxtyping import PyTree

from jaxcrusher.basics.checks import require, require_choice, require_own_process, require_whole
from jaxcrusher.basics.devices import computes_on, devices, finds_card
from jaxcrusher.basics.setup import remind_of_idle_cores
from jaxcrusher.basics.traced import traced
from jaxcrusher.batch.cluster import compute_on, connected
from jaxcrusher.files.journal import Journal, finished, text_of
from jaxcrusher.files.provenance import environment
from jaxcrusher.lanes.card import GPU
from jaxcrusher.lanes.machine import PROCESSOR, Target
from jaxcrusher.lanes.program import NoIntegration, program
from jaxcrusher.lanes.verify import Unsupported
from jaxcrusher.motion.recorded import recorded

if TYPE_CHECKING:
    import distributed

# Designs in a chunk: enough for all lanes of all cores to be busy nearly to its end.
CHUNK = 1024
# On a card. Two chunks at once took 29 us a design with so many, and 31 us with twice as many.
CARD_CHUNK = 65_536
# From so many designs in a chunk on a card is chosen without being asked for. An H100 takes 0.6 s
# for them, and 16 cores 3.7 s: as long as 100 cores. To begin, both take as long.
ENOUGH = 16_384
# Chunks at once on a card: while it computes one, the processor prepares another.
ON_CARD = 2
Item = TypeVar("Item")
Found = TypeVar("Found")
# Applies a function to stacked scenes: the scenes and the results have one more axis, the first.
Run = Callable[[Callable[[Any], PyTree], PyTree], PyTree]
# One of `ENGINES` by its name, or a function of the user's own.
Engine = Literal["lanes", "loop", "vmap", "gpu"] | Run


def map_chunks(
    function: Callable[[Any], PyTree],
    scenes: PyTree,
    chunk: int | None = None,
    engine: Engine | None = None,
) -> Iterator[tuple[slice, PyTree]]:
    """Apply `function` to `scenes`, stacked along the first axis of every leaf.

    Yields a slice of that axis and the results on it, as NumPy arrays, chunk by chunk: memory stays
    bounded, and what is finished is in the caller's hands. Chunks have about the same size: `chunk`
    scenes at most, or a few more, so that each device gets as many. None is 1024 scenes, or 65 536
    for lanes on a GPU. `function` is traced once a call, so that it may read globals that change.
    It is compiled again where its trace differs from earlier calls; arrays that shall change
    without this belong in an `equinox.Partial`.

    `engine` is one of these names, or a function of your own. "lanes" compiles integrations to
    loops over lanes of scenes; "loop" computes one scene after the other on each core; "vmap"
    computes all scenes at once by `jax.vmap`; "gpu" runs lanes on a GPU of NVIDIA's. None takes
    "gpu" where CuPy finds one and a chunk has 16 384 scenes or more, and "lanes" elsewhere.

    Raises ValueError for another name, a chunk below 1, and scenes that are not stacked.
    """
    yield from run_chunks(_traced(function, scenes), scenes, chunk, engine)


def map_all(
    function: Callable[[Any], PyTree],
    scenes: PyTree,
    chunk: int | None = None,
    engine: Engine | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> PyTree:
    """Return the results of `map_chunks`, joined: NumPy arrays, stacked like the scenes.

    `progress` is called after each chunk with the number of finished and of all scenes.
    """
    return run_all(_traced(function, scenes), scenes, chunk, engine, progress)


def _traced(function: Callable[[Any], PyTree], scenes: PyTree) -> Callable[[Any], PyTree]:
    """Return `function`, compared by what it now does with one of the scenes."""
    _require_stacked(function, scenes)

    def like(leaf: Any) -> jax.ShapeDtypeStruct:
        array = np.asarray(leaf)
        return jax.ShapeDtypeStruct(array.shape[1:], jax.dtypes.canonicalize_dtype(array.dtype))

    return traced(function, jax.tree.map(like, scenes))


def run_chunks(
    function: Callable[[Any], PyTree],
    scenes: PyTree,
    chunk: int | None = None,
    engine: Engine | None = None,
    *,
    whole: int = 1,
    skips: bool = False,
    journal: Journal | None = None,
    scheduler: "str | distributed.Client | None" = None,
) -> Generator[tuple[slice, PyTree], None, None]:
    """Do as `map_chunks` for a function that always does the same, which is not traced again.

    It is an `equinox.Partial` of a module-level function of this package. A chunk is filled up to
    a multiple of `whole` designs, so that few sizes are compiled: with designs of NaN if the
    function `skips` these, else with its last one. With a `journal` finished chunks, whose results
    are named arrays, are not computed again, and come first. Of several chunks each is
    computed by a worker of the `scheduler`, as in `jaxcrusher.sweep`, and comes as it finishes; the
    workers must have this process's environment.
    """
    _require_stacked(function, scenes)
    if chunk is not None:
        require_whole("chunk", chunk, 1)
    # Chunks are cut by NumPy: JAX would take a millisecond for each leaf.
    scenes = jax.tree.map(np.asarray, scenes)
    count = jax.tree.leaves(scenes)[0].shape[0]
    chunk = chunk or chunk_of(count, engine)
    if engine is None:  # The workers of a scheduler may have other devices.
        engine = default_engine(min(chunk, count)) if scheduler is None else "lanes"
    size = -(-count // -(-count // chunk))
    size = _shared(-(-size // whole) * whole)
    compute = functools.partial(_computed, function=function, size=size, engine=engine, skips=skips)
    chunks = [slice(first, min(first + size, count)) for first in range(0, count, size)]
    places: dict[int, Path] = {}
    if journal is not None:
        numbers, rest = eqx.partition(function, eqx.is_array)
        # Of the same engine: another one, as on another device, gives other bits.
        text = f"{name_of(engine)} {text_of(jax.tree.flatten(rest))}"
        for rows in chunks:
            inputs = jax.tree.leaves((numbers, _part(scenes, rows)))
            places[rows.start] = journal.place(text, inputs)
    todo = []
    for rows in chunks:
        known = None if journal is None else finished(places[rows.start])
        if known is None:
            todo.append(rows)
        else:
            yield rows, known
    parts = ((rows, _part(scenes, rows)) for rows in todo)
    # A worker takes a tenth of a second more for a chunk, and no less where it is the only one.
    where = scheduler if len(todo) > 1 else None
    with computing(compute, parts, engine, where, _name) as results:
        for rows, result in results:
            if journal is not None:
                journal.keep(places[rows.start], result)
            yield rows, result


def _part(scenes: PyTree, rows: slice) -> PyTree:
    return jax.tree.map(lambda leaf: leaf[rows], scenes)


def _name(part: tuple[slice, PyTree]) -> str:
    rows, _ = part
    return f"of rows {rows.start} to {rows.stop - 1}"


def _shared(size: int) -> int:
    """Return the least size of a chunk, from `size` on, that all devices share evenly."""
    shares = len(devices())
    # XLA opens a loop over one design, and then rounds differently: each device gets two.
    return -(-max(size, 2 * shares) // shares) * shares


def _computed(
    part: tuple[slice, PyTree],
    function: Callable[[Any], PyTree],
    size: int,
    engine: Engine,
    skips: bool,
) -> tuple[slice, PyTree]:
    """Compute a chunk, filled up to a size that the devices of this process share."""
    (rows, scenes), size = part, _shared(size)
    # Interleaved: neighbours in a grid cost about the same, and each device gets both.
    order = np.argsort(np.arange(size) % len(devices()), kind="stable")
    filled = jax.tree.map(lambda leaf: _filled(leaf, size, skips)[order], scenes)
    result = run_of(engine)(function, filled)
    back = np.argsort(order)[: rows.stop - rows.start]
    return rows, jax.tree.map(lambda leaf: np.asarray(leaf)[back], result)


def _filled(designs: np.ndarray, size: int, skips: bool) -> np.ndarray:
    """Fill a chunk up to its size with designs of NaN, or with its last one."""
    last = np.full(designs[-1:].shape, np.nan) if skips else designs[-1:]
    return np.concatenate([designs, np.repeat(last, size - len(designs), axis=0)])


@contextlib.contextmanager
def computing(
    function: Callable[[Item], Found],
    items: Iterable[Item],
    engine: Engine,
    scheduler: "str | distributed.Client | None",
    name: Callable[[Item], str],
    program: dict[str, Any] | None = None,
) -> Iterator[Iterator[Found]]:
    """Yield the results of a function of chunks: here in order, on workers as they finish.

    Workers must have the environment `program`, that of this process if None. An error says the
    `name` of its chunk.
    """
    with connected(scheduler) as client:
        if client is None:
            results = in_order(function, items, engine)
        else:
            results = compute_on(client, function, name, program or environment(), items)
        with contextlib.closing(results):
            yield results


def in_order(
    function: Callable[[Item], Found], items: Iterable[Item], engine: Engine
) -> Generator[Found, None, None]:
    """Yield the results of a function of chunks by an engine; on a GPU `ON_CARD` run at once.

    Where the caller stops early the chunks in progress are finished, and no other is begun.
    """
    if run_of(engine) is not on_gpu:
        yield from map(function, items)
        return
    items, begun = iter(items), deque[Future[Found]]()
    with ThreadPoolExecutor(ON_CARD) as pool:
        begun.extend(pool.submit(function, item) for item in islice(items, ON_CARD))
        try:
            while begun:
                found = begun.popleft().result()
                begun.extend(pool.submit(function, item) for item in islice(items, 1))
                yield found
        finally:
            for future in begun:
                future.cancel()


def run_all(
    function: Callable[[Any], PyTree],
    scenes: PyTree,
    chunk: int | None = None,
    engine: Engine | None = None,
    progress: Callable[[int, int], None] | None = None,
    **settings: Any,
) -> PyTree:
    """Return the results of `run_chunks`, with its further `settings`, joined as by `map_all`."""
    parts, done = dict[int, PyTree](), 0
    with contextlib.closing(run_chunks(function, scenes, chunk, engine, **settings)) as chunks:
        for rows, results in chunks:
            parts[rows.start] = results
            done += rows.stop - rows.start
            if progress is not None:
                progress(done, len(jax.tree.leaves(scenes)[0]))
    ordered = [parts[first] for first in sorted(parts)]
    return jax.tree.map(lambda *leaves: np.concatenate(leaves), *ordered)


def _require_stacked(function: Callable[[Any], PyTree], scenes: PyTree) -> None:
    """Check that all leaves have a first axis, and that it is of the same length."""
    require_own_process()
    require(callable(function), "function", "be one", f"a {type(function).__name__}")
    lengths = {np.shape(leaf)[:1] for leaf in jax.tree.leaves(scenes)}
    good = len(lengths) == 1 and () not in lengths and (0,) not in lengths
    first = ", ".join(str(*length) or "none" for length in sorted(lengths)) or "no arrays"
    require(good, "scenes", "hold arrays with a first axis of one length", f"with {first}")


def name_of(engine: Engine) -> str:
    """Return an engine's name; of a function its own name, of another object that of its class."""
    known = {run: name for name, run in ENGINES.items()}
    if isinstance(engine, str):
        return engine
    return known.get(engine) or getattr(engine, "__qualname__", type(engine).__qualname__)


def run_of(engine: Engine) -> Run:
    """Return the function of an engine; ValueError for a name that is none of `ENGINES`."""
    if callable(engine):
        return engine
    require_choice("engine", engine, tuple(ENGINES))
    return ENGINES[engine]


def default_engine(designs: int) -> Engine:
    """Return the engine that integrates so many designs at once if none is asked for."""
    return "gpu" if designs >= ENOUGH and finds_card() else "lanes"


def chunk_of(count: int, engine: Engine | None = None, usual: int = CHUNK) -> int:
    """Return how many of `count` designs make a chunk: `usual` many, and more on a GPU."""
    engine = engine or default_engine(min(count, CARD_CHUNK))
    return CARD_CHUNK if run_of(engine) is on_gpu else usual


def without_lanes() -> Engine:
    """Return the engine of functions that integrate nothing, which lanes would trace in vain."""
    return "loop" if computes_on() == "cpu" else "vmap"


def in_lanes(function: Callable[[Any], PyTree], scenes: PyTree) -> PyTree:
    """Compile integrations to loops over lanes of scenes, on all cores (see `lanes.program`).

    What lanes cannot do, such as derivatives, `without_lanes` does; a UserWarning says why.
    """
    return _by_lanes(function, scenes, PROCESSOR)


def on_gpu(function: Callable[[Any], PyTree], scenes: PyTree) -> PyTree:
    """Integrate by the same lanes on a GPU of NVIDIA's, a thread each (see `lanes.card`).

    It needs CuPy, and raises ImportError without. What lanes cannot do, `without_lanes` does.
    """
    return _by_lanes(function, scenes, GPU)


def _by_lanes(function: Callable[[Any], PyTree], scenes: PyTree, target: Target) -> PyTree:
    recording = eqx.Partial(recorded, function=function)
    try:
        run = program(recording, scenes, target)
    except NoIntegration:
        return run_of(without_lanes())(function, scenes)
    except Unsupported as why:
        name = without_lanes()
        warnings.warn(
            f"Lanes do not know {why}: the engine {name!r} computes these scenes.", stacklevel=3
        )
        return run_of(name)(function, scenes)
    return run(recording, scenes)


@eqx.filter_jit
def side_by_side(function: Callable[[Any], PyTree], scenes: PyTree) -> PyTree:
    """Compute all scenes at once by `jax.vmap`; each step is as slow as the slowest."""
    return jax.vmap(function)(scenes)


def in_turn(function: Callable[[Any], PyTree], scenes: PyTree) -> PyTree:
    """Compute one scene after the other on every device; each device gets as many scenes."""
    remind_of_idle_cores()
    return _in_turn(function, scenes)


@eqx.filter_jit
def _in_turn(function: Callable[[Any], PyTree], scenes: PyTree) -> PyTree:
    if len(devices()) == 1:
        return jax.lax.map(function, scenes)
    mesh, split = Mesh(np.array(devices()), ("designs",)), PartitionSpec("designs")
    sharded = jax.shard_map(
        lambda part: jax.lax.map(function, part),
        mesh=mesh,
        in_specs=split,
        out_specs=split,
        check_vma=False,  # Equinox's and our own loops begin with numbers that are alike everywhere
    )
    return sharded(scenes)


ENGINES: dict[str, Run] = {
    "lanes": in_lanes,
    "loop": in_turn,
    "vmap": side_by_side,
    "gpu": on_gpu,
}


def stack(scenes: list[PyTree]) -> PyTree:
    """Stack scenes of one structure along a new first axis."""
    return jax.tree.map(lambda *leaves: jnp.stack(leaves), *scenes)

"""Run a function over many scenes, on all cores, in chunks.

On a CPU integrations are compiled to loops over lanes of designs (see `lanes.program`). What lanes
cannot do, each core does for one design after the other: a batch under `jax.vmap` costs its slowest
lane, and XLA compiles a sequential loop to one kernel if it is asked to (see `jaxcrusher.set_up`).
Where the user lets JAX compute on a GPU or TPU the designs run side by side under `jax.vmap`; on
one of NVIDIA's lanes may be asked for.
"""

import math
import warnings
from collections.abc import Callable, Iterator
from typing import Any, Literal

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.sharding import Mesh, PartitionSpec
from jaxtyping import PyTree

from jaxcrusher.basics.checks import require, require_choice
from jaxcrusher.basics.devices import computes_on, devices, on_a_gpu
from jaxcrusher.basics.setup import remind_of_set_up
from jaxcrusher.basics.traced import traced
from jaxcrusher.files.journal import Journal, text_of
from jaxcrusher.lanes.machine import GPU, PROCESSOR, Target
from jaxcrusher.lanes.program import NoIntegration, program
from jaxcrusher.lanes.verify import Unsupported
from jaxcrusher.motion.recorded import recorded
from jaxcrusher.motion.statistic import STATISTIC, Chosen, chosen

# Designs in a chunk: enough for all lanes of all cores to be busy nearly to its end.
CHUNK = 1024
# Applies a function to stacked scenes: the scenes and the results have one more axis, the first.
Run = Callable[[Callable[[Any], PyTree], PyTree], PyTree]
# One of `ENGINES` by its name, or a function of the user's own.
Engine = Literal["lanes", "loop", "vmap", "gpu"] | Run


def map_chunks(
    function: Callable[[Any], PyTree],
    scenes: PyTree,
    chunk: int = CHUNK,
    engine: Engine | None = None,
) -> Iterator[tuple[slice, PyTree]]:
    """Apply `function` to `scenes`, stacked along the first axis of every leaf.

    Yields a slice of that axis and the results on it, as NumPy arrays, chunk by chunk:
    memory stays bounded, and what is finished is in the caller's hands. Chunks are of the same
    size, about, and of `chunk` scenes at most, or a few more, as many on each device. `function` is
    traced once a call, so that it may read globals that change, and compiled where that differs
    from earlier calls; arrays that it is to take without being compiled anew belong into an
    `equinox.Partial`.

    `engine` is one of these names, or a function of your own. "lanes" compiles integrations to
    loops over lanes of scenes; "loop" computes one scene after the other on each core; "vmap"
    computes all scenes at once by `jax.vmap`; "gpu" runs lanes on a GPU of NVIDIA's. None takes
    "lanes" where JAX computes on a CPU (see `jaxcrusher.set_up`), and "vmap" elsewhere.

    Raises ValueError for another name, and for scenes that are not stacked.
    """
    yield from run_chunks(_traced(function, scenes), scenes, chunk, engine)


def map_all(
    function: Callable[[Any], PyTree],
    scenes: PyTree,
    chunk: int = CHUNK,
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
    chunk: int = CHUNK,
    engine: Engine | None = None,
    *,
    whole: int = 1,
    journal: Journal | None = None,
) -> Iterator[tuple[slice, PyTree]]:
    """Do as `map_chunks` for a function that always does the same, which is not traced again.

    It is an `equinox.Partial` of a module-level function of this package. Only the table of
    statistics may change. A chunk is filled up to a multiple of `whole` designs, so that few sizes
    are compiled. With a `journal` finished chunks, whose results are named arrays, are not
    computed again.
    """
    _require_stacked(function, scenes)
    function = eqx.Partial(_with_statistics, function=function, statistics=chosen(STATISTIC))
    # Chunks are cut by NumPy: JAX would take a millisecond for each leaf.
    scenes = jax.tree.map(np.asarray, scenes)
    count = jax.tree.leaves(scenes)[0].shape[0]
    shares = len(devices())
    run = run_of(engine or ("lanes" if computes_on() == "cpu" else "vmap"))
    size = -(-count // -(-count // chunk))
    # XLA opens a loop over one design, and then rounds differently: each device gets two.
    size = max(size, 2 * shares)
    even = math.lcm(shares, whole)
    size = -(-size // even) * even
    for first in range(0, count, size):
        rows = slice(first, min(first + size, count))
        # The last chunk repeats its last design, so that every chunk has the same shape.
        index = np.minimum(np.arange(first, first + size), count - 1)
        # Interleaved: neighbours in a grid cost about the same, and each device gets both.
        order = np.argsort(np.arange(size) % shares, kind="stable")
        part = jax.tree.map(lambda leaf, i=index[order]: leaf[i], scenes)
        back = np.argsort(order)[: rows.stop - rows.start]

        def compute(part: PyTree = part, back: np.ndarray = back) -> PyTree:
            result = run(function, part)
            return jax.tree.map(lambda leaf: np.asarray(leaf)[back], result)

        if journal is None:
            yield rows, compute()
        else:
            numbers, rest = eqx.partition(function, eqx.is_array)
            inputs = jax.tree.leaves((numbers, part))
            yield rows, journal.kept(text_of(jax.tree.flatten(rest)), inputs, compute)


def _with_statistics(scene: Any, function: Callable[[Any], PyTree], statistics: Chosen) -> PyTree:
    """The result of `function`, which may look at the table that holds these `statistics`."""
    return function(scene)


def run_all(
    function: Callable[[Any], PyTree],
    scenes: PyTree,
    chunk: int = CHUNK,
    engine: Engine | None = None,
    progress: Callable[[int, int], None] | None = None,
    **settings: Any,
) -> PyTree:
    """Return the results of `run_chunks`, with its further `settings`, joined as by `map_all`."""
    parts = []
    for rows, results in run_chunks(function, scenes, chunk, engine, **settings):
        parts.append(results)
        if progress is not None:
            progress(rows.stop, len(jax.tree.leaves(scenes)[0]))
    return jax.tree.map(lambda *leaves: np.concatenate(leaves), *parts)


def _require_stacked(function: Callable[[Any], PyTree], scenes: PyTree) -> None:
    """Check that all leaves have a first axis, and that it is of the same length."""
    require(callable(function), "function", "be one", f"a {type(function).__name__}")
    lengths = {np.shape(leaf)[:1] for leaf in jax.tree.leaves(scenes)}
    good = len(lengths) == 1 and () not in lengths and (0,) not in lengths
    first = ", ".join(str(*length) or "none" for length in sorted(lengths)) or "no arrays"
    require(good, "scenes", "hold arrays with a first axis of one length", f"with {first}")


def name_of(engine: Engine) -> str:
    """Return an engine's name; that of a function or, where it is an object, of its class."""
    known = {run: name for name, run in ENGINES.items()}
    if isinstance(engine, str):
        return engine
    return known.get(engine) or getattr(engine, "__qualname__", type(engine).__qualname__)


def run_of(engine: Engine) -> Run:
    """Return the function of an engine; ValueError for a name that is none of `ENGINES`."""
    if isinstance(engine, str):
        require_choice("engine", engine, tuple(ENGINES))
        return ENGINES[engine]
    return engine


def without_lanes() -> Engine:
    """Return the engine of functions that integrate nothing, which lanes would trace in vain."""
    return "loop" if computes_on() == "cpu" else "vmap"


def in_lanes(function: Callable[[Any], PyTree], scenes: PyTree) -> PyTree:
    """Compile integrations to loops over lanes of scenes, on all cores (see `lanes.program`).

    What lanes cannot do, such as derivatives, `in_turn` does; a UserWarning says why.
    """
    return _by_lanes(function, scenes, PROCESSOR, in_turn)


def on_gpu(function: Callable[[Any], PyTree], scenes: PyTree) -> PyTree:
    """Integrate by the same lanes on a GPU of NVIDIA's, a thread each (see `lanes.machine`).

    Never run on one so far: it is tested thread by thread on a processor. It needs CuPy, and
    raises ImportError without. What lanes cannot do, `side_by_side` does, on the GPU where JAX
    sees it too.
    """
    with on_a_gpu():
        return _by_lanes(function, scenes, GPU, side_by_side)


def _by_lanes(
    function: Callable[[Any], PyTree], scenes: PyTree, target: Target, otherwise: Run
) -> PyTree:
    recording = recorded(function)
    try:
        run = program(recording, scenes, target)
    except NoIntegration:
        return otherwise(function, scenes)
    except Unsupported as why:
        name = name_of(otherwise)
        warnings.warn(
            f"Lanes do not know {why}: the engine {name!r} computes these scenes.", stacklevel=3
        )
        return otherwise(function, scenes)
    return run(recording, scenes)


@eqx.filter_jit
def side_by_side(function: Callable[[Any], PyTree], scenes: PyTree) -> PyTree:
    """Compute all scenes at once by `jax.vmap`; each step is as slow as the slowest."""
    return jax.vmap(function)(scenes)


def in_turn(function: Callable[[Any], PyTree], scenes: PyTree) -> PyTree:
    """Compute one scene after the other on every device; their number divides the scenes'."""
    remind_of_set_up()
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
        check_vma=False,
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

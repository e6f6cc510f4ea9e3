"""Integration of designs from both starts, for their statistics and objectives."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float, PyTree

import jaxcrusher as jc
from jaxcrusher.basics.plane import Vector
from jaxcrusher.batch.engines import chunk_of, run_all
from jaxcrusher.batch.sweep import row_of
from jaxcrusher.files.journal import Journal
from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.mechanism.starts import shifted_start
from optimize.ask import constraints
from optimize.ask.design import Design
from optimize.ask.limits import Found
from optimize.ask.problem import DesignProblem

if TYPE_CHECKING:
    import distributed

# A machine may start with its pin in the middle of the bore (hard impacts), or at rest in contact
# (quiet).
STARTS = ("centred", "contact")

Progress = Callable[[int, int], None]
Rows = dict[str, np.ndarray]


@dataclass(frozen=True)
class Tracking:
    """The place where a computation reports its progress, saves its chunks, and runs.

    Workers of a scheduler, or this process, compute the chunks, and a journal stores them.
    """

    progress: Progress = lambda done, of: None  # no report
    journal: Journal | None = None
    scheduler: "distributed.Client | None" = None

    def run(self, function: Callable[[Any], PyTree], batch: PyTree, chunk: int) -> PyTree:
        """Compute a function of each element of a batch by `jaxcrusher.batch.engines.run_all`."""
        return run_all(function, batch, chunk, **vars(self))


NOWHERE = Tracking()


@dataclass(frozen=True)
class Window:
    """Turns before statistics start, turns that they cover, and the tolerance of a step."""

    settle: int
    turns: int
    rtol: float


def evaluate(
    problem: DesignProblem,
    places: Float[np.ndarray, "points n"],
    window: Window,
    tracking: Tracking = NOWHERE,
    *,
    shifts: Float[np.ndarray, "points 2"] | None = None,
    chunk: int = 128,
) -> Rows:
    """Return the statistics of places of the unit box from both starts.

    `shifts` move the starts, in clearances. `chunk` is the number of motions between two reports of
    progress; a GPU takes more. Rows have the shape (starts, points): the columns of
    `jaxcrusher.sweep`, `objective` in its unit, the number of `steps`, `counts` (whether the design
    may be chosen, see `constraints.of_runs`), and the final `state`, (starts, points, dims).
    """
    moves = np.zeros((len(places), 2)) if shifts is None else shifts
    scenes = stacked_scenes(problem, jnp.asarray(places), jnp.asarray(moves))
    batch = scenes, np.tile(places, (len(STARTS), 1))
    function = eqx.Partial(_row, problem=problem, window=window)
    at_once = chunk_of(len(STARTS) * len(places), usual=chunk)
    found = tracking.run(function, batch, at_once)
    rows = {
        name: column.reshape(len(STARTS), len(places), *column.shape[1:])
        for name, column in found.items()
    }
    return rows | {"counts": constraints.of_runs(problem, rows, problem.capacity(places))}


def judged(rows: Found) -> np.ndarray:
    """Return the objective of the worse start, (points,); NaN unless both starts count."""
    worse = np.max(np.asarray(rows["objective"]), axis=0)
    return np.where(np.all(np.asarray(rows["counts"]), axis=0), worse, np.nan)


def started(
    design: Design,
    values: Mapping[str, Any],
    start: str,
    shift: Iterable[ArrayLike] = (0.0, 0.0),
) -> Scene:
    """Return the scene of the free parameters' values, `shift` clearances off one of the `STARTS`.

    The start is stored as numbers, so the scenes of all starts share one program. A rough feed is
    replaced by its mean load.
    """
    scene = design.build({**design.completed(values), "start": start}).steady()
    return _shifted(scene, Vector(*shift))


_shifted = eqx.filter_jit(shifted_start)  # one program replaces a hundred


@eqx.filter_jit
def stacked_scenes(
    problem: DesignProblem, places: Float[Array, "points n"], shifts: Float[Array, "points 2"]
) -> Scene:
    """Return the stacked scenes of all points from the first start, then from the second."""

    def one(unit: Array, shift: Array, start: str) -> Scene:
        return started(problem.design, problem.design.values(unit), start, shift)

    parts = [jax.vmap(eqx.Partial(one, start=start))(places, shifts) for start in STARTS]
    return jax.tree.map(lambda *leaves: jnp.concatenate(leaves), *parts)


def _row(batch: tuple[Scene, Array], problem: DesignProblem, window: Window) -> dict[str, Array]:
    """Return the row of a scene at a point of the unit box."""
    scene, unit = batch
    outputs = tuple(dict.fromkeys((*problem.statistics, *problem.objective.outputs)))
    result = jc.statistics(scene, window.settle, window.turns, outputs=outputs, rtol=window.rtol)
    objective = problem.objective.formula(result, scene, problem.chamber_at(unit))
    further = {"objective": objective, "steps": result.outcome.steps, "state": result.state}
    return row_of(result, problem.statistics, scene.watched) | further

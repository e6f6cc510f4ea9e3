"""Integrate designs from both starts, for their statistics and the objective."""

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

# A machine may start either way: with its pin centred in the bore (hard impacts), and resting in
# contact (quiet).
STARTS = ("centred", "contact")

Progress = Callable[[int, int], None]
Rows = dict[str, np.ndarray]


@dataclass(frozen=True)
class Tracking:
    """Where a computation tells how much is done of how much, and where it computes and keeps it.

    Chunks are computed by the workers of a scheduler, or here, and kept in a journal.
    """

    progress: Progress = lambda done, of: None  # told to nobody
    journal: Journal | None = None
    scheduler: "distributed.Client | None" = None

    def run(self, function: Callable[[Any], PyTree], batch: PyTree, chunk: int) -> PyTree:
        """Compute a function of each of a batch, as `jaxcrusher.batch.engines.run_all` does."""
        return run_all(function, batch, chunk, **vars(self))


NOWHERE = Tracking()


@dataclass(frozen=True)
class Window:
    """Turns before statistics start, turns they cover, and the tolerance of a step."""

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

    `shifts` moves the starts by so many clearances, and `chunk` is how many motions are integrated
    between two reports of progress, on a GPU more. Rows have the shape (starts, points): the
    columns of `jaxcrusher.sweep`, `objective` in its unit, the number of `steps`, `counts`, whether
    the design may be chosen (see `constraints.of_runs`), and the `state` at the end,
    (starts, points, dims), to go on from.
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
    """The objective of the worse start, shape (points,); NaN where either does not count."""
    worse = np.max(np.asarray(rows["objective"]), axis=0)
    return np.where(np.all(np.asarray(rows["counts"]), axis=0), worse, np.nan)


def started(
    design: Design,
    values: Mapping[str, Any],
    start: str,
    shift: Iterable[ArrayLike] = (0.0, 0.0),
) -> Scene:
    """The scene of the free parameters' values from one of the `STARTS`, `shift` clearances off.

    With the start as numbers, the scenes of all starts run as one program. A rough feed's motions
    are those under its mean load.
    """
    scene = design.build({**design.completed(values), "start": start}).steady()
    return _shifted(scene, Vector(*shift))


_shifted = eqx.filter_jit(shifted_start)  # one program in place of a hundred


@eqx.filter_jit
def stacked_scenes(
    problem: DesignProblem, places: Float[Array, "points n"], shifts: Float[Array, "points 2"]
) -> Scene:
    """The scenes of all points from one start, then from the other, stacked."""

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

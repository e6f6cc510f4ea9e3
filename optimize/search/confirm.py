"""Confirmation of the candidates by long independent runs, with confidence intervals."""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, Scalar
from scipy.special import stdtrit

import jaxcrusher as jc
from jaxcrusher.crusher.capacity import stroke, stroke_ratio
from jaxcrusher.mechanism.linkage import Linkage
from jaxcrusher.mechanism.reductions import ALL_THE_TIME
from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.motion.statistics import limits_of
from optimize.answer import Confirmed, Crushing, Orbit, Runs
from optimize.ask.constraints import end_well, keeps
from optimize.ask.limits import OF_ORBIT
from optimize.ask.options import Effort
from optimize.ask.problem import DesignProblem
from optimize.search import orbits
from optimize.search.evaluate import NOWHERE, STARTS, Rows, Tracking, Window, evaluate

CONFIDENCE = 0.95
# Factor of the turns of long runs over those of the landscape, and the tolerance of long runs, in
# clearances.
LONGER, CONFIRM_RTOL = 3, 1e-8
# Starts of independent runs are shifted at random by up to this many clearances. A decaying or
# chaotic motion forgets the shift.
SHIFT = 0.05


def interval(values: Float[np.ndarray, " runs"]) -> tuple[float, float]:
    """Return the mean of independent runs, and half the width of its 95 % confidence interval."""
    quantile = float(stdtrit(len(values) - 1, (1 + CONFIDENCE) / 2))
    return float(values.mean()), quantile * float(values.std(ddof=1)) / len(values) ** 0.5


def long_window(effort: Effort) -> Window:
    """Return the turns and the tolerance of the long runs."""
    return Window(LONGER * effort.settle, LONGER * effort.turns, CONFIRM_RTOL)


@dataclass(frozen=True)
class Repeats:
    """Independent runs from each start: their number, their turns, and the seed of their shifts."""

    runs: int
    window: Window
    seed: int


def long_runs(
    problem: DesignProblem, places: np.ndarray, repeats: Repeats, tracking: Tracking = NOWHERE
) -> list[Rows]:
    """Make several long runs of points (m, n) of the unit box from each start.

    The first run has the exact start; the starts of the others are shifted at random. Returns rows
    of shape (starts, runs, ...) for each point.
    """
    rng, runs = np.random.default_rng(repeats.seed), repeats.runs
    shifts = rng.uniform(-SHIFT, SHIFT, (len(places), runs, 2))
    shifts[:, 0] = 0
    points = np.repeat(places, runs, axis=0)
    moves = shifts.reshape(-1, 2)
    whole = evaluate(problem, points, repeats.window, tracking, shifts=moves, chunk=64)
    grouped = {
        name: values.reshape(len(STARTS), len(places), runs, *values.shape[2:])
        for name, values in whole.items()
    }
    return [{name: values[:, i] for name, values in grouped.items()} for i in range(len(places))]


def confirmed(
    problem: DesignProblem, unit: Float[np.ndarray, " n"], rows: Rows, orbit: Orbit | None
) -> Confirmed:
    """Return the design at a point of the unit box, judged by its long runs and its orbit."""
    values = problem.design.numbers(unit)
    given = problem.design.completed(values)
    described = problem.design.whole(given)
    scene = problem.design.build(given)
    intervals = [interval(numbers) for numbers in rows["objective"]]
    runs, judged = {}, []
    for i, (start, numbers) in enumerate(zip(STARTS, intervals, strict=True)):
        by_run = {name: column[i] for name, column in rows.items()}
        state = by_run.pop("state")[0]
        first = {name: jnp.asarray(column[0]) for name, column in by_run.items()}
        validity = limits_of(scene, first)
        settles = orbit is not None and orbit.stable and _in_contact(by_run)
        runs[start] = Runs(*numbers, validity, state, by_run, settles)
        if orbit is not None and settles:
            error = orbits.error(problem, orbit.solution, orbit.objective)
            judged.append((orbit.objective, error))
        else:
            judged.append(numbers)
    worse = int(np.argmax([mean for mean, _ in judged]))
    objective, half_width = judged[worse]
    worst = runs[STARTS[worse]]
    forces = {name: float(worst.by_run[name].mean()) for name in problem.forces}
    # A run may break the constraints before it settles on an orbit that keeps them.
    kept = orbit is not None and bool(keeps(problem, orbit.solution, OF_ORBIT))
    counts = bool(problem.reaches(problem.capacity(unit)))
    for start, of_start, well in zip(STARTS, rows["counts"], end_well(rows), strict=True):
        counts &= bool((well & kept if runs[start].settles else of_start).all())
    if orbit is not None and worst.settles:
        forces = {name: float(orbit.solution[name]) for name in problem.forces}
    return Confirmed(
        values,
        objective if counts else float("nan"),
        half_width,
        STARTS[worse],
        float(described["speed"]),
        forces,
        float(jc.periodic_orbit(scene.ideal())[scene.headline]),
        _crushing(problem, scene, unit),
        orbit,
        runs,
        follows={name: float(described[name]) for name in problem.design.following},
    )


def _crushing(problem: DesignProblem, scene: Scene, unit: np.ndarray) -> Crushing | None:
    if problem.chamber is None:
        return None
    sizes = scene.joints.values[0].clearance, problem.capacity(unit)
    return Crushing(*(float(one) for one in (*sizes, *_strokes(scene.linkage))))


@jax.jit  # one program replaces a hundred
def _strokes(linkage: Linkage) -> tuple[Scalar, Scalar]:
    return stroke(linkage), stroke_ratio(linkage)


def _in_contact(by_run: Rows) -> bool:
    """Tell whether no run lost contact or failed, so that all runs converge to the orbit."""
    return bool(least_contact(by_run) >= ALL_THE_TIME and by_run["success"].all())


def least_contact(by_run: Rows) -> float:
    """Return the least share of time in contact, over all runs and all pins."""
    shares = [column for name, column in by_run.items() if name.endswith("contact_fraction")]
    return float(np.min(shares))

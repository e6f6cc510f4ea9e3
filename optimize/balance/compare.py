"""Two gradient searches and two rivals without gradients, at equal work.

Work is counted in values of the objective; a gradient counts as many as it costs. L-BFGS-B is
SciPy's, Adam that of `optax`, projected on the box, CMA-ES that of `cma` (Hansen), the model-based
search that of `Py-BOBYQA` (Cartis, Fiala, Marteau, Roberts 2019). All work on the unit box, from
the same starts.
"""

import functools
import importlib.util
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

import jax
import numpy as np
import scipy.optimize

# The objective is about 1; noise of the solution is 1e-10 of it, and no search may hunt it.
RELATIVE_CHANGE = 1e-8
# First and last radius of the model-based search, first spread of the evolution, in boxes.
FIRST_RADIUS, LAST_RADIUS, SPREAD = 0.2, 1e-4, 0.3
# Adam's first step in each coordinate, in boxes; a cosine takes it to zero as the budget ends.
ADAM_RATE = 0.05
# What a search is told where there is no number: worse than any number, by far.
NO_NUMBER = 100.0


class Answer(NamedTuple):
    """An evaluation: value (NaN: none), steps of its solver, gradient (n,) if asked."""

    value: float
    steps: int
    slope: np.ndarray | None = None


@dataclass(frozen=True)
class Smooth:
    """A function of a point of the unit box, about 1, and the CPU seconds of a call."""

    value: Callable[[np.ndarray], Answer]
    gradient: Callable[[np.ndarray], Answer]
    value_seconds: float
    gradient_seconds: float

    @property
    def gradient_work(self) -> float:
        """A gradient's cost in values."""
        return self.gradient_seconds / self.value_seconds


@dataclass
class Search:
    """Result and cost of a search; the lists grow by one at every improvement.

    Seconds are those of the processor, the method's own included: others may use the machine.
    """

    method: str
    start: int
    work: list[float] = field(default_factory=list)
    seconds: list[float] = field(default_factory=list)
    best: list[float] = field(default_factory=list)
    point: list[float] = field(default_factory=list)  # of the best, in the unit box
    evaluations: int = 0
    steps: int = 0  # of the solver
    failures: int = 0  # evaluations without a number
    total_work: float = 0.0
    total_seconds: float = 0.0


class _Spent(Exception):
    """The budget is used up."""


class _Meter:
    """Counts, clocks and remembers the best; ends a search whose budget is spent."""

    def __init__(self, objective: Smooth, found: Search, budget: float):
        self.objective, self.found, self.budget = objective, found, budget
        self.began = time.process_time()

    def value(self, point) -> float:
        """The objective, without NaN."""
        return self._count(self.objective.value, 1.0, point)[0]

    def gradient(self, point) -> tuple[float, np.ndarray]:
        """The objective and its gradient, without NaN."""
        return self._count(self.objective.gradient, self.objective.gradient_work, point)

    def _count(self, function, work: float, point) -> tuple[float, np.ndarray]:
        found = self.found
        if found.total_work + work > self.budget:
            raise _Spent
        point = np.clip(point, 0.0, 1.0)
        answer = function(point)
        slope = np.zeros(len(point)) if answer.slope is None else answer.slope
        found.evaluations += 1
        found.steps += answer.steps
        found.total_work += work
        found.total_seconds = time.process_time() - self.began
        if not (np.isfinite(answer.value) and np.isfinite(slope).all()):
            found.failures += 1
            return NO_NUMBER, np.zeros(len(point))
        if not found.best or answer.value < found.best[-1]:
            found.best.append(answer.value)
            found.work.append(found.total_work)
            found.seconds.append(found.total_seconds)
            found.point = [float(entry) for entry in point]
        return answer.value, slope


def _gradient(meter: _Meter, start: np.ndarray, seed: int) -> None:
    scipy.optimize.minimize(
        meter.gradient,
        start,
        jac=True,
        method="L-BFGS-B",
        bounds=[(0.0, 1.0)] * len(start),
        options={"ftol": RELATIVE_CHANGE, "gtol": 1e-6, "maxiter": 100_000},
    )


def _adam(meter: _Meter, start: np.ndarray, seed: int) -> None:
    import optax

    steps = max(1, int(meter.budget / meter.objective.gradient_work))
    init, update = _adam_of(steps)
    point, state = start, init(start)
    for _ in range(steps):
        _, slope = meter.gradient(point)
        change, state = update(slope, state)
        point = np.clip(np.asarray(optax.apply_updates(point, change)), 0.0, 1.0)


@functools.cache
def _adam_of(steps: int) -> tuple[Callable, Callable]:
    """Return how Adam begins and how it goes on, compiled once for all starts."""
    import optax

    method = optax.adam(optax.cosine_decay_schedule(ADAM_RATE, steps))
    return method.init, jax.jit(method.update)


def _cma(meter: _Meter, start: np.ndarray, seed: int) -> None:
    import cma

    # A seed of 0 would mean the clock.
    options = {"bounds": [0.0, 1.0], "seed": seed + 1, "verbose": -9, "tolfun": RELATIVE_CHANGE}
    cma.fmin2(meter.value, start, SPREAD, options)


def _bobyqa(meter: _Meter, start: np.ndarray, seed: int) -> None:
    import pybobyqa

    # Py-BOBYQA draws its first directions from NumPy's global generator.
    np.random.seed(seed)
    pybobyqa.solve(
        meter.value,
        start,
        bounds=(np.zeros(len(start)), np.ones(len(start))),
        rhobeg=FIRST_RADIUS,
        rhoend=LAST_RADIUS,
        maxfun=10**6,
        do_logging=False,
    )


METHODS = {"L-BFGS-B": _gradient, "Adam": _adam, "CMA-ES": _cma, "Py-BOBYQA": _bobyqa}
_PACKAGES = {"cma": "cma", "pybobyqa": "Py-BOBYQA"}


def require_rivals() -> None:
    """ValueError, in one line, if a package of the comparison is not installed."""
    missing = [name for module, name in _PACKAGES.items() if not importlib.util.find_spec(module)]
    if missing:
        raise ValueError(
            f"The comparison needs {' and '.join(missing)}: pip install 'jaxcrusher[bench]'."
        )


def search(
    method: str, objective: Smooth, start: np.ndarray, budget: float, number: int = 0
) -> Search:
    """Search from `start` (n,) until the method ends or `budget` (values) is spent.

    `number` names the start and seeds the method.
    """
    found = Search(method, number)
    try:
        METHODS[method](_Meter(objective, found, budget), start, number)
    except _Spent:
        pass
    return found


def best_so_far(found: Search, axis: list[float], at: np.ndarray) -> np.ndarray:
    """The best value at amounts `at` of work or seconds (`axis`); NaN before the first."""
    index = np.searchsorted(axis, at, side="right") - 1
    return np.where(index >= 0, np.asarray(found.best)[np.maximum(index, 0)], np.nan)


def spent_until(found: Search, axis: list[float], value: float) -> float:
    """Work or seconds (`axis`) until the best was `value` or less; infinite if never."""
    reached = [spent for spent, best in zip(axis, found.best, strict=True) if best <= value]
    return reached[0] if reached else float("inf")

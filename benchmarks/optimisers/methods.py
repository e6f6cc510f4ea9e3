"""Searches of the unit box that count their work in values of the objective.

All work on the same box, from the same starts. A gradient counts as many values as it costs.
"""

import functools
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

import cma
import jax
import numpy as np
import optax
import pybobyqa
import scipy.optimize

# The objective is about 1; noise of the solution is 1e-10 of it, and no search may hunt it.
RELATIVE_CHANGE = 1e-8
# First and last radius of the model-based search, first spread of the evolution, in boxes.
FIRST_RADIUS, LAST_RADIUS, SPREAD = 0.2, 1e-4, 0.3
# Adam's first step in each coordinate, in boxes; a cosine takes it to zero as the budget ends.
ADAM_RATE = 0.05
# What a search is told where there is no number: worse than any number, by far.
NO_NUMBER = 100.0


@dataclass(frozen=True)
class Objective:
    """A function of a point of the unit box, about 1 (NaN: none), and the CPU seconds of a call."""

    value: Callable[[np.ndarray], float]
    gradient: Callable[[np.ndarray], tuple[float, np.ndarray]]  # beside the value
    value_seconds: float
    gradient_seconds: float

    @property
    def gradient_work(self) -> float:
        """A gradient's cost in values."""
        return self.gradient_seconds / self.value_seconds


class Improvement(NamedTuple):
    """A new best value, and what was spent until then."""

    work: float  # in values of the objective
    seconds: float  # of the processor, the method's own included: others may use the machine
    best: float


@dataclass
class Searched:
    """Result and cost of a search from a start."""

    method: str
    start: int
    improvements: list[Improvement] = field(default_factory=list)
    point: list[float] = field(default_factory=list)  # of the best, in the unit box
    evaluations: int = 0
    work: float = 0.0
    seconds: float = 0.0

    @property
    def best(self) -> float:
        """The best value, NaN where no number was found."""
        return self.improvements[-1].best if self.improvements else float("nan")

    def until(self, value: float) -> Improvement | None:
        """Return when the best was `value` or less, None if never."""
        return next((one for one in self.improvements if one.best <= value), None)


class _Spent(Exception):
    """The budget is used up."""


class _Meter:
    """Counts, clocks and remembers the best; ends a search whose budget is spent."""

    def __init__(self, objective: Objective, found: Searched, budget: float):
        self.objective, self.found, self.budget = objective, found, budget
        self.began = time.process_time()

    def value(self, point: np.ndarray) -> float:
        """The objective, without NaN."""
        self._spend(1.0)
        return self._told(point, self.objective.value(np.clip(point, 0.0, 1.0)))

    def gradient(self, point: np.ndarray) -> tuple[float, np.ndarray]:
        """The objective and its gradient, without NaN."""
        self._spend(self.objective.gradient_work)
        value, slope = self.objective.gradient(np.clip(point, 0.0, 1.0))
        if not (np.isfinite(value) and np.isfinite(slope).all()):
            value, slope = np.nan, np.zeros(len(point))
        return self._told(point, value), slope

    def _spend(self, work: float) -> None:
        if self.found.work + work > self.budget:
            raise _Spent
        self.found.work += work
        self.found.evaluations += 1

    def _told(self, point: np.ndarray, value: float) -> float:
        found = self.found
        found.seconds = time.process_time() - self.began
        if not np.isfinite(value):
            return NO_NUMBER
        if not found.best <= value:
            found.improvements.append(Improvement(found.work, found.seconds, value))
            found.point = np.clip(point, 0.0, 1.0).tolist()
        return value


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
    steps = max(1, int(meter.budget / meter.objective.gradient_work))
    init, update = _adam_of(steps)
    point, state = start, init(start)
    for _ in range(steps):
        _, slope = meter.gradient(point)
        change, state = update(slope, state)
        point = np.clip(point + np.asarray(change), 0.0, 1.0)


@functools.cache
def _adam_of(steps: int) -> tuple[Callable, Callable]:
    """Return how Adam begins and how it goes on, compiled once for all starts."""
    method = optax.adam(optax.cosine_decay_schedule(ADAM_RATE, steps))
    return method.init, jax.jit(method.update)


def _cma(meter: _Meter, start: np.ndarray, seed: int) -> None:
    # A seed of 0 would mean the clock.
    options = {"bounds": [0.0, 1.0], "seed": seed + 1, "verbose": -9, "tolfun": RELATIVE_CHANGE}
    cma.fmin2(meter.value, start, SPREAD, options)


def _bobyqa(meter: _Meter, start: np.ndarray, seed: int) -> None:
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


def search(
    method: str, objective: Objective, start: np.ndarray, budget: float, number: int = 0
) -> Searched:
    """Search from `start` (n,) until the method ends or `budget` (values) is spent.

    `number` names the start and seeds the method.
    """
    found = Searched(method, number)
    try:
        METHODS[method](_Meter(objective, found, budget), start, number)
    except _Spent:
        pass
    return found

"""Seconds and error of each way to the steady-state RMS of a crusher of 30 rad/s and 0.06 mm."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache

import jax
import numpy as np

import jaxcrusher as jc
from benchmarks.peers import numba_peer
from benchmarks.peers.equations import Crusher
from benchmarks.peers.same_field import by_cvode, by_scipy
from benchmarks.timing import spent, timed
from jaxcrusher.motion.flow import initial_state
from jaxcrusher.motion.method import FIRST_STEP

SPEED, CLEARANCE, RTOL = 30.0, 0.06e-3, 1e-9
# Turns waited for; the RMS is that of a third as many turns, and of two at least.
WAITED, SHARE, LEAST = (0, 10, 30, 100, 300, 1000, 3000, 10_000, 30_000), 3, 2
# Name -> the scene that is solved for, friction by hand, and starts. In contact the slip of the
# centres is far below the friction's ramp: there is none.
CASES: dict[str, tuple[str, float, tuple[str, ...]]] = {
    "no friction": ("centre", 0.0, ("contact", "centred")),
    "friction of sliding surfaces": ("surface", 0.1, ("contact",)),
}
TURN, RUNS = 2 * np.pi, 50
MOST_STEPS = 1_000_000_000  # of CVODE in a run


@dataclass(frozen=True)
class Row:
    """One way to one number."""

    case: str
    program: str
    start: str
    turns: int | None  # waited for
    seconds: float  # of the processor
    error: float  # relative


def of_ours(name: str) -> Row:
    """Solve by collocation, warm."""
    scene = jc.paper_scene(SPEED, CLEARANCE, slip=CASES[name][0])
    value = jax.jit(lambda scene: jc.periodic_orbit(scene, nodes=96))
    _, again, found = timed(lambda: value(scene), RUNS)
    return Row(name, "periodic_orbit", "", None, again.cpu, _error(name, found["foundation_rms"]))


@cache
def settled(name: str) -> jc.PeriodicOrbit:
    """Solve the orbit whose RMS all errors are against."""
    scene = jc.paper_scene(SPEED, CLEARANCE, slip=CASES[name][0])
    return jc.periodic_orbit(scene, nodes=384)


def _error(name: str, rms: float) -> float:
    return abs(float(rms) / float(settled(name).foundation_rms) - 1)


def waited(name: str, program: str, most: float) -> Iterator[Row]:
    """Integrate from each start over more and more turns; no run is longer than `most` seconds."""
    slip, friction, starts = CASES[name]
    numbers = numba_peer.numbers(Crusher(speed=SPEED, clearance=CLEARANCE, friction=friction))
    for start in starts:
        scene = jc.paper_scene(SPEED, CLEARANCE, slip=slip, start=start)
        y = np.append(np.asarray(initial_state(scene)), 0.0)
        WAYS[program](y.copy(), numbers, 0)
        pace = 0.0
        for turns in WAITED:
            if pace * (turns + _taken(turns)) > most:
                break
            took, mean = spent(lambda y=y, turns=turns: WAYS[program](y.copy(), numbers, turns))
            pace = took.cpu / (turns + _taken(turns))
            yield Row(name, program, start, turns, took.cpu, _error(name, np.sqrt(mean)))


def _taken(turns: int) -> int:
    return max(LEAST, turns // SHARE)


def _by_numba(y: np.ndarray, numbers: np.ndarray, turns: int) -> float:
    return numba_peer.integrate(y, numbers, turns, _taken(turns), RTOL, FIRST_STEP)[0]


def _angles(turns: int) -> np.ndarray:
    """Return the end of the wait (or any earlier angle: CVODE wants two) and the end."""
    end = turns + _taken(turns)
    return TURN * np.array([turns or end / 2, end])


def _mean(states: np.ndarray, turns: int) -> float:
    """Return the mean of the force's square, from its integral at these angles."""
    return float(states[1, 4] - (states[0, 4] if turns else 0.0)) / _taken(turns)


def _by_cvode(y: np.ndarray, numbers: np.ndarray, turns: int) -> float:
    return _mean(by_cvode(y, numbers, _angles(turns), "Adams", RTOL, MOST_STEPS), turns)


def _by_scipy(y: np.ndarray, numbers: np.ndarray, turns: int) -> float:
    return _mean(by_scipy(y, numbers, _angles(turns), "DOP853", RTOL), turns)


Way = Callable[[np.ndarray, np.ndarray, int], float]
WAYS: dict[str, Way] = {
    "numba Dopri5": _by_numba,
    "CVODE Adams": _by_cvode,
    "SciPy DOP853": _by_scipy,
}

"""The other programs, each giving RMS and force history of a case from one run.

SciPy's methods, CVODE and Dormand-Prince in numba share one right-hand side compiled by numba
(`benchmarks.peers.numba_peer.field`, smoothed laws as ours), with the square of the force as
another state that counts in no error norm. "events" is SciPy on the sharp laws in plain Python,
stopped at every touch.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.integrate import RK45, solve_ivp
from sksundae.cvode import CVODE

from benchmarks.peers import dopri5, numba_peer, scipy_peer
from benchmarks.peers.dopri5 import compiled
from benchmarks.peers.exudyn_peer import Model
from benchmarks.peers.motion import Motion
from benchmarks.work_precision.cases import Answer, Case, closed_form, solved
from benchmarks.work_precision.ours import FEW, LADDER, MOST_STEPS
from jaxcrusher.motion.method import FIRST_STEP

# Dormand-Prince's dense output, of fourth order (Shampine 1986).
DENSE = np.ascontiguousarray(RK45.P)
# An absolute tolerance so large that the integral of the square never counts.
NEVER = 1e30


@dataclass(frozen=True)
class Peer:
    """A program at one setting; `solve` gives the answer and the steps, if they are known."""

    program: str
    setting: str
    solve: Callable[[], tuple[Answer, int | None]]


def _start(case: Case) -> tuple[np.ndarray, np.ndarray]:
    """Return state (e / c, e', 0) and the field's numbers; without friction 0."""
    e, rate = case.relative, case.rate
    y = np.array([e.real, e.imag, rate.real, rate.imag, 0.0])
    return y, numba_peer.numbers(case.crusher)


def _answer(case: Case, states: np.ndarray, p: np.ndarray) -> Answer:
    """Return the answer of states at the case's angles."""
    rms = np.sqrt(states[-1, 4] * 2 * np.pi / case.span)
    return Answer(rms, _forces(case.angles, np.ascontiguousarray(states), p))


@compiled
def _forces(angles, states, p):
    forces, rate = np.empty(len(angles)), np.empty(5)
    for i in range(len(angles)):
        numba_peer.field(angles[i], states[i], p, rate)
        forces[i] = math.sqrt(2 * math.pi * rate[4])
    return forces


def _by_scipy(case: Case, method: str, rtol: float) -> tuple[Answer, int | None]:
    (y, p), rate = _start(case), np.empty(5)

    def field(angle, y):
        numba_peer.field(angle, y, p, rate)
        return rate.copy()

    found = solve_ivp(
        field,
        (0.0, case.angles[-1]),
        y,
        method,
        t_eval=case.angles,
        rtol=rtol,
        atol=[rtol] * 4 + [NEVER],
        first_step=FIRST_STEP,
    )
    if not found.success:
        raise RuntimeError(found.message)
    return _answer(case, found.y.T, p), None


def _by_cvode(case: Case, method: str, rtol: float) -> tuple[Answer, int | None]:
    y, p = _start(case)

    def field(angle, y, rate):
        numba_peer.field(angle, y, p, rate)

    solver = CVODE(
        field,
        method=method,
        rtol=rtol,
        atol=np.array([rtol] * 4 + [NEVER]),
        first_step=FIRST_STEP,
        max_num_steps=MOST_STEPS,
    )
    found = solver.solve(np.append(0.0, case.angles), y)
    if not found.success:
        raise RuntimeError(found.message)
    return _answer(case, found.y[1:], p), None


@compiled
def _march(y, p, angles, rtol, h, dense, states, most):
    """Integrate as `numba_peer` over any span, with states at `angles`; return the steps."""
    k, trial, bend = np.empty((7, 5)), np.empty(5), np.empty(4)
    angle, end, previous, steps, saved = 0.0, angles[-1], 1.0, 0, 0
    numba_peer.field(angle, y, p, k[0])
    while saved < len(angles) and steps < most:
        last = angle + h >= end
        step = end - angle if last else h
        error = dopri5.attempt(numba_peer.field, angle, step, y, p, rtol, k, trial)
        steps += 1
        h = step * dopri5.growth(error, previous)
        if error < 1:
            after = end if last else angle + step
            while saved < len(angles) and angles[saved] <= after:
                x = (angles[saved] - angle) / step
                for i in range(5):
                    bend[:] = 0.0
                    for j in range(7):
                        for order in range(4):
                            bend[order] += dense[j, order] * k[j, i]
                    rise = x * (bend[0] + x * (bend[1] + x * (bend[2] + x * bend[3])))
                    states[saved, i] = y[i] + step * rise
                saved += 1
            angle = after
            y[:] = trial
            k[0] = k[6]
            previous = error
    return steps


def _by_numba(case: Case, rtol: float) -> tuple[Answer, int | None]:
    y, p = _start(case)
    states = np.full((len(case.angles), 5), np.nan)
    steps = _march(y, p, case.angles, rtol, FIRST_STEP, DENSE, states, MOST_STEPS)
    return _answer(case, states, p), steps


def _by_events(case: Case, rtol: float) -> tuple[Answer, int | None]:
    return solved(case, scipy_peer.integrate, rtol), None


def _by_exudyn(case: Case, saves: int) -> tuple[Answer, int | None]:
    """Solve with fixed steps, `saves` of them between two instants of the history."""
    every = case.angles[0] / case.crusher.speed
    end, step = case.span / case.crusher.speed, every / saves
    c = case.crusher
    start = Motion(c, e=case.relative * c.clearance, rate=case.rate)
    # Every step is seen, so that the sum is as exact as the steps.
    force = Model(start, ideal=case.ideal).run(end, step, step)["foundation_force"]
    squares = force**2
    mean = (squares.sum() - (squares[0] + squares[-1]) / 2) / (len(squares) - 1)
    return Answer(np.sqrt(mean), force[saves::saves]), saves * len(case.angles)


def peers(case: Case) -> Iterator[Peer]:
    """Yield all programs at all settings for a case."""
    if case.ideal:
        for count in (8, 16, 32, 64, 128):
            yield Peer(
                "NumPy, closed form",
                f"{count} instants",
                lambda n=count: (replace(closed_form(case, n), history=np.nan), None),
            )
    else:
        for rtol in LADDER:
            label = f"rtol {rtol:.0e}"
            yield Peer("numba Dopri5", label, lambda r=rtol: _by_numba(case, r))
            for method in ("RK45", "DOP853", "LSODA"):
                yield Peer(f"SciPy {method}", label, lambda r=rtol, m=method: _by_scipy(case, m, r))
            for method in ("Adams", "BDF"):
                yield Peer(f"CVODE {method}", label, lambda r=rtol, m=method: _by_cvode(case, m, r))
        for rtol in FEW:
            yield Peer(
                "SciPy Radau", f"rtol {rtol:.0e}", lambda r=rtol: _by_scipy(case, "Radau", r)
            )
        for rtol in (1e-5, 1e-7, 1e-9):
            yield Peer(
                "SciPy DOP853, events", f"rtol {rtol:.0e}", lambda r=rtol: _by_events(case, r)
            )
    for count in (1, 8, 64):
        yield Peer(
            "EXUDYN", f"{count * len(case.angles)} steps", lambda n=count: _by_exudyn(case, n)
        )

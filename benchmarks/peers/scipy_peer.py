"""The crusher by SciPy's DOP853 (or LSODA, Radau), stopped at each corner of the contact's law."""

import time as clock

import numpy as np
from scipy.integrate import solve_ivp

from benchmarks.peers.any_linkage import AnyLinkage
from benchmarks.peers.loose_guide import SliderCrank
from benchmarks.peers.motion import Motion

# Instants that one call of SciPy comes to: it keeps all its steps, which may be millions.
TOGETHER = 500


def integrate(
    motion: Motion | AnyLinkage | SliderCrank,
    times,
    method: str = "DOP853",
    rtol: float = 1e-11,
    pause: float = 1e-12,
    seconds: float = np.inf,
) -> np.ndarray:
    """Return states of `motion` at `times` (s, from 0), shape (times, numbers of a state).

    The law has a corner where pin and bore touch or part: a step ends there, and the next one
    starts `pause` seconds later, so that the same crossing is not found again. Raises TimeoutError
    after so many `seconds` of the processor, and RuntimeError where SciPy stops.
    """
    began = clock.process_time()

    def field(time, y):
        if clock.process_time() - began > seconds:
            raise TimeoutError(f"SciPy's {method} has come to {time:.3g} s in {seconds:g} s.")
        return motion.field(time, y)

    def passing(corner: int):
        def event(time, y):
            return motion.corners(time, y)[corner]

        event.terminal = True  # pyright: ignore[reportFunctionMemberAccess]
        return event

    events = [passing(corner) for corner in range(len(motion.corners(0.0, motion.start)))]
    times = np.asarray(times)
    states, now, y, reported = [], 0.0, motion.start, 0
    while reported < len(times):
        until = times[min(reported + TOGETHER, len(times)) - 1]
        solution = solve_ivp(
            field,
            (now, until),
            y,
            method,
            dense_output=True,
            rtol=rtol,
            atol=rtol * 1e-2,
            events=events,
            first_step=min(1e-7, until - now),
            max_step=2e-4,
        )
        if solution.status < 0:
            raise RuntimeError(f"SciPy's {method} stopped at {now} s: {solution.message}")
        now, y = solution.t[-1], solution.y[:, -1]
        passed = int(np.searchsorted(times, now, side="right"))
        if passed > reported:
            states.append(solution.sol(times[reported:passed]).T)
            reported = passed
        if solution.status == 1:
            y, now = y + pause * np.array(motion.field(now, y)), now + pause
    return np.concatenate(states)

"""The crusher by SUNDIALS: CVODE (Adams) on the angles, IDA (BDF) on the nine coordinates.

IDA gets the equations with the constraints differentiated twice (index 1, no stabilisation):
q' = v, M v' = Q + Phi_q^T lambda, Phi_q v' = gamma. The drift is reported, not hidden.
"""

import numpy as np
from sksundae.cvode import CVODE
from sksundae.ida import IDA

from benchmarks.peers import nine_coordinates
from benchmarks.peers.free_bodies_numba import CompiledBodies
from benchmarks.peers.motion import Motion
from benchmarks.peers.nine_coordinates import COORDINATES, MULTIPLIERS, VELOCITIES, Instant


def cvode(motion: Motion | CompiledBodies, times, rtol: float = 1e-12) -> np.ndarray:
    """Return states of `motion` at `times` (s, from 0), shape (times, numbers of a state)."""

    def field(time, y, rate):
        rate[:] = motion.field(time, y)

    solver = CVODE(
        field, method="Adams", rtol=rtol, atol=rtol * 1e-2, max_num_steps=1_000_000, max_step=2e-4
    )
    return _states(solver.solve(np.asarray(times), motion.start))


def ida(motion: Motion, times, rtol: float = 1e-11) -> np.ndarray:
    """Return (q, q', lambda) at `times` (s), increasing from 0: shape (times, 25)."""
    masses = nine_coordinates.mass_matrix(motion.crusher)

    def residual(time, y, rate, result):
        now = Instant(motion.crusher, time, y[COORDINATES], y[VELOCITIES])
        acceleration = rate[VELOCITIES]
        result[COORDINATES] = rate[COORDINATES] - y[VELOCITIES]
        result[VELOCITIES] = masses * acceleration - now.force - y[MULTIPLIERS] @ now.phi_q
        result[MULTIPLIERS] = now.phi_q @ acceleration - now.gamma

    # A multiplier is as right as rtol of the impact forces of 1e5 N.
    absolute = np.full(25, rtol)
    absolute[VELOCITIES] = 10 * rtol
    absolute[MULTIPLIERS] = 1e6 * rtol
    solver = IDA(
        residual,
        algebraic_idx=list(range(18, 25)),
        rtol=rtol,
        atol=absolute,
        first_step=1e-8,
        max_num_steps=1_000_000,
        max_step=2e-4,
    )
    y, rate = nine_coordinates.start(motion)
    return _states(solver.solve(np.asarray(times), y, rate))


def _states(solution) -> np.ndarray:
    if not solution.success:
        raise RuntimeError(f"SUNDIALS stopped: {solution.message}")
    return solution.y

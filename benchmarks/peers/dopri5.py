"""Dormand and Prince's 5(4) pair for a field compiled by numba, over turns of the shaft.

The same tableau, error norm and controller as `jaxcrusher.statistics` with `diffrax.Dopri5`. A
`field(angle, y, p, rate)` writes the rate of `y` by shaft angle (rad); the last entry of `y` is an
integral over the turn and not in the error norm, the others are all scaled to 1.
"""

import math

import numpy as np
from numba import njit

# Dormand and Prince 1980: nodes, stages, and the error's weights.
C = np.array([0.0, 1 / 5, 3 / 10, 4 / 5, 8 / 9, 1.0, 1.0])
A = np.zeros((7, 7))
A[1, :1] = 1 / 5
A[2, :2] = 3 / 40, 9 / 40
A[3, :3] = 44 / 45, -56 / 15, 32 / 9
A[4, :4] = 19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729
A[5, :5] = 9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656
A[6, :6] = 35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84
ERROR = np.array([71 / 57600, 0.0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40])

# Fast, but with NaN and infinity kept: a trial step may leave the linkage's reach.
compiled = njit(cache=True, error_model="numpy", fastmath={"reassoc", "contract", "arcp", "nsz"})

# Put into each function that calls them: only then is compiled code with a given field kept.
shared = njit(inline="always")


@shared
def attempt(field, angle, step, y, p, rtol, k, trial):
    """Step from `y`, whose rate is k[0], into `trial`; return the error over the allowed one."""
    for stage in range(1, 7):
        for i in range(y.size):
            change = 0.0
            for j in range(stage):
                change += A[stage, j] * k[j, i]
            trial[i] = y[i] + step * change
        field(angle + C[stage] * step, trial, p, k[stage])
    squares = 0.0
    for i in range(y.size - 1):
        error = 0.0
        for j in range(7):
            error += ERROR[j] * k[j, i]
        scale = rtol + rtol * max(abs(y[i]), abs(trial[i]))
        squares += (step * error / scale) ** 2
    # What is not finite is a huge error.
    return max(math.sqrt(squares / (y.size - 1)), 1e-10) if squares < 1e300 else 1e150


@compiled
def growth(error, previous):
    """Return the step's growth: diffrax's PI control, pcoeff 0.4, icoeff 0.3, safety 0.9."""
    factor = 0.9 * error ** (-0.7 / 5) * previous ** (0.4 / 5)
    return min(max(factor, 1.0 if error < 1 else 0.2), 10.0)


@shared
def integrate(field, y, p, settle, turns, rtol, h, most=1_000_000_000):
    """Integrate `y` over whole turns; return the mean of the last entry by turn, and the steps.

    `h` is the first step (rad). Each turn ends on its last angle, as in jaxcrusher. The mean is NaN
    if it would take more than `most` steps, as a motion that is not finite does.
    """
    k = np.empty((7, y.size))
    trial = np.empty(y.size)
    total, steps, previous = 0.0, 0, 1.0
    for turn in range(settle + turns):
        angle, end = 0.0, 2 * math.pi
        y[-1] = 0.0
        h = min(h, end)
        field(angle, y, p, k[0])
        while angle < end:
            if steps >= most:
                return math.nan, steps
            last = angle + h >= end
            step = end - angle if last else h
            error = attempt(field, angle, step, y, p, rtol, k, trial)
            steps += 1
            if not last or error >= 1:
                h = step * growth(error, previous)
            if error < 1:
                angle += step
                y[:] = trial
                k[0] = k[6]
                previous = error
        if turn >= settle:
            total += y[-1]
    return total / turns, steps

"""SciPy's methods and CVODE on the right-hand side compiled by numba, `numba_peer.field`.

The square of the force is another state, which counts in no error norm.
"""

import numpy as np
from scipy.integrate import solve_ivp
from sksundae.cvode import CVODE

from benchmarks.peers import numba_peer
from jaxcrusher.motion.method import FIRST_STEP

# So large that the integral of the square never counts.
NEVER = 1e30


def by_scipy(
    y: np.ndarray, p: np.ndarray, angles: np.ndarray, method: str, rtol: float
) -> np.ndarray:
    """Return states (angles, 5) at increasing angles > 0, from `y` at 0 with `p` of the peer.

    Raises RuntimeError where the method fails.
    """
    rate = np.empty(5)

    def field(angle, y):
        numba_peer.field(angle, y, p, rate)
        return rate.copy()

    found = solve_ivp(
        field,
        (0.0, angles[-1]),
        y,
        method,
        t_eval=angles,
        rtol=rtol,
        atol=[rtol] * 4 + [NEVER],
        first_step=FIRST_STEP,
    )
    if not found.success:
        raise RuntimeError(found.message)
    return found.y.T


def by_cvode(
    y: np.ndarray, p: np.ndarray, angles: np.ndarray, method: str, rtol: float, most: int
) -> np.ndarray:
    """Do as `by_scipy`, in at most so many steps between two of at least two angles."""

    def field(angle, y, rate):
        numba_peer.field(angle, y, p, rate)

    solver = CVODE(
        field,
        method=method,
        rtol=rtol,
        atol=np.array([rtol] * 4 + [NEVER]),
        first_step=FIRST_STEP,
        max_num_steps=most,
    )
    found = solver.solve(np.append(0.0, angles), y)
    if not found.success:
        raise RuntimeError(found.message)
    return found.y[1:]

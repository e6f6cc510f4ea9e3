"""What independent programs say of a case: CVODE instant by instant, numba's Dopri5 by statistics.

CVODE integrates the published laws without smoothing, in angles; the program for numba is written
by hand. Neither shares code with jaxcrusher.
"""

import cmath
import math
from dataclasses import dataclass

import numpy as np

from benchmarks.peers import numba_peer, sundials_peer
from benchmarks.peers.equations import Crusher
from benchmarks.peers.motion import Motion

SPAN = 0.03  # s
INSTANTS = 1001
TIMES = np.linspace(0, SPAN, INSTANTS)
# By which a start is moved to see how errors grow: above the error of any program here, and
# far below a penetration.
OFFSET = 1e-10  # m
SETTLE, TURNS = 3, 5
# Statistics are those of several starts, this many clearances apart: above the errors at the
# first contact. Where their RMS scatters by more than SCATTER, MANY are needed, and OURS.
SPREAD, SCATTER = 1e-5, 1e-3
FEW, MANY, OURS = 5, 24, 4
# Of all members together: about 10 s.
MOST_STEPS = 10_000_000
GOLDEN = (math.sqrt(5) - 1) / 2


@dataclass(frozen=True)
class Reference:
    """A case by other programs; forces in N, lengths in m."""

    foundation_force: np.ndarray  # at TIMES
    eccentricity: np.ndarray  # at TIMES, shape (times, 2)
    contacts: np.ndarray  # touch-downs and partings up to each time
    force_growth: np.ndarray  # largest change up to each time by a metre of offset, N/m
    eccentricity_growth: np.ndarray  # the same, without unit
    rms: np.ndarray  # of |R_O| + |R_C|, of each member


def reference(crusher: Crusher, e: complex, rate: complex) -> Reference:
    """Run all references of a start at `e` (m) and `rate` (m/s)."""
    still = _history(crusher, e, rate)
    moved = [_history(crusher, e + offset, rate) for offset in (OFFSET, 1j * OFFSET)]

    def growth(name: str) -> np.ndarray:
        change = [abs(m[name] - still[name]).reshape(INSTANTS, -1).max(axis=1) for m in moved]
        return np.maximum.accumulate(np.max(change, axis=0)) / OFFSET

    return Reference(
        still["foundation_force"],
        still["eccentricity"],
        np.cumsum(np.diff(still["normal_force"] != 0, prepend=False)),
        growth("foundation_force"),
        growth("eccentricity"),
        statistics(crusher, e, rate),
    )


def _history(crusher: Crusher, e: complex, rate: complex) -> dict[str, np.ndarray]:
    motion = Motion(crusher, e=e, rate=rate)
    return motion.observe(TIMES, sundials_peer.cvode(motion, TIMES))


def members(crusher: Crusher, e: complex, count: int) -> list[complex]:
    """Eccentricities (m) about `e`, on a circle; the first `count` of a golden sequence."""
    radius = max(SPREAD * crusher.clearance, OFFSET)
    return [e + cmath.rect(radius, 2 * math.pi * GOLDEN * k) for k in range(count)]


def statistics(crusher: Crusher, e: complex, rate: complex) -> np.ndarray:
    """The RMS of every member over the turns after settling, N; NaN where it failed."""
    numbers = numba_peer.numbers(crusher)
    found, left = [], MOST_STEPS
    for place in members(crusher, e, MANY):
        enough = len(found) == FEW and np.ptp(found) <= SCATTER * np.mean(found)
        if enough or left <= 0:
            break
        relative = place / crusher.clearance
        start = np.array([relative.real, relative.imag, rate.real, rate.imag, 0.0])
        mean_square, steps = numba_peer.integrate(
            start, numbers, SETTLE, TURNS, 1e-9, 1e-5, MOST_STEPS
        )
        left -= steps
        found.append(math.sqrt(mean_square))
    return np.array(found)

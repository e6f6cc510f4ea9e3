"""Independent references of a case: CVODE instant by instant, numba's Dopri5 by statistics.

CVODE integrates the published laws without smoothing; the programs for numba are written by hand.
None shares code with jaxcrusher.
"""

import cmath
import math
from dataclasses import dataclass

import numpy as np

from benchmarks.peers.parting import parted
from benchmarks.stability.peer import AbstractPeer, Pins

SPAN = 0.03  # s
INSTANTS = 1001
TIMES = np.linspace(0, SPAN, INSTANTS)
# Starts are moved by this much to see how errors grow: above the error of any program here,
# and far below a penetration.
OFFSET = 1e-10  # m
SETTLE, TURNS = 3, 5
# Statistics are those of several starts, this many clearances apart: above the errors at the
# first contact. Where their RMS scatters by more than SCATTER, MANY are needed, and OURS.
SPREAD, SCATTER = 1e-5, 1e-3
FEW, MANY, OURS = 5, 24, 4
# The most steps of all members together: about 10 s.
MOST_STEPS = 10_000_000
GOLDEN = (math.sqrt(5) - 1) / 2


@dataclass(frozen=True)
class Reference:
    """A case by other programs, at TIMES: forces in N, lengths in m."""

    histories: dict[str, np.ndarray]  # `foundation_force`, `eccentricity` of each loose joint
    growth: dict[str, np.ndarray]  # share of each that parts, by a metre of offset
    contacts: np.ndarray  # touch-downs and partings up to each time
    rms: np.ndarray  # of |R_O| + |R_C|, of each member


def reference(peer: AbstractPeer, pins: Pins) -> Reference:
    """Run all references from a start."""
    still = peer.history(pins, TIMES)
    contacts = still.pop("contacts")
    # All pins at once: what grows fastest soon hides the rest, whichever of them it began with.
    ways = [[way] * len(pins.e) for way in (OFFSET, 1j * OFFSET)]
    moved = [peer.history(pins.moved(way), TIMES) for way in ways]
    grown = {name: share / OFFSET for name, share in parted(still, moved).items()}
    return Reference(still, grown, contacts, statistics(peer, pins))


def members(peer: AbstractPeer, pins: Pins, count: int) -> list[Pins]:
    """Return starts on circles about `pins`: the first `count` of a golden sequence."""
    radii = [max(SPREAD * clearance, OFFSET) for clearance in peer.clearances]
    angles = [2 * math.pi * GOLDEN * k for k in range(count)]
    return [pins.moved(cmath.rect(radius, angle) for radius in radii) for angle in angles]


def statistics(peer: AbstractPeer, pins: Pins) -> np.ndarray:
    """Return the RMS (N) of every member over the turns after settling; NaN where it failed."""
    found, left = [], MOST_STEPS
    for place in members(peer, pins, MANY):
        enough = len(found) == FEW and np.ptp(found) <= SCATTER * np.mean(found)
        if enough or left <= 0:
            break
        mean_square, steps = peer.mean_square(place, SETTLE, TURNS, MOST_STEPS)
        left -= steps
        found.append(math.sqrt(mean_square))
    return np.array(found)

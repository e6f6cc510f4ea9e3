"""What a motion swings about: the mean of its section points, and how far an orbit is from it."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from jaxcrusher.motion.flow import flat
from jaxcrusher.settled.result import PeriodicOrbit

# An orbit is that mean if it is no further from it, as a share of the spread and in clearances.
ABOUT, NEAR = 0.25, 1e-3


class Swing(NamedTuple):
    """What a piece of motion swings about."""

    centre: Float[np.ndarray, "period dims"]  # means of every so manieth section point
    spread: float  # about these, RMS, in clearances

    @property
    def allowed(self) -> float:
        """How far off an orbit may be that this swings about, in clearances."""
        return max(ABOUT * self.spread, NEAR)


def swing_about(states: Float[np.ndarray, "turns dims"], period: int) -> Swing:
    """What whole multiples of `period` turns swing about: a point that repeats after so many."""
    parts = states.reshape(-1, period, states.shape[1])
    centre = parts.mean(axis=0)
    apart = (parts - centre)[..., :2]
    return Swing(centre, float(np.sqrt(np.mean(apart**2))))


def section_of(orbit: PeriodicOrbit) -> Float[np.ndarray, "period 2"]:
    """Where the pin is at the beginning of each turn, in clearances."""
    places = [flat(orbit.state(2 * np.pi * turn), orbit.scene) for turn in range(orbit.period)]
    return np.array(places)[:, :2]


def distance(section: Float[np.ndarray, "p 2"], centre: Float[np.ndarray, "n dims"]) -> float:
    """Of one orbit from another, RMS, in clearances; whichever turn comes first.

    Infinite where the periods differ.
    """
    if len(section) != len(centre):
        return np.inf
    apart = [np.roll(section, -turn, axis=0) - centre[:, :2] for turn in range(len(section))]
    return min(float(np.sqrt(np.mean(shift**2))) for shift in apart)

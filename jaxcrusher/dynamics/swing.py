"""What a motion swings about: the mean of its section points, and how far an orbit is from it."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from jaxcrusher.motion.flow import flat
from jaxcrusher.orbits.result import PeriodicOrbit

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
    apart = places(parts - centre)
    return Swing(centre, float(np.sqrt(np.mean(apart**2))))


def places(states: Float[np.ndarray, "*turns dims"]) -> Float[np.ndarray, "*turns half"]:
    """The eccentricities of section points, which hold four numbers a joint, in clearances."""
    of_joints = states.reshape(*states.shape[:-1], -1, 4)[..., :2]
    return of_joints.reshape(*states.shape[:-1], -1)


def section_of(orbit: PeriodicOrbit) -> Float[np.ndarray, "period half"]:
    """Where the pins are at the beginning of each turn, in clearances."""
    turns = [flat(orbit.state(2 * np.pi * turn), orbit.scene) for turn in range(orbit.period)]
    return places(np.array(turns))


def distance(section: Float[np.ndarray, "p half"], centre: Float[np.ndarray, "n dims"]) -> float:
    """Of one orbit from another, RMS, in clearances; whichever turn comes first.

    Infinite where the periods differ.
    """
    if len(section) != len(centre):
        return np.inf
    middle = places(centre)
    apart = [np.roll(section, -turn, axis=0) - middle for turn in range(len(section))]
    return min(float(np.sqrt(np.mean(shift**2))) for shift in apart)

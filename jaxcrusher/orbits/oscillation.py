"""Free oscillations about an orbit: the mean of section points, and its distance from an orbit."""

from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float, Int

from jaxcrusher.orbits.result import PeriodicOrbit

# An orbit is the mean of a swing if it is no further from it, as a share of its spread and in
# clearances.
ABOUT, NEAR = 0.25, 1e-3


class Oscillation(NamedTuple):
    """A piece of motion: its mean section points, and its spread about them."""

    centre: Float[np.ndarray, "period dims"]  # entry i is the mean over every p-th turn from i on
    middle: Float[np.ndarray, "period half"]  # the eccentricities of these, in clearances
    spread: float  # about these, RMS, in clearances

    @property
    def allowed(self) -> float:
        """Return how far the orbit of this oscillation may be from its centre, in clearances."""
        return max(ABOUT * self.spread, NEAR)

    def is_about(self, section: Float[np.ndarray, "p half"]) -> bool:
        """Tell whether the pins oscillate about an orbit's section points."""
        return distance(section, self.middle) < self.allowed


def about_means(states: Any, period: int) -> tuple[Any, Any]:
    """Return the means of states so many turns apart, and the states' differences from them.

    The last mean contains the last state. First states that fill no period are left out.
    """
    parts = states[len(states) % period :].reshape(-1, period, states.shape[1])
    means = parts.mean(axis=0)
    return means, parts - means[None]


def oscillation_about(
    states: Float[np.ndarray, "turns dims"], period: int, pins: Int[np.ndarray, " half"]
) -> Oscillation:
    """Return the oscillation of whole multiples of `period` turns about an orbit of that period.

    Only the numbers `pins` of a state count (see `jaxcrusher.mechanism.state.pins_of`), and not a
    frame on springs.
    """
    centre, apart = about_means(states, period)
    spread = float(np.sqrt(np.mean(apart[..., pins] ** 2)))
    return Oscillation(centre, centre[..., pins], spread)


def section_of(orbit: PeriodicOrbit) -> Float[np.ndarray, "period half"]:
    """Return the positions of the pins at the beginning of each turn, in clearances."""
    turns = [orbit.state(2 * np.pi * turn) for turn in range(orbit.period)]
    places = [[at.array() for at in state.parts.eccentricities.values] for state in turns]
    return np.reshape(places, (orbit.period, -1))


def distance(section: Float[np.ndarray, "p half"], middle: Float[np.ndarray, "n half"]) -> float:
    """Return the distance between two orbits, RMS, in clearances; whichever turn comes first.

    It is infinite where the periods differ.
    """
    if len(section) != len(middle):
        return np.inf
    apart = [np.roll(section, -turn, axis=0) - middle for turn in range(len(section))]
    return min(float(np.sqrt(np.mean(shift**2))) for shift in apart)

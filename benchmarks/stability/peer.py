"""The crushers of other programs: CVODE instant by instant, numba's Dopri5 by statistics."""

from abc import ABC, abstractmethod
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from typing_extensions import override

from benchmarks.peers import free_bodies_numba, numba_peer, sundials_peer
from benchmarks.peers.crusher_bodies import PREFIXES, crusher
from benchmarks.peers.equations import Crusher
from benchmarks.peers.free_bodies_numba import CompiledBodies
from benchmarks.peers.motion import Motion

# The tolerance and the first step (rad) of statistics.
RTOL, FIRST = 1e-9, 1e-5


@dataclass(frozen=True)
class Pins:
    """Eccentricities (m) and rates (m/s) of the loose joints among A, B and C, in this order."""

    e: tuple[complex, ...]
    rates: tuple[complex, ...]

    def moved(self, by: Iterable[complex]) -> "Pins":
        """Return these pins with `by` (m) added to the eccentricities."""
        return Pins(tuple(at + d for at, d in zip(self.e, by, strict=True)), self.rates)


class AbstractPeer(ABC):
    """A crusher that other programs run; it can be hashed and sent to another process."""

    @property
    @abstractmethod
    def clearances(self) -> tuple[float, ...]:
        """The clearances of the loose joints, m."""

    @abstractmethod
    def history(self, pins: Pins, times: np.ndarray) -> dict[str, np.ndarray]:
        """Integrate by CVODE to `times` (s) without smoothing; names as in `jaxcrusher.simulate`.

        Returns `foundation_force` (N), `eccentricity` (m) of each loose joint, and `contacts`, the
        touch-downs and partings up to each time.
        """

    @abstractmethod
    def mean_square(self, pins: Pins, settle: int, turns: int, most: int) -> tuple[float, int]:
        """Return the mean of (|R_O| + |R_C|)^2 (N2) over `turns` after `settle`, and the steps.

        NaN if there would be more than `most`.
        """


@dataclass(frozen=True)
class BearingPeer(AbstractPeer):
    """Clearance in A: an open chain in angles, and a program by hand for numba."""

    crusher: Crusher

    @property
    @override
    def clearances(self) -> tuple[float, ...]:
        return (self.crusher.clearance,)

    @override
    def history(self, pins: Pins, times: np.ndarray) -> dict[str, np.ndarray]:
        """Integrate by CVODE in angles."""
        motion = Motion(self.crusher, e=pins.e[0], rate=pins.rates[0])
        found = motion.observe(times, sundials_peer.cvode(motion, times))
        return {
            "foundation_force": found["foundation_force"],
            "eccentricity": found["eccentricity"],
            "contacts": changes(found["normal_force"]),
        }

    @override
    def mean_square(self, pins: Pins, settle: int, turns: int, most: int) -> tuple[float, int]:
        """Integrate by `numba_peer`, smoothed as ours."""
        relative, rate = pins.e[0] / self.crusher.clearance, pins.rates[0]
        y = np.array([relative.real, relative.imag, rate.real, rate.imag, 0.0])
        numbers = numba_peer.numbers(self.crusher)
        return numba_peer.integrate(y, numbers, settle, turns, RTOL, FIRST, most)


@dataclass(frozen=True)
class SeatsPeer(AbstractPeer):
    """Clearance in A, B and C or in any of them: free bodies, compiled by numba."""

    numbers: tuple[tuple[str, float | str], ...]  # a description, as items

    @cached_property
    def loose(self) -> tuple[str, ...]:
        """Letters of the loose joints."""
        return crusher(dict(self.numbers)).loose

    @property
    @override
    def clearances(self) -> tuple[float, ...]:
        of = dict(self.numbers)
        return tuple(float(of[PREFIXES[joint] + "clearance"]) for joint in self.loose)

    def _compiled(self, pins: Pins) -> CompiledBodies:
        e, rates = (dict(zip(self.loose, at, strict=True)) for at in (pins.e, pins.rates))
        return CompiledBodies(crusher(dict(self.numbers), e, rates))

    @override
    def history(self, pins: Pins, times: np.ndarray) -> dict[str, np.ndarray]:
        """Integrate by CVODE in eccentricities."""
        motion = self._compiled(pins)
        found = motion.observe(times, sundials_peer.cvode(motion, times))
        forces = [found.pop(PREFIXES[joint] + "normal_force") for joint in self.loose]
        kept = {name.replace(".", "_"): values for name, values in found.items()}
        return kept | {"contacts": np.sum([changes(force) for force in forces], axis=0)}

    @override
    def mean_square(self, pins: Pins, settle: int, turns: int, most: int) -> tuple[float, int]:
        """Integrate the same field, not smoothed."""
        motion = self._compiled(pins)
        return free_bodies_numba.integrate(
            motion.start, motion.numbers, settle, turns, RTOL, FIRST, most
        )


def changes(force: np.ndarray) -> np.ndarray:
    """Count how often a contact has begun or ended, up to each instant."""
    return np.cumsum(np.diff(force != 0, prepend=False))

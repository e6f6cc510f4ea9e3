"""The cases of B and C: A, B and C loose, one number of a seat changed at a time."""

import cmath
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from benchmarks.peers.free_bodies import PREFIXES
from benchmarks.stability.case import AbstractCase
from benchmarks.stability.peer import Pins, SeatsPeer
from jaxcrusher.crusher.joints import JOINTS, LETTERS
from jaxcrusher.scenes.parameters import PE250X400

CLEARANCES = {"A": 6e-5, "B": 1e-4, "C": 8e-5}
YOUNG = float(PE250X400["young"])
LAW = {
    "bore_radius": 0.04,
    "young": YOUNG,
    "poisson": float(PE250X400["poisson"]),
    "restitution": 0.9,
    "impact_velocity": 0.5,
    "friction": 0.02,
}
# With the paper's 8.8 kN the seats rattle for good, beyond the elastic limit at every turn.
LOAD = 5e4  # N
VIOLENT = 5 * cmath.rect(1.0, 0.7)  # m/s, tilted so that no symmetry helps
SEATS = {LETTERS[seat]: seat for seat in JOINTS[1:]}


@dataclass(frozen=True)
class Axis:
    """A number of a description, its unit and values; these are times `factor` in SI units."""

    name: str
    unit: str
    values: tuple[float, ...]
    factor: float = 1.0


# Of each seat.
AXES = {
    "clearance": Axis("clearance", "m", (1e-6, 1e-5, 3e-5, 2e-4, 5e-4, 2e-3)),
    "stiffness": Axis("young", "x base", (1e-2, 100.0, 1e4), YOUNG),
    "restitution": Axis("restitution", "1", (0.05, 0.5, 1.0)),
    "friction": Axis("friction", "1", (0.0, 0.3, 1.0)),
}
LOADS = Axis("load", "N", (0.0, 8.8e3, 2e5, 1e6))
# Sets of loose joints with nothing else changed; the others are ideal.
SETS = ("ABC", "BC", "B", "C")


def starts(seats: str) -> tuple[str, ...]:
    """At rest amid the bores, resting in them, thrown at the wall of one of the seats."""
    return ("centred", "in contact", *(f"violent at {joint}" for joint in seats))


def described(loose: str, changes: Mapping[str, float]) -> dict[str, float | str]:
    """A crusher with these joints loose."""
    numbers = PE250X400 | {"slip": "surface", "load": LOAD}
    if "A" not in loose:
        numbers["joint"] = "ideal"
        del numbers["friction"]
    for joint in loose:
        prefix = PREFIXES[joint]
        law = (LAW if prefix else {"friction": LAW["friction"]}) | {"clearance": CLEARANCES[joint]}
        numbers |= {prefix + name: value for name, value in law.items()}
        numbers[prefix + "slip"] = "surface"
    return {**numbers, **changes}


@dataclass(frozen=True)
class SeatCase(AbstractCase):
    """A description, as items."""

    numbers: tuple[tuple[str, float | str], ...]

    @property
    def peer(self) -> SeatsPeer:
        """The crusher of the other programs."""
        return SeatsPeer(self.numbers)

    @property
    def values(self) -> dict[str, float | str]:
        """The same as a description."""
        return dict(self.numbers)

    @property
    def given(self) -> Pins:
        """At rest amid the bores, but for a pin that is thrown."""
        loose = self.peer.loose
        thrown = (VIOLENT if self.start == f"violent at {joint}" else 0j for joint in loose)
        return Pins(tuple(0j for _ in loose), tuple(thrown))


def cases() -> Iterator[SeatCase]:
    """All of them: sets of loose joints, loads, then each number of B and of C."""
    for loose in SETS:
        numbers = tuple(described(loose, {}).items())
        for start in starts(loose.strip("A")):
            yield SeatCase("loose", ", ".join(loose), start, numbers)
    yield from _along("load", LOADS, LOADS.name, "B")
    for joint, seat in SEATS.items():
        for name, axis in AXES.items():
            yield from _along(f"{seat} {name}", axis, f"{seat}.{axis.name}", joint)


def _along(label: str, axis: Axis, key: str, joint: str) -> Iterator[SeatCase]:
    for start in starts(joint):
        for value in axis.values:
            numbers = described("ABC", {key: value * axis.factor})
            yield SeatCase(label, f"{value:g}", start, tuple(numbers.items()))

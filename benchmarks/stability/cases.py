"""The cases: one number of a base case changed at a time, from starts of every kind.

Those of the bearing have clearance in A alone, those of the seats in A, B and C.
"""

import cmath
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

from benchmarks.peers.crusher_bodies import PREFIXES
from benchmarks.peers.equations import Crusher
from benchmarks.stability.case import Case, Numbers
from benchmarks.stability.peer import BearingPeer, Pins, SeatsPeer
from jaxcrusher.crusher.machine import LETTERS
from jaxcrusher.scenes.parameters import PE250X400


@dataclass(frozen=True)
class Axis:
    """Numbers of a description by name, their unit, and values, `relative` to the base case's."""

    unit: str
    values: tuple[float, ...]
    names: tuple[str, ...]
    relative: bool = False

    def changes(self, value: float, base: Mapping[str, float | str]) -> dict[str, float]:
        """Return the numbers at a value."""
        return {n: value * (float(base[n]) if self.relative else 1.0) for n in self.names}


# With the paper's friction of 0.1 the centred start whirls, and hides all else; 0.02 leaves
# impacts, swings and whirls. Slip is that of the surfaces.
BASE = Crusher(friction=0.02)
# Name in a description -> field of the peers' crusher.
FIELDS = {
    "speed": "speed",
    "clearance": "clearance",
    "friction": "friction",
    "load": "load",
    "restitution": "restitution",
    "young": "young",
    "shaft.mass": "m1",
    "shaft.inertia": "j1",
    "jaw.mass": "m2",
    "jaw.inertia": "j2",
    "toggle.mass": "m3",
    "toggle.inertia": "j3",
}
STARTS = ("centred", "in contact", "violent")
TIMES_BASE = "x base"
AXES = {
    "clearance": Axis("m", (1e-6, 1e-5, 3e-5, 6e-5, 1.2e-4, 5e-4, 2e-3), ("clearance",)),
    "speed": Axis("rad/s", (0.5, 2.0, 8.0, 30.0, 60.0, 120.0, 200.0, 400.0), ("speed",)),
    "stiffness": Axis(TIMES_BASE, (1e-2, 0.1, 1.0, 10.0, 100.0, 1e3, 1e4), ("young",), True),
    "restitution": Axis("1", (0.05, 0.2, 0.5, 0.7, 0.9, 1.0), ("restitution",)),
    "friction": Axis("1", (0.0, 0.01, 0.02, 0.05, 0.1, 0.3, 1.0), ("friction",)),
    "load": Axis("N", (0.0, 1e3, 8.8e3, 5e4, 2e5, 1e6), ("load",)),
    "masses": Axis(TIMES_BASE, (1e-2, 0.1, 1.0, 10.0, 100.0), tuple(FIELDS)[6:], True),
}
# Starts at e (clearances) and e' (m/s); a tilted direction, so that no symmetry helps.
TILTED = cmath.rect(1.0, 0.7)
VIOLENT = 5 * TILTED
GIVEN: dict[str, tuple[complex, complex]] = {
    "centred": (0j, 0j),
    "violent": (0j, VIOLENT),
    "e = 0, 1 mm/s": (0j, 1e-3 * TILTED),
    "e = 0, 0.5 m/s": (0j, 0.5 * TILTED),
    "grazing, at rest": (1 + 0j, 0j),
    "grazing, 0.5 m/s along": (1 + 0j, 0.5j),
    "grazing, 5 m/s along": (1 + 0j, 5j),
    "grazing, 0.5 m/s into": (1 + 0j, 0.5 + 0j),
    "10 m/s": (0j, 10 * TILTED),
    "30 m/s": (0j, 30 * TILTED),
}


def bearing_case(start: str, crusher: Crusher = BASE, axis: str = "start", value: str = "") -> Case:
    """Return the case of a crusher with clearance in A alone, from a start of `GIVEN`."""
    numbers = _numbers(crusher) | {"slip": "surface"}
    given = None
    if start != "in contact":
        relative, rate = GIVEN[start]
        given = Pins((relative * crusher.clearance,), (rate,))
    items = tuple(numbers.items())
    return Case(axis, value or start, start, items, BearingPeer(crusher), given)


def _numbers(crusher: Crusher) -> Numbers:
    return {name: getattr(crusher, field) for name, field in FIELDS.items()}


def cases() -> Iterator[Case]:
    """Yield the cases of A, axis by axis, then the starts of the base case."""
    for name, axis in AXES.items():
        for start in STARTS:
            for value in axis.values:
                changes = axis.changes(value, _numbers(BASE))
                crusher = replace(BASE, **{FIELDS[n]: number for n, number in changes.items()})
                yield bearing_case(start, crusher, name, f"{value:g}")
    for start in GIVEN:
        yield bearing_case(start)


CLEARANCES = {"A": 6e-5, "B": 1e-4, "C": 8e-5}
LAW = {
    "bore_radius": 0.04,
    "young": float(PE250X400["young"]),
    "poisson": float(PE250X400["poisson"]),
    "restitution": 0.9,
    "impact_velocity": 0.5,
    "friction": 0.02,
}
# With the paper's 8.8 kN the seats rattle for good, beyond the elastic limit at every turn.
LOAD = 5e4  # N
SEATS = {LETTERS[seat]: seat for seat in ("elbow", "pivot")}
# The numbers of each seat.
SEAT_AXES = {
    "clearance": Axis("m", (1e-6, 1e-5, 3e-5, 2e-4, 5e-4, 2e-3), ("clearance",)),
    "stiffness": Axis(TIMES_BASE, (1e-2, 100.0, 1e4), ("young",), True),
    "restitution": Axis("1", (0.05, 0.5, 1.0), ("restitution",)),
    "friction": Axis("1", (0.0, 0.3, 1.0), ("friction",)),
}
LOADS = Axis("N", (0.0, 8.8e3, 2e5, 1e6), ("load",))
# Sets of loose joints with nothing else changed; the others are ideal.
SETS = ("ABC", "BC", "B", "C")


def seat_starts(seats: str) -> tuple[str, ...]:
    """Return the starts: at rest amid the bores or in them, thrown at the wall of a seat."""
    return ("centred", "in contact", *(f"violent at {joint}" for joint in seats))


def described(loose: str, changes: Mapping[str, float]) -> Numbers:
    """Return the description of a crusher with these joints loose."""
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


def seat_case(
    axis: str, value: str, start: str, loose: str, changes: Mapping[str, float] | None = None
) -> Case:
    """Return the case of a crusher with these joints loose."""
    items = tuple(described(loose, changes or {}).items())
    thrown = tuple(VIOLENT if start == f"violent at {joint}" else 0j for joint in loose)
    given = None if start == "in contact" else Pins((0j,) * len(loose), thrown)
    return Case(axis, value, start, items, SeatsPeer(items), given)


def seat_cases() -> Iterator[Case]:
    """Yield the cases of B and C: sets of loose joints, loads, then each number of each seat."""
    for loose in SETS:
        for start in seat_starts(loose.strip("A")):
            yield seat_case("loose", ", ".join(loose), start, loose)
    yield from _along("load", LOADS, "", "B")
    for joint, seat in SEATS.items():
        for name, axis in SEAT_AXES.items():
            yield from _along(f"{seat} {name}", axis, f"{seat}.", joint)


def _along(label: str, axis: Axis, prefix: str, joint: str) -> Iterator[Case]:
    for start in seat_starts(joint):
        for value in axis.values:
            changes = {prefix + n: number for n, number in axis.changes(value, LAW).items()}
            yield seat_case(label, f"{value:g}", start, "ABC", changes)

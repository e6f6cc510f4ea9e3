"""The cases of A: one number of a base case changed at a time, and starts of every kind."""

import cmath
from collections.abc import Iterator
from dataclasses import dataclass, replace

from benchmarks.peers.equations import Crusher
from benchmarks.stability.case import STARTS, AbstractCase
from benchmarks.stability.peer import BearingPeer, Pins

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
MASSES = ("m1", "j1", "m2", "j2", "m3", "j3")


@dataclass(frozen=True)
class Axis:
    """A quantity, its unit, its values, and the crusher's fields that it sets or multiplies."""

    unit: str
    values: tuple[float, ...]
    fields: tuple[str, ...]
    factor: bool = False

    def crusher(self, value: float) -> Crusher:
        """The base case with this value."""
        scale = {name: getattr(BASE, name) if self.factor else 1.0 for name in self.fields}
        return replace(BASE, **{name: value * size for name, size in scale.items()})


AXES = {
    "clearance": Axis("m", (1e-6, 1e-5, 3e-5, 6e-5, 1.2e-4, 5e-4, 2e-3), ("clearance",)),
    "speed": Axis("rad/s", (0.5, 2.0, 8.0, 30.0, 60.0, 120.0, 200.0, 400.0), ("speed",)),
    "stiffness": Axis("x base", (1e-2, 0.1, 1.0, 10.0, 100.0, 1e3, 1e4), ("young",), True),
    "restitution": Axis("1", (0.05, 0.2, 0.5, 0.7, 0.9, 1.0), ("restitution",)),
    "friction": Axis("1", (0.0, 0.01, 0.02, 0.05, 0.1, 0.3, 1.0), ("friction",)),
    "load": Axis("N", (0.0, 1e3, 8.8e3, 5e4, 2e5, 1e6), ("load",)),
    "masses": Axis("x base", (1e-2, 0.1, 1.0, 10.0, 100.0), MASSES, True),
}
# Besides, on the base case alone: e in clearances, e' in m/s. A tilted direction, so that no
# symmetry helps.
TILTED = cmath.rect(1.0, 0.7)
GIVEN: dict[str, tuple[complex, complex]] = {
    "centred": (0j, 0j),
    "violent": (0j, 5 * TILTED),
    "e = 0, 1 mm/s": (0j, 1e-3 * TILTED),
    "e = 0, 0.5 m/s": (0j, 0.5 * TILTED),
    "grazing, at rest": (1 + 0j, 0j),
    "grazing, 0.5 m/s along": (1 + 0j, 0.5j),
    "grazing, 5 m/s along": (1 + 0j, 5j),
    "grazing, 0.5 m/s into": (1 + 0j, 0.5 + 0j),
    "10 m/s": (0j, 10 * TILTED),
    "30 m/s": (0j, 30 * TILTED),
}


@dataclass(frozen=True)
class Case(AbstractCase):
    """A crusher with clearance in A alone, and a start."""

    crusher: Crusher

    @property
    def peer(self) -> BearingPeer:
        """The crusher of the other programs."""
        return BearingPeer(self.crusher)

    @property
    def values(self) -> dict[str, float | str]:
        """The same as a description."""
        numbers = {name: getattr(self.crusher, field) for name, field in FIELDS.items()}
        return numbers | {"slip": "surface"}

    @property
    def given(self) -> Pins:
        """The start of `GIVEN`."""
        relative, rate = GIVEN[self.start]
        return Pins((relative * self.crusher.clearance,), (rate,))


def cases() -> Iterator[Case]:
    """All of them, axis by axis."""
    for name, axis in AXES.items():
        for start in STARTS:
            for value in axis.values:
                yield Case(name, f"{value:g}", start, axis.crusher(value))
    for start in GIVEN:
        yield Case("start", start, start, BASE)

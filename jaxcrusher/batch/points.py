"""The designs of a sweep or a map: the grid product of named axes."""

import hashlib
import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import jax
import numpy as np

from jaxcrusher.basics.checks import require
from jaxcrusher.files.journal import text_of
from jaxcrusher.mechanism.scene import Scene, require_scene
from jaxcrusher.scenes.machine import AbstractStructure, Machine, OwnFunction, plain, scene_by
from jaxcrusher.scenes.own_laws import with_digests
from jaxcrusher.scenes.parameters import CHOICES, FILES, PARAMETERS, Parameter, check_number


@dataclass(frozen=True)
class Grid:
    """The grid product of `axes`, with every other number and choice as in `base`.

    `axes` maps names to tuples of numbers or of choices, `base` names to values. A curve, a tuple
    of points, counts as a choice. `structure` makes scenes of them.
    """

    axes: dict[str, tuple]
    base: dict[str, float | str | tuple]
    structure: AbstractStructure

    @property
    def shape(self) -> tuple[int, ...]:
        """Return the number of values along each axis."""
        return tuple(len(values) for values in self.axes.values())

    @property
    def size(self) -> int:
        """Return the number of designs."""
        return math.prod(self.shape)

    @property
    def description(self) -> dict[str, Any]:
        """Return the values of every name: a tuple where it varies."""
        return self.base | self.axes

    @property
    def parameters(self) -> Mapping[str, Parameter]:
        """Return unit and meaning of its numbers, as far as they are known."""
        return self.structure.numbers(self.description)

    @property
    def names_of_numbers(self) -> list[str]:
        """Return the names of numbers, those of the package in their usual order."""
        return [name for name in self._ordered(PARAMETERS) if not self.chooses(name)]

    def chooses(self, name: str) -> bool:
        """Return whether a name's values are choices: each of these is a program of its own."""
        value = self.description[name]
        return isinstance(value[0] if name in self.axes else value, str | tuple)

    def _ordered(self, table: Mapping[str, Any]) -> list[str]:
        known = [name for name in table if name in self.description]
        return known + [name for name in self.description if name not in known]

    def numbers(self, designs: Sequence[int] | np.ndarray) -> dict[str, np.ndarray]:
        """Return the numbers of some designs, given by their place in the grid's product.

        Numbers that do not vary are there too: the bits of a design do not depend on what varies.
        """
        places = np.unravel_index(np.asarray(designs), self.shape)
        column = dict(zip(self.axes, places, strict=True))
        return {
            name: np.array(self.axes[name], float)[column[name]]
            if name in column
            else np.full(len(designs), self.base[name], float)
            for name in self.names_of_numbers
        }

    def choices(self, design: int) -> dict[str, Any]:
        """Return the choices of a design."""
        place = dict(zip(self.axes, np.unravel_index(design, self.shape), strict=True))
        return {
            name: self.axes[name][place[name]] if name in place else self.base[name]
            for name in self._ordered(CHOICES)
            if self.chooses(name)
        }

    def alike(self) -> Iterator[tuple[dict[str, Any], list[int]]]:
        """Yield the designs that have the same choices, which one program serves."""
        places = np.stack(np.unravel_index(np.arange(self.size), self.shape))
        choosing = [self.chooses(name) for name in self.axes]
        _, first, group = np.unique(
            places[choosing], axis=1, return_index=True, return_inverse=True
        )
        for number, design in enumerate(first.tolist()):
            yield self.choices(design), np.flatnonzero(group == number).tolist()

    def scene(self, design: int) -> Scene:
        """Return the scene of one design."""
        numbers = {name: float(column[0]) for name, column in self.numbers([design]).items()}
        return scene_by(self.structure, {**numbers, **self.choices(design)})

    def coordinates(self) -> dict[str, tuple[np.ndarray, dict[str, Any]]]:
        """Return the values along each axis, and their labels."""
        known = self.parameters
        labels = {n: {"long_name": of.meaning, "units": of.unit} for n, of in known.items()}
        return {
            name: (np.array(values, object), {})
            if self.chooses(name)
            else (np.array(values, float), labels.get(name, {}))
            for name, values in self.axes.items()
        }

    def settings(self) -> dict[str, Any]:
        """Return what decides which designs these are, as JSON keeps it."""
        kept: dict[str, Any] = {
            "order of axes": list(self.axes),
            "axes": with_digests({name: list(values) for name, values in self.axes.items()}),
            "base": with_digests(self.base),
        }
        if isinstance(self.structure, OwnFunction):
            kept["scene"] = f"{self.structure.name} {self._digest()}"
        return kept | self.structure.record

    def attributes(self) -> dict[str, Any]:
        """Return what does not vary, for the reader of a dataset."""
        known = self.parameters
        numbers = {
            name: [value, known[name].unit if name in known else None]  # one's own: not known
            for name, value in self.base.items()
            if not self.chooses(name)
        }
        choices = {name: value for name, value in self.base.items() if self.chooses(name)}
        return {"parameters": numbers, "choices": choices}

    def _digest(self) -> str:
        """Return a digest of the first and of the last scene: of its laws and of all numbers."""
        digest = hashlib.sha256()
        for design in (0, self.size - 1):
            leaves, tree = jax.tree.flatten(self.scene(design))
            digest.update(text_of(tree).encode())
            digest.update(b"".join(np.asarray(leaf).tobytes() for leaf in leaves))
        return digest.hexdigest()[:16]


def make_grid(machine: Machine, axes: Mapping[str, Any]) -> Grid:
    """Return the checked grid of the machines with the values of some axes.

    Raises ValueError for unknown names, and for values that no scene can be built from. The names
    that a user's own function takes are known to it only.
    """
    good = isinstance(axes, Mapping) and len(axes) > 0 and all(isinstance(n, str) for n in axes)
    require(good, "axes", 'map names to values, as {"speed": [30.0, 32.0]}', repr(axes))
    structure, varied = machine.structure, {n: _axis(n, values) for n, values in axes.items()}
    given = {name: value for name, value in machine.given.items() if name not in varied}
    idle = structure.idle({**given, **varied})
    for name in varied:
        require(name not in idle, "axes", "name numbers of the motion", name)
    fixed = {}
    for name, value in given.items():
        if name not in idle:
            text = isinstance(value, str | Path)
            fixed[name] = plain(value if text else _numbers(name, value, 2 * (name in FILES)))
    grid = Grid(varied, structure.beside(fixed, varied), structure)
    some = len(grid.names_of_numbers) > 0
    require(some, "axes", "hold a number, such as the speed, where the machine has none", "without")
    known = grid.parameters
    for name in varied:
        if name in known and known[name].whole:
            check_number(name, np.array(varied[name]), known)
    # All other limits are intervals, and what keeps off the dead points is convex: the grid's
    # corners speak for what lies between.
    ends = [
        values if grid.chooses(name) else {min(values), max(values)}
        for name, values in varied.items()
    ]
    for corner in itertools.product(*ends):
        made = {**grid.base, **dict(zip(varied, corner, strict=True))}
        require_scene(scene_by(structure, made))
    return grid


def _axis(name: str, values: Any) -> tuple:
    called, array = f"axes[{name!r}]", np.asarray(values, object)
    if not all(isinstance(one, str | Path) for one in array.flat):
        array = _numbers(called, values, 1)
    good = array.ndim == 1 and array.size > 0
    require(good, called, "have shape (n,), n > 0", f"of shape {array.shape}")
    axis = tuple(str(one) if isinstance(one, Path) else one for one in array.tolist())
    require(len(set(axis)) == len(axis), called, "hold every value once", values)
    return axis


def _numbers(called: str, values: Any, dimensions: int) -> np.ndarray:
    try:
        array = np.asarray(values, dtype=float)
    except (TypeError, ValueError):
        array = np.array(np.nan)
    good = array.ndim == dimensions and bool(np.all(np.isfinite(array)))
    must = "be " + ("a finite number", "a row of finite numbers", "rows of numbers")[dimensions]
    require(good, called, must, repr(values))
    return array

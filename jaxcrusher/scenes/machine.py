"""A machine: its structure, its numbers and choices by name, and the scenes that they make."""

import abc
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from typing_extensions import override

from jaxcrusher.basics.checks import require, require_known
from jaxcrusher.files.results import tell
from jaxcrusher.files.summary import Row, Summarised, Summary
from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.scenes.parameters import DRAWN_IN, NUMBERS, Parameter
from jaxcrusher.scenes.units import said


class AbstractStructure(abc.ABC):
    """A machine without its numbers and choices; structures that are equal share programs.

    A subclass is a frozen dataclass whose fields can be hashed.
    """

    @abc.abstractmethod
    def complete(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Return numbers and choices, with defaults for missing ones.

        Raises ValueError of one line for an unknown name, for a name without the one that it comes
        with, and for a number that is missing.
        """

    @abc.abstractmethod
    def scene(self, values: Mapping[str, Any]) -> Scene:
        """Return the scene of numbers, which may be traced, and choices.

        A number that only `jax.jit` knows and that lies outside its limits becomes NaN. Raises
        ValueError of one line as `complete` does, and for what is outside its limits.
        """

    @abc.abstractmethod
    def numbers(self, values: Mapping[str, Any]) -> Mapping[str, Parameter]:
        """Return unit, meaning and limits of the numbers that a machine with these values may have.

        They include the numbers of your own laws that the values name.
        """

    def choices(self, values: Mapping[str, Any]) -> Mapping[str, tuple[str, ...]]:
        """Return what may be chosen, by name."""
        return {}

    @property
    def record(self) -> dict[str, str]:
        """Return what besides numbers and choices decides a motion, as results keep it."""
        return {}

    def unusual(self, values: Mapping[str, Any]) -> list[str]:
        """Return unlikely numbers, a line each; ValueError for impossible ones."""
        return []

    def borrowed(self, given: Mapping[str, Any]) -> list[str]:
        """Return which numbers of a machine are taken from another one unless they are given."""
        return []

    def left_open(self, machine: "Machine") -> list[str]:
        """Return what a file leaves open, a sentence each, to be printed after the file's name."""
        return []

    def about(self, machine: "Machine") -> dict[str, str]:
        """Return what a sheet tells of a machine, by its title."""
        return {}

    def idle(self, values: Mapping[str, Any]) -> set[str]:
        """Return the names that no motion depends on; a value may be a tuple of several."""
        return set()

    def beside(
        self, fixed: Mapping[str, Any], varied: Mapping[str, tuple[Any, ...]]
    ) -> dict[str, Any]:
        """Return the values that all designs of a grid share, with defaults."""
        first = {name: values[0] for name, values in varied.items()}
        return {n: v for n, v in self.complete({**fixed, **first}).items() if n not in varied}


@dataclass(frozen=True)
class OwnFunction(AbstractStructure):
    """A function of one's own that makes a scene of numbers and choices by name.

    A number that has the name of one of the package's has its unit and its limits.
    """

    function: Callable[..., Scene]

    @property
    def name(self) -> str:
        """Return the name of the function, or of its class."""
        return getattr(self.function, "__qualname__", type(self.function).__qualname__)

    @override
    def complete(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Return the values: the function alone knows what it needs."""
        return dict(values)

    @override
    def scene(self, values: Mapping[str, Any]) -> Scene:
        return self.function(**values)

    @override
    def numbers(self, values: Mapping[str, Any]) -> Mapping[str, Parameter]:
        """Return the numbers of the package that have these names."""
        return {name: NUMBERS[name] for name in values if name in NUMBERS}


def plain(value: Any) -> float | str | tuple:
    """Return a value as a key of stored programs: a number, a text, or a curve as its points."""
    if isinstance(value, str | Path):
        return str(value)
    array = np.asarray(value, float)
    return tuple(map(tuple, array.tolist())) if array.ndim else float(array)


def scene_by(structure: AbstractStructure, values: Mapping[str, Any]) -> Scene:
    """Return the scene of numbers, which may be traced, and choices, a curve as a tuple."""
    described = {n: np.array(one) if isinstance(one, tuple) else one for n, one in values.items()}
    return structure.scene(described)


@dataclass(frozen=True)
class Family:
    """The scenes of a machine over some of its numbers: a function that equals its copies."""

    structure: AbstractStructure
    names: tuple[str, ...]
    fixed: tuple[tuple[str, Any], ...]  # a curve as a tuple of points

    def __call__(self, values: Float[Array, "..."]) -> Scene:
        """Return the scene of these numbers, in the order of the names; of one, a scalar too."""
        numbers = dict(zip(self.names, jnp.reshape(values, -1), strict=True))
        return scene_by(self.structure, {**dict(self.fixed), **numbers})


@dataclass(frozen=True, eq=False, repr=False)
class Machine(Summarised):
    """A structure with its numbers and choices, as a file describes it.

    `machine.scene()` is its scene, `machine.scene(speed=300.0)` the scene of other numbers, which
    may be traced, and `machine.replace(start="contact")` another machine. `given` are the numbers
    (SI units) and choices that were given; `written` has the units that they were written in, by
    name, and `defaults` the names of numbers that a file left open.
    """

    structure: AbstractStructure
    given: Mapping[str, Any] = field(default_factory=dict)
    written: dict[str, str] = field(default_factory=dict)
    defaults: tuple[str, ...] = ()

    @cached_property
    def values(self) -> dict[str, Any]:
        """Return all numbers and choices, with the defaults of those that were not given."""
        return self.structure.complete(self.given)

    @cached_property
    def numbers(self) -> Mapping[str, Parameter]:
        """Return unit, meaning and limits of the numbers that it may be given, by name."""
        return self.structure.numbers(self.given)

    @cached_property
    def choices(self) -> Mapping[str, tuple[str, ...]]:
        """Return what may be chosen, by name."""
        return self.structure.choices(self.given)

    @cached_property
    def units(self) -> dict[str, str]:
        """Return the units that its numbers are shown in: those written, and of its own numbers."""
        own = {n: one.unit for n, one in self.numbers.items() if n not in NUMBERS}
        drawn = {n: DRAWN_IN.get(of, (1.0, of))[1] for n, of in own.items() if of != "1"}
        return drawn | self.written

    @override
    def _summary(self) -> Summary:
        known, given = self.numbers, len(self.given)
        named = {**self.given, **self.values}  # what was given stands first
        rows = []
        for name, value in named.items():
            curve = f"a curve of {len(value)} points" if np.ndim(value) else ""
            text = curve or said(
                name, value if isinstance(value, str) else float(value), self.units
            )
            rows.append(Row(name, text, known[name].meaning if name in known else ""))
        title = f"Machine, a {type(self.structure).__name__}: {given} numbers and choices given"
        return Summary(f"{title}, {len(named) - given} by default", rows)

    @override
    def _picture(self) -> str:
        return self.scene()._picture()

    def scene(self, **values: Any) -> Scene:
        """Return the scene of these numbers and choices; all others are the machine's own.

        Raises ValueError of one line for an unknown name and for what is outside its limits.
        """
        return self.structure.scene({**self.given, **values})

    def unusual(self) -> list[str]:
        """Return its unlikely numbers, a line each; ValueError for impossible ones."""
        return self.structure.unusual(self.values)

    def require_possible(self, axes: Mapping[str, Sequence[Any]]) -> None:
        """Raise ValueError as `unusual` does, at either end of each axis, one at a time."""
        for name, values in axes.items():
            for end in (values[0], values[-1]):
                self.replace(**{name: end}).unusual()

    def over(self, *names: str) -> Family:
        """Return its scenes as a function of some numbers, whose own values do not matter.

        Raises ValueError for a name that it does not have.
        """
        if not isinstance(self.structure, OwnFunction):
            for name in names:
                require_known(name, self.numbers)
        fixed = {name: plain(one) for name, one in self.values.items() if name not in names}
        return Family(self.structure, names, tuple(fixed.items()))

    def number(self, name: str) -> float:
        """Return the value of a number; ValueError for a name that has none."""
        single = {key: one for key, one in self.values.items() if np.ndim(one) == 0}
        numbers = {key: one for key, one in single.items() if not isinstance(one, str)}
        require(len(numbers) > 0, name, "have a value, as {name: value}", "a name alone")
        require_known(name, numbers)
        return float(numbers[name])

    def replace(self, **values: Any) -> "Machine":
        """Return the machine with other numbers and choices; ValueError as `complete` does."""
        left = tuple(name for name in self.defaults if name not in values)
        made = Machine(self.structure, {**self.given, **values}, self.written, left)
        assert made.values is not None  # asked for now, so that errors come here
        return made


def machine_of(machine: Machine | Callable[..., Scene]) -> Machine:
    """Return a machine; a plain function of named numbers that makes scenes becomes one.

    Raises ValueError for anything else.
    """
    if isinstance(machine, Machine):
        return machine
    must = (
        "be a machine, such as jaxcrusher.paper_machine() makes it, or a function that makes a "
        "scene of numbers by name"
    )
    require(callable(machine), "machine", must, f"a {type(machine).__name__}")
    return Machine(OwnFunction(machine))


def tell_about(machine: Machine, path: Path | None) -> None:
    """Print on standard error what is unusual in a machine, and what its file leaves open.

    Raises ValueError for numbers that cannot be.
    """
    for line in machine.unusual():
        tell(f"unusual: {line}")
    for line in () if path is None else machine.structure.left_open(machine):
        tell(f"{path} {line}")

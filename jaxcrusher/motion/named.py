"""Results by name."""

import abc
from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Array

from jaxcrusher.basics.checks import concrete

# What may be asked for by name, each with its `unit`.
Known = tuple[tuple[str, Any], ...]


class MadeOf(property):
    """A property of a result, there only where what it is made of may be asked for."""

    needed: str

    def __get__(self, result: Any, kind: type | None = None) -> Any:
        """Return its value; AttributeError where it is not there."""
        if result is not None and self.needed not in result.units():
            raise AttributeError
        return super().__get__(result, kind)


def made_of(needed: str) -> Callable[[Callable[[Any], Array]], Any]:
    """Make a property of a method that needs something of this name."""

    def made(method: Callable[[Any], Array]) -> MadeOf:
        found = MadeOf(method)
        found.needed = needed
        return found

    return made


class AbstractNamed(abc.ABC):
    """Arrays by name: `result.x` or `result["x"]`, for every x of `values`.

    What was not asked for raises AttributeError or KeyError, which say so. `print(result)` shows
    what there is, with its units.
    """

    values: Mapping[str, Any]  # a field of the module that inherits

    @abc.abstractmethod
    def units(self) -> Mapping[str, str]:
        """The names that may be asked for, and their units."""

    @property
    @abc.abstractmethod
    def success(self) -> Any:
        """Whether the numbers mean something; one, or one for each of a batch."""

    @property
    @abc.abstractmethod
    def failure(self) -> str:
        """Why they do not, or nothing (one result with concrete values only)."""

    def __iter__(self) -> Iterator[str]:
        return iter(self.values)

    def __getitem__(self, name: str) -> Any:
        if name not in self.values:
            raise KeyError(self._missing(name))
        return self.values[name]

    # A type checker takes the names from `jaxcrusher.motion.names`, and so sees a misspelt one.
    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> Array:
            # `values` is missing while an object is being made, unpickled or copied.
            if name.startswith("__") or name == "values":
                raise AttributeError(name)
            if name not in self.values:
                raise AttributeError(self._missing(name))
            return self.values[name]

    def __dir__(self):
        return [*filter(self._offers, super().__dir__()), *self.values]

    def __str__(self) -> str:
        """A line for each name, and first what failed."""
        known = concrete(self.success)
        why = self.failure if known is not None and known.ndim == 0 else ""
        lines = [f"{type(self).__name__}: {why}" if why else type(self).__name__]
        width, units = max(map(len, self.values), default=0), self.units()
        for name, value in self.values.items():
            unit = "" if units[name] == "1" else f" {units[name]}"
            lines.append(f"  {name:{width}} {_shown(value)}{unit}")
        return "\n".join(lines)

    def _offers(self, name: str) -> bool:
        found = getattr(type(self), name, None)
        return not isinstance(found, MadeOf) or found.needed in self.units()

    def _missing(self, name: str) -> str:
        if name in self.units():
            return f"`{name}` was not asked for: name it in `outputs`."
        return f"There is no `{name}`, but {', '.join(self.values)}."


def _shown(value: Any) -> str:
    """A number; of more its shape, of a module its name."""
    shape = getattr(value, "shape", None)
    if shape is None:
        return type(value).__name__
    known = concrete(value)
    return f"{np.asarray(known).item():.10g}" if known is not None and not shape else f"{shape}"

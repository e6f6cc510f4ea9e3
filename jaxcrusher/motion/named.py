"""Results by name."""

import abc
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Array
from typing_extensions import override

from jaxcrusher.files.summary import Row, Summarised, Summary, value_text

# What may be asked for by name, each with its `unit`.
Known = tuple[tuple[str, Any], ...]


class MadeOf(property):
    """A property of a result, there only if the quantity that it needs may be asked for."""

    needed: str

    @override
    def __get__(self, result: Any, kind: type | None = None) -> Any:
        """Return its value; AttributeError where it is not there."""
        if result is not None and self.needed not in result.units():
            raise AttributeError
        return super().__get__(result, kind)


def made_of(needed: str) -> Callable[[Callable[[Any], Array]], Any]:
    """Make a property from a method that needs the quantity of this name."""

    def made(method: Callable[[Any], Array]) -> MadeOf:
        found = MadeOf(method)
        found.needed = needed
        return found

    return made


class AbstractNamed(Summarised):
    """Arrays by name: `result.x` or `result["x"]`, for every x of `values`.

    A name that was not asked for raises AttributeError or KeyError, whose message says so. The
    result at a prompt, or `print(result)`, shows its values with their units.
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
        """Why the numbers mean nothing, if so (one result with concrete values only)."""

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

    @override
    def __dir__(self):
        return [*filter(self._offers, super().__dir__()), *self.values]

    def _entries(self) -> Mapping[str, Any]:
        """Return what is known of names: their `unit` and `meaning`."""
        return {}

    @property
    def _is_one(self) -> bool:
        """Whether it is one result, which has not failed."""
        good = np.asarray(self.success)
        return not good.ndim and bool(good)

    def _headline(self) -> str:
        """Say what it is, if it is one and has not failed."""
        return ""

    def _counted(self) -> Mapping[str, Any]:
        """Return what is true of some of a batch, by the word for it."""
        return {}

    def _rows(self) -> list[Row]:
        """Return a row for each name that was asked for, in the order of all that may be."""
        return self._rows_of(self._told)

    @property
    def _told(self) -> list[str]:
        # JAX sorts the names of `values`.
        return [name for name in self.units() if name in self.values]

    def _rows_of(self, names: Iterable[str], errors: Mapping[str, Any] = {}) -> list[Row]:
        units, entries = self.units(), self._entries()
        return [
            Row(
                name,
                value_text(self.values[name], units[name], errors.get(name, np.nan)),
                getattr(entries.get(name), "meaning", ""),
            )
            for name in names
        ]

    def _remarks(self) -> list[str]:
        """Return what else is said of one that has not failed."""
        return []

    @override
    def _summary(self) -> Summary:
        kind, good = type(self).__name__, np.asarray(self.success)
        if good.ndim:
            counts = {"FAILED": ~good, **self._counted()}
            told = ", ".join(f"{np.sum(which)} {word}" for word, which in counts.items())
            return Summary(f"{kind}, a batch of {good.size}: {told}", self._rows())
        if not good:
            return Summary(f"{kind} FAILED: {self.failure}")
        return Summary(f"{kind}: {self._headline()}", self._rows(), self._remarks())

    def _offers(self, name: str) -> bool:
        found = getattr(type(self), name, None)
        return not isinstance(found, MadeOf) or found.needed in self.units()

    def _missing(self, name: str) -> str:
        if name in self.units():
            return f"`{name}` was not asked for: name it in `outputs`."
        return f"There is no `{name}`, but {', '.join(self.values)}."

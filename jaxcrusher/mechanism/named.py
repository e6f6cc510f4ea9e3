"""Values of parts by their names, such as those of joints or bodies."""

from collections.abc import Callable, Iterator, Mapping
from typing import Any, Generic, TypeVar

import equinox as eqx

from jaxcrusher.basics.record import Record

T = TypeVar("T")


class Named(Record, Generic[T]):
    """A value of one kind at each of some names, in a fixed order; None at every other name."""

    names: tuple[str, ...] = eqx.field(static=True)
    # None where there are none: Equinox takes all empty tuples of a PyTree for one.
    present: tuple[T, ...] | None

    def __init__(self, values: Mapping[str, T] | None = None):
        known = {name: one for name, one in (values or {}).items() if one is not None}
        self.names, self.present = tuple(known), tuple(known.values()) or None

    @property
    def values(self) -> tuple[T, ...]:
        """Return the values, in the order of the names."""
        return self.present or ()

    def __getitem__(self, name: str) -> T | None:
        return self.values[self.names.index(name)] if name in self.names else None

    def at(self, name: str) -> T:
        """Return the value at a name that has one."""
        found = self[name]
        assert found is not None, name
        return found

    def __contains__(self, name: str) -> bool:
        return name in self.names

    def __len__(self) -> int:
        return len(self.names)

    def items(self) -> Iterator[tuple[str, T]]:
        """Yield names and values."""
        return zip(self.names, self.values, strict=True)

    def map(self, function: Callable[..., Any], *others: "Named[Any]") -> "Named[Any]":
        """Return `function` of the values at each name, in this and in others."""
        found = {n: function(one, *(other[n] for other in others)) for n, one in self.items()}
        return Named(found)

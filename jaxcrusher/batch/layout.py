"""The table of a grid of designs: its columns, and the chunks in which it is filled."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import xarray as xr

from jaxcrusher.batch.points import Grid
from jaxcrusher.files.table import Column, dataset


@dataclass(frozen=True)
class Layout:
    """Columns over a grid of designs, in chunks of one shape.

    `chunk` is the shape of a chunk: one choice, or some of the numbers, of each axis. `further` has
    the labels of the columns' own dims, or their sizes where they have no labels.
    """

    grid: Grid
    columns: Mapping[str, Column]
    chunk: tuple[int, ...]
    further: Mapping[str, np.ndarray | int] = field(default_factory=dict)

    @property
    def chunks(self) -> tuple[int, ...]:
        """Return the number of chunks along each axis."""
        return tuple(-(-n // m) for n, m in zip(self.grid.shape, self.chunk, strict=True))

    @property
    def count(self) -> int:
        """Return the number of chunks."""
        return math.prod(self.chunks)

    def name(self, number: int) -> str:
        """Return where a chunk lies among the chunks, as "0.2"."""
        return ".".join(map(str, np.unravel_index(number, self.chunks)))

    def region(self, number: int) -> tuple[slice, ...]:
        """Return the designs of a chunk along each axis; the last ones may be fewer."""
        places = np.unravel_index(number, self.chunks)
        sizes = zip(map(int, places), self.chunk, self.grid.shape, strict=True)
        return tuple(slice(i * m, min((i + 1) * m, n)) for i, m, n in sizes)

    def size(self, number: int) -> int:
        """Return the number of designs in a chunk."""
        return math.prod(part.stop - part.start for part in self.region(number))

    def designs(self, number: int) -> np.ndarray:
        """Return the designs of a chunk, in an array of the shape of its region."""
        places = np.ix_(*(np.arange(part.start, part.stop) for part in self.region(number)))
        return np.ravel_multi_index(places, self.grid.shape)

    def coordinates(self) -> dict[str, tuple[str, np.ndarray, dict[str, Any]]]:
        """Return the values along each axis and dim that has labels."""
        found = {name: (name, *rest) for name, rest in self.grid.coordinates().items()}
        labels = {n: v for n, v in self.further.items() if not isinstance(v, int)}
        return found | {name: (name, values, {}) for name, values in labels.items()}

    def inner(self, column: Column) -> tuple[int, ...]:
        """Return the shape of one design's value."""
        sizes = (self.further[dim] for dim in column.dims)
        return tuple(size if isinstance(size, int) else len(size) for size in sizes)

    def dataset(self, values: Mapping[str, np.ndarray], attributes: Mapping[str, Any]):
        """Return the table; the values have the shape of the grid, and then the column's own."""
        return dataset(tuple(self.grid.axes), values, self.columns, self.coordinates(), attributes)


class Memory:
    """A table in the memory, filled chunk by chunk as a `ChunkStore` is."""

    journal = None

    def __init__(self, layout: Layout, attributes: Mapping[str, Any]):
        self._layout, self._attributes = layout, attributes
        self.done: set[int] = set()
        self._values = {
            name: np.full(
                (*layout.grid.shape, *layout.inner(column)),
                column.missing,
                dtype=object if column.kind is str else column.kind,
            )
            for name, column in layout.columns.items()
        }

    def write(self, number: int, values: Mapping[str, np.ndarray], record: Any) -> None:
        """Keep the values of a chunk; its record is not kept."""
        for name, column in self._values.items():
            column[self._layout.region(number)] = values[name]
        self.done.add(number)

    def dataset(self) -> xr.Dataset:
        """Return the table as it is now."""
        return self._layout.dataset(self._values, self._attributes)


def chunk_shape(grid: Grid, designs: int) -> tuple[int, ...]:
    """Return the shape of chunks of at most `designs` designs.

    They hold whole last axes as far as they fit, an even part of the next, and single values of
    those before.
    """
    shape = []
    for name, values in reversed(grid.axes.items()):
        # Another choice is another program.
        parts = len(values) if grid.chooses(name) else -(-len(values) // designs)
        shape.append(-(-len(values) // parts))
        designs = max(1, designs // shape[-1])
    return tuple(reversed(shape))

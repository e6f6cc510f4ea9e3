"""The table of a grid of designs, filled chunk by chunk: in memory, or in a Zarr store.

A killed run leaves a store whole. A chunk of the table is there one Zarr chunk, one file, of each
column. Its marker, a small JSON file with the files' checksums, is put in place after them by an
atomic rename: without a marker the chunk does not exist, whatever lies in the store.
"""

import contextlib
import hashlib
import json
import math
import os
import warnings
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from jaxcrusher.basics.checks import require
from jaxcrusher.batch.points import Grid
from jaxcrusher.files.durable import broken, checksum, lock, named, replace
from jaxcrusher.files.journal import Journal
from jaxcrusher.files.provenance import environment, provenance
from jaxcrusher.files.resume import require_same
from jaxcrusher.files.table import Column, dataset

_SIDE = ".sweep"  # the folder of settings, markers and the lock, inside the store


@dataclass(frozen=True)
class Layout:
    """Columns over a grid of designs, in chunks of one shape.

    `chunk` is the shape of a chunk: one choice, or some of the numbers, of each axis. `further` has
    the labels of the columns' own dims, or their sizes where they have no labels.
    """

    grid: Grid
    columns: Mapping[str, Column]
    chunk: tuple[int, ...]
    labels_of_dims: Mapping[str, np.ndarray | int] = field(default_factory=dict)

    def __post_init__(self):
        own = {*self.columns, *(dim for column in self.columns.values() for dim in column.dims)}
        for name in self.grid.axes:
            require(name not in own, "axes", "name none of the results' own columns and dims", name)

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
        labels = {n: v for n, v in self.labels_of_dims.items() if not isinstance(v, int)}
        return found | {name: (name, values, {}) for name, values in labels.items()}

    def inner(self, column: Column) -> tuple[int, ...]:
        """Return the shape of one design's value."""
        sizes = (self.labels_of_dims[dim] for dim in column.dims)
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


class ChunkStore:
    """A locked store, its settings compared and its finished chunks verified.

    Raises RuntimeError if another run holds the store or something finished is corrupt,
    ValueError if the store was made with other settings, and OSError if it cannot be written.
    """

    def __init__(
        self, path: Path, layout: Layout, settings: dict[str, Any], attributes: dict[str, Any]
    ):
        self.path, self._layout = path, layout
        # Of work that leads to chunks, where that takes long.
        self.journal = Journal(path / _SIDE / "journal")
        self._digest = hashlib.sha256(_json(settings)).hexdigest()
        side = path / _SIDE
        if path.is_file() or (path.is_dir() and not side.is_dir() and any(path.iterdir())):
            raise ValueError(
                f"Argument `store` must be new or one of an earlier call, but {path} is neither."
            )
        with named(f"The store {path} could not be made"):
            (side / "done").mkdir(parents=True, exist_ok=True)
            self._lock = lock(side / "lock", f"The store {path}")
            try:
                # What a killed run left half written.
                for leftover in path.rglob("*.partial*"):
                    leftover.unlink()
                if not (side / "settings.json").exists():
                    self._create(settings, attributes)
                self._check_settings(settings)
                self.done = self._verified()
            except BaseException:
                os.close(self._lock)
                raise

    def __enter__(self) -> "ChunkStore":
        return self

    def __exit__(self, *_: object) -> None:
        os.close(self._lock)

    def write(self, number: int, values: dict[str, np.ndarray], record: dict[str, Any]) -> None:
        """Write a chunk and then its marker; an OSError names the chunk."""
        what = (
            f"Chunk {self._layout.name(number)} of {self.path} could not be written; "
            f"the {len(self.done)} finished chunks are safe"
        )
        import zarr  # takes a third of a second

        with named(what):
            group = zarr.open_group(self.path, mode="r+")
            # Also chunks that are all False: every finished chunk has all its files.
            with zarr.config.set({"array.write_empty_chunks": True}):
                for name in self._layout.columns:
                    group[name][self._layout.region(number)] = values[name]  # pyright: ignore
            marker = {"settings": self._digest, "sha256": self._checksums(number), **record}
            replace(self._marker(number), _json(marker))
        self.done.add(number)
        if len(self.done) == self._layout.count:
            self.journal.discard()

    def dataset(self) -> xr.Dataset:
        """Open the table."""
        return xr.open_zarr(self.path)

    def _marker(self, number: int) -> Path:
        return self.path / _SIDE / "done" / f"{self._layout.name(number)}.json"

    def _checksums(self, number: int) -> dict[str, str]:
        """The checksums of a chunk's files, which are on the disk when this returns."""
        chunk = self._layout.name(number)
        names = [
            f"{name}/c.{chunk}" + ".0" * len(column.dims)
            for name, column in self._layout.columns.items()
        ]
        return {name: checksum(self.path / name, sync=True) for name in names}

    def _verified(self) -> set[int]:
        """The finished chunks, each file read and compared with its checksum."""
        done, corrupt = set(), []
        for number in range(self._layout.count):
            marker = self._marker(number)
            if not marker.exists():
                continue
            fault = self._fault(marker)
            done.add(number)
            if fault:
                corrupt.append(f"chunk {self._layout.name(number)} ({fault}; delete {marker})")
        if corrupt:
            raise RuntimeError(
                f"{len(corrupt)} of {len(done)} finished chunks of {self.path} are corrupt: "
                f"{', '.join(corrupt)}. Delete what is named and start again: nothing else is "
                "computed again."
            )
        return done

    def _fault(self, marker: Path) -> str:
        try:
            kept = json.loads(marker.read_bytes())
            checksums, digest = dict(kept["sha256"]), kept["settings"]
        except (ValueError, KeyError, TypeError):
            return "its marker is not readable"
        if digest != self._digest:
            return "its marker belongs to other settings"
        return broken(self.path, checksums)

    def _create(self, settings: dict[str, Any], attributes: dict[str, Any]) -> None:
        """Metadata and coordinates, made aside and moved in; settings.json says all are there."""
        import zarr

        layout, side = self._layout, self.path / _SIDE
        made = side / "new"
        group = zarr.create_group(made, overwrite=True, zarr_format=3, attributes=attributes)
        for name, (dim, values, labels) in layout.coordinates().items():
            array = group.create_array(
                name,
                shape=values.shape,
                dtype="str" if values.dtype == object else "float64",
                chunks=values.shape,
                dimension_names=(dim,),
                attributes={**labels},
            )
            array[:] = values
        for name, column in layout.columns.items():
            inner = layout.inner(column)
            group.create_array(
                name,
                shape=(*layout.grid.shape, *inner),
                chunks=(*layout.chunk, *inner),
                dtype="str" if column.kind is str else np.dtype(column.kind),
                fill_value=column.missing,
                dimension_names=(*layout.grid.axes, *column.dims),
                chunk_key_encoding={"name": "default", "separator": "."},
                attributes={**column.labels},
            )
        with warnings.catch_warnings():
            # Consolidated metadata is not yet in the text of Zarr 3; xarray asks for it.
            warnings.simplefilter("ignore")
            zarr.consolidate_metadata(made)
        files = [file for file in sorted(made.rglob("*")) if file.is_file()]
        checksums = {}
        for file in files:
            name = str(file.relative_to(made))
            checksums[name] = checksum(file, sync=True)
            (self.path / name).parent.mkdir(parents=True, exist_ok=True)
            os.replace(file, self.path / name)
        kept = {"settings": settings, "sha256": checksums}
        replace(side / "settings.json", _json(kept))

    def _check_settings(self, settings: dict[str, Any]) -> None:
        file = self.path / _SIDE / "settings.json"
        try:
            kept = json.loads(file.read_bytes())
            checksums, before = dict(kept["sha256"]), dict(kept["settings"])
            fault = broken(self.path, checksums)
        except (ValueError, KeyError, TypeError, AttributeError):
            fault, checksums, before = "its settings are not readable", {}, {}
        own = {name.partition("/")[0] for name in checksums}
        there = {metadata.parent.name for metadata in self.path.glob("*/zarr.json")}
        if fault and own and there - own:
            added = ", ".join(str(self.path / name) for name in sorted(there - own))
            raise ValueError(
                f"Argument `store` must hold its own variables alone, but {added} was added, which "
                f"changed the metadata. Move that elsewhere, delete {file} and start again: the "
                "metadata are written anew, and finished chunks are kept."
            )
        if fault:
            raise RuntimeError(
                f"The store {self.path} is corrupt ({fault}). Delete {file} and start again: it is "
                "written anew, and no finished chunk is computed again."
            )
        then, here = before.get("engine"), settings.get("engine")
        if then != here and isinstance(then, str):
            # As on another kind of device, whose bits and chunks differ.
            raise ValueError(
                f"Argument `engine` must be {then!r} for the store {self.path}, which that engine "
                f"began, but is {here!r} here."
            )
        require_same(self.path, before, json.loads(_json(settings)), "store")


def _json(content: dict[str, Any]) -> bytes:
    return json.dumps(content, indent=1).encode()


@contextlib.contextmanager
def opened(
    layout: Layout,
    store: str | Path | None,
    title: str,
    settings: Mapping[str, Any],
    about: Mapping[str, Any],
    program: dict[str, Any] | None = None,
) -> Iterator[Memory | ChunkStore]:
    """Open the table: in memory, or the store at a path, whose settings must be the same.

    `about` is told in the attributes, and `program` is the `environment` that computes.
    """
    program = environment() if program is None else program
    attributes = provenance(title, program, **layout.grid.attributes(), **about)
    if store is None:
        yield Memory(layout, attributes)
        return
    attributes["machine"] += "; that of each chunk stands in .sweep/done"
    with ChunkStore(Path(store), layout, {**settings, **program}, attributes) as kept:
        yield kept

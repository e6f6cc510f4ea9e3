"""Tables of results: the unit and meaning of every column, the dataset they stand in, and CSV."""

import csv
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

if TYPE_CHECKING:
    import xarray as xr


class Column(NamedTuple):
    """A named number of every case of a table."""

    unit: str
    meaning: str
    kind: type = float  # or bool, or str
    dims: tuple[str, ...] = ()  # of one case's value; none of a scalar

    @property
    def missing(self) -> Any:
        """Return the value that marks a missing one."""
        return {bool: False, str: "", int: 0}.get(self.kind, np.nan)

    @property
    def labels(self) -> dict[str, str]:
        """Return the attributes of the column in a dataset."""
        return {"units": self.unit, "long_name": self.meaning}


# Every column of the tables that is no statistic of a scene.
COLUMNS = {
    # of a motion that was integrated
    "half_width_ratio": Column("1", "Hertz's half-width / radius of bore or roller"),
    "impact_speed_ratio": Column("1", "fastest approach / elastic limit"),
    "delivered_restitution": Column("1", "restitution of the fastest impact"),
    "inside_model": Column("1", "narrow clearance, Hertzian contact, elastic impacts", bool),
    "whirl": Column("1", "friction whirl", bool),
    "success": Column("1", "solved, or integrated to the end", bool),
    "reached": Column("rad", "phase (2 pi a turn) at the end, or at the failure"),
    "steps": Column("1", "integration steps"),
    "state": Column("1, m/s", "state at the end, as in Section", dims=("coordinate",)),
    # of a periodic orbit
    "error": Column("1", "estimated error of the RMS, as a share of it"),
    "least_penetration": Column("1", "least penetration / clearance"),
    "largest_multiplier": Column("1", "largest modulus of the Floquet multipliers"),
    "multipliers_error": Column("1", "estimated error of the multipliers' moduli"),
    "settling_turns": Column("1", "turns in which a disturbance falls to 1/e"),
    "stable": Column("1", "disturbances are known to die", bool),
    "undecided": Column("1", "not known if disturbances die", bool),
    "unstable": Column("1", "Floquet multipliers outside of the unit circle", int),
    "failure": Column("1", "why there is no orbit", str),
    "found": Column("1", "the way by which the orbit was found", str),
    "motion": Column("1", "the motion from rest, where no orbit is stable", str),
    "run_rms": Column("N", "RMS over turns of that motion"),
    "run_rms_error": Column("N", "standard error of that RMS"),
    "multiplier_real": Column("1", "real: Floquet multipliers", dims=("multiplier",)),
    "multiplier_imag": Column("1", "imag: Floquet multipliers", dims=("multiplier",)),
    # of the motions that random starts come to
    "worst_rms": Column("N", "RMS of the loudest orbit that a start comes to"),
    "likeliest_rms": Column("N", "RMS of the orbit that most starts come to"),
    "unsettled": Column("1", "share of starts that come to no orbit"),
    "share": Column("1", "share of starts that come to the orbit", dims=("orbit",)),
    "share_error": Column("1", "standard error of the share", dims=("orbit",)),
    "orbit_rms": Column("N", "RMS of the orbit", dims=("orbit",)),
    "orbit_period": Column("1", "turns of the orbit, 0 if there is none", int, ("orbit",)),
    "label": Column("1", "orbit that the start comes to, -1: none", int, ("start",)),
    "start_state": Column("1, m/s", "section point of the start", dims=("start", "coordinate")),
    # of section points
    "e_x": Column("1", "e_x / clearance", dims=("turn",)),
    "e_y": Column("1", "e_y / clearance", dims=("turn",)),
    "rate_x": Column("m/s", "de_x/dt", dims=("turn",)),
    "rate_y": Column("m/s", "de_y/dt", dims=("turn",)),
    "settled": Column("1", "the motion has settled, as far as its turns tell", bool),
    "period": Column("1", "turns until the points repeat, 0 if they do not", int),
}


def columns_of(entries: Mapping[str, Any], names: Iterable[str]) -> dict[str, Column]:
    """Return the columns of some of several entries that have a unit and a meaning."""
    return {name: Column(entries[name].unit, entries[name].meaning) for name in names}


def vector_columns(entries: Mapping[str, Any], values: Mapping[str, Any]) -> dict[str, Column]:
    """Return the columns of entries with `values` over time; vectors have the dim `direction`."""
    names = [name for name in entries if name in values]
    return {
        name: one._replace(dims=("direction",)[: np.ndim(values[name]) - 1])
        for name, one in columns_of(entries, names).items()
    }


def dataset(
    dims: tuple[str, ...],
    values: Mapping[str, np.ndarray],
    columns: Mapping[str, Column],
    coordinates: Mapping[str, Any],
    attributes: Mapping[str, Any] | None = None,
) -> "xr.Dataset":
    """Return the table of `values`, of shape (*sizes of dims, *sizes of the column's own dims).

    Columns without a value are left out. `coordinates` as in `xarray.Dataset`.
    """
    # A second that an orbit, which knows the columns, need not wait for.
    import xarray as xr

    data = {
        name: ((*dims, *column.dims), values[name], column.labels)
        for name, column in columns.items()
        if name in values
    }
    return xr.Dataset(data, coordinates, attributes)


def read_cells(path: Path | str) -> list[list[str]]:
    """Return the cells of each line of a CSV file, with commas between them.

    Raises ValueError, with a clause that says what the file is or has, if it cannot be read, or if
    it has other separators, which programs write beside decimal commas.
    """
    try:
        lines = Path(path).read_text(encoding="utf-8-sig").splitlines()
    except OSError as error:
        raise ValueError(f"cannot be read: {error.strerror}") from None
    except UnicodeDecodeError:
        raise ValueError("is no UTF-8 text") from None
    except ValueError:  # of a zero, and of half a character
        raise ValueError("is no name of a file") from None
    for mark, marks in ((";", "semicolons"), ("\t", "tabs")):
        if mark in "".join(lines[:1]):
            must = "write commas there, and decimal points in numbers, as 2.1"
            raise ValueError(f"has {marks} between its cells: {must}")
    try:
        return [[cell.strip() for cell in row] for row in csv.reader(lines)]
    except csv.Error as error:
        raise ValueError(f"is no table: {error}") from None


def as_csv(table: "xr.Dataset") -> str:
    """Return a table as CSV: one row for each cell of its grid, and a unit behind each heading.

    The components of a vector along `direction` become columns of their own.
    """
    import xarray as xr

    if "direction" in table.dims:
        parts = {}
        for name, values in table.items():
            axes = table.direction.to_numpy() if "direction" in values.dims else []
            for axis in axes:
                parts[f"{name}_{axis}"] = values.sel(direction=axis, drop=True)
            if not len(axes):
                parts[name] = values
        table = xr.Dataset(parts)
    units = {name: table[name].attrs.get("units", "1") for name in table.variables}
    headings = {
        name: str(name) if unit == "1" else f"{name} [{unit}]" for name, unit in units.items()
    }
    return table.to_dataframe().reset_index().rename(columns=headings).to_csv(index=False)

"""What was measured of a machine: harmonics, RMS values and statistics, with their scatter.

A CSV file is a table, or a time series with the shaft's angle and other units than SI in brackets:

```text
speed_rpm, quantity, order, amplitude, phase_deg, sigma, unit
286, corner_velocity_y, 1, 1.31, 84, 0.02, mm/s
286, main_cap_acceleration_30deg, rms, 6.4, , 0.1, m/s2

time, angle_deg, corner_velocity_y (mm/s)
0.000, 12.1, 0.83
```

A vector has a direction behind its name: `x` to the right, `y` up, or an angle from x to the left.
"""

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from numbers import Integral
from pathlib import Path

import numpy as np
from jaxtyping import Float

from jaxcrusher.basics.checks import (
    number_in,
    renamed,
    require,
    require_positive,
    require_whole,
)
from jaxcrusher.files.table import read_cells
from jaxcrusher.scenes.units import quantity_in

# Returns the SI unit of a quantity of an order; ValueError for what a machine does not show.
UnitOf = Callable[[str, int | str], str]
# Returns the phase of angles of the shaft, which a drive at constant speed turns by the phase.
PhaseOf = Callable[[Float[np.ndarray, " n"]], Float[np.ndarray, " n"]]
# Columns in other units -> their names here, and what one of them is in SI units.
_COLUMNS = {
    "speed_rpm": ("speed", np.pi / 30),
    "phase_deg": ("phase", np.pi / 180),
    "angle_deg": ("angle", np.pi / 180),
}
_NEEDED = {"speed", "quantity", "order", "amplitude", "sigma"}
_KNOWN = _NEEDED | {"phase", "unit"}
# The scatter of harmonics over fewer turns says little.
FEWEST_TURNS = 5
# A difference of so many standard deviations of one of its two parts is none of noise.
CLEAR = 5.0
RMS, WHOLE = "rms", ""


@dataclass(frozen=True)
class Measurement:
    """A number that was measured at a speed of the shaft (rad/s), in SI units.

    `order` is a whole number for a harmonic, with 0 for the mean: a quantity is
    a(theta) = mean + sum of A_k cos(k theta + phi_k) of the shaft's angle at its mean speed, as in
    `jaxcrusher.harmonics`. It is "rms" for the RMS about the mean, and "" for a statistic or for
    `least_penetration` of a `PeriodicOrbit`. A `phase` (rad) of NaN leaves the amplitude alone.
    `sigma` is the standard deviation of the number; with a phase, that of A cos(phi) and that of
    A sin(phi). Raises ValueError for other numbers.
    """

    speed: float
    quantity: str
    order: int | str
    amplitude: float
    sigma: float
    phase: float = math.nan

    def __post_init__(self):
        require_positive("speed", self.speed, "rad/s")
        require_positive("sigma", self.sigma, "")
        require(math.isfinite(self.amplitude), "amplitude", "be finite", self.amplitude)
        if isinstance(self.order, Integral):
            object.__setattr__(self, "order", int(self.order))
        whole = isinstance(self.order, int) and 0 <= self.order <= 100
        must = 'be a whole number from 0 to 100, "rms", or "" of a statistic'
        require(whole or self.order in (RMS, WHOLE), "order", must, repr(self.order))
        signed = self.amplitude >= 0 or self.has_phase or self.order in (0, WHOLE)
        require(signed, "amplitude", "be >= 0 of an RMS or without a phase", self.amplitude)
        require(not math.isinf(self.phase), "phase", "be finite, or NaN", self.phase)
        phased = self.is_harmonic or not self.has_phase
        require(phased, "phase", "belong to a harmonic", self.phase)

    @property
    def is_harmonic(self) -> bool:
        """Return whether it is more than a mean, an RMS or a statistic."""
        return isinstance(self.order, int) and self.order > 0

    @property
    def has_phase(self) -> bool:
        """Return whether the phase was measured."""
        return not math.isnan(self.phase)


def read_measured(
    path: Path | str, unit_of: UnitOf, orders: int = 4, phase_of: PhaseOf = np.asarray
) -> list[Measurement]:
    """Return what a CSV file holds: a table, or the harmonics of a time series up to `orders`.

    Raises ValueError, with the file, the line and the column, for a file that is neither.
    """
    try:
        rows = read_cells(path)
    except ValueError as error:
        raise ValueError(f"{path}: {error}.") from None
    header = [_COLUMNS.get(name, (name, 1.0)) for name in (rows[0] if rows else [])]
    names = [name for name, _ in header]
    is_series = {"time", "angle"} <= {*names}
    must = f"have the columns {', '.join(sorted(_NEEDED))}, or time and angle"
    require(is_series or {*names} >= _NEEDED, str(path), must, f"with {', '.join(names)}")
    # What is not read would be left out in silence, such as the unit of a column `units`.
    given = [name for name in names if name]
    once = len({*given}) == len(given) and (is_series or {*given} <= _KNOWN)
    alone = "time, angle and quantities" if is_series else ", ".join(sorted(_KNOWN))
    must = f"have no columns but {alone}, each once"
    require(once, str(path), must, f"with {', '.join(rows[0])}")
    found, series = [], []
    for line, row in enumerate(rows[1:], 2):
        must = f"have {len(names)} cells, one of each column"
        require(len(row) in (0, len(names)), f"{path}, line {line}", must, f"with {len(row)}")
        try:
            if is_series and row:
                cells = zip(rows[0], row, header, strict=True)
                series.append([size * _number(name, cell) for name, cell, (_, size) in cells])
            elif row:
                with renamed(**dict(zip(names, rows[0], strict=True))):
                    found.append(_of_row(dict(zip(names, row, strict=True)), dict(header), unit_of))
        except ValueError as error:
            said = str(error).replace("Argument", "column", 1)
            raise ValueError(f"{path}, line {line}: {said}") from None
    if is_series:
        columns = np.array(series).reshape(-1, len(names)).T
        try:
            return of_series(dict(zip(names, columns, strict=True)), unit_of, orders, phase_of)
        except ValueError as error:
            raise ValueError(f"{path}: {error}") from None
    return found


def _number(column: str, cell: str) -> float:
    """Return the number of a cell; ValueError, with the column, for another text."""
    try:
        value = number_in(cell)
    except ValueError:
        value = math.nan
    require(math.isfinite(value), column, "be a finite number", repr(cell))
    return value


def _of_row(row: Mapping[str, str], sizes: Mapping[str, float], unit_of: UnitOf) -> Measurement:
    """Return the measurement of a row of a table, whose columns have units of some sizes."""
    order = int(row["order"]) if row["order"].isdecimal() else row["order"]
    speed, amplitude, sigma = (_number(name, row[name]) for name in ("speed", "amplitude", "sigma"))
    phase = _number("phase", row["phase"]) if row.get("phase") else math.nan
    # Its errors tell the numbers as they stand in the file.
    one = Measurement(speed, row["quantity"], order, amplitude, sigma, phase)
    size = _size(row.get("unit", ""), unit_of(one.quantity, one.order))
    return replace(
        one,
        speed=sizes["speed"] * one.speed,
        amplitude=size * one.amplitude,
        sigma=size * one.sigma,
        phase=sizes.get("phase", 1.0) * one.phase,
    )


def _size(unit: str, wanted: str) -> float:
    """Return what one of a unit is in the unit wanted; without one it is that."""
    return 1.0 if unit in ("", wanted) else quantity_in(wanted, "unit", f"1 {unit}")


def of_series(
    columns: Mapping[str, Float[np.ndarray, " n"]],
    unit_of: UnitOf,
    orders: int = 4,
    phase_of: PhaseOf = np.asarray,
) -> list[Measurement]:
    """Return the harmonics of orders 1 to `orders` of a time series, with their scatter.

    `columns` are `time` (s), `angle` (rad, of the shaft, which may begin again each turn), and each
    quantity by its name, with another unit than SI in brackets behind it. Each whole turn has
    harmonics of its own, of the phase, by least squares. The answer is their mean, with the
    standard deviation of independent turns, by Student's distribution.

    Of n instants a turn at the same angles the order n - k folds onto k: it looks the same, and
    turns do not scatter by it. So a filter must have taken such orders away, or n must be large.
    The standard deviation also contains the difference of the harmonics of every second instant,
    which folds at half of n. This part is at least what folds where orders fall with their square.

    Raises ValueError for fewer than five whole turns, for orders of a quarter of n and above, for
    times that fall, and for a gap over which turns cannot be counted.
    """
    for name, column in columns.items():
        require(bool(np.isfinite(column).all()), name, "be finite in each row", "not")
    time, angle = columns["time"], phase_of(np.unwrap(columns["angle"]))
    require(bool(np.all(np.diff(time) >= 0)), "time", "not fall from row to row", "out of order")
    # A series that ends with a whole turn may miss it by rounding.
    turn = np.floor((angle - angle[:1]) / (2 * np.pi) + 1e-9).astype(int)
    turns = int(turn.max(initial=0))
    require(turns >= FEWEST_TURNS, "angle", f"go through {FEWEST_TURNS} whole turns", turns)
    speed, found = float(np.polyfit(time, angle, 1)[0]), []
    # A step that `unwrap` reads as a turn less, or several, is so far behind the mean speed.
    behind = np.abs(np.diff(angle) - speed * np.diff(time)) >= np.pi
    must = "go on from row to row by less than half a turn"
    require(not behind.any(), "angle", must, f"with a gap after {time[behind.argmax()]:g} s")
    for name in (name for name in columns if name not in ("time", "angle")):
        quantity, _, unit = (part.strip(" )") for part in name.partition("("))
        with renamed(quantity=name, unit=name):
            size = _size(unit, unit_of(quantity, 1))
        each = [_fit(angle[turn == i], columns[name][turn == i], orders) for i in range(turns)]
        mean, apart = size * np.mean(each, axis=0)
        # Of the mean, in each of its two parts: Student's, of as many degrees of freedom less two.
        scatter, of_apart = size * np.sqrt(np.var(each, axis=0, ddof=1) / (2 * turns))
        scatter = scatter * np.sqrt((turns - 1) / (turns - 2))
        # What differs by more than it scatters.
        folded = np.where(abs(apart) > CLEAR * of_apart, abs(apart), 0.0) / np.sqrt(2)
        whole = size * np.std(columns[name]) * np.sqrt(2)  # the amplitude, if it is of one order
        least = whole / (np.bincount(turn)[:turns].min() - np.arange(1, orders + 1)) ** 2
        scatter = np.hypot(scatter, np.maximum(folded, least))
        found += [
            Measurement(speed, quantity, k, float(abs(a)), float(s), float(np.angle(a)))
            for k, (a, s) in enumerate(zip(mean, scatter, strict=True), 1)
        ]
    return found


def _fit(angle: np.ndarray, values: np.ndarray, orders: int) -> np.ndarray:
    """Return A exp(i phi) of the orders 1 to `orders`, and half of what every second one differ."""
    must = "be less than a quarter of a turn's instants, since higher ones fold onto lower ones"
    require(4 * orders + 2 <= angle.size, "orders", must, f"{orders} of {angle.size} instants")
    phases = np.outer(angle, np.arange(orders + 1))
    basis = np.hstack([np.cos(phases), -np.sin(phases[:, 1:])])
    parts = np.stack(
        [
            np.linalg.lstsq(basis[one], values[one], rcond=None)[0]
            for one in (slice(None), slice(0, None, 2), slice(1, None, 2))
        ]
    )
    whole, even, odd = parts[:, 1 : orders + 1] + 1j * parts[:, orders + 1 :]
    return np.stack([whole, (even - odd) / 2])


def taken(
    measured: Path | str | Iterable[Path | str | Measurement],
    unit_of: UnitOf,
    orders: int = 4,
    phase_of: PhaseOf = np.asarray,
) -> list[Measurement]:
    """Return measurements, of which files are read."""
    require_whole("orders", orders, 1)
    found: list[Measurement] = []
    for one in [measured] if isinstance(measured, Path | str) else measured:
        is_read = not isinstance(one, Measurement)
        found += read_measured(one, unit_of, orders, phase_of) if is_read else [one]
    require(len(found) > 0, "measured", "hold a measurement", "empty")
    return found

"""Numbers, values of any kind and tables as text: one form for screen, page and sheets.

What is typed in again, as a parameter of a machine, has six digits: see `jaxcrusher.scenes.units`.
"""

import math
import numbers
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.table import Table as Grid

# Text that aligns right: a number, perhaps with its error.
NUMBER = re.compile(r"[-+]?\d[\d.e+-]*( ± \d[\d.e+-]*)?")
# Of a unit, the size from which another is told in its place, how many of the first that one is and
# how it is written, the largest first. A force of 1200 kN is said so; wear is told in MJ/m3.
PREFIXED = {
    "m": ((0.0, 1e-3, "mm"),),
    "N": ((1e3, 1e3, "kN"),),
    "J/m3": ((1e6, 1e6, "MJ/m3"), (1e3, 1e3, "kJ/m3")),
}


def number(value: float) -> str:
    """Return a number with four digits; below ten million, with all digits before the point.

    NaN is "no value".
    """
    if math.isnan(value):
        return "no value"
    return f"{value:.0f}" if 1e3 <= abs(value) < 1e7 else f"{value:z.4g}"


def two_digits(value: float) -> str:
    """Return a number as errors are written, with two digits."""
    return number(float(f"{value:.2g}"))


def to_error(value: float, error: float, most: int = 6) -> str:
    """Return a number to the second digit of its error, but with no more than `most` digits.

    An error that is zero or not finite tells no digit: the number then has those of `number`.
    """
    if not (math.isfinite(error) and math.isfinite(value)) or error <= 0:
        return number(value)
    places = _second_digit(error)
    if value != 0:
        places = min(places, most - 1 - math.floor(math.log10(abs(value))))
    rounded = round(value, places)
    if 1e-4 <= abs(rounded) < 1e7 or rounded == 0:
        return f"{rounded:z.{max(places, 0)}f}"
    return f"{rounded:.{max(1, places + 1 + math.floor(math.log10(abs(rounded))))}g}"


def with_error(value: float, error: float) -> str:
    """Return a number with its error or scatter, which is left out where it is not finite."""
    told = to_error(value, error)
    if not math.isfinite(error):
        return told
    places = len(told.partition(".")[2])
    same = "e" not in told and error > 0 and _second_digit(error) == places
    return f"{told} ± {error:.{places}f}" if same else f"{told} ± {two_digits(error)}"


def _second_digit(error: float) -> int:
    """Return the decimal place of the second digit of an error: of 0.0123 three, of 4100 -2."""
    return 1 - math.floor(math.log10(float(f"{error:.1e}")))


def measured(value: float, unit: str, error: float) -> str:
    """Return a number with its unit as `quantity` does, and with its error if there is one."""
    if not error > 0:
        return quantity(value, unit)
    factor, unit = prefixed(abs(value), unit)
    return f"{with_error(value / factor, error / factor)} {unit}".removesuffix(" 1")


def quantity(value: float, unit: str) -> str:
    """Return a number with its unit, if any, or with the one that suits its size."""
    if math.isnan(value):
        return number(value)
    factor, unit = prefixed(abs(value), unit)
    return f"{number(value / factor)} {unit}".removesuffix(" 1")


def prefixed(most: float, unit: str) -> tuple[float, str]:
    """Return a factor and a unit that suit values up to `most`."""
    others = PREFIXED.get(unit, ())
    return next(((factor, told) for least, factor, told in others if most >= least), (1.0, unit))


def as_text(value: object) -> str:
    """Return a value of any kind as text."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    return number(value) if isinstance(value, float) else str(value)


def is_number(value: object) -> bool:
    """Tell whether a value aligns right."""
    if isinstance(value, str):
        return NUMBER.fullmatch(value) is not None
    return isinstance(value, numbers.Real) and not isinstance(value, bool)


def digits_apart(value: float, limit: float, least: int = 4) -> int:
    """Return how many digits tell a number from the limit that it has passed, at least `least`."""
    counts = range(least, 17)
    return next((n for n in counts if f"{value:.{n}g}" != f"{limit:.{n}g}"), 17)


@dataclass(frozen=True)
class Table:
    """Rows under headings; the first column names its row. `about` and `caption` may be empty."""

    headings: Sequence[str]
    rows: Sequence[Sequence[object]]
    caption: str = ""
    about: str = ""

    @classmethod
    def of(
        cls, rows: Sequence[Mapping[str, object]], *, caption: str = "", about: str = ""
    ) -> "Table":
        """Return the table of rows with the same headings; without rows it has none."""
        headings = tuple(rows[0]) if rows else ()
        return cls(headings, [tuple(row.values()) for row in rows], caption, about)

    def printed(self) -> "Grid":
        """Return the table for a screen."""
        from rich.box import SIMPLE_HEAD
        from rich.table import Table as Grid

        first, *others = self.headings
        found = Grid(first, title=self.caption or None, box=SIMPLE_HEAD)
        for heading in others:
            found.add_column(heading, justify="right")
        for row in self.rows:
            found.add_row(*map(as_text, row))
        return found

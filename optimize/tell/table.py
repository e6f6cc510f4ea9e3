"""A table of the search, for the page, the screen and a CSV file."""

import math
import numbers
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import rich.table
from rich.box import SIMPLE_HEAD

from optimize.tell import words as formatting


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

    @property
    def turned(self) -> "Table":
        """The table with its rows as columns: any number of headings then fits a screen."""
        headings, *rows = zip(self.headings, *self.rows, strict=True)
        return Table(("", *headings[1:]), rows, self.caption, self.about)

    def printed(self) -> rich.table.Table:
        """Return the table for a screen."""
        first, *others = self.headings
        found = rich.table.Table(first, title=self.caption or None, box=SIMPLE_HEAD)
        for heading in others:
            found.add_column(heading, justify="right")
        for row in self.rows:
            found.add_row(*map(as_text, row))
        return found


def as_text(value: object) -> str:
    """Return a value as text; NaN is "no value"."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, numbers.Real) and not math.isfinite(value):
        return "no value"
    return formatting.number(value) if isinstance(value, float) else str(value)


def is_number(value: object) -> bool:
    """Tell whether a cell aligns right."""
    if isinstance(value, str):
        return re.fullmatch(r"[-+]?\d[\d.e+±-]*", value) is not None
    return isinstance(value, numbers.Real) and not isinstance(value, bool)

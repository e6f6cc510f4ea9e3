"""What an object says of itself: a few lines on a screen, a small table in a notebook."""

import abc
import html
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from typing_extensions import override

from jaxcrusher.files.text import measured, number, prefixed

# So many lines of so many columns an object has at most.
MOST_LINES, WIDEST = 25, 100


class Row(NamedTuple):
    """A line of a summary: a name, what is said of it, and what it means."""

    name: str
    value: str
    meaning: str = ""


@dataclass(frozen=True)
class Summary:
    """A title, which says at once if something failed, rows below it, and remarks."""

    title: str
    rows: Sequence[Row] = ()
    remarks: Sequence[str] = ()

    @property
    def shown(self) -> tuple[Sequence[Row], str]:
        """Return the rows that there is room for, and how many are left out, in words."""
        room = max(MOST_LINES - len(self._title()) - len(self._remarks()), 2)
        if len(self.rows) <= room:
            return self.rows, ""
        return self.rows[: room - 1], f"and {len(self.rows) - room + 1} more"

    def text(self) -> str:
        """Return it in lines."""
        rows, more = self.shown
        name, value = (max((len(row[i]) for row in rows), default=0) for i in (0, 1))
        lines = [f"  {row.name:{name}}  {row.value:{value}}  {row.meaning}" for row in rows]
        lines += [f"  {more}"] if more else []
        return "\n".join([*self._title(), *map(_cut, lines), *self._remarks()])

    def table(self, picture: str = "") -> str:
        """Return the summary in HTML, with a picture."""
        rows, more = self.shown
        told = "".join(f"<tr>{''.join(map(_cell, row))}</tr>" for row in rows)
        below = "".join(f"<div>{html.escape(one)}</div>" for one in (more, *self.remarks) if one)
        return (
            f"<div><strong>{html.escape(self.title)}</strong>"
            f'<div style="display: flex; flex-wrap: wrap; gap: 1em">'
            f'<table style="white-space: nowrap; margin: 0">{told}</table>{picture}</div>'
            f"{below}</div>"
        )

    def _title(self) -> list[str]:
        return textwrap.wrap(self.title, WIDEST, subsequent_indent="  ")

    def _remarks(self) -> list[str]:
        wrapped = [textwrap.wrap(one, WIDEST - 2) for one in self.remarks]
        lines = [f"  {line}" for lines in wrapped for line in lines]
        most = MOST_LINES // 2
        return lines if len(lines) <= most else [*lines[: most - 1], "  ..."]


class Summarised(abc.ABC):
    """What has a summary, which a prompt prints, and a notebook shows as a table.

    Where JAX traces its numbers, or has put something else in their place, it says so in a line.
    """

    @abc.abstractmethod
    def _summary(self) -> Summary:
        """Return what is said of it (concrete values only)."""

    def _picture(self) -> str:
        """Return a small picture as SVG, or nothing."""
        return ""

    @override
    def __repr__(self) -> str:
        return self._known_summary().text()

    def _repr_html_(self) -> str:
        try:
            picture = self._picture()
        except Exception as error:
            picture = f"<em>no picture: {type(error).__name__}</em>"
        return self._known_summary().table(picture)

    def _known_summary(self) -> Summary:
        # JAX shows PyTrees in its messages, with flags, shapes or None for numbers. One that cannot
        # be said must not hide them.
        try:
            return self._summary()
        except Exception as error:
            why = f"whose numbers JAX traces or has replaced ({type(error).__name__})"
            return Summary(f"{type(self).__name__}, {why}")


def value_text(values: Any, unit: str, error: float = np.nan) -> str:
    """Return a number with its error and unit; of an array its range, its unit and its shape."""
    known = np.asarray(values)
    if known.ndim == 0:
        return measured(float(known), unit, error)
    lacking = int(np.sum(~np.isfinite(known)))
    without = f", {lacking} without a value" if lacking else ""
    return f"{range_of(known, unit)}, shape {known.shape}{without}"


def range_of(values: Any, unit: str) -> str:
    """Return the least and the largest of numbers with their unit."""
    known = np.asarray(values)
    finite = known[np.isfinite(known)]
    if not finite.size:
        return number(np.nan)
    least, most = float(finite.min()), float(finite.max())
    factor, unit = prefixed(max(abs(least), abs(most)), unit)
    return f"{number(least / factor)} to {number(most / factor)} {unit}".removesuffix(" 1")


def _cell(text: str) -> str:
    return f'<td style="text-align: left">{html.escape(text)}</td>'


def _cut(line: str) -> str:
    line = line.rstrip()
    return line if len(line) <= WIDEST else f"{line[: WIDEST - 4]} ..."

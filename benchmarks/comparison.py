"""One figure of ours beside one of another program, and tables of them."""

import math
from dataclasses import dataclass

import numpy as np
from rich.table import Table

HEADINGS = ("quantity", "ours", "theirs", "program", "difference", "tolerance", "verdict")


@dataclass(frozen=True)
class Comparison:
    """A quantity by two programs; difference and tolerance are relative, and pure numbers."""

    quantity: str
    ours: float
    theirs: float
    program: str
    difference: float
    tolerance: float
    reason: str  # why the tolerance is what it is

    @property
    def agrees(self) -> bool:
        """Whether the difference is within the tolerance; a NaN never is."""
        return self.difference <= self.tolerance

    @property
    def verdict(self) -> str:
        """In words."""
        return "agrees" if self.agrees else "does not agree"


def numbers(quantity, ours, theirs, program, tolerance, reason) -> Comparison:
    """Two numbers."""
    ours, theirs = float(ours), float(theirs)
    # What is exactly zero there (a force in free flight) must be zero here, and counts as is.
    difference = abs(ours - theirs) / (abs(theirs) or 1.0)
    return Comparison(quantity, ours, theirs, program, difference, tolerance, reason)


def histories(quantity, ours, theirs, program, tolerance, reason) -> Comparison:
    """Two histories, scalars (times,) or vectors (times, 2): shown are their largest values.

    The difference is the largest at any time, over the largest value of theirs.
    """
    ours, theirs = np.asarray(ours), np.asarray(theirs)
    if ours.shape != theirs.shape:
        raise ValueError(f"Histories must have one shape, but have {ours.shape}, {theirs.shape}.")

    def size(history):
        return abs(history) if history.ndim == 1 else np.linalg.norm(history, axis=1)

    largest = size(theirs).max()
    # A quantity that is zero in both (friction without friction) has no relative difference.
    difference = size(ours - theirs).max() / largest if largest > 0 else size(ours).max()
    return Comparison(
        quantity, size(ours).max(), largest, program, float(difference), tolerance, reason
    )


def samples(quantity, ours, theirs, program, reason) -> Comparison:
    """Means of independent samples; the tolerance is four standard errors of the difference."""
    ours, theirs = np.asarray(ours), np.asarray(theirs)
    error = math.sqrt(sum(s.var(ddof=1) / s.size for s in (ours, theirs)))
    tolerance = 4 * error / abs(theirs.mean())
    return numbers(quantity, ours.mean(), theirs.mean(), program, tolerance, reason)


def _number(value: float) -> str:
    return f"{value:.6g}"


def _cells(comparison: Comparison) -> list[str]:
    c = comparison
    return [
        c.quantity,
        _number(c.ours),
        _number(c.theirs),
        c.program,
        f"{c.difference:.1e}",
        f"{c.tolerance:.1e}",
        c.verdict,
    ]


def screen_table(title: str, comparisons: list[Comparison]) -> Table:
    """For the terminal."""
    table = Table(title=title, title_justify="left")
    for heading in HEADINGS:
        table.add_column(heading)
    for comparison in comparisons:
        table.add_row(*_cells(comparison), style=None if comparison.agrees else "bold red")
    return table


def markdown_table(comparisons: list[Comparison]) -> list[str]:
    """Lines of a table, and a footnote to each reason."""
    reasons = list(dict.fromkeys(c.reason for c in comparisons))
    lines = [f"| {' | '.join(HEADINGS)} |", "|" + "---|" * len(HEADINGS)]
    for comparison in comparisons:
        cells = _cells(comparison)
        cells[5] += f" ({reasons.index(comparison.reason) + 1})"
        if not comparison.agrees:
            cells[6] = f"**{cells[6]}**"
        lines.append(f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in cells)} |")
    notes = [f"({i}) {reason}  " for i, reason in enumerate(reasons, start=1)]
    return [*lines, "", "Tolerances:  ", *notes]

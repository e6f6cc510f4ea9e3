"""One figure of ours beside one of another program, and tables of them."""

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from benchmarks.pages import table

HEADINGS = ("quantity", "ours", "theirs", "program", "difference", "tolerance", "by", "verdict")


@dataclass(frozen=True)
class Comparison:
    """A quantity by two programs; difference and tolerance are relative, and pure numbers."""

    quantity: str
    ours: float
    theirs: float
    program: str
    difference: float
    tolerance: float
    reason: str  # the name of the tolerance's reason, which the page explains

    @property
    def agrees(self) -> bool:
        """Tell whether the difference is within the tolerance; a NaN never is."""
        return self.difference <= self.tolerance


def numbers(quantity, ours, theirs, program, tolerance, reason) -> Comparison:
    """Compare two numbers."""
    ours, theirs = float(ours), float(theirs)
    # What is exactly zero there (a force in free flight) must be zero here, and counts as is.
    difference = abs(ours - theirs) / (abs(theirs) or 1.0)
    return Comparison(quantity, ours, theirs, program, difference, tolerance, reason)


def histories(quantity, ours, theirs, program, tolerance, reason) -> Comparison:
    """Compare histories, scalars (times,) or vectors (times, 2); shown are their largest values.

    The difference is the largest at any time, over the largest value of theirs.
    """
    ours, theirs = np.asarray(ours), np.asarray(theirs)
    if ours.shape != theirs.shape:
        raise ValueError(f"Histories must have one shape, but have {ours.shape}, {theirs.shape}.")

    def size(history) -> float:
        sizes = abs(history) if history.ndim == 1 else np.linalg.norm(history, axis=1)
        return float(sizes.max())

    # A quantity that is zero in both (friction without friction) has no relative difference.
    largest = size(theirs)
    difference = size(ours - theirs) / largest if largest > 0 else size(ours)
    return Comparison(quantity, size(ours), largest, program, difference, tolerance, reason)


def samples(quantity, ours, theirs, program, reason) -> Comparison:
    """Compare means of independent samples; allowed are four standard errors of the difference."""
    ours, theirs = np.asarray(ours), np.asarray(theirs)
    error = math.sqrt(sum(s.var(ddof=1) / s.size for s in (ours, theirs)))
    tolerance = 4 * error / abs(theirs.mean())
    return numbers(quantity, ours.mean(), theirs.mean(), program, tolerance, reason)


def table_of(comparisons: Iterable[Comparison]) -> str:
    """Return the table of comparisons; what does not agree is bold."""
    rows = []
    for c in comparisons:
        values = f"{c.ours:.6g}", f"{c.theirs:.6g}", c.program
        limits = f"{c.difference:.1e}", f"{c.tolerance:.1e}", c.reason
        rows.append([c.quantity, *values, *limits, "agrees" if c.agrees else "**does not agree**"])
    return table(HEADINGS, rows)

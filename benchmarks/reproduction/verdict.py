"""The rule of the verdicts on numbers of the paper, which the page claims.md states."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

TOLERANCE = 0.05  # relative: what the reading of a number from a curve is good for

REPRODUCED = "reproduced"
NOT_REPRODUCED = "not reproduced"
INCONSISTENT = "inconsistent in the source"
UNCHECKED = "cannot be checked"


class Estimate(NamedTuple):
    """A value with the range of it over runs and windows."""

    value: float
    low: float
    high: float


def estimate(samples: np.ndarray) -> Estimate:
    """Return median and range. A NaN, from a failed run, is not left out."""
    samples = np.asarray(samples, dtype=float)
    return Estimate(*(float(f(samples)) for f in (np.median, np.min, np.max)))


@dataclass(frozen=True)
class Printed:
    """A number as printed: its value and half a unit of its last digit."""

    value: float
    rounding: float

    @property
    def interval(self) -> tuple[float, float]:
        """Return the interval that rounds to it."""
        return self.value - self.rounding, self.value + self.rounding


def printed(text: str) -> Printed:
    """`"7.4e4"` is 74000 with a rounding of 500; `"40"` is 40 with 0.5."""
    mantissa, _, exponent = text.partition("e")
    decimals = len(mantissa.partition(".")[2])
    return Printed(float(text), 0.5 * 10.0 ** (int(exponent or 0) - decimals))


def overlap(first: tuple[float, float], second: tuple[float, float]) -> bool:
    """Return whether two closed intervals have a number in common, up to rounding in binary."""
    finite = (abs(end) for end in (*first, *second) if math.isfinite(end))
    slack = 1e-9 * max(finite, default=0.0)
    return first[0] <= second[1] + slack and second[0] <= first[1] + slack


def verdict(
    claim: Printed, found: Estimate | None, implied: tuple[float, float] | None = None
) -> str:
    """Judge by the rule; `implied` is the interval that the paper's other numbers leave."""
    if implied is not None and not overlap(claim.interval, implied):
        return INCONSISTENT
    if found is None:
        return UNCHECKED
    allowed = max(TOLERANCE * abs(claim.value), claim.rounding)
    near = math.isfinite(found.value) and abs(found.value - claim.value) <= allowed
    return REPRODUCED if near else NOT_REPRODUCED

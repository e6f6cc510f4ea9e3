"""Confirmation: long independent runs of the candidates, with confidence intervals."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.stats import t as student

from optimize.evaluate import STARTS, Case, Progress, Window, evaluate

CONFIDENCE = 0.95
# Starts of independent runs are shifted at random by up to this many clearances: a swing or a
# chaotic motion forgets it, a periodic one comes back to itself.
SHIFT = 0.05


@dataclass(frozen=True)
class Confirmed:
    """A design's independent runs: rows of shape (starts, runs), one per variable."""

    unit: np.ndarray
    rows: dict[str, np.ndarray]

    @property
    def counts(self) -> bool:
        """No run failed, whirled or broke a constraint."""
        return bool(self.rows["counts"].all())

    def mean(self, start: int) -> float:
        """The mean objective of the runs from one start."""
        return float(self.rows["objective"][start].mean())

    def half_width(self, start: int) -> float:
        """Of the 95 % confidence interval of `mean`, from the scatter between runs."""
        values = self.rows["objective"][start]
        quantile = float(student.ppf((1 + CONFIDENCE) / 2, len(values) - 1))
        return quantile * float(values.std(ddof=1)) / len(values) ** 0.5

    @property
    def worse(self) -> int:
        """The start with the larger mean."""
        return int(np.argmax([self.mean(i) for i in range(len(STARTS))]))

    @property
    def value(self) -> float:
        """What the design is judged by; NaN if a run does not count."""
        return self.mean(self.worse) if self.counts else float("nan")

    @property
    def error(self) -> float:
        """Half the width of the confidence interval of `value`."""
        return self.half_width(self.worse)

    def first(self, start: int) -> dict[str, Any]:
        """The variables of the first run, whose start is not shifted."""
        return {name: values[start, 0].item() for name, values in self.rows.items()}


def confirm(
    case: Case, units: np.ndarray, runs: int, window: Window, seed: int, progress: Progress
) -> list[Confirmed]:
    """Independent long runs of points (m, n) of the unit box, `runs` from each start.

    The first run starts as the scene says, the others are shifted at random.
    """
    rng = np.random.default_rng(seed)
    shifts = rng.uniform(-SHIFT, SHIFT, (len(units), runs, 2))
    shifts[:, 0] = 0
    points = np.repeat(units, runs, axis=0)
    parts = []
    for part, rows in evaluate(case, points, window, shifts=shifts.reshape(-1, 2), chunk=32):
        parts.append(rows)
        progress(part.stop, len(points))
    whole = {name: np.concatenate([rows[name] for rows in parts], axis=1) for name in parts[0]}
    grouped = {name: v.reshape(len(STARTS), len(units), runs) for name, v in whole.items()}
    return [
        Confirmed(unit, {name: values[:, i] for name, values in grouped.items()})
        for i, unit in enumerate(units)
    ]

"""Confirmation: long independent runs of the candidates, with confidence intervals."""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float
from scipy.stats import t as student

import jaxcrusher as jc
from optimize.answer import Confirmed, Runs
from optimize.evaluate import STARTS, Case, Progress, Rows, Window, evaluate

CONFIDENCE = 0.95
# Starts of independent runs are shifted at random by up to this many clearances: a swing or a
# chaotic motion forgets it, a periodic one comes back to itself.
SHIFT = 0.05


def interval(values: Float[np.ndarray, " runs"]) -> tuple[float, float]:
    """The mean of independent runs, and half of its 95 % confidence interval, by their scatter."""
    quantile = float(student.ppf((1 + CONFIDENCE) / 2, len(values) - 1))
    return float(values.mean()), quantile * float(values.std(ddof=1)) / len(values) ** 0.5


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
    grouped = {
        name: values.reshape(len(STARTS), len(units), runs, *values.shape[2:])
        for name, values in whole.items()
    }
    return [
        confirmed(case, unit, {name: values[:, i] for name, values in grouped.items()})
        for i, unit in enumerate(units)
    ]


def confirmed(case: Case, unit: Float[np.ndarray, " n"], rows: Rows) -> Confirmed:
    """A point of the unit box with its runs: `rows` of shape (starts, runs, ...)."""
    values = case.design.numbers(unit)
    described = {**jc.PE250X400, **case.design.fixed, **values}
    intervals = [interval(numbers) for numbers in rows["objective"]]
    worse = int(np.argmax([mean for mean, _ in intervals]))
    mean, half_width = intervals[worse]
    ideal = jc.statistics(jc.build_scene(described).ideal(), 0, 1, outputs=("foundation_rms",))
    runs = {}
    for i, (start, numbers) in enumerate(zip(STARTS, intervals, strict=True)):
        by_run = {name: column[i] for name, column in rows.items()}
        limits = ("half_width_ratio", "impact_speed_ratio", "delivered_restitution")
        first = [by_run[name][0] for name in limits]
        validity = jc.Validity(*map(jnp.asarray, (*first, described["restitution"])))
        state = by_run.pop("state")[0]
        runs[start] = Runs(*numbers, validity, state, by_run)
    return Confirmed(
        values,
        mean if rows["counts"].all() else float("nan"),
        half_width,
        STARTS[worse],
        float(described["speed"]),
        float(described["clearance"]),
        float(rows["foundation_rms"].mean(axis=1).max()),
        float(np.asarray(ideal.foundation_rms)),
        float(case.capacity(unit)),
        runs,
    )

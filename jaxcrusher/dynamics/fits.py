"""Slopes at a finite radius: a linear fit over pairs of runs, the only kind that chaos has."""

from collections.abc import Callable
from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jaxcrusher.basics.checks import require
from jaxcrusher.batch.engines import map_all


@dataclass(frozen=True)
class Fit:
    """Slopes by n parameters with standard errors, and what speaks against them.

    `shares` are those of the one pair that says most in the sum of what all say, regardless of
    sign. `drifts` are how far the slopes move from the first half of the window to the whole.
    """

    slopes: Float[np.ndarray, " n"]
    errors: Float[np.ndarray, " n"]
    shares: Float[np.ndarray, " n"]
    drifts: Float[np.ndarray, " n"]
    drift_errors: Float[np.ndarray, " n"]
    freedom: int  # degrees, of all errors


def fit_slopes(
    value: Callable,
    point: Float[np.ndarray, " n"],
    radius: Float[np.ndarray, " n"],
    pairs: int,
    seed: int,
    shift: float = 0.0,
    chunk: int = 64,
) -> Fit:
    """Slopes by a linear fit over pairs of runs.

    `value` maps {"point": (n,), "shift": (2,)} to two numbers: a statistic over a window and
    over the first half of it. The two runs of a pair share their start (random within `shift`)
    and lie at opposite points of the box `point` ± `radius`, so that curvature and much of the
    noise cancel in their difference. A run that is not finite makes every slope NaN.

    Raises ValueError for fewer pairs than twice the parameters: the errors need residuals.
    """
    require(pairs >= 2 * len(point), "pairs", "be at least twice the parameters", pairs)
    rng = np.random.default_rng(seed)
    offsets = rng.uniform(0.3, 1.0, (pairs, len(point)))
    # Signs of a Hadamard matrix rather than by chance: no two parameters go together.
    common = np.arange(pairs)[:, None] & np.arange(1, len(point) + 1)
    offsets *= np.where(np.bitwise_count(common) % 2, 1, -1)
    shifts = np.repeat(rng.uniform(-shift, shift, (pairs, 2)), 2, axis=0)
    signs = np.tile([1.0, -1.0], pairs)[:, None]
    cases = {
        "point": jnp.asarray(point + signs * radius * np.repeat(offsets, 2, axis=0)),
        "shift": jnp.asarray(shifts),
    }
    both = map_all(value, cases, chunk).reshape(pairs, 2, 2)
    half = (both[:, 0] - both[:, 1]) / 2
    if not np.isfinite(half).all():
        nothing, unknown = np.full(len(point), np.nan), np.full(len(point), np.inf)
        return Fit(nothing, unknown, nothing, nothing, unknown, pairs - len(point))
    slopes, errors = _linear(offsets, half[:, 0])
    drifts, drift_errors = _linear(offsets, half[:, 0] - half[:, 1])
    said = np.abs(np.linalg.pinv(offsets) * half[:, 0])
    shares = said.max(axis=1) / np.maximum(said.sum(axis=1), np.finfo(float).tiny)
    drifts, drift_errors = drifts / radius, drift_errors / radius
    return Fit(slopes / radius, errors / radius, shares, drifts, drift_errors, pairs - len(point))


def _linear(
    offsets: Float[np.ndarray, "pairs n"], half: Float[np.ndarray, " pairs"]
) -> tuple[np.ndarray, np.ndarray]:
    """Least-squares slopes through the origin, and standard errors."""
    pairs, n = offsets.shape
    slopes, *_ = np.linalg.lstsq(offsets, half, rcond=None)
    rest = half - offsets @ slopes
    variance = rest @ rest / max(pairs - n, 1)
    return slopes, np.sqrt(variance * np.diag(np.linalg.inv(offsets.T @ offsets)))

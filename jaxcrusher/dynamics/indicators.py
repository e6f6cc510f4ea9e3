"""Indicators of order and chaos, on plain arrays: any map's or flow's will do."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import ArrayLike, Float


@dataclass(frozen=True)
class Lyapunov:
    """Exponents, largest first, with standard errors by batch means."""

    exponents: Float[np.ndarray, " dims"]
    errors: Float[np.ndarray, " dims"]

    @property
    def positive(self) -> bool:
        """The largest is above zero by three standard errors."""
        return bool(self.exponents[0] > 3 * self.errors[0])


def lyapunov_spectrum(
    jacobians: Float[ArrayLike, "steps dims dims"],
    *,
    slices: int = 1,
    discard: float = 0.1,
    batches: int = 20,
) -> Lyapunov:
    """The spectrum per `slices` steps, from the Jacobians of consecutive steps (Benettin 1980).

    `slices` steps make a period of whatever forces the motion: growth differs from slice to
    slice, and only whole periods are compared. The first `discard` of them align the frame. The
    errors are right where batches are long against the memory of the growth rates.
    """
    steps = np.asarray(jacobians, dtype=float)
    frame = np.eye(steps.shape[-1])
    growth = np.empty(steps.shape[:2])
    for i, jacobian in enumerate(steps):
        frame, upper = np.linalg.qr(jacobian @ frame)
        with np.errstate(divide="ignore"):
            growth[i] = np.log(np.abs(np.diag(upper)))
    periods = growth[: len(growth) // slices * slices].reshape(-1, slices, steps.shape[-1])
    growth = periods.sum(axis=1)[round(discard * len(periods)) :]
    batches = min(batches, len(growth))
    length = len(growth) // batches
    means = growth[len(growth) - batches * length :].reshape(batches, length, -1).mean(axis=1)
    scatter = means.std(axis=0, ddof=1) if batches > 1 else np.full(growth.shape[1], np.inf)
    order = np.argsort(-growth.mean(axis=0), kind="stable")
    return Lyapunov(growth.mean(axis=0)[order], scatter[order] / np.sqrt(batches))


def detect_period(
    points: Float[ArrayLike, "n dims"],
    *,
    longest: int = 32,
    tolerance: float = 1e-6,
    noise: float = 0.0,
) -> int | None:
    """The least k <= `longest` with x(i + k) = x(i), or None.

    Equal means within `tolerance` of a coordinate's range, or `noise` in its own unit: what the
    integration leaves on a fixed point. At least three periods are asked for.
    """
    x = np.asarray(points, dtype=float)
    if not np.isfinite(x).all():
        return None
    allowed = tolerance * np.ptp(x, axis=0) + noise
    for k in range(1, min(longest, len(x) // 3) + 1):
        if (np.abs(x[k:] - x[:-k]) <= allowed).all():
            return k
    return None


def zero_one_test(
    series: Float[ArrayLike, " n"], *, frequencies: int = 100, seed: int = 0
) -> float:
    """K of Gottwald and Melbourne's 0-1 test (2009): near 1 for chaos, near 0 for order.

    The median over random frequencies in (pi/5, 4 pi/5) of the correlation of the modified mean
    square displacement with time. For section points, a thousand or more; sampled flows mislead.
    """
    x = np.asarray(series, dtype=float)
    n, cut = len(x), len(x) // 10
    rng = np.random.default_rng(seed)
    time = np.arange(1, n + 1)
    lags = np.arange(1, cut + 1)
    values = []
    for c in rng.uniform(np.pi / 5, 4 * np.pi / 5, frequencies):
        p, q = np.cumsum(x * np.cos(c * time)), np.cumsum(x * np.sin(c * time))
        square = np.array(
            [
                np.mean(
                    (p[j : n - cut + j] - p[: n - cut]) ** 2
                    + (q[j : n - cut + j] - q[: n - cut]) ** 2
                )
                for j in lags
            ]
        )
        oscillation = x.mean() ** 2 * (1 - np.cos(lags * c)) / (1 - np.cos(c))
        values.append(np.corrcoef(lags, square - oscillation)[0, 1])
    return float(np.median(values))


def birkhoff_average(series: Float[ArrayLike, "n ..."]) -> np.ndarray:
    """The mean with the smooth weight exp(-1 / (s (1 - s))) (Das and co-workers 2017).

    Converges faster than any power of 1/n on periodic and quasi-periodic motions, and no slower
    than the plain mean on chaotic ones.
    """
    x = np.asarray(series, dtype=float)
    s = (np.arange(len(x)) + 0.5) / len(x)
    weight = np.exp(-1 / (s * (1 - s)))
    return np.tensordot(weight / weight.sum(), x, axes=(0, 0))


def power_spectrum(
    series: Float[ArrayLike, " n"], interval: float
) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies (Hz) and one-sided power density (unit^2 / Hz), with a Hann window.

    `interval` is the time between samples (s). The density's integral is the variance.
    """
    # Half a second that `import jaxcrusher` shall not take.
    from scipy.signal import periodogram

    return periodogram(np.asarray(series, dtype=float), 1 / interval, "hann")

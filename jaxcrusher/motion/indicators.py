"""Indicators of order and chaos, and the verdict on which they agree.

They take plain arrays, from any map or flow.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import ArrayLike, Float

# A growth in a turn that is chaos where its error is not known. Over some 24 turns a swing about a
# stable orbit lets disturbances grow too, by up to 0.1 a turn; of chaotic motions, which lose
# contact, it is 1.7 to 7.
CHAOS = 0.2
# Below and above, the 0-1 test speaks for order and for disorder, and the points that it needs.
ORDER, DISORDER, ENOUGH = 0.2, 0.8, 480
# An exponent known no better than this is not known to be zero.
NEUTRAL_ERROR = 0.1
# A trend in the section's spread that is no accident: rank correlation with time (of ten batches
# without a trend one set in 2000 comes so far), and change as a share.
TREND_RANK, TREND_SHARE = 0.9, 0.05


def verdict(
    period: int | None, grows: bool, zero_one: float | None, *, trending: bool, neutral: bool
) -> str:
    """Return the name of a motion on which its indicators agree, or "undecided".

    **Arguments:**

    - `period`: turns after which its section points repeat; None: they do not.
    - `grows`: whether disturbances grow.
    - `zero_one`: K of the 0-1 test; None where there are too few points for it.
    - `trending`: whether the spread of the points still changes.
    - `neutral`: whether disturbances neither grow nor decay, as far as is known.
    """
    if period is not None:
        return "undecided" if grows else "periodic"
    if grows and (zero_one is None or zero_one > DISORDER):
        return "chaotic"
    if trending:
        return "not settled"
    if neutral and zero_one is not None and zero_one < ORDER:
        return "quasi-periodic"
    return "undecided"


@dataclass(frozen=True)
class Lyapunov:
    """Exponents, largest first, with standard errors by batch means."""

    exponents: Float[np.ndarray, " dims"]
    errors: Float[np.ndarray, " dims"]

    @property
    def positive(self) -> bool:
        """The largest is above zero by three standard errors."""
        return bool(self.exponents[0] > 3 * self.errors[0])

    @property
    def neutral(self) -> bool:
        """The largest is zero within three standard errors, which are small."""
        largest, error = self.exponents[0], self.errors[0]
        return bool(abs(largest) <= 3 * error and error < NEUTRAL_ERROR)


def lyapunov_spectrum(
    jacobians: Float[ArrayLike, "steps dims dims"],
    *,
    slices: int = 1,
    discard: float = 0.1,
    batches: int = 20,
) -> Lyapunov:
    """The spectrum per `slices` steps, from the Jacobians of consecutive steps (Benettin 1980).

    `slices` steps make one period of the forcing: growth differs from slice to slice, so only whole
    periods are compared. The first share `discard` of the periods aligns the frame. The errors are
    right if batches are much longer than the growth rates' correlation time.
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
    # Periods that fill no batch are in the mean too.
    errors = scatter[order] * np.sqrt(length / len(growth))
    return Lyapunov(growth.mean(axis=0)[order], errors)


def detect_period(
    points: Float[ArrayLike, "n dims"],
    *,
    longest: int = 32,
    tolerance: float = 1e-6,
    noise: float = 0.0,
) -> int | None:
    """The least k <= `longest` with x(i + k) = x(i), or None.

    Equal means within `tolerance` of a coordinate's range plus `noise` in its own unit, which is
    what the integration leaves on a fixed point. Over at least three periods no point drifts by
    more than ten times this; a swing as small as this repeats if it turns by 0.2 rad or more.
    """
    x = np.asarray(points, dtype=float)
    if not np.isfinite(x).all():
        return None
    allowed = tolerance * np.ptp(x, axis=0) + noise
    for k in range(1, min(longest, len(x) // 3) + 1):
        if (np.abs(x[k:] - x[:-k]) <= allowed).all():
            drifts = [np.ptp(x[i::k], axis=0) > 10 * allowed for i in range(k)]
            if not np.any(drifts):
                return k
    return None


def widest(points: Float[np.ndarray, "n dims"]) -> Float[np.ndarray, " n"]:
    """Return the coordinate that spreads most: a constant one holds no motion."""
    return points[:, int(np.argmax(np.ptp(points, axis=0)))]


def spread_trend(
    points: np.ndarray, batches: int = 10, *, noise: float = 0.0
) -> tuple[float, bool]:
    """The relative change of the points' spread over the window, and whether it is significant.

    The spread of a batch is the root mean square distance from its mean, with each coordinate in
    units of its range. Coordinates within `noise` hold no motion and are left out. The change is
    that of a straight line through the spreads' logarithms.
    """
    span = np.ptp(points, axis=0)
    scaled = points / np.where(span > noise, span, np.inf)
    length = len(points) // batches
    parts = scaled[: batches * length].reshape(batches, length, -1)
    spread = np.sqrt(np.sum(parts.var(axis=1), axis=1))
    if not spread.all():
        return 0.0, False
    place = np.linspace(-0.5, 0.5, batches)
    share = np.expm1(place @ np.log(spread) / (place @ place))
    rank = np.corrcoef(place, np.argsort(np.argsort(spread)))[0, 1]
    return float(share), bool(abs(rank) > TREND_RANK and abs(share) > TREND_SHARE)


def zero_one_test(
    series: Float[ArrayLike, " n"], *, frequencies: int = 100, seed: int = 0
) -> float:
    """K of Gottwald and Melbourne's 0-1 test (2009): near 1 for chaos, near 0 for order.

    K is the median, over random frequencies in (pi/5, 4 pi/5), of the correlation of the modified
    mean square displacement with time. Gottwald and Melbourne ask for a thousand section points;
    200 tell the tori of these machines from chaos, and 100 do not. Sampled flows mislead.
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

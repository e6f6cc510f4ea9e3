"""Whether a slope may be believed: evidence in, a word out."""

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import ArrayLike, Complex

# A tangent that has grown by more than exp(3) says more of the start than of the parameter.
GROWTH = 3.0
# An orbit with a multiplier so near to 1 is about to end, or to part in two: it moves by a
# thousand times what a parameter pushes it.
NEAR_ONE = 1e-3
# Slopes known worse than this many standard errors are not known in sign.
SIGNIFICANT = 3.0
# Two estimates agree within this share, or two standard errors of their difference.
AGREEMENT = 0.05
# A fit that rests on one pair of runs is an accident.
LARGEST_SHARE = 0.2
# The names of the fits at a radius and at half of it.
FITS = ("fit", "fit at half the radius")


@dataclass(frozen=True)
class Slope:
    """The slope of a statistic by one parameter, in their units.

    `verdict` is "ok", "doubtful" or "refused"; `radius` is that of the fit, 0 for a derivative.
    `estimates` holds every estimate made: name -> (slope, standard error).
    """

    parameter: str
    estimator: str
    value: float
    standard_error: float
    radius: float
    verdict: str
    reasons: tuple[str, ...]
    estimates: dict[str, tuple[float, float]] = field(repr=False)


def judge(
    name: str,
    estimates: dict[str, tuple[float, float]],
    chaotic: bool,
    radius: float,
    *,
    growth: float,
    multipliers: Complex[ArrayLike, "..."] = np.nan,
    share: float = 0.0,
    drift: tuple[float, float] = (0.0, 0.0),
    settling: bool = False,
) -> Slope:
    """The estimate to use, and whether to believe it.

    `radius` is that of the fit, in the parameter's unit; `growth` the logarithm of what the
    tangent has grown by; `multipliers` those of the orbit, which an implicit slope needs;
    `share` and `drift` those of the fit (see `jaxcrusher.dynamics.fits.Fit`). `settling` is
    whether the motion still comes to another, whose slope may be quite different.
    """
    estimator = "fit" if chaotic else "implicit" if "implicit" in estimates else "tangent"
    value, error = estimates[estimator]
    beside = [estimates[key] for key in (("orbits",) if estimator == "implicit" else FITS)]
    refusals, doubts = [], []
    if not np.isfinite(value):
        refusals.append(f"{estimator} is not finite")
    elif not abs(value) > SIGNIFICANT * error:
        ratio = f"{abs(value) / error:.1f}" if error > 0 else "0 / 0"
        refusals.append(f"slope over its error {ratio} < {SIGNIFICANT:.0f}")
    if chaotic:
        if not _agree(*beside):
            refusals.append(f"fits at two radii disagree: {_listed(beside)}")
        if share > LARGEST_SHARE:
            refusals.append(f"one pair of runs makes {100 * share:.0f} % of the fit")
        if not abs(drift[0]) <= AGREEMENT * abs(value) + 2 * drift[1]:
            refusals.append(f"doubling the window moves the fit by {drift[0]:.4g}")
        if "shadowing" in estimates and not _agree(estimates["shadowing"], beside[0]):
            doubts.append(f"shadowing {estimates['shadowing'][0]:.4g} disagrees with the fit")
    elif not any(_agree((value, error), other) for other in beside):
        against = "orbits beside it" if estimator == "implicit" else "fits"
        said = f"{estimator} {value:.4g} and {against} {_listed(beside)} disagree"
        # The orbit's slope is exact where it stands, but not over the radius; a tangent that
        # disagrees has grown.
        (doubts if estimator == "implicit" else refusals).append(said)
    if estimator == "implicit":
        # How long the motion takes to settle does not matter: it is solved for.
        largest, nearest = np.max(np.abs(multipliers)), np.min(np.abs(np.subtract(multipliers, 1)))
        if not largest < 1:
            refusals.append(f"no motion stays on this orbit: largest multiplier {largest:.6g}")
        if not nearest >= NEAR_ONE:
            refusals.append(f"a multiplier is within {nearest:.1g} of 1: the orbit is about to end")
    if estimator == "tangent" and not growth <= GROWTH:
        refusals.append(f"the tangent grows by exp({growth:.1f}) > exp({GROWTH:.0f})")
    if settling and estimator != "implicit":
        doubts.append("the motion has not settled: this slope is of its transient")
    verdict = "refused" if refusals else "doubtful" if doubts else "ok"
    return Slope(
        name,
        estimator,
        value,
        error,
        radius if chaotic else 0.0,
        verdict,
        (*refusals, *doubts),
        estimates,
    )


def _agree(one: tuple[float, float], other: tuple[float, float]) -> bool:
    """Within the share of agreement of the larger, or two standard errors of the difference."""
    apart = abs(one[0] - other[0])
    allowed = AGREEMENT * max(abs(one[0]), abs(other[0])) + 2 * np.hypot(one[1], other[1])
    return bool(np.isfinite(apart) and apart <= allowed)


def _listed(estimates: list[tuple[float, float]]) -> str:
    return ", ".join(f"{value:.4g}" for value, _ in estimates)

"""Whether a slope may be believed: evidence in, a word out.

A slope is believed if some other estimate agrees with it that could have refuted it, and none
refutes it. An estimate with a large error agrees with everything, so it is no evidence.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import ArrayLike, Complex
from scipy.special import stdtrit
from typing_extensions import override

from jaxcrusher.files.text import digits_apart, number, with_error

# A tangent that has grown by more than exp(3) says more of the start than of the parameter.
GROWTH = 3.0
# An orbit with a multiplier so near to 1 is about to end, or to part in two: it moves by a
# thousand times what a parameter pushes it.
NEAR_ONE = 1e-3
# The chance that a right slope is refuted, all of its comparisons together; that a slope of zero is
# taken to have a sign; and that evidence which counts agrees with a slope although the true one is
# zero or twice as large.
LEVEL = 0.05
# Two estimates agree within this share besides: they have radii and windows of their own.
AGREEMENT = 0.05
# A fit that rests on one pair of runs is an accident.
LARGEST_SHARE = 0.2
# The names of the fits at a radius and at half of it.
FITS = ("fit", "fit at half the radius")


@dataclass(frozen=True)
class Slope:
    """The slope of a statistic by one parameter, in their units.

    `verdict` is "ok", "undecided" (no evidence could have refuted the slope), "doubtful" or
    "refused"; `radius` is that of the fit, 0 for a derivative. `estimates` holds every estimate
    made: name -> (slope, standard error).
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
    freedom: Mapping[str, float] = {},
    multipliers: Complex[ArrayLike, "..."] = np.nan,
    share: float = 0.0,
    drift: tuple[float, float] = (0.0, 0.0),
    unsettled: str = "",
) -> Slope:
    """The estimate to use, and whether to believe it.

    `radius` is that of the fit, in the parameter's unit; `growth` the logarithm of the tangent's
    growth; `freedom` the degrees of freedom of standard errors by their estimates' names, infinite
    where a name is missing; `multipliers` those of the orbit, which an implicit slope needs;
    `share` and `drift` those of the fit (see `jaxcrusher.dynamics.slopes.Fit`). `unsettled` says
    why the motion may still come to another, whose slope may be quite different.
    """
    estimator = "fit" if chaotic else "implicit" if "implicit" in estimates else "tangent"
    names = ("orbits",) if estimator == "implicit" else FITS
    made = {key: _Estimate(*one, freedom.get(key, np.inf)) for key, one in estimates.items()}
    own, beside = made[estimator], {n: made[n] for n in names if n in made and n != estimator}
    # Each comparison gets its part of the level, that of the fit's two windows too (Bonferroni).
    level = LEVEL / max(len(beside) + chaotic, 1)
    refuting = [n for n, other in beside.items() if own.refuted_by(other, level)]
    refusals, doubts = [], []
    if not np.isfinite(own.value):
        refusals.append(f"{estimator} is not finite")
    elif not abs(own.value) > (least := own.quantile(LEVEL)) * own.error:
        ratio = abs(own.value) / own.error if own.error > 0 else np.nan  # both are 0
        count = digits_apart(ratio, least, 2)
        refusals.append(f"slope over its error {ratio:.{count}g} < {least:.{count}g}")
    if chaotic:
        if FITS[1] in refuting:
            refusals.append(f"fits at two radii disagree: {own}, {made[FITS[1]]}")
        if share > LARGEST_SHARE:
            refusals.append(f"one pair of runs makes {100 * share:.0f} % of the fit")
        allowed = AGREEMENT * abs(own.value) + own.quantile(level) * drift[1]
        if not abs(drift[0]) <= allowed:
            refusals.append(f"doubling the window moves the fit by {drift[0]:.4g}")
    elif refuting:
        against = "orbits beside it" if estimator == "implicit" else "fits"
        listed = ", ".join(str(beside[n]) for n in refuting)
        # The orbit's slope is exact where it stands, but not over the radius; a tangent that
        # disagrees has grown.
        (doubts if estimator == "implicit" else refusals).append(
            f"{estimator} {own} and {against} {listed} disagree"
        )
    if estimator == "implicit":
        # How long the motion takes to settle does not matter: it is solved for.
        largest, nearest = np.max(np.abs(multipliers)), np.min(np.abs(np.subtract(multipliers, 1)))
        if not largest < 1:
            refusals.append(f"no motion stays on this orbit: largest multiplier {largest:.6g}")
        if not nearest >= NEAR_ONE:
            refusals.append(f"a multiplier is within {nearest:.1g} of 1: the orbit is about to end")
    if estimator == "tangent" and not growth <= GROWTH:
        count = digits_apart(growth, GROWTH)
        refusals.append(f"the tangent grows by exp({growth:.{count}g}) > exp({GROWTH:g})")
    if unsettled and estimator != "implicit":
        doubts.append(unsettled)
    agreeing = [n for n, other in beside.items() if n not in refuting]
    supported = any(own.could_be_refuted_by(beside[n], level) for n in agreeing)
    missing = []
    if not refusals and not supported:
        listed = " and ".join(f"{n} {beside[n]}" for n in agreeing) or "nothing beside it"
        missing.append(f"undecided: {listed} cannot tell it from zero or from its double")
    verdict = "refused" if refusals else "doubtful" if doubts else "undecided" if missing else "ok"
    return Slope(
        name,
        estimator,
        own.value,
        own.error,
        radius if chaotic else 0.0,
        verdict,
        (*refusals, *doubts, *missing),
        estimates,
    )


@dataclass(frozen=True)
class _Estimate:
    """A slope with its standard error, and the degrees of freedom that this is known by."""

    value: float
    error: float
    freedom: float

    @override
    def __str__(self) -> str:
        return with_error(self.value, self.error) if self.error else number(self.value)

    def quantile(self, level: float) -> float:
        """How many standard errors Student's t exceeds, to either side, with this chance."""
        return -float(stdtrit(self.freedom, level / 2))

    def refuted_by(self, other: "_Estimate", level: float) -> bool:
        """Whether the two differ by more than their errors and their radii explain."""
        apart = self._difference(other)
        allowed = AGREEMENT * max(abs(self.value), abs(other.value))
        return bool(abs(apart.value) > allowed + apart.quantile(level) * apart.error)

    def could_be_refuted_by(self, other: "_Estimate", level: float) -> bool:
        """Whether the other would refute this one, were the true slope zero or twice as large.

        It must do so but for a chance of `LEVEL`. The other then scatters about zero, or about the
        double, and must come out further from this one than `refuted_by` allows.
        """
        apart = self._difference(other)
        quantiles = apart.quantile(level) - float(stdtrit(apart.freedom, LEVEL))
        # Of the double the allowed share is twice that of the slope.
        return bool((1 - 2 * AGREEMENT) * abs(self.value) > quantiles * apart.error)

    def _difference(self, other: "_Estimate") -> "_Estimate":
        """This less the other, with Welch's and Satterthwaite's degrees of freedom."""
        error, parts = np.hypot(self.error, other.error), (self, other)
        if not np.isfinite(error):
            return _Estimate(np.nan, np.inf, 1.0)
        shares = [(one.error / error) ** 4 / one.freedom for one in parts] if error > 0 else [0.0]
        freedom = 1 / sum(shares) if sum(shares) > 0 else np.inf
        return _Estimate(self.value - other.value, float(error), freedom)

"""Slopes of a statistic, each with a verdict on whether it may be believed.

A motion that forgets its start has a slope that the forward tangent finds; a chaotic one has
none at a point: its tangent grows without bound, and a slope exists only at a finite radius.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxcrusher.basics.checks import require, require_choice
from jaxcrusher.basics.plane import Vector
from jaxcrusher.crusher.scene import Scene
from jaxcrusher.crusher.starts import shifted_start
from jaxcrusher.dynamics.fits import fit_slopes
from jaxcrusher.dynamics.regime import Regime, classify
from jaxcrusher.dynamics.shadowing import shadowing_slopes
from jaxcrusher.motion.section import LARGEST, poincare_section, whole
from jaxcrusher.motion.statistics import FURTHER_STATISTICS, STATISTICS
from jaxcrusher.motion.tangents import Tangents, changes, combine, tangents, weights
from jaxcrusher.settled.orbit import orbit_slopes

# A tangent that has grown by more than exp(3) says more of the start than of the parameter.
GROWTH = 3.0
# Slopes known worse than this many standard errors are not known in sign.
SIGNIFICANT = 3.0
# Two estimates agree within this share, or two standard errors of their difference.
AGREEMENT = 0.05
# A fit that rests on one pair of runs is an accident.
LARGEST_SHARE = 0.2
# A chaotic run forgets a start shifted by this many clearances.
START_SHIFT = 1e-3
# Pairs of runs that check a derivative.
QUIET_PAIRS = 6
# Turns whose tangents are integrated, and the tolerance and turns that tell a regime.
TANGENT_TURNS = 40
REGIME_RTOL, REGIME_TURNS = 1e-10, 200


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


@dataclass(frozen=True)
class GradientReport:
    """The slopes of one statistic at one design."""

    metric: str
    regime: Regime
    horizon: int  # turns a run lasts
    growth: tuple[float, float]  # largest exponent times horizon, and its standard error
    slopes: dict[str, Slope]

    @property
    def usable(self) -> bool:
        """Every slope is ok."""
        return all(slope.verdict == "ok" for slope in self.slopes.values())

    def __str__(self) -> str:
        """The motion, and two lines a parameter: the slope, and how the estimates agree."""
        growth = f"exponent x horizon {self.growth[0]:.2g} ± {self.growth[1]:.2g}"
        lines = [f"d {self.metric}; {self.regime}; {growth}"]
        for s in self.slopes.values():
            why = f" ({'; '.join(s.reasons)})" if s.reasons else ""
            lines.append(
                f"  by {s.parameter}: {s.value:.6g} ± {s.standard_error:.2g}, {s.estimator}, "
                f"{s.verdict}{why}"
            )
            others = (
                f"{name} {value:.5g} ± {error:.2g}"
                for name, (value, error) in s.estimates.items()
                if name != s.estimator
            )
            lines += [f"    against {', '.join(others)}"] if len(s.estimates) > 1 else []
        return "\n".join(lines)


def gradient_report(
    scene: Callable[..., Scene],
    metric: str,
    parameters: dict[str, float],
    *,
    settle_turns: int = 50,
    turns: int = 50,
    radius: float = 0.01,
    pairs: int = 32,
    seed: int = 0,
    rtol: float = 1e-9,
    chunk: int = 64,
) -> GradientReport:
    """Slopes of a statistic by named parameters, each with its verdict.

    **Arguments:**

    - `scene`: makes a scene from the parameters, by keyword.
    - `metric`: any of the outputs of `jaxcrusher.statistics`.
    - `parameters`: name -> value: the design.
    - `settle_turns`, `turns`, `rtol`: of every run, as in `jaxcrusher.statistics`.
    - `radius`: of the fit, as a share of each value; a second fit has half of it.
    - `pairs`, `seed`: of runs of a fit, and for the random choice of them.

    **Returns:** a `GradientReport`. Periodic motions get the implicit formula on their orbit,
    other motions that do not grow the forward tangent over the turns after settling, chaotic ones
    the fit; the others stand beside it. A failed motion and a whirl are refused. Standard errors:
    of the implicit formula what a tolerance a hundred times coarser changes, of the tangent half
    the difference of the two halves of its window, of the fit that of its residuals.

    Raises ValueError for an unknown metric, for no parameters, and for an ideal joint.
    """
    require_choice("metric", metric, (*STATISTICS, *FURTHER_STATISTICS))
    require(bool(parameters), "parameters", "name at least one number", parameters)
    names, numbers = tuple(parameters), np.array([*parameters.values()], dtype=float)
    point = jnp.asarray(numbers)
    build = eqx.Partial(_build, scene=scene, names=names)
    here = build(point)
    require(here.joint is not None, "scene", "make scenes with a clearance joint", "an ideal one")
    horizon = settle_turns + turns
    along: list[Tangents] = []

    def jacobians(state: Float[Array, " dims"]) -> np.ndarray:
        along.append(tangents(build, point, metric, state, TANGENT_TURNS, rtol))
        return along[-1].jacobians

    kind = classify(here, settle_turns, max(turns, REGIME_TURNS), REGIME_RTOL, jacobians)
    if kind.exponents is None:
        why = (f"the motion is {kind.name}: outside the model",)
        slopes = {n: Slope(n, "none", np.nan, np.nan, 0.0, "refused", why, {}) for n in names}
        return GradientReport(metric, kind, horizon, (np.nan, np.nan), slopes)
    largest, error = kind.exponents.exponents[0], kind.exponents.errors[0]
    chaotic = kind.exponents.positive
    estimates: dict[str, tuple[np.ndarray, np.ndarray]] = {}
    if kind.name == "periodic":
        assert kind.period is not None and kind.state is not None
        found = orbit_slopes(build, point, metric, kind.state, kind.period)
        estimates |= {} if found is None else {"implicit": found}
    estimates["tangent"] = _tangent(along[0], metric)
    value = eqx.Partial(
        _metric, build=build, metric=metric, settle_turns=settle_turns, turns=turns, rtol=rtol
    )
    fits = []
    for share, name in ((1.0, "fit"), (0.5, "fit at half the radius")):
        fits.append(
            fit_slopes(
                value,
                numbers,
                share * radius * np.abs(numbers),
                pairs if chaotic else QUIET_PAIRS,
                seed,
                START_SHIFT if chaotic else 0.0,
                chunk,
            )
        )
        estimates[name] = fits[-1].slopes, fits[-1].errors
    if chaotic and metric not in LARGEST:
        estimates["shadowing"] = _shadowing(along[0], metric)
    slopes = {}
    for i, name in enumerate(names):
        single = {key: (float(a[i]), float(b[i])) for key, (a, b) in estimates.items()}
        slopes[name] = judge(
            name,
            single,
            chaotic,
            radius * abs(numbers[i]),
            growth=float(largest) * TANGENT_TURNS,
            share=float(fits[0].shares[i]),
            drift=(float(fits[0].drifts[i]), float(fits[0].drift_errors[i])),
        )
    growth = float(largest) * horizon, float(error) * horizon
    return GradientReport(metric, kind, horizon, growth, slopes)


def _build(values: Float[Array, " n"], scene: Callable[..., Scene], names: tuple) -> Scene:
    return scene(**dict(zip(names, values, strict=True)))


def _tangent(along: Tangents, metric: str) -> tuple[np.ndarray, np.ndarray]:
    """The forward tangent from dx/dp = 0 on, and half the difference of its window's halves."""
    found = changes(along, np.zeros(along.forcing.shape[1:]))
    parts = zip(np.array_split(along.values, 2), np.array_split(found, 2), strict=True)
    first, second = (combine(metric, values, part) for values, part in parts)
    with np.errstate(over="ignore", invalid="ignore"):
        return combine(metric, along.values, found), np.abs(first - second) / 2


def _shadowing(along: Tangents, metric: str) -> tuple[np.ndarray, np.ndarray]:
    """Shadowing slopes of the statistic, which is a mean, or a function of one."""
    scale = len(along.values) * weights(metric, along.values)[:, None]
    return shadowing_slopes(
        along.jacobians, along.forcing, scale * along.by_state, scale * along.by_parameter
    )


def _metric(case, build, metric: str, settle_turns: int, turns: int, rtol: float) -> Array:
    """The statistic at `case["point"]`, its start shifted by `case["shift"]` clearances.

    Over all turns, and over the first half of them.
    """
    scene = shifted_start(build(case["point"]), Vector(*case["shift"]))
    section = poincare_section(scene, settle_turns, turns, outputs=(metric,), rtol=rtol)
    values = section.values[metric]
    return jnp.stack([whole(metric, values), whole(metric, values[: -(-turns // 2)])])


def judge(
    name: str,
    estimates: dict[str, tuple[float, float]],
    chaotic: bool,
    radius: float,
    *,
    growth: float,
    share: float = 0.0,
    drift: tuple[float, float] = (0.0, 0.0),
) -> Slope:
    """The estimate to use, and whether to believe it.

    `radius` is that of the fit, in the parameter's unit; `growth` the largest exponent times the
    turns of the tangent; `share` and `drift` those of the fit (see `jaxcrusher.dynamics.fits.Fit`).
    """
    fit, half = estimates["fit"], estimates["fit at half the radius"]
    estimator = "fit" if chaotic else "implicit" if "implicit" in estimates else "tangent"
    value, error = estimates[estimator]
    refusals, doubts = [], []
    if not np.isfinite(value):
        refusals.append(f"{estimator} is not finite")
    elif not abs(value) > SIGNIFICANT * error:
        ratio = f"{abs(value) / error:.1f}" if error > 0 else "0 / 0"
        refusals.append(f"slope over its error {ratio} < {SIGNIFICANT:.0f}")
    if chaotic:
        if not _agree(fit, half):
            refusals.append(f"fits at two radii disagree: {fit[0]:.4g} and {half[0]:.4g}")
        if share > LARGEST_SHARE:
            refusals.append(f"one pair of runs makes {100 * share:.0f} % of the fit")
        if not abs(drift[0]) <= AGREEMENT * abs(value) + 2 * drift[1]:
            refusals.append(f"doubling the window moves the fit by {drift[0]:.4g}")
        if "shadowing" in estimates and not _agree(estimates["shadowing"], fit):
            doubts.append(f"shadowing {estimates['shadowing'][0]:.4g} disagrees with the fit")
    elif not (_agree((value, error), fit) or _agree((value, error), half)):
        against = f"{estimator} {value:.4g} and fits {fit[0]:.4g}, {half[0]:.4g} disagree"
        # The orbit's slope is exact where it stands, but not over the radius; a tangent that
        # disagrees has grown.
        (doubts if estimator == "implicit" else refusals).append(against)
    if growth > GROWTH and not chaotic:
        notice = f"the tangent grows by exp({growth:.1f}) > exp({GROWTH:.0f})"
        (refusals if estimator == "tangent" else doubts).append(notice)
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

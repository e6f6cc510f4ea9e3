"""Slopes of a statistic, each with a verdict on whether it may be believed.

A motion that forgets its start has a slope that the forward tangent finds; a chaotic one has
none at a point: its tangent grows without bound, and a slope exists only at a finite radius.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxcrusher.batch import map_chunks
from jaxcrusher.checks import require, require_choice
from jaxcrusher.orbit import periodic_orbit, periodic_slopes
from jaxcrusher.plane import Vector
from jaxcrusher.regime import Regime, regime
from jaxcrusher.scene import Scene
from jaxcrusher.starts import shifted_start
from jaxcrusher.statistics import STATISTICS, statistics

# A tangent that has grown by more than exp(3) says more of the start than of the parameter.
GROWTH = 3.0
# Slopes known worse than this many standard errors are not known in sign.
SIGNIFICANT = 3.0
# Two estimates agree within this share, or two standard errors of their difference.
AGREEMENT = 0.05
# A chaotic run forgets a start shifted by this many clearances.
START_SHIFT = 1e-3


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
    slopes: dict[str, Slope]

    @property
    def usable(self) -> bool:
        """Every slope is ok."""
        return all(slope.verdict == "ok" for slope in self.slopes.values())

    def __str__(self) -> str:
        """A line for the motion and one a parameter."""
        lines = [f"d {self.metric}; {self.regime}"]
        for s in self.slopes.values():
            why = f" ({'; '.join(s.reasons)})" if s.reasons else ""
            lines.append(
                f"  by {s.parameter}: {s.value:.6g} ± {s.standard_error:.2g}, {s.estimator}, "
                f"{s.verdict}{why}"
            )
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
    - `metric`: any of `jaxcrusher.STATISTICS`.
    - `parameters`: name -> value: the design.
    - `settle_turns`, `turns`, `rtol`: of every run, as in `jaxcrusher.statistics`.
    - `radius`: of the fit, as a share of each value; a second fit has half of it.
    - `pairs`, `seed`: of runs of a fit, and for the random choice of them.

    **Returns:** a `GradientReport`. Periodic motions get the implicit formula on their orbit,
    other motions that do not grow the forward tangent, chaotic ones the fit; the others stand
    beside it. A failed motion and a whirl are refused.
    """
    require_choice("metric", metric, STATISTICS)
    require(bool(parameters), "parameters", "name at least one number", parameters)
    names, point = tuple(parameters), np.array([*parameters.values()], dtype=float)
    build = eqx.Partial(_build, scene=scene, names=names)
    here = build(jnp.asarray(point))
    kind = regime(here, settle_turns, max(turns, 200), tangent_turns=40)
    horizon = settle_turns + turns
    if kind.name in ("failed", "whirl"):
        why = (f"the motion is {kind.name}: outside the model",)
        slopes = {n: Slope(n, "none", np.nan, np.nan, 0.0, "refused", why, {}) for n in names}
        return GradientReport(metric, kind, horizon, slopes)
    assert kind.exponents is not None
    chaotic = kind.exponents.positive
    value = eqx.Partial(
        _metric, build=build, metric=metric, settle_turns=settle_turns, turns=turns, rtol=rtol
    )
    estimates: dict[str, tuple[np.ndarray, np.ndarray]] = {}
    nothing = np.zeros(len(names))
    if kind.name == "periodic":
        assert kind.period is not None and kind.state is not None
        orbit = periodic_orbit(here, jnp.asarray(kind.state), kind.period)
        if orbit is not None:
            slopes = periodic_slopes(build, jnp.asarray(point), metric, orbit, kind.period)
            estimates["implicit"] = (slopes, nothing)
    estimates["tangent"] = (np.asarray(_tangent(value, jnp.asarray(point))), nothing)
    for share, name in ((1.0, "fit"), (0.5, "fit at half the radius")):
        estimates[name] = fit_slopes(
            value, point, share * radius * np.abs(point), pairs if chaotic else 6, seed,
            START_SHIFT if chaotic else 0.0, chunk,
        )  # fmt: skip
    # An exponent that may be zero is taken for zero.
    growth = float(kind.exponents.exponents[0]) * horizon if chaotic else 0.0
    slopes = {}
    for i, name in enumerate(names):
        single = {key: (float(a[i]), float(b[i])) for key, (a, b) in estimates.items()}
        slopes[name] = judge(name, single, growth, chaotic, radius * abs(point[i]))
    return GradientReport(metric, kind, horizon, slopes)


def _build(values: Float[Array, " n"], scene: Callable[..., Scene], names: tuple) -> Scene:
    return scene(**dict(zip(names, values, strict=True)))


@eqx.filter_jit
def _tangent(value: Callable, point: Float[Array, " n"]) -> Float[Array, " n"]:
    return jax.jacfwd(lambda point: value({"point": point, "shift": jnp.zeros(2)}))(point)


def _metric(case, build, metric: str, settle_turns: int, turns: int, rtol: float) -> Array:
    """The statistic at `case["point"]`, its start shifted by `case["shift"]` clearances."""
    scene = shifted_start(build(case["point"]), Vector(*case["shift"]))
    return getattr(statistics(scene, settle_turns, turns, outputs=(metric,), rtol=rtol), metric)


def fit_slopes(
    value: Callable,
    point: Float[np.ndarray, " n"],
    radius: Float[np.ndarray, " n"],
    pairs: int,
    seed: int,
    shift: float = 0.0,
    chunk: int = 64,
) -> tuple[np.ndarray, np.ndarray]:
    """Slopes (n,) and standard errors (n,) by a linear fit over pairs of runs.

    `value` maps {"point": (n,), "shift": (2,)} to a number. The two runs of a pair share their
    start (random within `shift`) and lie at opposite points of the box `point` ± `radius`, so
    that curvature and much of the noise cancel in their difference.
    """
    rng = np.random.default_rng(seed)
    offsets = rng.uniform(0.3, 1.0, (pairs, len(point)))
    # Signs in turn rather than by chance: no two parameters go together.
    offsets *= np.where((np.arange(pairs)[:, None] >> np.arange(len(point))) & 1, 1, -1)
    shifts = np.repeat(rng.uniform(-shift, shift, (pairs, 2)), 2, axis=0)
    signs = np.tile([1.0, -1.0], pairs)[:, None]
    cases = {
        "point": jnp.asarray(point + signs * radius * np.repeat(offsets, 2, axis=0)),
        "shift": jnp.asarray(shifts),
    }
    parts = [np.asarray(part) for _, part in map_chunks(value, cases, chunk)]
    both = np.concatenate(parts).reshape(pairs, 2)
    half = (both[:, 0] - both[:, 1]) / 2
    if not np.isfinite(half).all():
        return np.full(len(point), np.nan), np.full(len(point), np.inf)
    slopes, *_ = np.linalg.lstsq(offsets, half, rcond=None)
    rest = half - offsets @ slopes
    variance = rest @ rest / max(pairs - len(point), 1)
    errors = np.sqrt(variance * np.diag(np.linalg.inv(offsets.T @ offsets)))
    return slopes / radius, errors / radius


def judge(
    name: str, estimates: dict[str, tuple[float, float]], growth: float, chaotic: bool,
    radius: float,
) -> Slope:  # fmt: skip
    """The estimate to use, and whether to believe it.

    `growth` is the largest exponent times the horizon; `radius` that of the fit, in the
    parameter's unit.
    """
    fit, half = estimates["fit"], estimates["fit at half the radius"]
    estimator = "fit" if chaotic else "implicit" if "implicit" in estimates else "tangent"
    value, error = estimates[estimator]
    refusals, doubts = [], []
    if not np.isfinite(value):
        refusals.append(f"{estimator} is not finite")
    elif not abs(value) > SIGNIFICANT * error:
        ratio = abs(value) / error if error > 0 else 0.0
        refusals.append(f"slope over its error {ratio:.1f} < {SIGNIFICANT:.0f}")
    if chaotic and not _agree(fit, half):
        refusals.append(f"fits at two radii disagree: {fit[0]:.4g} and {half[0]:.4g}")
    elif not chaotic and not (_agree((value, error), fit) or _agree((value, error), half)):
        against = f"{estimator} {value:.4g} and fits {fit[0]:.4g}, {half[0]:.4g} disagree"
        # The orbit's slope is exact where it stands, but not over the radius; a tangent that
        # disagrees has grown in the transient.
        (doubts if estimator == "implicit" else refusals).append(against)
    if growth > GROWTH and not chaotic:
        notice = f"exponent x horizon {growth:.1f} > {GROWTH:.0f}: no tangent"
        (refusals if estimator == "tangent" else doubts).append(notice)
    verdict = "refused" if refusals else "doubtful" if doubts else "ok"
    return Slope(
        name, estimator, value, error, radius if chaotic else 0.0, verdict,
        (*refusals, *doubts), estimates,
    )  # fmt: skip


def _agree(one: tuple[float, float], other: tuple[float, float]) -> bool:
    """Within the share of agreement of the larger, or two standard errors of the difference."""
    apart = abs(one[0] - other[0])
    allowed = AGREEMENT * max(abs(one[0]), abs(other[0])) + 2 * np.hypot(one[1], other[1])
    return bool(np.isfinite(apart) and apart <= allowed)

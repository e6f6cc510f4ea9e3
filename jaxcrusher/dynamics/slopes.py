"""Slopes of a statistic, each with a verdict on whether it may be believed.

If a motion forgets its start, the forward tangent finds its slope. A chaotic motion has no slope at
a point: its tangent grows without bound. It has a slope only at a finite radius, by a linear fit
over pairs of runs.
"""

import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from typing_extensions import override

from jaxcrusher.basics.checks import (
    require,
    require_choice,
    require_positive,
    require_untraced,
    require_whole,
    require_within,
)
from jaxcrusher.basics.plane import Vector
from jaxcrusher.basics.traced import traced
from jaxcrusher.batch.engines import map_all
from jaxcrusher.dynamics.judgement import FITS, Slope, judge
from jaxcrusher.dynamics.regime import Regime, classify
from jaxcrusher.files.summary import Row, Summarised, Summary
from jaxcrusher.files.text import measured, number, with_error
from jaxcrusher.mechanism.reductions import Statistic
from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.mechanism.starts import shifted_start
from jaxcrusher.motion.indicators import Lyapunov
from jaxcrusher.motion.method import require_tolerance
from jaxcrusher.motion.section import Slices, poincare_section
from jaxcrusher.motion.tangents import SLICES, changes, combine, tangents
from jaxcrusher.orbits.result import PeriodicOrbit
from jaxcrusher.orbits.shot import shoot
from jaxcrusher.orbits.slopes import orbit_beside, orbit_slopes
from jaxcrusher.scenes.machine import Machine, machine_of
from jaxcrusher.scenes.units import per

# Regime -> why its slope may not be that of the motion in the end.
UNSETTLED = {
    "not settled": "the motion has not settled: this slope is of its transient",
    "undecided": "the motion is undecided: this slope may be of a transient",
}
# A chaotic run forgets a start shifted by this many clearances.
START_SHIFT = 1e-3
# Pairs of runs that check a derivative, at least.
QUIET_PAIRS = 6
# Parts of the tangents' window whose scatter tells the error. Two were alike by chance where a
# swing beats with the shaft, and leave Student's t one degree of freedom; parts of less than ten
# turns would know of each other.
PARTS = 4
# Runs at most in a batch of a fit.
BATCH = 64
# Turns whose tangents are integrated, and the tolerance and turns that tell a regime.
TANGENT_TURNS = 40
REGIME_RTOL, REGIME_TURNS = 1e-10, 200


@dataclass(frozen=True, repr=False)
class GradientReport(Summarised):
    """The slopes of one statistic at one design."""

    metric: str
    regime: Regime
    horizon: int  # turns a run lasts
    growth: tuple[float, float]  # largest exponent times horizon, and its standard error
    slopes: dict[str, Slope]
    units: Mapping[str, str] = field(default_factory=dict)  # of slopes, as far as they are known

    @property
    def usable(self) -> bool:
        """Every slope is ok."""
        return all(slope.verdict == "ok" for slope in self.slopes.values())

    @override
    def _summary(self) -> Summary:
        good = "every slope is ok" if self.usable else "NOT every slope is ok"
        rows, reasons = [], []
        for name, slope in self.slopes.items():
            text = measured(slope.value, self.units.get(name, "1"), slope.standard_error)
            rows.append(Row(f"by {name}", text, f"{slope.verdict}, {slope.estimator}"))
            reasons += [f"{name}: {reason}" for reason in slope.reasons]
        return Summary(
            f"GradientReport of {self.metric}: {good}", rows, (str(self.regime), *reasons)
        )

    @override
    def __str__(self) -> str:
        """The motion, and two lines a parameter: the slope, and how the estimates agree."""
        growth = f"exponent x horizon {with_error(*self.growth)}"
        lines = [f"d {self.metric}; {self.regime}; {growth}"]
        for s in self.slopes.values():
            why = f" ({'; '.join(s.reasons)})" if s.reasons else ""
            lines.append(
                f"  by {s.parameter}: {with_error(s.value, s.standard_error)}, {s.estimator}, "
                f"{s.verdict}{why}"
            )
            others = (
                f"{name} {with_error(value, error) if error else number(value)}"
                for name, (value, error) in s.estimates.items()
                if name != s.estimator
            )
            lines += [f"    against {', '.join(others)}"] if len(s.estimates) > 1 else []
        return "\n".join(lines)


def gradient_report(
    machine: Machine | Callable[..., Scene],
    metric: str,
    parameters: Mapping[str, float] | Sequence[str],
    *,
    settle_turns: int = 50,
    turns: int = 50,
    radius: float = 0.01,
    pairs: int = 32,
    seed: int = 0,
    rtol: float = 1e-9,
    progress: Callable[[str], None] = lambda stage: None,
) -> GradientReport:
    """Slopes of a statistic by named parameters, each with its verdict.

    **Arguments:**

    - `machine`: such as `jaxcrusher.paper_machine(start="contact")`, or a function of your own
      that makes a scene of the parameters, by keyword.
    - `metric`: any of the outputs of `jaxcrusher.statistics`.
    - `parameters`: names of numbers, or names -> values where these are not the machine's.
    - `settle_turns`, `turns`, `rtol`: of every run, as in `jaxcrusher.statistics`.
    - `radius`: of neighbouring orbits and of fits (a second one has half of it), as a share of
      each value, or where that is 0 of the scale `jaxcrusher.PARAMETERS` has for the name.
    - `pairs`, `seed`: of runs of a fit, and for the random choice of them. There are at least
      twice as many pairs as parameters.
    - `progress`: called with the name of each stage as it begins; the stages depend on the motion.

    **Returns:** a `GradientReport`. Periodic motions get the slopes of their orbit, which is solved
    for (`jaxcrusher.orbits.slopes`), beside differences of neighbouring orbits. This takes seconds
    for a start beside a stable motion of one turn in contact; others are classified first. Other
    motions that do not grow get the forward tangent over the turns after settling, chaotic ones the
    fit; the others stand beside it. A failed motion and a whirl are refused. The standard error of
    an orbit's slope is its distance from differences over a thousandth of the radius, of the
    tangent the scatter of the four quarters of its window, and of the fit the scatter of its
    residuals; differences of orbits have none.

    Raises ValueError for an unknown metric, for no parameters, for a value of 0 without a scale,
    for an ideal joint, and for a radius, turns, pairs, a seed or a tolerance out of range.
    """
    machine = machine_of(machine)
    several = isinstance(parameters, Mapping | Sequence) and not isinstance(parameters, str)
    good = several and len(parameters) > 0
    require(good, "parameters", 'name at least one number, as {"speed": 30.0}', repr(parameters))
    if not isinstance(parameters, Mapping):
        parameters = {name: machine.number(name) for name in parameters}
    require_untraced("parameters", parameters, "gradient_report", "jaxcrusher.statistics")
    require_positive("radius", radius, "")
    whole = (("settle_turns", settle_turns, 0), ("turns", turns, 1), ("pairs", pairs, 1))
    for name, count, least in (*whole, ("seed", seed, 0)):
        require_whole(name, count, least)
    require_tolerance(rtol)
    for name, value in parameters.items():
        require_within(f"parameters[{name!r}]", value, -np.inf, np.inf)
    names, numbers = tuple(parameters), np.array([*parameters.values()], dtype=float)
    known = machine.replace(**parameters).numbers
    must = "have a scale (be one of jaxcrusher.PARAMETERS) or not be 0"
    for name, value in parameters.items():
        require(value != 0 or name in known, name, must, value)
    radii = radius * np.array([abs(of) or known[name].scale for name, of in parameters.items()])
    point = jnp.asarray(numbers)
    make = machine.over(*names)
    here = make(point)
    require_choice("metric", metric, tuple(here.statistics))
    require(not here.is_ideal, "machine", "have a joint with clearance", "ideal joints")
    statistic = here.statistics[metric]
    units = {name: per(statistic.unit, known[name].unit) for name in names if name in known}
    build = traced(make, point)
    horizon = settle_turns + turns
    progress("looking for the periodic orbit")

    def of_orbit(orbit: PeriodicOrbit, kind: Regime) -> GradientReport:
        slopes, multipliers = {}, np.asarray(orbit.multipliers)
        columns = orbit_slopes(build, point, metric, radii, orbit)
        for name, radius, *told in zip(names, radii, *columns, strict=True):
            of, value, error, beside = map(float, (radius, *told))
            estimates = {"implicit": (value, error), "orbits": (beside, 0.0)}
            slopes[name] = judge(name, estimates, False, of, growth=0.0, multipliers=multipliers)
        growth = _growth_over(horizon, kind)
        return GradientReport(metric, kind, horizon, growth, slopes, units)

    beside = orbit_beside(here)
    if beside is not None:
        return of_orbit(beside, _regime_of(beside))
    along: list[Slices] = []

    def further(state: Float[Array, " dims"]) -> Slices:
        progress(f"differentiating along {TANGENT_TURNS} turns")
        along.append(tangents(build, point, metric, state, TANGENT_TURNS, rtol))
        return along[-1]

    progress(f"classifying the motion: {settle_turns + max(turns, REGIME_TURNS)} turns")
    kind = classify(here, settle_turns, max(turns, REGIME_TURNS), REGIME_RTOL, further)
    if kind.exponents is None:
        why = (f"the motion is {kind.name}: outside the model",)
        slopes = {n: Slope(n, "none", np.nan, np.nan, 0.0, "refused", why, {}) for n in names}
        return GradientReport(metric, kind, horizon, (np.nan, np.nan), slopes, units)
    if kind.period is not None and kind.state is not None:
        progress("differentiating along its orbit")
        orbit = shoot(here, kind.state, kind.period)
        if bool(orbit.success):
            return of_orbit(orbit, kind)
    chaotic = kind.exponents.positive
    estimates: dict[str, tuple[np.ndarray, np.ndarray]] = {"tangent": _tangent(along[0], statistic)}
    freedom: dict[str, float] = {"tangent": PARTS - 1}
    fits: list[Fit] = []
    value = eqx.Partial(
        _metric, build=build, metric=metric, settle_turns=settle_turns, turns=turns, rtol=rtol
    )
    count = max(pairs if chaotic else QUIET_PAIRS, 2 * len(names))
    shift = START_SHIFT if chaotic else 0.0
    for share, name in zip((1.0, 0.5), FITS, strict=True):
        progress(f"fitting slopes to {2 * count} runs of {horizon} turns")
        fits.append(fit_slopes(value, numbers, share * radii, count, seed, shift))
        estimates[name] = fits[-1].slopes, fits[-1].errors
        freedom[name] = fits[-1].freedom
    grown = _growth_over(TANGENT_TURNS, kind)[0] if chaotic else _growth(along[0])
    slopes = {}
    for i, name in enumerate(names):
        single = {key: (float(a[i]), float(b[i])) for key, (a, b) in estimates.items()}
        slopes[name] = judge(
            name,
            single,
            chaotic,
            radii[i],
            growth=grown,
            freedom=freedom,
            share=float(fits[0].shares[i]),
            drift=(float(fits[0].drifts[i]), float(fits[0].drift_errors[i])),
            unsettled=UNSETTLED.get(kind.name, ""),
        )
    growth = _growth_over(horizon, kind)
    return GradientReport(metric, kind, horizon, growth, slopes, units)


def _regime_of(orbit: PeriodicOrbit) -> Regime:
    """Return the regime of a stable motion that was solved for."""
    exponents = np.sort(np.log(np.abs(orbit.multipliers)))[::-1] / orbit.period
    errors = np.full_like(exponents, float(orbit.multipliers_error))
    evidence = (
        f"largest multiplier {float(orbit.largest_multiplier):.6g}",
        f"settles in {float(orbit.settling_turns):.3g} turns",
        f"penetrates {float(orbit.least_penetration):.2g} clearances at least",
    )
    return Regime("periodic", evidence, orbit.period, Lyapunov(exponents, errors))


def _growth_over(turns: int, kind: Regime) -> tuple[float, float]:
    """Return the largest exponent times so many turns, and its standard error."""
    assert kind.exponents is not None
    largest, error = kind.exponents.exponents[0], kind.exponents.errors[0]
    return float(largest) * turns, float(error) * turns


def _growth(along: Slices) -> float:
    """The logarithm of the spectral radius of all slices together: no unit, no norm enters it."""
    matrix = functools.reduce(lambda before, jacobian: jacobian @ before, along.jacobians)
    return float(np.log(np.max(np.abs(np.linalg.eigvals(matrix)))))


def _tangent(along: Slices, metric: Statistic) -> tuple[np.ndarray, np.ndarray]:
    """The forward tangent from dx/dp = 0 on, and its error by the scatter of its window's parts."""
    found = changes(along, np.zeros(along.forcing.shape[1:]))
    count = len(along.jacobians)
    # Of whole turns, or where there are too few of slices.
    unit = SLICES if count >= PARTS * SLICES else 1
    windows = np.array_split(np.arange(count).reshape(-1, unit), PARTS)
    parts = [jax.tree.map(lambda a, w=w: a[w.ravel()], (along.values, found)) for w in windows]
    slopes = [combine(metric, *part) for part in parts]
    with np.errstate(over="ignore", invalid="ignore"):
        error = np.std(slopes, axis=0, ddof=1) / np.sqrt(PARTS)
        return combine(metric, along.values, found), error


def _metric(case, build, metric: str, settle_turns: int, turns: int, rtol: float) -> Array:
    """The statistic at `case["point"]`, its start shifted by `case["shift"]` clearances.

    Over all turns, and over the first half of them.
    """
    scene = shifted_start(build(case["point"]), Vector(*case["shift"]))
    section = poincare_section(scene, settle_turns, turns, outputs=(metric,), rtol=rtol)
    windows = section[metric], section[metric][: -(-turns // 2)]
    reduction = scene.statistics[metric].reduction
    return jnp.stack([reduction.of_pieces(values) for values in windows])


@dataclass(frozen=True)
class Fit:
    """Slopes by n parameters with standard errors, and what speaks against them.

    `shares` are those of the pair that contributes most, in the sum of all contributions regardless
    of sign. `drifts` are how far the slopes move from the first half of the window to the whole.
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
    both = map_all(value, cases, BATCH).reshape(pairs, 2, 2)
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

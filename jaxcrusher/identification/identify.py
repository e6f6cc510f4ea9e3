"""From measured vibration to the numbers of a machine, with what the data cannot tell."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float
from scipy.linalg import qr
from scipy.optimize import least_squares
from scipy.stats import chi2, qmc
from typing_extensions import override

from jaxcrusher.basics.checks import (
    require,
    require_names,
    require_positive,
    require_whole,
    require_within,
)
from jaxcrusher.basics.setup import cores, require_set_up
from jaxcrusher.files import svg
from jaxcrusher.files.summary import Row, Summarised, Summary
from jaxcrusher.identification.measurements import WHOLE, Measurement, taken
from jaxcrusher.identification.model import (
    Predicted,
    Quantities,
    What,
    look,
    quantities_of,
    require_continuous,
    residual_rows,
)
from jaxcrusher.mechanism.reductions import require_orders
from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.orbits.solving import NODES
from jaxcrusher.scenes.earlier import of_description
from jaxcrusher.scenes.machine import Machine, machine_of
from jaxcrusher.scenes.units import unit_of as shown_in

# A direction cannot be told if its standard deviation is this share of its numbers: the interval
# of 95 % is then as wide as they are.
UNIDENTIFIABLE = 0.5
# How far such a direction is followed, as a share of a number, and which components are named, as a
# share of the largest.
STEP, NAMED = 0.1, 0.1
UNKNOWN = 1e3  # of so many times its size a standard deviation is not said
# Numbers are held near their start by a standard deviation of so many times their size, unless the
# data tell all of them.
HELD = 3.0
# A chance of a larger chi-square below which the model, or the sigmas, are called wrong.
UNLIKELY = 0.01
# Two standard deviations along an axis of the ellipse add 4 to chi-square where the orbit is linear
# within the errors; this is how much more or less is no matter.
AWAY, BENT = 2.0, 1.5
# Starts end in one minimum if their chi-squares differ by less.
SAME = 0.1
# How much the sum of squares still changes in the end, from several starts and from the best.
ROUGH, FINE = 1e-4, 1e-10
STEPS = 60  # of the trust region, at most
EDGE = 1e-6  # how near a bound, in sizes of the number, is on it


@dataclass(frozen=True)
class UnidentifiableDirection:
    """Changes of numbers, made together, that move no measured number by more than `sigmas`."""

    changes: Mapping[str, float]
    sigmas: float


@dataclass(frozen=True)
class OptimalExperiment:
    """A further harmonic, measured with its phase, and what it tells."""

    speed: float  # rad/s
    quantity: str
    order: int
    sigma: float  # assumed
    gain: float  # of information, bits
    standard_deviations: Mapping[str, float]  # with it


@dataclass(frozen=True)
class _LeastSquares:
    """Measurements and priors to be met by u, the numbers in shares of their size."""

    machine: Machine
    quantities: Quantities
    size: Mapping[str, float]
    bounds: Float[np.ndarray, "2 n"]
    measured: Sequence[Measurement]
    prior: Float[np.ndarray, "2 n"]  # mean and 1 / standard deviation of u, which is 0 without
    nodes: int
    known: dict[tuple[bytes, What], dict[float, tuple[Predicted, Predicted]]] = field(
        default_factory=dict
    )

    def look(self, u: np.ndarray, what: What) -> dict[float, tuple[Predicted, Predicted]]:
        """Return what is seen at each speed, and its slopes by u."""
        if (u.tobytes(), what) in self.known:
            return self.known[u.tobytes(), what]
        scenes = self.machine.over(*self.size, "speed")
        sizes = jnp.array([*self.size.values(), 1.0])

        def at(speed: float) -> tuple[Predicted, Predicted]:
            point = jnp.array([*u, speed])
            found = look(scenes, len(u), point, sizes, what, {"nodes": self.nodes})
            return jax.tree.map(np.asarray, found)

        first, *others = sorted({one.speed for one in self.measured})
        seen = {first: at(first)}  # which compiles, once
        with ThreadPoolExecutor(cores()) as pool:
            seen |= zip(others, pool.map(at, others), strict=True)
        self.known[u.tobytes(), what] = seen
        return seen

    def at(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return residuals, n of priors last, and their slopes."""
        seen = self.look(u, self.quantities.asked(self.measured))
        residuals, slopes = residual_rows(self.measured, seen)
        mean, weight = self.prior
        residuals = np.concatenate([residuals, weight * (u - mean)])
        return residuals, np.concatenate([slopes, np.diag(weight)])

    def solve(self, start: np.ndarray, weight: float, ends: float) -> tuple[np.ndarray, float]:
        """Return the least squares from a start and their sum, infinite without an orbit there.

        `weight` is that of a prior at the start. A step to where there is no orbit is shortened.
        """

        def both(u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            residuals, slopes = self.at(u)
            residuals = np.concatenate([residuals, weight * (u - start)])
            return residuals, np.concatenate([slopes, weight * np.eye(len(u))])

        if not np.all(np.isfinite(both(start)[0])):
            return start, np.inf
        found = least_squares(
            lambda u: both(u)[0],
            start,
            lambda u: both(u)[1],  # pyright: ignore
            bounds=self.bounds,
            x_scale="jac",
            max_nfev=STEPS,
            **dict.fromkeys(("ftol", "xtol", "gtol"), ends),
        )
        return found.x, float(np.sum(found.fun[: -len(start)] ** 2))


@dataclass(frozen=True, repr=False)
class Identified(Summarised):
    """Numbers of a machine that measurements tell, and how surely.

    Arrays have the order of `values`. `residuals` are in sigmas; a harmonic with its phase has two.
    The covariance is that of the linear model at the estimate, by the sigmas as given. For a number
    at its limit it is NaN; for the others it holds with that number at its limit.
    """

    values: Mapping[str, float]  # SI units
    covariance: Float[np.ndarray, "n n"]
    measured: Sequence[Measurement]
    fitted: Sequence[complex]  # what the machine shows, A e^(i phi) of a harmonic
    residuals: Float[np.ndarray, " rows"]
    chi_square: float  # with that of priors
    freedom: int  # residuals and priors less directions of numbers that these fit
    unidentifiable: Sequence[UnidentifiableDirection]
    starts: Sequence[float]  # chi-squares that starts came to, the least first; infinite: no orbit
    remarks: Sequence[str]
    problem: _LeastSquares

    @property
    def standard_deviations(self) -> dict[str, float]:
        """Return the standard deviation of each number."""
        return dict(zip(self.values, np.sqrt(np.diag(self.covariance)).tolist(), strict=True))

    @property
    def known(self) -> dict[str, bool]:
        """Return whether each number has a standard deviation of less than 1000 times its size."""
        sizes = self.problem.size
        return {n: one < UNKNOWN * sizes[n] for n, one in self.standard_deviations.items()}

    @property
    def correlations(self) -> Float[np.ndarray, "n n"]:
        """Return the correlations of the estimates."""
        spread = np.sqrt(np.diag(self.covariance))
        return self.covariance / np.outer(spread, spread)

    @property
    def chance(self) -> float:
        """Return the chance of a larger chi-square if the model is right; NaN without freedom."""
        return float(chi2.sf(self.chi_square, self.freedom)) if self.freedom > 0 else np.nan

    def optimal_experiments(
        self, *, orders: int = 4, noise: float | Mapping[str, float] = 0.01
    ) -> list[OptimalExperiment]:
        """Return which further measurements would tell most, the best of each observable.

        They are harmonics with phases up to `orders`, at the speeds measured. `noise` is their
        standard deviation. A number is a share of each observable's largest RMS about its mean, if
        sensors show it (`Scene.measurable`) or it was measured. A mapping has SI units by name of
        any observable, others left out. Gains count from what is known now; without data each
        number is known to its own size. Raises ValueError for deviations that are not above zero.
        """
        require_orders(orders)
        given = [*noise.values()] if isinstance(noise, Mapping) else noise
        require_positive("noise", np.array(given), "")
        problem, size = self.problem, np.array([*self.problem.size.values()])
        u = np.array([*self.values.values()]) / size
        known, observable = problem.quantities, problem.quantities.observable
        seen = {observable(one.quantity) for one in self.measured if one.order != WHOLE}
        shown = (*known.measurable, *sorted(seen.difference(known.measurable)))
        names = tuple(noise) if isinstance(noise, Mapping) else shown
        require_names("noise", names, tuple(known.observables))
        found = problem.look(u, What(names, orders, ()))
        sigmas = dict(noise) if isinstance(noise, Mapping) else dict.fromkeys(names, 0.0)
        if not isinstance(noise, Mapping):
            for seen, _ in found.values():
                for quantity, values in seen.spectra.items():
                    name = observable(quantity)
                    sigmas[name] = max(sigmas[name], noise * float(abs(values[-1])))
        rows = problem.at(u)[1]
        spread = np.linalg.inv(rows.T @ rows + np.eye(len(u)))
        best: dict[str, OptimalExperiment] = {}
        for speed, (_, by) in found.items():
            for quantity, slopes in by.spectra.items():
                name, sigma = observable(quantity), sigmas[observable(quantity)]
                for order, slope in enumerate(slopes[:-1] if sigma > 0 else ()):
                    both = np.stack([slope.real, slope.imag]) / sigma
                    inner = np.eye(2) + both @ spread @ both.T
                    gain = 0.5 * float(np.log2(np.linalg.det(inner)))
                    if name not in best or gain > best[name].gain:
                        left = spread - spread @ both.T @ np.linalg.solve(inner, both @ spread)
                        after = (size * np.sqrt(np.diag(left))).tolist()
                        deviations = dict(zip(self.values, after, strict=True))
                        best[name] = OptimalExperiment(
                            speed, quantity, order, sigma, gain, deviations
                        )
        return sorted(best.values(), key=lambda one: -one.gain)

    def lines(self, units: Mapping[str, str] | None = None) -> list[str]:
        """Return the answer in lines, numbers in `units` by name, or in those of drawings."""

        def said(name: str, value: float, digits: str) -> str:
            unit, size = shown_in(name, units or {})
            return f"{value / size:{digits}} {unit}".rstrip()

        spread, names, known = self.standard_deviations, list(self.values), self.known
        lines = []
        for name, value in self.values.items():
            error = "(at its limit)" if np.isnan(spread[name]) else "(its start: unknown)"
            if known[name]:
                error = f"± {said(name, spread[name], '.2g')}"
            lines.append(f"{name}: {said(name, value, '.6g')} {error}")
        tied = self.correlations
        for i, j in zip(*np.triu_indices(len(names), 1), strict=True):
            if np.isfinite(tied[i, j]):
                lines.append(f"correlation {tied[i, j]:.3f}: {names[i]}, {names[j]}")
        chance = f", larger by chance in {100 * self.chance:.2g} %" if self.freedom > 0 else ""
        lines.append(f"chi-square {self.chi_square:.4g} of {self.freedom} degrees{chance}")
        for one in self.unidentifiable:
            changes = [f"{name} by {said(name, by, '.2g')}" for name, by in one.changes.items()]
            lines.append(
                f"Cannot be told: a change of {' and '.join(changes)} moves no measured number by "
                f"more than {one.sigmas:.2g} sigma."
            )
        return [*lines, *self.remarks]

    @override
    def __str__(self) -> str:
        return "\n".join(self.lines())

    @override
    def _summary(self) -> Summary:
        lines, count = self.lines(), len(self.values)
        rows = [Row(*line.split(": ", 1)) for line in lines[:count]]
        fits = "" if not self.chance < UNLIKELY else ", which the model does NOT fit"
        title = f"Identified: {count} numbers from {len(self.measured)} measurements{fits}"
        return Summary(title, rows, lines[count:])

    @override
    def _picture(self) -> str:
        rows = np.arange(1, len(self.residuals) + 1)
        return svg.curve(rows, self.residuals, "residuals, in sigmas, one after the other")


@of_description
def identify(
    machine: Machine | Callable[..., Scene],
    measured: Path | str | Iterable[Path | str | Measurement],
    free: Sequence[str] | Mapping[str, float],
    *,
    priors: Mapping[str, tuple[float, float]] | None = None,
    starts: int = 3,
    orders: int = 4,
    nodes: int = NODES,
    seed: int = 0,
) -> Identified:
    """Return the numbers of a machine whose periodic orbits show what was measured.

    Nonlinear least squares (SciPy's trust region with bounds) with the exact slopes of the orbits.

    **Arguments:**

    - `machine`: such as `jaxcrusher.read_machine("pump.toml")`, or a function of your own that
      makes a scene of the free numbers and the `speed`, by keyword.
    - `measured`: CSV files as `jaxcrusher.identification.measurements` has them, or `Measurement`s.
      Time series give harmonics up to `orders`, by the phase that the machine's drive has at the
      shaft's angles.
    - `free`: names of numbers to be found, which begin at the machine's values, or names -> values
      to begin with. Bounds are the limits of their scene files.
    - `priors`: names of free numbers -> mean and standard deviation from other knowledge.
    - `starts`: how many. All but the first are drawn by `seed`: each number is off by up to a
      factor of two, or by half of its size if it may be negative.
    - `nodes`: of an orbit, as in `jaxcrusher.periodic_orbit`.

    **Returns:** an `Identified`. Numbers that the data do not determine stay near their start, and
    `unidentifiable` names them. Errors are assumed normal, independent, and small enough for the
    orbit to be linear within them.

    Raises ValueError for bad arguments, and where no start has an orbit at each speed.
    """
    require_set_up()
    require_whole("starts", starts, 1)
    machine, names = machine_of(machine), () if isinstance(free, str) else tuple(free)
    good = 0 < len(names) == len(set(names)) and "speed" not in names
    require(good, "free", "name numbers but the speed, each once", repr(free))
    require_continuous("free", names, machine)
    values = free if isinstance(free, Mapping) else {name: machine.number(name) for name in names}
    problem, begin = _problem(machine, values, priors or {}, nodes)
    known = problem.quantities
    problem = replace(problem, measured=taken(measured, known.unit_of, orders, known.phase))
    shifts = 2 * qmc.LatinHypercube(len(begin), rng=seed).random(starts - 1) - 1
    low, high = problem.bounds[0] + EDGE, problem.bounds[1] - EDGE
    others = [np.where(low > 0, begin * 2**shift, begin + shift / 2) for shift in shifts]
    # Strictly inside of the bounds, where the trust region begins.
    points = [np.clip(point, low, high) for point in (begin, *others)]
    found = [problem.solve(point, 1 / HELD, ROUGH) for point in points]
    found.sort(key=lambda one: one[1])
    best, least = found[0]
    must = "begin where there is a periodic orbit at each speed"
    require(np.isfinite(least), "free", must, f"without one at {starts} starts")
    told = _svd(problem.at(best)[1])[0][-1] > 1 / UNIDENTIFIABLE
    best, _ = problem.solve(best, 0.0 if told else 1 / HELD, FINE)
    return _answer(problem, best, np.array([sum_of for _, sum_of in found]))


def _problem(
    machine: Machine,
    values: Mapping[str, float],
    priors: Mapping[str, tuple[float, float]],
    nodes: int,
) -> tuple[_LeastSquares, Float[np.ndarray, " n"]]:
    """Return what is to be solved but for measurements, checked, and the start in shares."""
    names, numbers = list(values), machine.replace(**values).numbers
    sizes, bounds, known = {}, [], [(0.0, 0.0)] * len(names)
    for name, value in values.items():
        of, every = numbers.get(name), (-np.inf, np.inf)
        low, high = every if of is None else of.limits or (0.0, np.inf)
        require_within(f"free[{name!r}]", value, low, high)
        sizes[name] = size = abs(value) or (1.0 if of is None else of.scale)
        bounds.append((low / size, high / size))
    for name, (mean, sigma) in priors.items():
        require(name in names, "priors", f"name free numbers, {', '.join(names)}", name)
        require_positive(f"priors[{name!r}]", sigma, "")
        require(bool(np.isfinite(mean)), f"priors[{name!r}]", "have a finite mean", mean)
        known[names.index(name)] = mean / sizes[name], sizes[name] / sigma
    # What it shows does not depend on the speed, which a description has.
    scene = machine.scene(**values, **({} if "speed" in machine.values else {"speed": 30.0}))
    bounds, prior = np.array(bounds).T, np.array(known).T
    problem = _LeastSquares(machine, quantities_of(scene), sizes, bounds, (), prior, nodes)
    return problem, np.array([values[name] / sizes[name] for name in names])


def _answer(problem: _LeastSquares, u: np.ndarray, starts: np.ndarray) -> Identified:
    """Return what is known at the least squares."""
    seen = problem.look(u, problem.quantities.asked(problem.measured))
    size = np.array([*problem.size.values()])
    residuals, slopes = residual_rows(problem.measured, seen)
    mean, weight = problem.prior
    inside = np.abs(problem.bounds - u).min(axis=0) > 2 * EDGE
    # Directions in which all numbers move but those that their limits hold.
    strength, among = _svd(np.concatenate([slopes, np.diag(weight)])[:, inside])
    directions = among @ np.eye(len(u))[inside]
    # What nothing tells has a large deviation, and no infinite one.
    least = 1e-12 * strength.max(initial=1.0)
    half = size[:, None] * directions.T / np.maximum(strength, least)
    chi_square = float(residuals @ residuals + np.sum((weight * (u - mean)) ** 2))
    # A direction in which nothing but the hold at its start stops the numbers fits no residual.
    fitted = int(np.count_nonzero(strength > 1 / HELD))
    freedom = len(residuals) + int(np.count_nonzero(weight)) - fitted
    return Identified(
        values=dict(zip(problem.size, (u * size).tolist(), strict=True)),
        covariance=np.where(np.outer(inside, inside), half @ half.T, np.nan),
        measured=problem.measured,
        fitted=[complex(seen[m.speed][0].of(m.quantity, m.order)) for m in problem.measured],
        residuals=residuals,
        chi_square=chi_square,
        freedom=freedom,
        unidentifiable=_unidentifiable(problem, slopes),
        starts=starts.tolist(),
        remarks=[
            *_remarks(problem, inside, seen, starts, float(chi2.sf(chi_square, max(freedom, 1)))),
            *_bends(problem, u, strength, directions, chi_square),
        ],
        problem=problem,
    )


def _svd(matrix: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the singular values of a matrix, zeros for missing rows, and their directions."""
    _, values, directions = np.linalg.svd(matrix)
    return np.pad(values, (0, len(directions) - len(values))), directions


def _unidentifiable(problem: _LeastSquares, slopes: np.ndarray) -> list[UnidentifiableDirection]:
    """Return the directions that the data alone do not tell, the weakest first."""
    strength, directions = _svd(slopes)
    directions, found = directions[strength < 1 / UNIDENTIFIABLE][::-1], []
    # Of any directions that span the same, each has one number that the others leave alone.
    alone = np.array(qr(directions, pivoting=True)[-1])[: len(directions)]
    for direction in np.linalg.solve(directions[:, alone], directions):
        shares = direction / direction[np.abs(direction).argmax()]
        sigmas = float(np.abs(slopes @ (STEP * shares)).max())
        pairs = zip(problem.size.items(), shares.tolist(), strict=True)
        changes = {name: STEP * share * of for (name, of), share in pairs if abs(share) > NAMED}
        found.append(UnidentifiableDirection(changes, sigmas))
    return found


def _bends(
    problem: _LeastSquares,
    u: np.ndarray,
    strength: np.ndarray,
    directions: np.ndarray,
    chi_square: float,
) -> list[str]:
    """Say how far chi-square is from a parabola along axes of the ellipse that can be told."""
    grown = [
        float(np.sum(problem.at(u + side * AWAY / by * direction)[0] ** 2)) - chi_square
        for by, direction in zip(strength, directions, strict=True)
        if by > 1 / UNIDENTIFIABLE
        for side in (1, -1)
    ]
    if not np.isfinite(grown).all():
        return [
            f"{AWAY:g} standard deviations away there is no such machine, or none with a periodic "
            "orbit. Standard deviations are rough."
        ]
    worst = max(grown, key=lambda one: abs(one - AWAY**2), default=AWAY**2)
    if abs(worst - AWAY**2) <= BENT:
        return []
    return [
        f"The errors are not linear: {AWAY:g} standard deviations away chi-square has grown by "
        f"{worst:.2g}, and not by {AWAY**2:g}. Standard deviations are rough."
    ]


def _remarks(
    problem: _LeastSquares,
    inside: np.ndarray,
    seen: Mapping[float, tuple[Predicted, Predicted]],
    starts: np.ndarray,
    chance: float,
) -> list[str]:
    """Say what speaks against the answer."""
    unstable = [f"{speed:.4g}" for speed, (one, _) in seen.items() if not one.stable]
    missing = int(np.isinf(starts).sum())
    other = starts[np.isfinite(starts) & (starts > starts[0] * (1 + ROUGH) + SAME)]
    limited = [name for name, free in zip(problem.size, inside, strict=True) if not free]
    least = other.min(initial=np.inf)
    said = {
        "The data scatter more than their sigmas say: these or the model are wrong.": (
            chance < UNLIKELY
        ),
        f"{missing} of {len(starts)} starts had no periodic orbit.": missing,
        f"{len(other)} of {len(starts)} starts ended at other numbers, the best of them with a "
        f"chi-square of {least:.4g}.": len(other),
        f"No orbit is known to be stable at {', '.join(unstable)} rad/s.": unstable,
        f"At its limit, with no standard deviation: {', '.join(limited)}.": limited,
    }
    return [remark for remark, holds in said.items() if holds]

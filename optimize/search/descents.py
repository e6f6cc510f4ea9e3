"""The local stage: descents by exact gradients on periodic orbits, or by fits without orbits.

Many starts descend in lock-step, so that each round is one batch on all cores.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import optax
import scipy.optimize
from jaxtyping import Array, Bool, Float, PyTree

# A step of the trust region must gain this many standard errors.
SIGNIFICANT = 2.0
# Radius of the first and of the last fit, as shares of the box.
FIRST_RADIUS, LAST_RADIUS = 0.2, 0.01
# A descent ends if the projected gradient in the unit box is below this share of the value.
STATIONARY = 1e-9
EXACT = {"gtol": STATIONARY, "ftol": 0.0}
# A descent with constraints ends if a step gains less than this share of the value.
SETTLED = 1e-14
# In lock-step a step must gain at least the share `GAIN` of the decrease that its slope predicts,
# else the next step is a quarter as long. If a step leaves more than half of the slope along it,
# the next step is ten times as long; else it is the whole step of L-BFGS.
GAIN, SHORTER, STEEP, LONGER = 1e-4, 0.25, 0.5, 10.0
# The first step is at most half of the box, and a failed step below rounding ends a descent.
FIRST_STEP, NO_STEP = 0.5, 1e-12
# Ends of descents nearer to each other than this share of the box are the same minimum.
APART = 1e-2
# The rounding error of a value, as a share of it.
ROUNDING = 1e-15
OPTIMISER = optax.scale_by_lbfgs(memory_size=10)

# Values (m,) at points (m, n), each from the random start with the given number (m,).
Noisy = Callable[[np.ndarray, np.ndarray], np.ndarray]
# Values (*batch) and gradients (*batch, n) at points (*batch, n) of the unit box.
Smooth = Callable[[np.ndarray], tuple[Any, np.ndarray]]


@dataclass(frozen=True)
class Descent:
    """Points of the unit box, (steps + 1, n), values at both ends, and the last gradient (n,)."""

    path: np.ndarray
    first: float
    last: float
    gradient: np.ndarray
    evaluations: int


def above(number: Smooth, least: float) -> Smooth:
    """Return the margin of a number above its lower limit `least`, as a share of this limit."""

    def spare(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        value, slope = number(points)
        return (value - least) / abs(least), slope / abs(least)

    return spare


def negative(number: Smooth) -> Smooth:
    """Return the negative of a number, to maximise the number."""

    def function(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        value, slope = number(points)
        return -value, -slope

    return function


def descend_together(
    function: Smooth,
    starts: Float[np.ndarray, "starts n"],
    upper: Float[np.ndarray, " n"],
    rounds: int,
    progress: Callable[[int, int], None] = lambda done, of: None,
) -> list[Descent]:
    """Descend from many starts in lock-step, inside the box from 0 to `upper`.

    Each round evaluates one point of each unfinished descent, all in one batch. Directions are
    those of optax's L-BFGS without components that press against a bound; steps end at the box.
    A step to NaN fails. `progress` gets the numbers of finished and of all descents.
    """
    tops, count = np.broadcast_to(upper, starts.shape), len(starts)
    points = np.clip(starts, 0, tops)
    values, slopes = (np.array(one) for one in function(points))
    first, scales = values.copy(), np.where(values == 0, 1.0, np.abs(values))[:, None]
    memory = jax.jit(jax.vmap(OPTIMISER.init))(points)
    known = ways, _, left = jax.tree.map(
        np.array, _directions(slopes / scales, memory, points, tops)
    )
    lengths = np.minimum(1.0, FIRST_STEP / np.maximum(np.abs(ways).max(axis=1), 1e-300))
    ended, asked = ~np.isfinite(values), np.ones(count, int)
    paths = [[point.copy()] for point in points]
    for _ in range(rounds):
        ended |= left < STATIONARY
        progress(int(ended.sum()), count)
        going = np.flatnonzero(~ended)
        if not len(going):
            break
        trials = np.clip(points + lengths[:, None] * ways, 0, tops)[going]
        there, rises = function(trials)
        asked[going] += 1
        steps = trials - points[going]
        promised = np.sum(slopes[going] * steps, axis=1)
        rounding = ROUNDING * np.abs(values[going])
        lower = there <= values[going] + GAIN * promised + rounding  # false for NaN
        ended[going] |= ~lower & (np.abs(steps).max(axis=1) < NO_STEP)
        steep, moved = np.zeros(count, bool), np.zeros(count, bool)
        steep[going] = np.sum(rises * steps, axis=1) < STEEP * promised
        new = going[lower]
        moved[new] = True
        points[new], values[new], slopes[new] = trials[lower], there[lower], rises[lower]
        for i in new.tolist():
            paths[i].append(points[i].copy())
        # Only descents that have moved update their memory.
        found = _directions(slopes / scales, known[1], points, tops)
        known = ways, _, left = jax.tree.map(partial(_where, moved), found, known)
        lengths = np.where(moved, np.where(steep, LONGER * lengths, 1.0), SHORTER * lengths)
    return [
        Descent(np.stack(path), float(begun), float(value), slope, int(number))
        for path, begun, value, slope, number in zip(
            paths, first, values, slopes, asked, strict=True
        )
    ]


def _where(which: Bool[np.ndarray, " starts"], new: Array, old: Array) -> np.ndarray:
    return np.where(which.reshape(-1, *(1,) * (new.ndim - 1)), new, old)


@jax.jit
def _directions(
    slopes: Float[Array, "starts n"], memory: PyTree, points: Float[Array, "starts n"], upper: Array
) -> tuple[Float[Array, "starts n"], PyTree, Float[Array, " starts"]]:
    """Return descent directions, the new memory of L-BFGS, and norms of projected gradients."""
    held = ((points <= 0) & (slopes > 0)) | ((points >= upper) & (slopes < 0))
    free = jnp.where(held, 0.0, slopes)
    # The memory takes differences along free coordinates, and only if the curvature is positive.
    places = jnp.where(held, points, memory.params)
    before = jnp.where(held, 0.0, memory.updates)
    rises = jnp.sum((free - before) * (points - places), axis=1, keepdims=True) > 0
    memory = memory._replace(
        params=jnp.where(rises, places, points), updates=jnp.where(rises, before, free)
    )
    with jax.numpy_dtype_promotion("standard"):  # optax mixes types
        steps, memory = jax.vmap(OPTIMISER.update)(free, memory, points)
    memory = memory._replace(updates=slopes)
    ways = jnp.where(held, 0.0, -jnp.asarray(steps))
    uphill = jnp.sum(ways * free, axis=1, keepdims=True) >= 0
    ends = optax.projections.projection_box(points - free, 0.0, upper)
    return jnp.where(uphill, -free, ways), memory, jnp.max(jnp.abs(ends - points), axis=1)


def apart(descents: Sequence[Descent]) -> list[Descent]:
    """Return the descents with distinct ends (see `APART`), best first, without values of NaN."""
    found: list[Descent] = []
    for one in sorted(descents, key=lambda one: one.last):
        near = (np.abs(one.path[-1] - other.path[-1]).max() < APART for other in found)
        if np.isfinite(one.last) and not any(near):
            found.append(one)
    return found


def descend(
    function: Smooth,
    start: Float[np.ndarray, " n"],
    upper: Float[np.ndarray, " n"],
    steps: int,
    spares: Sequence[Smooth] = (),
) -> Descent:
    """Descend by L-BFGS-B inside the box from 0 to `upper`, with at most `steps` iterations.

    The line search turns back where `function` is NaN. From a start with NaN there is no descent.
    `spares` are constraints, which must not be below 0: then SLSQP replaces L-BFGS-B.
    """
    start = np.clip(start, 0, upper)
    first, slope = function(start)
    if not np.isfinite(first):
        return Descent(start[None], float(first), float(first), slope, 1)
    scale = abs(first) or 1.0

    def scaled(point: np.ndarray) -> tuple[float, np.ndarray]:
        value, gradient = function(point)
        if not np.isfinite(value):
            return 2 * first / scale + 1, np.zeros_like(point)
        return value / scale, gradient / scale

    path = [start]
    found = scipy.optimize.minimize(
        scaled,
        start,
        jac=True,
        method="SLSQP" if spares else "L-BFGS-B",
        bounds=[(0.0, float(top)) for top in upper],
        constraints=[_constraint(spare) for spare in spares],
        callback=lambda x: path.append(x.copy()),
        options={"maxiter": steps, **({"ftol": SETTLED} if spares else EXACT)},
    )
    last, gradient = function(found.x)
    return Descent(np.stack([*path, found.x]), float(first), float(last), gradient, found.nfev)


def _constraint(spare: Smooth) -> dict[str, Any]:
    return {
        "type": "ineq",
        "fun": lambda point: np.nan_to_num(spare(point)[0], nan=-1.0),  # NaN breaks the constraint
        "jac": lambda point: spare(point)[1],
    }


def descend_by_fits(
    objective: Noisy,
    starts: Float[np.ndarray, "starts n"],
    *,
    pairs: int = 12,
    rounds: int = 12,
    seed: int = 0,
    progress: Callable[[int, int], None] = lambda done, of: None,
) -> list[Descent]:
    """Descend by trust regions in lock-step, for a noisy objective without usable derivatives.

    Each round fits a plane to `pairs` pairs of runs, at opposite points of a box about each centre.
    Both runs of a pair have the same random start. The step goes down the plane's gradient to the
    edge of the box. It is kept if the mean over as many common random starts falls by more than two
    standard errors of the paired difference; else the box is halved. The pairs of all centres are
    one batch. `progress` gets the numbers of finished and of all descents.

    `objective` maps points (m, n) and starts' numbers (m,) to values (m,), NaN for a failed run.

    Paths are those of the centres. Values are means over common starts, and gradients are NaN.
    """
    rng = np.random.default_rng(seed)
    centres = np.array(starts, dtype=float)
    radii, common = np.full(len(centres), FIRST_RADIUS), rng.integers(2**31, size=pairs)

    def sample(points: np.ndarray) -> np.ndarray:
        found = objective(np.repeat(points, pairs, axis=0), np.tile(common, len(points)))
        return found.reshape(len(points), pairs)

    first = here = sample(centres)
    paths, asked = [centres.copy()], np.full(len(centres), pairs)
    for _ in range(rounds):
        offsets = rng.uniform(-1, 1, (pairs, centres.shape[1]))
        numbers = rng.integers(2**31, size=pairs)
        going = np.flatnonzero((radii >= LAST_RADIUS) & np.isfinite(here).all(axis=1))
        progress(len(centres) - len(going), len(centres))
        if not len(going):
            break
        trials = _downhill(objective, centres[going], radii[going], offsets, numbers)
        asked[going] += 2 * pairs
        led = np.isfinite(trials).all(axis=1)
        tried, better = going[led], np.zeros(len(centres), bool)
        if len(tried):
            there = sample(trials[led])
            asked[tried] += pairs
            gains = _gains(here[tried] - there)
            better[tried[gains]] = True
            centres, here = centres.copy(), here.copy()
            centres[better], here[better] = trials[led][gains], there[gains]
        radii[going] = np.where(better[going], 1.0, 0.5) * radii[going]
        paths.append(centres.copy())
    ends = zip(np.stack(paths, axis=1), first, here, asked, strict=True)
    return [
        Descent(path, float(one.mean()), float(last.mean()), np.full(path.shape[1], np.nan), int(n))
        for path, one, last, n in ends
    ]


def _gains(gains: Float[np.ndarray, "starts pairs"]) -> Bool[np.ndarray, " starts"]:
    """Tell whether paired differences are finite, and their mean is significantly above zero."""
    errors = gains.std(axis=1, ddof=1) / np.sqrt(gains.shape[1])
    return np.isfinite(gains).all(axis=1) & (gains.mean(axis=1) > SIGNIFICANT * errors)


def _downhill(
    objective: Noisy,
    centres: Float[np.ndarray, "starts n"],
    radii: Float[np.ndarray, " starts"],
    offsets: Float[np.ndarray, "pairs n"],
    numbers: np.ndarray,
) -> Float[np.ndarray, "starts n"]:
    """Step down the gradients of fitted planes to the boxes' edges; NaN if too many runs fail."""
    sizes = radii[:, None, None] * offsets
    ends = np.clip(centres[:, None] + np.stack([sizes, -sizes]), 0, 1)
    repeated = np.tile(numbers, 2 * len(centres))
    high, low = objective(ends.reshape(-1, ends.shape[-1]), repeated).reshape(ends.shape[:-1])
    found = np.full(centres.shape, np.nan)
    for i, (rise, apart) in enumerate(zip(high - low, ends[0] - ends[1], strict=True)):
        good = np.isfinite(rise)
        if good.sum() > centres.shape[1]:
            slope, *_ = np.linalg.lstsq(apart[good], rise[good], rcond=None)
            found[i] = centres[i] - radii[i] * slope / max(np.abs(slope).max(), 1e-300)
    return np.clip(found, 0, 1)

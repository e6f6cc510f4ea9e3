"""The local stage: exact gradients on periodic orbits, fits where there are none."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.optimize
from jaxtyping import Float

# A step of the trust region must gain this many standard errors.
SIGNIFICANT = 2.0
# Radius of the first fit and of the last, as shares of the box.
FIRST_RADIUS, LAST_RADIUS = 0.2, 0.01
# A descent ends where the projected gradient by the unit box is so small a share of the value.
STATIONARY = 1e-9
EXACT = {"gtol": STATIONARY, "ftol": 0.0}
# With a constraint it ends where a step gains less than this share of the value.
SETTLED = 1e-14

Objective = Callable[[np.ndarray, np.ndarray], np.ndarray]
# Value and gradient at a point of the unit box.
Smooth = Callable[[np.ndarray], tuple[float, np.ndarray]]


@dataclass(frozen=True)
class Descent:
    """Points of the unit box, (steps + 1, n), the value at both ends and the gradient (n,)."""

    path: np.ndarray
    first: float
    last: float
    gradient: np.ndarray
    evaluations: int


def descend(
    function: Smooth,
    start: Float[np.ndarray, " n"],
    upper: Float[np.ndarray, " n"],
    steps: int,
    spares: Sequence[Smooth] = (),
) -> Descent:
    """L-BFGS-B inside the box from 0 to `upper`, at most `steps` iterations.

    A NaN of `function` is a wall that the line search comes back from. A start without a value
    stays where it is. Where there are `spares`, each must end at least 0: SLSQP sees to that.
    """
    seen: dict[bytes, tuple[float, np.ndarray]] = {}
    known = once(function, seen)
    start = np.clip(start, 0, upper)
    first, slope = known(start)
    if not np.isfinite(first):
        return Descent(start[None], first, first, slope, 1)
    scale = abs(first) or 1.0

    def scaled(point: np.ndarray) -> tuple[float, np.ndarray]:
        value, gradient = known(point)
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
    last, gradient = known(found.x)
    return Descent(np.stack([*path, found.x]), first, last, gradient, len(seen))


def once(number: Smooth, seen: dict[bytes, tuple[float, np.ndarray]]) -> Smooth:
    """Return the number, computed once at each point and remembered in `seen`."""

    def known(point: np.ndarray) -> tuple[float, np.ndarray]:
        key = np.ascontiguousarray(point).tobytes()
        if key not in seen:
            seen[key] = number(point)
        return seen[key]

    return known


def _constraint(spare: Smooth) -> dict[str, Any]:
    known = once(spare, {})  # value and gradient are asked for one by one
    return {
        "type": "ineq",
        "fun": lambda point: known(point)[0],
        "jac": lambda point: known(point)[1],
    }


def descend_by_fits(
    objective: Objective,
    start: Float[np.ndarray, " n"],
    *,
    pairs: int = 12,
    rounds: int = 12,
    seed: int = 0,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A trust region for an objective without a usable derivative, down to its noise.

    Each round fits a plane to runs at opposite points of a box about the centre, `pairs` of
    them, both runs of a pair from one random start; takes the step that lowers the plane most
    inside the box; and keeps it if the mean over as many common random starts falls by more than
    two standard errors of the paired difference. Otherwise the box is halved.

    `objective` maps points (m, n) and starts' numbers (m,) to values (m,); one that fails is NaN.

    Returns the centres, shape (rounds + 1, n), their means and the standard errors, (rounds + 1,).
    """
    rng = np.random.default_rng(seed)
    centre, radius = np.asarray(start, dtype=float), FIRST_RADIUS
    common = rng.integers(2**31, size=pairs)

    def sample(point: np.ndarray) -> np.ndarray:
        return objective(np.tile(point, (pairs, 1)), common)

    here = sample(centre)
    path = [(centre, here)]
    for _ in range(rounds):
        if radius >= LAST_RADIUS and np.isfinite(here).all():
            trial = _downhill(objective, centre, radius, pairs, rng)
            if trial is not None and _gains(here - (there := sample(trial))):
                centre, here = trial, there
            else:
                radius /= 2
        path.append((centre, here))
    centres = np.stack([point for point, _ in path])
    values = np.stack([value for _, value in path])
    return centres, values.mean(axis=1), values.std(axis=1, ddof=1) / np.sqrt(pairs)


def _gains(gain: Float[np.ndarray, " pairs"]) -> bool:
    """Tell whether paired differences are numbers, and their mean is significantly above zero."""
    error = gain.std(ddof=1) / np.sqrt(len(gain))
    return bool(np.isfinite(gain).all() and gain.mean() > SIGNIFICANT * error)


def _downhill(
    objective: Objective,
    centre: Float[np.ndarray, " n"],
    radius: float,
    pairs: int,
    rng: np.random.Generator,
) -> Float[np.ndarray, " n"] | None:
    """Down a plane fitted to runs at opposite points, to the box's edge; None if too many fail."""
    offsets = rng.uniform(-1, 1, (pairs, len(centre)))
    numbers = rng.integers(2**31, size=pairs)
    high = np.clip(centre + radius * offsets, 0, 1)
    low = np.clip(centre - radius * offsets, 0, 1)
    rise = objective(high, numbers) - objective(low, numbers)
    good = np.isfinite(rise)
    if good.sum() <= len(centre):
        return None
    slope, *_ = np.linalg.lstsq((high - low)[good], rise[good], rcond=None)
    return np.clip(centre - radius * slope / max(np.abs(slope).max(), 1e-300), 0, 1)

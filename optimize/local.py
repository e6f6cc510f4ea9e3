"""The local stage: exact gradients where they may be believed, fits elsewhere."""

from collections.abc import Callable
from dataclasses import dataclass

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optax
from jaxtyping import Array, Float

from jaxcrusher.batch.engines import in_turn, map_all
from optimize.evaluate import Case, Progress, Window, quiet_objective

# A quiet motion has no transient to wait for.
GRADIENT_WINDOW = Window(0, 4, 1e-8)
# A step of the trust region must gain this many standard errors.
SIGNIFICANT = 2.0
# Radius of the first fit and of the last, as shares of the box.
FIRST_RADIUS, LAST_RADIUS = 0.2, 0.01

Objective = Callable[[np.ndarray, np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Descent:
    """Paths of points, (steps + 1, runs, n), and the quiet objective on them, (steps + 1, runs).

    `gradient` is that at the ends, by the unit box's coordinates, (runs, n); `steps` counts the
    integration steps, each of which carried the motion and its tangents.
    """

    path: np.ndarray
    values: np.ndarray
    gradient: np.ndarray
    steps: int


def value_and_gradient(
    unit: Float[Array, " n"], case: Case, window: Window
) -> tuple[tuple[Array, Array], Array]:
    """The quiet objective, its steps, and its exact gradient by the unit box's coordinates."""
    return jax.value_and_grad(quiet_objective, has_aux=True)(unit, case, window)


def descend_by_gradients(
    case: Case,
    starts: Float[np.ndarray, "runs n"],
    steps: int,
    progress: Progress,
    window: Window = GRADIENT_WINDOW,
) -> Descent:
    """Adam with projection on the box, from every start at once.

    A point whose gradient is not finite stays where it is.
    """
    function = eqx.Partial(value_and_gradient, case=case, window=window)
    optimiser = optax.adam(optax.cosine_decay_schedule(0.1, steps))
    unit = jnp.asarray(starts)
    state = optimiser.init(unit)
    path, values = [np.asarray(unit)], []
    gradient, taken = np.zeros_like(starts), 0
    for step in range(steps + 1):
        (value, count), gradient = map_all(function, unit, len(starts), in_turn)
        values.append(value)
        taken += int(count.sum())
        if step == steps:
            break
        usable = np.isfinite(gradient).all(axis=-1, keepdims=True)
        # Adam divides by the gradient's own size; the mean only makes it a number near 1.
        scaled = jnp.where(usable, gradient / np.nanmean(np.abs(value)), 0.0)
        updates, state = optimiser.update(scaled, state, unit)
        unit = optax.projections.projection_box(optax.apply_updates(unit, updates), 0.0, 1.0)
        path.append(np.asarray(unit))
        progress(step + 1, steps)
    return Descent(np.stack(path), np.stack(values), np.asarray(gradient), taken)


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

    def sample(point):
        return objective(np.tile(point, (pairs, 1)), common)

    here = sample(centre)
    path = [(centre, here)]
    for _ in range(rounds):
        if radius < LAST_RADIUS or not np.isfinite(here).all():
            path.append((centre, here))
            continue
        offsets = rng.uniform(-1, 1, (pairs, len(centre)))
        numbers = rng.integers(2**31, size=pairs)
        high = np.clip(centre + radius * offsets, 0, 1)
        low = np.clip(centre - radius * offsets, 0, 1)
        rise = objective(high, numbers) - objective(low, numbers)
        good = np.isfinite(rise)
        if good.sum() > len(centre):
            slope, *_ = np.linalg.lstsq((high - low)[good], rise[good], rcond=None)
            trial = np.clip(centre - radius * slope / max(np.abs(slope).max(), 1e-300), 0, 1)
            there = sample(trial)
            gain = here - there
            error = gain.std(ddof=1) / np.sqrt(pairs)
            if np.isfinite(gain).all() and gain.mean() > SIGNIFICANT * error:
                centre, here = trial, there
                path.append((centre, here))
                continue
        radius /= 2
        path.append((centre, here))
    centres = np.stack([point for point, _ in path])
    values = np.stack([value for _, value in path])
    return centres, values.mean(axis=1), values.std(axis=1, ddof=1) / np.sqrt(pairs)

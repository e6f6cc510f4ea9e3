"""Periodic orbits, and the slope of a statistic along with the orbit."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Complex, Float

from jaxcrusher.crusher.formulations import EccentricityFormulation
from jaxcrusher.motion.statistics import over_pieces
from jaxcrusher.motion.tangents import Build, Tangents, chain, changes, combine, tangents

ITERATIONS = 8
# Of the orbit's closure, in clearances and m/s, and the tolerance of its integration.
CLOSURE, RTOL = 1e-7, 1e-11


def periodic_orbit(
    build: Build,
    point: Float[Array, " n"],
    metric: str,
    guess: Float[ArrayLike, " dims"],
    period: int,
) -> tuple[np.ndarray, Tangents] | None:
    """The section point near `guess` that repeats after `period` turns, by Newton's method.

    With it come the derivatives along the orbit. None if the iteration does not converge, or if
    the state holds more than eccentricity and rate (a memory that no impact renews repeats
    whatever it is).
    """
    x = np.asarray(guess, dtype=float)
    # Traced: a neighbour of a parameter at its limit lies outside.
    scene = eqx.filter_eval_shape(build, point)
    if not isinstance(scene.formulation, EccentricityFormulation) or x.size != 4:
        return None
    for _ in range(ITERATIONS):
        along = tangents(build, point, metric, x, period, RTOL)
        if float(np.max(np.abs(along.state - x))) < CLOSURE:
            return x, along
        matrix, _ = chain(along)
        if not np.isfinite(matrix).all():
            return None
        x = x + np.linalg.solve(np.eye(4) - matrix, along.state - x)
    return None


def orbit_shift(along: Tangents) -> Float[np.ndarray, "dims n"]:
    """How the section point of the orbit moves: x = P(x, p) gives (I - P_x)^-1 P_p."""
    matrix, forcing = chain(along)
    return np.linalg.solve(np.eye(len(matrix)) - matrix, forcing)


def periodic_slopes(along: Tangents, metric: str) -> Float[np.ndarray, " n"]:
    """Slopes of `metric` by the parameters, the motion staying on its orbit.

    m(x, p) over a period has the slope m_p + m_x dx/dp, with dx/dp of `orbit_shift`. Exact for a
    motion that has settled; a run that has not differs by its swing.
    """
    return combine(metric, along.values, changes(along, orbit_shift(along)))


def multipliers(along: Tangents) -> Complex[np.ndarray, " dims"]:
    """Floquet multipliers: a shift from the orbit grows by these in a period."""
    return np.linalg.eigvals(chain(along)[0])


def orbit_differences(
    build: Build,
    point: Float[np.ndarray, " n"],
    metric: str,
    orbit: tuple[np.ndarray, Tangents],
    period: int,
    radius: Float[np.ndarray, " n"],
) -> Float[np.ndarray, " n"]:
    """Central differences of `metric` over orbits at `point` ± `radius`, one parameter at a time.

    `orbit` is the one at `point`. NaN where there is no neighbour that repeats after `period`.
    """
    state, along = orbit
    found = np.full(len(point), np.nan)
    for i, shift in enumerate(np.diag(radius)):
        ends = [
            periodic_orbit(
                build,
                jnp.asarray(point + sign * shift),
                metric,
                state + sign * orbit_shift(along) @ shift,
                period,
            )
            for sign in (1, -1)
        ]
        high, low = (np.nan if end is None else _value(end[1], metric) for end in ends)
        found[i] = (high - low) / (2 * radius[i])
    return found


def _value(along: Tangents, metric: str) -> float:
    return float(over_pieces(metric, jnp.asarray(along.values)))

"""Periodic orbits, and the slope of a statistic along with the orbit."""

import numpy as np
from jaxtyping import Array, ArrayLike, Float

from jaxcrusher.crusher.formulations import EccentricityFormulation
from jaxcrusher.motion.tangents import Build, Tangents, chain, changes, combine, tangents

ITERATIONS = 8
# Of the orbit's closure, in clearances and m/s, and the tolerance of its integration.
CLOSURE, RTOL = 1e-7, 1e-11
# A tolerance so much coarser tells what the integration leaves in a slope.
COARSER = 1e4


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
    if not isinstance(build(point).formulation, EccentricityFormulation) or x.size != 4:
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


def periodic_slopes(along: Tangents, metric: str) -> Float[np.ndarray, " n"]:
    """Slopes of `metric` by the parameters, the motion staying on its orbit.

    x = P(x, p) gives dx/dp = (I - P_x)^-1 P_p, and m(x, p) over a period the slope m_p +
    m_x dx/dp. Exact for a motion that has settled; a run that has not differs by its swing.
    """
    matrix, forcing = chain(along)
    moved = np.linalg.solve(np.eye(len(matrix)) - matrix, forcing)
    return combine(metric, along.values, changes(along, moved))


def orbit_slopes(
    build: Build,
    point: Float[Array, " n"],
    metric: str,
    guess: Float[ArrayLike, " dims"],
    period: int,
) -> tuple[np.ndarray, np.ndarray] | None:
    """`periodic_slopes` at the orbit near `guess`, and their change with a coarser tolerance."""
    found = periodic_orbit(build, point, metric, guess, period)
    if found is None:
        return None
    state, along = found
    slopes = periodic_slopes(along, metric)
    coarse = tangents(build, point, metric, state, period, COARSER * RTOL)
    return slopes, np.abs(periodic_slopes(coarse, metric) - slopes)

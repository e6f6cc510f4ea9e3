"""Periodic orbits, and the slope of a statistic along with the orbit."""

from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxcrusher.formulations import EccentricityFormulation
from jaxcrusher.plane import Vector
from jaxcrusher.scene import Scene
from jaxcrusher.section import poincare_section
from jaxcrusher.starts import Given
from jaxcrusher.statistics import statistics

ITERATIONS = 8
# Of the orbit's closure, in clearances and m/s, and the tolerance of its integration.
CLOSURE, RTOL = 1e-7, 1e-11


def periodic_orbit(
    scene: Scene, guess: Float[Array, " dims"], period: int
) -> Float[Array, " 4"] | None:
    """The section point near `guess` that repeats after `period` turns, by Newton's method.

    None if it does not converge, or if the state holds more than eccentricity and rate.
    """
    if not isinstance(scene.formulation, EccentricityFormulation) or guess.size != 4:
        return None
    x = guess
    for _ in range(ITERATIONS):
        after, matrix = _turns(scene, x, period)
        if float(jnp.max(jnp.abs(after - x))) < CLOSURE:
            return x
        x = x + jnp.linalg.solve(jnp.eye(4) - matrix, after - x)
    return None


@eqx.filter_jit
def _turns(scene: Scene, x: Array, period: int) -> tuple[Array, Array]:
    """The point after `period` turns, and its derivative by the point before."""

    def after(x):
        end = poincare_section(scene, 0, period, state=x, rtol=RTOL).states[-1]
        return end, end

    matrix, end = jax.jacfwd(after, has_aux=True)(x)
    return end, matrix


def periodic_slopes(
    build: Callable[[Array], Scene],
    point: Float[Array, " n"],
    metric: str,
    orbit: Float[Array, " 4"],
    period: int,
) -> Float[np.ndarray, " n"]:
    """Slopes of `metric` by the parameters of `build`, the motion staying on its orbit.

    x = P(x, p) gives dx/dp = (I - P_x)^-1 P_p, and m(x, p) over a period the slope m_p +
    m_x dx/dp. Exact for a motion that has settled; a run that has not differs by its swing.
    """

    def both(x, p):
        scene = build(p)
        start = Given(Vector(x[0], x[1]), Vector(x[2], x[3]))
        placed = eqx.tree_at(lambda s: s.start, scene, start)
        after = poincare_section(scene, 0, period, state=x, rtol=RTOL).states[-1]
        result = statistics(placed, 0, period, outputs=(metric,), rtol=RTOL)
        return jnp.append(after, getattr(result, metric))

    by_state, by_point = jax.jit(lambda x, p: jax.jacfwd(both, argnums=(0, 1))(x, p))(orbit, point)
    moved = np.linalg.solve(np.eye(4) - np.asarray(by_state[:4]), np.asarray(by_point[:4]))
    return np.asarray(by_point[4]) + np.asarray(by_state[4]) @ moved

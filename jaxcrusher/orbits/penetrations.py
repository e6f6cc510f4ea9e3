"""How near the pins of an orbit come to leaving their bores."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Scalar

from jaxcrusher.mechanism.reductions import SAMPLES
from jaxcrusher.orbits.forced import pins
from jaxcrusher.periodic.trigonometric import evaluate, resample

# Steps that lead from an instant of a grid to the least penetration beside it.
POLISHED = 3


@eqx.filter_jit
def least_penetrations(x: Float[Array, "nodes dims"]) -> Float[Array, " joints"]:
    """Return the least penetration of each joint over the period, in clearances.

    Between the instants of a grid Newton's method goes on, so that it is smooth in the nodes.
    """
    pairs = pins(x)
    grid = resample(pairs, max(SAMPLES, 4 * len(x)))

    def least(pin: Float[Array, "nodes 2"], grid: Float[Array, "instants 2"]) -> Scalar:
        def step(place: Scalar) -> Scalar:
            e, rate, bend = (evaluate(pin, place, order) for order in range(3))
            curve = rate @ rate + e @ bend
            # A pin at rest is nowhere nearer, and has slopes in reverse too.
            bent = curve > 0
            return jnp.where(bent, e @ rate, 0.0) / jnp.where(bent, 2 * np.pi * curve, 1.0)

        start = jnp.argmin(jnp.sum(grid**2, axis=1)) / len(grid)
        place = jax.lax.fori_loop(0, POLISHED, lambda _, place: place - step(place), start)
        place = jax.lax.stop_gradient(place)
        # The place has slopes, and so the penetration has second derivatives.
        left = step(place)
        place = place - (left - jax.lax.stop_gradient(left))
        return jnp.linalg.norm(evaluate(pin, place)) - 1

    return jax.vmap(least, in_axes=1)(pairs, grid)

"""Orbits from the pins at rest, by continuation in a damping that the machine does not have.

Near a resonance the pin swings too far for Newton's method to come to the orbit from rest. With
x'' = f - k x' in place of x'' = f, and k as large as the swing is fast, the pins only follow their
loads, and rest is a good guess. From there k is lowered to zero in steps that Newton's method can
follow (natural continuation: Allgower and Georg, Introduction to Numerical Continuation Methods,
2003). The result is the motion of least swing among those that coexist: for a resonance of one
degree of freedom the damping at which an amplitude is possible is a function of the amplitude, and
the smallest amplitude comes first.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int, Scalar

from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.orbits import forced
from jaxcrusher.periodic.collocation import collocate
from jaxcrusher.periodic.newton import RESULTS, Factors
from jaxcrusher.periodic.system import System

# The damping, per radian of the shaft, at which rest is as good as an orbit, where contact is kept:
# a swing of 27 to a turn is damped critically by 54. The least that is told from none keeps
# 1 - 3e-7 of a swing in a turn.
HIGHEST, LEAST = 30.0, 1e-7
# What a step leaves of the damping at first, and its power after a step that succeeds.
FIRST, BOLDER = 0.2, 1.5
# A step that would leave more than this share of the damping is given up; so is a search that has
# cost so many of Newton's steps.
SHORTEST, MOST_STEPS = 0.97, 300


class Continued(eqx.Module):
    """An orbit, how the search for it ended, and whether it used the damping."""

    x: Float[Array, "nodes dims"]  # NaN of a failure
    result: RESULTS
    factors: Factors  # of the last of Newton's Jacobians but one
    steps: Int[Array, ""]  # of all searches together
    by_damping: Bool[Array, ""]


class _Lowering(eqx.Module):
    x: Array  # the last orbit, or rest
    damping: Scalar  # at which it is one
    share: Scalar  # of this damping that the next step leaves
    tried: Scalar  # the damping of the next step; first that of the machine, then the highest
    last: Continued
    done: Bool[Array, ""]


def continued_in_damping(
    scene: Scene, period: int, start: Float[Array, "nodes dims"], at_rest: Bool[Array, ""]
) -> Continued:
    """Return the orbit near `start`; if a start at rest fails, by continuation in a damping.

    Pure JAX, and one program of Newton's method for all of it.
    """
    turns = jnp.asarray(2 * np.pi * period)

    def advance(search: _Lowering) -> _Lowering:
        x, root = collocate(System(forced.acceleration, turns, scene, search.tried), search.x)
        good, before = root.success, search.last.steps
        # Of a step that failed, the half on a logarithmic scale.
        halved = jnp.sqrt(jnp.maximum(search.share, LEAST / search.damping))
        begins, arrived = jnp.isinf(search.damping), good & (search.tried == 0)
        share = jnp.where(good, search.share**BOLDER, jnp.where(begins, FIRST, halved))
        damping = jnp.where(good, search.tried, search.damping)
        result = RESULTS.where(good & ~arrived, RESULTS.too_many_steps, root.result)
        orbit = jnp.where(arrived, x, jnp.nan)
        last = Continued(orbit, result, root.factors, before + root.steps, before > 0)
        given_up = ~at_rest | (share > SHORTEST) | (last.steps >= MOST_STEPS)
        # Without an orbit at the highest damping contact is lost, and nodes are of no use.
        given_up |= ~good & begins & (before > 0)
        following = jnp.minimum(share * damping, HIGHEST)
        return _Lowering(
            jnp.where(good, x, search.x),
            damping,
            share,
            jnp.where(following < LEAST, 0.0, following),
            last,
            arrived | given_up,
        )

    size, zero = start.size, jnp.zeros(())
    factors = jnp.eye(size), jnp.arange(size, dtype=jnp.int32)
    none = Continued(start, RESULTS.too_many_steps, factors, jnp.array(0), jnp.array(False))
    first = _Lowering(start, zero + jnp.inf, zero + FIRST, zero, none, jnp.array(False))
    return jax.lax.while_loop(lambda search: ~search.done, advance, first).last

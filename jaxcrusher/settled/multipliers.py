"""Floquet multipliers: what a small disturbance of an orbit is multiplied by in one period.

They are the eigenvalues of the monodromy matrix, which the variational equations along the orbit
give. These are linear: Magnus' expansion of sixth order by Gauss points (Blanes, Casas, Ros, BIT
40, 2000) takes steps that a swing much faster than the drive does not shorten as it does those of
a quadrature, and two numbers of steps tell the error.
"""

import math

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float, Scalar

from jaxcrusher.settled.collocation import System

# Steps a period, and the degree of the exponential's series after two halvings.
STEPS = 1024
DEGREE = 10
# Of Gauss' outer points of an interval from its middle, in intervals.
GAUSS = math.sqrt(0.15)


class Multipliers(eqx.Module):
    """Of an orbit over its period."""

    values: Complex[Array, " twodims"]
    monodromy: Float[Array, "twodims twodims"]  # d(x, x') at the end / at the beginning
    error: Scalar  # estimated, of the matrix, relative to its largest entry

    @property
    def largest(self) -> Scalar:
        """The largest modulus: below 1 the orbit is stable."""
        return jnp.max(jnp.abs(self.values))


def multipliers(system: System, x: Float[Array, "nodes dims"], steps: int = STEPS) -> Multipliers:
    """Of the orbit through the nodes `x`, with `steps` (a power of two) a period.

    Pure JAX, without slopes; NaN where the orbit is.
    """
    system, x = jax.lax.stop_gradient((system, x))
    coarse, fine = (_monodromy(system, x, count) for count in (steps // 2, steps))
    # Twice the steps leave a 64th of the error.
    error = jnp.max(jnp.abs(fine - coarse)) / jnp.max(jnp.abs(fine)) / 63
    good = jnp.all(jnp.isfinite(fine))
    values = jnp.linalg.eigvals(jnp.where(good, fine, 0.0))
    return Multipliers(jnp.where(good, values, jnp.nan), fine, error)


def _monodromy(system: System, x: Array, steps: int) -> Array:
    """The product of all steps, the last on the left. Matrices are stacked along the last axis."""
    dims, step = x.shape[1], system.period / steps
    early, middle, late = (_linearised(system, x, steps, 0.5 + off) for off in (-GAUSS, 0.0, GAUSS))
    # Rates in the unit of the fastest swing, so that all entries are of one size.
    pace = jnp.sqrt(jnp.max(jnp.abs(middle[dims:, :dims])))
    units = jnp.concatenate([jnp.ones(dims), jnp.full(dims, 1 / pace)])
    scale = (units[:, None] / units)[..., None]
    first = step * scale * middle
    second = step / (2 * GAUSS) * scale * (late - early)
    third = step / (2 * GAUSS**2) * scale * (late - 2 * middle + early)
    inner = _bracket(first, second)
    outer = -_bracket(first, 2 * third + inner) / 60
    bend = _bracket(-20 * first - third + inner, second + outer) / 240
    passed = _exponential(first + third / 12 + bend)
    while passed.shape[-1] > 1:
        passed = _product(passed[..., 1::2], passed[..., ::2])
    return passed[..., 0] / scale[..., 0]


def _linearised(system: System, x: Array, steps: int, shift: float) -> Array:
    """The matrix of the variational equations at `shift` of each step."""
    by_x, by_rate = system.slopes(*system.at(x, steps, shift))
    zero, eye = jnp.zeros_like(by_x), jnp.broadcast_to(np.eye(x.shape[1]), by_x.shape)
    stacked = jnp.concatenate(
        [jnp.concatenate([zero, eye], axis=2), jnp.concatenate([by_x, by_rate], axis=2)], axis=1
    )
    return jnp.moveaxis(stacked, 0, -1)


def _product(a: Array, b: Array) -> Array:
    """Of two stacks, as a sum over whole stacks: thousands of calls of `matmul` cost more."""
    return sum(a[:, k, None] * b[None, k] for k in range(1, len(b))) + a[:, 0, None] * b[None, 0]


def _bracket(a: Array, b: Array) -> Array:
    return _product(a, b) - _product(b, a)


def _exponential(matrix: Array) -> Array:
    """Of a stack of matrices whose norms are of order one."""
    quarter, eye = matrix / 4, jnp.eye(len(matrix))[..., None]
    found = eye + quarter / DEGREE
    for degree in range(DEGREE - 1, 0, -1):
        found = eye + _product(quarter, found) / degree
    found = _product(found, found)
    return _product(found, found)

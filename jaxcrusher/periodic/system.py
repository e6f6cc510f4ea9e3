"""A forced system of second order: x'' = f(t, x, x', args), with f of period T in t.

A motion of it is known by x at equally spaced times of the period, its nodes: x' and x'' are
those of the trigonometric polynomial through them.
"""

import functools
from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PyTree, Scalar

from jaxcrusher.basics.loops import one_by_one
from jaxcrusher.basics.record import Printed
from jaxcrusher.periodic.trigonometric import differentiation, nodes, resample

# time, x, x', args -> x''; x of shape (dims,)
Acceleration = Callable[[Scalar, Array, Array, PyTree], Array]


class System(Printed):
    """x'' = acceleration(t, x, x', args) - damping x', with everything of `period` in t."""

    acceleration: Acceleration = eqx.field(static=True)
    period: Scalar
    args: PyTree
    damping: Scalar | None = None

    def residual(self, x: Float[Array, "nodes dims"]) -> Float[Array, "nodes dims"]:
        """Return by what the nodes' acceleration exceeds x''."""
        times, rate, second = self.motion(x)
        found = one_by_one(self.acceleration, (times, x, rate), self.args)
        return found - second - self._damped(rate)

    def residual_and_jacobian(
        self, x: Float[Array, "nodes dims"]
    ) -> tuple[Float[Array, "nodes dims"], Float[Array, "nodes dims nodes dims"]]:
        """Return the residual and its Jacobian: full by differentiation of x, in blocks by f."""
        times, rate, second = self.motion(x)
        (by_x, by_rate), found = self.slopes(times, x, rate)
        return found - second, jacobian(by_x, by_rate, self.matrices(len(x)))

    def slopes(
        self, times: Float[Array, " n"], x: Float[Array, "n dims"], rate: Float[Array, "n dims"]
    ) -> tuple[tuple[Float[Array, "n dims dims"], ...], Float[Array, "n dims"]]:
        """df/dx and df/dx' at some instants, and f."""
        by_both = functools.partial(by_place_and_rate, self.acceleration)
        (by_x, by_rate), found = one_by_one(by_both, (times, x, rate), self.args)
        by_rate = by_rate - self._damped(jnp.eye(x.shape[1])[None])
        return (by_x, by_rate), found - self._damped(rate)

    def acceleration_at(
        self, time: Scalar, x: Float[Array, " dims"], rate: Float[Array, " dims"]
    ) -> Float[Array, " dims"]:
        """Return x'' at one instant."""
        return self.acceleration(time, x, rate, self.args) - self._damped(rate)

    def defect(
        self, x: Float[Array, "nodes dims"], found: Float[Array, "points dims"]
    ) -> Float[Array, "points dims"]:
        """Return by what the accelerations `found` at equally spaced points exceed x'' there.

        It is zero at the nodes of a solution, and between them what the nodes cannot follow.
        """
        pace = 2 * np.pi / self.period
        return found - pace**2 * resample(x, len(found), order=2)

    def at(
        self, x: Float[Array, "nodes dims"], points: int, shift: float = 0.0
    ) -> tuple[Float[Array, " points"], Float[Array, "points dims"], Float[Array, "points dims"]]:
        """Times, x and x' at equally spaced `points` of the period, of the orbit through `x`.

        `shift` in steps between the points.
        """
        rate = 2 * np.pi / self.period * resample(x, points, shift, 1)
        return self.period * (np.arange(points) + shift) / points, resample(x, points, shift), rate

    def matrices(self, count: int) -> tuple[Array, Array]:
        """Return the matrices from values at the nodes to the first two derivatives by t there."""
        pace = 2 * np.pi / self.period
        first, second = differentiation(count)
        return pace * first, pace**2 * second

    def _damped(self, rate: Array) -> Array | float:
        return 0.0 if self.damping is None else self.damping * rate

    def motion(
        self, x: Float[Array, "nodes dims"]
    ) -> tuple[Float[Array, " nodes"], Float[Array, "nodes dims"], Float[Array, "nodes dims"]]:
        """Return the times of the nodes, and x' and x'' there."""
        first, second = self.matrices(len(x))
        return self.period * nodes(len(x)), first @ x, second @ x


def jacobian(
    by_x: Float[Array, "nodes dims dims"],
    by_rate: Float[Array, "nodes dims dims"],
    matrices: tuple[Array, Array],
) -> Float[Array, "nodes dims nodes dims"]:
    """Return the Jacobian of a system's residual from df/dx and df/dx' at its nodes."""
    first, second = matrices
    eye_nodes, eye = jnp.eye(len(by_x)), jnp.eye(by_x.shape[1])
    return (
        jnp.einsum("iab,ij->iajb", by_x, eye_nodes)
        + jnp.einsum("iab,ij->iajb", by_rate, first)
        - jnp.einsum("ab,ij->iajb", eye, second)
    )


@functools.partial(jax.jit, static_argnums=0)  # traced once for all that is asked of orbits
def by_place_and_rate(function: Callable, *instant: PyTree) -> tuple[PyTree, PyTree]:
    """Return the slopes of a function of an instant by x and x', and its value."""

    def twice(*instant) -> tuple[PyTree, PyTree]:
        found = function(*instant)
        return found, found

    return jax.jacfwd(twice, argnums=(1, 2), has_aux=True)(*instant)

"""Periodic solutions of a forced second-order system by Fourier collocation.

x'' = f(t, x, x', args) with f of period T in t. The unknowns are x at equally spaced times of
the period; x' and x'' follow from the trigonometric polynomial through them. Time is given, not
found: the orbit has no freedom of phase, and no multiplier that is always 1.
"""

import functools
from collections.abc import Callable
from types import ModuleType

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.custom_batching import custom_vmap
from jax.scipy.linalg import lu_factor, lu_solve
from jaxtyping import Array, ArrayLike, Bool, Float, PyTree, Scalar

from jaxcrusher.basics.loops import on_a_gpu, one_by_one
from jaxcrusher.orbits.newton import Factors, Root, newton
from jaxcrusher.orbits.trigonometric import differentiation, nodes, resample

# time, x, x', args -> x''; x of shape (dims,)
Acceleration = Callable[[Scalar, Array, Array, PyTree], Array]

# Of the last step, in the unit of x: rounding leaves some 1e-13 of the differentiation matrix.
TOLERANCE, MAX_STEPS = 1e-10, 40
# What the factors of a Jacobian one step away leave of a slope, each time it is put right.
REFINEMENTS = 3


class System(eqx.Module):
    """x'' = acceleration(t, x, x', args) - damping x', with everything of `period` in t."""

    acceleration: Acceleration = eqx.field(static=True)
    period: Scalar
    args: PyTree
    damping: Scalar | None = None

    def residual(self, x: Float[Array, "nodes dims"]) -> Float[Array, "nodes dims"]:
        """Return by what the nodes' acceleration exceeds x''."""
        times, rate, second = self._motion(x)
        found = one_by_one(self.acceleration, (times, x, rate), self.args)
        return found - second - self._damped(rate)

    def linearised(
        self, x: Float[Array, "nodes dims"]
    ) -> tuple[Float[Array, "nodes dims"], Float[Array, "nodes dims nodes dims"]]:
        """Return the residual and its Jacobian: full by differentiation of x, in blocks by f."""
        times, rate, bend = self._motion(x)
        (by_x, by_rate), found = self.slopes(times, x, rate)
        return found - bend, self.jacobian(by_x, by_rate)

    def jacobian(
        self,
        by_x: Float[Array, "nodes dims dims"],
        by_rate: Float[Array, "nodes dims dims"],
        xp: ModuleType = np,
    ) -> Float[Array, "nodes dims nodes dims"]:
        """Return the Jacobian of the residual from df/dx and df/dx' at the nodes.

        `xp` is as in `differentiation`.
        """
        first, second = self.matrices(len(by_x), xp)
        eye_nodes, eye = xp.eye(len(by_x)), xp.eye(by_x.shape[1])
        return (
            jnp.einsum("iab,ij->iajb", by_x, eye_nodes)
            + jnp.einsum("iab,ij->iajb", by_rate, first)
            - jnp.einsum("ab,ij->iajb", eye, second)
        )

    def slopes(
        self, times: Float[Array, " n"], x: Float[Array, "n dims"], rate: Float[Array, "n dims"]
    ) -> tuple[tuple[Float[Array, "n dims dims"], ...], Float[Array, "n dims"]]:
        """df/dx and df/dx' at some instants, and f."""
        by_both = functools.partial(_by_both, self.acceleration)
        (by_x, by_rate), found = one_by_one(by_both, (times, x, rate), self.args)
        by_rate = by_rate - self._damped(jnp.eye(x.shape[1]))
        return (by_x, by_rate), found - self._damped(rate)

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

    def matrices(self, count: int, xp: ModuleType = np) -> tuple[Array, Array]:
        """Return those from values at the nodes to the first two derivatives by t there."""
        pace = 2 * np.pi / self.period
        first, second = differentiation(count, xp)
        return pace * first, pace**2 * second

    def _damped(self, rate: Array) -> Array | float:
        return 0.0 if self.damping is None else self.damping * rate

    def _motion(self, x: Array) -> tuple[Array, Array, Array]:
        first, second = self.matrices(len(x))
        return self.period * nodes(len(x)), first @ x, second @ x


@functools.partial(jax.jit, static_argnums=0)  # traced once for all that is asked of orbits
def _by_both(
    acceleration: Acceleration, *instant: PyTree
) -> tuple[tuple[Float[Array, "dims dims"], ...], Float[Array, " dims"]]:
    """Return the slopes of an acceleration by x and x', and the acceleration."""

    def twice(*instant) -> tuple[Array, Array]:
        found = acceleration(*instant)
        return found, found

    return jax.jacfwd(twice, argnums=(1, 2), has_aux=True)(*instant)


@eqx.filter_jit
def collocate(
    system: System,
    guess: Float[ArrayLike, "nodes dims"],
    *,
    tolerance: float = TOLERANCE,
    max_steps: int = MAX_STEPS,
) -> tuple[Float[Array, "nodes dims"], Root]:
    """Return the orbit near `guess`, an even number of nodes, and how the search for it ended.

    `tolerance` bounds the last step, in the unit of x: choose that of order one. Differentiable
    by the system's numbers in both directions, by the implicit function theorem and never through
    Newton's steps; the guess has no slope. Where the search failed the orbit is NaN.
    """
    system_now, guess = jax.lax.stop_gradient((system, jnp.asarray(guess, float)))
    shape = guess.shape

    def linearised(x: Array) -> tuple[Array, Array]:
        left, matrix = system_now.linearised(x.reshape(shape))
        return left.ravel(), matrix.reshape(guess.size, guess.size)

    root = newton(
        lambda x: system_now.residual(x.reshape(shape)).ravel(),
        linearised,
        guess.ravel(),
        tolerance,
        max_steps,
    )
    x = jnp.where(root.success, root.point, jnp.nan).reshape(shape)
    return attached(system, x, root.factors), root


class Unfactored(eqx.Module):
    """Stands for factors that are found when slopes are asked for, if they are `needed` at all."""

    needed: Bool[Array, ""]


@eqx.filter_custom_jvp
def attached(
    system: System, x: Float[Array, "nodes dims"], factors: Factors | Unfactored
) -> Float[Array, "nodes dims"]:
    """Return the orbit `x`, as the function of the system's numbers that the equations make it.

    `factors` are those of the Jacobian, one step of Newton's before or less.
    """
    return x


@attached.def_jvp
def _attached_jvp(primals, tangents):
    system, x, factors = primals
    x = attached(system, x, factors)

    # Of the differentiated equations, at the orbit itself.
    times, rate, _ = system._motion(x)
    (by_x, by_rate), _ = system.slopes(times, x, rate)
    first, second = system.matrices(len(x))

    def moved(change: Array) -> Array:
        bent = jnp.einsum("iab,ib->ia", by_x, change)
        return bent + jnp.einsum("iab,ib->ia", by_rate, first @ change) - second @ change

    def solve(apply: Callable, right: Array, transposed: int) -> Array:
        if isinstance(factors, Unfactored):
            known = factors.needed, system, by_x, by_rate
            return _directly(transposed)(known, right[None])[0]

        # The factors belong to a point a small step away: each pass squares what that leaves.
        def closer(_, found: Array) -> Array:
            left = (right - apply(found)).ravel()
            return found + lu_solve(factors, left, trans=transposed).reshape(right.shape)

        return jax.lax.fori_loop(0, 1 + REFINEMENTS, closer, jnp.zeros_like(right))

    _, forcing = eqx.filter_jvp(lambda system: system.residual(x), (system,), (tangents[0],))
    if forcing is None:  # by numbers that do not move the orbit
        return x, jnp.zeros_like(x)
    change = jax.lax.custom_linear_solve(
        moved,
        -forcing,
        lambda apply, right: solve(apply, right, 0),
        lambda apply, right: solve(apply, right, 1),
    )
    return x, change


def _directly(transposed: int) -> Callable:
    """Solve the linearised equations for right sides of shape (sides, nodes, dims).

    Under `jax.vmap` right sides of one design share its factors, and on a CPU designs go one after
    the other, so that those that need no solution cost nothing.
    """

    @custom_vmap
    def solve(known: tuple, rights: Array) -> Array:
        needed, system, by_x, by_rate = known

        def solved() -> Array:
            size = by_x.shape[0] * by_x.shape[1]
            # Constants of this program would be copied for every design.
            factors = lu_factor(system.jacobian(by_x, by_rate, jnp).reshape(size, size))
            flat = lu_solve(factors, rights.reshape(len(rights), size).T, trans=transposed)
            return flat.T.reshape(rights.shape)

        return jax.lax.cond(needed, solved, lambda: jnp.zeros_like(rights))

    @solve.def_vmap
    def _(count: int, batched: list, known: tuple, rights: Array) -> tuple[Array, bool]:
        if not any(jax.tree.leaves(batched[0])):
            return solve(known, rights.reshape(-1, *rights.shape[2:])).reshape(rights.shape), True
        leaves, structure = jax.tree.flatten((known, rights))
        flags = jax.tree.leaves(batched)

        def one(i: Array) -> Array:
            own = [leaf[i] if flag else leaf for leaf, flag in zip(leaves, flags, strict=True)]
            return solve(*jax.tree.unflatten(structure, own))

        numbers = jnp.arange(count)
        return (jax.vmap(one)(numbers) if on_a_gpu() else jax.lax.map(one, numbers)), True

    return solve

"""Periodic solutions of a forced second-order system by Fourier collocation.

x'' = f(t, x, x', args) with f of period T in t. The unknowns are x at equally spaced times of
the period; x' and x'' follow from the trigonometric polynomial through them. Time is given, not
found: the orbit has no freedom of phase, and no multiplier that is always 1.
"""

from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.custom_batching import custom_vmap
from jax.scipy.linalg import lu_factor, lu_solve
from jaxtyping import Array, ArrayLike, Bool, Float

from jaxcrusher.basics.checks import require
from jaxcrusher.basics.loops import on_a_gpu
from jaxcrusher.periodic.newton import Factors, Root, newton
from jaxcrusher.periodic.system import System, jacobian

# Of the last step, in the unit of x: rounding leaves some 1e-13 of the differentiation matrix.
TOLERANCE, MAX_STEPS = 1e-10, 40
# What the factors of a Jacobian one step away leave of a slope, each time it is put right.
REFINEMENTS = 3


@eqx.filter_jit
def collocate(
    system: System,
    guess: Float[ArrayLike, "nodes dims"],
    *,
    tolerance: float = TOLERANCE,
    max_steps: int = MAX_STEPS,
) -> tuple[Float[Array, "nodes dims"], Root]:
    """Return the orbit near `guess`, an even number of nodes, and how the search for it ended.

    `tolerance` bounds the last step, in the unit of x: x should be of order one. It is
    differentiable by the system's numbers, forward and in reverse, by the implicit function theorem
    and never through Newton's steps; the guess has no slope. Where the search failed the orbit is
    NaN, and the second result's `failure` says why.

    Raises ValueError for a guess of another shape, or with an odd number of nodes.
    """
    require(jnp.ndim(guess) == 2, "guess", "have shape (nodes, dims)", jnp.shape(guess))
    system_now, guess = jax.lax.stop_gradient((system, jnp.asarray(guess, float)))
    shape = guess.shape

    def residual_and_jacobian(x: Array) -> tuple[Array, Array]:
        left, matrix = system_now.residual_and_jacobian(x.reshape(shape))
        return left.ravel(), matrix.reshape(guess.size, guess.size)

    root = newton(residual_and_jacobian, guess.ravel(), tolerance, max_steps)
    x = jnp.where(root.success, root.point, jnp.nan).reshape(shape)
    return attached(system, x, root.factors), root


class Unfactored(eqx.Module):
    """Stands for factors that are found when slopes are asked for, if they are `needed` at all."""

    needed: Bool[Array, ""]


@eqx.filter_custom_jvp
def attached(
    system: System, x: Float[Array, "nodes dims"], factors: Factors | Unfactored
) -> Float[Array, "nodes dims"]:
    """Return the orbit `x` as an implicit function of the system's numbers.

    `factors` are those of the Jacobian at most one Newton step before.
    """
    return x


@attached.def_jvp
def _attached_jvp(primals, tangents):
    system, x, factors = primals
    x = attached(system, x, factors)

    # Of the differentiated equations, at the orbit itself.
    times, rate, _ = system.motion(x)
    (by_x, by_rate), _ = system.slopes(times, x, rate)
    first, second = system.matrices(len(x))

    def moved(change: Array) -> Array:
        bent = jnp.einsum("iab,ib->ia", by_x, change)
        return bent + jnp.einsum("iab,ib->ia", by_rate, first @ change) - second @ change

    def solve(apply: Callable, right: Array, transposed: int) -> Array:
        if isinstance(factors, Unfactored):
            columns = jnp.stack([first[:, len(x) // 2], second[:, len(x) // 2]])
            known = factors.needed, by_x, by_rate, columns
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
        needed, by_x, by_rate, columns = known

        def solved() -> Array:
            size, count, place = rights[0].size, len(by_x), jnp.arange(len(by_x))
            # Whole matrices, which are circulant, would be copied for every design. Their middle
            # columns hold their largest numbers without loss of digits.
            first, second = columns[:, (place[:, None] - place[None] + count // 2) % count]
            matrix = jacobian(by_x, by_rate, (first, second))
            factors = lu_factor(matrix.reshape(size, size))
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

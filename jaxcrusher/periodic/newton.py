"""Newton's method for a square system, damped so that it does not leap off its guess.

The damping is Deuflhard's error-oriented one (Newton Methods for Nonlinear Problems, 2004,
algorithm NLEQ-ERR): a step is accepted if the next step, seen with the same Jacobian, is shorter.
Unlike a test of the residual, it does not depend on the scaling of the equations; with residuals of
a stiff contact that test accepts only tiny steps.

One iteration is `advanced`. The method `newton` repeats it in one program of JAX; equations whose
evaluation calls several programs are evaluated between two calls of `advanced`.
"""

from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.scipy.linalg import lu_factor, lu_solve
from jaxtyping import Array, Bool, Float, Int, Scalar

from jaxcrusher.basics.record import Printed, words

# The shortest step, as a share of Newton's.
LEAST_SHARE = 1e-6
# In place of zero where it would divide.
TINY = 1e-300


class RESULTS(eqx.Enumeration):  # pyright: ignore
    """How the search ended."""

    successful = ""
    not_finite = "The equations are not finite at the guess."
    no_descent = "Newton's method comes no closer, however short its steps."
    too_many_steps = "Newton's method has not converged within its steps."


Factors = tuple[Float[Array, "n n"], Int[Array, " n"]]


class Root(Printed):
    """Where Newton's method is or has ended, and the LU factors of the Jacobian one step before."""

    point: Float[Array, " n"]  # to be looked at next unless done: a share of a step from `start`
    start: Float[Array, " n"]
    step: Float[Array, " n"]  # Newton's
    share: Scalar
    factors: Factors  # at `start`
    jacobian: Float[Array, "n n"]  # where the equations were seen last, before the last step
    steps: Int[Array, ""]  # factorisations
    done: Bool[Array, ""]
    result: RESULTS

    @property
    def success(self) -> Bool[Array, "*batch"]:
        """Converged."""
        return self.result == RESULTS.successful

    @property
    def failure(self) -> str:
        """Why there is no zero, or nothing (one search with concrete values only)."""
        return words(RESULTS, self.result)


@jax.jit
def first_iterate(guess: Float[Array, " n"]) -> Root:
    """Return the method before it has looked at its guess."""
    eye, none, whole = jnp.eye(guess.size), jnp.zeros_like(guess), jnp.ones(())
    factors = eye, jnp.arange(guess.size, dtype=jnp.int32)
    count, done, why = jnp.zeros((), int), jnp.array(False), RESULTS.too_many_steps
    return Root(guess, guess, none, whole, factors, eye, count, done, why)


@jax.jit
def advanced(
    now: Root,
    left: Float[Array, " n"],
    matrix: Float[Array, "n n"],
    tolerance: float | Scalar,
    max_steps: int | Int[Array, ""],
    noise: float | Scalar = 0.0,
    least: float | Scalar = LEAST_SHARE,
) -> Root:
    """Return the next iterate from the residual and the Jacobian at the point of this one.

    It converges when the next step is at most `tolerance` in every entry, or the residual at most
    `noise`; that step is then taken. After a whole step the last Jacobian tells the next step, and
    the new Jacobian is not factorised. The method fails where less than the share `least` of a step
    would have to be taken.
    """
    begins = now.steps == 0
    following, length = lu_solve(now.factors, -left), _size(now.step)
    shorter, retry = _tested(now.step, length, following, now.share)
    converged = ~begins & (now.share == 1) & (_largest(following) <= tolerance)
    # What is left of a step may be the noise of an integration, which shrinks no more.
    quiet = _largest(left) <= noise
    accepted = (begins | shorter | quiet) & ~converged
    exhausted = accepted & (now.steps >= max_steps)
    goes_on = accepted & ~exhausted
    factors = jax.lax.cond(goes_on, lambda: lu_factor(matrix), lambda: now.factors)
    own = lu_solve(factors, -left)
    arrived = goes_on & (quiet | (_largest(own) <= tolerance))
    foreseen = _foreseen(following, now.share * length, own, least)
    share = jnp.where(goes_on, jnp.where(begins | arrived, 1.0, foreseen), retry)
    step, start = (
        jnp.where(goes_on, new, old) for new, old in ((own, now.step), (now.point, now.start))
    )
    lost = ~(converged | exhausted) & ~(jnp.isfinite(_size(step)) & (share >= least))
    point = jnp.where(lost, start, start + share * step)
    point = jnp.where(exhausted, now.point, point)
    point = jnp.where(converged, now.point + following, point)
    result = RESULTS.where(converged | arrived, RESULTS.successful, RESULTS.too_many_steps)
    result = RESULTS.where(lost, RESULTS.no_descent, result)
    able = ~begins | jnp.all(jnp.isfinite(left))
    result = RESULTS.where(able, result, RESULTS.not_finite)
    steps = now.steps + goes_on.astype(int)
    done = converged | arrived | exhausted | lost
    return Root(point, start, step, share, factors, matrix, steps, done, result)


def newton(
    residual_and_jacobian: Callable[[Array], tuple[Array, Array]],
    guess: Float[Array, " n"],
    tolerance: float | Scalar,
    max_steps: int | Int[Array, ""],
) -> Root:
    """Return a zero near `guess` of equations; `linearised` gives their residual and Jacobian.

    Where no step is allowed the guess is looked at. The equations stand in one place of the
    program, so that they are compiled once. Pure JAX; not to be differentiated through.
    """
    limits = tolerance, jnp.asarray(max_steps, int)

    def advance(now: Root) -> Root:
        return advanced(now, *residual_and_jacobian(now.point), *limits)

    return jax.lax.while_loop(lambda now: ~now.done, advance, first_iterate(guess))


def _foreseen(expected: Array, moved: Scalar, step: Array, least: float | Scalar) -> Scalar:
    """Return the share of a step to try first.

    After a move of length `moved` the last Jacobian expected the step `expected`. By how much it
    mistook `step` tells how much of it to trust.
    """
    mistaken = _size(expected - step)
    share = moved * _size(expected) / jnp.maximum(mistaken * _size(step), TINY)
    return jnp.clip(share, least, 1.0)


def _tested(step: Array, length: Scalar, following: Array, share: Scalar) -> tuple[Array, Scalar]:
    """Return whether a share of a step of some length is accepted, and else the share to try.

    `following` is the step from there, seen with the same Jacobian.
    """
    size = _size(following)
    # Deuflhard's estimate: the share at which the equations still look straight.
    curved = _size(following - (1 - share) * step)
    straight = 0.5 * length * share**2 / jnp.maximum(curved, TINY)
    usable = jnp.isfinite(size)
    retry = jnp.where(usable, jnp.minimum(straight, share / 2), share / 2)
    return usable & (size <= (1 - share / 4) * length), retry


def _size(vector: Array) -> Scalar:
    """Return the root mean square."""
    return jnp.sqrt(jnp.mean(vector**2))


def _largest(vector: Array) -> Scalar:
    """Return the largest absolute value."""
    return jnp.max(jnp.abs(vector))

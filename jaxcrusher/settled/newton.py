"""Newton's method for a square system, damped so that it does not leap off its guess.

The damping is Deuflhard's error-oriented one (Newton Methods for Nonlinear Problems, 2004,
algorithm NLEQ-ERR): a step is accepted if the next step, seen with the same Jacobian, is shorter.
It does not depend on how the equations are scaled, as a test of the residual would; with
residuals of a stiff contact that test accepts only tiny steps.
"""

from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.scipy.linalg import lu_factor, lu_solve
from jaxtyping import Array, Bool, Float, Int, Scalar

# The shortest step, as a share of Newton's.
LEAST_SHARE = 1e-6


class RESULTS(eqx.Enumeration):  # pyright: ignore
    """How the search ended."""

    successful = ""
    not_finite = "The equations are not finite at the guess."
    no_descent = "Newton's method comes no closer, however short its steps."
    too_many_steps = "Newton's method has not converged within its steps."


Factors = tuple[Float[Array, "n n"], Int[Array, " n"]]


class Root(eqx.Module):
    """Where Newton's method ended, and the LU factors of the Jacobian one step before."""

    point: Float[Array, " n"]
    factors: Factors
    steps: Int[Array, ""]  # factorisations
    result: RESULTS

    @property
    def success(self) -> Bool[Array, "*batch"]:
        """Converged."""
        return self.result == RESULTS.successful


class _Iterate(eqx.Module):
    point: Array
    factors: Factors
    share: Scalar  # of Newton's step, to be tried next
    step: Array  # the next step as the last Jacobian foresaw it
    length: Scalar  # of the last Newton step, times the share that was taken of it
    steps: Int[Array, ""]
    done: Bool[Array, ""]
    result: RESULTS


class _Trial(eqx.Module):
    share: Scalar
    next_share: Scalar
    point: Array
    step: Array
    settled: Bool[Array, ""]
    lost: Bool[Array, ""]


def newton(
    residual: Callable[[Array], Array],
    linearised: Callable[[Array], tuple[Array, Array]],
    guess: Float[Array, " n"],
    tolerance: float,
    max_steps: int,
) -> Root:
    """A zero of `residual` near `guess`; `linearised` gives the residual and its Jacobian.

    Converged when a further step, with the last Jacobian, is at most `tolerance` in every entry;
    that step is then taken. Pure JAX; not to be differentiated through.
    """
    successful = RESULTS.successful

    def advance(state: _Iterate) -> _Iterate:
        left, matrix = linearised(state.point)
        factors = lu_factor(matrix)
        step = lu_solve(factors, -left)
        length = _size(step)
        # By how much the last Jacobian mistook this step tells how much of it to trust.
        mistaken = _size(state.step - step)
        foreseen = state.length * _size(state.step) / jnp.maximum(mistaken * length, 1e-300)
        share = jnp.where(state.steps == 0, 1.0, jnp.clip(foreseen, LEAST_SHARE, 1.0))
        trial = _damped(residual, state.point, step, factors, share, tolerance)
        steps = state.steps + 1
        exhausted = steps >= max_steps
        lost = trial.lost | ~jnp.isfinite(length)
        result = RESULTS.where(exhausted, RESULTS.too_many_steps, successful)
        result = RESULTS.where(trial.settled, successful, result)
        result = RESULTS.where(lost, RESULTS.no_descent, result)
        able = (state.steps > 0) | jnp.all(jnp.isfinite(left))
        result = RESULTS.where(able, result, RESULTS.not_finite)
        return _Iterate(
            jnp.where(lost, state.point, trial.point),
            factors,
            trial.share,
            trial.step,
            trial.share * length,
            steps,
            trial.settled | lost | exhausted,
            result,
        )

    n, none = guess.size, jnp.zeros_like(guess)
    first = _Iterate(
        guess,
        (jnp.eye(n), jnp.arange(n, dtype=jnp.int32)),
        jnp.ones(()),
        none,
        jnp.zeros(()),
        jnp.array(0),
        jnp.array(False),
        RESULTS.too_many_steps,
    )
    last = jax.lax.while_loop(lambda state: ~state.done, advance, first)
    return Root(last.point, last.factors, last.steps, last.result)


def _damped(
    residual: Callable[[Array], Array],
    point: Array,
    step: Array,
    factors: Factors,
    share: Scalar,
    tolerance: float,
) -> _Trial:
    """The share of Newton's step after which the next one is shorter."""
    length = _size(step)

    def attempt(share: Scalar) -> tuple[_Trial, Bool[Array, ""]]:
        tried = point + share * step
        left = residual(tried)
        following = lu_solve(factors, -left)
        size = _size(following)
        usable = jnp.isfinite(size)
        # Deuflhard's estimate: the share at which the equations still look straight.
        bend = _size(following - (1 - share) * step)
        straight = 0.5 * length * share**2 / jnp.maximum(bend, 1e-300)
        shorter = usable & (size <= (1 - share / 4) * length)
        retry = jnp.where(usable, jnp.minimum(straight, share / 2), share / 2)
        settled = usable & (share == 1) & (jnp.max(jnp.abs(following)) <= tolerance)
        end = jnp.where(settled, tried + following, tried)
        lost = ~(shorter | settled) & ~(retry >= LEAST_SHARE)
        trial = _Trial(share, retry, end, following, settled, lost)
        return trial, shorter | settled | lost

    # One loop, so that what it does is compiled once. Where there is no step there is no share.
    no = jnp.array(False)
    none = _Trial(share, share, point, step, no, no), ~jnp.isfinite(length)
    return jax.lax.while_loop(lambda s: ~s[1], lambda s: attempt(s[0].next_share), none)[0]


def _size(vector: Array) -> Scalar:
    """Root mean square."""
    return jnp.sqrt(jnp.mean(vector**2))

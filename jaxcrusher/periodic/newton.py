"""Newton's method for a square system, damped so that it does not leap off its guess.

The damping is Deuflhard's error-oriented one (Newton Methods for Nonlinear Problems, 2004,
algorithm NLEQ-ERR): a step is accepted if the next step, seen with the same Jacobian, is shorter.
It does not depend on how the equations are scaled, as a test of the residual would; with
residuals of a stiff contact that test accepts only tiny steps.

It is written once and driven twice: by `newton`, which is one program of JAX, and by
`newton_on_host`, for equations whose evaluation calls several programs and holds their Jacobian.
"""

from collections.abc import Callable
from types import ModuleType
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.scipy.linalg import lu_factor, lu_solve
from jaxtyping import Array, Bool, Float, Int, Scalar

from jaxcrusher.basics.record import Printed, words

# The shortest step, as a share of Newton's; from the host, where each evaluation takes seconds.
LEAST_SHARE, LEAST_ON_HOST = 1e-6, 0.1
# In place of zero where it would divide.
TINY = 1e-300


class RESULTS(eqx.Enumeration):  # pyright: ignore
    """The search ended so."""

    successful = ""
    not_finite = "The equations are not finite at the guess."
    no_descent = "Newton's method comes no closer, however short its steps."
    too_many_steps = "Newton's method has not converged within its steps."


Factors = tuple[Float[Array, "n n"], Int[Array, " n"]]


class Root(Printed):
    """Where Newton's method ended, and the LU factors of the Jacobian one step before."""

    point: Float[Array, " n"]
    factors: Factors
    jacobian: Float[Array, "n n"]  # where the equations were seen last, before the last step
    steps: Int[Array, ""]  # factorisations
    result: RESULTS

    @property
    def success(self) -> Bool[Array, "*batch"]:
        """Converged."""
        return self.result == RESULTS.successful

    @property
    def failure(self) -> str:
        """Why there is no zero, or nothing (one search with concrete values only)."""
        return words(RESULTS, self.result)


def _foreseen(expected: Any, moved: Any, step: Any, xp: ModuleType) -> Any:
    """Return the share of a step to try first.

    After a move of length `moved` the last Jacobian expected the step `expected`. By how much it
    mistook `step` tells how much of it to trust.
    """
    mistaken = _size(expected - step, xp)
    share = moved * _size(expected, xp) / xp.maximum(mistaken * _size(step, xp), TINY)
    return xp.clip(share, LEAST_SHARE, 1.0)


def _tested(step: Any, length: Any, following: Any, share: Any, xp: ModuleType) -> tuple[Any, Any]:
    """Return whether a share of a step of some length is accepted, and else the share to try.

    `following` is the step from there, seen with the same Jacobian.
    """
    size = _size(following, xp)
    # Deuflhard's estimate: the share at which the equations still look straight.
    bend = _size(following - (1 - share) * step, xp)
    straight = 0.5 * length * share**2 / xp.maximum(bend, TINY)
    usable = xp.isfinite(size)
    retry = xp.where(usable, xp.minimum(straight, share / 2), share / 2)
    return usable & (size <= (1 - share / 4) * length), retry


def _size(vector: Any, xp: ModuleType = jnp) -> Any:
    """Return the root mean square."""
    return xp.sqrt(xp.mean(vector**2))


class _Iterate(eqx.Module):
    point: Array  # to be looked at next: a share of a step away from `start`
    start: Array
    step: Array  # Newton's, from `start`
    share: Scalar
    factors: Factors  # at `start`
    jacobian: Array  # where the equations were seen last
    steps: Int[Array, ""]
    done: Bool[Array, ""]
    result: RESULTS


def newton(
    linearised: Callable[[Array], tuple[Array, Array]],
    guess: Float[Array, " n"],
    tolerance: float | Scalar,
    max_steps: int | Int[Array, ""],
) -> Root:
    """Return a zero near `guess` of equations; `linearised` gives their residual and Jacobian.

    Converged when a further step, with the last Jacobian, is at most `tolerance` in every entry;
    that step is then taken. Where no step is allowed the guess is looked at. The equations stand
    in one place of the program, so that they are compiled once. Pure JAX; not to be differentiated
    through.
    """

    def advance(now: _Iterate) -> _Iterate:
        left, matrix = linearised(now.point)
        begins = now.steps == 0
        following, length = lu_solve(now.factors, -left), _size(now.step)
        shorter, retry = _tested(now.step, length, following, now.share, jnp)
        small = jnp.max(jnp.abs(following)) <= tolerance
        converged = ~begins & (now.share == 1) & small
        accepted = (begins | shorter) & ~converged
        exhausted = accepted & (now.steps >= max_steps)
        goes_on = accepted & ~exhausted
        factors = jax.lax.cond(goes_on, lambda: lu_factor(matrix), lambda: now.factors)
        own = lu_solve(factors, -left)
        foreseen = jnp.where(begins, 1.0, _foreseen(following, now.share * length, own, jnp))
        step, start = (
            jnp.where(goes_on, new, old) for new, old in ((own, now.step), (now.point, now.start))
        )
        share = jnp.where(goes_on, foreseen, retry)
        finite = jnp.isfinite(_size(step))
        lost = ~(converged | exhausted) & ~(finite & (share >= LEAST_SHARE))
        result = RESULTS.where(exhausted, RESULTS.too_many_steps, RESULTS.successful)
        result = RESULTS.where(lost, RESULTS.no_descent, result)
        able = ~begins | jnp.all(jnp.isfinite(left))
        point = jnp.where(lost, start, start + share * step)
        point = jnp.where(exhausted, now.point, point)
        return _Iterate(
            jnp.where(converged, now.point + following, point),
            start,
            step,
            share,
            factors,
            matrix,
            now.steps + goes_on.astype(int),
            converged | exhausted | lost,
            RESULTS.where(able, result, RESULTS.not_finite),
        )

    n, none = guess.size, jnp.zeros_like(guess)
    first = _Iterate(
        guess,
        guess,
        none,
        jnp.ones(()),
        (jnp.eye(n), jnp.arange(n, dtype=jnp.int32)),
        jnp.eye(n),
        jnp.array(0),
        jnp.array(False),
        RESULTS.too_many_steps,
    )
    last = jax.lax.while_loop(lambda now: ~now.done, advance, first)
    return Root(last.point, last.factors, last.jacobian, last.steps, last.result)


class HostRoot(NamedTuple):
    """A zero, the Jacobian one step before, what else was evaluated there, and evaluations."""

    point: np.ndarray
    jacobian: np.ndarray
    seen: Any
    steps: int


def newton_on_host(
    evaluated: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray, Any]],
    guess: Float[np.ndarray, " n"],
    tolerance: float,
    max_steps: int,
    noise: float = 0.0,
) -> HostRoot | None:
    """Return a zero near `guess` of equations that give their Jacobian with their residual.

    `evaluated` returns the residual, its Jacobian, and anything that is to be kept. Converged when
    a Newton step is at most `tolerance` in every entry, or the residual at most `noise`; that step
    is then taken. None where the method fails.
    """
    point, share, last = guess, 1.0, None
    for count in range(1, max_steps + 1):
        left, jacobian, seen = evaluated(point)
        step, quiet = linear_solution(jacobian, -left), np.max(np.abs(left)) <= noise
        if last is not None:
            start, before, matrix = last
            expected = linear_solution(matrix, -left)
            length = _size(before, np)
            accepted, retry = _tested(before, length, expected, share, np)
            # What is left of a step may be the noise of an integration, which shrinks no more.
            if not (accepted or quiet or np.max(np.abs(expected)) <= tolerance):
                share = float(retry)
                if share < LEAST_ON_HOST:
                    return None
                point = start + share * before
                continue
            share = float(_foreseen(expected, share * length, step, np))
        largest = np.max(np.abs(step))
        if not np.isfinite(largest):
            return None
        if quiet or largest <= tolerance:
            return HostRoot(point + step, jacobian, seen, count)
        last = point, step, jacobian
        point = point + share * step
    return None


def linear_solution(
    matrix: Float[np.ndarray, "n n"], right: Float[np.ndarray, " n *sides"]
) -> Float[np.ndarray, " n *sides"]:
    """Return the solution of linear equations, not finite where the matrix is singular."""
    try:
        return np.linalg.solve(matrix, right)
    except np.linalg.LinAlgError:
        return np.full(right.shape, np.nan)

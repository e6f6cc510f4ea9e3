"""Integration of a motion together with its totals and, when asked, its sensitivities.

Derivatives are forward sensitivities: the tangent of the state by every perturbed number is
integrated beside the state, under the same error control. (Differentiating through the steps
controls the error of the state only; with the state at rest it returned derivatives 66 %
wrong at any tolerance.) The rule is linear in the tangents, so `jax.grad`, `jax.jacfwd` and
`jax.jvp` all work; the cost grows with the number of perturbed numbers. With an `adjoint`
diffrax differentiates instead.
"""

import dataclasses
import functools
from collections.abc import Callable
from typing import Any

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Bool, Float, Int, PyTree, Scalar

from jaxcrusher.basics.checks import all_finite, nan_unless
from jaxcrusher.basics.following import (
    Followed,
    Following,
    FollowingSolver,
    Instant,
    first_followed,
    rates,
    state_alone,
)
from jaxcrusher.basics.last_step import floats_counted_at_once
from jaxcrusher.basics.loops import integrator
from jaxcrusher.basics.record import Printed, words

# How much narrower the tolerance is where second derivatives come along. A penetration is a
# twentieth of a clearance, and so is the change of clearance in which the error of a slope may
# turn: at a tolerance of 1e-9 second derivatives of the RMS were 12 % off, and are 1e-3 off so.
NARROWER = 100.0
# What an error of a second derivative weighs then. The second derivative of the contact's force
# jumps where its smoothed corner ends, by 1e5 m/s2 for a clearance that grows by all of itself. At
# full weight no step of more than 1e-14 s would pass there.
SECOND = 1e-5
# Tangents are carried in multiples of this, the last ones zero: XLA makes vector instructions of
# loops over whole registers of doubles, and scalar ones of others (3 cost more than 4).
REGISTER = 4


class Carried(eqx.Module):
    """The state of an integration: the motion, and totals that it does not depend on."""

    motion: PyTree[Array]
    totals: PyTree[Array]


class Sensitive(eqx.Module):
    """A state and its tangents, stacked along the first axis of each leaf."""

    state: Any
    tangents: Any


class InitialValueProblem(eqx.Module):
    """The functions of an integration, which depend on `args`.

    The independent variable is the caller's. `observe` is evaluated at every saved time.
    `summarise` takes the stacked observations of a segment, the `Carried` at its end, and the
    numbers that `following` has kept there. Each segment begins these numbers anew.
    """

    # Diffrax and derivatives call these about ten times; jitted they are traced once.
    initial: Callable[[PyTree], Any] = eqx.field(converter=jax.jit)  # args -> Carried
    # time, state, args -> Carried, or what is observed
    field: Callable[[Any, Any, PyTree], Any] = eqx.field(converter=jax.jit)
    observe: Callable[[Any, Any, PyTree], PyTree] = eqx.field(converter=jax.jit)
    summarise: Callable[[PyTree, Any, PyTree], PyTree]  # observations, Carried, what is kept
    following: Following | None = None


class Integration(eqx.Module):
    """Solver, step-size controller and bounds, passed to `diffrax.diffeqsolve` as they are.

    `adjoint` None means forward sensitivities; a diffrax adjoint replaces them. The first
    step is always given: where the motion is NaN, diffrax's own choice is NaN too, and it
    runs on to `max_steps` instead of failing.
    """

    solver: diffrax.AbstractSolver
    stepsize_controller: diffrax.AbstractStepSizeController
    max_steps: int = eqx.field(static=True)
    dt0: float = eqx.field(static=True)
    adjoint: diffrax.AbstractAdjoint | None


class RESULTS(diffrax.RESULTS):  # pyright: ignore
    """The results of diffrax, and one for a failure that diffrax does not check."""

    not_finite = "The motion is not finite."


class Outcome(Printed):
    """How an integration ended: its result, the time it came to, and the steps it took."""

    result: RESULTS
    reached: Scalar
    steps: Int[Array, ""]  # accepted and rejected
    # The largest relative change of the state at the end of a segment, by the relative change of a
    # number; 0 without derivatives.
    sensitivity: Scalar = eqx.field(default_factory=lambda: jnp.zeros(()))

    @property
    def success(self) -> Bool[Array, "*batch"]:
        """Whether the integration came to its end."""
        return self.result == RESULTS.successful


def failure_text(outcome: Outcome, unit: str) -> str:
    """One line on a failed integration, empty for one that succeeded (concrete values only).

    `unit` is that of the independent variable.
    """
    if bool(outcome.success):
        return ""
    if bool(outcome.result == RESULTS.max_steps_reached):
        # That of diffrax names an argument that is not here.
        reason = "The bound of steps was reached; `method=jc.Method(max_steps=...)` sets another."
    else:
        reason = words(RESULTS, outcome.result)
    return f"stopped at {float(outcome.reached):.6g} {unit}: {reason}"


def error_norm(error: PyTree) -> Scalar:
    """The root mean square over the motion; totals do not count unless there is no motion.

    With sensitivities it is the largest over the state and each of its tangents, so that
    derivatives never loosen the control of the motion itself.
    """
    error = error.state if isinstance(error, Followed) else error
    largest = _largest(error, 0)
    second = isinstance(error, Sensitive) and isinstance(error.state, Sensitive)
    return NARROWER * largest if second else largest


def pi_controller(tolerance: Scalar | float) -> diffrax.PIDController:
    """Return a PI controller with equal relative and absolute tolerance, and a smallest step."""
    return diffrax.PIDController(
        rtol=tolerance,
        atol=tolerance,
        pcoeff=0.4,
        icoeff=0.3,
        norm=error_norm,
        dtmin=1e-14,
        force_dtmin=False,
    )


def _largest(error: PyTree, order: int) -> Scalar:
    """Return the largest error, where that of a derivative of an order weighs by `SECOND`."""
    if isinstance(error, Sensitive):
        tangents = jax.vmap(lambda tangent: _largest(tangent, order + 1))(error.tangents)
        return jnp.maximum(_largest(error.state, order), jnp.max(tangents))
    if isinstance(error, Carried) and jax.tree.leaves(error.motion):
        return _largest(error.motion, order)
    squares = [jnp.sum(leaf**2) for leaf in jax.tree.leaves(error)]
    count = sum(leaf.size for leaf in jax.tree.leaves(error))
    weight = SECOND ** max(order - 1, 0)
    return weight * jnp.sqrt(sum(squares, jnp.zeros(())) / max(count, 1))


def integrate(
    args: PyTree,
    times: Float[Array, "segments saves"],
    *,
    problem: InitialValueProblem,
    method: Integration,
) -> tuple[PyTree, Outcome]:
    """Integrate from 0 through consecutive segments, each ending at its last time.

    Totals restart from zero at every segment. Returns the summaries, stacked over segments,
    and the outcome. From a failed step on every number is NaN.
    """
    if method.adjoint is not None:
        return _march(args, times, problem, method)
    return _beside_tangents(args, times, problem=problem, method=method)


@eqx.filter_custom_jvp
def _beside_tangents(args, times, *, problem: InitialValueProblem, method: Integration):
    """Integrate, with a rule for derivatives that carries tangents beside the motion."""
    return _march(args, times, problem, method)


@_beside_tangents.def_jvp
def _integrate_jvp(primals, tangents, *, problem: InitialValueProblem, method: Integration):
    args, times = primals
    args_dot, times_dot = tangents
    if times_dot is not None:
        raise ValueError(
            "Argument `times` must not be differentiated, but is traced by a derivative; "
            "the rate of an output is an output of its own."
        )
    moves = jax.tree.map(lambda dot: dot is not None, args_dot, is_leaf=lambda dot: dot is None)
    perturbed, fixed = eqx.partition(args, moves)
    values, unravel = ravel_pytree(perturbed)
    # Tangents by relative changes of a number: of the same units and size as the state. They are
    # units, and cancel: a second derivative has none by them.
    scales = jax.lax.stop_gradient(jnp.where(values == 0, 1.0, jnp.abs(values)))
    augmented = _with_tangents(problem, unravel)
    (summary, jacobian, sensitivities), outcome = integrate(
        (values, scales, fixed), times, problem=augmented, method=method
    )
    outcome = dataclasses.replace(outcome, sensitivity=jnp.max(sensitivities))
    weights = jnp.pad(ravel_pytree(args_dot)[0] / scales, (0, -values.size % REGISTER))
    summary_dot = jax.tree.map(
        lambda leaf: jnp.tensordot(weights, jnp.moveaxis(leaf, 1, 0), axes=1), jacobian
    )
    return (summary, outcome), (summary_dot, jax.tree.map(lambda _: None, outcome))


@functools.cache  # so that one trace serves programs of several counts
def _with_tangents(problem: InitialValueProblem, unravel: Callable) -> InitialValueProblem:
    """The problem that carries the derivative by every entry of a vector of numbers."""

    def along_each(function, args, *operands_and_tangents):
        """The function and its derivatives; operands come as (value, stacked tangents)."""
        values, scales, fixed = args
        operands = [operand for operand, _ in operands_and_tangents]

        def inner(values, *operands):
            return function(*operands, eqx.combine(unravel(values), fixed))

        stacked = [tangents for _, tangents in operands_and_tangents]
        seeds = jnp.pad(jnp.diag(scales), ((0, -scales.size % REGISTER), (0, 0)))
        found, pushed = jax.linearize(inner, values, *operands)
        return found, jax.vmap(pushed)(seeds, *stacked)

    def initial(args):
        return Sensitive(*along_each(problem.initial, args))

    def field(time, y, args):
        rate = along_each(lambda s, a: problem.field(time, s, a), args, (y.state, y.tangents))
        return Sensitive(*rate)

    def observe(time, y, args):
        return along_each(lambda s, a: problem.observe(time, s, a), args, (y.state, y.tangents))

    def with_tangents(function, values, tangents):
        """A function of values and its derivatives along stacked tangents of these."""
        pushed = jax.vmap(lambda *dots: jax.jvp(function, values, dots)[1])
        return function(*values), pushed(*tangents)

    def summarise(observed, end, kept):
        # Observations are stacked over the saved times first, then over the tangents.
        by_tangent = jax.tree.map(lambda leaf: jnp.moveaxis(leaf, 1, 0), observed[1])
        kept = Sensitive(None, None) if kept is None else kept
        values = observed[0], end.state, kept.state
        tangents = by_tangent, end.tangents, kept.tangents
        return *with_tangents(problem.summarise, values, tangents), _sensitivity(end)

    following = problem.following
    if following is None:
        return InitialValueProblem(initial, field, observe, summarise)

    def begin(args):
        return Sensitive(*along_each(following.begin, args))

    def watch(time, y, args):
        look = following.watch
        return Sensitive(*along_each(lambda s, a: look(time, s, a), args, (y.state, y.tangents)))

    def follow(kept, *instants):
        # Of the state's own steps the times have no tangents.
        def at_times(kept, *seen):
            known = (Instant(one.time, now) for one, now in zip(instants, seen, strict=True))
            return following.follow(kept, *known)

        values = kept.state, *(one.seen.state for one in instants)
        tangents = kept.tangents, *(one.seen.tangents for one in instants)
        return Sensitive(*with_tangents(at_times, values, tangents))

    return InitialValueProblem(initial, field, observe, summarise, Following(begin, watch, follow))


def _sensitivity(end: Sensitive) -> Scalar:
    """Return how many times its size a state changes along with a number by all of itself."""
    state, tangents = (
        jnp.max(jnp.abs(ravel_pytree(y)[0]), initial=0.0).astype(float)
        for y in jax.lax.stop_gradient((_motion(end.state), _motion(end.tangents)))
    )
    return jnp.where(state > 0, tangents / state, 0.0)


def _motion(y: Carried | Sensitive) -> PyTree:
    """Return the motion alone, without its derivatives."""
    return y.motion if isinstance(y, Carried) else _motion(y.state)


def _restarted(y: Carried | Sensitive) -> Carried | Sensitive:
    """The same motion with totals zero."""
    if isinstance(y, Sensitive):
        return Sensitive(_restarted(y.state), _restarted(y.tangents))
    return Carried(y.motion, jax.tree.map(jnp.zeros_like, y.totals))


def _march(
    args, times, problem: InitialValueProblem, method: Integration
) -> tuple[PyTree, Outcome]:
    """The loop over segments."""
    start, y = jnp.zeros_like(times[0, 0]), problem.initial(args)
    success = RESULTS.promote(diffrax.RESULTS.successful)
    # A NaN among the numbers is one outside its limits: see `scenes.parameters.within_limits`.
    able = RESULTS.where(all_finite((y, args)), success, RESULTS.not_finite)
    if not jax.tree.leaves(y):
        summary = nan_unless(able == success, _evaluate(args, times, y, problem))
        return summary, Outcome(able, times[-1, -1], jnp.array(0))
    if integrator.value is not None:
        # It looks at the state alone.
        return integrator.value(args, times, nan_unless(able == success, y), problem, method)
    following, solver, field = problem.following, method.solver, problem.field
    if following is not None:
        solver = FollowingSolver(solver, following)
        field = functools.partial(rates, field=field)

    def segment(carry, saves):
        start, y, before = carry
        # After a failure the remaining segments have no length, and their numbers are NaN.
        dead = before.result != success
        saves = jnp.where(dead, start, saves)
        y = y if following is None else first_followed(following, start, y, args)
        with floats_counted_at_once():
            solution = diffrax.diffeqsolve(
                diffrax.ODETerm(field),
                solver,
                start,
                saves[-1],
                method.dt0,
                y,
                args,
                saveat=diffrax.SaveAt(
                    subs=[
                        diffrax.SubSaveAt(t1=True),
                        diffrax.SubSaveAt(ts=saves, fn=state_alone),
                    ]
                ),
                stepsize_controller=method.stepsize_controller,
                max_steps=method.max_steps,
                adjoint=diffrax.ForwardMode() if method.adjoint is None else method.adjoint,
                throw=False,
            )
        assert solution.ts is not None and solution.ys is not None
        y, kept = jax.tree.map(lambda leaf: leaf[0], solution.ys[0]), None
        if isinstance(y, Followed):
            y, kept = y.state, y.kept
        result = RESULTS.promote(solution.result)
        result = RESULTS.where((result == success) & ~all_finite(y), RESULTS.not_finite, result)
        result = RESULTS.where(dead, before.result, result)
        reached = jnp.where(dead, before.reached, solution.ts[0][0])
        after = Outcome(
            result, reached, before.steps + jnp.asarray(solution.stats["num_steps"], int)
        )
        # Diffrax would have it compiled in two places of its loop.
        observed = jax.lax.map(
            lambda at: problem.observe(at[0], at[1], args), (saves, solution.ys[1])
        )
        observed = nan_unless(~dead & jnp.isfinite(solution.ts[1]), observed)
        summary = problem.summarise(observed, *nan_unless(after.success, (y, kept)))
        return (saves[-1], _restarted(y), after), summary

    carry = (start, y, Outcome(able, start, jnp.array(0)))
    (_, _, outcome), summaries = jax.lax.scan(segment, carry, times)
    return summaries, outcome


def _evaluate(args, times, y: PyTree, problem: InitialValueProblem) -> PyTree:
    """The summaries of a scene that has nothing to integrate."""
    observed = jax.vmap(jax.vmap(lambda time: problem.observe(time, y, args)))(times)
    summarise = jax.vmap(lambda segment: problem.summarise(segment, y, None), axis_size=len(times))
    return summarise(observed)

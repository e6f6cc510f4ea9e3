"""An integration as one step of a traced program: what it integrates, and how."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import diffrax
import jax
import jax.numpy as jnp
from jax.core import ShapedArray, Tracer
from jax.extend.core import Primitive
from jaxtyping import Array, PyTree

from jaxcrusher.batch.lanes.emit import Unsupported
from jaxcrusher.batch.lanes.layout import Method, Sizes
from jaxcrusher.batch.lanes.source import Equations, exponents, source, tableau
from jaxcrusher.motion.integrate import (
    RESULTS,
    Carried,
    Integration,
    Outcome,
    Problem,
    error_norm,
)

# Its operands are times, tolerances (absolute, relative), the state at the start, and the numbers
# that the equations depend on; its results the summaries and, of the outcome, code, time and steps.
integration_p = Primitive("integration")
integration_p.multiple_results = True


@integration_p.def_abstract_eval
def _shapes(*operands, what: "Recorded"):
    return what.shapes


@dataclass(frozen=True, eq=False)
class Recorded:
    """An integration without its numbers."""

    equations: Equations
    method: Method
    summarise: Callable[[Array, Array], PyTree]  # see `engine.run`
    shapes: list[ShapedArray]

    @cached_property
    def exponents(self) -> list[int]:
        """See `source.exponents`."""
        return exponents(self.equations)

    def source(self, known: dict[int, float]) -> tuple[str, Sizes]:
        """See `source.source`."""
        if (key := tuple(known.items())) not in self._sources:
            self._sources[key] = source(self.equations, known)
        return self._sources[key]

    @cached_property
    def _sources(self) -> dict[Any, tuple[str, Sizes]]:
        return {}


def record(
    args: PyTree, times: Array, y: Carried, problem: Problem, method: Integration
) -> tuple[PyTree, Outcome]:
    """In place of the march of `integrate`: one equation in the program that is being traced.

    Raises `Unsupported` for what lanes cannot do: derivatives, other solvers and controllers.
    """
    if not isinstance(y, Carried):
        raise Unsupported("derivatives")
    steps, tolerances = _method(method)
    states, state_tree = jax.tree.flatten(y)
    numbers, args_tree = jax.tree.flatten(args)
    if any(jnp.shape(leaf) != () for leaf in states + numbers):
        raise Unsupported("states or numbers that are arrays")
    count = len(states)

    def of_scalars(function):
        def flat(time, *scalars):
            state = jax.tree.unflatten(state_tree, scalars[:count])
            return function(time, state, jax.tree.unflatten(args_tree, scalars[count:]))

        return jax.make_jaxpr(flat, return_shape=True)(
            *[jnp.zeros(())] * (1 + count + len(numbers))
        )

    field, _ = of_scalars(problem.field)
    observe, seen = of_scalars(problem.observe)
    parts, seen_tree = jax.tree.flatten(seen)
    motion = len(jax.tree.leaves(y.motion))

    def summarise(seen, last):
        observed, first = [], 0
        for part in parts:
            flat = seen[:, first : first + part.size]
            observed.append(flat.reshape(-1, *part.shape))
            first += part.size
        end = jax.tree.unflatten(state_tree, list(last))
        return problem.summarise(jax.tree.unflatten(seen_tree, observed), end)

    segments, instants = times.shape
    size = sum(part.size for part in parts)
    summaries = jax.eval_shape(
        jax.vmap(summarise), _like(segments, instants, size), _like(segments, count)
    )
    leaves, tree = jax.tree.flatten(summaries)
    integer = jnp.zeros((), int).dtype
    shapes = [ShapedArray(leaf.shape, leaf.dtype) for leaf in leaves]
    shapes += [ShapedArray((), kind) for kind in (integer, jnp.zeros(()).dtype, integer)]
    what = Recorded(
        Equations(field, observe, motion, count, len(numbers)),
        steps,
        jax.jit(jax.vmap(summarise)),
        shapes,
    )
    *found, code, reached, steps = integration_p.bind(
        times, *tolerances, *map(jnp.asarray, states + numbers), what=what
    )
    return jax.tree.unflatten(tree, found), Outcome(_result(code), reached, steps)


def _like(*shape: int) -> jax.ShapeDtypeStruct:
    return jax.ShapeDtypeStruct(shape, float)


def _result(code: Array) -> RESULTS:
    """Of the code of the stepper."""
    result = RESULTS.promote(diffrax.RESULTS.successful)
    others = (diffrax.RESULTS.max_steps_reached, diffrax.RESULTS.dt_min_reached)
    for i, other in enumerate((*map(RESULTS.promote, others), RESULTS.not_finite), 1):
        result = RESULTS.where(code == i, other, result)
    return result


def _method(method: Integration) -> tuple[Method, tuple[Array, Array]]:
    """Solver, controller and limits in numbers, and the absolute and relative tolerance."""
    pid = method.stepsize_controller
    if method.adjoint is not None:
        raise Unsupported("an adjoint")
    if not isinstance(pid, diffrax.PIDController):
        raise Unsupported(f"the step-size controller `{type(pid).__name__}`")
    if pid.norm is not error_norm:
        raise Unsupported("a norm of errors of one's own")
    for name in ("dcoeff", "dtmax", "force_dtmin", "error_order"):
        if getattr(pid, name):
            raise Unsupported(f"`{name}` of the step-size controller")
    order = method.solver.order(diffrax.ODETerm(lambda t, y, args: y))
    assert order is not None
    numbers = ((pid.pcoeff + pid.icoeff) / order, -pid.pcoeff / order, pid.safety, pid.factormin)
    smallest = 0.0 if pid.dtmin is None else pid.dtmin
    rest = (pid.factormax, smallest, method.dt0, method.max_steps)
    if any(isinstance(value, Tracer) for value in (*numbers, *rest)):
        raise Unsupported("a step-size controller whose coefficients are traced")
    tolerances = (jnp.asarray(pid.atol, float), jnp.asarray(pid.rtol, float))
    return Method(*tableau(method.solver), *map(float, (*numbers, *rest))), tolerances

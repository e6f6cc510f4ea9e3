"""An integration as one step of a traced program: what it integrates, and how."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import diffrax
import jax
import jax.numpy as jnp
from jax.core import ShapedArray, Tracer
from jax.extend.core import Jaxpr, JaxprEqn, Primitive
from jaxtyping import Array, PyTree

from jaxcrusher.batch.lanes.kernels import Equations, Kernels, exponents, kernels
from jaxcrusher.batch.lanes.known import Unsupported, known
from jaxcrusher.batch.lanes.layout import Control
from jaxcrusher.batch.lanes.primitives import REAL
from jaxcrusher.batch.lanes.tableau import Solver, known_solver, tableau
from jaxcrusher.batch.lanes.vector import CORES, Shape
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
    solver: Solver
    control: Control
    shapes: list[ShapedArray]  # of the summaries, then of code, time and steps

    @cached_property
    def exponents(self) -> list[int]:
        """See `kernels.exponents`."""
        return exponents(self.equations)

    def kernels(self, written: dict[int, float], shape: Shape = CORES) -> Kernels:
        """See `kernels.kernels`; `written` are the numbers that are written into them."""
        if (key := (shape, *written.items())) not in self._kernels:
            self._kernels[key] = kernels(self.equations, written, tableau(self.solver), shape)
        return self._kernels[key]

    @cached_property
    def _kernels(self) -> dict[Any, Kernels]:
        return {}


def record(
    args: PyTree, times: Array, y: Carried, problem: Problem, method: Integration
) -> tuple[PyTree, Outcome]:
    """In place of the march of `integrate`: one equation in the program that is being traced.

    Raises `Unsupported` for what lanes cannot do: derivatives, other solvers and controllers.
    """
    if not isinstance(y, Carried):
        raise Unsupported("derivatives")
    control, tolerances = _control(method)
    states, state_tree = jax.tree.flatten(y)
    numbers, args_tree = jax.tree.flatten(args)
    if any(jnp.shape(leaf) != () for leaf in states + numbers):
        raise Unsupported("states or numbers that are arrays")
    count = len(states)
    for leaf in states:
        if (kind := str(jnp.result_type(leaf))) != REAL:
            raise Unsupported(f"the type `{kind}` of a state")
    # Of the types that they have: a whole number divides unlike a double.
    types = [_type(leaf) for leaf in (jnp.zeros(()), *states, *numbers)]

    def of_scalars(function):
        def flat(time, *scalars):
            state = jax.tree.unflatten(state_tree, scalars[:count])
            return function(time, state, jax.tree.unflatten(args_tree, scalars[count:]))

        return jax.make_jaxpr(flat, return_shape=True)(*types)

    field, _ = of_scalars(problem.field)
    observe, seen = of_scalars(problem.observe)
    parts, seen_tree = jax.tree.flatten(seen)
    segments, instants = times.shape

    def of_segment(*numbers):
        stacked = jax.tree.unflatten(seen_tree, numbers[: len(parts)])
        return problem.summarise(stacked, jax.tree.unflatten(state_tree, numbers[len(parts) :]))

    stacked = [jax.ShapeDtypeStruct((instants, *part.shape), float) for part in parts]
    summarise, found = jax.make_jaxpr(of_segment, return_shape=True)(*stacked, *states)
    leaves, tree = jax.tree.flatten(found)
    integer = jnp.zeros((), int).dtype
    shapes = [ShapedArray((segments, *leaf.shape), leaf.dtype) for leaf in leaves]
    shapes += [ShapedArray((), kind) for kind in (integer, jnp.zeros(()).dtype, integer)]
    motion = len(jax.tree.leaves(y.motion))
    what = Recorded(
        Equations(
            known(field),
            known(observe),
            known(summarise, len(parts), instants),
            instants,
            motion,
            count,
        ),
        known_solver(method.solver),
        control,
        shapes,
    )
    *found, code, reached, steps = integration_p.bind(
        times, *tolerances, *map(jnp.asarray, states + numbers), what=what
    )
    return jax.tree.unflatten(tree, found), Outcome(_result(code), reached, steps)


def _type(leaf: Any) -> jax.ShapeDtypeStruct:
    kind = jax.typeof(jnp.asarray(leaf))
    return jax.ShapeDtypeStruct(kind.shape, kind.dtype, weak_type=kind.weak_type)


def integrates(equation: JaxprEqn) -> bool:
    """Whether an equation is an integration or has one inside."""
    if equation.primitive is integration_p:
        return True
    inside = [
        getattr(part, "jaxpr", part)
        for value in equation.params.values()
        for part in (value if isinstance(value, tuple | list) else [value])
    ]
    return any(
        integrates(inner) for part in inside if isinstance(part, Jaxpr) for inner in part.eqns
    )


def _result(code: Array) -> RESULTS:
    """Of the code of the stepper."""
    result = RESULTS.promote(diffrax.RESULTS.successful)
    others = (diffrax.RESULTS.max_steps_reached, diffrax.RESULTS.dt_min_reached)
    for i, other in enumerate((*map(RESULTS.promote, others), RESULTS.not_finite), 1):
        result = RESULTS.where(code == i, other, result)
    return result


def _control(method: Integration) -> tuple[Control, tuple[Array, Array]]:
    """Controller and limits in numbers, and the absolute and relative tolerance."""
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
    rest = (pid.factormax, smallest, max(method.dt0, smallest), method.max_steps)
    if any(isinstance(value, Tracer) for value in (*numbers, *rest)):
        raise Unsupported("a step-size controller whose coefficients are traced")
    tolerances = (jnp.asarray(pid.atol, float), jnp.asarray(pid.rtol, float))
    return Control(*map(float, (*numbers, *rest))), tolerances

"""An integration as one equation of a trace: what it integrates, and how, in verified functions.

Solvers and step-size controllers are those of diffrax; lanes take their numbers.
"""

import math
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import ShapedArray, Tracer
from jax.extend.core import Jaxpr, JaxprEqn, Primitive
from jaxtyping import Array, PyTree

from jaxcrusher.basics.following import Instant
from jaxcrusher.lanes.code import CORES, Shape
from jaxcrusher.lanes.layout import STAGES, Control
from jaxcrusher.lanes.primitives import REAL
from jaxcrusher.lanes.stepper import Equations, Followed, Kernels, Tableau, kernels
from jaxcrusher.lanes.verify import Unsupported, verified

# For XLA: there is little to compute.
IN_A_HURRY: dict[str, Any] = {"xla_backend_optimization_level": 0}

# Threads that run one program at once write its functions once.
_LOCK = threading.Lock()

# Its operands are times, tolerances (absolute, relative), the state at the start, and the numbers
# that the equations depend on; its results the summaries, and code, time and steps at the end.
integration_p = Primitive("integration")
integration_p.multiple_results = True


@integration_p.def_abstract_eval
def _shapes(*operands, what: "Recorded"):
    return what.shapes


@dataclass(frozen=True, eq=False)
class Recorded:
    """An integration without its numbers."""

    equations: Equations
    solver: diffrax.Tsit5 | diffrax.Dopri5
    control: Control
    shapes: list[ShapedArray]  # of the summaries, then of code, time and steps

    def kernels(self, shape: Shape = CORES) -> Kernels:
        """Write the functions of lanes once for their shape."""
        with _LOCK:
            if shape not in self._kernels:
                self._kernels[shape] = kernels(self.equations, _tableau(self.solver), shape)
            return self._kernels[shape]

    @cached_property
    def _kernels(self) -> dict[Shape, Kernels]:
        return {}


def record(
    problem: Any,
    args: PyTree,
    times: Array,
    state: PyTree,
    motion: int,
    method: Any,
    norm: Callable,
) -> tuple[PyTree, tuple[Array, Array, Array]]:
    """Put an integration into the program that is being traced, as one equation.

    `problem` has the functions `field` and `observe` of time, state and `args`, and `summarise` of
    what is observed, stacked over the instants of a segment, of the state at its end, and of the
    numbers that its `following` keeps, if it has one (see `basics.following`). `times` has the
    shape (segments, instants). The first `motion` leaves of the state count for the error; the
    others are totals, which restart from zero in every segment. `method` has diffrax's `solver` and
    `stepsize_controller`, and `adjoint`, `dt0` and `max_steps`. `norm` is the norm of errors that
    lanes compute: the root mean square over the motion, or over all if there is none. Returns the
    summaries, and the code (see `layout`), time and number of steps at the end. Raises
    `Unsupported` for what lanes cannot do.
    """
    control, tolerances = _control(method, norm)
    states, state_tree = jax.tree.flatten(state)
    numbers, args_tree = jax.tree.flatten(args)
    if any(jnp.shape(leaf) != () for leaf in states):
        raise Unsupported("states that are arrays")
    count = len(states)
    # Of a number that is an array, such as a curve, each entry is a number.
    arrays = [jnp.shape(leaf) for leaf in numbers]
    numbers = [
        entry for leaf in numbers for entry in (jnp.ravel(leaf) if jnp.ndim(leaf) else [leaf])
    ]
    for leaf in states:
        if (kind := str(jnp.result_type(leaf))) != REAL:
            raise Unsupported(f"the type `{kind}` of a state")
    # Of the types that they have: a whole number divides unlike a double.
    types = [_type(leaf) for leaf in (jnp.zeros(()), *states, *numbers)]

    def of_scalars(function: Callable) -> Any:
        def flat(time, *scalars):
            state = jax.tree.unflatten(state_tree, scalars[:count])
            args = jax.tree.unflatten(args_tree, _joined(scalars[count:], arrays))
            return function(time, state, args)

        return jax.make_jaxpr(flat, return_shape=True)(*types)

    followed, kept_tree = Followed(), jax.tree.structure(None)
    if problem.following is None:
        field, _ = of_scalars(problem.field)
    else:
        field, (_, instant) = of_scalars(
            lambda *at: (problem.field(*at), problem.following.watch(*at))
        )
        begin, kept_tree = jax.tree.flatten(problem.following.begin(args))
        followed = _followed(problem.following.follow, begin, kept_tree, instant)
    observe, seen = of_scalars(problem.observe)
    parts, seen_tree = jax.tree.flatten(seen)
    segments, instants = times.shape

    def of_segment(*numbers):
        stacked = jax.tree.unflatten(seen_tree, numbers[: len(parts)])
        last = numbers[len(parts) :]
        kept = jax.tree.unflatten(kept_tree, last[count:])
        return problem.summarise(stacked, jax.tree.unflatten(state_tree, last[:count]), kept)

    stacked = [jax.ShapeDtypeStruct((instants, *part.shape), float) for part in parts]
    summarise, found = jax.make_jaxpr(of_segment, return_shape=True)(
        *stacked, *states, *followed.begin
    )
    equations = Equations(
        verified(field, shapes=[()] * (count + followed.seen)),
        verified(observe),
        verified(summarise, len(parts), instants),
        instants,
        motion,
        followed,
    )
    leaves, tree = jax.tree.flatten(found)
    integer = jnp.zeros((), int).dtype
    shapes = [ShapedArray((segments, *leaf.shape), leaf.dtype) for leaf in leaves]
    shapes += [ShapedArray((), kind) for kind in (integer, jnp.zeros(()).dtype, integer)]
    what = Recorded(equations, method.solver, control, shapes)
    *found, code, reached, steps = integration_p.bind(
        times, *tolerances, *map(jnp.asarray, states + numbers), what=what
    )
    return jax.tree.unflatten(tree, found), (code, reached, steps)


def _followed(
    follow: Callable, begin: Sequence[float], kept_tree: Any, instant: PyTree
) -> Followed:
    """Return what is followed, of which is kept at the `begin`; an `instant` shows what is seen."""
    shapes, seen_tree = jax.tree.flatten(instant)
    count, length = len(begin), 1 + len(shapes)

    def flat(*numbers):
        kept, rest = jax.tree.unflatten(kept_tree, numbers[:count]), numbers[count:]
        instants = (rest[i : i + length] for i in range(0, 3 * length, length))
        return follow(
            kept, *(Instant(time, jax.tree.unflatten(seen_tree, seen)) for time, *seen in instants)
        )

    numbers = [jax.ShapeDtypeStruct((), float)] * (count + 3 * length)
    function = verified(jax.make_jaxpr(flat)(*numbers), shapes=[()] * count)
    return Followed(len(shapes), tuple(map(float, begin)), function)


def _joined(entries: Sequence[Array], shapes: list[tuple[int, ...]]) -> list[Array]:
    """Make arrays of these shapes of their entries; a scalar is an entry itself."""
    rest = iter(entries)
    return [
        jnp.stack([next(rest) for _ in range(math.prod(shape))]).reshape(shape)
        if shape
        else next(rest)
        for shape in shapes
    ]


def _type(leaf: Any) -> jax.ShapeDtypeStruct:
    kind = jax.typeof(jnp.asarray(leaf))
    return jax.ShapeDtypeStruct(kind.shape, kind.dtype, weak_type=kind.weak_type)


def integrates(equation: JaxprEqn) -> bool:
    """Say whether an equation is an integration or has one inside."""
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


def _control(method: Any, norm: Callable) -> tuple[Control, tuple[Array, Array]]:
    """Return controller and limits in numbers, and the absolute and relative tolerance."""
    pid, solver = method.stepsize_controller, method.solver
    if method.adjoint is not None:
        raise Unsupported("an adjoint")
    if not isinstance(pid, diffrax.PIDController):
        raise Unsupported(f"the step-size controller `{type(pid).__name__}`")
    if pid.norm is not norm:
        raise Unsupported("a norm of errors of one's own")
    for name in ("dcoeff", "dtmax", "force_dtmin", "error_order"):
        if getattr(pid, name):
            raise Unsupported(f"`{name}` of the step-size controller")
    if not isinstance(solver, diffrax.Tsit5 | diffrax.Dopri5):
        raise Unsupported(f"the solver `{type(solver).__name__}`")
    order = solver.order(diffrax.ODETerm(lambda t, y, args: y))
    assert order is not None
    smallest = 0.0 if pid.dtmin is None else pid.dtmin
    limits = (max(method.dt0, smallest), smallest, method.max_steps)
    exponents = ((pid.pcoeff + pid.icoeff) / order, -pid.pcoeff / order)
    numbers = (*limits, *exponents, pid.safety, pid.factormin, pid.factormax)
    if any(isinstance(value, Tracer) for value in numbers):
        raise Unsupported("a step-size controller whose coefficients are traced")
    tolerances = (jnp.asarray(pid.atol, float), jnp.asarray(pid.rtol, float))
    return Control(*map(float, numbers)), tolerances


@cache
def _tableau(solver: diffrax.Tsit5 | diffrax.Dopri5) -> Tableau:
    """Take the tableau from diffrax, and the interpolation from its values at enough places."""
    table = solver.tableau
    weights = np.zeros((STAGES, STAGES))
    for stage, row in enumerate(table.a_lower, 1):
        weights[stage, :stage] = row
    places = np.arange(1, 5) / 4
    ends = {"t0": 0.0, "t1": 1.0, "y0": jnp.zeros(STAGES), "y1": jnp.asarray(table.b_sol)}

    def weight(place):
        """Return that of each stage: what the others do not add to."""
        return solver.interpolation_cls(**ends, k=jnp.eye(STAGES)).evaluate(place)

    values = np.asarray(jax.jit(jax.vmap(weight), compiler_options=IN_A_HURRY)(places))
    powers = places[:, None] ** np.arange(1, 5)
    dense = np.ascontiguousarray(np.linalg.solve(powers, values).T)
    return Tableau(np.append(0.0, table.c), weights, np.asarray(table.b_error), dense)

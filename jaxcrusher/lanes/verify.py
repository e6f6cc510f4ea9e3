"""The verifier: it refuses programs unless lanes know every primitive, type and shape in them.

Instructions are written only by the `walk` of what `verified` returns. `verified` inlines the calls
of a trace, and checks each equation against the tables of `primitives`.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from jax.extend.core import ClosedJaxpr, JaxprEqn, Literal, Var

from jaxcrusher.lanes.primitives import (
    ALONG_AXES,
    ELEMENTWISE,
    OVER_INSTANTS,
    REAL,
    STRUCTURAL,
    TRUE,
    TYPES,
    Operation,
    constant,
    type_of,
)

# Primitives that call a jaxpr, and where it stands.
_CALLS = {
    "checkpoint": "jaxpr",
    "closed_call": "call_jaxpr",
    "custom_jvp_call": "call_jaxpr",
    "custom_vjp_call": "call_jaxpr",
    "jit": "jaxpr",
    "pjit": "jaxpr",
    "remat2": "jaxpr",
}
# Parameters that do not change a value: where it stands, how exact it is at least, and whether
# its type gives way to others, which JAX has settled when it traced. The axes are in the shapes.
_IGNORED = {"accuracy", "axes", "index_dtype", "out_sharding", "sharding", "weak_type"}


class Unsupported(Exception):
    """Something that lanes cannot do and another engine can; the text names it."""


class Verified(NamedTuple):
    """A function as a list of equations that lanes know, without calls."""

    operands: list[Var]
    constants: dict[Var, Any]
    equations: list[JaxprEqn]
    results: list[Any]  # variables and literals

    @property
    def shapes(self) -> list[tuple[int, ...]]:
        """Return the shapes of the results."""
        return list(map(_shape, self.results))

    @property
    def read(self) -> list[int]:
        """Return the places of the operands that the function reads."""
        read = {id(v) for e in self.equations for v in e.invars} | set(map(id, self.results))
        return [i for i, v in enumerate(self.operands) if id(v) in read]

    def walk(
        self,
        inputs: Sequence[Any],
        primitive: Callable[[JaxprEqn, list], Any],
        literal: Callable[[Any, str], Any] = constant,
    ) -> list:
        """Return the results; `primitive` evaluates each equation with its operands.

        `literal` turns a constant array and its type into a value of a variable.
        """
        values = {v: literal(array, type_of(v)) for v, array in self.constants.items()}
        values |= zip(self.operands, inputs, strict=True)

        def read(variable: Any) -> Any:
            known = isinstance(variable, Literal)
            return literal(variable.val, type_of(variable)) if known else values[variable]

        for equation in self.equations:
            values[equation.outvars[0]] = primitive(equation, list(map(read, equation.invars)))
        return list(map(read, self.results))


def inlined(
    jaxpr: ClosedJaxpr,
    operands: Sequence[Any],
    constants: dict[Var, Any],
    opened: Callable[[JaxprEqn], bool],
) -> tuple[list[JaxprEqn], list[Any]]:
    """Open those calls of a trace that are to be opened; return its equations and results.

    Its variables are new. Its constants are added to those that are given.
    """
    names: dict[Var, Any] = dict(zip(jaxpr.jaxpr.invars, operands, strict=True))
    for variable, number in zip(jaxpr.jaxpr.constvars, jaxpr.consts, strict=True):
        names[variable] = Var(variable.aval)
        constants[names[variable]] = number

    def named(operands: Sequence[Any]) -> list[Any]:
        return [v if isinstance(v, Literal) else names[v] for v in operands]

    equations = []
    for equation in jaxpr.jaxpr.eqns:
        name = equation.primitive.name
        if name in _CALLS and opened(equation):
            called = equation.params[_CALLS[name]]
            # Since JAX 0.12 every jaxpr has its constants, and both classes are one.
            called = called if isinstance(called, ClosedJaxpr) else ClosedJaxpr(called, [])
            inside, results = inlined(called, named(equation.invars), constants, opened)
            equations += inside
        else:
            results = [Var(variable.aval) for variable in equation.outvars]
            equations.append(equation.replace(invars=named(equation.invars), outvars=results))
        names |= zip(equation.outvars, results, strict=True)
    return equations, named(jaxpr.jaxpr.outvars)


def verified(
    function: ClosedJaxpr,
    series: int = 0,
    instants: int = 0,
    shapes: list[tuple[int, ...]] | None = None,
) -> Verified:
    """Return a function that lanes can compute; its first operands may be series over instants.

    Its results are doubles, and have the given shapes, if any are given. Raises `Unsupported` for
    the first thing that lanes do not know.
    """
    operands = [Var(variable.aval) for variable in function.jaxpr.invars]
    constants: dict[Var, Any] = {}
    equations, results = inlined(function, operands, constants, lambda equation: True)
    for variable in (*operands, *constants):
        _require_type(variable, "an operand")
    over = set(operands[:series])
    for equation in equations:
        if _verify(equation, over, instants):
            over |= set(equation.outvars)
    for result in results:
        if type_of(result) != REAL:
            raise Unsupported(f"the type `{type_of(result)}` of a result")
    found = Verified(operands, constants, equations, results)
    if shapes is not None and found.shapes != shapes:
        raise Unsupported(f"results of the shapes {found.shapes} in place of {shapes}")
    return found


def _shape(variable: Any) -> tuple[int, ...]:
    return variable.aval.shape


def _require_type(variable: Any, of: str) -> None:
    if type_of(variable) not in TYPES:
        raise Unsupported(f"the type `{type_of(variable)}` of {of}")


def _verify(equation: JaxprEqn, over: set[Var], instants: int) -> bool:
    """Verify one equation, and say whether its result is over the instants."""
    name, params = equation.primitive.name, equation.params
    operation = ELEMENTWISE.get(name) or STRUCTURAL.get(name) or ALONG_AXES.get(name)
    is_over = [not isinstance(v, Literal) and v in over for v in equation.invars]
    if operation is None and not (name == "dynamic_slice" and any(is_over)):
        raise Unsupported(f"the primitive `{name}`")
    for variable in (*equation.invars, *equation.outvars):
        _require_type(variable, f"`{name}`")
        if 0 in _shape(variable):
            raise Unsupported(f"the primitive `{name}` of an array without elements")
    if operation is not None:
        _require_kinds(equation, operation.kinds)
        _require_options(equation, operation)
    if any(is_over):
        return _verify_over_instants(equation, is_over, instants)
    scalar = name == "broadcast_in_dim" and _shape(equation.invars[0]) == ()
    return bool(instants) and scalar and params["shape"][:1] == (instants,)


def _require_options(equation: JaxprEqn, operation: Operation) -> None:
    """Refuse a parameter that an operation does not know."""
    given = {name for name, value in equation.params.items() if value is not None}
    if unknown := given - _IGNORED - {*operation.options}:
        name = equation.primitive.name
        raise Unsupported(f"the option `{min(unknown)}` of the primitive `{name}`")


def _require_kinds(equation: JaxprEqn, kinds: str) -> None:
    """Refuse operands of types that an operation does not take."""
    for variable in equation.invars:
        kind = type_of(variable)
        if {REAL: "f", TRUE: "b"}.get(kind, "i") not in kinds:
            raise Unsupported(f"the primitive `{equation.primitive.name}` of the type `{kind}`")


def _verify_over_instants(equation: JaxprEqn, is_over: Sequence[bool], instants: int) -> bool:
    """Verify an equation of series over instants, and say whether its result is one too."""
    name, params = equation.primitive.name, equation.params
    if name in OVER_INSTANTS and params["axes"] == (0,):
        _require_kinds(equation, OVER_INSTANTS[name])
        return False
    if name == "dynamic_slice":
        whole = params["slice_sizes"] == (1, *_shape(equation.invars[0])[1:])
        if not whole or any(is_over[1:]):
            raise Unsupported("a part of the instants")
        return False
    if name == "slice":
        start, end = params["start_indices"][0], params["limit_indices"][0]
        stride = 1 if params["strides"] is None else params["strides"][0]
        if (start, end, stride) == (0, instants, 1):
            return True
        if end != start + 1:
            raise Unsupported("a part of the instants")
        return False
    if name == "squeeze" and 0 not in params["dimensions"]:
        return True
    others = (_shape(v) for v, yes in zip(equation.invars, is_over, strict=True) if not yes)
    if name not in ELEMENTWISE or any(others):
        raise Unsupported(f"the primitive `{name}` of series and other arrays")
    return True

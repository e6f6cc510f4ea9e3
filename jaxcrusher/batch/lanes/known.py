"""Programs of which lanes know every primitive and every type; others are refused here.

Nothing is written as instructions that has not been through `known`: there the calls of a trace are
opened, and the tables of `primitives` are held against each equation.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

from jax.extend.core import ClosedJaxpr, JaxprEqn, Literal, Var

from jaxcrusher.batch.lanes.inlined import inlined
from jaxcrusher.batch.lanes.primitives import (
    ALONG_AXES,
    ELEMENTWISE,
    OVER_INSTANTS,
    REAL,
    STRUCTURAL,
    TRUE,
    TYPES,
    shape_of,
    type_of,
    unknown_option,
)


class Unsupported(Exception):
    """What lanes cannot do and another engine can; the text names it."""


class Known(NamedTuple):
    """A function as a list of equations that lanes know, without calls."""

    operands: list[Var]
    constants: dict[Var, Any]
    equations: list[JaxprEqn]
    results: list[Any]  # variables and literals
    shapes: list[tuple[int, ...]]  # of the results


def known(function: ClosedJaxpr, series: int = 0, instants: int = 0) -> Known:
    """A function that lanes can compute; its first operands may be series over instants.

    Its results are doubles. Raises `Unsupported` for the first thing that lanes do not know.
    """
    operands = [Var(variable.aval) for variable in function.jaxpr.invars]
    constants: dict[Var, Any] = {}
    equations, results = inlined(function, operands, constants, lambda equation: True)
    for variable in (*operands, *constants):
        _require_type(variable, "an operand")
    over = set(operands[:series])
    for equation in equations:
        if _check(equation, over, instants):
            over |= set(equation.outvars)
    for result in results:
        if type_of(result) != REAL:
            raise Unsupported(f"the type `{type_of(result)}` of a result")
    shapes = list(map(shape_of, results))
    return Known(operands, constants, equations, results, shapes)


def _require_type(variable: Any, of: str) -> None:
    if type_of(variable) not in TYPES:
        raise Unsupported(f"the type `{type_of(variable)}` of {of}")


def _check(equation: JaxprEqn, over: set[Var], instants: int) -> bool:
    """Whether the result of an equation that lanes know is over the instants."""
    name, params = equation.primitive.name, equation.params
    operation = ELEMENTWISE.get(name) or STRUCTURAL.get(name) or ALONG_AXES.get(name)
    is_over = [not isinstance(v, Literal) and v in over for v in equation.invars]
    if operation is None and not (name == "dynamic_slice" and any(is_over)):
        raise Unsupported(f"the primitive `{name}`")
    for variable in (*equation.invars, *equation.outvars):
        _require_type(variable, f"`{name}`")
        if 0 in shape_of(variable):
            raise Unsupported(f"the primitive `{name}` of an array without elements")
    if operation is not None:
        _require_kinds(equation, operation.kinds)
        if (option := unknown_option(operation, params)) is not None:
            raise Unsupported(f"the option `{option}` of the primitive `{name}`")
    if params.get("dimensions") is not None and name == "reshape":
        raise Unsupported("the option `dimensions` of the primitive `reshape`")
    if any(is_over):
        return _check_over_instants(equation, is_over, instants)
    scalar = name == "broadcast_in_dim" and shape_of(equation.invars[0]) == ()
    return bool(instants) and scalar and params["shape"][:1] == (instants,)


def _require_kinds(equation: JaxprEqn, kinds: str) -> None:
    """Check that an operation takes the types of its operands."""
    for variable in equation.invars:
        kind = type_of(variable)
        if {REAL: "f", TRUE: "b"}.get(kind, "i") not in kinds:
            raise Unsupported(f"the primitive `{equation.primitive.name}` of the type `{kind}`")


def _check_over_instants(equation: JaxprEqn, is_over: Sequence[bool], instants: int) -> bool:
    """Whether the result is over the instants too, of an equation with operands that are."""
    name, params = equation.primitive.name, equation.params
    if name in OVER_INSTANTS and params["axes"] == (0,):
        _require_kinds(equation, OVER_INSTANTS[name])
        return False
    if name == "dynamic_slice":
        whole = params["slice_sizes"] == (1, *shape_of(equation.invars[0])[1:])
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
    others = (shape_of(v) for v, yes in zip(equation.invars, is_over, strict=True) if not yes)
    if name not in ELEMENTWISE or any(others):
        raise Unsupported(f"the primitive `{name}` of series and other arrays")
    return True

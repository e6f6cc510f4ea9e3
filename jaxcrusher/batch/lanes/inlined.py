"""A trace with calls opened."""

from collections.abc import Callable, Sequence
from typing import Any

from jax.extend.core import ClosedJaxpr, Jaxpr, JaxprEqn, Literal, Var

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


def inlined(
    jaxpr: ClosedJaxpr,
    operands: Sequence[Any],
    constants: dict[Var, Any],
    opened: Callable[[JaxprEqn], bool],
) -> tuple[list[JaxprEqn], list[Any]]:
    """Its equations, those calls opened that are to be, with variables of their own; its outputs.

    Constants are added to those that are given.
    """
    names: dict[Var, Any] = dict(zip(jaxpr.jaxpr.invars, operands, strict=True))
    for variable, constant in zip(jaxpr.jaxpr.constvars, jaxpr.consts, strict=True):
        names[variable] = Var(variable.aval)
        constants[names[variable]] = constant

    def named(operands: Sequence[Any]) -> list[Any]:
        return [v if isinstance(v, Literal) else names[v] for v in operands]

    equations = []
    for equation in jaxpr.jaxpr.eqns:
        name = equation.primitive.name
        if name in _CALLS and opened(equation):
            called = equation.params[_CALLS[name]]
            called = ClosedJaxpr(called, []) if isinstance(called, Jaxpr) else called
            inside, results = inlined(called, named(equation.invars), constants, opened)
            equations += inside
        else:
            results = [Var(variable.aval) for variable in equation.outvars]
            equations.append(equation.replace(invars=named(equation.invars), outvars=results))
        names |= zip(equation.outvars, results, strict=True)
    return equations, named(jaxpr.jaxpr.outvars)

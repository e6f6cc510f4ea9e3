"""A trace with the calls opened that integrate."""

from collections.abc import Sequence
from typing import Any

from jax.extend.core import ClosedJaxpr, Jaxpr, JaxprEqn, Literal, Var

from jaxcrusher.batch.lanes.recorded import integration_p

# Primitives that call a jaxpr, and where it stands.
_CALLS = {
    "jit": "jaxpr",
    "pjit": "jaxpr",
    "closed_call": "call_jaxpr",
    "custom_jvp_call": "call_jaxpr",
}


def inlined(
    jaxpr: ClosedJaxpr, operands: Sequence[Any], constants: dict[Var, Any]
) -> tuple[list[JaxprEqn], list[Any]]:
    """Its equations, calls that integrate opened, with variables of their own; its outputs."""
    names: dict[Var, Any] = dict(zip(jaxpr.jaxpr.invars, operands, strict=True))
    for variable, constant in zip(jaxpr.jaxpr.constvars, jaxpr.consts, strict=True):
        names[variable] = Var(variable.aval)
        constants[names[variable]] = constant

    def named(operands: Sequence[Any]) -> list[Any]:
        return [v if isinstance(v, Literal) else names[v] for v in operands]

    equations = []
    for equation in jaxpr.jaxpr.eqns:
        name = equation.primitive.name
        if name in _CALLS and integrates(equation):
            inside, results = inlined(
                equation.params[_CALLS[name]], named(equation.invars), constants
            )
            equations += inside
        else:
            results = [Var(variable.aval) for variable in equation.outvars]
            equations.append(equation.replace(invars=named(equation.invars), outvars=results))
        names |= zip(equation.outvars, results, strict=True)
    return equations, named(jaxpr.jaxpr.outvars)


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

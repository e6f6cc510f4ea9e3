"""Integrations recorded for lanes, which do them in place of diffrax's loop."""

from collections.abc import Callable
from typing import Any

import diffrax
import jax
from jaxtyping import Array, PyTree

from jaxcrusher.basics.integrate import (
    RESULTS,
    Carried,
    InitialValueProblem,
    Integration,
    Outcome,
    Sensitive,
    error_norm,
    integrator,
)
from jaxcrusher.lanes.record import record as record_integration
from jaxcrusher.lanes.verify import Unsupported


def recorded(scene: Any, function: Callable[[Any], PyTree]) -> PyTree:
    """Return `function` of a scene, whose integrations are recorded while this is traced."""
    with integrator(record):
        return function(scene)


def record(
    args: PyTree,
    times: Array,
    y: Carried | Sensitive,
    problem: InitialValueProblem,
    method: Integration,
) -> tuple[PyTree, Outcome]:
    """Record an integration in place of the march of `integrate`, as an `integrator` does.

    Raises `Unsupported` for what lanes cannot do: derivatives, other solvers and controllers.
    """
    if not isinstance(y, Carried):
        raise Unsupported("derivatives")
    motion = len(jax.tree.leaves(y.motion))
    summaries, (code, reached, steps) = record_integration(
        problem, args, times, y, motion, method, error_norm
    )
    return summaries, Outcome(_result(code), reached, steps)


def _result(code: Array) -> RESULTS:
    """Translate how lanes say that a design ended (see `lanes.layout`)."""
    result = RESULTS.promote(diffrax.RESULTS.successful)
    others = (diffrax.RESULTS.max_steps_reached, diffrax.RESULTS.dt_min_reached)
    for i, other in enumerate((*map(RESULTS.promote, others), RESULTS.not_finite), 1):
        result = RESULTS.where(code == i, other, result)
    return result

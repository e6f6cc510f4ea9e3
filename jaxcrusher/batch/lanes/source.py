"""The source of a batch's equations, and the Runge-Kutta methods."""

from collections.abc import Mapping
from functools import cache
from typing import NamedTuple

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
from jax.extend.core import ClosedJaxpr

from jaxcrusher.batch.lanes.emit import Atom, Emitter, Unsupported, number
from jaxcrusher.batch.lanes.layout import LANES, STAGES, Sizes
from jaxcrusher.batch.lanes.stepper import FAST

_HEAD = f"""import math
from math import inf, nan, sqrt

from numba import cfunc, types

from jaxcrusher.batch.lanes.elementary import cosine, exponential, logarithm, power, sine

LANES = {LANES}
# Fast, but with NaN and infinity kept: a trial step may leave the linkage's reach.
options = dict(error_model="numpy", fastmath=set({sorted(FAST)}), cache=True, _nrt=False)
row = types.float64[::1]
"""


class Equations(NamedTuple):
    """Jaxprs of scalars: time, states (of the motion, then totals), numbers of the design."""

    field: ClosedJaxpr
    observe: ClosedJaxpr
    motion: int
    states: int
    numbers: int


def exponents(equations: Equations) -> list[int]:
    """The numbers of a design that powers depend on: formulas rather than data.

    x^1.5 is a product and a root, x^p a logarithm and an exponential. Raises `Unsupported` as
    `source` does.
    """
    emitter, _ = _bodies(equations, {})
    return sorted(int(name[1:]) for name in emitter.exponents)


def _bodies(
    equations: Equations, known: Mapping[int, float]
) -> tuple[Emitter, list[tuple[list[str], list[str]]]]:
    """The lines and the results of the field and of what is observed."""
    numbers = [
        number(known[i]) if i in known else Atom(f"n{i}", True, made_of=frozenset({f"n{i}"}))
        for i in range(equations.numbers)
    ]
    operands = [Atom("t", False), *(Atom(f"y{i}", False) for i in range(equations.states))]
    emitter, functions = Emitter(), (equations.field, equations.observe)
    return emitter, [emitter.body(function, operands + numbers) for function in functions]


def source(equations: Equations, known: Mapping[int, float]) -> tuple[str, Sizes]:
    """A module with the functions `prepare`, `field` and `observe` of all lanes, and its sizes.

    `known` are those numbers of a design that are written into it. Raises `Unsupported` for a
    primitive that lanes do not know.
    """
    emitter, ((rates, results), (looks, seen)) = _bodies(equations, known)
    reads = ["t = time[lane]", *(f"y{i} = y[{i} * LANES + lane]" for i in range(equations.states))]
    given = [f"n{i} = given[{i} * LANES + lane]" for i in range(equations.numbers)]
    kept = [f"kept[{row} * LANES + lane] = {name}" for name, row in emitter.rows.items()]
    rates += [f"rate[{i} * LANES + lane] = {text}" for i, text in enumerate(results)]
    looks += [f"seen[{i} * LANES + lane] = {text}" for i, text in enumerate(seen)]
    text = [
        _HEAD,
        _over_lanes("prepare(given, kept)", given + emitter.prepared + kept),
        _over_lanes("field(time, y, kept, rate)", reads + rates),
        _over_lanes("observe(time, y, kept, seen)", reads + looks),
    ]
    sizes = Sizes(equations.motion, equations.states, equations.numbers, len(kept), len(seen))
    return "".join(text), sizes


def _over_lanes(head: str, lines: list[str]) -> str:
    arguments = ", ".join(["row"] * len(head.split(",")))
    body = "".join(f"        {line}\n" for line in lines)
    return (
        f"\n\n@cfunc(types.void({arguments}), **options)\ndef {head}:\n"
        f"    for lane in range(LANES):\n{body}"
    )


class Tableau(NamedTuple):
    """An explicit Runge-Kutta method; see `layout.Method`."""

    nodes: np.ndarray
    weights: np.ndarray
    error: np.ndarray
    dense: np.ndarray


@cache
def tableau(solver: diffrax.AbstractSolver) -> Tableau:
    """Taken from diffrax; its interpolation by asking for values at enough places.

    Raises `Unsupported` for another kind of solver.
    """
    if not isinstance(solver, diffrax.Tsit5 | diffrax.Dopri5):
        raise Unsupported(f"the solver `{type(solver).__name__}`")
    table = solver.tableau
    weights = np.zeros((STAGES, STAGES))
    for stage, row in enumerate(table.a_lower, 1):
        weights[stage, :stage] = row
    places = np.arange(1, 5) / 4

    def weight(place):
        """Of each stage: what the others do not add to."""
        ends = {"t0": 0.0, "t1": 1.0, "y0": jnp.zeros(STAGES), "y1": jnp.asarray(table.b_sol)}
        return solver.interpolation_cls(**ends, k=jnp.eye(STAGES)).evaluate(place)

    with jax.ensure_compile_time_eval():
        values = np.asarray(jax.jit(jax.vmap(weight))(places))
    powers = places[:, None] ** np.arange(1, 5)
    dense = np.ascontiguousarray(np.linalg.solve(powers, values).T)
    return Tableau(np.append(0.0, table.c), weights, np.asarray(table.b_error), dense)

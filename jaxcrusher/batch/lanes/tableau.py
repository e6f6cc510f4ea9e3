"""The Runge-Kutta methods that lanes know, taken from diffrax."""

from functools import cache
from typing import Any

import diffrax
import jax
import jax.numpy as jnp
import numpy as np

from jaxcrusher.batch.lanes.known import Unsupported
from jaxcrusher.batch.lanes.layout import STAGES, Tableau

# For XLA: there is little to compute.
IN_A_HURRY: dict[str, Any] = {"xla_backend_optimization_level": 0}

Solver = diffrax.Tsit5 | diffrax.Dopri5


def known_solver(solver: diffrax.AbstractSolver) -> Solver:
    """The solver, if it is one of them; raises `Unsupported` for another."""
    if not isinstance(solver, Solver):
        raise Unsupported(f"the solver `{type(solver).__name__}`")
    return solver


@cache
def tableau(solver: Solver) -> Tableau:
    """Taken from diffrax; its interpolation by asking for values at enough places."""
    table = solver.tableau
    weights = np.zeros((STAGES, STAGES))
    for stage, row in enumerate(table.a_lower, 1):
        weights[stage, :stage] = row
    places = np.arange(1, 5) / 4

    def weight(place):
        """Of each stage: what the others do not add to."""
        ends = {"t0": 0.0, "t1": 1.0, "y0": jnp.zeros(STAGES), "y1": jnp.asarray(table.b_sol)}
        return solver.interpolation_cls(**ends, k=jnp.eye(STAGES)).evaluate(place)

    values = np.asarray(jax.jit(jax.vmap(weight), compiler_options=IN_A_HURRY)(places))
    powers = places[:, None] ** np.arange(1, 5)
    dense = np.ascontiguousarray(np.linalg.solve(powers, values).T)
    return Tableau(np.append(0.0, table.c), weights, np.asarray(table.b_error), dense)

"""The Runge-Kutta methods that lanes know, taken from diffrax."""

from functools import cache

import diffrax
import jax
import jax.numpy as jnp
import numpy as np

from jaxcrusher.batch.lanes.emit import Unsupported
from jaxcrusher.batch.lanes.layout import STAGES, Tableau


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

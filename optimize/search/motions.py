"""Curves of every periodic orbit of a map, to be drawn: path of the pin, and force over a turn."""

from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Scalar

import jaxcrusher as jc
from jaxcrusher.files.table import Column
from jaxcrusher.motion.simulation import headline_force
from jaxcrusher.orbits.result import RESULTS, PeriodicOrbit, missing, observables_along
from jaxcrusher.periodic import newton
from jaxcrusher.periodic.trigonometric import resample
from optimize.ask.problem import DesignProblem
from optimize.search.evaluate import Rows

# Number of stored instants of a turn, at equal steps of the shaft's phase from zero.
INSTANTS = 96
# The stored curves, and the objective of the same machine with ideal joints.
COLUMNS = {
    "path": Column("1", "place of the first pin, in clearances", dims=("instant", "axis")),
    "force": Column("N", "the headline force over a turn", dims=("instant",)),
    "ideal_force": Column("N", "the same force with ideal joints", dims=("instant",)),
    "ideal_objective": Column("1", "the objective with ideal joints, if it is a statistic of them"),
}


def turns(problem: DesignProblem, places: Float[np.ndarray, "points n"], rows: Rows) -> Rows:
    """Return the `COLUMNS` at places of the unit box, as 32-bit floats, from their orbits' nodes.

    **Arguments:**

    - `problem`: the problem of the search.
    - `places`: the points of the unit box.
    - `rows`: the rows of `optimize.search.orbits.solve`, with `eccentricity` and `success`.

    Without an orbit `path` and `force` are NaN; the columns of ideal joints have values.
    """
    nodes = np.where(rows["success"][:, None, None], rows["eccentricity"], np.nan)
    found = _turns(problem, jnp.asarray(places), jnp.asarray(nodes))
    return {name: np.asarray(column, np.float32) for name, column in found.items()}


@eqx.filter_jit
def _turns(
    problem: DesignProblem,
    places: Float[Array, "points n"],
    nodes: Float[Array, "points nodes dims"],
) -> dict[str, Array]:
    name = headline_force(problem.scene)
    phases = jnp.asarray(2 * np.pi / INSTANTS * np.arange(INSTANTS))

    def force(orbit: PeriodicOrbit) -> Float[Array, " instants"]:
        (size,) = observables_along(
            orbit, phases, ((name, orbit.scene.observables[name]),)
        ).values()
        return size if size.ndim == 1 else jnp.hypot(size[:, 0], size[:, 1])

    def turn(unit: Float[Array, " n"], path: Float[Array, "nodes dims"]) -> dict[str, Array]:
        scene = problem.design.scene(unit)
        found = RESULTS.promote(newton.RESULTS.successful)
        orbit = replace(missing(scene, 1, found), eccentricity=path)
        ideal = jc.periodic_orbit(scene.ideal())
        return {
            "path": resample(path[:, :2], INSTANTS),
            "force": force(orbit),
            "ideal_force": force(ideal),
            "ideal_objective": _objective(problem, ideal),
        }

    return jax.vmap(turn)(places, nodes)


def _objective(problem: DesignProblem, ideal: PeriodicOrbit) -> Scalar:
    """Return the objective of ideal joints; NaN unless it is one of their statistics."""
    name, known = problem.objective.outputs[0], ideal.scene.statistics
    same = name in known and known[name].meaning == problem.objective.meaning
    return ideal[name] if same else jnp.asarray(jnp.nan)

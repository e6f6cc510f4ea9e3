"""Whether an orbit closes: by the estimate from its defect, and by the integrator beyond it."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest

import jaxcrusher as jc
from jaxcrusher.orbits.effort import Budget
from jaxcrusher.orbits.search import COMES_BACK, SURELY_CLOSED, OrbitSearch
from jaxcrusher.orbits.solving import orbit_nodes, with_statistics

LOOSE_ELBOW = {"load_law": "normal_to_jaw", "elbow.clearance": 3e-5, "clearance": 1.2e-4}


def integrated(orbit):
    """By what a motion that begins on the orbit misses its beginning, by the integrator alone."""
    end = jc.poincare_section(orbit.scene, 0, orbit.period, state=orbit.section, rtol=1e-12)
    return np.max(np.abs(end.states[-1] - orbit.section))


@pytest.mark.parametrize(
    ("more", "nodes"), [({}, 48), pytest.param(LOOSE_ELBOW, 96, marks=pytest.mark.slow)]
)
def test_the_closure_is_what_the_integrator_finds(more, nodes):
    scene = jc.build_scene({"clearance": 0.06e-3, **more, "speed": 30.0})
    found, factors = orbit_nodes(scene, None, 1, nodes)
    closure = integrated(with_statistics(scene, found, factors, 1))
    assert 1e-9 < closure < 1e-5  # far above the integrator's own error, and small
    # The variational equations leave out the square of the closure, and the defect is looked at
    # 256 times a turn: of a loose elbow 0.8 % is left.

    assert float(found.closure) == pytest.approx(closure, rel=0.02)


@pytest.mark.slow
def test_an_orbit_that_does_not_close_is_none():
    scene = jc.paper_scene(36.0, 0.06e-3)
    found, factors = orbit_nodes(scene, None, 1, 64)
    assert bool(with_statistics(scene, found, factors, 1).success)  # by the error of its RMS
    assert float(found.closure) > COMES_BACK
    orbit = jc.periodic_orbit(scene, nodes=64)
    assert not bool(orbit.success)
    assert orbit.failure == "The motion does not repeat when it is integrated over its period."


@pytest.mark.parametrize("estimate", [jnp.nan, jnp.asarray(2 * SURELY_CLOSED)])
def test_the_integrator_decides_where_the_estimate_does_not(estimate):
    orbit = jc.periodic_orbit(jc.paper_scene(30.0, 0.06e-3), nodes=96)
    beside = dataclasses.replace(orbit, section=orbit.section + 3 * COMES_BACK)
    search = OrbitSearch(orbit.scene, orbit.scene, None, None, None, Budget("usual"))
    assert search._is_closed(orbit, jnp.asarray(estimate))
    assert not search._is_closed(beside, jnp.asarray(estimate))
    taken = search.budget.steps
    assert search._is_closed(beside, jnp.asarray(SURELY_CLOSED / 2))
    assert search.budget.steps == taken > 0  # it is not integrated

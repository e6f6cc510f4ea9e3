"""Orbits of many designs as they are compiled for a GPU: without loops over instants."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.extend.core import jaxprs_in_params

import jaxcrusher as jc
from jaxcrusher.basics import loops
from jaxcrusher.periodic import collocation, multipliers

POINTS = jnp.array([[27.0, 0.05e-3], [30.0, 0.06e-3], [33.457, 0.10988e-3]])


def solved(point):
    """Return value, slopes and multipliers; the third design takes the way by a damping."""

    def rms(point):
        orbit = jc.periodic_orbit(jc.paper_scene(*point, slip="surface"), nodes=96)
        return orbit.foundation_rms, (orbit.multipliers, orbit.success)

    return jax.value_and_grad(rms, has_aux=True)(point)


@pytest.fixture
def gpu(monkeypatch):
    """Trace as for a GPU."""
    jax.clear_caches()
    for module in (loops, collocation, multipliers):
        monkeypatch.setattr(module, "on_a_gpu", lambda: True)
    yield
    jax.clear_caches()


def lengths(jaxpr):
    """Return the numbers of steps of all scans in a program."""
    for equation in jaxpr.eqns:
        if equation.primitive.name == "scan":
            yield equation.params["length"]
        for inner in jaxprs_in_params(equation.params):
            yield from lengths(inner)


@pytest.mark.slow
def test_designs_go_side_by_side_to_the_same_numbers(gpu):
    batch = jax.jit(jax.vmap(solved))
    # Nodes, instants and steps of multipliers are 96 and more.
    assert max(lengths(jax.make_jaxpr(batch)(POINTS).jaxpr), default=0) < 96
    (value, (of_batch, success)), slopes = batch(POINTS)
    jax.clear_caches()
    loops.on_a_gpu, multipliers.on_a_gpu, collocation.on_a_gpu = [lambda: False] * 3
    alone = jax.jit(solved)
    assert success.all()
    for i, point in enumerate(POINTS):
        (one, (own, _)), slope = alone(point)
        # Newton's method ends within 1e-10 clearances.
        np.testing.assert_allclose(value[i], one, rtol=1e-9)
        np.testing.assert_allclose(slopes[i], slope, rtol=1e-6)
        np.testing.assert_allclose(np.sort(np.abs(of_batch[i])), np.sort(np.abs(own)), rtol=1e-8)

"""Periodic orbits of a crusher whose elbow and pivot are loose too."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxcrusher as jc
from jaxcrusher.motion.flow import flat
from jaxcrusher.orbits.solving import NODES
from tests.differences import differences

# The load presses the toggle: along the jaw it lets elbow and pivot part twice a turn.
LOOSE = {
    "load_law": "normal_to_jaw",
    "friction": 0.0,
    "elbow.clearance": 1e-4,
    "elbow.friction": 0.0,
    "pivot.clearance": 8e-5,
    "pivot.friction": 0.0,
}


@pytest.fixture(scope="module")
def orbit():
    found = jc.periodic_orbit(jc.build_scene(LOOSE))
    assert bool(found.stable), found.failure
    return found


@pytest.mark.slow
def test_the_orbit_is_a_motion(orbit):
    """Three pins keep contact, and the integrator finds the same statistics."""
    assert orbit.eccentricity.shape == (NODES, 6) and orbit.multipliers.shape == (12,)
    assert 0.02 < float(orbit.least_penetration) < 0.05
    assert bool(orbit.validity.inside) and set(orbit.validity.others) == {"elbow", "pivot"}
    turn = jc.statistics(orbit.scene, 0, 1, state=flat(orbit.state()), rtol=1e-11)
    # The swing of multiplier 0.9992 keeps what rounding leaves of a start, 1e-10 clearances.
    assert float(turn.foundation_rms) == pytest.approx(float(orbit.foundation_rms), rel=1e-9)
    for name in ("penetration_ratio", "elbow_penetration_ratio", "pivot_penetration_ratio"):
        # Seen at 1024 instants here, as the top of a polynomial there.
        assert float(turn[name]) == pytest.approx(float(orbit[name]), rel=1e-5)


@pytest.mark.slow
def test_multipliers_against_the_section(orbit):
    """Moduli of the map's Jacobian, which is integrated."""
    start = flat(orbit.state())
    section = jc.poincare_section(orbit.scene, 0, 1, slices=1, state=start, rtol=1e-11)
    moduli = np.sort(np.abs(np.linalg.eigvals(np.asarray(section.jacobians[0]))))
    # The two that die at once, to 2e-6, are what is left of entries of order one.
    expected = np.sort(np.abs(np.asarray(orbit.multipliers)))
    np.testing.assert_allclose(moduli[2:], expected[2:], rtol=1e-6)
    assert moduli[:2].max() < 1e-5


@pytest.mark.slow
def test_slopes_by_clearances_of_elbow_and_pivot(orbit):
    names = ("speed", "elbow.clearance", "pivot.clearance", "elbow.bore_radius")
    point = jnp.array([30.0, 1e-4, 8e-5, 0.04])

    def rms(point):
        values = LOOSE | dict(zip(names, point, strict=True))
        return jc.periodic_orbit(jc.build_scene(values), nodes=NODES).foundation_rms

    both = jax.jit(jax.value_and_grad(rms))
    value, slopes = both(point)
    assert float(value) == pytest.approx(float(orbit.foundation_rms), rel=1e-12)
    expected = differences(lambda point: both(point)[0], point, 1e-3 * point)
    # Differences over 0.1 % bend by 1e-6, and lose 1e-11 N to rounding.
    np.testing.assert_allclose(slopes, expected, rtol=1e-5)


@pytest.mark.slow
def test_a_map(orbit):
    found = jc.orbit_map(jc.paper_machine(**LOOSE), {"speed": [29.0, 30.0]}, nodes=NODES)
    assert found.success.all()
    assert float(found.foundation_rms[1]) == pytest.approx(float(orbit.foundation_rms), rel=1e-12)


@pytest.mark.slow
def test_what_parts_has_no_orbit_in_contact():
    """The force at the elbow reverses: its pin crosses the play, and that is said."""
    orbit = jc.periodic_orbit(jc.build_scene(LOOSE | {"load_law": "along_jaw"}), nodes=NODES)
    assert not bool(orbit.success) and orbit.failure
    assert np.isnan(orbit.foundation_rms)


@pytest.mark.slow
def test_more_nodes_where_few_do_not_close():
    """96 nodes estimate no error here, and yet the integrator does not come back."""
    values = {"clearance": 1.2e-4, "elbow.clearance": 3e-5, "pivot.clearance": 3e-5}
    scene = jc.build_scene(LOOSE | values)
    orbit = jc.periodic_orbit(scene)
    assert bool(orbit.success) and len(orbit.eccentricity) == 2 * NODES
    # Asked for, they are refused; traced, when nothing is integrated, they are not.
    refused = jc.periodic_orbit(scene, nodes=NODES)
    assert not bool(refused.success) and "does not repeat" in refused.failure
    assert np.isnan(refused.foundation_rms)

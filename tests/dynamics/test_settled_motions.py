"""The motions that many starts come to; orbits by shooting."""

import numpy as np
import pytest

import jaxcrusher as jc
from jaxcrusher.dynamics import settled_motions as module
from jaxcrusher.motion.flow import flat
from jaxcrusher.settled.shooting import shoot


@pytest.fixture(scope="module")
def found():
    return jc.settled_motions(jc.paper_scene(40.0, 0.12e-3), starts=16, turns=600)


def test_a_companion_of_two_turns(found):
    """Most centred starts come to it, the others swing about the quiet motion."""
    loud, quiet = found.orbits
    assert (loud.period, quiet.period) == (2, 1)
    # Four turns after 600 at three tolerances: 25 131.73 (1e-6), 25 129.0841 (1e-9), .08606.
    np.testing.assert_allclose(loud.foundation_rms, 25129.08606, atol=2e-4)
    np.testing.assert_allclose(quiet.foundation_rms, 22221.2840, atol=1e-3)
    assert loud.stable and quiet.stable
    # It leaves the bore for a moment each second turn.
    assert -0.003 < loud.least_penetration < 0 < quiet.least_penetration
    assert 0.99 < loud.contact_fraction < 1
    np.testing.assert_allclose(loud.foundation_peak, 61647, rtol=1e-3)
    # After 600 turns half of these 16 starts, after 1000 more than half; a standard error is 0.12.
    assert 0.2 < found.shares[0] < 0.9
    assert sum(found.shares) + sum(found.unsettled.values()) == pytest.approx(1)
    assert "period 2: RMS 25129.09 N" in str(found)


def test_shooting_and_collocation_agree(found):
    """The same quiet motion by the integrator, from a point beside it."""
    quiet = found.orbits[1]
    beside = flat(quiet.state(), quiet.scene) + 1e-3
    shot = shoot(quiet.scene, beside, 1)
    assert shot.success
    # The integrator's tolerance is 1e-11 of a state whose swing it hardly damps.
    np.testing.assert_allclose(shot.foundation_rms, quiet.foundation_rms, rtol=1e-8)
    moduli = (np.sort(np.abs(orbit.multipliers)) for orbit in (shot, quiet))
    np.testing.assert_allclose(*moduli, atol=1e-7)
    assert shot.error < 1e-6 and shot.multipliers_error < 1e-5
    np.testing.assert_allclose(shot.least_penetration, quiet.least_penetration, rtol=1e-3)


def test_shooting_from_nowhere_says_so():
    scene = jc.paper_scene(40.0, 0.12e-3)
    lost = shoot(scene, np.array([0.0, 0.0, 0.3, 0.0]), 1)
    assert not lost.success and "does not repeat" in lost.failure
    assert np.isnan(lost.foundation_rms) and np.isnan(lost.multipliers).all()


def test_distance_from_an_orbit_of_two_turns():
    """Whichever turn comes first; between two orbits the nearer."""
    section = np.array([[0.0, 0.0], [1.0, 0.0]])
    states = np.zeros((24, 4))
    states[::2, 0] = 1.0
    assert module._distance(section, states) == 0
    assert module._distance(section[:1], states) == pytest.approx(0.5)
    assert module._nearest([section[:1], section], states) == 1
    assert module._nearest([], states) is None


def test_refusals():
    with pytest.raises(ValueError, match="have a clearance joint"):
        jc.settled_motions(jc.ideal_scene(30.0))
    with pytest.raises(ValueError, match="`spread` must be finite and > 0"):
        jc.settled_motions(jc.paper_scene(30.0, 0.06e-3), spread=0.0)

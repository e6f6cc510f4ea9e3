"""Motions that lanes wait for: the orbits about which they oscillate, and names of the others."""

import numpy as np
import pytest

import jaxcrusher as jc
from jaxcrusher.basics.record import words
from jaxcrusher.dynamics.lane_waits import TURNS, LaneWaits
from jaxcrusher.orbits.effort import Spent
from jaxcrusher.orbits.result import RESULTS
from jaxcrusher.orbits.transient import Wait


def waits_of(axis, tell=lambda: None, **others):
    """Crushers over the clearance, in m."""

    def scene(free, rest):
        return jc.build_scene({"clearance": free[0], **others, **rest})

    return LaneWaits(scene, (np.array(axis)[:, None], {}), None, None, tell)


@pytest.mark.slow
def test_newtons_method_in_lanes_comes_to_the_orbit():
    waits, both = waits_of([0.06e-3, 0.05e-3], speed=30.0), np.arange(2)
    waits.go_on(both, 240)
    assert waits.last(0).states.shape == (120, 4)
    found = waits.near(both, 1)
    assert found.closed.all()
    for i, clearance in enumerate((0.06e-3, 0.05e-3)):
        orbit = jc.periodic_orbit(jc.paper_scene(30.0, clearance))
        # Newton's last step is below 1e-7, and the nodes know the orbit to 1e-9.
        np.testing.assert_allclose(found.states[i], orbit.section, atol=1e-6)
        # Differences leave 1e-4 of a slope; the modulus itself is 0.99993 there.
        assert found.multipliers[i] == pytest.approx(float(orbit.largest_multiplier), abs=1e-4)
        # Every orbit of one turn repeats after two turns as well.
        twice = waits.near(np.array([i]), 2)
        np.testing.assert_allclose(twice.states[0], orbit.section, atol=1e-6)
    # More turns are added to those that there are.
    before = waits.last(0).states
    waits.go_on(np.array([0]), 480)
    assert waits.last(0).states.shape == (240, 4) and waits.last(1).states.shape == (120, 4)
    assert not np.array_equal(waits.last(0).states[:120], before)


def test_a_wait_is_told_of_and_ends_where_that_is_asked():
    """A long wait shows that it goes on, and Ctrl-C ends it; what it has come to is kept."""
    told = []

    def tell():
        told.append(len(told))
        if len(told) == 3:
            raise InterruptedError

    waits = waits_of([0.06e-3], tell, speed=30.0)
    with pytest.raises(InterruptedError):
        waits.go_on(np.arange(1), 100 * TURNS)
    states = waits.last(0).states
    assert told == [0, 1, 2] and states.shape == (3 * TURNS // 2, 4)
    (mean,), (spread,) = waits.means(np.arange(1), 2)
    np.testing.assert_array_equal(mean, states[1::2].mean(axis=0))
    np.testing.assert_array_equal(spread, states[1::2].std(axis=0))
    assert waits.names(np.arange(1)) == ["The motion from rest repeats after each turn."]


@pytest.mark.slow
def test_motions_are_named():
    """With a load on the closing stroke some repeat, and some hit their bores again and again."""
    waits = waits_of([0.0645e-3, 0.12e-3, 0.05e-3], speed=34.51, load_law="closing_stroke")
    cases = np.arange(3)
    waits.go_on(cases, 480)
    names = RESULTS.repeats_1, RESULTS.repeats_2, RESULTS.chaotic
    assert waits.names(cases) == [words(RESULTS, name) for name in names]
    # As a lone wait of as many turns names it.
    scene = jc.build_scene({"clearance": 0.05e-3, "speed": 34.51, "load_law": "closing_stroke"})
    lone = Wait(scene, Spent("quick"))
    assert len(list(lone.rounds())) == 2 and lone.regime(RESULTS.not_closed) == RESULTS.chaotic
    assert waits.hopeless(cases).tolist() == [False, False, True]
    quiet, _, loud = (float(waits.statistics(i).foundation_rms_error) for i in range(3))
    # What repeats has no scatter but that of the tolerance, 1e-7 of some 20 kN.
    assert quiet < 0.01 < loud


@pytest.mark.slow
def test_a_map_names_a_motion_round_an_unstable_orbit():
    """A pair of multipliers has left the unit circle: the motion turns round the orbit."""
    axes = {"speed": [40.0], "clearance": [0.075e-3, 0.0975e-3]}
    found = jc.orbit_map(jc.paper_machine(), axes, nodes=384).isel(speed=0)
    assert found.success.values.all() and found.stable.values.tolist() == [True, False]
    name = words(RESULTS, RESULTS.quasi_periodic)
    assert found.motion.values.tolist() == ["", name]
    # As a lone call finds them.
    np.testing.assert_allclose(found.foundation_rms, [22320.44114, 22509.25530], atol=1e-3)
    assert np.isnan(found.run_rms[0]) and found.run_rms_error[1] < 0.1
    assert found.largest_multiplier[1] == pytest.approx(1.0019934, abs=1e-6)
    # By `statistics` at a hundredth of the tolerance, over turns 5000 to 6000 from contact.
    rms, error = 22507.0542, 0.4125
    assert abs(rms - found.run_rms[1]) < 4 * (found.run_rms_error[1] + error)

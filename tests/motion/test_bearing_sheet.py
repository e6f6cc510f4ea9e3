"""What bearings stand along a run, beside statistics and counted by hand."""

import numpy as np
import pytest

import jaxcrusher as jc
from jaxcrusher.motion.bearing_sheet import bearing_sheet, bearings_of, quantities_of, shaking_rms
from jaxcrusher.motion.section import poincare_section
from jaxcrusher.motion.turns import Turns, run_turns


@pytest.fixture(scope="module")
def scene():
    return jc.build_scene({"contact_law": "rollers", "start": "contact", "elbow.clearance": 5e-5})


def test_numbers_are_the_statistics_of_the_same_turns():
    scene = jc.build_scene({"contact_law": "rollers", "start": "contact"})
    run = run_turns(scene, quantities_of(scene), settle=60, turns=5, rtol=1e-7)
    found = bearing_sheet(run)["main"]
    names = ("bearing_life", "static_load_ratio", "roller_pressure", "joint_peak", "shaking_rms")
    exact = jc.statistics(scene, 60, 5, rtol=1e-7, outputs=names)
    expected = {
        "life": exact["bearing_life"],
        "static_safety": 1 / exact["static_load_ratio"],
        "pressure": exact["roller_pressure"],
        "peak_load": exact["joint_peak"],
    }
    for name, value in expected.items():
        # 1024 instants a turn of a smooth motion; the tolerance of the steps.
        assert found[name][0] == pytest.approx(float(value), rel=1e-4), name
    assert shaking_rms(run)[0] == pytest.approx(float(exact["shaking_rms"]), rel=1e-4)
    assert found["contact_lost"] == (0, 0) and found["impacts"] == (0, 0)
    assert found["equivalent_load"][0] > found["mean_load"][0] > 0


def test_the_first_instant_of_a_turn_is_the_end_of_the_turn_before():
    """From the centred start, whose turns differ."""
    scene = jc.paper_scene(30.0, 0.06e-3)
    quantities = {"depth": scene.observables["penetration_ratio"]}
    states = np.asarray(poincare_section(scene, 0, 10).states)
    ends = np.hypot(states[:, 0], states[:, 1]) - 1
    whole = run_turns(scene, quantities, settle=0, turns=10).values["depth"]
    np.testing.assert_allclose(whole[1:, 0], ends[:-1], rtol=0, atol=1e-6)
    later = run_turns(scene, quantities, settle=5, turns=5).values["depth"]
    np.testing.assert_array_equal(later, whole[5:])


def test_a_crank_that_is_held_by_a_multiplier_is_not_turned_back():
    """After five turns its drive is 10 pi on, and would draw an angle there that began again."""
    scene = jc.paper_scene(30.0, 0.06e-3, start="contact", formulation="multiplier")
    quantities = {"shaft_speed": scene.observables["shaft_speed"]}
    speed = run_turns(scene, quantities, settle=5, turns=5, rtol=1e-6).values["shaft_speed"]
    # The multiplier holds the speed; it came to 261 rad/s.
    np.testing.assert_allclose(speed, 30.0, rtol=1e-3)


def test_impacts_are_counted_by_hand(scene):
    """Two turns of eight instants: two impacts in the first, one over the end of it."""
    depth = np.array([[-1, 1, 1, -1, 1, 1, -1, -1], [1, 1, 1, 1, 1, 1, 1, 1.0]])
    rate = np.zeros((2, 8))
    rate[0, 1], rate[0, 3], rate[1, 5] = 0.2, 0.5, 9.0
    load = np.array([[0.0, 2, 2, 0, 2, 2, 0, 0], np.full(8, 3.0)])
    values = {name: np.ones((2, 8)) for name in quantities_of(scene)}
    values |= {"main penetration_ratio": depth, "main penetration_rate": rate, "main load": load}
    values |= {"shaft_speed": np.full((2, 8), 30.0)}
    values |= {"main friction": np.array([np.full(8, 4.0), np.full(8, 6.0)])}
    found = bearing_sheet(Turns(scene, 1, values))["main"]
    assert found["impacts"] == (1.5, 0.5)
    # Before it touches, the second approaches at 0.5 m/s; what is pressed faster is no impact.
    assert found["impact_speed"][0] == 0.5
    assert found["contact_lost"] == (0.25, 0.25)
    assert found["friction_power"] == (5.0, 1.0)
    assert found["mean_load"] == (2.0, 1.0) and found["peak_load"][0] == 3.0
    both = np.array([np.mean(load[0] ** (10 / 3)), 3 ** (10 / 3)])
    # The mean of two turns is uncertain by half of what they differ by.
    worn, uncertain = both.mean(), np.ptp(both) / 2 / both.mean()
    assert found["equivalent_load"] == pytest.approx((worn**0.3, 0.3 * worn**0.3 * uncertain))
    # Two 22324 with C of 980 kN, at 30 rad/s.
    hours = 1e6 * 2 * np.pi / (30 * 3600) * (2 * 0.98e6) ** (10 / 3) / worn
    assert found["life"] == pytest.approx((hours, hours * uncertain))
    assert found["static_safety"][0] == pytest.approx(2 * 1.12e6 / 3)


def test_life_counts_revolutions_and_not_time(scene):
    """The shaft turns backwards, thrice as fast under the load of 2 N as under that of 1 N."""
    values = {name: np.ones((2, 8)) for name in quantities_of(scene)}
    values |= {"main load": np.tile([2.0, 1.0], (2, 4))}
    values |= {"shaft_speed": np.tile([-45.0, -15.0], (2, 4))}
    found = bearing_sheet(Turns(scene, 1, values))["main"]
    worn = (3 * 2 ** (10 / 3) + 1) / 4
    assert found["equivalent_load"] == pytest.approx((worn**0.3, 0.0))
    hours = 1e6 * 2 * np.pi / (30 * 3600) * (2 * 0.98e6) ** (10 / 3) / worn
    assert found["life"] == pytest.approx((hours, 0.0))


def test_seats_are_there_where_they_are_loose(scene):
    assert bearings_of(scene) == ("main", "shaft_bearing", "elbow")
    assert bearings_of(jc.ideal_scene(30.0)) == ("main", "shaft_bearing")

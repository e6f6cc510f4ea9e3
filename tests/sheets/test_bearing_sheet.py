"""What bearings stand along a run, beside statistics and counted by hand."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

import jaxcrusher as jc
from jaxcrusher.mechanism.reductions import samples_of
from jaxcrusher.motion.method import resolve
from jaxcrusher.motion.section import poincare_section
from jaxcrusher.motion.statistics import over_turns
from jaxcrusher.motion.turns import Turns, run_turns
from jaxcrusher.sheets.bearing_sheet import bearing_sheet, bearings_of, outputs_of, shaking_rms


@pytest.fixture(scope="module")
def scene():
    return jc.build_scene({"contact_law": "rollers", "start": "contact", "elbow.clearance": 5e-5})


def test_numbers_are_the_statistics_of_the_same_turns():
    scene = jc.build_scene({"contact_law": "rollers", "start": "contact"})
    run = run_turns(scene, outputs_of(scene), settle=60, turns=5, rtol=1e-7)
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
        # Peaks by parabolas through steps of 1e-7 are 1e-4 off.
        assert found[name][0] == pytest.approx(float(value), rel=3e-4), name
    # The tolerance of the steps.
    assert shaking_rms(run)[0] == pytest.approx(float(exact["shaking_rms"]), rel=1e-5)
    # No impact in five turns tells little of how many there are, and nothing of their speed:
    # exp(-1.841) is 16 %.
    assert found["impacts"] == (0, pytest.approx(-np.log(0.1587) / 5, rel=1e-3))
    for name in ("contact_lost", "impact_speed"):
        np.testing.assert_array_equal(found[name], (0, np.nan), err_msg=name)
    assert found["equivalent_load"][0] > found["mean_load"][0] > 0


def test_the_first_instant_of_a_turn_is_the_end_of_the_turn_before():
    """From the centred start, whose turns differ."""
    scene = jc.paper_scene(30.0, 0.06e-3)
    states = np.asarray(poincare_section(scene, 0, 10).states)
    ends = np.hypot(states[:, 0], states[:, 1]) - 1
    outputs = samples_of({"depth": scene.observables["penetration_ratio"]})
    whole = run_turns(scene, outputs, settle=0, turns=10).values["depth"]
    np.testing.assert_allclose(whole[1:, 0], ends[:-1], rtol=0, atol=1e-6)
    later = run_turns(scene, outputs, settle=5, turns=5).values["depth"]
    np.testing.assert_array_equal(later, whole[5:])


def test_a_crank_that_is_held_by_a_multiplier_is_not_turned_back():
    """After five turns its drive is 10 pi on, and would draw an angle there that began again."""
    scene = jc.paper_scene(30.0, 0.06e-3, start="contact", formulation="multiplier")
    outputs = samples_of({"shaft_speed": scene.observables["shaft_speed"]})
    speed = run_turns(scene, outputs, settle=5, turns=5, rtol=1e-6).values["shaft_speed"]
    # The multiplier holds the speed; it came to 261 rad/s.
    np.testing.assert_allclose(speed, 30.0, rtol=1e-3)


def of_turns(scene, **numbers):
    """A run of turns with these statistics at the main bearing, and ones elsewhere."""
    values = {name: np.ones(2) for name, _ in outputs_of(scene)}
    return Turns(scene, 1, values | {f"main {name}": one for name, one in numbers.items()})


def test_numbers_of_two_turns_by_hand(scene):
    run = of_turns(
        scene,
        load=np.array([1.0, 3.0]),
        peak=np.array([2.0, 3.0]),
        wear=30 * np.array([0.5 * 2 ** (10 / 3), 3 ** (10 / 3)]),
        contact=np.array([0.5, 1.0]),
        impacts=np.array([3.0, 0.0]),
        approach=np.array([0.5, 9.0]),
        friction=np.array([4.0, 6.0]),
    )
    run.values["speed"][:] = 30.0
    found = bearing_sheet(run)["main"]
    assert found["impacts"] == pytest.approx((1.5, 1.5))
    # What is pressed faster in the other turn is no impact.
    assert found["impact_speed"][0] == 0.5
    assert found["contact_lost"] == (0.25, 0.25)
    assert found["friction_power"] == (5.0, 1.0)
    assert found["mean_load"] == (2.0, 1.0) and found["peak_load"][0] == 3.0
    both = np.array([0.5 * 2 ** (10 / 3), 3 ** (10 / 3)])
    # The mean of two turns is uncertain by half of what they differ by.
    worn, uncertain = both.mean(), np.ptp(both) / 2 / both.mean()
    assert found["equivalent_load"] == pytest.approx((worn**0.3, 0.3 * worn**0.3 * uncertain))
    # Two 22324 with C of 980 kN, at 30 rad/s.
    hours = 1e6 * 2 * np.pi / (30 * 3600) * (2 * 0.98e6) ** (10 / 3) / worn
    assert found["life"] == pytest.approx((hours, hours * uncertain))
    assert found["static_safety"][0] == pytest.approx(2 * 1.12e6 / 3)


def test_life_counts_revolutions_and_not_time():
    """An uneven shaft turns fast under some loads: sums over 4096 instants are exact there."""
    scene = jc.build_scene({"joint": "ideal", "speed_fluctuation": 0.2})
    outputs = outputs_of(scene)
    found = over_turns(scene, None, 0, 1, outputs, resolve(scene, 1e-9))
    times = 2 * np.pi / 30.0 * np.arange(4096) / 4096
    seen = jc.simulate(scene, times, outputs=("joint_force", "shaft_speed"))
    load, speed = np.linalg.norm(seen["joint_force"], axis=1), np.asarray(seen["shaft_speed"])
    assert np.ptp(speed) > 5
    assert float(found["main wear"]) == pytest.approx(np.mean(load ** (10 / 3) * speed), rel=1e-6)
    assert float(found["speed"]) == pytest.approx(np.mean(speed), rel=1e-6)
    # A shaft that turns backwards wears the rings as much.
    snapshot = scene.formulation.snapshot(0.0, scene.formulation.initial(scene), scene)
    backwards = eqx.tree_at(lambda s: s.motion.crank.speed, snapshot, jnp.asarray(-45.0))
    assert float(dict(outputs)["speed"].quantity(backwards, scene)) == 45


def test_seats_are_there_where_they_are_loose(scene):
    assert bearings_of(scene) == ("main", "shaft_bearing", "elbow")
    assert bearings_of(jc.ideal_scene(30.0)) == ("main", "shaft_bearing")

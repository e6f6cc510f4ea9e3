"""Crushers whose friction has bristles: at rest, in orbits, in lanes, and with their power."""

from dataclasses import replace

import numpy as np
import pytest

import jaxcrusher as jc
from jaxcrusher.batch.engines import in_lanes, in_turn, map_all
from jaxcrusher.mechanism.drives import GivenTorque
from jaxcrusher.testing import check_law
from tests.crusher.formulations import forces_by_both
from tests.differences import assert_slopes

LAW = "jaxcrusher.joint.bristles:LuGre"
# The shaft's own bearing is loose alone: its surfaces pass each other at 2 m/s.
OWN = {"speed": 30.0, "joint": "ideal", "shaft_bearing.clearance": 5e-5}
OWN |= {"shaft_bearing.slip": "surface", "shaft_bearing.friction_law": LAW, "start": "contact"}
# Bristles so soft that a turn takes some thousand steps.
OWN |= {"shaft_bearing.bristle_stiffness": 2e3}


def orbit_with(friction):
    return jc.periodic_orbit(jc.build_scene(OWN | {"shaft_bearing.friction": friction}))


@pytest.mark.slow
def test_bristles_hold_a_shaft_that_laws_without_a_state_let_creep():
    """A free shaft without a torque, whose jaw lies on it: the friction circle holds it."""
    turned = []
    for law in ("jaxcrusher.joint.friction:Stribeck", LAW):
        chosen = {"slip": "surface", "start": "contact", "restitution": 0.5, "friction_law": law}
        scene = replace(jc.build_scene(chosen), drive=GivenTorque(0.0, 30.0))
        times = np.linspace(0, 3, 301)
        motion = jc.simulate(scene, times, outputs=("shaft_speed",))
        turned.append(abs(np.trapezoid(motion.shaft_speed[200:], times[200:])))
    # By 0.045 rad/s, and by what is left of a swing on the bristles.
    assert turned[0] > 0.03 and turned[1] < 3e-3


@pytest.mark.slow
def test_an_orbit_is_shot_for_and_has_slopes():
    """Sliding all the time, it is that of full friction; the bristles add a multiplier of none."""
    orbit = jc.periodic_orbit(jc.build_scene(OWN))
    plain = {k: v for k, v in OWN.items() if "bristle" not in k and v != LAW}
    plain = jc.periodic_orbit(jc.build_scene(plain))
    assert orbit.stable and orbit.found == "by shooting" and orbit.section.shape == (5,)
    # The tolerance of shooting is 1e-11.
    assert float(orbit.foundation_rms) == pytest.approx(float(plain.foundation_rms), rel=1e-9)
    moduli = np.sort(np.abs(orbit.multipliers))
    np.testing.assert_allclose(moduli[1:], np.sort(np.abs(plain.multipliers)), rtol=1e-5)
    assert moduli[0] < 1e-12
    # Central differences of values whose errors are 4e-11 of 19 100 N.
    assert_slopes(lambda friction: orbit_with(friction).foundation_rms, 0.1, 1e-3, rtol=1e-4)


@pytest.mark.slow
def test_both_formulations_move_alike_and_lanes_too():
    def end(numbers):
        scene = jc.build_scene(OWN | numbers)
        return jc.statistics(scene, 0, 1, rtol=1e-8).foundation_rms

    speeds = {"speed": np.linspace(28.0, 32.0, 5)}
    lanes, turns = (map_all(end, speeds, engine=how) for how in (in_lanes, in_turn))
    np.testing.assert_allclose(lanes, turns, rtol=1e-7)
    # By the drift that the multipliers' tolerance allows.
    np.testing.assert_allclose(*forces_by_both(OWN | {"foundation.mass": 6e3}), rtol=2e-5)


@pytest.mark.slow
def test_the_law_runs_everywhere():
    bearing = jc.build_scene(OWN).joints["shaft_bearing"]
    check_law(bearing)
    check_law(bearing.friction)


def test_nodes_know_no_bristles():
    scene = jc.build_scene(OWN)
    with pytest.raises(ValueError, match=r"`nodes` must be None for a bearing that remembers"):
        jc.periodic_orbit(scene, nodes=96)
    with pytest.raises(ValueError, match="have bearings without a memory"):
        jc.orbit_map(lambda **numbers: jc.build_scene(OWN | numbers), {"speed": [30.0]})

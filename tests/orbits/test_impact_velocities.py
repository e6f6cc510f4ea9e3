"""Orbits with a tracked impact velocity, against the integrator, which tracks it."""

from pathlib import Path

import jax
import numpy as np
import pytest

import jaxcrusher as jc
from jaxcrusher.orbits import periodic_orbit
from jaxcrusher.orbits.effort import Budget
from jaxcrusher.orbits.impact_velocities import settled_velocities
from tests.differences import assert_slopes

EXAMPLES = Path(__file__).parents[2] / "examples"


def test_a_tracked_velocity_is_held_at_what_it_comes_to():
    orbit = jc.periodic_orbit(jc.paper_scene(30.0, 0.06e-3, impact_law="tracked"))
    # 40 turns after 4000, the velocity tracked all the way, at a tolerance of 1e-9.
    assert orbit.stable and float(orbit.foundation_rms) == pytest.approx(19102.3157338, rel=1e-9)
    # The floor, below which no impact is counted.
    assert float(orbit.frozen_impact_velocities["main"]) == pytest.approx(0.01, rel=1e-12)
    assert orbit.found.endswith("tracked impact velocity held at 0.01 m/s at the main joint")
    assert jc.periodic_orbit(jc.ideal_scene(30.0)).frozen_impact_velocities is None


@pytest.mark.slow
def test_a_slider_holds_a_velocity_at_each_corner():
    """Its weight presses it to its lower edge, where it lands more slowly than the floor counts."""
    machine = jc.read_machine(EXAMPLES / "loose_guide.toml").replace(gravity=9.81, speed=10.0)
    orbit = jc.periodic_orbit(machine.scene())
    np.testing.assert_allclose(orbit.frozen_impact_velocities["guide"], [0.01] * 4, rtol=1e-12)
    assert orbit.stable and "held at 0.01, 0.01, 0.01, 0.01 m/s at the guide" in orbit.found
    # The orbit of the same scene whose velocities are that constant.
    constant = {"slides.guide.impact_law": "constant", "slides.guide.impact_velocity": 0.01}
    other = jc.periodic_orbit(machine.replace(**constant).scene())
    for name in ("shaking_rms", "drive_torque_rms"):
        # Orbits are known to rounding.
        assert float(orbit[name]) == pytest.approx(float(other[name]), rel=1e-10)


@pytest.mark.slow
def test_slopes_hold_it():
    def rms(clearance):
        scene = jc.paper_scene(27.0, clearance, impact_law="tracked")
        return jc.periodic_orbit(scene, nodes=96).foundation_rms

    # As of other orbits of this design: 30 125.935 by a constant velocity, to six digits.
    assert_slopes(rms, 5e-5, 1e-8, rtol=1e-6)


@pytest.mark.slow
def test_a_motion_that_goes_on_losing_contact_is_refused():
    scene = jc.paper_scene(30.0, 0.06e-3, impact_law="tracked", load_law="closing_stroke")
    spent = Budget("quick")
    assert settled_velocities(scene, spent) is None and spent.turns > 0
    orbit = jc.periodic_orbit(scene, effort="quick")
    assert not orbit.success and "losing contact" in orbit.failure


def test_values_must_be_known():
    scene = jc.paper_scene(30.0, 0.06e-3, impact_law="tracked")
    with pytest.raises(ValueError, match=r"^Argument `scene` must have a constant impact velocity"):
        jax.jit(jc.periodic_orbit)(scene)


def test_a_scene_by_multipliers_is_refused_before_anything_is_waited_for(monkeypatch):
    monkeypatch.setattr(periodic_orbit, "settled_velocities", None)
    scene = jc.paper_scene(30.0, 0.06e-3, impact_law="tracked", formulation="multiplier")
    with pytest.raises(ValueError, match="`scene` must be written by eccentricity, but is written"):
        jc.periodic_orbit(scene)

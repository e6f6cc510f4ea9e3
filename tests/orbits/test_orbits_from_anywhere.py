"""Orbits where the first try fails, and slopes that mean what they say."""

import jax
import numpy as np
import pytest

import jaxcrusher as jc
from jaxcrusher.scenes.build import build_chamber
from tests.differences import assert_slopes, differences


def rms_at(clearance):
    """In a tongue: 96 nodes give the RMS to 1e-5, and its slope of the wrong sign."""
    return jc.periodic_orbit(jc.paper_scene(41.6, clearance, slip="surface")).foundation_rms


@pytest.mark.slow
def test_eager_and_traced_orbits_mean_the_same():
    value, slope = jax.value_and_grad(rms_at)(5e-5)
    traced = jax.jit(jax.value_and_grad(rms_at))
    under_jit, its_slope = traced(np.float64(5e-5))
    # Both stand to 1e-8 of the RMS, with the same nodes.
    assert float(under_jit) == pytest.approx(float(value), rel=1e-8)
    assert float(its_slope) == pytest.approx(float(slope), rel=1e-6)
    expected = differences(lambda clearance: traced(clearance)[0], 5e-5, 1e-9)
    # Each RMS is known to some 1e-11 of 22 407 N: 100 N/m over this step.
    assert float(slope) == pytest.approx(float(expected), rel=5e-3)


@pytest.mark.slow
def test_an_error_is_not_claimed_too_small():
    """Sums of signed defects claim 2e-5 here, and the truth is 1e-3."""
    numbers = {"speed": 38.8277, "clearance": 9.1839e-5, "shaft.eccentricity": 0.0101464}
    laws = {"load": 12239.0, "load_law": "normal_to_jaw", "contact_law": "flores"}
    scene = jc.build_scene(numbers | laws)
    best = jc.periodic_orbit(scene)
    # By 384 nodes, as published by whoever found the fault.
    assert float(best.foundation_rms) == pytest.approx(21536.7, abs=0.1) and best.error < 1e-8
    for nodes in (96, 192):
        found = jax.jit(lambda scene, n=nodes: jc.periodic_orbit(scene, nodes=n))(scene)
        true = abs(float(found.foundation_rms / best.foundation_rms) - 1)
        assert not found.success or true < 3 * float(found.error)


@pytest.mark.slow
def test_the_slope_of_a_failure_is_no_number():
    def rms(speed, clearance=0.12e-3):
        return jc.periodic_orbit(jc.paper_scene(speed, clearance), nodes=96).foundation_rms

    def slopes(speed):
        return *jax.jvp(rms, (speed,), (1.0,)), jax.grad(rms)(speed), jax.jacfwd(rms)(speed)

    for by in (jax.jit, lambda function: function):
        assert np.isnan(by(slopes)(44.0)).all()


def test_multipliers_have_no_slopes():
    """Computed without, they would have slopes of zero."""

    def found(speed):
        orbit = jc.periodic_orbit(jc.paper_scene(speed, 0.06e-3), nodes=96)
        return orbit.settling_turns, orbit.largest_multiplier, orbit.foundation_rms

    slopes = jax.jacfwd(found)(30.0)
    assert np.isnan(slopes[0]) and np.isnan(slopes[1]) and np.isfinite(slopes[2])
    # And they spoil none that goes backwards beside them, nor are they computed for it.
    with jax.debug_nans(True):
        assert np.isfinite(jax.grad(lambda speed: found(speed)[2])(30.0))


@pytest.mark.slow
def test_traced_numbers_out_of_limits_are_failures():
    good = {"speed": 27.0, "restitution": 0.9, "friction": 0.1, "poisson": 0.3}

    def looked(numbers):
        scene = jc.build_scene({"clearance": 0.05e-3, **numbers})
        orbit = jc.periodic_orbit(scene, nodes=16)
        run = jc.statistics(scene, 0, 1)
        motion = jc.simulate(scene, [0.0, 1e-4], outputs=("foundation_force",))
        return (orbit.success, orbit.foundation_rms), (run.success, run.foundation_rms), motion

    traced = jax.jit(looked)
    _, (success, rms), motion = traced(good)
    assert success and np.isfinite(rms) and motion.success
    for name, value in (
        ("speed", -30.0),
        ("restitution", 1.5),
        ("friction", -0.1),
        ("poisson", 0.9),
    ):
        orbit, run, motion = traced(good | {name: value})
        for success, rms in (orbit, run, (motion.success, motion["foundation_force"][-1])):
            assert not success and np.isnan(rms), name

        def known(number, name=name):
            scene = jc.build_scene(good | {"clearance": 0.05e-3, name: number})
            return jc.statistics(scene, 0, 1).foundation_rms

        # Where the number is known inside of `jax.grad`, it is refused as always.
        with pytest.raises(ValueError, match=f"^Argument `{name}` must .* is {value}"):
            jax.grad(known)(value)


# Drawn at random: Newton's method finds no orbit from rest, and `simulate` settles to these RMS.
MACHINE = {
    "speed": 30.77148,
    "clearance": 0.0001374923,
    "bore_radius": 0.1990168,
    "load": 7034.523,
    "load_law": "normal_to_jaw",
    "friction": 0.1409557,
    "slip": "surface",
    "contact_law": "flores",
    "restitution": 0.7033087,
    "young": 82782010000.0,
    "shaft.mass": 1022.548,
    "shaft.inertia": 168.1751,
    "shaft.eccentricity": 0.01522508,
    "shaft.mass_centre_radius": 0.00252406,
    "shaft.mass_centre_angle": 3.432032,
    "jaw.mass": 2318.38,
    "jaw.inertia": 700.1917,
    "jaw.length": 1.025177,
    "jaw.mass_centre_distance": 0.5190754,
    "jaw.mass_centre_angle": 0.3515711,
    "toggle.mass": 78.93356,
    "toggle.inertia": 5.886129,
    "toggle.length": 0.4592695,
    "bearing.distance": 0.8979894,
    "bearing.inclination": 0.5810425,
    "counterweight.mass": 95.27843,
}
PAPER = {"speed": 38.465164, "clearance": 0.105981e-3, "slip": "surface"}


@pytest.mark.slow
@pytest.mark.optimised
def test_a_motion_that_must_be_waited_for():
    scene = jc.build_scene(MACHINE)
    assert not jc.periodic_orbit(scene, nodes=96).success
    orbit = jc.periodic_orbit(scene)
    # It has a claim of 1.7e-6 with 384 nodes.
    assert orbit.stable and orbit.error < 1e-5 and orbit.least_penetration > 0
    # The tolerance of that run leaves 2e-7.
    assert float(orbit.foundation_rms) == pytest.approx(56232.3449, rel=1e-6)


@pytest.mark.slow
def test_a_map_waits_for_what_its_neighbours_do_not_lead_to():
    """So does a lone call, whose first try fails at the higher speed."""
    axes = {"speed": [37.075044, 38.465164], "clearance": [0.105981e-3]}
    found = jc.orbit_map(jc.paper_machine(slip="surface"), axes)
    assert not jc.periodic_orbit(jc.build_scene(PAPER), nodes=96).success
    alone = [jc.periodic_orbit(jc.build_scene(PAPER | {"speed": speed})) for speed in axes["speed"]]
    assert found.success.all()
    assert alone[1].stable and alone[1].error < 1e-5 and alone[1].least_penetration > 0
    for cell, orbit in zip(found.foundation_rms[:, 0], alone, strict=True):
        # 192 nodes leave an error of 1e-7 at most here.
        assert float(cell) == pytest.approx(float(orbit.foundation_rms), rel=1e-6)


@pytest.mark.slow
def test_a_hessian_past_an_impact():
    """The second derivative of the contact's force jumps where its corner ends."""

    def force(numbers):
        scene = jc.build_scene({"clearance": 6e-5 * numbers[0], "restitution": 0.9 * numbers[1]})
        seen = jc.simulate(scene, [0.0, 3e-3], outputs=("foundation_force",))
        return seen["foundation_force"][-1]

    slope = jax.jit(jax.jacfwd(force))
    # Second derivatives are controlled to 1e-6, differences lose 1e-4 to the curve.
    assert_slopes(slope, np.ones(2), 1e-4, rtol=2e-3, atol=1e-3, by=jax.jacfwd)


def test_the_slope_of_a_capacity():
    def capacity(discharge):
        return build_chamber({"chamber.discharge": discharge}).capacity(30.0)

    # Q is linear in b: the slope is a difference of any size.
    assert_slopes(capacity, 0.036, 0.004, rtol=1e-12)
    with pytest.raises(ValueError, match="must be wider than the jaw's stroke"):
        jax.grad(capacity)(1e-3)

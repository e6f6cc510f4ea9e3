"""What a roller bearing does in the crusher: its orbit, its life, its limits, and its slopes."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxcrusher as jc
from jaxcrusher.joint.validity import RollerLoad
from jaxcrusher.mechanism.observables import bearing_stiffness
from tests.differences import differences

ROLLERS = {"contact_law": "rollers", "start": "contact"}


@pytest.fixture(scope="module")
def orbit():
    return jc.periodic_orbit(jc.build_scene(ROLLERS))


@pytest.mark.slow
def test_the_orbit_is_what_is_integrated(orbit):
    assert bool(orbit.success) and bool(orbit.validity.inside)
    # Six turns take a disturbance to 1/e: thirty to 1e-2 of the start's, which is close.
    names = ("foundation_rms", "bearing_life", "bearing_stiffness", "roller_pressure")
    found = jc.statistics(orbit.scene, 60, 1, outputs=names)
    for name in names:
        # What is left after ten times 1/e, 5e-5, of a start that is 1e-3 off; peaks by samples.
        np.testing.assert_allclose(found[name], orbit[name], rtol=1e-5, err_msg=name)


def test_life_is_that_of_the_equivalent_load(orbit):
    """ISO 281: (C / P)^(10/3) million turns, P the mean of F^(10/3)."""
    angles = 2 * np.pi * np.arange(720) / 720
    force = np.linalg.norm(orbit.motion(angles, ("joint_force",))["joint_force"], axis=1) / 2
    equivalent = np.mean(force ** (10 / 3)) ** 0.3
    hours = (0.98e6 / equivalent) ** (10 / 3) * 1e6 / (3600 * 30 / (2 * np.pi))
    # Means over 720 instants of a smooth motion and over 1024 nodes.
    assert float(orbit.bearing_life) == pytest.approx(hours, rel=1e-8)
    assert float(orbit.static_load_ratio) == pytest.approx(force.max() / 1.12e6, rel=1e-4)


def test_stiffness_is_a_difference_of_forces(orbit):
    yields = differences(orbit.scene.joints.at("main").normal.penetration_under, 20e3, 10.0)
    # Of a central difference of 1e-3.
    assert float(bearing_stiffness(orbit.scene, 20e3)) == pytest.approx(1 / yields, rel=1e-6)
    at = bearing_stiffness(orbit.scene, float(orbit.joint_peak))
    assert float(orbit.bearing_stiffness) < float(at)
    with pytest.raises(
        ValueError, match="name a joint with clearance: there is none, but is main, an ideal one"
    ):
        bearing_stiffness(jc.build_scene({"joint": "ideal"}), 1e4)


@pytest.mark.slow
def test_slopes_are_differences():
    names = ("rollers.count", "rollers.length", "rollers.friction", "clearance", "rollers.damping")

    def numbers(shares):
        defaults = [jc.PARAMETERS[name].default for name in names]
        given = {n: d * share for n, d, share in zip(names, defaults, shares, strict=True)}
        one = jc.periodic_orbit(jc.build_scene(ROLLERS | given))
        return jnp.stack([one.foundation_rms, jnp.log(one.bearing_life), one.drive_power])

    ones = np.ones(len(names))
    slopes = np.array(jax.jacobian(numbers)(ones))
    # The next order of a step of 1e-3 of each number's share.
    error = np.abs(slopes - differences(numbers, ones, 1e-3))
    assert np.all(error < 1e-5 * np.abs(slopes).max(axis=1, keepdims=True)), error


def test_a_bearing_that_is_too_small_is_told():
    small = {"rollers.static_rating": 1e4, "rollers.length": 1e-3}
    found = jc.periodic_orbit(jc.build_scene(ROLLERS | small)).validity
    assert not bool(found.inside) and "of the static rating" in found.verdict()
    load = found.others["rollers"]
    assert isinstance(load, RollerLoad) and float(load.load_ratio) > 1
    with pytest.raises(ValueError, match="must be smaller than the pitch diameter"):
        jc.build_scene(ROLLERS | {"rollers.diameter": 0.2})
    with pytest.raises(ValueError, match="must come with `contact_law=rollers`"):
        jc.build_scene({"rollers.count": 20})
    with pytest.raises(ValueError, match="ask for bearing_life only of a scene with rollers there"):
        jc.statistics(jc.build_scene({}), 0, 1, outputs=("bearing_life",))

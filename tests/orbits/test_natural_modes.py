"""Natural modes of a machine on supports: closed forms, and a free vibration integrated."""

import equinox as eqx
import numpy as np
import pytest

import jaxcrusher as jc

# G in the middle of the supports and at their height, without weight: nothing couples but the
# mechanism, which weighs next to nothing here.
PLAIN = {
    "foundation.mass": 5000.0,
    "foundation.inertia": 2000.0,
    "foundation.x": 0.0,
    "foundation.y": -0.4,
    "foundation.left": -0.7,
    "foundation.right": 0.7,
    "foundation.base": -0.4,
    "foundation.horizontal_stiffness": 2e6,
    "foundation.vertical_stiffness": 3e6,
    "foundation.horizontal_damping": 1e4,
    "foundation.vertical_damping": 6e4,
    "joint": "ideal",
    "gravity": 0.0,
}
PLAIN |= {f"{body}.mass": 1e-6 for body in ("shaft", "jaw", "toggle")}
PLAIN |= {f"{body}.inertia": 1e-6 for body in ("shaft", "jaw", "toggle")}


def test_uncoupled():
    modes = jc.natural_modes(jc.build_scene(PLAIN))
    masses = np.array([5000.0, 5000.0, 2000.0])
    springs = np.array([4e6, 6e6, 6e6 * 0.49])
    dampers = np.array([2e4, 12e4, 12e4 * 0.49])
    order = np.argsort(springs / masses)
    frequency = np.sqrt(springs / masses)
    # The mechanism has 3e-6 kg of 5000, at arms of a metre.
    np.testing.assert_allclose(modes.frequency, frequency[order] / (2 * np.pi), rtol=1e-7)
    ratio = dampers / (2 * masses * frequency)
    np.testing.assert_allclose(modes.damping_ratio, ratio[order], rtol=1e-7)
    damped = modes.frequency * np.sqrt(1 - ratio[order] ** 2)
    np.testing.assert_allclose(modes.damped_frequency, damped, rtol=1e-7)
    np.testing.assert_allclose(modes.share, np.eye(3)[order], atol=1e-6)


def test_overdamped():
    scene = jc.build_scene(PLAIN | {"foundation.vertical_damping": 6e5})
    modes = jc.natural_modes(scene)
    vertical = modes.isel(mode=int(np.argmax(modes.share.values[:, 1])))
    assert float(vertical.damping_ratio) == pytest.approx(12e5 / (2 * 5000 * 1200**0.5), rel=1e-6)
    assert float(vertical.frequency) == pytest.approx(1200**0.5 / (2 * np.pi), rel=1e-6)
    assert float(vertical.damped_frequency) == 0


def test_a_free_vibration():
    """A machine that turns swings by its modes: multipliers of its orbit decay as the modes do."""
    scene = jc.build_scene({"foundation.mass": 3000.0, "joint": "ideal", "speed": 30.0})
    modes = jc.natural_modes(scene)
    orbit = jc.periodic_orbit(scene)
    turn = 2 * np.pi / 30
    decay = 2 * np.pi * modes.frequency * modes.damping_ratio
    # The linkage moves through the turn, so that the block is not the same all the time: to 1 %.
    found = np.sort(np.log(np.abs(orbit.multipliers))[::2] / -turn)
    np.testing.assert_allclose(found, np.sort(decay), rtol=1e-2)


def test_refused():
    with pytest.raises(ValueError, match="`scene` must have a frame on supports"):
        jc.natural_modes(jc.ideal_scene(30.0))
    high = jc.build_scene({"foundation.mass": 1e6, "foundation.y": 40.0})
    with pytest.raises(ValueError, match="does not topple"):
        jc.natural_modes(high)
    with pytest.raises(ValueError, match="natural_modes"):
        eqx.filter_jit(jc.natural_modes)(jc.build_scene(PLAIN))

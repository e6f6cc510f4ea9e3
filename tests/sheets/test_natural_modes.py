"""Natural modes of a machine on supports: closed forms, and a free vibration integrated."""

import equinox as eqx
import numpy as np
import pytest
import scipy.linalg

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
SIDES = ("horizontal", "vertical")
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
    damped = modes.frequency.values * np.sqrt(1 - ratio[order] ** 2)
    np.testing.assert_allclose(modes.damped_frequency, damped, rtol=1e-7)
    np.testing.assert_allclose(modes.decay, ratio[order] * frequency[order], rtol=1e-7)
    np.testing.assert_allclose(modes.share, np.eye(3)[order], atol=1e-6)
    still = jc.natural_modes(
        jc.build_scene(PLAIN | {f"foundation.{one}_damping": 0.0 for one in SIDES})
    )
    # Not what rounding leaves: nothing takes energy.
    assert not still.damping_ratio.any() and not still.decay.any()
    np.testing.assert_allclose(still.frequency, modes.frequency, rtol=1e-12)


def test_coupled():
    """Modes are those of mass and stiffness alone, free motions the eigenvalues with dampers."""
    beside = {"foundation.x": 0.2, "foundation.y": 0.3, "foundation.vertical_damping": 2e5}
    modes = jc.natural_modes(jc.build_scene(PLAIN | beside))
    mass = np.diag([5000.0, 5000.0, 2000.0])
    # Of each support: how a motion (x, y, rotation) of G moves it.
    moves = [np.array([[1, 0, 0.7], [0, 1, side - 0.2]]) for side in (-0.7, 0.7)]
    stiffness = sum(one.T @ np.diag([2e6, 3e6]) @ one for one in moves)
    damping = sum(one.T @ np.diag([1e4, 2e5]) @ one for one in moves)
    squares, shapes = scipy.linalg.eigh(stiffness, mass)
    # The mechanism has 3e-6 kg of 5000, at arms of a metre.
    np.testing.assert_allclose(modes.frequency, np.sqrt(squares) / (2 * np.pi), rtol=1e-7)
    np.testing.assert_allclose(np.abs(modes["shape"]), np.abs(shapes.T), rtol=1e-6)
    ratio = np.diag(shapes.T @ damping @ shapes) / (2 * np.sqrt(squares))
    np.testing.assert_allclose(modes.damping_ratio, ratio, rtol=1e-7)
    upper, lower = np.hstack([0 * mass, np.eye(3)]), np.hstack([-stiffness, -damping])
    values = np.linalg.eigvals(np.vstack([upper, np.linalg.solve(mass, lower)]))
    expected = np.sort_complex(values[values.imag >= 0])
    found = np.sort_complex(-modes.decay.values + 2j * np.pi * modes.damped_frequency.values)
    assert len(found) == 4 and np.sum(found.imag == 0) == 2
    np.testing.assert_allclose(found, expected, rtol=1e-6)


def test_strong_dampers_do_not_move_natural_frequencies():
    """A block of 6 t on soft springs: `scipy.linalg.eigh` of matrices by hand gives these Hz."""
    block = {"foundation.mass": 6e3, "foundation.x": 0.3, "foundation.y": 0.2, "joint": "ideal"}
    soft = {"foundation.horizontal_stiffness": 1e6, "foundation.vertical_stiffness": 15e6}
    modes = jc.natural_modes(jc.build_scene(block | soft))
    # As drawn, where the springs do not sag: to 1e-3.
    np.testing.assert_allclose(modes.frequency, [2.6676, 10.0937, 14.8588], rtol=1e-3)
    assert np.sum(modes.damped_frequency == 0) == 2
    stiffer = soft | {"foundation.vertical_stiffness": 30e6}
    assert (jc.natural_modes(jc.build_scene(block | stiffer)).frequency > modes.frequency).all()


@pytest.mark.slow
def test_a_free_vibration():
    """A machine that turns swings by its modes: multipliers of its orbit decay as the modes do."""
    scene = jc.build_scene({"foundation.mass": 3000.0, "joint": "ideal", "speed": 30.0})
    modes = jc.natural_modes(scene)
    orbit = jc.periodic_orbit(scene)
    turn = 2 * np.pi / 30
    # The linkage moves through the turn, so that the block is not the same all the time: to 1 %.
    found = np.sort(np.log(np.abs(orbit.multipliers))[::2] / -turn)
    np.testing.assert_allclose(found, np.sort(modes.decay), rtol=1e-2)


def test_refused():
    with pytest.raises(ValueError, match="`scene` must have a frame on supports"):
        jc.natural_modes(jc.ideal_scene(30.0))
    high = jc.build_scene({"foundation.mass": 1e6, "foundation.y": 40.0})
    with pytest.raises(ValueError, match="does not topple"):
        jc.natural_modes(high)
    with pytest.raises(ValueError, match="natural_modes"):
        eqx.filter_jit(jc.natural_modes)(jc.build_scene(PLAIN))

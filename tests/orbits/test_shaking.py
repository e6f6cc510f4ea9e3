"""The shaking force: its numbers by other means, and what |R_O| + |R_C| does not tell of it."""

import equinox as eqx
import jax
import numpy as np
import pytest

import jaxcrusher as jc

LAWS = ("along_jaw", "normal_to_jaw", "closing_stroke", "none")


@eqx.filter_jit
def forces(speed, mass, law):
    """RMS of |R_O| + |R_C| and of the shaking force, and its peak, with ideal joints."""
    described = {"joint": "ideal", "speed": speed, "counterweight.mass": mass, "load_law": law}
    orbit = jc.periodic_orbit(jc.build_scene(described))
    return orbit.foundation_rms, orbit.shaking_rms, orbit.shaking_peak


def differences(mass, count=4096):
    """The shaking force over a turn at 30 rad/s, by differences of the places of the bodies.

    In NumPy from Tables 1 and 2, with a counterweight of `mass` at 0.2 m, opposite to O-A. The
    elbow is where circles about C and A meet.
    """
    angle = 2 * np.pi * np.arange(count) / count

    def place(length, angle):
        return length * np.stack([np.cos(angle), np.sin(angle)], axis=-1)

    bearing = 0.64 * np.array([np.sin(np.radians(22.5)), np.cos(np.radians(22.5))])
    pin = bearing + place(0.01, angle)
    apart = np.linalg.norm(pin, axis=1)
    # The toggle lies left of C-A by the angle at C of the triangle C, B, A.
    inside = np.arccos((apart**2 + 0.3**2 - 0.695**2) / (2 * apart * 0.3))
    elbow = place(0.3, np.arctan2(pin[:, 1], pin[:, 0]) - inside)
    tilt = np.arctan2(-(pin - elbow)[:, 0], (pin - elbow)[:, 1])
    jaw = pin + place(0.3, tilt + np.radians(15) - np.pi / 2)
    bodies = (
        (95.0, bearing + place(0.006, angle + np.radians(30))),
        (mass, bearing - place(0.2, angle)),
        (524.0, jaw),
        (22.0, elbow / 2),
    )
    moment = sum(m * at for m, at in bodies)
    step = 2 * np.pi / count / 30.0
    return -(np.roll(moment, 1, axis=0) - 2 * moment + np.roll(moment, -1, axis=0)) / step**2


@pytest.mark.parametrize("law", LAWS)
def test_shaking_force_is_the_bodies_whatever_the_load(law):
    for mass in (0.0, 50.0):
        expected = np.linalg.norm(differences(mass), axis=1)
        _, shaking, peak = forces(30.0, mass, law)
        # Differences leave h^2 / 12 of the fourth derivative: 2e-7 a harmonic's order squared.
        np.testing.assert_allclose(shaking, np.sqrt(np.mean(expected**2)), rtol=1e-6)
        np.testing.assert_allclose(peak, expected.max(), rtol=1e-6)
        if mass == 0:
            # To the two decimals of another program.
            assert float(shaking) == pytest.approx(4513.63, abs=5e-3)
    assert float(forces(30.0, 0.0, "none")[0]) < 0.6 * float(forces(30.0, 0.0, "along_jaw")[0])


def test_less_of_the_two_reactions_may_shake_the_ground_more():
    """The paper's machine with counterweights of 0 and 50 kg, at 10 and 30 rad/s."""
    (none, quiet), (heavy, loud) = (forces(30.0, mass, "along_jaw")[:2] for mass in (0.0, 50.0))
    # 19 099 to 18 714 N, and 4514 to 4824 N by the differences above too.
    assert float(heavy) < 0.985 * float(none) and float(loud) > 1.06 * float(quiet)
    shaken = [np.sqrt(np.mean(np.sum(differences(m) ** 2, axis=1))) for m in (0.0, 50.0)]
    assert shaken[1] > 1.06 * shaken[0]
    # Slowly turned the weight of 20 kg is all that |R_O| + |R_C| sees of what calms the machine.
    (none, shaking), (light, calm) = (forces(10.0, mass, "along_jaw")[:2] for mass in (0.0, 20.0))
    assert float(light) > float(none) and float(calm) < 0.35 * float(shaking)


def test_moving_part_of_the_force_on_the_ground():
    """On a periodic orbit with clearance, the ground's force less its mean over the period."""
    orbit = jc.periodic_orbit(jc.paper_scene(31.0, 0.05e-3), nodes=96)
    names = ("bearing_reaction", "toggle_reaction", "crushing_load", "shaking_force")
    seen = orbit.motion(2 * np.pi * np.arange(1024) / 1024, names)
    # The load on the jaw stands on the fixed jaw, which stands on the ground.
    ground = -(seen["bearing_reaction"] + seen["toggle_reaction"] + seen["crushing_load"])
    moving = ground - ground.mean(axis=0)
    # Momentum comes back to itself, as far as the orbit is known: to 1e-8 of 1e4 N.
    np.testing.assert_allclose(moving, seen["shaking_force"], rtol=0, atol=1e-4)
    rms = np.sqrt(np.mean(np.sum(moving**2, axis=1)))
    assert float(orbit.shaking_rms) == pytest.approx(rms, rel=1e-8)
    sampled = np.linalg.norm(seen["shaking_force"], axis=1).max()
    # 1024 instants of a turn see the top of a smooth peak to 1e-5.
    assert sampled <= float(orbit.shaking_peak) < sampled * (1 + 1e-5)


def test_slopes_of_the_shaking_force():
    """By speed and by a counterweight that is not there yet, forwards, against differences."""

    def shaking(speed, mass):
        numbers = {"speed": speed, "clearance": 5e-5, "counterweight.mass": mass}
        return jc.periodic_orbit(jc.build_scene(numbers), nodes=96).shaking_rms

    slopes = jax.grad(shaking, argnums=(0, 1))(30.0, 1.0)
    steps = (1e-2, 0.0), (0.0, 1e-2)
    for slope, step in zip(slopes, steps, strict=True):
        high, low = (shaking(30.0 + k * step[0], 1.0 + k * step[1]) for k in (1, -1))
        # Central differences over 1e-2: a third derivative of their own size leaves 1e-5.
        assert float(slope) == pytest.approx(float(high - low) / 2e-2, rel=1e-5)
    assert float(slopes[1]) < -150


def test_a_shaft_alone_stands_still_with_its_counterweight():
    """m1 l11 of the shaft against m r of a counterweight opposite to it: nothing shakes."""
    light = {f"{body}.{part}": 1e-9 for body in ("jaw", "toggle") for part in ("mass", "inertia")}
    described = {"joint": "ideal", "load_law": "none", "counterweight.radius": 0.2, **light}
    described |= {"counterweight.angle": np.radians(210), "counterweight.mass": 95 * 0.006 / 0.2}
    for speed in (10.0, 30.0):
        orbit = jc.periodic_orbit(jc.build_scene(described | {"speed": speed}))
        # Links of 1e-9 kg, and rounding of an angle, against 95 kg at 6 mm.
        assert float(orbit.shaking_rms) < 1e-8 * 95 * 0.006 * speed**2 + 2e-6
        weight = (95 + 95 * 0.006 / 0.2) * 9.81
        assert float(orbit.foundation_rms) == pytest.approx(weight, rel=1e-7)

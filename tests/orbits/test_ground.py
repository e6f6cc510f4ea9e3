"""Force and moment on the ground under a clamped frame, and their harmonics."""

import jax.numpy as jnp
import numpy as np
import pytest

import jaxcrusher as jc
from jaxcrusher.mechanism.reductions import SAMPLES
from jaxcrusher.orbits import solving
from tests.differences import assert_slopes
from tests.pairs import crossed

LAWS = ("along_jaw", "closing_stroke", "normal_to_jaw", "none")
ANGLES = 2 * np.pi * np.arange(1024) / 1024
# Away from bearing and pivot, so that every arm counts.
POINT = (0.5, -0.4)


def at_point(**values):
    return jc.build_scene({"foundation.x": POINT[0], "foundation.y": POINT[1], **values})


def by_hand(point, counterweight=0.0, count=1024):
    """Force and moment on the ground at 30 rad/s, in NumPy from Tables 1 and 2.

    A counterweight (kg) is at 0.2 m, opposite to O-A. Momentum and moment of momentum about
    the point are differentiated as trigonometric polynomials. The elbow is where circles about C
    and A meet.
    """
    angle = 2 * np.pi * np.arange(count) / count

    def place(length, angle):
        return length * np.stack([np.cos(angle), np.sin(angle)], axis=-1)

    def change(x):
        orders = np.fft.rfftfreq(count, 1 / count)
        spectrum = 30.0 * 1j * orders.reshape(-1, *[1] * (x.ndim - 1)) * np.fft.rfft(x, axis=0)
        # Harmonics past the 40th are rounding.
        spectrum[40:] = 0
        return np.fft.irfft(spectrum, count, axis=0)

    bearing = 0.64 * np.array([np.sin(np.radians(22.5)), np.cos(np.radians(22.5))])
    pin = bearing + place(0.01, angle)
    apart = np.linalg.norm(pin, axis=1)
    inside = np.arccos((apart**2 + 0.3**2 - 0.695**2) / (2 * apart * 0.3))
    slope = np.arctan2(pin[:, 1], pin[:, 0]) - inside
    elbow = place(0.3, slope)
    tilt = np.arctan2(-(pin - elbow)[:, 0], (pin - elbow)[:, 1])
    jaw = pin + place(0.3, tilt + np.radians(15) - np.pi / 2)
    bodies = (
        (95.0, bearing + place(0.006, angle + np.radians(30)), 0.2, None),
        (counterweight, bearing - place(0.2, angle), 0.0, None),
        (524.0, jaw, 128.48, tilt),
        (22.0, elbow / 2, 0.7154, slope),
    )
    momentum, spin, weight = 0.0, 0.0, 0.0
    for mass, at, inertia, turned in bodies:
        arm, velocity = at - point, change(at)
        momentum = momentum + mass * velocity
        # The shaft's own turns at constant speed.
        own = 30.0 if turned is None else change(turned)
        spin = (
            spin + inertia * own + mass * (arm[:, 0] * velocity[:, 1] - arm[:, 1] * velocity[:, 0])
        )
        weight = weight - mass * 9.81 * arm[:, 0]
    force = np.array([0.0, -9.81 * (641.0 + counterweight)]) - change(momentum)
    return force, weight - change(spin)


@pytest.mark.parametrize(("law", "mass"), crossed(LAWS, (0.0, 50.0), later=LAWS[2:]))
def test_force_and_moment_of_ideal_joints(law, mass):
    """The bodies' momentum, whatever the load."""
    described = {"joint": "ideal", "load_law": law, "counterweight.mass": mass}
    orbit = jc.periodic_orbit(at_point(**described))
    seen = orbit.motion(ANGLES, ("ground_force", "ground_moment"))
    force, moment = by_hand(np.array(POINT), mass)
    # Spectral derivatives of places lose some 1e-11 twice, of forces of 1e4 N.
    np.testing.assert_allclose(seen["ground_force"], force, rtol=0, atol=1e-5)
    np.testing.assert_allclose(seen["ground_moment"], moment, rtol=0, atol=1e-5)
    assert float(orbit.shaking_moment_rms) == pytest.approx(np.std(moment), rel=1e-8)
    size = np.linalg.norm(force - force.mean(axis=0), axis=1)
    rms = np.sqrt(np.mean(size**2))
    assert float(orbit.shaking_rms) == pytest.approx(rms, rel=1e-9)
    # 1024 instants of a turn see the top of a smooth peak to 1e-5.
    assert size.max() <= float(orbit.shaking_peak) * (1 + 1e-9) < size.max() * (1 + 1e-5)
    if mass == 0:
        # By another program too, to its two decimals.
        assert rms == pytest.approx(4513.63, abs=5e-3)


def test_less_of_the_two_reactions_may_shake_the_ground_more():
    """|R_O| + |R_C| and the shaking force with counterweights, at 30 and 10 rad/s."""

    def forces(speed, mass):
        described = {"joint": "ideal", "speed": speed, "counterweight.mass": mass}
        orbit = jc.periodic_orbit(jc.build_scene(described))
        return float(orbit.foundation_rms), float(orbit.shaking_rms)

    # 19 099 to 18 714 N, and 4514 to 4824 N as by hand above.
    (none, quiet), (heavy, loud) = forces(30.0, 0.0), forces(30.0, 50.0)
    assert heavy < 0.985 * none and loud > 1.06 * quiet
    # Slowly turned the weight of 20 kg is all that |R_O| + |R_C| sees of what calms the machine.
    (none, shaking), (light, calm) = forces(10.0, 0.0), forces(10.0, 20.0)
    assert light > none and calm < 0.35 * shaking


def test_without_a_foundation_moments_count_about_the_pivot():
    _, moment = by_hand(np.zeros(2))
    plain = jc.periodic_orbit(jc.ideal_scene(30.0)).motion(ANGLES, ("ground_moment",))
    np.testing.assert_allclose(plain["ground_moment"], moment, rtol=0, atol=1e-5)
    scene = jc.build_scene({"joint": "ideal", "foundation.x": 0.0})
    zero = jc.periodic_orbit(scene).motion(ANGLES, ("ground_moment",))
    np.testing.assert_array_equal(zero["ground_moment"], plain["ground_moment"])
    with pytest.raises(ValueError, match=r"`foundation\.x` must lie"):
        jc.build_scene({"foundation.x": 1000.0})


def light(**values):
    """The shaft alone: its links weigh 1e-9 kg."""
    bodies = {f"{body}.{part}": 1e-9 for body in ("jaw", "toggle") for part in ("mass", "inertia")}
    return at_point(joint="ideal", load_law="none", **bodies, **values)


def test_harmonics_of_a_rotating_unbalance():
    """The force is m r omega^2, ahead in x by a quarter; its moment is that at arms O - p."""
    orbit = jc.periodic_orbit(light(speed=20.0))
    found = jc.harmonics(orbit, 3)
    assert list(found["order"].values) == [0, 1, 2, 3]
    assert list(found["unit"].values) == ["N", "N", "N m"]
    size, ahead, weight = 95 * 0.006 * 20.0**2, np.radians(30), 95 * 9.81
    amplitude, phase = found["amplitude"], found["phase"]
    x, y = (amplitude.sel(quantity=f"ground_force_{axis}") for axis in "xy")
    # Links of 1e-9 kg at some m/s2, and rounding.
    np.testing.assert_allclose(x, [0, size, 0, 0], atol=1e-6)
    np.testing.assert_allclose(y, [-weight, size, 0, 0], atol=1e-6)
    seen = phase.sel(order=1).values
    np.testing.assert_allclose(seen[:2], [ahead, ahead - np.pi / 2], atol=1e-9)
    arm = 0.64 * np.array([np.sin(np.pi / 8), np.cos(np.pi / 8)]) - POINT
    # (arm + r e) x (F e - W): the force passes through O, the weight through the mass centre.
    turning = size * (arm[0] * -1j - arm[1]) - weight * 0.006
    moment = amplitude.sel(quantity="ground_moment")
    np.testing.assert_allclose(moment, [-weight * arm[0], abs(turning), 0, 0], atol=1e-6)
    assert seen[2] == pytest.approx(np.angle(turning * np.exp(1j * ahead)), abs=1e-9)
    # Half of the squares of the harmonics.
    assert float(orbit.shaking_moment_rms) == pytest.approx(abs(turning) / np.sqrt(2), rel=1e-9)


def test_each_turn_of_an_orbit_has_a_mean_of_its_own():
    """As those of a run have: here a turn of an ideal machine stands for two, which differ."""
    scene = jc.ideal_scene(30.0)
    still = scene.formulation.initial(scene)
    times = 2 * np.pi / 30.0 * np.arange(2 * SAMPLES) / SAMPLES
    found, _, _ = solving._statistics(
        lambda time, scene: scene.formulation.snapshot(time / 2, still, scene),
        (jnp.asarray(times),),
        scene,
        scene.entries(("foundation_rms", "foundation_peak", "shaking_moment_rms")),
    )
    moment, force = (
        np.asarray(jc.simulate(scene, times / 2, outputs=(name,))[name]).reshape(2, -1)
        for name in ("ground_moment", "foundation_force")
    )
    assert float(found["shaking_moment_rms"]) == pytest.approx(
        np.sqrt(np.mean(np.var(moment, axis=1))), rel=1e-9
    )
    assert np.std(moment) > 1.2 * float(found["shaking_moment_rms"])
    assert float(found["foundation_rms"]) == pytest.approx(np.sqrt(np.mean(force**2)), rel=1e-12)
    # The polynomial between the instants is no lower.
    assert 0 <= float(found["foundation_peak"]) - force.max() < 0.1


@pytest.mark.slow
def test_harmonics_make_the_motion():
    """Any observable, of two turns in orders of a half, and what is refused."""
    orbit = jc.periodic_orbit(jc.paper_scene(30.0, 0.06e-3), period=2, nodes=96)
    names = ("ground_force", "drive_power")
    found = jc.harmonics(orbit, 200, outputs=names)
    assert found.sizes == {"quantity": 3, "order": 401} and found["order"].values[1] == 0.5
    angles = np.array([0.3, 4.0, 9.0])
    turned = angles[:, None] * found["order"].values + found["phase"].values[:, None]
    sums = np.sum(found["amplitude"].values[:, None] * np.cos(turned), axis=2)
    seen = orbit.motion(angles, names)
    # 200 harmonics hold all of a motion in contact: the pin's swing is at the 28th.
    np.testing.assert_allclose(sums[:2].T, seen["ground_force"], rtol=0, atol=1e-4)
    np.testing.assert_allclose(sums[2], seen["drive_power"], rtol=0, atol=1e-4)
    # The motion repeats after one turn: nothing has a half order.
    assert float(found["amplitude"].values[:, 1::2].max()) < 1e-5
    for bad, message in (
        ({"orders": 0}, "`orders` must be a whole number >= 1"),
        ({"orders": 512}, "`orders` must be less than 512"),
        ({"outputs": ("energy",)}, "`outputs` must"),
    ):
        with pytest.raises(ValueError, match=message):
            jc.harmonics(orbit, **bad)
    with pytest.raises(ValueError, match="one that was found"):
        lost = jc.periodic_orbit(jc.paper_scene(25.0, 0.12e-3, young=1e7), nodes=4)
        jc.harmonics(lost)


@pytest.mark.slow
def test_the_moment_of_a_motion_with_clearance():
    """Integrated over turns it is the deviation of samples, and orbits have its slopes."""
    scene = at_point(clearance=5e-5, start="contact")
    found = jc.statistics(scene, 0, 2, outputs=("shaking_moment_rms",))
    times = 2 * np.pi / 30 * np.linspace(0, 2, 2 * 2048 + 1)
    moment = np.asarray(jc.simulate(scene, times, outputs=("ground_moment",)).ground_moment)
    turns = np.stack([moment[:2049], moment[2048:]])
    mean = np.trapezoid(turns, axis=1) / 2048
    squares = np.trapezoid((turns - mean[:, None]) ** 2, axis=1) / 2048
    # The trapezium rule of 2048 points a turn of a 130 Hz swing.
    np.testing.assert_allclose(found.by_turn["shaking_moment_rms"], np.sqrt(squares), rtol=1e-6)
    rms = np.sqrt(squares.mean())
    assert float(found.shaking_moment_rms) == pytest.approx(rms, rel=1e-6)

    def shaking(at):
        values = {"speed": at[0], "clearance": 5e-5, "foundation.x": at[1]}
        return jc.periodic_orbit(jc.build_scene(values), nodes=96).shaking_moment_rms

    # Central differences over 1e-3 m are 2e-6 off, a hundredth of those over 1e-2 m.
    assert_slopes(shaking, [30.0, 0.5], 1e-3, rtol=1e-5)

"""The ideal slider-crank, by inverse dynamics as a textbook does them."""

import equinox as eqx
import jax
import numpy as np
import pytest

from jaxcrusher.mechanism.drives import UnevenSpeed
from jaxcrusher.mechanism.linkage import Point
from jaxcrusher.mechanism.multiplier import CONTACT_TIME, MultiplierFormulation


def by_hand(angle, speed, spin_up):
    """Acceleration of the slider along its line, guide's force and moment, and the crank's torque.

    Places and forces are complex numbers in the axes of the slide. The slider gives the force along
    the line, moments of the rod about the crank pin that across it, and the rest is added up.
    """
    turned = (3 - 1j) / np.sqrt(10)  # from the frame's axes into those of the slide
    line, wrist, slider_centre = (
        turned * arm for arm in (0.02 - 0.01j, 0.01 - 0.015j, -0.01 + 0.02j)
    )
    pull, weight = turned * (-700 + 200j), -9.81j * turned
    crank = turned * np.exp(1j * angle)
    swing = spin_up * 1j - speed**2  # what a second derivative of a turning arm is times the arm
    pin = 0.05 * crank
    sine = ((line + wrist).imag - pin.imag) / 0.12
    rod = np.sqrt(1 - sine**2) + 1j * sine
    rod_spin = -(1j * speed * pin).imag / (0.12 * rod.real)
    rod_up = (0.12 * rod_spin**2 * rod.imag - (swing * pin).imag) / (0.12 * rod.real)
    rod_swing = rod_up * 1j - rod_spin**2
    second = (swing * pin + rod_swing * 0.12 * rod).real

    def moment(arm, force):
        return (arm.conjugate() * force).imag

    rod_centre = (0.06 - 0.01j) * rod
    rod_push = 0.21 * (swing * pin + rod_swing * rod_centre - weight)
    on_slider = 0.14 * (second - weight) - pull  # by rod and guide together
    along = on_slider.real
    about_pin = 2.5e-4 * rod_up + moment(rod_centre, rod_push)
    across = (0.12 * rod.imag * along - about_pin) / (0.12 * rod.real)
    by_rod = along + 1j * across
    guide = -(on_slider.imag - across)
    guide_moment = moment(wrist, by_rod) - moment(slider_centre, on_slider)
    crank_centre = (0.02 + 0.01j) * crank
    crank_push = 0.3 * (swing * crank_centre - weight)
    torque = 1e-4 * spin_up + moment(crank_centre, crank_push) + moment(pin, rod_push + by_rod)
    return second, guide, guide_moment, torque


@pytest.mark.parametrize("time", np.linspace(0.0, 0.012, 5))
def test_the_ideal_slider_crank_is_that_of_inverse_dynamics(machine, time):
    drive = UnevenSpeed(5000 * np.pi / 30, 0.2, 2.0, 0.5)
    scene = machine("slider-crank", (), drive)

    state = scene.formulation.initial(scene)
    s = scene.formulation.snapshot(jax.numpy.asarray(time), state, scene)
    crank, guide = s.motion.crank, s.accelerations.slides["guide"]
    second = s.accelerations.centres["slider"].dot(scene.linkage.slides.at("guide").direction)
    found = second, guide.force, guide.moment, s.accelerations.torque
    expected = by_hand(float(crank.angle), float(crank.speed), float(crank.acceleration))
    # Rounding of forces and moments of 2e4 m/s2 times masses and arms of which these are sums.
    for one, other, size in zip(found, expected, (2e4, 6e3, 300.0, 300.0), strict=True):
        assert float(one) == pytest.approx(other, rel=0, abs=1e-12 * size)


def test_multipliers_bring_a_slider_back_to_its_line(machine):
    """What is off, across the line and in angle, obeys off'' = -2 alpha off' - beta^2 off."""
    scene = eqx.tree_at(
        lambda s: s.formulation, machine("slider-crank"), MultiplierFormulation(30.0, 20.0)
    )

    state = eqx.tree_at(
        lambda s: (s.position["slider"].angle, s.velocity["slider"].angle),
        scene.formulation.initial(scene),
        (jax.numpy.asarray(2e-3), jax.numpy.asarray(0.3 * CONTACT_TIME)),
    )
    s = scene.formulation.snapshot(jax.numpy.zeros(()), state, scene)
    spin_up, centre = s.accelerations.spin_ups["slider"], s.accelerations.centres["slider"]
    # Rounding of the 1e5 rad/s2 that moments of 10 N m would give 1e-4 kg m2, and of the solve.
    assert float(spin_up) == pytest.approx(-60 * 0.3 - 400 * 2e-3, abs=1e-9)
    slide = scene.linkage.slides.at("guide")
    origin, normal = Point("slider"), slide.direction.perp()
    arm = s.motion.position(origin) - s.motion.centre("slider")
    second = centre + spin_up * arm.perp() - 0.3**2 * arm
    off = s.motion.position(origin) - s.motion.position(Point("frame", slide.through))
    expected = -60 * normal.dot(s.motion.velocity(origin)) - 400 * normal.dot(off)
    # The origin turns about a mass centre on its way: its velocity across is 6 mm/s.
    assert abs(float(expected)) > 0.05
    # The same at arms of 0.02 m.
    assert float(normal.dot(second)) == pytest.approx(float(expected), abs=2e-11)

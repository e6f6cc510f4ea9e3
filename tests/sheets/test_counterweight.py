"""The counterweight of the first order, against the closed form of a slider-crank."""

import dataclasses

import numpy as np
import pytest

import jaxcrusher as jc
from jaxcrusher.mechanism.drives import GivenTorque
from jaxcrusher.sheets.balance import balance_of, with_moment

# Of examples/slider_crank.toml: the crank's moment about O, half of the rod's mass at either end.
CRANK, ROD = 0.05, 0.12  # m
TURNING = 0.3 * 0.025 + 0.21 / 2 * CRANK  # kg m
TO_AND_FRO = 0.21 / 2 + 0.14  # kg
# Sums over 1024 instants have an error of rounding, some 1e-16 of the largest force.
ROUNDING = 1e-12


@pytest.fixture(scope="module")
def scene():
    return jc.read_machine("examples/slider_crank.toml").scene()


@pytest.fixture(scope="module")
def balance(scene):
    return balance_of(scene)


def test_half_of_what_moves_to_and_fro_cannot_be_balanced(balance):
    square = balance.speed**2
    assert balance.first.forward == pytest.approx(
        square * (TURNING + TO_AND_FRO * CRANK / 2), rel=ROUNDING
    )
    half = square * TO_AND_FRO * CRANK / 2
    assert balance.first.backward == pytest.approx(half, rel=ROUNDING)
    assert balance.first.largest == pytest.approx(
        square * (TURNING + TO_AND_FRO * CRANK), rel=ROUNDING
    )
    moments = {
        "in all directions": TURNING + TO_AND_FRO * CRANK / 2,
        "horizontally": TURNING + TO_AND_FRO * CRANK,
        "vertically": TURNING,
    }
    assert balance.moments == pytest.approx({n: -m for n, m in moments.items()}, rel=ROUNDING)


def test_the_second_order_is_that_of_the_slider(balance):
    """Its place is r cos(theta) + sqrt(l^2 - r^2 sin(theta)^2), and it alone has a second order."""
    angle = 2 * np.pi * np.arange(256) / 256
    place = np.sqrt(ROD**2 - CRANK**2 * np.sin(angle) ** 2)
    second = 2 / len(angle) * np.sum(place * np.cos(2 * angle))
    force = TO_AND_FRO * 4 * balance.speed**2 * second
    assert balance.second.sides == pytest.approx((force, 0.0), rel=ROUNDING, abs=ROUNDING * force)


@pytest.mark.parametrize(
    ("way", "sides"),
    [("in all directions", (1, 1)), ("horizontally", (0, 2)), ("vertically", (2, 0))],
)
def test_the_mass_on_the_crank_leaves_what_it_is_to_leave(scene, balance, way, sides):
    moment = balance.moments[way]
    after = balance_of(with_moment(scene, moment, 0.07))
    least = abs(balance.first.backward)
    # The mass centre is of sums and quotients, and adds some roundings of the force before.
    near = 1e-11 * balance.first.largest
    assert after.first.sides == pytest.approx([least * side for side in sides], abs=near)
    assert balance.with_moment(moment).sides == pytest.approx(after.first.sides, abs=near)
    assert after.second.largest == pytest.approx(balance.second.largest, abs=near)


def test_the_angle_is_ahead_of_the_crank_of_a_crusher():
    machine = jc.paper_machine()
    moment = balance_of(machine.scene()).moments["in all directions"]
    mass, angle = abs(moment) / 0.2, np.angle(moment)
    numbers = {"counterweight.mass": mass, "counterweight.angle": angle}
    after = balance_of(machine.scene(**numbers))
    # Rounding of a force of 5.5 kN.
    assert abs(after.first.forward) < 1e-8


def test_what_has_no_balance_is_refused(scene):
    free = dataclasses.replace(scene, drive=GivenTorque(0.0, 500.0))
    with pytest.raises(ValueError, match="`scene` must have a given speed"):
        balance_of(free)
    with pytest.raises(ValueError, match="`radius` must be finite and > 0 m"):
        with_moment(scene, 1 + 0j, 0.0)

"""Archard's wear of a joint: volumes, where they are taken, and what they do over hours."""

import numpy as np
import pytest

import jaxcrusher as jc
from jaxcrusher.sheets.wear import HOUR, Archard, wear_of, worn_clearance
from tests.differences import assert_slopes

BY = Archard(coefficient=1e-15, width=0.1)
SLIDING = {"speed": 30.0, "clearance": 6e-5, "slip": "surface"}


def orbit_at(clearance=6e-5, **numbers):
    return jc.periodic_orbit(jc.build_scene(SLIDING | {"clearance": clearance} | numbers), nodes=96)


def test_what_sectors_lose_is_the_volume_that_slides():
    """k F_n |v| in the mean of the orbit, whatever sectors it falls into."""
    orbit = orbit_at()
    radius = float(orbit.scene.joints["main"].bore_radius)
    for sectors in (8, 72):
        wear = wear_of(orbit, by=BY, sectors=sectors)
        volume = BY.coefficient * float(orbit.sliding_power)
        for depths in (wear.bore, wear.pin):
            found = float(depths.sum()) * 2 * np.pi / sectors * radius * BY.width
            # Sums over the same instants.
            assert found == pytest.approx(volume, rel=1e-9)
    assert float(wear.growth) == pytest.approx(
        BY.growth(float(orbit.sliding_power), radius), rel=1e-9
    )


def test_a_load_that_stands_in_the_bore_wears_one_side_of_it_and_all_of_the_pin():
    """A's load hardly turns in the jaw, which hardly turns; the shaft turns past it."""
    wear = wear_of(orbit_at(load=2e5, **{"jaw.mass": 200.0}), by=BY)
    even, loaded = (float(one.max() / one.mean()) for one in (wear.pin, wear.bore))
    # The contact is some 30 degrees wide, and the load swings by some ten.
    assert even < 2.0 < 4.0 < loaded
    assert float(np.min(wear.bore)) == pytest.approx(0.0, abs=1e-12 * float(wear.bore.max()))


@pytest.mark.slow
def test_wear_has_the_slopes_of_its_orbit():
    def growth(clearance):
        return 1e12 * wear_of(orbit_at(clearance), by=BY).growth

    # Central differences of an orbit whose error is 1e-13.
    assert_slopes(growth, 6e-5, 1e-8, rtol=1e-5)


@pytest.mark.slow
def test_a_clearance_grows_over_hours():
    """Twice the steps change it by less than a hundredth of what it grows by."""
    make = lambda clearance: jc.build_scene(SLIDING | {"clearance": clearance})  # noqa: E731
    hours = 0.5 * 6e-5 / (HOUR * float(wear_of(orbit_at(), by=BY).growth))
    few, many = (worn_clearance(make, 6e-5, hours, by=BY, steps=n) for n in (1, 2))
    assert 8e-5 < float(few[-1]) < 1.0e-4
    assert float(few[-1]) == pytest.approx(float(many[-1]), abs=0.01 * 3e-5)


@pytest.mark.parametrize(
    ("numbers", "how", "words"),
    [
        ({"friction": 0.0}, {}, "`joint` must be one with friction of sliding surfaces"),
        ({}, {"by": Archard(0.0, 0.1)}, r"`coefficient` must be finite and > 0 m2/N"),
        ({}, {"sectors": 2}, "`sectors` must be a whole number"),
    ],
)
def test_refusals(numbers, how, words):
    with pytest.raises(ValueError, match=words):
        wear_of(orbit_at(**numbers), **{"by": BY, **how})

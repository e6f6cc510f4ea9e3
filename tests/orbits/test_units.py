"""In other units an orbit is the same: a law of its slopes by all numbers of a machine together."""

import re

import jax
import jax.numpy as jnp
import numpy as np
import pint
import pytest

import jaxcrusher as jc
from jaxcrusher.scenes.parameters import NUMBERS, complete, numbers_of
from tests.pairs import slow

UNITS = pint.UnitRegistry()
RESULTS = {"foundation_rms": "N", "shaking_rms": "N", "drive_power": "W"}
OF_SUPPORTS = {"transmitted_rms": "N", "frame_velocity_rms": "m/s"}
BLOCK = {"foundation.mass": 6e3, "foundation.x": 0.3, "foundation.y": 0.2}
SPRINGS = {
    f"foundation.{side}_{part}": value
    for side in ("horizontal", "vertical")
    for part, value in (("stiffness", 4e7), ("damping", 6e4))
}
MACHINES = {
    "quiet": {},
    "surface": {"slip": "surface", "friction": 0.03},
    "block": {**BLOCK, **SPRINGS, "load_law": "normal_to_jaw", "counterweight.mass": 10.0},
    "rod": {
        "elbow.clearance": 5e-5,
        "pivot.clearance": 4e-5,
        "rod.stiffness": 2e5,
        "rod.preload": 2e4,
        "load_law": "normal_to_jaw",
    },
}


def exponents(unit):
    """Return those of mass, length and time."""
    powers = re.sub(r"(?<=[a-z])(-?\d)", r"**\1", unit)
    found = UNITS.Unit("" if unit == "1" else powers).dimensionality
    return np.array([float(found.get(f"[{one}]", 0)) for one in ("mass", "length", "time")])


@pytest.mark.parametrize("machine", ["quiet", *slow("surface", "block", "rod")])
def test_slopes_by_all_numbers_add_up(machine):
    """Numbers p of exponents a make a result S of exponent b: sum a p dS/dp = b S (Euler).

    Backwards through the orbit, and with the exponents of mass, length and time. A slope that is
    wrong for any number that has a unit, or a unit that is wrong in the table, breaks it.
    """
    described = complete(MACHINES[machine])
    names = numbers_of(described)
    units = RESULTS | (OF_SUPPORTS if machine == "block" else {})

    def results(stretched):
        """Those of the same machine, in units that are exp(-stretched) times as large."""
        numbers = {
            name: described[name] * jnp.exp(exponents(NUMBERS[name].unit) @ stretched)
            for name in names
        }
        orbit = jc.periodic_orbit(jc.build_scene(described | numbers), nodes=96)
        return jnp.log(jnp.stack([orbit[name] for name in units]))

    slopes = jax.jit(jax.jacrev(results))(jnp.zeros(3))
    expected = [exponents(unit) for unit in units.values()]
    # Rounding leaves 1e-12. The contact's smoothing, a length that no number tells, takes 3e-10 of
    # the power that friction needs.
    np.testing.assert_allclose(slopes, expected, rtol=0, atol=1e-9)

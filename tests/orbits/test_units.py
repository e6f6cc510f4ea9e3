"""In other units an orbit is the same: a law of its slopes by all numbers of a machine together."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxcrusher as jc
from jaxcrusher.scenes.parameters import NUMBERS, complete, numbers_of
from jaxcrusher.scenes.units import parse_unit
from tests.pairs import slow

RESULTS = {"foundation_rms": "N", "shaking_rms": "N", "drive_power": "W"}
OF_SUPPORTS = {"transmitted_rms": "N", "frame_velocity_rms": "m/s"}
MACHINES = {
    "quiet": {},
    "surface": {"slip": "surface", "friction": 0.03},
    "block": {
        "foundation.mass": 6000.0,
        "foundation.x": 0.3,
        "foundation.y": 0.2,
        **{f"foundation.{way}_stiffness": 4e7 for way in ("horizontal", "vertical")},
        **{f"foundation.{way}_damping": 6e4 for way in ("horizontal", "vertical")},
        "load_law": "normal_to_jaw",
        "counterweight.mass": 10.0,
    },
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
    found = parse_unit(unit).dimensionality
    return np.array([float(found.get(f"[{one}]", 0)) for one in ("mass", "length", "time")])


@pytest.mark.parametrize("machine", ["quiet", *slow("surface", "block", "rod")])
def test_slopes_by_all_numbers_add_up(machine):
    """Numbers p of exponents a make a result S of exponent b: sum a p dS/dp = b S (Euler).

    Ahead and backwards through the orbit, for mass, length and time. A slope that is wrong for any
    number that has a unit, or a unit that is wrong in the table, breaks it.
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

    # One program gives slopes both ways: it compiles for longer than it computes.
    @jax.jit
    def both_ways(at):
        _, along = jax.linearize(results, at)
        back = jax.linear_transpose(along, at)
        ahead = jax.vmap(along, out_axes=1)(jnp.eye(3))
        return ahead, jax.vmap(lambda row: back(row)[0])(jnp.eye(len(units)))

    expected = [exponents(unit) for unit in units.values()]
    # Rounding leaves 1e-12. The contact's smoothing, a length that no number tells, takes 3e-10 of
    # the power that friction needs.
    for slopes in both_ways(jnp.zeros(3)):
        np.testing.assert_allclose(slopes, expected, rtol=0, atol=1e-9)

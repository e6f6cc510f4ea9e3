"""Soil under a block beside another program, and its limits."""

import jax
import numpy as np
import pytest

import jaxcrusher as jc
from jaxcrusher.mechanism.supports import soil_under

SAND = 6e7, 1800.0, 0.35


@pytest.mark.parametrize(
    ("sides", "expected"),
    [
        # geofound 1.1.4, Pais and Kausel, G 60 MPa, 1800 kg/m3, nu 0.35, at 30 rad/s: kx, cx, krot,
        # cz. What it multiplies twice by the factor of embedment is divided by it.
        ((4, 2, 0), (475285226.6, 2629068.276, 1808079596.5, 5472842.04)),
        ((2, 4, 0), (504376135.7, 2629068.276, 660387793.3, 5472842.04)),
        ((4, 2, 1), (844423419.25, 7994557.572, None, 9416444.4545)),
        ((2, 4, 1), (896108267.7, 9416444.4545, None, 9416444.4545)),
    ],
)
def test_another_program_s_numbers(sides, expected):
    length, width, embedment = sides
    found = soil_under(*SAND, length, width, embedment, 30.0)
    names = "horizontal_stiffness", "horizontal_damping", "rocking_stiffness", "vertical_damping"
    for name, value in zip(names, expected, strict=True):
        if value is not None:
            assert float(getattr(found, name)) == pytest.approx(value, rel=1e-9), name


def test_embedment_of_rocking():
    """7957.383 MN m/rad of geofound have the factor 1 + 1 + 1.6 / 16.35 twice, about the base."""
    found = soil_under(*SAND, 4, 2, 1, 30.0)
    at_base = float(found.rocking_stiffness + found.horizontal_stiffness * found.lever**2)
    assert at_base == pytest.approx(7957383177.4 / (2 + 1.6 / 16.35), rel=1e-9)


def test_static_stiffness_of_a_square_is_known():
    """Gazetas (1991) has 4.54 G B / (1 - nu) and 9 G B / (2 - nu), from memory."""
    slow = soil_under(*SAND, 2, 2, 0, 1e-3)
    assert float(slow.vertical_stiffness) == pytest.approx(4.54 * 6e7 / 0.65, rel=0.04)
    assert float(slow.horizontal_stiffness) == pytest.approx(9 * 6e7 / 1.65, rel=0.04)
    # Fast waves leave with rho V of the base; and soil never pushes a block.
    fast = soil_under(*SAND, 2, 2, 0, 30.0)
    assert float(fast.horizontal_damping) == pytest.approx(1800 * np.sqrt(6e7 / 1800) * 4)
    assert 0 < float(fast.rocking_damping) < float(fast.vertical_damping)


def test_refusals():
    soil = {"foundation.soil.shear_modulus": 6e7}
    with pytest.raises(ValueError, match=r"come with `foundation\.mass`"):
        jc.build_scene(soil)
    speed = {"foundation.soil.shear_wave_speed": 180.0}
    with pytest.raises(ValueError, match="not stand beside its modulus"):
        jc.build_scene(soil | speed | {"foundation.mass": 6e3})
    with pytest.raises(ValueError, match=r"come with `foundation\.soil\.shear_modulus`"):
        jc.build_scene({"foundation.soil.length": 2.0, "foundation.mass": 6e3})
    block = {"foundation.mass": 6e3, **soil}
    for given in ("vertical_stiffness", "horizontal_damping", "rocking_stiffness"):
        with pytest.raises(ValueError, match=f"`foundation.{given}` must not stand beside `found"):
            jc.build_scene({**block, f"foundation.{given}": 1e8})


@pytest.mark.parametrize("name", ["length", "width"])
@pytest.mark.parametrize("jacobian", [jax.jacfwd, jax.jacrev])
@pytest.mark.parametrize("embedment", [0.0, 0.3])
def test_slopes_by_the_sides_of_a_square_base(name, jacobian, embedment):
    """They are those of one side of a kink, and differences where there is none."""
    soil = {"shear_modulus": 6e7, "density": 1800.0, "poisson": 0.35, "length": 2.0, "width": 2.0}

    def under(side):
        return soil_under(**(soil | {name: side}), embedment=embedment, speed=30.0)

    step, slopes = 1e-6, jacobian(under)(2.0)
    for found, below, at, above in zip(
        slopes, *(under(2.0 + shift) for shift in (-step, 0.0, step)), strict=True
    ):
        left, right = sorted([float(at - below) / step, float(above - at) / step])
        slack = 1e-5 * abs(right)
        assert left - slack <= float(found) <= right + slack

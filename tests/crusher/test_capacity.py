"""Laminating crushing theory against the paper's figures."""

import jax
import jax.numpy as jnp
import pytest

from jaxcrusher.crusher.capacity import AFFLUENCE, CrushingChamber, lower_end, stroke
from jaxcrusher.scenes.build import build_chamber, build_linkage
from tests.differences import assert_slopes


def test_paper_capacity():
    chamber = CrushingChamber()
    # 2b - s = 60.6 mm has three digits, and so has the paper's 9.41.
    assert float(chamber.capacity(25.0)) == pytest.approx(9.41, rel=1e-3)
    assert float(chamber.layer_height(25.0)) == pytest.approx(0.0775, abs=5e-5)
    # h < H gives 8.98 rad/s, printed with three digits.
    assert float(chamber.lowest_speed()) == pytest.approx(8.98, abs=5e-3)
    assert float(chamber.layer_height(chamber.lowest_speed())) == pytest.approx(0.6, rel=1e-12)


def test_floor_and_speed_limit():
    chamber = CrushingChamber()
    floor = 9.41 / AFFLUENCE
    assert floor == pytest.approx(5.63, abs=0.01)
    # 41.8 rad/s by the equations; the paper prints 41.45.
    assert float(chamber.highest_speed(floor)) == pytest.approx(41.8, abs=0.06)
    # Q ~ 1 / omega, exactly.
    assert float(chamber.capacity(50.0)) == pytest.approx(
        float(chamber.capacity(25.0)) / 2, rel=1e-14
    )


def test_stroke_of_the_mechanism():
    machine = build_linkage({})
    found = float(jax.jit(stroke)(machine))
    # 7.45 mm, an independent figure of three digits.
    assert found == pytest.approx(7.45e-3, abs=5e-6)
    # The largest of 720 points is at most half a spacing off: (pi / 720)^2 / 2 = 1e-5 short.
    angles = jnp.linspace(0, 2 * jnp.pi, 720, endpoint=False)
    sampled = jnp.ptp(jax.jit(jax.vmap(lower_end, (0, None)))(angles, machine))
    assert 0 <= found / float(sampled) - 1 < 1e-5


def test_chamber_of_a_description():
    """The paper's to the last bit; b and s of another as in (22)."""
    paper = build_chamber({"speed": 40.0, "jaw.mass": 1.0})
    assert float(paper.capacity(25.0)) == float(CrushingChamber().capacity(25.0))
    longer = {"shaft.eccentricity": 0.012, "chamber.discharge": 0.05, "chamber.width": 0.6}
    longer |= {"chamber.loosening": 0.5, "chamber.height": 0.7, "gravity": 9.0}
    chamber = build_chamber(longer)
    # The paper's b is given to 0.1 um.
    width = 2 * 0.05 - float(jax.jit(stroke)(build_linkage(longer)))
    assert float(chamber.double_width) == pytest.approx(width, abs=1e-7)
    by_hand = width / 2 * 9.0 * (jnp.pi / 20) ** 2 / 2 * 0.6 * 0.5 * 60 * 20 * 30 / jnp.pi
    assert float(chamber.capacity(20.0)) == pytest.approx(float(by_hand), rel=1e-5)
    assert float(chamber.height) == 0.7
    with pytest.raises(
        ValueError, match=r"^Argument `chamber.discharge` must be wider than the ja"
    ):
        build_chamber({"chamber.discharge": 0.007})
    with pytest.raises(ValueError, match=r"^Argument `chamber.width` must be finite and > 0 m"):
        build_chamber({"chamber.width": -1.0})


def test_a_traced_chamber_beyond_its_limits_has_neither_capacity_nor_slope():
    for name, value in (("discharge", 0.007), ("width", -1.0), ("loosening", 2.0)):
        of = jax.value_and_grad(
            lambda x, name=name: build_chamber({f"chamber.{name}": x}).capacity(30)
        )
        assert jnp.isnan(jnp.stack(jax.jit(of)(value))).all(), name


def test_second_derivatives_of_the_stroke():
    """The angles of its ends move with the links."""

    def travel(share):
        return stroke(build_linkage({"toggle.length": 0.3 * share}))

    # Differences are off by the square of the step; with the angles held 23 % are missing.
    assert_slopes(jax.jit(jax.grad(travel)), 1.0, 1e-3, rtol=1e-5, by=jax.jacfwd)

"""Laminating crushing theory against the paper's figures."""

import pytest

import jaxcrusher as jc
from jaxcrusher.crusher.capacity import AFFLUENCE, stroke
from jaxcrusher.scenes.build import build_machine


def test_paper_capacity():
    chamber = jc.CrushingChamber()
    # 2b - s = 60.6 mm has three digits, and so has the paper's 9.41.
    assert float(chamber.capacity(25.0)) == pytest.approx(9.41, rel=1e-3)
    assert float(chamber.layer_height(25.0)) == pytest.approx(0.0775, abs=5e-5)
    # h < H gives 8.98 rad/s, printed with three digits.
    assert float(chamber.lowest_speed()) == pytest.approx(8.98, abs=5e-3)
    assert float(chamber.layer_height(chamber.lowest_speed())) == pytest.approx(0.6, rel=1e-12)


def test_floor_and_speed_limit():
    chamber = jc.CrushingChamber()
    floor = 9.41 / AFFLUENCE
    assert floor == pytest.approx(5.63, abs=0.01)
    # 41.8 rad/s by the equations; the paper prints 41.45.
    assert float(chamber.highest_speed(floor)) == pytest.approx(41.8, abs=0.06)
    # Q ~ 1 / omega, exactly.
    assert float(chamber.capacity(50.0)) == pytest.approx(
        float(chamber.capacity(25.0)) / 2, rel=1e-14
    )


def test_stroke_of_the_mechanism():
    # 7.45 mm, an independent figure of three digits.
    assert float(stroke(build_machine({}))) == pytest.approx(7.45e-3, abs=5e-6)
    chamber = jc.chamber_from_stroke(build_machine({}), 0.034)
    assert float(chamber.double_width) == pytest.approx(0.068 - 7.45e-3, abs=5e-6)

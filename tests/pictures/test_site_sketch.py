"""Names and dimensions of the sketch of a machine on its foundation."""

import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.text import Text

import jaxcrusher as jc
from jaxcrusher.pictures.site_sketch import draw_site
from jaxcrusher.scenes.reader import read_scene


def texts_of(scene, points=()):
    fig = draw_site(scene, dict(points))
    try:
        fig.draw_without_rendering()
        return {one.get_text() for one in fig.findobj(Text) if one.get_text()}
    finally:
        plt.close(fig)


@pytest.mark.parametrize("corner", [(), (("corner", (1.2, -0.45)),)])
def test_dimensions_are_from_the_pivot_in_mm(corner):
    scene = jc.build_scene({"joint": "ideal", "foundation.mass": 6e3, "foundation.x": 0.3})
    texts = texts_of(scene, corner)
    # O by hand: 640 mm from C, 22.5 degrees off the vertical. G is level with C.
    x, y = 640 * np.sin(np.pi / 8), 640 * np.cos(np.pi / 8)
    expected = {"left -700", "right 900", "base -600", "G 300", f"O {x:.5g}", f"O {y:.5g}"}
    expected |= {"+x", "+y", "+M", "C", "O", "G"}
    expected |= {"corner", "corner 1200", "corner -450"} if corner else set()
    assert texts == expected | {"block (outline not given)"}


def test_a_clamped_linkage_has_its_bearings():
    texts = texts_of(read_scene("examples/double_toggle.toml"))
    assert {"O", "B -480", "B -800", "D 550", "D 250", "+x"} <= texts
    assert not any("block" in text or "G" in text for text in texts)

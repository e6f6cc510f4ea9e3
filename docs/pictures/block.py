"""The machine on its block: supports, axes, and what the foundation's page counts by them."""

from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Arc, Polygon, Rectangle
from matplotlib.quiver import Quiver, QuiverKey
from matplotlib.text import Annotation

import jaxcrusher as jc
from jaxcrusher.crusher.outline import FORCES
from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.mechanism.supports import OnSupports
from jaxcrusher.pictures.mechanism import DRAWN, plot_mechanism
from jaxcrusher.pictures.plots import BLUE, GREEN, ORANGE, WIDTH

# Of a spring or a damper in m: its height, and how far each stands from the support's middle.
HEIGHT, ASIDE = 0.3, 0.11
THICK = 0.38  # of the block, m; the model knows its mass and its base only
CONCRETE: dict[str, Any] = {"facecolor": "0.9", "edgecolor": "k"}
LABEL: dict[str, Any] = {"fontsize": 10, "ha": "center", "va": "center"}


def plot_block(scene: Scene) -> Figure:
    """Draw a crusher on supports, to scale, with its axes, supports and displacements."""
    fig, ax = plt.subplots(figsize=(WIDTH, 5.9), layout="constrained")
    plot_mechanism(scene, jc.simulate(scene, [0.0, 0.13], outputs=DRAWN), 1, ax).set_title("")
    # Forces have a picture of their own.
    symbols = [symbol for symbol, *_ in FORCES.values()]
    for artist in ax.get_children():
        is_symbol = isinstance(artist, Annotation) and artist.get_text() in symbols
        if is_symbol or isinstance(artist, Quiver | QuiverKey):
            artist.remove()
    foundation = scene.foundation
    assert isinstance(foundation, OnSupports)
    left, right, base = (float(foundation.left), float(foundation.right), float(foundation.base))
    ax.add_patch(Rectangle((left - 0.2, base), right - left + 0.4, THICK, zorder=-1, **CONCRETE))
    frame = [(-0.2, base + THICK), (-0.15, 0.05), (0.02, 0.68), (0.9, 0.78), (0.95, base + THICK)]
    ax.add_patch(Polygon(frame, facecolor="0.97", edgecolor="0.6", zorder=-2))
    for name, x in (("left", left), ("right", right)):
        _support(ax, x, base)
        ax.annotate(name, (x, base - HEIGHT - 0.12), **LABEL)
    ground = base - HEIGHT
    ax.plot([left - 0.35, right + 0.35], [ground, ground], color="k", linewidth=1.5)
    for x in np.arange(left - 0.35, right + 0.35, 0.06):
        ax.plot([x, x - 0.04], [ground, ground - 0.05], color="k", linewidth=0.6)
    g = np.array([float(foundation.point.x), float(foundation.point.y)])
    ax.plot(*g, "P", color=ORANGE, markersize=9, markeredgecolor="w", zorder=7)
    ax.annotate("G", g + np.array((-0.05, -0.05)), **LABEL, color=ORANGE, zorder=7)
    for way, name, beside in (
        ((0.3, 0), "$u_x$", (-0.02, 0.06)),
        ((0, 0.3), "$u_y$", (-0.07, -0.02)),
    ):
        _arrow(ax, g, g + way, ORANGE)
        ax.annotate(name, g + way + np.array(beside), **LABEL, color=ORANGE, zorder=7)
    ax.add_patch(Arc(g, 0.34, 0.34, theta1=25, theta2=75, color=ORANGE, linewidth=1.5, zorder=7))
    turned = g + 0.17 * np.array([np.cos(np.radians(75)), np.sin(np.radians(75))])
    _arrow(ax, turned, turned + np.array((-0.03, 0.008)), ORANGE)
    ax.annotate(r"$\varphi$", g + np.array((0.17, 0.18)), **LABEL, color=ORANGE, zorder=7)
    # The axes of the page: their origin is the pivot C.
    for way, name in (((0.28, 0), "x"), ((0, 0.28), "y")):
        _arrow(ax, np.zeros(2), np.array(way), "k")
        ax.annotate(name, 1.14 * np.array(way), **LABEL, zorder=7)
    x = right + 0.3
    ax.annotate("", (x, base), (x, 0), arrowprops={"arrowstyle": "<->", "color": "0.3"})
    ax.annotate("base", (x + 0.1, base / 2), **LABEL, color="0.3")
    ax.plot([0.02, x], [0, 0], ":", color="0.5", linewidth=0.8, zorder=0)
    ax.set(xlim=(left - 0.4, right + 0.5), ylim=(ground - 0.2, 0.85))
    ax.set_axis_off()
    return fig


def _support(ax: Axes, x: float, base: float) -> None:
    """A spring and a damper below the block, and such a pair beside it."""
    ground, style = base - HEIGHT, {"linewidth": 1.2, "solid_capstyle": "butt"}
    at, zigzag = x - ASIDE, np.array([0, 0, 1, -1, 1, -1, 0, 0])
    share = np.array([0, 0.2, 0.28, 0.44, 0.6, 0.76, 0.84, 1])
    ax.plot(at + 0.05 * zigzag, base - HEIGHT * share, color=GREEN, **style)
    at = x + ASIDE
    ax.plot([at, at], [base, base - 0.5 * HEIGHT], color=BLUE, **style)
    ax.plot([at - 0.035, at + 0.035], [base - 0.5 * HEIGHT] * 2, color=BLUE, **style)
    cup = np.array([(-0.05, 0.35), (-0.05, 0.65), (0.05, 0.65), (0.05, 0.35)])
    ax.plot(at + cup[:, 0], base - HEIGHT * cup[:, 1], color=BLUE, **style)
    ax.plot([at, at], [base - 0.65 * HEIGHT, ground], color=BLUE, **style)
    ax.plot(x, base, "v", color="k", markersize=6, zorder=5)


def _arrow(ax: Axes, begin: np.ndarray, end: np.ndarray, colour: str) -> None:
    how = {"arrowstyle": "-|>", "color": colour, "linewidth": 1.5, "shrinkA": 0, "shrinkB": 0}
    ax.annotate("", end, begin, arrowprops=how, zorder=7)

"""A dimensioned sketch of a machine on its foundation, with the axes of a load sheet."""

from collections.abc import Iterable, Mapping
from typing import Any

import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch, Polygon, Rectangle

from jaxcrusher.basics.plane import Arm
from jaxcrusher.crusher.outline import BLUE, GREEN, ORANGE
from jaxcrusher.mechanism.linkage import Point
from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.mechanism.supports import OnSupports
from jaxcrusher.pictures.mechanism import (
    HATCHED,
    fixed_jaw,
    foot,
    joints_in_frame,
    joints_outline,
    places_of,
)

# Angles of the crank by which is found how far the bodies reach.
ANGLES = 24
# Of the picture, inches: letters have their size on a page of A4.
WIDTH, HEIGHTS = 6.3, (2.5, 3.9)
# Of the drawing's span: between dimension lines, the height of a support, what a block stands out
# beside its supports, and the axes' arrows.
LINE, FOOT, SIDE, AXIS = 0.085, 0.06, 0.08, 0.16
_THIN: dict[str, Any] = {"color": "0.45", "linewidth": 0.6}
_NAME: dict[str, Any] = {"textcoords": "offset points", "fontweight": "bold", "fontsize": 10}


def draw_site(scene: Scene, points: Mapping[str, tuple[float, float]] = {}) -> Figure:
    """Return a sketch of the machine on its foundation with dimensions in mm.

    The machine is to scale, the crank at +x. Of a block only the supports and the mass centre G are
    known; its outline is drawn for the eye. Dimensions are from the origin of the scene's axes (the
    pivot C of a crusher) to the shaft, to G or to the reference point of moments, to the supports
    and to the named points (m).
    """
    fig, ax = plt.subplots(layout="constrained")
    reach = _draw_machine(scene, ax)
    supports, marked = scene.supports, {}
    for name, at in joints_in_frame(scene.linkage):
        marked[scene.template.joint(name).title] = float(at[0]), float(at[1])
    if scene.foundation is not None:
        at = scene.foundation.point
        middle = "G" if supports is not None else "foundation's point"
        marked[middle] = float(at.x), float(at.y)
    marked |= points
    corners = np.array([*reach, *marked.values(), (0.0, 0.0)])
    if supports is not None:
        base = float(supports.base)
        corners = np.array([*corners, (float(supports.left), base), (float(supports.right), base)])
    low, high = corners.min(axis=0), corners.max(axis=0)
    span = float(max(high - low))
    if supports is not None:
        low, high = _draw_block(supports, ax, reach, low, high, span)
    _draw_points(scene, ax, marked)
    levels = {name: y for name, (_, y) in marked.items()}
    places = {name: x for name, (x, _) in marked.items()}
    if supports is not None:
        places |= {"left": float(supports.left), "right": float(supports.right)}
        levels["base"] = float(supports.base)
    under, beside = low[1] - 0.6 * LINE * span, high[0] + LINE * span
    rows = _dimensions(ax, places.items(), under, -LINE * span, upright=False)
    columns = _dimensions(ax, levels.items(), beside, LINE * span, upright=True)
    _draw_axes(ax, np.array([low[0] - 1.6 * AXIS * span, high[1] - AXIS * span]), AXIS * span)
    x = low[0] - 1.8 * AXIS * span, beside + (columns + 0.3) * LINE * span
    y = under - (rows + 0.3) * LINE * span, high[1] + 0.06 * span
    ax.set(xlim=x, ylim=y, aspect="equal")
    fig.set_size_inches(WIDTH, float(np.clip(WIDTH * np.ptp(y) / np.ptp(x), *HEIGHTS)))
    ax.axis("off")
    return fig


def _draw_machine(scene: Scene, ax: Axes) -> np.ndarray:
    """Draw the bodies with the crank at +x, and return all corners that they have in a turn, m."""
    linkage, outline = scene.linkage, scene.template.outline
    angles = jnp.linspace(0.0, 2 * np.pi, ANGLES, endpoint=False)
    look = joints_outline(scene, angles) if outline is None else outline(scene)
    reach, ways = [], []
    for body, corners, style in look.shapes:
        way = places_of(linkage, [Point(body, Arm(*corner)) for corner in corners], angles)
        ax.add_patch(Polygon(way[0], **style))
        reach += way.reshape(-1, 2).tolist()
        ways.append(way)
    if look.fixed_jaw is not None:
        block = fixed_jaw(ways[1], *look.fixed_jaw)
        ax.add_patch(Polygon(block, **HATCHED))
        reach += block.tolist()
    for _, at in joints_in_frame(scene.linkage):
        corners = foot(at, look)
        ax.add_patch(Polygon(corners, zorder=3, **HATCHED))
        reach += corners.tolist()
    return np.array(reach)


def _draw_block(
    supports: OnSupports,
    ax: Axes,
    reach: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
    span: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Draw block and supports, and return the corners of what is drawn by then, m."""
    left, right, base = float(supports.left), float(supports.right), float(supports.base)
    begin, end = min(left, low[0]) - SIDE * span, max(right, high[0]) + SIDE * span
    # It ends below the machine, if there is room, and else is a plate.
    top = max(float(reach[:, 1].min()), base + 0.1 * span)
    block = {"facecolor": "0.95", "edgecolor": "0.3", "linestyle": "--", "zorder": 0}
    ax.add_patch(Rectangle((begin, base), end - begin, top - base, **block))
    words = {"ha": "left", "va": "center", "fontsize": 9, "color": "0.3"}
    ax.text(begin + 0.02 * span, (base + top) / 2, "block (outline not given)", **words)
    height = FOOT * span
    for at in (left, right):
        turns = np.array([0, 0, 1, -1, 1, -1, 0, 0]) * 0.25 * height
        down = base - height * np.array([0, 0.15, 0.25, 0.4, 0.6, 0.75, 0.85, 1])
        ax.plot(at + turns, down, color="k", linewidth=1.2)
        ground = [(at - height, base - height), (at + height, base - height)]
        ground += [(at + height, base - 1.3 * height), (at - height, base - 1.3 * height)]
        ax.add_patch(Polygon(ground, facecolor="none", edgecolor="none", hatch="////"))
        ax.plot([at - height, at + height], [base - height] * 2, color="k", linewidth=1.2)
    low = np.minimum(low, [begin, base - 1.3 * height])
    return low, np.maximum(high, [end, top])


def _draw_points(scene: Scene, ax: Axes, marked: Mapping[str, tuple[float, float]]) -> None:
    """Draw the origin and the points that dimensions go to, with their names."""
    named = dict(marked)
    if not any(at == (0.0, 0.0) for at in marked.values()):
        named = {"origin": (0.0, 0.0), **marked}
    fixed = [scene.template.joint(name).title for name, _ in joints_in_frame(scene.linkage)]
    for at in dict.fromkeys(named.values()):
        here = [name for name, place in named.items() if place == at]
        name = ", ".join(here)
        mark, colour = (
            ("P", ORANGE) if here == ["G"] else ("o", BLUE if here[0] in fixed else GREEN)
        )
        how = {"color": colour, "markeredgecolor": "w", "markersize": 7, "zorder": 7}
        ax.plot(*at, mark, **how)
        ax.annotate(name, at, (5, 5), color=colour, zorder=8, **_NAME)


def _dimensions(
    ax: Axes, places: Iterable[tuple[str, float]], first: float, step: float, *, upright: bool
) -> int:
    """Draw dimensions from the origin, a line for each, the shortest first; return how many."""

    def at(along: float, across: float) -> tuple[float, float]:
        return (across, along) if upright else (along, across)

    shown = sorted(((n, v) for n, v in places if abs(v) > 5e-4), key=lambda one: abs(one[1]))
    for i, (name, value) in enumerate(shown):
        line = first + i * step
        for end in (0.0, value):
            ax.plot(
                *np.transpose([at(end, first - 0.3 * step), at(end, line + 0.15 * step)]), **_THIN
            )
        arrow = {"arrowstyle": "<|-|>", "mutation_scale": 7, "shrinkA": 0, "shrinkB": 0}
        ax.add_patch(FancyArrowPatch(at(0.0, line), at(value, line), color="k", lw=0.7, **arrow))
        turn = {"rotation": 90 if upright else 0, "ha": "center", "va": "center", "fontsize": 9}
        box = {"facecolor": "w", "edgecolor": "none", "pad": 0.8}
        middle, words = value / 2, f"{name} {1e3 * value:.5g}"
        if abs(value) < (0.55 * len(words) + 2) * abs(step) / 3:  # no room between the ends
            middle = value + np.copysign((0.55 * len(words) + 1) * abs(step) / 4.5, value)
        ax.text(*at(middle, line), words, bbox=box, zorder=9, **turn)
    return len(shown)


def _draw_axes(ax: Axes, corner: np.ndarray, size: float) -> None:
    """Draw the axes and the sense of moments at a corner of the drawing."""
    for name, way in {"+x": (1, 0), "+y": (0, 1)}.items():
        end = corner + size * np.array(way)
        arrow = {"arrowstyle": "-|>", "mutation_scale": 10, "shrinkA": 0, "shrinkB": 0}
        ax.add_patch(FancyArrowPatch(tuple(corner), tuple(end), color="k", lw=1.2, **arrow))
        ax.annotate(name, tuple(end), (3, 3), **_NAME)
    turned = np.linspace(np.radians(10), np.radians(75), 20)
    arc = corner + 0.55 * size * np.stack([np.cos(turned), np.sin(turned)], axis=-1)
    ax.plot(*arc.T, color="k", linewidth=1)
    ax.annotate(
        "", tuple(arc[-1]), tuple(arc[-3]), arrowprops={"arrowstyle": "-|>", "color": "k", "lw": 1}
    )
    ax.annotate("+M", tuple(arc[10]), (3, 3), **_NAME)

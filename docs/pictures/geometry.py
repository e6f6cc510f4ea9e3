"""The letters of the model's equations, on the machine and on its joint."""

from typing import Any

import equinox as eqx
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Arc, Circle

from jaxcrusher.crusher.machine import lengths_of
from jaxcrusher.mechanism.linkage import Linkage
from jaxcrusher.mechanism.motion import ideal_at_rest
from jaxcrusher.pictures.plots import BLUE, GREEN, ORANGE, PURPLE

ANGLE = np.radians(50)  # of the shaft
# The eccentricity is drawn so many times larger; and of the joint, in radii of the bore: its
# clearance, the eccentricity, and e.
MAGNIFIED, CLEARANCE, THROW, LOOSE = 6, 0.25, 0.5, 0.36


def plot_geometry(linkage: Linkage) -> Figure:
    """Draw the linkage, its eccentricity magnified, with its letters, and the joint beside it.

    Points O, A, B, C and mass centres, lengths, and angles counted as in the equations; of the
    joint the centres of pin and bore, e, n, c and the penetration.
    """
    fig, (whole, joint) = plt.subplots(1, 2, figsize=(9.5, 5), layout="constrained")
    _linkage(linkage, whole)
    _joint(joint)
    for ax in (whole, joint):
        ax.set(aspect="equal")
        ax.set_axis_off()
    return fig


def _linkage(linkage: Linkage, ax: Axes) -> None:
    o = np.asarray(linkage.joints.at("shaft_bearing").bore.arm.vector().array())
    throw, size, _ = map(float, lengths_of(linkage).values())
    a = o + MAGNIFIED * throw * _unit(ANGLE)
    magnified = eqx.tree_at(
        lambda one: one.joints.at("main").pin.arm.x, linkage, replace_fn=lambda x: MAGNIFIED * x
    )
    motion = ideal_at_rest(magnified, ANGLE)
    elbow = magnified.joints.at("elbow").pin
    b, jaw = (np.asarray(one.array()) for one in (motion.position(elbow), motion.axis("jaw")))
    c, s2 = np.zeros(2), np.asarray(motion.centre("jaw").array())
    ends = {"$l_0$": (c, o), "$l_1$": (o, a), "$l_2$": (b, a), "$l_3$": (c, b), "$l_{21}$": (a, s2)}
    for letter, (start, end) in ends.items():
        thin = letter in ("$l_0$", "$l_{21}$")
        colour = PURPLE if thin else "k"
        style = {"linestyle": "--", "linewidth": 1.2} if thin else {"linewidth": 3}
        _line(ax, start, end, color=colour, zorder=1, **style)
        across = (end - start)[::-1] * np.array([1, -1]) / np.linalg.norm(end - start)
        side = -1 if letter in ("$l_0$", "$l_1$", "$l_{21}$") else 1
        share = 0.75 if letter in ("$l_0$", "$l_3$") else 0.5
        beside = side * 0.06 * size * across
        _text(ax, start + share * (end - start) + beside, letter, color=colour, ha="center")
    points = {
        "O": (o, -0.07, 0.0),
        "A": (a, -0.02, 0.04),
        "B": (b, 0.04, -0.05),
        "C": (c, -0.07, 0),
    }
    points |= {"$S_2$": (s2, 0.03, 0.0), "$S_3$": (b / 2, -0.02, -0.08)}
    for name, (point, x, y) in points.items():
        ax.plot(*point, "P" if "S" in name else "o", color="k", markerfacecolor="w", zorder=3)
        _text(ax, point + size * np.array([x, y]), name, fontsize=13, weight="bold")
    tilt = np.degrees(
        [np.arctan2(o[0], o[1]), np.arctan2(-jaw[0], jaw[1]), np.arctan2(-b[1], b[0])]
    )
    arcs = (
        ("$\\theta_0$", c, 0.45, 90 - tilt[0], 90.0, 0.0),
        ("$\\theta_1$", o, 0.2, 0.0, np.degrees(ANGLE), 0.0),
        ("$\\theta_2$", b, 0.65, 90.0, 90 + tilt[1], 3.0),
        ("$\\theta_3$", c, 0.3, -tilt[2], 0.0, 0.0),
    )
    for letter, at, radius, low, high, apart in arcs:
        r = radius * size
        ax.add_patch(Arc((at[0], at[1]), 2 * r, 2 * r, theta1=low, theta2=high, color=BLUE))
        first = 0.0 if letter in ("$\\theta_1$", "$\\theta_3$") else np.pi / 2
        _line(ax, at, at + 1.15 * r * _unit(first), color=BLUE, linewidth=0.8)
        middle = np.radians((low + high) / 2 + apart)
        _text(ax, at + 1.12 * r * _unit(middle), letter, color=BLUE, ha="center", va="center")
    for angle, letter in ((0.0, "x"), (np.pi / 2, "y")):
        origin = np.array([-0.3 * size, 0.1 * size])
        tip = origin + 0.2 * size * _unit(angle)
        _arrow(ax, origin, tip)
        _text(ax, tip, letter)
    ax.set(xlim=(-0.4 * size, o[0] + 0.35 * size), ylim=(b[1] - 0.12 * size, a[1] + 0.12 * size))
    ax.set_title(f"linkage, $l_1$ magnified {MAGNIFIED} times", fontsize=11)


def _joint(ax: Axes) -> None:
    """Not to scale: in a bearing the clearance is a thousandth of the bore."""
    bore, direction = np.zeros(2), np.radians(70)
    n = _unit(direction)
    pin, radius = LOOSE * n, 1 - CLEARANCE
    shaft = pin - THROW * _unit(ANGLE)
    ax.add_patch(Circle((bore[0], bore[1]), 1, facecolor="0.93", edgecolor="k", linewidth=2))
    ax.add_patch(Circle((pin[0], pin[1]), radius, facecolor="#dbe9f6", edgecolor="k", alpha=0.9))
    _line(ax, shaft, pin, color="k", linewidth=1.5)
    _text(ax, (shaft + pin) / 2 + np.array([-0.13, 0.03]), "$l_1$")
    _arrow(ax, bore, pin, arrowstyle="-|>", linewidth=2, color=ORANGE)
    _text(ax, pin / 2 + np.array([0.04, -0.06]), "$\\mathbf{e}$", color=ORANGE, fontsize=14)
    _arrow(ax, 1.15 * n, 1.45 * n, arrowstyle="-|>", linewidth=2, color=GREEN)
    _text(ax, 1.5 * n, "$\\mathbf{n}$", color=GREEN, fontsize=14)
    for point, name, x, y in (
        (bore, "$A_{jaw}$", 0.05, -0.13),
        (pin, "$A_{shaft}$", 0.06, 0.02),
        (shaft, "O", -0.12, -0.1),
    ):
        ax.plot(*point, "o", color="k", markerfacecolor="w", zorder=3)
        _text(ax, point + np.array([x, y]), name, fontsize=12)
    for start, at, length, letter in ((bore, 200.0, 1.0, "$R_i$"), (pin, 330.0, radius, "$R_j$")):
        end = start + length * _unit(np.radians(at))
        _arrow(ax, start, end, color="0.3")
        _text(ax, (start + end) / 2 + np.array([0.0, 0.06]), letter, color="0.3")
    ax.text(
        0,
        -1.3,
        "$c = R_i - R_j$;  $\\delta = |\\mathbf{e}| - c$: in contact where $\\delta > 0$",
        ha="center",
    )
    ax.set(xlim=(-1.15, 1.15), ylim=(-1.45, 1.65))
    ax.set_title("joint A: pin of the shaft in the bore of the jaw", fontsize=11)


def _unit(angle: float) -> np.ndarray:
    return np.array([np.cos(angle), np.sin(angle)])


def _text(ax: Axes, at: np.ndarray, text: str, **style: Any) -> None:
    ax.text(float(at[0]), float(at[1]), text, **style)


def _line(ax: Axes, start: np.ndarray, end: np.ndarray, **style: Any) -> None:
    ax.plot([start[0], end[0]], [start[1], end[1]], **style)


def _arrow(ax: Axes, start: np.ndarray, end: np.ndarray, **style: Any) -> None:
    whole = {"arrowstyle": "->", "shrinkA": 0, "shrinkB": 0} | style
    ax.annotate("", (end[0], end[1]), (start[0], start[1]), arrowprops=whole)

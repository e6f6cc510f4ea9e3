"""How pictures show a crusher: outlines of its bodies, names of its points, and its forces."""

from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from jaxcrusher.crusher.machine import LETTERS, lengths_of
from jaxcrusher.mechanism.linkage import Point
from jaxcrusher.mechanism.scene import Scene

BLUE, ORANGE, GREEN, PURPLE = "#0072B2", "#D55E00", "#009E73", "#CC79A7"
# Force of a crusher -> symbol, colour, where it acts, and which end of the arrow is there: the
# frame pushes, so that R_O and F_A, almost equal, do not cover each other.
FORCES = {
    "bearing_reaction": ("$R_O$", BLUE, "O", "tip"),
    "toggle_reaction": ("$R_C$", GREEN, "C", "tip"),
    "joint_force": ("$F_A$", ORANGE, "A", "tail"),
    "crushing_load": ("$F_{load}$", PURPLE, "load_position", "tail"),
}
# What a trajectory of a crusher must hold to be drawn; its pin tells the angle of a free shaft.
DRAWN = ("pin_position", "eccentricity", *FORCES, "load_position")
# Of a joint: the force on the bore and its sign, and where its inset lies.
Inset = tuple[str, int, tuple[float, float, float, float]]
INSETS: dict[str, Inset] = {
    "main": ("joint_force", 1, (0.01, 0.52, 0.37, 0.45)),
    "elbow": ("elbow_reaction", 1, (0.01, 0.31, 0.37, 0.16)),
    "pivot": ("toggle_reaction", -1, (0.01, 0.095, 0.37, 0.16)),
}
# The longest arrow in lengths of the jaw.
LONGEST_ARROW = 0.4
# The outline of the jaw in bore radii, along B-A from A and across it to the face; from B below.
# The sign of the frame in the same.
HUB, FACE, FOOT, SIGN = 1.25, 1.35, 0.35, 0.45
JAW, TOGGLE, PIN = "0.88", "0.7", "#dbe9f6"


class Shape(NamedTuple):
    """A figure of a body: corners in its axes (m), and how it is drawn."""

    body: str
    corners: Iterable[tuple[float, float]]
    style: dict[str, Any]


class Dot(NamedTuple):
    """A point, the offset of its name in typographic points, and how it is drawn."""

    point: Point
    beside: tuple[int, int]
    style: dict[str, Any]


class Outline(NamedTuple):
    """What is drawn of a mechanism: its bodies, points by their names, and forces by theirs."""

    shapes: list[Shape]
    dots: dict[str, Dot]
    forces: Mapping[str, tuple[str, str, str, str]]  # as in `FORCES`
    longest: float  # arrow, m
    sign: float  # size of the sign of the frame, m
    limits: Float[np.ndarray, "2 2"]  # of x and of y, m
    needed: tuple[str, ...] = ()  # what a trajectory must hold
    insets: Mapping[str, Inset] = {}  # as in `INSETS`
    pin: str | None = None  # where the crank's pin is, which tells the angle of a free crank
    fixed_jaw: tuple[float, float] | None = None  # beside the second shape: its size and width, m


def outline(scene: Scene) -> Outline:
    """Return the outline of a crusher; an ideal joint has no radius, and 0.19 is the paper's."""
    linkage, main = scene.linkage, scene.bearings["main"]
    throw, size, toggle = map(float, lengths_of(linkage).values())
    bearing = np.asarray(linkage.joints.at("shaft_bearing").bore.arm.vector().array())
    r = 0.19 * size if main is None else float(main.bore_radius)
    # Along B-A from A, across it away from the face.
    jaw = [(0.0, HUB * r), (-size, 0.4 * r), (-size - FOOT * r, 0.0)]
    face = [(-size - FOOT * r, -FACE * r), (0.9 * HUB * r, -FACE * r)]
    jaw += [*face, (HUB * r, -0.5 * r), (0.9 * r, 0.9 * r)]
    half, turned = 0.18 * r, np.linspace(0, 2 * np.pi, 61)
    plate = [(0.0, half), (toggle, half), (toggle, -half), (0.0, -half)]
    pin = zip(throw + r * np.cos(turned), r * np.sin(turned), strict=True)
    line = {"closed": False, "fill": False}
    shapes = [
        Shape("jaw", jaw, {"facecolor": JAW, "edgecolor": "k"}),
        Shape("jaw", face, {**line, "edgecolor": "k", "linewidth": 3, "capstyle": "butt"}),
        Shape("toggle", plate, {"facecolor": TOGGLE, "edgecolor": "k"}),
        Shape("shaft", pin, {"facecolor": PIN, "edgecolor": "k"}),
        Shape("shaft", [(0.0, 0.0), (throw + r, 0.0)], {**line, "edgecolor": "0.4"}),
    ]
    named = {LETTERS[name]: joint.pin for name, joint in linkage.joints.items()}
    named["$S_2$"] = linkage.centre("jaw")
    offsets = {"O": (-18, -4), "A": (7, 4), "B": (9, -14), "C": (5, 9), "$S_2$": (8, -4)}
    styles = {name: {"marker": "o", "markersize": 6} for name in named}
    styles |= {"$S_2$": {"marker": "P", "markersize": 7}}
    dots = {name: Dot(point, offsets[name], styles[name]) for name, point in named.items()}
    right, top = bearing + HUB * r
    limits = np.array([(-0.95 * size, right + 0.63 * size), (-0.55 * size, top + 0.3 * size)])
    sizes = LONGEST_ARROW * size, SIGN * r, limits
    return Outline(shapes, dots, FORCES, *sizes, DRAWN, INSETS, "pin_position", (size, r))

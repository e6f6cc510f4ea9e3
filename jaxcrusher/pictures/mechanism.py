"""The mechanism to scale, its clearance magnified, and the forces on it."""

import itertools
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle, Polygon

from jaxcrusher.basics.checks import require
from jaxcrusher.crusher.machine import LETTERS
from jaxcrusher.crusher.scene import Scene
from jaxcrusher.mechanism.named import before
from jaxcrusher.motion.simulation import Trajectory
from jaxcrusher.pictures.plots import BLUE, GREEN, ORANGE, PURPLE

# What a trajectory must hold to be drawn.
DRAWN = (
    "pin_position",
    "jaw_position",
    "jaw_mass_centre",
    "eccentricity",
    "bearing_reaction",
    "toggle_reaction",
    "joint_force",
    "crushing_load",
    "load_position",
)
# Force -> symbol, colour, where it acts, and which end of the arrow is there: the frame pushes,
# so that R_O and F_A, almost equal, do not cover each other.
FORCES = {
    "bearing_reaction": ("$R_O$", BLUE, "bearing", "tip"),
    "toggle_reaction": ("$R_C$", GREEN, "toggle_pivot", "tip"),
    "joint_force": ("$F_A$", ORANGE, "pin_position", "tail"),
    "crushing_load": ("$F_{load}$", PURPLE, "load_position", "tail"),
}
# Of a joint: the force on the bore and its sign, and where its inset lies.
INSETS = {
    "main": ("joint_force", 1, (0.01, 0.52, 0.37, 0.45)),
    "elbow": ("elbow_reaction", 1, (0.01, 0.31, 0.37, 0.16)),
    "pivot": ("toggle_reaction", -1, (0.01, 0.095, 0.37, 0.16)),
}
# The longest arrow in lengths of the jaw, and the widest magnified gap in radii of the bore.
LONGEST_ARROW, WIDEST_GAP = 0.4, 0.35
# The outline of the jaw in bore radii, along B-A from A and across it to the face; from B below.
HUB, FACE, FOOT = 1.25, 1.35, 0.35
JAW, TOGGLE, PIN = "0.88", "0.7", "#dbe9f6"
# How arrows are drawn, in the axes' own units, and what stands beside one.
ARROW: dict[str, Any] = {"angles": "xy", "scale_units": "xy", "minlength": 0, "zorder": 5}
OUTLINED = {**ARROW, "width": 0.007, "edgecolor": "w", "linewidth": 0.5}
_BOX = {"boxstyle": "round,pad=0.1", "facecolor": "w", "edgecolor": "none", "alpha": 0.8}
SYMBOL: dict[str, Any] = {"fontsize": 12, "fontweight": "bold", "zorder": 6, "bbox": _BOX}
SYMBOL |= {"textcoords": "offset points", "xytext": (0, 0), "ha": "center", "va": "center"}


def plot_mechanism(
    scene: Scene, trajectory: Trajectory, instant: int = 0, ax: Axes | None = None
) -> Axes:
    """Draw the mechanism (m) at the trajectory's time of index `instant`.

    Links, pivots, bore and pin are to scale. The machine's tables hold no outline of the jaw, no
    face and no fixed jaw: these are drawn for the eye, the face parallel to A-B. An inset for each
    joint with clearance shows the pin in its bore with the clearance magnified. Arrows show the
    frame's R_O on the shaft and R_C on the toggle, and F_A and the crushing load on the jaw.

    Raises ValueError if the trajectory lacks the instant, one of `DRAWN`, or the eccentricity and
    the force of a loose elbow or pivot.
    """
    ax = plt.subplots(figsize=(8, 6.4), layout="constrained")[1] if ax is None else ax
    Drawing(scene, trajectory, ax, [instant]).show(instant)
    return ax


class Drawing:
    """The artists of a mechanism, made once and moved from instant to instant.

    The largest force at `instants`, those that will be shown, sets the scale of the arrows.
    """

    def __init__(self, scene: Scene, trajectory: Trajectory, ax: Axes, instants: list[int]):
        joints = dict(scene.joints.items())
        of_joints = [(before(name) + "eccentricity", INSETS[name][0]) for name in joints]
        needed = tuple(dict.fromkeys((*DRAWN, *itertools.chain(*of_joints))))
        for name in needed:
            require(name in trajectory.values, "trajectory", f"hold '{name}'", "without it")
        count = len(trajectory.time)
        good = len(instants) > 0 and all(-count <= i < count for i in instants)
        require(good, "instant", f"be the index of one of {count} times", instants)
        self.time = np.asarray(trajectory.time)
        self.data = {name: np.asarray(trajectory[name]) for name in needed}
        bearing = np.array([float(scene.machine.bearing.x), float(scene.machine.bearing.y)])
        self.data["bearing"] = np.broadcast_to(bearing, (count, 2))
        self.data["toggle_pivot"] = np.zeros((count, 2))
        sizes = [np.linalg.norm(self.data[name][instants], axis=1) for name in FORCES]
        largest = max(float(np.nanmax(size, initial=0)) for size in sizes)
        size = float(scene.machine.jaw.length)
        # An ideal joint has no radius; 0.19 is the paper's.
        radius = 0.19 * size if scene.joint is None else float(scene.joint.bore_radius)
        self.ax = ax
        self.parts = [
            _Bodies(ax, size, radius, bearing, self.data),
            _Arrows(ax, largest / (LONGEST_ARROW * size), largest),
        ]
        for name, joint in joints.items():
            bore, clearance = float(joint.bore_radius), float(joint.clearance)
            self.parts.append(_Magnified(ax, name, bore, clearance, largest))
        right, top = bearing + HUB * radius
        ax.set(
            xlim=(-0.95 * size, right + 0.63 * size),
            ylim=(-0.55 * size, top + 0.3 * size),
            aspect="equal",
            xlabel="x (m)",
            ylabel="y (m)",
        )

    def show(self, instant: int) -> None:
        """Move everything to one instant of the trajectory."""
        here = {name: values[instant] for name, values in self.data.items()}
        for part in self.parts:
            part.show(here)
        self.ax.set_title(f"t = {1e3 * self.time[instant]:.2f} ms")


class _Bodies:
    """Frame, fixed jaw, toggle, jaw and shaft."""

    def __init__(self, ax: Axes, size: float, radius: float, bearing: np.ndarray, data: dict):
        self.radius = r = radius
        # Along B-A from A, across it towards the face.
        self.outline = np.array(
            [
                (0.0, -HUB * r),
                (-size, -0.4 * r),
                (-size - FOOT * r, 0.0),
                (-size - FOOT * r, FACE * r),
                (0.9 * HUB * r, FACE * r),
                (HUB * r, 0.5 * r),
                (0.9 * r, -0.9 * r),
            ]
        )
        self.jaw = ax.add_patch(Polygon(self.outline, facecolor=JAW, edgecolor="k"))
        (self.face,) = ax.plot([], [], color="k", linewidth=3, solid_capstyle="butt")
        self.toggle = ax.add_patch(Polygon(np.zeros((4, 2)), facecolor=TOGGLE, edgecolor="k"))
        self.half_toggle = 0.18 * r
        self.pin = ax.add_patch(Circle((0, 0), r, facecolor=PIN, edgecolor="k"))
        self.elbow = ax.add_patch(Circle((0, 0), 0.3 * r, facecolor=TOGGLE, edgecolor="k"))
        (self.mark,) = ax.plot([], [], color="0.4", linewidth=1.2)
        (self.axis,) = ax.plot([], [], "o", color="k", markersize=4)
        (self.centre,) = ax.plot([], [], "P", color="k", markerfacecolor="w", markersize=7)
        for pivot in (np.zeros(2), bearing):
            foot = pivot + 0.45 * r * np.array([(0, 0), (-0.8, -1.3), (0.8, -1.3)])
            ax.add_patch(Polygon(foot, facecolor="w", edgecolor="k", hatch="////", zorder=3))
            ax.plot(*pivot, "o", color="k", markerfacecolor="w", markersize=6, zorder=4)
        self._fixed_jaw(ax, r, size, data)
        offsets = {"O": (-18, -4), "A": (7, 4), "B": (9, -14), "C": (5, 9), "$S_2$": (8, -4)}
        self.names = {
            name: ax.annotate(name, (0, 0), textcoords="offset points", xytext=offset)
            for name, offset in offsets.items()
        }

    def _fixed_jaw(self, ax: Axes, r: float, size: float, data: dict) -> None:
        """Clear of the face at every time, 20 degrees off it on average."""
        upwards, across = _axes(data["pin_position"], data["jaw_position"])
        lower = data["pin_position"] - (size + FOOT * r) * upwards + FACE * r * across
        nearest = lower[np.nanargmax(lower[:, 0])] + np.array([0.3 * r, 0.0])
        opening = np.radians(20) + np.arctan2(*np.nanmean(upwards, axis=0))
        top = nearest + 1.25 * size * np.array([np.sin(opening), np.cos(opening)])
        back = np.array([0.5 * r, 0.0])
        block = np.array([nearest, top, top + back, nearest + back])
        ax.add_patch(Polygon(block, facecolor="w", edgecolor="k", hatch="////"))
        ax.plot(*block[:2].T, color="k", linewidth=3, solid_capstyle="butt")

    def show(self, here: dict[str, np.ndarray]) -> None:
        pin, elbow = here["pin_position"], here["jaw_position"]
        upwards, across = _axes(pin, elbow)
        outline = pin + self.outline[:, :1] * upwards + self.outline[:, 1:] * across
        self.jaw.set(xy=outline)
        self.face.set_data(*outline[3:5].T)
        side = self.half_toggle * np.array([-elbow[1], elbow[0]]) / np.linalg.norm(elbow)
        self.toggle.set(xy=[side, elbow + side, elbow - side, -side])
        self.pin.set(center=pin)
        self.elbow.set(center=elbow)
        crank = (pin - here["bearing"]) / np.linalg.norm(pin - here["bearing"])
        self.mark.set_data(*np.array([here["bearing"], pin + self.radius * crank]).T)
        self.axis.set_data(*pin[:, None])
        self.centre.set_data(*here["jaw_mass_centre"][:, None])
        points = (here["bearing"], pin, elbow, np.zeros(2), here["jaw_mass_centre"])
        for name, point in zip(self.names.values(), points, strict=True):
            name.xy = (point[0], point[1])


class _Arrows:
    """The forces, to one scale, and the scale."""

    def __init__(self, ax: Axes, newtons_per_metre: float, largest: float):
        self.arrows, self.labels = {}, {}
        for name, (symbol, colour, _, end) in FORCES.items():
            self.arrows[name] = ax.quiver(
                0, 0, 0, 0, scale=newtons_per_metre, pivot=end, color=colour, **OUTLINED
            )
            self.labels[name] = ax.annotate(symbol, (0, 0), color=colour, **SYMBOL)
        unit = _round_down(0.6 * largest)
        words = f"{unit / 1e3:g} kN"
        ax.quiverkey(self.arrows["joint_force"], 0.14, 0.05, unit, words, labelpos="E", color="k")
        # A shorter arrow leaves no room for its name.
        self.metres, self.least = 1 / newtons_per_metre, 0.1 * largest

    def show(self, here: dict[str, np.ndarray]) -> None:
        for name, (_, _, place, end) in FORCES.items():
            force, point = here[name], here[place]
            self.arrows[name].set_offsets(point)
            self.arrows[name].set_UVC(*force)
            length = np.linalg.norm(force)
            label = self.labels[name]
            label.set_visible(bool(length > self.least))
            if label.get_visible():
                away = -force if end == "tip" else force
                x, y = point + self.metres * away
                label.xy = (x, y)
                label.set_position(12 * away / length)


class _Magnified:
    """The pin of a joint in its bore, the clearance, which is named, as wide as can be seen."""

    def __init__(self, ax: Axes, joint: str, radius: float, clearance: float, largest: float):
        self.joint = joint
        *_, place = INSETS[joint]
        times = _round_down(WIDEST_GAP * radius / clearance)
        self.scale = times / radius
        gap = self.scale * clearance
        inset = ax.inset_axes(place)
        limits = (-1.35, 1.35)
        inset.set(xlim=limits, ylim=limits, aspect="equal", xticks=[], yticks=[], facecolor=JAW)
        inset.set_title(f"{LETTERS[joint]}: {1e3 * clearance:g} mm, times {times:g}", fontsize=9)
        inset.add_patch(Circle((0, 0), 1, facecolor="w", edgecolor="k", linewidth=1.5))
        inset.add_patch(Circle((0, 0), gap, fill=False, edgecolor="0.4", linestyle="--"))
        pin = Circle((0, 0), 1 - gap, facecolor=PIN, edgecolor="k", linewidth=1.5, alpha=0.8)
        self.pin = inset.add_patch(pin)
        inset.plot(0, 0, "+", color="k", markersize=9)
        (self.centre,) = inset.plot([], [], "o", color="k", markersize=4)
        colour = FORCES["joint_force"][1]
        self.force = inset.quiver(
            0, 0, 0, 0, scale=largest / 0.7, pivot="tip", color=colour, width=0.02, **ARROW
        )

    def show(self, here: dict[str, np.ndarray]) -> None:
        force, sign, _ = INSETS[self.joint]
        centre = self.scale * here[before(self.joint) + "eccentricity"]
        self.pin.set(center=centre)
        self.centre.set_data(*centre[:, None])
        # At the bore's surface, where the pin presses.
        away = np.linalg.norm(centre)
        self.force.set_offsets(centre / away if away > 0 else centre)
        self.force.set_UVC(*(sign * here[force]))


def _axes(pin: np.ndarray, elbow: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Unit vectors along the jaw, B-A, and across it towards the face."""
    along = pin - elbow
    upwards = along / np.linalg.norm(along, axis=-1, keepdims=True)
    return upwards, np.stack([upwards[..., 1], -upwards[..., 0]], axis=-1)


def _round_down(value: float) -> float:
    """The largest of 1, 2, 5 times a power of ten that is not above the value."""
    if not value > 0:
        return 1.0
    power = 10.0 ** np.floor(np.log10(value))
    return float(power * max(step for step in (1, 2, 5) if step * power <= value))

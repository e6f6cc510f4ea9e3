"""Any mechanism to scale, as a picture or a film: bodies between joints, and the forces on them.

A crusher has outlines for the eye, and beside it the magnified clearances of A, B and C.
"""

import itertools
from collections.abc import Container, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
from jaxtyping import Array, Float, Scalar
from matplotlib.axes import Axes
from matplotlib.patches import Circle, Polygon

from jaxcrusher.basics.checks import require
from jaxcrusher.basics.plane import Arm
from jaxcrusher.crusher.outline import (
    BLUE,
    GREEN,
    JAW,
    ORANGE,
    PIN,
    PURPLE,
    Dot,
    Outline,
    Shape,
)
from jaxcrusher.crusher.outline import DRAWN as DRAWN
from jaxcrusher.mechanism.linkage import Linkage, Point
from jaxcrusher.mechanism.motion import ideal_at_rest
from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.mechanism.topology import FRAME
from jaxcrusher.motion.simulation import Trajectory
from jaxcrusher.pictures.frames import pictures_of, require_film, write_film

# The longest arrow and half of a slider's length in spans of a linkage, and the widest magnified
# gap in radii of the bore.
LONGEST, HALF, WIDEST_GAP = 0.3, 0.04, 0.5
COLOURS = (BLUE, GREEN, PURPLE, "0.3", "tab:brown", "tab:olive")
# How arrows are drawn, in the axes' own units, and what stands beside one.
ARROW: dict[str, Any] = {"angles": "xy", "scale_units": "xy", "minlength": 0, "zorder": 5}
OUTLINED = {**ARROW, "width": 0.007, "edgecolor": "w", "linewidth": 0.5}
_BOX = {"boxstyle": "round,pad=0.1", "facecolor": "w", "edgecolor": "none", "alpha": 0.8}
SYMBOL: dict[str, Any] = {"fontsize": 12, "fontweight": "bold", "zorder": 6, "bbox": _BOX}
SYMBOL |= {"textcoords": "offset points", "xytext": (0, 0), "ha": "center", "va": "center"}
EDGES = (-1.35, 1.35)  # of what is magnified, in radii of the bore
HATCHED: dict[str, Any] = {"facecolor": "w", "edgecolor": "k", "hatch": "////"}


def plot_mechanism(
    scene: Scene, trajectory: Trajectory, instant: int = 0, ax: Axes | None = None
) -> Axes:
    """Draw a mechanism (m) at the trajectory's time of index `instant`, with ideal joints.

    Links and joints of a crusher are to scale, its bore and pin too. The machine's tables hold no
    outline of the jaw, no face and no fixed jaw: these are drawn for the eye, the face parallel to
    A-B. An inset for each of A, B and C with clearance shows the pin in its bore with the clearance
    magnified. Arrows show the frame's R_O on the shaft and R_C on the toggle, and F_A and the
    crushing load on the jaw.

    A body of another linkage is the outline of its joints and points, a slider a block on its
    dashed line; a loose joint is ringed. Arrows show the force on the bore of each loose joint, if
    the trajectory holds it.

    Raises ValueError if the trajectory lacks the instant or, of a crusher, one of `DRAWN` or the
    eccentricity and the force of a loose elbow or pivot; and for another linkage whose crank turns
    freely.
    """
    ax = plt.subplots(figsize=(8, 6.4), layout="constrained")[1] if ax is None else ax
    Drawing(scene, trajectory, ax, [instant]).show(instant)
    return ax


def animate(
    scene: Scene,
    trajectory: Trajectory,
    path: str | Path,
    *,
    instants: Sequence[int] | None = None,
    frames_per_second: int = 20,
    dpi: float = 80,
) -> None:
    """Write a film of the mechanism, a picture for each of `instants` (None: all times, by index).

    The suffix of `path` chooses: `.gif`; `.html`, one page with a player, which plays without a
    network; or `.mp4`, which needs ffmpeg. What is drawn: see `plot_mechanism`; one scale of the
    arrows holds for all pictures.
    The times shown should be equally spaced.

    Raises ValueError for another suffix, for .mp4 without ffmpeg, and as `plot_mechanism` does.
    """
    path = Path(path)
    require_film(path, frames_per_second)
    fig, ax = plt.subplots(figsize=(8, 6.4), layout="constrained")
    try:
        shown = range(len(trajectory.time)) if instants is None else instants
        drawing = Drawing(scene, trajectory, ax, shown)
        pictures = [*pictures_of(fig, drawing.show, shown, dpi)]
    finally:
        plt.close(fig)
    write_film(path, pictures, frames_per_second, path.stem)


def drawn_of(scene: Scene) -> tuple[str, ...]:
    """Return what a trajectory must hold to be drawn with all clearances magnified."""
    look = _look(scene)
    names = [] if look is None else list(look.needed)
    for joint in scene.joints.names:
        names += [f"{scene.prefix(joint)}eccentricity"]
        names += [_pressing(look, joint)[0]] if joint in scene.bearings else []
    return tuple(dict.fromkeys(names))


def _look(scene: Scene) -> Outline | None:
    """Return the outline that a mechanism has for the eye; None for any linkage."""
    return None if scene.template.outline is None else scene.template.outline(scene)


def _pressing(look: Outline | None, joint: str) -> tuple[str, int]:
    """Return the name of the force on the bore of a joint, and its sign."""
    usual = f"{joint}_reaction", 1
    return usual if look is None or joint not in look.insets else look.insets[joint][:2]


class Drawing:
    """The artists of a mechanism, made once and moved from instant to instant.

    The largest force at `instants`, those that will be shown, sets the scale of the arrows.
    `magnified` has axes for magnified clearances, by their joints; without it a crusher has insets.
    """

    def __init__(
        self,
        scene: Scene,
        trajectory: Trajectory,
        ax: Axes,
        instants: Iterable[int],
        magnified: Mapping[str, Axes] | None = None,
    ):
        self.ax, self.time, shown = ax, np.asarray(trajectory.time), list(instants)
        count, look = len(self.time), _look(scene)
        outlined = look is not None
        if magnified is None:
            insets = {} if look is None else look.insets
            own = {joint: how for joint, how in insets.items() if joint in scene.bearings}
            magnified = {joint: ax.inset_axes(place) for joint, (*_, place) in own.items()}
        needed = [] if look is None else list(look.needed)
        for joint in magnified:
            needed.append(f"{scene.prefix(joint)}eccentricity")
            needed += [_pressing(look, joint)[0]] if joint in scene.bearings else []
        for name in needed:
            require(name in trajectory.values, "trajectory", f"hold '{name}'", "without it")
        good = len(shown) > 0 and all(-count <= i < count for i in shown)
        require(good, "instant", f"be the index of one of {count} times", shown)
        angles = _angles(scene, trajectory, None if look is None else look.pin)
        look = joints_outline(scene, angles, trajectory.values) if look is None else look
        self._frame(scene.linkage, look)
        self.parts = []
        for body, corners, style in look.shapes:
            arms = [Point(body, Arm(*corner)) for corner in corners]
            patch = ax.add_patch(Polygon(np.zeros((2, 2)), **style))
            self.parts.append((patch, places_of(scene.linkage, arms, angles)))
        self.dots = {}
        for name, (point, beside, style) in look.dots.items():
            way = places_of(scene.linkage, [point], angles)[:, 0]
            (dot,) = ax.plot([], [], **{"color": "k", "markerfacecolor": "w", "zorder": 4} | style)
            text = ax.annotate(name, (0, 0), beside, textcoords="offset points", zorder=6)
            self.dots[name] = dot, text, way
        places = {name: way for name, (_, _, way) in self.dots.items()}
        places |= {name: np.asarray(values) for name, values in trajectory.values.items()}
        sizes = [np.linalg.norm(places[name][shown], axis=1) for name in look.forces]
        largest = max((float(np.nanmax(size, initial=0)) for size in sizes), default=0.0) or 1.0
        self.metres, self.least = look.longest / largest, 0.1 * largest
        self.arrows = {}
        for name, (symbol, colour, at, end) in look.forces.items():
            how = {"scale": 1 / self.metres, "pivot": end, "color": colour, **OUTLINED}
            arrow = ax.quiver(0, 0, 0, 0, **how)
            label = ax.annotate(symbol, (0, 0), color=colour, **SYMBOL)
            self.arrows[name] = arrow, label, end, places[at], places[name]
        if look.forces:
            unit = _round_down(0.6 * largest)
            ax.quiverkey(arrow, 0.14, 0.05, unit, f"{unit / 1e3:g} kN", labelpos="E", color="k")
        self.clearances: dict[str, _Pin | _Slider] = {}
        for joint, place in magnified.items():
            play = places[f"{scene.prefix(joint)}eccentricity"]
            if joint in scene.bearings:
                name, sign = _pressing(look, joint)
                force = sign * places[name]
                self.clearances[joint] = _Pin(place, scene, joint, play, force, largest)
            else:
                self.clearances[joint] = _Slider(place, scene, joint, play)
        if look.fixed_jaw is not None:
            self._fixed_jaw(*look.fixed_jaw)
        x, y = look.limits
        ax.set(xlim=x, ylim=y, aspect="equal", xlabel="x (m)", ylabel="y (m)")
        if not outlined:
            ax.legend(loc="center left", bbox_to_anchor=(1, 0.5), frameon=False)

    def _frame(self, linkage: Linkage, look: Outline) -> None:
        """Draw what stands still: bearings in the frame, and the lines of slides."""
        for _, at in joints_in_frame(linkage):
            self.ax.add_patch(Polygon(foot(at, look), zorder=3, **HATCHED))
        for slide in linkage.slides.values:
            ahead = np.asarray(slide.direction.array())
            begin = np.asarray(slide.through.vector().array())
            ends = [begin + ahead * float(ahead @ (corner - begin)) for corner in look.limits.T]
            self.ax.plot(*np.array(ends).T, "--", color="0.6", linewidth=1, zorder=0)

    def _fixed_jaw(self, size: float, r: float) -> None:
        _, face = self.parts[1]
        block = fixed_jaw(face, size, r)
        self.ax.add_patch(Polygon(block, **HATCHED))
        self.ax.plot(*block[:2].T, color="k", linewidth=3, solid_capstyle="butt")

    def show(self, instant: int) -> None:
        """Move everything to one instant of the trajectory."""
        for patch, corners in self.parts:
            patch.set(xy=corners[instant])
        for dot, name, way in self.dots.values():
            dot.set_data(*way[instant][:, None])
            name.xy = tuple(way[instant])
        for arrow, label, end, places, forces in self.arrows.values():
            at, force = places[instant], forces[instant]
            arrow.set_offsets(at)
            arrow.set_UVC(*force)
            # A shorter arrow leaves no room for its name.
            length = np.linalg.norm(force)
            label.set_visible(bool(length > self.least))
            if label.get_visible():
                away = -force if end == "tip" else force
                label.xy = tuple(at + self.metres * away)
                label.set_position(12 * away / length)
        for clearance in self.clearances.values():
            clearance.show(instant)
        self.ax.set_title(f"t = {1e3 * self.time[instant]:.2f} ms")


def joints_in_frame(linkage: Linkage) -> list[tuple[str, np.ndarray]]:
    """Return the joints that lie in the frame, with their places, m."""
    found = []
    for name, joint in linkage.joints.items():
        ends = [end for end in (joint.bore, joint.pin) if end.body == FRAME]
        found += [(name, np.asarray(end.arm.vector().array())) for end in ends]
    return found


def foot(at: np.ndarray, look: Outline) -> Float[np.ndarray, "3 2"]:
    """Return corners of the foot on which a joint of the frame stands."""
    return at + look.sign * np.array([(0, 0), (-0.8, -1.4), (0.8, -1.4)])


def fixed_jaw(face: Float[np.ndarray, "n 2 2"], size: float, r: float) -> Float[np.ndarray, "4 2"]:
    """Return corners of a fixed jaw clear of the face at all n times, on average 20 degrees off it.

    The first two corners are those before the face, whose low end stands first. The jaw is `size`
    long, and `r` (m) is the radius of its bore.
    """
    low, high = face.swapaxes(0, 1)
    nearest = low[np.nanargmax(low[:, 0])] + np.array([0.3 * r, 0.0])
    opening = np.radians(20) + np.arctan2(*np.nanmean(high - low, axis=0))
    top = nearest + 1.25 * size * np.array([np.sin(opening), np.cos(opening)])
    back = np.array([0.5 * r, 0.0])
    return np.array([nearest, top, top + back, nearest + back])


def _angles(scene: Scene, trajectory: Trajectory, pin: str | None) -> Float[Array, " n"]:
    """Return the angle of the crank at each time, of a free one by where its pin is."""
    if scene.drive.initial() is None:
        return jax.vmap(lambda time: scene.drive.crank(time, None).angle)(
            jnp.asarray(trajectory.time)
        )
    must = "have a crank of given speed to be drawn"
    require(pin is not None, "scene", must, "a free one")
    assert pin is not None
    linkage = scene.linkage
    bearing = linkage.side_of(linkage.bearing, FRAME).vector().array()
    arm = jnp.asarray(trajectory[pin]) - bearing
    return jnp.arctan2(arm[:, 1], arm[:, 0])


@eqx.filter_jit
def _seen(
    linkage: Linkage, points: list[Point], angles: Float[Array, " n"]
) -> Float[Array, "n points 2"]:
    def at(angle: Scalar) -> Array:
        motion = ideal_at_rest(linkage, angle)
        return jnp.stack([motion.position(point).array() for point in points])

    return jax.vmap(at)(angles)


def places_of(linkage: Linkage, points: list[Point], angles: Float[Array, " n"]) -> np.ndarray:
    """Return positions of points at angles of the crank, without the shifts by clearances."""
    return np.asarray(_seen(linkage, points, angles))


def joints_outline(scene: Scene, angles: Float[Array, " n"], held: Container[str] = ()) -> Outline:
    """Return the look of any linkage, by its joints and points, with the forces that are held."""
    linkage, dots, parts = scene.linkage, {}, []
    for name, joint in linkage.joints.items():
        end = joint.bore if joint.pin.body == FRAME else joint.pin  # the one that moves
        loose = name in scene.joints
        size = {"markersize": 10 if loose else 5, "markeredgecolor": ORANGE if loose else "k"}
        dots[name] = Dot(end, (6, 6), {"marker": "o", **size})
    ends = [end for joint in linkage.joints.values for end in (joint.bore, joint.pin)]
    moving = [point for point in (*ends, *scene.points.values) if point.body != FRAME]
    every = places_of(linkage, moving, angles).reshape(-1, 2)
    low, high = every.min(axis=0), every.max(axis=0)
    span = float(max(high - low))
    sliders = [slide.body for slide in linkage.slides.values]
    for body, colour in zip(linkage.bodies.names, itertools.cycle(COLOURS)):
        own = [point.arm.vector().array() for point in moving if point.body == body]
        corners = np.array(own, float)
        middle = corners.mean(axis=0)
        x, y = (corners - middle).T
        outline = corners[np.argsort(np.arctan2(y, x), kind="stable")]
        if body in sliders:
            outline = middle + HALF * span * np.array([(-2, -1), (2, -1), (2, 1), (-2, 1)])
        style = {"facecolor": colour, "edgecolor": colour, "alpha": 0.5, "linewidth": 4}
        style |= {"closed": len(outline) > 2, "joinstyle": "round", "label": body}
        parts.append(Shape(body, outline.tolist(), style))
    forces = {f"{name}_reaction": ("", ORANGE, name, "tail") for name in scene.bearings.names}
    forces = {name: how for name, how in forces.items() if name in held}
    margin = 0.15 * span
    limits = np.stack([low - margin, high + margin], axis=1)
    return Outline(parts, dots, forces, LONGEST * span, 0.03 * span, limits)


def _title(ax: Axes, scene: Scene, joint: str, clearance: float, times: float) -> None:
    ax.set(aspect="equal", xticks=[], yticks=[], facecolor=JAW)
    name = scene.template.joint(joint).title
    ax.set_title(f"{name}: {1e3 * clearance:g} mm, times {times:g}", fontsize=9)


class _Pin:
    """The pin of a joint in its bore, the clearance, which is named, as wide as can be seen."""

    def __init__(
        self,
        ax: Axes,
        scene: Scene,
        joint: str,
        eccentricity: np.ndarray,
        forces: np.ndarray,
        largest: float,
    ):
        bearing = scene.bearings.at(joint)
        radius, clearance = float(bearing.bore_radius), float(bearing.clearance)
        times = _round_down(WIDEST_GAP * radius / clearance)
        self.gap, self.centres = times / radius * clearance, times / radius * eccentricity
        self.forces = forces
        ax.set(xlim=EDGES, ylim=EDGES)
        _title(ax, scene, joint, clearance, times)
        ax.add_patch(Circle((0, 0), 1, facecolor="w", edgecolor="k", linewidth=1.5))
        ax.add_patch(Circle((0, 0), self.gap, fill=False, edgecolor="0.4", linestyle="--"))
        pin = Circle((0, 0), 1 - self.gap, facecolor=PIN, edgecolor="k", linewidth=1.5, alpha=0.8)
        self.pin = ax.add_patch(pin)
        ax.plot(0, 0, "+", color="k", markersize=9)
        (self.path,) = ax.plot([], [], color=BLUE, linewidth=0.9)
        (self.centre,) = ax.plot([], [], "o", color="k", markersize=4)
        (self.contact,) = ax.plot([], [], "o", color=ORANGE, markeredgecolor="k", zorder=6)
        self.force = ax.quiver(
            0, 0, 0, 0, scale=largest / 0.7, pivot="tip", color=ORANGE, width=0.02, **ARROW
        )

    def show(self, instant: int) -> None:
        centre = self.centres[instant]
        self.pin.set(center=centre)
        self.centre.set_data(*centre[:, None])
        self.path.set_data(*self.centres[: instant + 1].T)
        # At the bore's surface, where the pin presses.
        away = np.linalg.norm(centre)
        at = centre / away if away > 0 else centre
        self.contact.set_data(*at[:, None])
        self.contact.set_visible(bool(away > self.gap))
        self.force.set_offsets(at)
        self.force.set_UVC(*self.forces[instant])


class _Slider:
    """A slider between its edges, the gap magnified across the slide; its motion ahead is not seen.

    Lengths are in half lengths of the slider.
    """

    def __init__(self, ax: Axes, scene: Scene, joint: str, play: np.ndarray):
        slide, clearance = scene.linkage.slides.at(joint), float(scene.joints.at(joint).clearance)
        assert slide.length is not None and slide.height is not None
        half = float(slide.length) / 2
        times = _round_down(WIDEST_GAP * half / clearance)
        gap = times / half * clearance
        # A square, as high as it is long: the height decides nothing here.
        self.corners = np.array([(i, 0.6 * j) for i, j in ((1, 1), (-1, 1), (-1, -1), (1, -1))])
        ahead, side = self.corners.T
        offsets = times / half * (play[:, :1] + play[:, 1:] * ahead)
        self.places = np.stack([ahead + 0 * offsets, side + offsets], axis=-1)
        self.touching = np.sign(side) * offsets > gap
        ax.set(xlim=EDGES, ylim=EDGES)
        _title(ax, scene, joint, clearance, times)
        edge = 0.6 + gap
        ax.axhspan(-edge, edge, facecolor="w", edgecolor="k", linewidth=1.5)
        style = {"facecolor": PIN, "edgecolor": "k", "linewidth": 1.5, "alpha": 0.8}
        self.block = ax.add_patch(Polygon(self.corners, **style))
        (self.contact,) = ax.plot([], [], "o", color=ORANGE, markeredgecolor="k", zorder=6)

    def show(self, instant: int) -> None:
        corners = self.places[instant]
        self.block.set(xy=corners)
        self.contact.set_data(*corners[self.touching[instant]].T)


def _round_down(value: float) -> float:
    """The largest of 1, 2, 5 times a power of ten that is not above the value, > 0."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(power * max(step for step in (1, 2, 5) if step * power <= value))

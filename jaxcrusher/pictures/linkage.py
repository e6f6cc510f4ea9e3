"""Any linkage to scale: its bodies between their joints, and the forces in loose joints."""

from collections.abc import Iterable

import equinox as eqx
import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
from jaxtyping import Array, Float, Scalar
from matplotlib.axes import Axes
from matplotlib.patches import Polygon

from jaxcrusher.basics.checks import require
from jaxcrusher.mechanism.linkage import Joint, Point
from jaxcrusher.mechanism.linkage_scene import LinkageScene
from jaxcrusher.mechanism.motion import ideal_at_rest
from jaxcrusher.mechanism.topology import FRAME
from jaxcrusher.motion.simulation import Trajectory
from jaxcrusher.pictures.plots import BLUE, GREEN, ORANGE, PURPLE

COLOURS = (BLUE, GREEN, PURPLE, "0.3", "tab:brown", "tab:olive")
# The longest arrow, and half of a slider's length and of the sign of the frame, in spans.
LONGEST_ARROW, HALF, SIGN = 0.3, 0.04, 0.03


def plot_linkage(
    scene: LinkageScene, trajectory: Trajectory, instant: int = 0, ax: Axes | None = None
) -> Axes:
    """Draw a linkage (m) at the trajectory's time of index `instant`.

    A body is the outline of its joints and points, a slider a block on its dashed line; a loose
    joint is ringed. Arrows show the force on the bore of each loose joint, if the trajectory holds
    it. Clearances are too small to be seen.

    Raises ValueError for a crank that turns freely, and an instant that there is not.
    """
    ax = plt.subplots(figsize=(7, 5), layout="constrained")[1] if ax is None else ax
    LinkageDrawing(scene, trajectory, ax, [instant]).show(instant)
    return ax


class LinkageDrawing:
    """The artists of a linkage, made once and moved from instant to instant."""

    def __init__(
        self, scene: LinkageScene, trajectory: Trajectory, ax: Axes, instants: Iterable[int]
    ):
        given = scene.drive.initial() is None
        require(given, "scene", "have a crank of given speed to be drawn", "a free one")
        count, shown = len(trajectory.time), list(instants)
        good = len(shown) > 0 and all(-count <= i < count for i in shown)
        require(good, "instant", f"be the index of one of {count} times", shown)
        self.ax, self.time = ax, np.asarray(trajectory.time)
        linkage = scene.linkage
        pins = [_moving_end(joint) for joint in linkage.joints.values]
        self.outlines, points = _outlines(scene, pins)
        found = _places(scene, tuple(points), jnp.asarray(trajectory.time))
        self.places = np.stack([np.asarray(at) for at in found], axis=1)  # (times, points, 2)
        every = self.places.reshape(-1, 2)
        low, high = every.min(axis=0), every.max(axis=0)
        span = float(max(high - low))
        self.bodies = {}
        for i, (body, outline) in enumerate(self.outlines.items()):
            colour = COLOURS[i % len(COLOURS)]
            patch = Polygon(
                np.zeros((2, 2)), closed=len(outline) > 2, facecolor=colour, edgecolor=colour
            )
            patch.set(alpha=0.5, linewidth=4, joinstyle="round", label=body)
            self.bodies[body] = ax.add_patch(patch)
        self.sliders = [slide.body for slide in linkage.slides.values]
        self.half = HALF * span
        self._frame(scene, low, high, SIGN * span)
        self.joints = {}
        for i, name in enumerate(linkage.joints.names):
            loose = name in scene.joints
            size = {"markersize": 10 if loose else 5, "markeredgecolor": ORANGE if loose else "k"}
            (dot,) = ax.plot([], [], "o", markerfacecolor="w", zorder=4, **size)
            self.joints[name] = i, dot, ax.annotate(name, (0, 0), (6, 6), **_NAME)
        kept = [name for name in scene.joints.names if f"{name}_reaction" in trajectory.values]
        forces = {name: np.asarray(trajectory[f"{name}_reaction"]) for name in kept}
        sizes = [np.linalg.norm(force[shown], axis=1).max() for force in forces.values()]
        largest = float(max(sizes, default=0.0)) or 1.0
        scale = largest / (LONGEST_ARROW * span)
        how = {"angles": "xy", "scale_units": "xy", "scale": scale, "color": ORANGE, "zorder": 5}
        self.arrows = {name: (ax.quiver(0, 0, 0, 0, **how), forces[name]) for name in kept}
        margin = 0.15 * span
        ax.set(
            xlim=(low[0] - margin, high[0] + margin),
            ylim=(low[1] - margin, high[1] + margin),
            aspect="equal",
            xlabel="x (m)",
            ylabel="y (m)",
        )
        ax.legend(loc="center left", bbox_to_anchor=(1, 0.5), frameon=False)

    def _frame(self, scene: LinkageScene, low: np.ndarray, high: np.ndarray, size: float) -> None:
        """Draw what stands still: bearings in the frame, and the lines of slides."""
        for joint in scene.linkage.joints.values:
            for end in (joint.bore, joint.pin):
                if end.body == FRAME:
                    at = np.asarray(end.arm.vector().array())
                    foot = at + size * np.array([(0, 0), (-0.8, -1.4), (0.8, -1.4)])
                    patch = Polygon(foot, facecolor="w", edgecolor="k", hatch="////", zorder=3)
                    self.ax.add_patch(patch)
        for slide in scene.linkage.slides.values:
            ahead = np.asarray(slide.direction.array())
            begin = np.asarray(slide.through.vector().array())
            ends = [begin + ahead * float(ahead @ (corner - begin)) for corner in (low, high)]
            self.ax.plot(*np.array(ends).T, "--", color="0.6", linewidth=1, zorder=0)

    def show(self, instant: int) -> None:
        """Move everything to one instant of the trajectory."""
        for body, outline in self.outlines.items():
            corners = self.places[instant][outline]
            if body in self.sliders:
                block = np.array([(-2, -1), (2, -1), (2, 1), (-2, 1)]) * self.half
                corners = corners.mean(axis=0) + block
            self.bodies[body].set(xy=corners)
        for end, dot, name in self.joints.values():
            at = self.places[instant, end]
            dot.set_data(*at[:, None])
            name.xy = (at[0], at[1])
        for name, (arrow, force) in self.arrows.items():
            arrow.set_offsets(self.places[instant, self.joints[name][0]])
            arrow.set_UVC(*force[instant])
        self.ax.set_title(f"t = {1e3 * self.time[instant]:.2f} ms")


_NAME = {"textcoords": "offset points", "fontsize": 10, "zorder": 6}


def _moving_end(joint: Joint) -> Point:
    """Return the end of a joint that is not the frame's."""
    return joint.bore if joint.pin.body == FRAME else joint.pin


def _outlines(scene: LinkageScene, pins: list[Point]) -> tuple[dict[str, list[int]], list[Point]]:
    """Return the corners of each body, in their order round it, by their places in all points.

    `pins`, one a joint, are the first of these.
    """
    points, found = list(pins), {}
    ends = [end for joint in scene.linkage.joints.values for end in (joint.bore, joint.pin)]
    for body in scene.linkage.bodies.names:
        own = [point for point in (*ends, *scene.points.values) if point.body == body]
        corners = np.array([np.asarray(point.arm.vector().array()) for point in own])
        x, y = (corners - corners.mean(axis=0)).T
        order = np.argsort(np.arctan2(y, x), kind="stable")
        found[body] = [len(points) + int(i) for i in order]
        points += own
    return found, points


@eqx.filter_jit
def _places(
    scene: LinkageScene, points: tuple[Point, ...], times: Float[Array, " n"]
) -> list[Float[Array, "n 2"]]:
    """Return where points are at times, without what clearances shift."""

    def at(time: Scalar) -> list[Array]:
        crank = scene.drive.crank(time, None)
        motion = ideal_at_rest(scene.linkage, crank.angle)
        return [motion.position(point).array() for point in points]

    return jax.vmap(at)(times)

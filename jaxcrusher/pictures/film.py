"""A motion as one picture that moves: mechanism, magnified clearances, and force over the turn."""

from collections.abc import Sequence
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from jaxtyping import ArrayLike, Float
from matplotlib.axes import Axes
from matplotlib.ticker import MultipleLocator

from jaxcrusher.basics.checks import require
from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.motion.simulation import Trajectory
from jaxcrusher.pictures.mechanism import Drawing
from jaxcrusher.pictures.motions import force_size
from jaxcrusher.pictures.style import BLUE, ORANGE, typeset

# Inches, and the type in points: at a width of 700 pixels it is 11 pixels high.
SIZE, TYPE = (9.6, 4.4), 10.5
STYLE: dict[Any, Any] = {"font.size": TYPE, "axes.titlesize": TYPE, "legend.fontsize": TYPE}


class Film:
    """The mechanism, each magnified clearance, and a force (kN) over the angle, with a cursor.

    The motion needs what `drawn_of` names, and `force`. `ideal` is the same force with ideal
    joints, shape (times,) or (times, 2), N; None: not drawn. The angle is that of the shaft at its
    mean speed since the first time. The largest force of joints at `instants`, those that will be
    shown, sets the scale of the arrows. Raises ValueError as `Drawing` does.
    """

    def __init__(
        self,
        scene: Scene,
        motion: Trajectory,
        force: str,
        instants: Sequence[int],
        *,
        title: str,
        ideal: Float[ArrayLike, "times ..."] | None = None,
    ):
        require(force in motion.values, "motion", f"hold '{force}'", "without it")
        time = np.asarray(motion.time)
        self.angle = np.degrees(float(scene.drive.speed) * (time - time[0]))
        self.size = force_size(motion[force])
        joints = scene.joints.names
        self.figure = plt.figure(figsize=SIZE, layout="constrained")
        self.figure.suptitle(title)
        widths = [1.0, *([0.85] if joints else []), 1.3]
        rows = max(len(joints), 1)
        grid = self.figure.add_gridspec(rows, len(widths), width_ratios=widths)
        mechanism = self.figure.add_subplot(grid[:, 0])
        beside = {name: self.figure.add_subplot(grid[i, 1]) for i, name in enumerate(joints)}
        self.drawing = Drawing(scene, motion, mechanism, instants, beside)
        self._limits(mechanism, list(instants))
        mechanism.locator_params(nbins=4)
        if mechanism.get_legend() is not None:
            # Below the axis, where there is room.
            place = {"loc": "upper center", "bbox_to_anchor": (0.5, 0), "borderaxespad": 4.5}
            mechanism.legend(**place, ncols=2, frameon=False)
        self._force(self.figure.add_subplot(grid[:, -1]), scene, force, ideal)

    def _limits(self, ax: Axes, instants: list[int]) -> None:
        """Leave out the room that a crusher has for insets, and let no arrow end outside."""
        low, high = ax.get_xlim()
        left = min(corners[..., 0].min() for _, corners in self.drawing.parts)
        ax.set_xlim(max(low, left - 0.2 * (high - left)), high)
        margin = 0.05 * (high - left)
        for _, _, end, places, forces in self.drawing.arrows.values():
            away = self.drawing.metres * forces[instants] * (-1 if end == "tip" else 1)
            x, y = (places[instants] + away).T
            least, most = ax.get_xlim()
            ax.set_xlim(min(least, np.min(x) - margin), max(most, np.max(x) + margin))
            least, most = ax.get_ylim()
            ax.set_ylim(min(least, np.min(y) - margin), max(most, np.max(y) + margin))

    def _force(self, ax: Axes, scene: Scene, force: str, ideal: ArrayLike | None) -> None:
        ax.plot(self.angle, self.size, color=BLUE, linewidth=1, label="with clearance")
        if ideal is not None:
            size = force_size(ideal)
            ax.plot(self.angle, size, "--", color=ORANGE, linewidth=1.6, label="ideal joints")
            ax.legend(loc="upper center", ncols=2, columnspacing=1.0, frameon=False)
        self.cursor = ax.axvline(0, color="0.3", linewidth=1)
        (self.dot,) = ax.plot([], [], "o", color=BLUE, markeredgecolor="k")
        words = typeset(scene.observables[force].meaning)
        ax.set(xlabel="shaft angle, degrees", title=f"{words}, kN")
        ax.set(xlim=(self.angle[0], self.angle[-1]), ylim=(0, None))
        # Room for the legend.
        ax.set_ylim(top=1.1 * ax.get_ylim()[1])
        ax.xaxis.set_major_locator(MultipleLocator(90 * max(1, round(self.angle[-1] / 360))))

    def show(self, instant: int) -> None:
        """Move everything to one instant of the motion."""
        angle, size = self.angle[instant], self.size[instant]
        self.drawing.show(instant)
        self.drawing.ax.set_title(f"shaft at {angle:.0f}°")
        self.cursor.set_xdata([angle, angle])
        self.dot.set_data([angle], [size])

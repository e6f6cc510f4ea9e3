"""The mechanism in motion, as a film."""

from collections.abc import Sequence
from pathlib import Path

import matplotlib.pyplot as plt
from matplotlib.animation import AbstractMovieWriter, FFMpegWriter, HTMLWriter, PillowWriter

from jaxcrusher.basics.checks import require, require_choice, require_whole
from jaxcrusher.files.durable import writing
from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.motion.simulation import Trajectory
from jaxcrusher.pictures.mechanism import Drawing

SUFFIXES = (".gif", ".html", ".mp4")


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

    The suffix of `path` chooses: `.gif`; `.html`, one page with a player (the icons on its buttons
    come from the network); or `.mp4`, which needs ffmpeg. What is drawn: see
    `jaxcrusher.pictures.mechanism.plot_mechanism`; one scale of the arrows holds for all pictures.
    The times shown should be equally spaced.

    Raises ValueError for another suffix, for .mp4 without ffmpeg, and as `plot_mechanism` does.
    """
    path = Path(path)
    require_whole("frames_per_second", frames_per_second, 1)
    writer = _writer(path.suffix, frames_per_second)
    fig, ax = plt.subplots(figsize=(8, 6.4), layout="constrained")
    try:
        shown = range(len(trajectory.time)) if instants is None else instants
        drawing = Drawing(scene, trajectory, ax, shown)
        drawing.show(shown[0])
        # Laid out once: the pictures must not wobble.
        fig.draw_without_rendering()
        fig.set_layout_engine("none")
        # Not FuncAnimation, which draws every picture three times.
        with writing(path) as partial, writer.saving(fig, str(partial), dpi):
            for instant in shown:
                drawing.show(instant)
                writer.grab_frame()
    finally:
        plt.close(fig)


def _writer(suffix: str, frames_per_second: int) -> AbstractMovieWriter:
    require_choice("path", suffix, SUFFIXES)
    if suffix == ".gif":
        return PillowWriter(fps=frames_per_second)
    if suffix == ".html":
        # Without a limit: matplotlib drops the pictures beyond it with no more than a log line.
        return HTMLWriter(fps=frames_per_second, embed_frames=True, embed_limit=float("inf"))
    there = FFMpegWriter.isAvailable()
    require(there, "path", "end in .gif or .html where ffmpeg is not installed", suffix)
    return FFMpegWriter(fps=frames_per_second)

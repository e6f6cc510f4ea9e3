"""The paper's figures, drawn; what they show is computed elsewhere."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from cycler import cycler
from matplotlib.axes import Axes

from benchmarks.reproduction.motions import Comparison, Portrait
from benchmarks.reproduction.readings import Point
from jaxcrusher.crusher.capacity import AFFLUENCE, CrushingChamber
from jaxcrusher.files.results import write_figure
from jaxcrusher.pictures import plots
from jaxcrusher.pictures.plots import BLUE, GREEN, ORANGE

STYLE: dict[Any, Any] = {
    "font.size": 9,
    "axes.grid": True,
    "grid.alpha": 0.3,
    "grid.linewidth": 0.5,
    "axes.prop_cycle": cycler(color=[BLUE, ORANGE, GREEN]),
    "figure.dpi": 120,
}
Draw = Callable[[Axes, Portrait], None]


def draw_comparison(path: Path, turn: Comparison, begin: Comparison) -> None:
    """Draw Figure 5: `turn` settled in contact, `begin` the first impacts of the centred start."""
    figure, axes = plt.subplots(2, 2, figsize=(9, 6), layout="constrained")
    styles = ("-", "--", ":")
    for (label, (displacement, velocity)), style in zip(turn.motion.items(), styles, strict=False):
        axes[0, 0].plot(turn.time[label], 1e3 * displacement, style, label=label)
        axes[0, 1].plot(turn.time[label], velocity, style, label=label)
    for ax, run, title in (
        (axes[1, 0], turn, "(c) force at A, started in contact"),
        (axes[1, 1], begin, "(d) force at A, centred start"),
    ):
        for (label, force), style, width in zip(run.force.items(), styles, (1, 1, 2), strict=False):
            ax.plot(run.time[label], force / 1e3, style, linewidth=width, label=label)
        ax.set(xlabel="time (s)", ylabel="force at A (kN)", title=title)
    axes[0, 0].set(
        xlabel="time (s)", ylabel="displacement of B, x (mm)", title="(a) jaw displacement"
    )
    axes[0, 1].set(xlabel="time (s)", ylabel="velocity of B, x (m/s)", title="(b) jaw velocity")
    for ax in axes.flat:
        ax.legend(fontsize=8)
    write_figure(path, figure, dpi=120)


def draw_stroke(path: Path, times: np.ndarray, by_clearance: dict[float, np.ndarray]) -> None:
    """Draw Figure 7a: displacement of B (m) by clearance (mm), and its difference."""
    figure, (above, below) = plt.subplots(
        2, 1, figsize=(6, 5), sharex=True, layout="constrained", height_ratios=(2, 1)
    )
    for (clearance, values), style in zip(by_clearance.items(), ("-", "--"), strict=True):
        above.plot(times, 1e3 * values, style, label=f"{clearance:g} mm")
    first, second = by_clearance.values()
    below.plot(times, 1e6 * (second - first), color="k", linewidth=0.8)
    above.set(ylabel="displacement of B, x (mm)", title="30 rad/s")
    below.set(xlabel="time (s)", ylabel="difference (µm)")
    above.legend(title="radial clearance")
    write_figure(path, figure, dpi=120)


def draw_capacity(path: Path) -> None:
    """Draw Figure 7b, with the floor and where it is reached."""
    chamber = CrushingChamber()
    floor = float(chamber.capacity(25.0)) / AFFLUENCE
    figure, ax = plt.subplots(figsize=(6, 4), layout="constrained")
    plots.plot_capacity(chamber, np.linspace(15, 50, 200), floor, ax)
    ax.axvspan(25, 40, color=GREEN, alpha=0.12, label="the paper's range, 25 to 40 rad/s")
    ax.axvline(41.45, color="0.4", linestyle=":", label="the paper's limit, 41.45 rad/s")
    high = float(chamber.highest_speed(floor))
    ax.plot(high, floor, "o", color=ORANGE, label=f"by (21)-(25), {high:.2f} rad/s")
    ax.legend()
    write_figure(path, figure, dpi=120)


def orbit(ax: Axes, motion: Portrait) -> None:
    """Draw the pin's centre in its clearance circle."""
    angle = np.linspace(0, 2 * np.pi, 361)
    c = motion.clearance
    ax.plot(c * np.cos(angle), c * np.sin(angle), color="k", linewidth=1, label="clearance")
    ax.plot(*motion.orbit.T, color=BLUE, linewidth=0.5, label="pin centre")
    ax.set(xlabel="$e_x$ (mm)", ylabel="$e_y$ (mm)", aspect="equal")


def foundation(ax: Axes, motion: Portrait) -> None:
    """Draw the foundation force, and the ideal joint's."""
    turns = motion.turns - motion.turns[0]
    ax.plot(turns, motion.force / 1e3, color=BLUE, linewidth=0.7, label="with clearance")
    ax.plot(
        turns,
        motion.ideal_force / 1e3,
        color=ORANGE,
        linestyle="--",
        linewidth=1.2,
        label="ideal joint",
    )
    ax.set(xlabel="turns of the shaft, from the 57th", ylabel="$|R_O| + |R_C|$ (kN)")


def section(ax: Axes, motion: Portrait) -> None:
    """Draw once a turn, at theta1 = 0, the penetration, negative in flight, and its rate."""
    ax.plot(*motion.section.T, ".", color=BLUE, markersize=3, label="once a turn")
    ax.set(xlabel="penetration (µm)", ylabel="penetration rate (mm/s)")


def square(axes: np.ndarray) -> None:
    """Show orbits in a square about the origin, all of the same size."""
    orbits = [ax for ax in axes.flat if ax.get_aspect() == 1]
    reach = max((abs(end) for ax in orbits for end in ax.dataLim.extents), default=0)
    for ax in orbits:
        ax.set(xlim=(-1.05 * reach, 1.05 * reach), ylim=(-1.05 * reach, 1.05 * reach))


def draw_row(path: Path, draw: Draw, rows: dict[str, dict[Point, Portrait]]) -> None:
    """Draw one of Figures 8 to 13: a column a motion, a row a reading, the same axes in a row."""
    columns = list(next(iter(rows.values())))
    figure, axes = plt.subplots(
        len(rows),
        len(columns),
        figsize=(3 * len(columns), 2.9 * len(rows)),
        sharex="row",
        sharey="row",
        layout="constrained",
        squeeze=False,
    )
    for line, (reading, motions) in zip(axes, rows.items(), strict=True):
        for ax, (speed, clearance) in zip(line, columns, strict=True):
            draw(ax, motions[speed, clearance])
            ax.set_title(f"{speed:g} rad/s, {clearance:g} mm\n{reading}", fontsize=9)
            ax.xaxis.set_tick_params(labelbottom=True)
            if ax is not line[0]:
                ax.set_ylabel("")
        square(line)
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels))
    write_figure(path, figure, dpi=120)


def draw_landscape(path: Path, runs: xr.DataArray, settled: xr.DataArray) -> None:
    """Draw Figure 14 or 15: a force (N) over the box, of runs and of the periodic orbit.

    The runs' is drawn as the cells that it is: neighbours differ by chance as much as by design,
    and contours between them would show that chance. The periodic orbit's carries contours.
    """
    with plt.rc_context(plots.STYLE):
        figure, (cells, flat) = plt.subplots(
            1, 2, figsize=(plots.WIDTH, 3.2), sharex=True, sharey=True, layout="constrained"
        )
        kilo = [values.transpose("speed", "clearance") / 1e3 for values in (runs, settled)]
        ends = [min(float(v.min()) for v in kilo), max(float(v.max()) for v in kilo)]
        colours: dict[str, Any] = {"cmap": "cividis", "vmin": ends[0], "vmax": ends[1]}
        for ax, values in zip((cells, flat), kilo, strict=True):
            where = (1e3 * values.clearance, values.speed, values)
            mesh = ax.pcolormesh(*where, shading="nearest", **colours)
            ax.set(xlabel="clearance (mm)", facecolor="0.8")
            ax.grid(visible=False)
        # Of the last, the periodic orbit's.
        lines = flat.contour(*where, levels=8, colors="w", linewidths=0.8)
        flat.clabel(lines, fmt="%g")
        cells.set(title="centred start, turns 21 to 32", ylabel="speed (rad/s)")
        flat.set(title="periodic orbit")
        words = runs.attrs["long_name"].replace("|R_O| + |R_C|", "the foundation force")
        figure.colorbar(mesh, ax=[cells, flat], label=f"{words} (kN)")
        write_figure(path, figure)


def draw_choice(path: Path, rows: dict[str, Portrait]) -> None:
    """Draw Figure 16: orbit, force and section of the paper's choice, a row a reading."""
    figure, axes = plt.subplots(
        len(rows), 3, figsize=(10, 3 * len(rows)), layout="constrained", squeeze=False
    )
    for line, (reading, motion) in zip(axes, rows.items(), strict=True):
        for ax, draw in zip(line, (orbit, foundation, section), strict=True):
            draw(ax, motion)
            ax.legend(fontsize=7, loc="upper center", bbox_to_anchor=(0.5, -0.2), ncols=2)
        square(line)
        line[0].set_title(f"39 rad/s, 0.03 mm, {reading}", fontsize=9)
    write_figure(path, figure, dpi=120)

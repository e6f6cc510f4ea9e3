"""The figures that a search leaves behind."""

import math
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.patches import Patch

import jaxcrusher as jc
from jaxcrusher.files.results import write_figure
from jaxcrusher.pictures import page, plots
from optimize import landscape as maps
from optimize import words
from optimize.answer import Answer, Box, Confirmed
from optimize.evaluate import Case, started
from optimize.pareto import nondominated

OPTIMUM, COMPARED = ("*", "C3", 13), ("D", "C1", 8)


def draw_all(
    folder: Path,
    case: Case,
    units: np.ndarray,
    data: xr.Dataset,
    points: np.ndarray,
    orbits: xr.Dataset | None,
    answer: Answer,
) -> list[str]:
    """Every figure that the design's parameters allow; returns the names of their files.

    `data` is the landscape of `units` from both starts, `orbits` the settled motions of `points`.
    """
    drawn = ["pareto.png", "motion.png"]
    if "speed" in case.design.names:
        draw_capacity(folder, case, answer.box)
        drawn.insert(0, "capacity.png")
    if len(case.design.names) == 2:
        draw_starts(folder, answer, data)
        drawn.insert(0, "starts.png")
        if orbits is not None:
            draw_settled(folder, answer, orbits)
            draw_settling(folder, answer, orbits)
            drawn = ["landscape.png", "settling.png", *drawn]
    if orbits is not None and orbits.counts.any():
        draw_pareto(folder, case, points, orbits, answer)
    else:
        draw_pareto(folder, case, units, data, answer)
    draw_motions(folder, case, answer)
    return drawn


def draw_settled(folder: Path, answer: Answer, orbits: xr.Dataset) -> None:
    """Map of the settled motions' objective, with descents and designs."""
    fig, ax = plt.subplots(figsize=(7, 4.8), layout="constrained")
    values = orbits.objective.where(orbits.stable)
    plots.plot_landscape(values, ax, units=answer.box.units)
    _mark(ax, answer, descents=True, open_cells=not bool(orbits.stable.all()))
    write_figure(folder / "landscape.png", fig)


def draw_settling(folder: Path, answer: Answer, orbits: xr.Dataset) -> None:
    """Map of the turns in which a disturbance of the settled motion falls to 1/e."""
    fig, ax = plt.subplots(figsize=(7, 4.8), layout="constrained")
    turns, units = orbits.settling_turns.where(orbits.stable), answer.box.units
    across, up = plots.axes_of(turns.dims)
    mesh = ax.pcolormesh(
        words.shown(across, orbits[across].to_numpy(), units),
        words.shown(up, orbits[up].to_numpy(), units),
        turns.transpose(up, across),
        cmap="viridis",
        norm="log",
        shading="nearest",
    )
    fig.colorbar(mesh, ax=ax, label="turns in which a disturbance falls to 1/e")
    plots.label_axes(ax, across, up, units)
    _mark(ax, answer, open_cells=not bool(orbits.stable.all()))
    write_figure(folder / "settling.png", fig)


def draw_starts(folder: Path, answer: Answer, data: xr.Dataset) -> None:
    """Map of the first turns' time average from the worse start, with what moves how."""
    fig, ax = plt.subplots(figsize=(7, 4.8), layout="constrained")
    marks = {
        "failed": ~data.success.all("start"),
        "whirl": data.whirl.any("start"),
        "outside the contact model": ~data.inside_model.all("start"),
    }
    plots.plot_landscape(maps.worst(data), ax, marks=marks, units=answer.box.units)
    _mark(ax, answer)
    write_figure(folder / "starts.png", fig)


def _mark(ax: Axes, answer: Answer, *, descents: bool = False, open_cells: bool = False) -> None:
    """Descents, optimum and the design to compare with, added to the legend."""
    handles, labels = [], []
    legend = ax.get_legend()
    if legend is not None:
        handles = [handle for handle in legend.legend_handles if handle is not None]
        labels = [text.get_text() for text in legend.get_texts()]
    if open_cells:
        handles.append(Patch(facecolor="0.6", edgecolor="w"))
        labels.append("no stable settled motion found")
    names, units = plots.axes_of(answer.box.bounds), answer.box.units
    for i, descent in enumerate(answer.refinement if descents else ()):
        path = (words.shown(name, np.asarray(descent.path[name]), units) for name in names)
        (line,) = ax.plot(*path, "w.-", linewidth=0.8, markersize=2)
        if i == 0:
            handles, labels = [*handles, line], [*labels, "descents"]
    for title, design in answer.designs.items():
        marker, colour, size = OPTIMUM if title == "optimum" else COMPARED
        (mark,) = ax.plot(
            *(words.shown(name, design.values[name], units) for name in names),
            marker,
            color=colour,
            markersize=size,
            markeredgecolor="w",
            linestyle="",
            clip_on=False,
        )
        handles, labels = [*handles, mark], [*labels, title]
    ax.legend(
        handles,
        labels,
        loc="lower center",
        bbox_to_anchor=(0.5, 1.0),
        ncols=3,
        facecolor="0.8",
        fontsize=9,
    )


def draw_capacity(folder: Path, case: Case, box: Box) -> None:
    """Capacity over speed, with the box searched."""
    low, high = box.bounds["speed"]
    fig, ax = plt.subplots(figsize=(6, 4), layout="constrained")
    speeds = np.linspace(0.6 * low, 1.25 * high, 200)
    plots.plot_capacity(case.chamber, speeds, box.capacity_floor, ax)
    ax.axvspan(low, high, color="C2", alpha=0.15, label="box searched")
    reached = box.derived_speed[1]
    if math.isfinite(reached):
        ax.axvline(
            reached, color="0.4", linestyle=":", label=f"floor reached at {reached:.2f} rad/s"
        )
    ax.legend()
    write_figure(folder / "capacity.png", fig)


def draw_pareto(
    folder: Path, case: Case, units: np.ndarray, data: xr.Dataset, answer: Answer
) -> None:
    """RMS against capacity and against the peak at the points of a map, and the designs among them.

    The front is what no other point beats in both.

    `data` is the map of settled motions, or the landscape, whose worse start counts.
    """
    names, capacity = ("foundation_rms", "foundation_peak"), case.capacity(units)
    if "start" in data.dims:
        worse, motion = data[[*names, "counts"]].max("start"), "worse start"
        counts = data.counts.all("start")
    else:
        worse, counts, motion = data, data.counts, "settled"
    columns = {name: worse[name].where(counts).to_numpy().ravel() / 1e3 for name in names}
    rms, peak = columns.values()
    with plt.rc_context(page.STYLE):
        fig, axes = plt.subplots(1, 2, figsize=(page.WIDTH, 3.4), layout="constrained")
        for ax, other, sign, label in (
            (axes[0], capacity, -1.0, "capacity (m³/h)"),
            (axes[1], peak, 1.0, "peak of the foundation force (kN)"),
        ):
            front = nondominated(np.stack([rms, sign * other], axis=-1))
            ax.plot(rms, other, "o", color="0.7", markersize=3, label="points of the map")
            order = np.flatnonzero(front)[np.argsort(rms[front])]
            ax.plot(rms[order], other[order], "s-", color="C0", markersize=7, label="front")
            ax.set(xlabel=f"RMS of the foundation force, {motion} (kN)", ylabel=label)
        for title, design in answer.designs.items():
            least, highest = _forces(design, "start" in data.dims)
            marker, colour, size = OPTIMUM if title == "optimum" else COMPARED
            for ax, value in zip(axes, (design.capacity, highest), strict=True):
                ax.plot(
                    least,
                    value,
                    marker,
                    color=colour,
                    markersize=size,
                    markeredgecolor="k",
                    markeredgewidth=0.6,
                    linestyle="",
                    label=title,
                    zorder=3,
                )
        fig.legend(*axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=4)
        write_figure(folder / "pareto.png", fig)


def _forces(design: Confirmed, transient: bool) -> tuple[float, float]:
    """RMS and peak (kN) of the worse start's first run, or of the settled motion; NaN if none."""
    if transient:
        runs = design.transient.values()
        rms, peak = (
            max(one.first(name) for one in runs) for name in ("foundation_rms", "foundation_peak")
        )
        return rms / 1e3, peak / 1e3
    if design.settled is None:
        return math.nan, math.nan
    return design.settled.foundation_rms / 1e3, design.settled.foundation_peak / 1e3


def draw_motions(folder: Path, case: Case, answer: Answer) -> None:
    """Orbit and foundation force of optimum and its rival after their long runs."""
    fig, axes = plt.subplots(
        2,
        2 * len(answer.designs),
        figsize=(6.2 * len(answer.designs), 6),
        layout="constrained",
        gridspec_kw={"width_ratios": [1, 1.5] * len(answer.designs)},
        squeeze=False,
    )
    for column, (title, design) in enumerate(answer.designs.items()):
        described: dict[str, Any] = {**case.design.fixed, **design.values}
        speed, clearance = design.speed, design.clearance
        times = 2 * np.pi / speed * np.linspace(0, 2, 4001)
        outputs = ("foundation_force", "eccentricity")
        ideal = jc.simulate(jc.build_scene(described).ideal(), times, outputs=outputs)
        for row, (start, runs) in enumerate(design.transient.items()):
            scene = started(described, start)
            motion = jc.simulate(scene, times, outputs=outputs, state=runs.state, rtol=1e-9)
            orbit, force = axes[row, 2 * column : 2 * column + 2]
            plots.plot_orbit(motion, clearance, orbit)
            plots.plot_force(motion, ideal, force)
            orbit.set_title(f"{title}, start {start}", fontsize=10)
            force.set_title(f"{speed:.2f} rad/s, {1e3 * clearance:.3f} mm", fontsize=10)
    forces = axes[:, 1::2].ravel()
    top = max(ax.get_ylim()[1] for ax in forces)
    for ax in forces:
        ax.set_ylim(0, top)
        ax.legend(loc="lower right", fontsize=8)
    write_figure(folder / "motion.png", fig)

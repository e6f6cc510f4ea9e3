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
from jaxcrusher.crusher.capacity import CrushingChamber
from jaxcrusher.files.results import write_figure
from jaxcrusher.motion.simulation import leading_force
from jaxcrusher.pictures import mechanism, plots
from jaxcrusher.scenes.units import said, unit_of
from optimize.answer import Answer, Confirmed
from optimize.ask.problem import Problem
from optimize.search.front import nondominated
from optimize.search.landscape import worst
from optimize.search.motions import design_motions
from optimize.tell.forces import name_of
from optimize.tell.words import shown

OPTIMUM = {"marker": "*", "color": "C3", "markersize": 13, "linestyle": ""}
COMPARED = {"marker": "D", "color": "C1", "markersize": 8, "linestyle": ""}


def draw_all(folder: Path, answer: Answer) -> tuple[list[str], dict[str, str]]:
    """Draw every figure that the design's parameters allow and that has something to show.

    Returns the names of the files, and why others were left out, by name.
    """
    problem, maps = answer.problem, answer.maps
    assert maps is not None
    drawn, omitted = [], {}
    data, orbits = maps.landscape, maps.orbits
    if len(problem.design.names) == 2:
        if maps.stable_orbits:
            assert orbits is not None
            draw_orbits(folder, answer, orbits)
            draw_settling(folder, answer, orbits)
            drawn += ["landscape.png", "settling.png"]
        elif orbits is not None:
            why = "no point of the map has a stable orbit of one turn"
            omitted |= {"landscape.png": why, "settling.png": why}
        draw_starts(folder, answer, data)
        drawn.append("starts.png")
    if "speed" in problem.design.names and problem.chamber is not None:
        draw_capacity(folder, problem.chamber, problem)
        drawn.append("capacity.png")
    if answer.fronts and all(len(front.objective) == 1 for front in answer.fronts):
        higher = "" if problem.chamber is None else "a higher capacity than the optimum, nor "
        omitted["pareto.png"] = (
            f"nothing has to be traded, because no point of the map has {higher}a lower "
            f"{name_of(problem.rival.meaning)}{'' if higher else ' than the optimum'}"
        )
    elif maps.counting_orbits is not None:
        draw_pareto(folder, problem, maps.points, maps.counting_orbits, answer)
        drawn.append("pareto.png")
    elif data.counts.all("start").any():
        draw_pareto(folder, problem, maps.cells, data, answer)
        drawn.append("pareto.png")
    else:
        omitted["pareto.png"] = "no point of the maps may be chosen"
    draw_motions(folder, problem, answer)
    drawn.append("motion.png")
    if answer.optimum is not None and problem.chamber is not None:
        draw_bearings(folder, problem, answer.optimum)
        drawn.append("bearings.png")
    return drawn, omitted


def draw_orbits(folder: Path, answer: Answer, orbits: xr.Dataset) -> None:
    """Draw the map of the objective on periodic orbits, with descents and designs."""
    fig, ax = plt.subplots(figsize=(7, 4.8), layout="constrained")
    stable = _looks_stable(orbits)
    plots.plot_landscape(orbits.objective.where(stable), ax, units=answer.problem.units)
    _mark(ax, answer, descents=True, open_cells=not bool(stable.all()))
    write_figure(folder / "landscape.png", fig)


def draw_settling(folder: Path, answer: Answer, orbits: xr.Dataset) -> None:
    """Draw the map of the turns in which a disturbance of the orbit falls to 1/e."""
    fig, ax = plt.subplots(figsize=(7, 4.8), layout="constrained")
    stable = _looks_stable(orbits)
    turns, units = orbits.settling_turns.where(stable), answer.problem.units
    across, up = plots.axes_of(turns.dims)
    mesh = ax.pcolormesh(
        shown(across, orbits[across].to_numpy(), units),
        shown(up, orbits[up].to_numpy(), units),
        turns.transpose(up, across),
        cmap="viridis",
        norm="log",
        shading="nearest",
    )
    fig.colorbar(mesh, ax=ax, label="turns in which a disturbance falls to 1/e")
    plots.label_axes(ax, across, up, units)
    _mark(ax, answer, open_cells=not bool(stable.all()))
    write_figure(folder / "settling.png", fig)


def _looks_stable(orbits: xr.Dataset) -> xr.DataArray:
    """Tell where disturbances die, or die within what the nodes leave in doubt."""
    return np.isfinite(orbits.settling_turns)


def draw_starts(folder: Path, answer: Answer, data: xr.Dataset) -> None:
    """Draw the map of the first turns' time average from the worse start, with marks."""
    fig, ax = plt.subplots(figsize=(7, 4.8), layout="constrained")
    marks = {
        "failed": ~data.success.all("start"),
        "whirl": data.whirl.any("start"),
        "outside the contact model": ~data.inside_model.all("start"),
    }
    plots.plot_landscape(worst(data), ax, marks=marks, units=answer.problem.units)
    _mark(ax, answer)
    write_figure(folder / "starts.png", fig)


def _mark(ax: Axes, answer: Answer, *, descents: bool = False, open_cells: bool = False) -> None:
    """Mark descents, optimum and the design to compare with, and add them to the legend."""
    legend = ax.get_legend()
    handles: list[Any] = [] if legend is None else list(legend.legend_handles)
    if open_cells:
        label = "no stable periodic orbit found"
        handles.append(Patch(facecolor="0.6", edgecolor="w", label=label))
    names, units = plots.axes_of(answer.problem.design.bounds), answer.problem.units
    for i, descent in enumerate(answer.refinement if descents else ()):
        path = (shown(name, np.asarray(descent.path[name]), units) for name in names)
        lines = ax.plot(*path, "w.-", linewidth=0.8, markersize=2, label="descents")
        handles += lines if i == 0 else []
    for title, design in answer.designs.items():
        handles += ax.plot(
            *(shown(name, design.values[name], units) for name in names),
            **_marker(title),
            markeredgecolor="w",
            clip_on=False,
            label=title,
        )
    place = {"loc": "lower center", "bbox_to_anchor": (0.5, 1.0), "ncols": 3}
    ax.legend(handles=handles, facecolor="0.8", fontsize=9, **place)


def _marker(title: str) -> dict[str, Any]:
    return OPTIMUM if title == "optimum" else COMPARED


def draw_capacity(folder: Path, chamber: CrushingChamber, problem: Problem) -> None:
    """Draw the capacity over speed, with the box searched."""
    low, high = problem.design.bounds["speed"]
    fig, ax = plt.subplots(figsize=(6, 4), layout="constrained")
    speeds = np.linspace(0.6 * low, 1.25 * high, 200)
    plots.plot_capacity(chamber, speeds, problem.capacity_floor, ax, units=problem.units)
    unit, one = unit_of("speed", problem.units)
    ax.axvspan(low / one, high / one, color="C2", alpha=0.15, label="box searched")
    reached = float(chamber.highest_speed(problem.capacity_floor)) / one
    if math.isfinite(reached):
        label = f"floor reached at {reached:.4g} {unit}"
        ax.axvline(reached, color="0.4", linestyle=":", label=label)
    ax.legend()
    write_figure(folder / "capacity.png", fig)


def draw_pareto(
    folder: Path, problem: Problem, units: np.ndarray, data: xr.Dataset, answer: Answer
) -> None:
    """Draw the objective against a crusher's capacity and the rival, at a map's points and designs.

    `data` is the map of orbits, whose fronts the answer has, or the landscape, whose
    worse start counts: its front is what no other point beats in both.
    """
    transient = "start" in data.dims
    force = problem.rival
    (statistic,) = force.outputs
    worse = data[["objective", statistic]].max("start") if transient else data
    counts = data.counts.all("start") if transient else data.counts
    objective, forces = (
        worse[name].where(counts).to_numpy().ravel() for name in ("objective", statistic)
    )
    kilo, unit = (
        (1e3, "kN")
        if answer.problem.objective.unit == "N"
        else (1.0, answer.problem.objective.unit)
    )
    of_axes = [(forces, 1.0, 1e3, f"{force.meaning} (kN)")]
    if problem.chamber is not None:
        of_axes.insert(0, (problem.capacity(units), -1.0, 1.0, "capacity (m³/h)"))
    with plt.rc_context(plots.STYLE):
        fig, axes = plt.subplots(
            1, len(of_axes), figsize=(plots.WIDTH, 3.4), layout="constrained", squeeze=False
        )
        axes = axes.ravel()
        for k, (ax, (column, sign, one, heading)) in enumerate(zip(axes, of_axes, strict=True)):
            dots = objective / kilo, column / one
            ax.plot(*dots, "o", color="0.7", markersize=3, label="points of the map")
            if answer.fronts:
                line = answer.fronts[k].objective, answer.fronts[k].other
            else:
                of_map = np.flatnonzero(nondominated(np.stack([objective, sign * column], axis=-1)))
                order = of_map[np.argsort(objective[of_map])]
                line = objective[order], column[order]
            size = 4 if len(line[0]) > 1 else 7
            if len(line[0]) == 1:
                ax.set_title("nothing to trade", fontsize=8)
            ax.plot(line[0] / kilo, line[1] / one, "s-", color="C0", markersize=size, label="front")
            meaning = "worse start" if transient else "periodic orbit"
            ax.set_xlabel(f"{answer.problem.objective.meaning}, {meaning} ({unit})")
            ax.set_ylabel(heading)
        for title, design in answer.designs.items():
            least, highest = _numbers(design, statistic, transient)
            crushing = design.crushing
            values = [highest / 1e3] if crushing is None else [crushing.capacity, highest / 1e3]
            for ax, value in zip(axes, values, strict=True):
                ax.plot(
                    least / kilo,
                    value,
                    **_marker(title),
                    markeredgecolor="k",
                    markeredgewidth=0.6,
                    label=title,
                    zorder=3,
                )
        for ax in axes:
            _zoom_to_front(ax)
        fig.legend(*axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=4)
        write_figure(folder / "pareto.png", fig)


def _zoom_to_front(ax: Axes) -> None:
    """Leave out the points of the map that lie far from a front of several points."""
    _, front, *designs = ax.lines
    shown = np.concatenate([line.get_xydata() for line in (front, *designs)])
    if np.size(front.get_xdata()) > 1:
        low, high = np.nanmin(shown, axis=0), np.nanmax(shown, axis=0)
        margin = 0.1 * (high - low)
        ax.set(xlim=(low[0] - margin[0], high[0] + margin[0]))
        ax.set(ylim=(low[1] - margin[1], high[1] + margin[1]))


def _numbers(design: Confirmed, statistic: str, transient: bool) -> tuple[float, float]:
    """Return objective and a statistic of the worse start's first run, or of the orbit."""
    if transient:
        runs = design.transient.values()
        one, two = (max(run.first(name) for run in runs) for name in ("objective", statistic))
        return one, two
    if design.orbit is None:
        return math.nan, math.nan
    return design.orbit.objective, float(design.orbit.solution[statistic])


def draw_bearings(folder: Path, problem: Problem, design: Confirmed) -> None:
    """Draw where the frame carries the machine, at O and C, when the toggle presses hardest."""
    scene = problem.design.build(problem.design.described(design.values)).ideal()
    times = 2 * np.pi / design.speed * np.linspace(0, 1, 73)
    turn = jc.simulate(scene, times, outputs=mechanism.DRAWN)
    hardest = int(np.argmax(np.linalg.norm(turn["toggle_reaction"], axis=1)))
    fig, ax = plt.subplots(figsize=(4.2, 4.8), layout="constrained")
    mechanism.plot_mechanism(scene, turn, hardest, ax)
    # Without loose joints nothing stands on the left.
    ax.set(title="", xlim=(0.5 * ax.get_xlim()[0], ax.get_xlim()[1]))
    write_figure(folder / "bearings.png", fig)


def draw_motions(folder: Path, problem: Problem, answer: Answer) -> None:
    """Draw the pin's path and the leading force of both designs after their long runs."""
    fig, axes = plt.subplots(
        2,
        2 * len(answer.designs),
        figsize=(6.2 * len(answer.designs), 6),
        layout="constrained",
        gridspec_kw={"width_ratios": [1, 1.5] * len(answer.designs)},
        squeeze=False,
    )
    turns = np.linspace(0, 2, 4001)
    motions = design_motions(problem, list(answer.designs.values()), turns)
    for column, (title, design) in enumerate(answer.designs.items()):
        scene = problem.design.build(problem.design.described(design.values))
        joint, clearance = scene.joints.names[0], float(scene.joints.values[0].clearance)
        of_speed = said("speed", design.speed, answer.problem.units)
        times = 2 * np.pi / design.speed * turns
        ideal = jc.simulate(scene.ideal(), times, outputs=(leading_force(scene),))
        for row, (start, motion) in enumerate(motions[column].items()):
            orbit, force = axes[row, 2 * column : 2 * column + 2]
            plots.plot_orbit(motion, clearance, orbit, prefix=scene.prefix(joint))
            plots.plot_force(motion, ideal, force)
            orbit.set_title(f"{title}, start {start}", fontsize=10)
            force.set_title(f"{of_speed}, {1e3 * clearance:.3f} mm", fontsize=10)
    forces = axes[:, 1::2].ravel()
    top = max(ax.get_ylim()[1] for ax in forces)
    for ax in forces:
        ax.set_ylim(0, top)
        ax.legend(loc="lower right", fontsize=8)
    write_figure(folder / "motion.png", fig)

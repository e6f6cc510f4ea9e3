"""The figures of a search, as SVG whose text and axes have the colour of the page around them."""

import io
import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh
from matplotlib.figure import Figure

import jaxcrusher as jc
from jaxcrusher.files.results import write_text
from jaxcrusher.files.text import prefixed, quantity
from jaxcrusher.motion.simulation import headline_force
from jaxcrusher.pictures import mechanism, plots
from jaxcrusher.scenes.parameters import in_words
from jaxcrusher.scenes.units import said, unit_of
from optimize.answer import Answer, Confirmed, Front, Refinement
from optimize.ask.constraints import may_be_stable
from optimize.ask.problem import DesignProblem
from optimize.search.evaluate import started
from optimize.search.landscape import worst
from optimize.search.orbits import unsolvable
from optimize.tell.words import name_of, shown

OPTIMUM = {"marker": "*", "color": "C3", "markersize": 13, "linestyle": ""}
COMPARED = {"marker": "D", "color": "C1", "markersize": 8, "linestyle": ""}
# A colour that nothing else has. Lines of this colour get the text colour of the page.
INK = "#010203"
_INKED = ("text.color", "axes.edgecolor", "axes.labelcolor", "xtick.color", "ytick.color")
_CLEAR = ("figure.facecolor", "axes.facecolor", "savefig.facecolor", "legend.facecolor")
STYLE: dict[Any, Any] = {
    **plots.STYLE,
    **dict.fromkeys(_INKED, INK),
    **dict.fromkeys(_CLEAR, "none"),
    "legend.frameon": False,
    "svg.fonttype": "none",
}
# Width and height (inches) of a picture beside a table, and of a map.
NARROW, MAP = (4.3, 2.25), (6.2, 4.3)
ABOVE: dict[str, Any] = {"loc": "lower center", "bbox_to_anchor": (0.5, 1.0)}
# Tolerance of the drawn motion of a design without an orbit.
FINE = 1e-9


@mpl.rc_context(STYLE)
def draw_all(folder: Path, answer: Answer) -> tuple[list[str], dict[str, str]]:
    """Draw every figure that the free parameters and the results of the search allow.

    Returns the names of the files, and the reasons for omitted figures, by name.
    """
    problem, maps = answer.problem, answer.maps
    assert maps is not None
    drawn, omitted = ["motion.svg"], {}
    draw_motions(folder, answer)
    orbits, best, free = maps.orbits, answer.optimum, len(problem.design.names)
    if orbits is None:
        why = unsolvable(problem)
        must = f"a scene with orbits to solve for must {why}"
        omitted["map"] = must if why else "no design of the box keeps contact"
    elif not maps.stable_orbits:
        why = "no point of the map has a stable orbit of one turn"
        omitted |= dict.fromkeys(("curve.svg", "orbits.svg", "settling.svg"), why)
    elif free <= 2:
        if best is not None:
            draw_curve(folder, answer, best, orbits)
            drawn.append("curve.svg")
        if free == 2:
            draw_orbits(folder, answer, orbits)
            drawn += ["orbits.svg", "settling.svg"]
    else:
        omitted["curve.svg"] = f"the map has no lines, because {free} numbers are free"
    if free == 2:
        draw_landscape(folder, answer, maps.landscape)
        drawn.append("landscape.svg")
    if "speed" in problem.design.names and problem.chamber is not None:
        draw_capacity(folder, problem)
        drawn.append("capacity.svg")
    if any(len(front.objective) > 1 for front in answer.fronts):
        draw_fronts(folder, answer)
        drawn.append("pareto.svg")
    else:
        omitted["pareto.svg"] = _no_front(answer)
    if best is not None and problem.chamber is not None:
        draw_bearings(folder, problem, best)
        drawn.append("bearings.svg")
    return drawn, omitted


def _no_front(answer: Answer) -> str:
    """Say why there is no front of several points, or why it is not known."""
    problem, maps = answer.problem, answer.maps
    if answer.fronts:
        higher = "" if problem.chamber is None else "a higher capacity than the optimum, nor "
        return (
            f"nothing has to be traded, because no point of the map has {higher}a lower "
            f"{name_of(problem.rival.meaning)}{'' if higher else ' than the optimum'}"
        )
    if maps is None or maps.counting_orbits is None or answer.optimum is None:
        return "there is no periodic orbit that may be chosen"
    return "the optimum is not known to come to its periodic orbit"


def write_figure(path: Path, figure: Figure) -> None:
    """Write a figure as SVG in which `INK` becomes `currentColor`, and close the figure.

    Meshes become pixels: as paths they would show seams and be large. Only those ids of elements
    are kept that the picture refers to, and no two pictures share an id.
    """
    for ax in figure.axes:
        for mesh in ax.collections:
            mesh.set_rasterized(isinstance(mesh, QuadMesh))
    written = io.StringIO()
    with plt.rc_context({"svg.hashsalt": path.name}):
        figure.savefig(written, format="svg", dpi=110, metadata={"Date": None})
    plt.close(figure)
    text = re.sub(r"<metadata>.*?</metadata>", "", written.getvalue(), flags=re.S)
    text = re.sub(r"<style[^>]*>.*?</style>", "", text, flags=re.S).replace(INK, "currentColor")
    named = {*re.findall(r"[\"(]#([^\")]+)", text)}
    text = re.sub(r' id="([^"]+)"', lambda one: one[0] if one[1] in named else "", text)
    text = re.sub(r" +(?=\n)|(?<=\n) +", "", text)
    write_text(path, text.replace("<svg ", '<svg color="#1b1b1b" stroke-linejoin="round" ', 1))


def line_of_map(orbits: xr.Dataset, values: dict[str, float]) -> xr.Dataset:
    """Return the row or column of a map next to a design on which the objective varies most."""
    dims = [str(name) for name in orbits.objective.dims]
    lines = []
    for name in dims:
        others = {other: values[other] for other in dims if other != name}
        lines.append(orbits.sel(others, method="nearest"))
    changes = [float(line.objective.max() - line.objective.min()) for line in lines]
    return lines[int(np.nanargmax(changes))]


def draw_curve(folder: Path, answer: Answer, best: Confirmed, orbits: xr.Dataset) -> None:
    """Draw the objective over the parameter that changes it most, and that of ideal joints."""
    units, sought = answer.problem.units, answer.problem.objective
    known = orbits.objective.where(may_be_stable(orbits))
    line = line_of_map(orbits.assign(objective=known), best.values)
    ideal = line.ideal_objective.to_numpy()
    (name,) = line.objective.dims
    x, y = shown(str(name), line[name].to_numpy(), units), line.objective.to_numpy()
    one, unit = prefixed(float(np.nanmax(np.abs(y))), sought.unit)
    fig, ax = plt.subplots(figsize=NARROW, layout="constrained")
    ax.plot(x, y / one, "o-", color=plots.BLUE, linewidth=2.5, markersize=4, label="with clearance")
    if np.isfinite(ideal).any():
        ax.plot(x, ideal / one, "--", color=plots.ORANGE, label="ideal joints")
        share = "what the contact adds"
        ax.fill_between(x, ideal / one, y / one, color=plots.BLUE, alpha=0.25, lw=0, label=share)
    at = shown(str(name), best.values[str(name)], units)
    ax.plot(at, best.objective / one, **_marker("optimum"), label="optimum", clip_on=False)
    # The point of the map next to the optimum gives the contribution of the contact.
    near = int(np.nanargmin(np.abs(x - at)))
    adds = y[near] - ideal[near]
    told = [
        f"at {in_words(other)} {said(other, float(line[other]), units)}"
        for other in best.values
        if other != name
    ]
    told += [f"the contact adds {quantity(adds, sought.unit)} at the star"] * bool(adds == adds)
    of_unit = unit_of(str(name), units)[0]
    ax.set(
        title="\n".join(told),
        xlabel=f"{in_words(str(name))} ({of_unit})" if of_unit else in_words(str(name)),
        ylabel=f"{sought.meaning} ({unit})",
    )
    ax.legend()
    write_figure(folder / "curve.svg", fig)


def draw_orbits(folder: Path, answer: Answer, orbits: xr.Dataset) -> None:
    """Draw maps of the objective on periodic orbits, with descents, and of their settling time."""
    # Disturbances decay, or may decay within the error of the multipliers.
    stable = np.isfinite(orbits.settling_turns)
    marks = {"no stable periodic orbit found": ~stable}
    objective, turns = orbits.objective.where(stable), orbits.settling_turns.where(stable)
    draw_map(folder / "orbits.svg", answer, objective, marks, descents=answer.refinement)
    draw_map(folder / "settling.svg", answer, turns, marks, norm="log")


def draw_landscape(folder: Path, answer: Answer, data: xr.Dataset) -> None:
    """Draw the map of the time average over the first turns, from the worse start."""
    marks = {
        "failed": ~data.success.all("start"),
        "whirl": data.whirl.any("start"),
        "outside the contact model": ~data.inside_model.all("start"),
    }
    draw_map(folder / "landscape.svg", answer, worst(data), marks)


def draw_map(
    path: Path,
    answer: Answer,
    values: xr.DataArray,
    marks: Mapping[str, xr.DataArray],
    *,
    descents: Sequence[Refinement] = (),
    norm: str = "linear",
) -> None:
    """Draw a map over the two free parameters with hatched cells, descents and designs."""
    fig, ax = plt.subplots(figsize=MAP, layout="constrained")
    names, units = plots.axes_of(answer.problem.design.bounds), answer.problem.units
    plots.plot_landscape(values, ax, marks=marks, units=units, norm=norm)
    hatched = ax.get_legend()
    handles: list[Any] = [] if hatched is None else list(hatched.legend_handles)
    for i, descent in enumerate(descents):
        line = (shown(name, np.asarray(descent.path[name]), units) for name in names)
        lines = ax.plot(*line, "w.-", linewidth=0.8, markersize=2, label="descents")
        handles += lines if i == 0 else []
    for title, design in answer.designs.items():
        handles += ax.plot(
            *(shown(name, design.values[name], units) for name in names),
            **_marker(title),
            markeredgecolor="w",
            clip_on=False,
            label=title,
        )
    # White lines need a grey background.
    ax.legend(handles=handles, frameon=True, facecolor="0.6", labelcolor="k", ncols=3, **ABOVE)
    write_figure(path, fig)


def _marker(title: str) -> dict[str, Any]:
    return OPTIMUM if title == "optimum" else COMPARED


def draw_capacity(folder: Path, problem: DesignProblem) -> None:
    """Draw a crusher's capacity over the speed, with the searched range."""
    chamber = problem.chamber
    assert chamber is not None
    low, high = problem.design.bounds["speed"]
    fig, ax = plt.subplots(figsize=NARROW, layout="constrained")
    speeds = np.linspace(0.6 * low, 1.25 * high, 200)
    plots.plot_capacity(chamber, speeds, problem.capacity_floor, ax, units=problem.units)
    unit, one = unit_of("speed", problem.units)
    ax.axvspan(low / one, high / one, color="C2", alpha=0.15, label="box searched")
    reached = float(chamber.highest_speed(problem.capacity_floor)) / one
    if math.isfinite(reached):
        label = f"floor reached at {reached:.4g} {unit}"
        ax.axvline(reached, color="0.5", linestyle=":", label=label)
    ax.legend(ncols=2, **ABOVE)
    write_figure(folder / "capacity.svg", fig)


def draw_fronts(folder: Path, answer: Answer) -> None:
    """Draw the fronts of the answer, the points of the map that count, and the designs."""
    problem, maps, fronts = answer.problem, answer.maps, answer.fronts
    assert maps is not None and maps.counting_orbits is not None
    orbits = maps.counting_orbits.where(maps.counting_orbits.counts)
    objective = orbits.objective.to_numpy().ravel()
    one, unit = prefixed(float(np.nanmax(np.abs(objective))), problem.objective.unit)
    whole = (plots.WIDTH, 3.4)
    fig, axes = plt.subplots(1, len(fronts), figsize=whole, layout="constrained", squeeze=False)
    for ax, front in zip(axes.ravel(), fronts, strict=True):
        crushes = front.of == "capacity"
        of_map = problem.capacity(maps.points) if crushes else orbits[front.of].to_numpy().ravel()
        other, other_unit = prefixed(float(np.nanmax(np.abs(of_map))), front.unit)
        dots = objective / one, of_map / other
        ax.plot(*dots, "o", color="0.6", markersize=3, label="points of the map")
        size = 4 if len(front.objective) > 1 else 7
        line = front.objective / one, front.other / other
        ax.plot(*line, "s-", color="C0", markersize=size, label="front")
        if len(front.objective) == 1:
            ax.set_title("nothing to trade")
        for title, design in answer.designs.items():
            at = _on_front(design, front)
            ax.plot(at[0] / one, at[1] / other, **_marker(title), label=title, zorder=3)
        ax.set(xlabel=f"{problem.objective.meaning} ({unit})")
        ax.set(ylabel=f"{front.meaning} ({other_unit.replace('m3', 'm³')})")
        _zoom_to_front(ax)
    fig.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside upper center", ncols=4)
    write_figure(folder / "pareto.svg", fig)


def _on_front(design: Confirmed, front: Front) -> tuple[float, float]:
    """Return both numbers of a front on the orbit of a design; NaN without an orbit."""
    if design.orbit is None:
        return math.nan, math.nan
    if design.crushing is not None and front.of == "capacity":
        return design.orbit.objective, design.crushing.capacity
    return design.orbit.objective, float(design.orbit.solution[front.of])


def _zoom_to_front(ax: Axes) -> None:
    """Limit the axes to the designs and a front of several points."""
    _, front, *designs = ax.lines
    shown = np.concatenate([line.get_xydata() for line in (front, *designs)])
    if np.size(front.get_xdata()) > 1:
        low, high = np.nanmin(shown, axis=0), np.nanmax(shown, axis=0)
        margin = 0.1 * (high - low)
        ax.set(xlim=(low[0] - margin[0], high[0] + margin[0]))
        ax.set(ylim=(low[1] - margin[1], high[1] + margin[1]))


def draw_bearings(folder: Path, problem: DesignProblem, design: Confirmed) -> None:
    """Draw the mechanism and its bearings O and C at the instant of the largest toggle force."""
    scene = problem.design.build(problem.design.completed(design.values)).ideal()
    times = 2 * np.pi / design.speed * np.linspace(0, 1, 73)
    turn = jc.simulate(scene, times, outputs=mechanism.DRAWN)
    hardest = int(np.argmax(np.linalg.norm(turn["toggle_reaction"], axis=1)))
    # The mechanism has the colours of a drawing on paper.
    with plt.rc_context(dict.fromkeys(_CLEAR, "w") | dict.fromkeys(_INKED, "k")):
        fig, ax = plt.subplots(figsize=(4.2, 4.8), layout="constrained")
        mechanism.plot_mechanism(scene, turn, hardest, ax)
        # Without loose joints the left part of the picture is empty.
        ax.set(title="", xlim=(0.5 * ax.get_xlim()[0], ax.get_xlim()[1]))
        write_figure(folder / "bearings.svg", fig)


def draw_motions(folder: Path, answer: Answer) -> None:
    """Draw the path of the first loose pin and the headline force of both designs over two turns.

    The motion is the periodic orbit. For a design without an orbit it continues the long run of the
    worse start.
    """
    problem = answer.problem
    count, turns = len(answer.designs), np.linspace(0, 2, 1001)
    fig, axes = plt.subplots(
        count,
        2,
        figsize=(plots.WIDTH, 2.6 * count),
        layout="constrained",
        width_ratios=[1, 1.7],
        squeeze=False,
    )
    for (place, force), (title, design) in zip(axes, answer.designs.items(), strict=True):
        scene = problem.design.build(problem.design.completed(design.values))
        name, prefix = headline_force(scene), scene.prefix(scene.joints.names[0])
        clearance = float(scene.joints.values[0].clearance)
        outputs = name, f"{prefix}eccentricity"
        times = 2 * np.pi / design.speed * turns
        if design.orbit is not None and design.orbit.found:
            seen, of = design.orbit.solution.motion(2 * np.pi * turns, outputs), "periodic orbit"
        else:
            run, of = design.transient[design.worse_start], f"{design.worse_start} start"
            begun = started(problem.design, design.values, design.worse_start)
            state = np.asarray(run.state)
            motion = jc.simulate(begun, times, outputs=outputs, state=state, rtol=FINE)
            seen = {output: motion[output] for output in outputs}
        plots.plot_orbit(seen, clearance, place, prefix=prefix)
        place.set_title(f"{title}, {of}")
        ideal = jc.simulate(scene.ideal(), times, outputs=(name,))
        force.plot(turns, plots.force_size(seen[name]), color=plots.BLUE, label="with clearance")
        line = plots.force_size(ideal[name])
        force.plot(turns, line, "--", color=plots.ORANGE, label="ideal joints")
        words = "|R_O| + |R_C|" if name == "foundation_force" else "shaking force"
        force.set(xlabel="turns of the shaft", ylabel=f"{words} (kN)")
        force.set_title(
            f"{said('speed', design.speed, answer.problem.units)}, {quantity(clearance, 'm')}"
        )
    top = max(ax.get_ylim()[1] for ax in axes[:, 1])
    for ax in axes[:, 1]:
        ax.set_ylim(0, top)
    axes[0, 1].legend(loc="lower right")
    write_figure(folder / "motion.svg", fig)

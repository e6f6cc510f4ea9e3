"""What a search leaves behind: result.json, the landscape, the figures, the closing table."""

import math
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from rich.console import Console
from rich.table import Table

import jaxcrusher as jc
from jaxcrusher.files.results import write_figure
from jaxcrusher.pictures import plots
from optimize import landscape as maps
from optimize import problem
from optimize.evaluate import STARTS, Case, started
from optimize.options import Options
from optimize.page.answer import DESIGNS, outside
from optimize.pareto import nondominated


def draw_all(
    folder: Path,
    case: Case,
    options: Options,
    units: np.ndarray,
    data: xr.Dataset,
    paths: list[np.ndarray],
    result: dict,
) -> list[str]:
    """Every figure that the design's parameters allow; returns the names of their files.

    `units` are the landscape's points.
    """
    drawn = ["pareto.png", "motion.png"]
    if "speed" in case.design.names:
        draw_capacity(folder, case, options)
        drawn.insert(0, "capacity.png")
    if case.design.names == ("speed", "clearance"):
        draw_landscape(folder, case, data, paths, result)
        drawn.insert(0, "landscape.png")
    draw_pareto(folder, case.capacity(units), data, result)
    draw_motions(folder, case, options, result)
    return drawn


def draw_landscape(
    folder: Path, case: Case, data: xr.Dataset, paths: list[np.ndarray], result: dict
) -> None:
    """Map with what moves how, descents, optimum and the design to compare with."""
    fig, ax = plt.subplots(figsize=(7, 4.8), layout="constrained")
    exponent = data.exponent.max("start")
    marks = {
        "failed": ~data.success.all("start"),
        "whirl": data.whirl.any("start"),
        "chaotic": exponent > maps.CHAOTIC,
        "outside the contact model": ~data.inside_model.all("start"),
    }
    plots.plot_landscape(maps.worst(data), ax, marks=marks)
    handles, labels = [], []
    if ax.get_legend() is not None:
        handles, labels = (
            ax.get_legend().legend_handles,
            [text.get_text() for text in ax.get_legend().get_texts()],
        )
    for i, path in enumerate(paths):
        values = case.design.values(path)
        (line,) = ax.plot(
            values["speed"], 1e3 * values["clearance"], "w.-", linewidth=0.8, markersize=2
        )
        if i == 0:
            handles, labels = [*handles, line], [*labels, "descents"]
    for name, marker, colour, label in (
        ("optimum", "*", "C3", "optimum"),
        ("seed_choice", "D", "C1", "paper's choice"),
    ):
        values = result[name]["values"]
        (mark,) = ax.plot(
            values["speed"],
            1e3 * values["clearance"],
            marker,
            color=colour,
            markersize=13 if marker == "*" else 8,
            markeredgecolor="w",
            linestyle="",
            clip_on=False,
        )
        handles, labels = [*handles, mark], [*labels, label]
    ax.legend(
        handles,
        labels,
        loc="lower center",
        bbox_to_anchor=(0.5, 1.0),
        ncols=3,
        facecolor="0.7",
        fontsize=9,
    )
    write_figure(folder / "landscape.png", fig)


def draw_capacity(folder: Path, case: Case, options: Options) -> None:
    """Capacity over speed, with the box searched."""
    box = problem.box(options)
    low, high = case.design.bounds["speed"]
    fig, ax = plt.subplots(figsize=(6, 4), layout="constrained")
    speeds = np.linspace(0.6 * low, 1.25 * high, 200)
    plots.plot_capacity(case.chamber, speeds, box["capacity_floor"], ax)
    ax.axvspan(low, high, color="C2", alpha=0.15, label="box searched")
    reached = box["derived_speed"][1]
    if math.isfinite(reached):
        ax.axvline(
            reached, color="0.4", linestyle=":", label=f"floor reached at {reached:.2f} rad/s"
        )
    ax.legend()
    write_figure(folder / "capacity.png", fig)


def draw_pareto(folder: Path, capacity: np.ndarray, data: xr.Dataset, result: dict) -> None:
    """The landscape's RMS against capacity and against the peak, with what no other beats."""
    counts = data.counts.all("start").to_numpy().ravel()
    columns = {
        name: np.where(counts, data[name].max("start").to_numpy().ravel(), np.nan) / 1e3
        for name in ("foundation_rms", "foundation_peak")
    }
    fig, axes = plt.subplots(1, 2, figsize=(9, 4), layout="constrained")
    seed = result["seed_choice"]
    rms = max(run["foundation_rms"] for run in seed["runs"].values()) / 1e3
    peak = max(run["foundation_peak"] for run in seed["runs"].values()) / 1e3
    for ax, other, sign, label, mark in (
        (axes[0], capacity, -1.0, "capacity (m³/h)", seed["capacity"]),
        (axes[1], columns["foundation_peak"], 1.0, r"peak of $|R_O| + |R_C|$ (kN)", peak),
    ):
        front = nondominated(np.stack([columns["foundation_rms"], sign * other], axis=-1))
        ax.plot(columns["foundation_rms"], other, "o", color="0.7", markersize=4, label="landscape")
        order = np.flatnonzero(front)[np.argsort(columns["foundation_rms"][front])]
        ax.plot(
            columns["foundation_rms"][order],
            other[order],
            "s-",
            color="C0",
            markersize=5,
            label="not beaten in both",
        )
        ax.plot(
            rms, mark, "D", color="C1", markersize=9, markeredgecolor="k", label="paper's choice"
        )
        ax.set(xlabel=r"RMS of $|R_O| + |R_C|$, worse start (kN)", ylabel=label)
        ax.legend(fontsize=8)
    write_figure(folder / "pareto.png", fig)


def draw_motions(folder: Path, case: Case, options: Options, result: dict) -> None:
    """Orbit and foundation force of optimum and paper's choice from both starts, settled."""
    fig, axes = plt.subplots(
        2,
        2 * len(DESIGNS),
        figsize=(6.2 * len(DESIGNS), 6),
        layout="constrained",
        gridspec_kw={"width_ratios": [1, 1.5] * len(DESIGNS)},
        squeeze=False,
    )
    for column, (name, title) in enumerate(DESIGNS.items()):
        described: dict[str, Any] = {**case.design.fixed, **result[name]["values"]}
        speed, clearance = result[name]["speed"], result[name]["clearance"]
        times = 2 * np.pi / speed * (options.settle + np.linspace(0, 2, 4001))
        outputs = ("foundation_force", "eccentricity")
        ideal = jc.simulate(jc.build_scene(described).ideal(), times, outputs=outputs)
        for row, start in enumerate(STARTS):
            motion = jc.simulate(started(described, start), times, outputs=outputs, rtol=1e-9)
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


def print_table(console: Console, result: dict) -> None:
    """The closing table, the checks, and what to make of the answer."""
    objective = result["objective"]
    unit = objective["unit"]
    table = Table(title=f"{objective['meaning']}, {unit}")
    free = [f"{name}\n{jc.PARAMETERS[name].unit}" for name in result["optimum"]["values"]]
    for heading in (
        "",
        *free,
        f"centred start\n{unit}",
        f"contact start\n{unit}",
        "ideal RMS\nN",
        "capacity\nm3/h",
    ):
        table.add_column(heading, justify="left" if not heading else "right")
    for name, title in DESIGNS.items():
        row = result[name]
        table.add_row(
            title,
            *(f"{value:.5g}" for value in row["values"].values()),
            *(_number(row["runs"][start]) for start in STARTS),
            f"{row['ideal_rms']:.0f}",
            f"{row['capacity']:.2f}",
        )
    console.print(table)
    console.print(f"± half a 95 % interval, from {_runs(result)} independent runs", highlight=False)
    for name, title in DESIGNS.items():
        kinds = [f"{start} start {row['name']}" for start, row in result[name]["regime"].items()]
        console.print(f"{title}: {'; '.join(kinds)}", highlight=False)
        console.print(f"{title}: {_limits(result[name]['runs'])}", highlight=False)
    for name, slope in result["gradient_report"]["slopes"].items():
        why = f" ({'; '.join(slope['reasons'])})" if slope["reasons"] else ""
        console.print(
            f"slope of {result['gradient_report']['metric']} by {name}: {slope['value']:.5g}, "
            f"{slope['estimator']}, {slope['verdict']}{why}",
            highlight=False,
            markup=False,
        )
    for check in result["checks"]:
        colour = "green" if check["passed"] else "red"
        console.print(f"[{colour}]{check['verdict']:>6}[/] {check['name']}: {check['detail']}")
    console.print(result["claim"]["words"], highlight=False)
    console.print(result["remark"], highlight=False)
    spent = [
        f"{name} {seconds:.0f} s"
        + (f" ({result['steps'][name] / 1e6:.1f}e6 steps)" if name in result["steps"] else "")
        for name, seconds in result["seconds"].items()
    ]
    console.print(f"spent: {', '.join(spent)}", highlight=False)


def _runs(result: dict) -> int:
    return result["optimum"]["runs"][STARTS[0]]["runs"]


def _number(run: dict) -> str:
    """A mean with its interval, or what is wrong with it."""
    if not run["success"]:
        return "failed"
    text = f"{run['objective_mean']:.5g} ± {run['objective_half_width']:.2g}"
    return f"{text}, friction whirl" if run["whirl"] else text


def _limits(runs: dict[str, dict]) -> str:
    """What of a design's runs is outside the contact model."""
    found = outside(runs)
    if found:
        return "OUTSIDE the contact model: " + "; ".join(found)
    widest = max(run["validity"]["half_width_ratio"] for run in runs.values())
    fastest = max(run["validity"]["impact_speed_ratio"] for run in runs.values())
    return (
        f"inside the contact model (half-width {widest:.2f} bore radii, "
        f"approach {fastest:.2f} of the elastic limit)"
    )

"""What a search leaves behind: result.json, the landscape, the figures, the closing table."""

import json
import math
import os
from pathlib import Path

import matplotlib
import numpy as np
import xarray as xr
from rich.console import Console
from rich.table import Table

import jaxcrusher as jc
from jaxcrusher import plots
from optimize.options import SEED_CLEARANCE, SEED_SPEED, Options

matplotlib.use("Agg")
import matplotlib.pyplot as plt

DESIGNS = {"optimum": "optimum", "seed_choice": "paper's choice"}


def write_json(path: Path, content: dict) -> None:
    """Write at once or not at all; NaN becomes null."""

    def clean(value):
        if isinstance(value, dict):
            return {key: clean(entry) for key, entry in value.items()}
        if isinstance(value, list | tuple):
            return [clean(entry) for entry in value]
        return None if isinstance(value, float) and not math.isfinite(value) else value

    partial = path.with_suffix(".partial")
    partial.write_text(json.dumps(clean(content), indent=2) + "\n")
    os.replace(partial, path)


def write_landscape(path: Path, landscape: xr.Dataset) -> None:
    """Write the landscape as netCDF, at once or not at all; logical variables become 0 and 1."""
    partial = path.with_suffix(".partial")
    logical = [name for name, values in landscape.items() if values.dtype == bool]
    landscape = landscape.assign({name: landscape[name].astype("int8") for name in logical})
    landscape.to_netcdf(partial, engine="scipy")
    os.replace(partial, path)


def draw_landscape(
    folder: Path, rms: xr.DataArray, paths: np.ndarray, optimum: dict, options: Options
) -> None:
    """Map, refinement paths (steps, n, 2) in rad/s and m, box, optimum and the paper's choice."""
    fig, ax = plt.subplots(figsize=(7, 4.5), layout="constrained")
    plots.plot_landscape(rms, ax)
    for i in range(paths.shape[1]):
        label = "gradient paths" if i == 0 else None
        ax.plot(paths[:, i, 0], 1e3 * paths[:, i, 1], "w.-", linewidth=0.8, markersize=2,
                label=label)  # fmt: skip
    (low, high), (small, large) = options.speed, options.clearance
    ax.plot([low, high, high, low, low], [small, small, large, large, small], "k--",
            linewidth=1, label="box")  # fmt: skip
    ax.plot(optimum["speed"], 1e3 * optimum["clearance"], "*", color="C3", markersize=15,
            markeredgecolor="w", label="optimum", clip_on=False)  # fmt: skip
    ax.plot(SEED_SPEED, 1e3 * SEED_CLEARANCE, "D", color="C1", markersize=8,
            markeredgecolor="w", label="paper's choice", clip_on=False)  # fmt: skip
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, 1.13), ncols=4, facecolor="0.7")
    fig.savefig(folder / "landscape.png", dpi=150)
    plt.close(fig)


def draw_capacity(folder: Path, options: Options) -> None:
    """Capacity over speed, with the box searched."""
    box = options.box()
    fig, ax = plt.subplots(figsize=(6, 4), layout="constrained")
    speeds = np.linspace(0.6 * options.speed[0], 1.25 * options.speed[1], 200)
    plots.plot_capacity(options.chamber, speeds, box["capacity_floor"], ax)
    ax.axvspan(*options.speed, color="C2", alpha=0.15, label="box searched")
    ax.axvline(box["derived_speed"][1], color="0.4", linestyle=":",
               label=f"floor reached at {box['derived_speed'][1]:.2f} rad/s")  # fmt: skip
    ax.legend()
    fig.savefig(folder / "capacity.png", dpi=150)
    plt.close(fig)


def draw_motions(folder: Path, designs: dict[str, tuple[float, float]], options: Options) -> None:
    """Orbit and foundation force of named designs from both starts, after settling."""
    fig, axes = plt.subplots(
        2, 2 * len(designs), figsize=(6.2 * len(designs), 6), layout="constrained",
        gridspec_kw={"width_ratios": [1, 1.5] * len(designs)}, squeeze=False,
    )  # fmt: skip
    for column, (name, (speed, clearance)) in enumerate(designs.items()):
        turn = 2 * np.pi / speed
        times = turn * (options.settle + np.linspace(0, 2, 4001))
        outputs = ("foundation_force", "eccentricity")
        scene = jc.ideal_scene(speed, load=options.scene()["load"])
        ideal = jc.simulate(scene, times, outputs=outputs)
        for row, start in enumerate(("centred", "contact")):
            scene = jc.paper_scene(speed, clearance, start=start, **options.scene())
            motion = jc.simulate(scene, times, outputs=outputs, rtol=1e-9)
            orbit, force = axes[row, 2 * column : 2 * column + 2]
            plots.plot_orbit(motion, clearance, orbit)
            plots.plot_force(motion, ideal, force)
            orbit.set_title(f"{name}, start {start}", fontsize=10)
            force.set_title(f"{speed:.2f} rad/s, {1e3 * clearance:.3f} mm", fontsize=10)
    forces = axes[:, 1::2].ravel()
    top = max(ax.get_ylim()[1] for ax in forces)
    for ax in forces:
        ax.set_ylim(0, top)
        ax.legend(loc="lower right", fontsize=8)
    fig.savefig(folder / "motion.png", dpi=150)
    plt.close(fig)


def print_table(console: Console, result: dict) -> None:
    """The closing table, the checks, and what to make of the answer."""
    table = Table(title="RMS force on the foundation, |R_O| + |R_C|")
    for heading in ("", "speed\nrad/s", "clearance\nmm", "centred start\nN", "contact start\nN",
                    "ideal\nN", "capacity\nm3/h"):  # fmt: skip
        table.add_column(heading, justify="left" if not heading else "right")
    for name, title in DESIGNS.items():
        row = result[name]
        runs = [row["runs"][start] for start in ("centred", "contact")]
        table.add_row(
            title,
            f"{row['speed']:.3f}",
            f"{1e3 * row['clearance']:.4f}",
            *(_number(run) for run in runs),
            f"{row['ideal_rms']:.0f}",
            f"{row['capacity']:.2f}",
        )
    console.print(table)
    for name, title in DESIGNS.items():
        console.print(f"{title}: {_limits(result[name]['runs'])}", highlight=False)
    for check in result["checks"]:
        colour = "green" if check["passed"] else "red"
        console.print(f"[{colour}]{check['verdict']:>6}[/] {check['name']}: {check['detail']}")
    console.print(result["remark"])


def _number(run: dict) -> str:
    """An RMS with its standard error, or what is wrong with it."""
    if not run["success"]:
        return "failed"
    text = f"{run['foundation_rms']:.0f}±{run['foundation_rms_error']:.0f}"
    return f"{text}, friction whirl" if run["whirl"] else text


def _limits(runs: dict[str, dict]) -> str:
    """What of a design's runs is outside the contact model."""
    found = []
    for start, run in runs.items():
        remarks = jc.Validity(**run["validity"]).remarks() if run["success"] else ["run failed"]
        found += [f"{start} start, {remark}" for remark in remarks]
    if found:
        return "OUTSIDE the contact model: " + "; ".join(found)
    widest = max(run["validity"]["half_width_ratio"] for run in runs.values())
    fastest = max(run["validity"]["impact_speed_ratio"] for run in runs.values())
    return (
        f"inside the contact model (half-width {widest:.2f} bore radii, "
        f"approach {fastest:.2f} of the elastic limit)"
    )

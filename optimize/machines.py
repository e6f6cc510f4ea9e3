"""Machines of scene files side by side: their numbers in a table and in a picture."""

import math
import textwrap
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

import jaxcrusher as jc
from jaxcrusher.basics.checks import require, require_whole
from jaxcrusher.files.results import results_folder, write_figure, write_table
from jaxcrusher.motion.statistics import Statistics
from jaxcrusher.motion.statistics_table import always_of
from jaxcrusher.orbits.forced import refusal
from jaxcrusher.pictures.page import STYLE, WIDTH
from jaxcrusher.scenes.build import build_chamber
from jaxcrusher.scenes.parameters import complete
from jaxcrusher.scenes.plausibility import borrowed, tell_borrowed, tell_unusual
from jaxcrusher.scenes.scene_file import read_scene_file, scene_of
from optimize.forces import name_of, prefixed, quantity
from optimize.objectives import OBJECTIVES
from optimize.throughput import read_bulk_density, throughput

# What is compared, in this order; wear needs friction.
COMPARED = ("rms", "peak", "shaking_rms", "shaking_peak", "joint_peak", "wear", "energy")
# Largest values, which differ from turn to turn where the pin hits its bore.
PEAKS = ("peak", "shaking_peak", "joint_peak")
DRAWN = ("capacity", "shaking_rms", "peak", "joint_peak", "wear", "energy")


@dataclass(frozen=True)
class Machine:
    """A crusher's numbers by name: `COMPARED` ones in their units, NaN where there is none."""

    name: str
    speed: float  # rad/s
    clearance: float  # m, NaN of ideal joints
    capacity: float  # m3/h
    numbers: dict[str, float]
    typical: dict[str, float]  # the median over turns of each peak, where turns differ
    motion: str  # what they are numbers of
    model: str  # "inside", or why not
    borrowed: int = 0  # numbers of the machine that its file leaves to the PE250x400


def run(
    files: Sequence[Path],
    settle: int,
    turns: int,
    bulk_density: str | None,
    folder: Path,
    console: Console,
) -> None:
    """Compute, print, write and draw; ValueError for bad options and files."""
    require(len(files) > 0, "scenes", "name at least one file", "none")
    titles = [path.stem for path in files]
    require(len(set(titles)) == len(titles), "scenes", "have names of their own", titles)
    require_whole("settle", settle, 0)
    require_whole("turns", turns, 2)
    density = read_bulk_density(bulk_density)
    # All files are read before anything is compiled.
    described = []
    for path in files:
        given = read_scene_file(path)
        values = complete(given)
        described.append((values, scene_of(values, path, given), len(borrowed(given))))
        tell_unusual(values)
        tell_borrowed(given, path)
    found = []
    for title, (values, scene, left) in zip(titles, described, strict=True):
        with console.status(title):
            found.append(replace(machine(title, values, scene, settle, turns), borrowed=left))
    results_folder(folder)
    write_table(folder / "compare.csv", [csv_row(one) for one in found])
    with plt.rc_context(STYLE):
        write_figure(folder / "compare.png", draw(found))
    table = Table("", *titles, box=SIMPLE_HEAD)
    for row in table_rows(found, density):
        table.add_row(*row)
    console.print(table)
    console.print(f"results in {folder}/", highlight=False)


def machine(name: str, values: dict, scene: jc.Scene, settle: int, turns: int) -> Machine:
    """Return the numbers of a crusher on its stable orbit, or over `turns` turns after `settle`."""
    chamber, rubs = (
        build_chamber(values),
        scene.joint is not None and scene.joint.friction is not None,
    )
    names = [name for name in COMPARED if name != "wear" or rubs]
    result, motion = None, "periodic orbit"
    if not refusal(scene):
        orbit = jc.periodic_orbit(scene)
        result = orbit if bool(orbit.stable) else None
    if result is None:
        asked = (statistic for name in names for statistic in OBJECTIVES[name].outputs)
        outputs = tuple(dict.fromkeys((*always_of(scene), *asked)))
        result = jc.statistics(scene, settle, turns, outputs=outputs)
        motion = f"mean of turns {settle + 1} to {settle + turns}"
        if not bool(result.success):
            motion = f"failed: {result.failure}"
        elif bool(result.whirl):
            motion = "friction whirl, outside the theory"
    numbers = {name: float(OBJECTIVES[name].formula(result, scene, chamber)) for name in names}
    typical = {}
    if isinstance(result, Statistics):
        by_turn = {name: result.by_turn[OBJECTIVES[name].outputs[0]] for name in PEAKS}
        typical = {name: float(np.median(values)) for name, values in by_turn.items()}
    remarks = result.validity.remarks()
    clearance = math.nan if scene.joint is None else float(scene.joint.clearance)
    return Machine(
        name,
        float(scene.drive.speed),
        clearance,
        float(chamber.capacity(scene.drive.speed)),
        {name: numbers.get(name, math.nan) for name in COMPARED},
        typical,
        motion,
        "; ".join(remarks) or "inside",
    )


def csv_row(one: Machine) -> dict[str, object]:
    """Return the row of a machine: units are those of `OBJECTIVES`, and in the headings."""
    numbers = {f"{name}, {OBJECTIVES[name].unit}": one.numbers[name] for name in COMPARED}
    return {
        "machine": one.name,
        "speed, rad/s": one.speed,
        "clearance, m": one.clearance,
        "capacity, m3/h": one.capacity,
        **numbers,
        "numbers of": one.motion,
        "contact model": one.model,
        "numbers left to the PE250x400": one.borrowed,
    }


def table_rows(found: Sequence[Machine], density: float | None) -> list[tuple[str, ...]]:
    """Return a heading and a cell of each machine, number by number."""

    def row(heading: str, unit: str, values: Iterable[float]) -> tuple[str, ...]:
        return heading, *(
            "none" if math.isnan(value) else quantity(value, unit) for value in values
        )

    rows = [
        row("speed", "rpm", (one.speed * 30 / math.pi for one in found)),
        row("radial clearance", "m", (one.clearance for one in found)),
        row("capacity", "m3/h", (one.capacity for one in found)),
    ]
    if density is not None:
        rows.append(row("capacity", "t/h", (throughput(one.capacity, density) for one in found)))
    for name in COMPARED:
        of = OBJECTIVES[name]
        rows.append(row(name_of(of.meaning), of.unit, (one.numbers[name] for one in found)))
        if any(name in one.typical for one in found):
            medians = (one.typical.get(name, one.numbers[name]) for one in found)
            rows.append(row("  median over turns", of.unit, medians))
    rows.append(("numbers of the", *(one.motion for one in found)))
    rows.append(("contact model", *(one.model for one in found)))
    if any(one.borrowed for one in found):
        rows.append(("numbers left to the PE250x400", *(str(one.borrowed) for one in found)))
    return rows


def draw(found: Sequence[Machine]) -> Figure:
    """Draw bars of each number that a machine has; one outside the contact model is hatched."""
    fig, grid = plt.subplots(2, 3, figsize=(WIDTH, 5), layout="constrained")
    titles = [one.name for one in found]
    drawn = [n for n in DRAWN if not all(math.isnan(one.numbers.get(n, 0.0)) for one in found)]
    for ax in grid.ravel()[len(drawn) :]:
        ax.remove()
    for ax, name in zip(grid.ravel(), drawn, strict=False):
        if name == "capacity":
            title, unit, values = name, "m3/h", [one.capacity for one in found]
        else:
            of, plain = OBJECTIVES[name], [one.numbers[name] for one in found]
            factor, unit = prefixed(np.nanmax([0.0, *map(abs, plain)]), of.unit)
            title, values = name_of(of.meaning), [value / factor for value in plain]
        bars = ax.bar(titles, values, color=[f"C{i % 10}" for i in range(len(found))])
        for bar, one in zip(bars, found, strict=True):
            bar.set_hatch("" if one.model == "inside" else "///")
        ax.set_title(textwrap.fill(title, 26), fontsize=8)
        ax.set_ylabel(unit)
        ax.tick_params(axis="x", labelrotation=20)
    return fig

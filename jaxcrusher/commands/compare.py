"""`python -m jaxcrusher compare`: crushers side by side, in one table and one picture."""

import math
import textwrap
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure
from rich.console import Console

import jaxcrusher as jc
from jaxcrusher.basics.checks import require, require_whole
from jaxcrusher.commands.machines import read_machine, settings_of
from jaxcrusher.commands.options import Compare, Crusher
from jaxcrusher.crusher.capacity import (
    CAUTION,
    PER_VOLUME,
    per_volume,
    stroke,
    stroke_ratio,
    throughput,
)
from jaxcrusher.crusher.template import CALLED, STATISTIC
from jaxcrusher.files.results import listed, write_figure, write_table
from jaxcrusher.files.resume import begin_beside
from jaxcrusher.files.text import Table, prefixed, quantity
from jaxcrusher.motion.statistics import Statistics
from jaxcrusher.orbits.forced import refusal
from jaxcrusher.pictures.plots import STYLE, WIDTH
from jaxcrusher.scenes.build import build_chamber
from jaxcrusher.scenes.reader import kind_of, read_bulk_density

# Largest values. They differ from turn to turn where the pin hits its bore.
PEAKS = ("foundation_peak", "shaking_peak", "joint_peak")
DRAWN = ("capacity", "shaking_rms", "foundation_peak", "joint_peak", *PER_VOLUME)
FILES = ("compare.csv", "compare.png")
# Every number of a machine with its heading and its unit. Wear is known only with friction.
QUANTITIES = {
    "speed": ("speed", "rad/s"),
    "clearance": ("radial clearance", "m"),
    "capacity": ("capacity", "m3/h"),
    "stroke": ("stroke at the discharge", "m"),
    "stroke_ratio": ("  vertical over horizontal", "1"),
    **{name: (called, STATISTIC[name].unit) for name, called in CALLED.items()},
    **{name: (meaning, "J/m3") for name, (_, meaning) in PER_VOLUME.items()},
}


@dataclass(frozen=True)
class Compared:
    """The `QUANTITIES` of a crusher; an unknown quantity is NaN."""

    name: str
    numbers: dict[str, float]
    typical: dict[str, float]  # the median over turns of each peak, where turns differ
    motion: str  # the motion that the numbers describe
    model: str  # "inside" the contact model, or why it is outside
    borrowed: int = 0  # how many numbers its file leaves to the PE250x400


def run(options: Compare, console: Console) -> int:
    """Compute, print, write and draw. Raises ValueError for bad options and files."""
    require(len(options.scenes) > 0, "scenes", "name at least one file", "none")
    titles = [path.stem for path in options.scenes]
    require(len(set(titles)) == len(titles), "scenes", "have names of their own", titles)
    require_whole("settle", options.settle, 0)
    require_whole("turns", options.turns, 2)
    density = read_bulk_density(options.bulk_density)
    # All files are read before anything is compiled.
    machines = {}
    for title, path in zip(titles, options.scenes, strict=True):
        crushes = kind_of(path) == "crusher"
        require(crushes, "scenes", "be files of crushers, which alone are compared", path)
        machines[title] = read_machine(Crusher(path))
    window = {"settle": options.settle, "turns": options.turns}
    settings = {title: settings_of("compare", one, **window) for title, one in machines.items()}
    folder = begin_beside(options.results.folder, settings, *FILES)
    found = []
    for title, machine in machines.items():
        with console.status(title):
            found.append(compared(title, machine, options.settle, options.turns))
    write_table(folder / "compare.csv", [csv_row(one) for one in found])
    with plt.rc_context(STYLE):
        write_figure(folder / "compare.png", draw(found))
    table = Table(("", *titles), table_rows(found, density))
    console.print(table.printed(), soft_wrap=False)
    console.print(CAUTION)
    console.print(listed(folder, FILES))
    return 0


def compared(name: str, machine: jc.Machine, settle: int, turns: int) -> Compared:
    """Return a crusher's numbers on its stable orbit, or over `turns` turns after `settle`."""
    chamber, scene = build_chamber(machine.values), machine.scene()
    left = len(machine.structure.borrowed(machine.given))
    main = scene.joints["main"]
    powers = {which: power for which, (power, _) in PER_VOLUME.items()}
    if main is None or main.friction is None:
        del powers["wear"]
    result, motion = None, "periodic orbit"
    if scene.steady() is not scene:
        motion += " under the mean load"
    if not refusal(scene):
        orbit = jc.periodic_orbit(scene, effort="thorough")
        result = orbit if bool(orbit.stable) else None
    if result is None:
        outputs = tuple(dict.fromkeys((*scene.usual_statistics, *CALLED, *powers.values())))
        result = jc.statistics(scene, settle, turns, outputs=outputs)
        motion = f"mean of turns {settle + 1} to {settle + turns}"
        if not bool(result.success):
            motion = f"failed: {result.failure}"
        elif bool(result.whirl):
            motion = "friction whirl, outside the theory"
    numbers = dict.fromkeys(QUANTITIES, math.nan)
    numbers["speed"] = float(scene.drive.speed)
    numbers["capacity"] = float(chamber.capacity(scene.drive.speed))
    numbers["stroke"] = float(stroke(scene.linkage))
    numbers["stroke_ratio"] = float(stroke_ratio(scene.linkage))
    if main is not None:
        numbers["clearance"] = float(main.clearance)
    numbers |= {force: float(result[force]) for force in CALLED}
    for which, power in powers.items():
        numbers[which] = float(per_volume(result[power], numbers["capacity"]))
    typical = {}
    if isinstance(result, Statistics):
        typical = {peak: float(np.median(result.by_turn[peak])) for peak in PEAKS}
    remarks = result.validity.remarks()
    return Compared(name, numbers, typical, motion, "; ".join(remarks) or "inside", left)


def csv_row(one: Compared) -> dict[str, object]:
    """Return the row of a machine for the CSV file; headings contain the units."""
    return {
        "machine": one.name,
        **{f"{name}, {unit}": one.numbers[name] for name, (_, unit) in QUANTITIES.items()},
        "numbers of": one.motion,
        "contact model": one.model,
        "numbers left to the PE250x400": one.borrowed,
    }


def table_rows(found: Sequence[Compared], density: float | None) -> list[tuple[str, ...]]:
    """Return a row for each number: its heading, and a cell for each machine."""

    def row(heading: str, unit: str, values: Iterable[float]) -> tuple[str, ...]:
        return heading, *(quantity(value, unit) for value in values)

    rows = []
    for name, (heading, unit) in QUANTITIES.items():
        values = [one.numbers[name] for one in found]
        if name == "speed":
            unit, values = "rpm", [value * 30 / math.pi for value in values]
        rows.append(row(heading, unit, values))
        if name == "capacity" and density is not None:
            rows.append(row(heading, "t/h", (throughput(value, density) for value in values)))
        if any(name in one.typical for one in found):
            medians = (one.typical.get(name, one.numbers[name]) for one in found)
            rows.append(row("  median over turns", unit, medians))
    rows.append(("numbers of the", *(one.motion for one in found)))
    rows.append(("contact model", *(one.model for one in found)))
    if any(one.borrowed for one in found):
        rows.append(("numbers left to the PE250x400", *(str(one.borrowed) for one in found)))
    return rows


def draw(found: Sequence[Compared]) -> Figure:
    """Draw bars of the known numbers; machines outside the contact model are hatched."""
    fig, grid = plt.subplots(2, 3, figsize=(WIDTH, 5), layout="constrained")
    titles = [one.name for one in found]
    drawn = [name for name in DRAWN if not all(math.isnan(one.numbers[name]) for one in found)]
    for ax in grid.ravel()[len(drawn) :]:
        ax.remove()
    for ax, name in zip(grid.ravel(), drawn, strict=False):
        heading, unit = QUANTITIES[name]
        values = [one.numbers[name] for one in found]
        factor, unit = prefixed(np.nanmax([0.0, *map(abs, values)]), unit)
        colours = [f"C{i % 10}" for i in range(len(found))]
        bars = ax.bar(titles, [value / factor for value in values], color=colours)
        for bar, one in zip(bars, found, strict=True):
            bar.set_hatch("" if one.model == "inside" else "///")
        ax.set_title(textwrap.fill(heading, 26), fontsize=8)
        ax.set_ylabel(unit)
        ax.tick_params(axis="x", labelrotation=20)
    return fig

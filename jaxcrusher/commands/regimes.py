"""`python -m jaxcrusher regimes`: the kind of motion of each design of a list or a grid."""

import itertools
import json
import time
from collections.abc import Mapping
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from rich.console import Console
from rich.markup import escape

import jaxcrusher as jc
from jaxcrusher.basics.checks import require, require_whole
from jaxcrusher.commands.machines import bounds, read_axes, read_moving, settings_of
from jaxcrusher.commands.options import Regimes
from jaxcrusher.dynamics.regime import LEAST_TURNS, Regime
from jaxcrusher.files import table
from jaxcrusher.files.progress import progress
from jaxcrusher.files.provenance import provenance, versions
from jaxcrusher.files.results import listed, results_folder, write_figure, write_json, write_netcdf
from jaxcrusher.files.resume import earlier, keep_beside
from jaxcrusher.files.table import Column, columns_of
from jaxcrusher.motion.method import require_tolerance
from jaxcrusher.motion.statistics import of_whirl
from jaxcrusher.pictures.maps import plot_regimes
from jaxcrusher.pictures.style import WIDTH, style
from jaxcrusher.scenes.machine import Machine
from jaxcrusher.scenes.own_laws import with_digests
from jaxcrusher.scenes.parameters import CHAMBER, SITE, Parameter, key_of
from jaxcrusher.scenes.reader import read_text
from jaxcrusher.scenes.units import all_said, units_of

FILES = "regimes.json", "regimes.nc", "regimes.png"
# The numbers of a row besides the statistics.
COLUMNS = {
    "period": Column("1", "turns after which the motion repeats"),
    "largest_exponent": Column("1", "largest Lyapunov exponent a turn"),
    "largest_exponent_error": Column("1", "its standard error"),
    "zero_one": Column("1", "0-1 test: 0 order, 1 chaos"),
    "trend": Column("1", "change of the section's spread, as a share"),
    "seconds": Column("s", "time it took"),
}


def run(options: Regimes, console: Console) -> int:
    """Classify the remaining designs. Return 1 if a run failed; ValueError for bad options."""
    found = read_moving(options.crusher)
    designs = read_designs(options, found)
    values, scene = found.values, found.scene()
    outputs = of_whirl(scene)
    columns = COLUMNS | columns_of(scene.statistics, outputs)
    units = found.units | _units(options)
    for name, least in (("settle", 0), ("turns", LEAST_TURNS), ("tangent_turns", 1)):
        require_whole(name, getattr(options, name), least)
    require_tolerance(options.rtol)
    scenes = [found.scene(**design) for design in designs]
    moving = all(scene.has_unknowns for scene in scenes)
    require(moving, "design", "have clearance to move in", "ideal")
    for design in designs:
        found.replace(**design).unusual()
    varied, fixed = list(designs[0]), {"versions": versions()}
    fixed |= {n: getattr(options, n) for n in ("settle", "turns", "tangent_turns", "rtol")}
    settings = settings_of("regimes", found, varied=varied, **fixed)
    settings["scene"] = {n: value for n, value in settings["scene"].items() if n not in varied}
    folder = results_folder(options.results.folder)
    keep_beside(folder / "regimes.json", settings, *FILES[1:])
    kept = earlier(folder / "regimes.json", settings, "name")
    # If a user's own laws or files have changed, a design of the same name is another design.
    told, done = [with_digests(design) for design in designs], kept["rows"] if kept else []
    for design, now in zip(designs, told, strict=True):
        same = (row["design"] != design or row.get("described", design) == now for row in done)
        done = list(itertools.compress(done, same))
    attributes = provenance("Regimes of a machine's motion", scene=values)
    asked = []
    with progress(console) as bars:
        bar = bars.add_task("designs", total=len(designs))
        for design, now, scene in zip(designs, told, scenes, strict=True):
            row = next((row for row in done if row["design"] == design), None)
            remark = " (done before)" if row else ""
            if row is None:
                began = time.perf_counter()
                verdict = jc.regime(
                    scene,
                    options.settle,
                    options.turns,
                    rtol=options.rtol,
                    tangent_turns=options.tangent_turns,
                )
                row = _row(design, now, verdict, outputs, time.perf_counter() - began)
                done.append(row)
                content = {**attributes, "settings": settings, "rows": done}
                write_json(folder / "regimes.json", content)
                rows = dataset(done, columns, settings, attributes, found.numbers)
                write_netcdf(folder / "regimes.nc", rows)
            asked.append(row)
            title = all_said(design, units) or "the crusher"
            bars.console.print(escape(f"{title}: {row['verdict']}{remark}"))
            bars.advance(bar)
    failed = sum(row["regime"] == "failed" for row in asked)
    remark = f", {failed} failed" if failed else ""
    plural = "s" * (len(asked) != 1)
    over = list(designs[0]) if options.over else []
    written = FILES[:2]
    if len(over) == 2 and not set(over) & set(found.choices):
        with plt.rc_context(style()):
            fig, ax = plt.subplots(figsize=(WIDTH, 3.6), layout="constrained")
            plot_regimes(on_grid(asked), ax, units=units)
            write_figure(folder / "regimes.png", fig)
        written = FILES
    console.print(f"{len(asked)} design{plural}{remark}; {listed(folder, written)}")
    return 1 if failed else 0


def read_designs(options: Regimes, found: Machine) -> list[dict[str, Any]]:
    """Return the designs of the options in SI units; ValueError for unreadable designs."""
    both = bool(options.over and options.design)
    require(not both, "design", "stand instead of over", "given with it")
    if options.over:
        axes = read_axes(options.over, found)
        return [dict(zip(axes, cell, strict=True)) for cell in itertools.product(*axes.values())]
    if not options.design:
        return [{}]
    designs = [_design(text, found) for text in options.design]
    must = f"name {', '.join(designs[0])} as the first one does"
    for design in designs:
        require(list(design) == list(designs[0]), "design", must, ", ".join(design))
    return designs


def on_grid(rows: list[dict]) -> xr.DataArray:
    """Return the kinds of motion as a table over both ranges of the grid."""
    axes = {
        name: list(dict.fromkeys(row["design"][name] for row in rows)) for name in rows[0]["design"]
    }
    shape = [len(values) for values in axes.values()]
    kinds = np.array([row["regime"] for row in rows]).reshape(shape)
    return xr.DataArray(kinds, axes, list(axes))


def dataset(
    rows: list[dict],
    columns: dict[str, Column],
    settings: dict,
    attributes: dict[str, str],
    numbers: Mapping[str, Parameter],
) -> xr.Dataset:
    """Return the rows as a dataset; the varied parameters are coordinates along `design`."""
    coordinates = {}
    for name in settings["varied"]:
        known = numbers.get(name)
        labels = {"units": known.unit, "long_name": known.meaning} if known else {}
        coordinates[name] = ("design", [row["design"][name] for row in rows], labels)
    values = {
        name: np.array([np.nan if row[name] is None else float(row[name]) for row in rows])
        for name in columns
    }
    values["regime"] = np.array([row["regime"] for row in rows])
    kept = {"regime": Column("1", "kind of motion", str)} | columns
    attributes = {**attributes, "settings": json.dumps(settings)}
    return table.dataset(("design",), values, kept, coordinates, attributes)


def _row(
    design: dict[str, Any],
    described: dict[str, Any],
    verdict: Regime,
    outputs: tuple[str, ...],
    seconds: float,
) -> dict[str, Any]:
    exponents, summary = verdict.exponents, verdict.statistics
    row: dict[str, Any] = {
        "design": design,
        "described": described,
        "regime": verdict.name,
        "verdict": str(verdict),
        "period": verdict.period,
        "largest_exponent": None if exponents is None else float(exponents.exponents[0]),
        "largest_exponent_error": None if exponents is None else float(exponents.errors[0]),
        "zero_one": verdict.zero_one,
        "trend": verdict.trend,
        "seconds": round(seconds, 3),
    }
    return row | {name: None if summary is None else float(summary[name]) for name in outputs}


def _design(text: str, found: Machine) -> dict[str, Any]:
    parts = [part.partition("=") for part in text.split(",")]
    for name, equals, value in parts:
        comma = " with decimal points, not commas" if name.strip()[:1].isdigit() else ""
        require(bool(equals), "design", f"be KEY=VALUE,KEY=VALUE{comma}", repr(text))
        require("=" not in value, "design", "have a comma after each VALUE", repr(text))
    design = {}
    for name, _, value in parts:
        key = name.strip()
        require(key not in design, "design", "name a key once", repr(text))
        idle = key in CHAMBER or key in SITE
        require(not idle, "design", "name numbers of the motion", repr(text))
        design[key_of(key)] = read_text(key, value.strip(), found)
    return design


def _units(options: Regimes) -> dict[str, str]:
    """Return the units in which the designs were given."""
    parts = [part.partition("=") for text in options.design for part in text.split(",")]
    designs = [(name.strip(), value) for name, _, value in parts]
    return units_of((*bounds(options.over), *designs))

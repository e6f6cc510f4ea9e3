"""`python -m jaxcrusher gradient`: slopes of a statistic, and whether they can be trusted."""

import dataclasses
import json
from pathlib import Path
from typing import Any

from rich.console import Console

import jaxcrusher as jc
from jaxcrusher.basics.checks import require, require_choice, require_positive, require_whole
from jaxcrusher.commands.machines import read_moving, settings_of
from jaxcrusher.commands.options import Gradient
from jaxcrusher.dynamics.judgement import Slope
from jaxcrusher.dynamics.slopes import GradientReport
from jaxcrusher.files.provenance import environment, provenance
from jaxcrusher.files.results import write_json
from jaxcrusher.files.resume import SETTINGS, begin, earlier, keep_beside
from jaxcrusher.motion.method import require_tolerance
from jaxcrusher.scenes.machine import Machine
from jaxcrusher.scenes.parameters import numbers_of
from jaxcrusher.scenes.reader import require_continuous
from jaxcrusher.scenes.units import per, unit_of


def run(options: Gradient, console: Console) -> int:
    """Differentiate, print and write. Return 1 if the motion failed; ValueError for bad options."""
    found = read_moving(options.crusher)
    scene = found.scene()
    metric = options.metric or scene.headline
    numbers = numbers_of(found.values, found.numbers)
    by = options.by or ("speed", *(name for name in numbers if name.endswith("clearance")))
    require_choice("metric", metric, tuple(scene.statistics))
    _check(options, found, by, numbers)
    names = "settle", "turns", "radius", "pairs", "seed", "rtol"
    asked = {"metric": metric, "by": by} | {name: getattr(options, name) for name in names}
    values, unit = found.values, scene.statistics[metric].unit
    units = {name: unit_of(name, found.units)[0] for name in by}
    settings = settings_of("gradient", found, **asked, units=units)
    path = options.results.folder / "gradient.json"
    keep_beside(options.results.folder / SETTINGS, settings, path.name)
    kept = restored(path, settings)
    if kept is not None:
        return _tell(kept, f"{path} (done before)", console)
    begin(options.results.folder, settings, path.name)

    with console.status("compiling") as status:
        report = jc.gradient_report(
            found,
            metric,
            by,
            settle_turns=options.settle,
            turns=options.turns,
            radius=options.radius,
            pairs=options.pairs,
            seed=options.seed,
            rtol=options.rtol,
            progress=lambda stage: status.update(f"{stage} (with compilation up to a minute)"),
        )
    told = ", ".join(f"by {name} {per(unit, of)}" for name, of in units.items())
    kept = content(report, unit, found) | {"told": f"{shown(report, found.units)}\nunits: {told}"}
    write_json(path, provenance("Slopes", scene=values) | kept)
    return _tell(kept, str(path), console)


def _tell(kept: dict[str, Any], path: str, console: Console) -> int:
    """Print the stored report, and return the exit status."""
    console.print(f"{kept['told']}; in SI units: {path}", markup=False)
    return 1 if kept["regime"] == "failed" else 0


def _check(options: Gradient, machine: Machine, by: tuple[str, ...], numbers: list[str]) -> None:
    require(len(set(by)) == len(by), "by", "name parameters, each once", " ".join(by))
    for name in by:
        require_continuous("by", name, machine)
        require(name in numbers, "by", "name numbers that the machine has, such as speed", name)
    for name, least in (("settle", 0), ("turns", 1), ("pairs", 2), ("seed", 0)):
        require_whole(name, getattr(options, name), least)
    require_positive("radius", options.radius, "")
    require_tolerance(options.rtol)


def shown(report: GradientReport, units: dict[str, str]) -> GradientReport:
    """Return the report with slopes per unit in which each number was given."""

    def one(slope: Slope) -> Slope:
        _, factor = unit_of(slope.parameter, units)
        estimates = {
            name: (value * factor, error * factor)
            for name, (value, error) in slope.estimates.items()
        }
        value, error = slope.value * factor, slope.standard_error * factor
        return dataclasses.replace(slope, value=value, standard_error=error, estimates=estimates)

    slopes = {name: one(slope) for name, slope in report.slopes.items()}
    return dataclasses.replace(report, slopes=slopes, units={})


def content(report: GradientReport, of: str, machine: Machine) -> dict[str, Any]:
    """Return a report as JSON stores it; `of` is the unit of its statistic."""
    units = {name: f"({of})/({machine.numbers[name].unit})" for name in report.slopes}
    return {
        "metric": report.metric,
        "regime": report.regime.name,
        "period": report.regime.period,
        "evidence": list(report.regime.evidence),
        "horizon_turns": report.horizon,
        "growth": dict(zip(("value", "standard_error"), map(float, report.growth), strict=True)),
        "usable": report.usable,
        "slopes": {
            name: {"units": units[name], **dataclasses.asdict(slope)}
            for name, slope in report.slopes.items()
        },
    }


def restored(path: Path, settings: dict[str, Any]) -> dict[str, Any] | None:
    """Return the stored report if settings and environment are the same, else None.

    Raises ValueError for a folder with a report of other settings.
    """
    asked = earlier(path.with_name(SETTINGS), settings, "name")
    if asked is None or not path.exists():
        return None
    kept = json.loads(path.read_text(encoding="utf-8"))
    return kept if kept.get("environment") == json.dumps(environment()) else None

"""`python -m jaxcrusher regimes`: what kind of motion each of some designs has."""

import itertools
import json
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import tyro
import xarray as xr
from rich.console import Console
from rich.markup import escape

import jaxcrusher as jc
from jaxcrusher.basics.checks import require, require_positive, require_whole
from jaxcrusher.commands.options import Crusher, Ranges, Results, read_axes
from jaxcrusher.files.provenance import environment
from jaxcrusher.files.results import progress, provenance, write_json, write_netcdf
from jaxcrusher.scenes.parameters import PARAMETERS
from jaxcrusher.scenes.scene_file import read_text

# Name -> unit and meaning of a row's numbers.
COLUMNS = {
    "period": ("1", "turns after which the motion repeats"),
    "largest_exponent": ("1", "largest Lyapunov exponent a turn"),
    "largest_exponent_error": ("1", "its standard error"),
    "zero_one": ("1", "0-1 test: 0 order, 1 chaos"),
    "trend": ("1", "change of the section's spread, as a share"),
    "foundation_rms": ("N", "RMS of |R_O| + |R_C|"),
    "contact_fraction": ("1", "share of time in contact"),
    "winding": ("1", "revolutions of the pin round the bore per turn"),
    "seconds": ("s", "time it took"),
}
Designs = Annotated[
    tuple[str, ...], tyro.conf.UseAppendAction, tyro.conf.arg(metavar="KEY=VALUE,...")
]


@dataclass(frozen=True)
class Regimes:
    """Classify the motion of some designs: periodic, chaotic, whirl and so on.

    Writes OUT/NAME/regimes.json and regimes.nc after each design; the same command does not do
    again what is done, and may name further designs. With the default turns about a minute for
    the first design, most of it compilation, and 5 to 30 s for each of the others.
    """

    crusher: Crusher = field(default_factory=Crusher)
    over: Ranges = ()
    """A parameter and its range, or a choice and what to choose, as in sweep; the grid is the
    product of all."""
    design: Designs = ()
    """A design of a list instead, as in --design "speed=25,clearance=0.03 mm". May be repeated;
    all name the same keys. Without --over and --design: the crusher as it is."""
    settle: int = 200
    """Turns of the shaft before the motion is looked at."""
    turns: int = 1000
    """Turns of which the section is looked at."""
    tangent_turns: int = 100
    """Further turns for the exponents."""
    rtol: float = 1e-10
    """Tolerance of a step, in clearances and m/s."""
    results: Results = field(default_factory=lambda: Results("regimes"))

    def run(self, console: Console) -> int:
        """Classify what is not done yet; 1 if a run failed. ValueError for bad options."""
        values, designs = self.crusher.moving(), self.designs()
        for name, least in (("settle", 0), ("turns", 1), ("tangent_turns", 1)):
            require_whole(name, getattr(self, name), least)
        require_positive("rtol", self.rtol, "")
        scenes = [jc.build_scene({**values, **design}) for design in designs]
        settings = self._settings(values, list(designs[0]))
        folder = self.results.folder()
        done = read_rows(folder / "regimes.json", settings)
        attributes = provenance("Regimes of a jaw crusher's motion", values)
        asked = []
        with progress(console) as bars:
            bar = bars.add_task("designs", total=len(designs))
            for design, scene in zip(designs, scenes, strict=True):
                row = next((row for row in done if row["design"] == design), None)
                kept = " (done before)" if row else ""
                if row is None:
                    began = time.perf_counter()
                    verdict = jc.regime(
                        scene,
                        self.settle,
                        self.turns,
                        rtol=self.rtol,
                        tangent_turns=self.tangent_turns,
                    )
                    row = _row(design, verdict, time.perf_counter() - began)
                    done.append(row)
                    content = {**attributes, "settings": settings, "rows": done}
                    write_json(folder / "regimes.json", content)
                    write_netcdf(folder / "regimes.nc", dataset(done, settings, attributes))
                asked.append(row)
                bars.console.print(
                    escape(f"{_name(design)}: {row['verdict']}{kept}"),
                    highlight=False,
                    soft_wrap=True,
                )
                bars.advance(bar)
        failed = sum(row["regime"] == "failed" for row in asked)
        remark = f", {failed} failed" if failed else ""
        console.print(
            f"{len(asked)} designs{remark}; {folder / 'regimes.json'}, {folder / 'regimes.nc'}",
            highlight=False,
        )
        return 1 if failed else 0

    def designs(self) -> list[dict[str, Any]]:
        """The designs asked for, in SI units; ValueError for ones that cannot be read."""
        require(not (self.over and self.design), "design", "stand instead of over", "given with it")
        if self.over:
            axes = read_axes(self.over)
            return [
                dict(zip(axes, cell, strict=True)) for cell in itertools.product(*axes.values())
            ]
        if not self.design:
            return [{}]
        designs = [_design(text) for text in self.design]
        for design in designs:
            require(
                list(design) == list(designs[0]),
                "design",
                f"name {', '.join(designs[0])} as the first one does",
                ", ".join(design),
            )
        return designs

    def _settings(self, values: dict[str, Any], varied: list[str]) -> dict[str, Any]:
        """Everything that decides the rows besides their designs, as JSON keeps it."""
        return {
            "varied": varied,
            "scene": {name: value for name, value in values.items() if name not in varied},
            "settle": self.settle,
            "turns": self.turns,
            "tangent_turns": self.tangent_turns,
            "rtol": self.rtol,
            "versions": environment()["versions"],
        }


def read_rows(path: Path, settings: dict[str, Any]) -> list[dict[str, Any]]:
    """The rows done before; ValueError if they were made with other settings."""
    if not path.exists():
        return []
    try:
        content = json.loads(path.read_text())
        rows, before = list(content["rows"]), dict(content["settings"])
    except (ValueError, KeyError, TypeError):
        raise ValueError(f"{path} is not readable; choose another --name, or delete it.") from None
    now = settings | settings["scene"] | settings["versions"]
    then = before | before.get("scene", {}) | before.get("versions", {})
    differ = [name for name in {**then, **now} if then.get(name) != now.get(name)]
    named = [name for name in differ if name not in ("scene", "versions")]
    require(
        not differ,
        "name",
        f"be another one for other settings: {path} has another {', '.join(named)}",
        path.parent.name,
    )
    return rows


def dataset(rows: list[dict], settings: dict, attributes: dict[str, str]) -> xr.Dataset:
    """The rows, with the varied names as coordinates along them."""
    coordinates = {}
    for name in settings["varied"]:
        known = PARAMETERS.get(name)
        labels = {"units": known.unit, "long_name": known.meaning} if known else {}
        coordinates[name] = ("design", [row["design"][name] for row in rows], labels)
    variables: dict[str, Any] = {
        "regime": ("design", [row["regime"] for row in rows], {"long_name": "kind of motion"})
    }
    for name, (unit, meaning) in COLUMNS.items():
        column = [np.nan if row[name] is None else float(row[name]) for row in rows]
        variables[name] = ("design", column, {"units": unit, "long_name": meaning})
    return xr.Dataset(variables, coordinates, {**attributes, "settings": json.dumps(settings)})


def _row(design: dict[str, Any], verdict: jc.Regime, seconds: float) -> dict[str, Any]:
    exponents, summary = verdict.exponents, verdict.statistics
    row: dict[str, Any] = {
        "design": design,
        "regime": verdict.name,
        "verdict": str(verdict),
        "period": verdict.period,
        "largest_exponent": None if exponents is None else float(exponents.exponents[0]),
        "largest_exponent_error": None if exponents is None else float(exponents.errors[0]),
        "zero_one": verdict.zero_one,
        "trend": verdict.trend,
        "seconds": round(seconds, 3),
    }
    for name in ("foundation_rms", "contact_fraction", "winding"):
        value = getattr(summary, name, None)
        row[name] = None if value is None else float(np.asarray(value))
    return row


def _design(text: str) -> dict[str, Any]:
    design = {}
    for part in text.split(","):
        name, equals, value = part.partition("=")
        require(bool(equals), "design", "be KEY=VALUE,KEY=VALUE", repr(text))
        design[name.strip()] = read_text(name.strip(), value.strip())
    return design


def _name(design: dict[str, Any]) -> str:
    """A design in words."""
    words = []
    for name, value in design.items():
        unit = PARAMETERS[name].unit if name in PARAMETERS else ""
        words.append(
            f"{name} {value if isinstance(value, str) else f'{value:.6g}'} {unit}".rstrip()
        )
    return ", ".join(words) or "the crusher"

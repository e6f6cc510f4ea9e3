"""`python -m jaxcrusher foundation`: the load sheet of a crusher's foundation."""

import base64
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
from jaxtyping import Array, Scalar
from jinja2 import Environment
from rich.console import Console
from rich.table import Table

import jaxcrusher as jc
from jaxcrusher.basics.checks import require, require_whole
from jaxcrusher.commands.crushers import read_crusher, settings_of, units_given
from jaxcrusher.commands.options import Foundation
from jaxcrusher.files.progress import stages
from jaxcrusher.files.provenance import provenance
from jaxcrusher.files.results import listed, write_figure, write_json, write_table, write_text
from jaxcrusher.files.resume import begin_beside
from jaxcrusher.orbits.forced import refusal
from jaxcrusher.orbits.load_sheet import SOURCE, Row, joint_states, running_frequency, sheet
from jaxcrusher.orbits.result import PeriodicOrbit
from jaxcrusher.orbits.solving import NODES
from jaxcrusher.scenes.echo import said
from jaxcrusher.scenes.scene_file import read_range

TITLE = "Load sheet of a jaw crusher's foundation"
FILES = ("sheet.csv", "sheet.html", "run_up.png", "sheet.json")
# Statistic -> its name in the picture; of a clamped frame the first alone.
CURVES = {"shaking_rms": "shaking force", "transmitted_rms": "force on the ground"}
PAGE = Path(__file__).with_name("load_sheet.html")
REMEDY = (
    "`--set joint ideal` gives the sheet with an ideal main bearing, whose forces are exact and "
    "lack the impacts alone (without clearance in B and C as well, if these are loose). Any motion "
    "has averages and peaks: `python -m jaxcrusher simulate --turns 200`."
)


def run(options: Foundation, console: Console) -> int:
    """Solve, print, write; 1 if there is no orbit. ValueError for bad options."""
    require_whole("orders", options.orders, 1)
    require_whole("points", options.points, 2)
    values, scene = read_crusher(options.crusher)
    if refused := refusal(scene):
        raise ValueError(f"The crusher must {refused}.")
    low, high = _speeds(options, float(values["speed"]))
    numbers = {"orders": options.orders, "speeds": [low, high], "points": options.points}
    settings = settings_of("foundation", values, **numbers)
    folder = begin_beside(options.results.folder, settings, *FILES)
    with stages(console, "solving (the first time half a minute, most of it compilation)"):
        orbit = jc.periodic_orbit(scene)
    if not bool(orbit.success):
        console.print(f"no periodic orbit: {orbit.failure}")
        console.print(REMEDY)
        return 1
    rows = sheet(orbit, options.orders)
    speeds = np.linspace(low, high, options.points)
    with console.status("running up"):
        curves = run_up(values, speeds)
    draw(orbit, speeds, curves, folder / "run_up.png")
    write_table(folder / "sheet.csv", [asdict(row) for row in rows])
    units = units_given(options.crusher)
    given = [(name, said(name, values[name], units)) for name in values if _is_told(name)]
    picture = base64.b64encode((folder / "run_up.png").read_bytes()).decode()
    write_text(folder / "sheet.html", page(orbit, rows, given, picture))
    write_json(
        folder / "sheet.json",
        provenance("Load sheet of a foundation", scene=values)
        | {"rows": [asdict(row) for row in rows], "speed": speeds, **curves},
    )
    console.print(f"{TITLE}: {joint_states(scene)}.")
    for part, lines in texts(rows).items():
        console.print(table(part, lines), soft_wrap=False)
    if scene.supports is None:
        console.print("The frame is clamped: foundation.mass puts it on supports.")
    else:
        console.print(f"Zones of {SOURCE}.")
    console.print(listed(folder, FILES[:3]))
    return 0


def _speeds(options: Foundation, speed: float) -> tuple[float, float]:
    if options.speeds is None:
        return speed / 2, 2 * speed
    low, high = read_range("speed", *options.speeds)
    require(low < high, "speeds", "be LOW HIGH, the first below the second", options.speeds)
    return low, high


def _is_told(name: str) -> bool:
    """Whether the page's head names a number of the scene."""
    return name.startswith(("foundation.", "counterweight.")) or name == "speed"


def run_up(values: dict[str, Any], speeds: np.ndarray) -> dict[str, np.ndarray]:
    """Return the RMS of what shakes over the speed with ideal joints, N.

    These have an orbit at every speed, and shake as a quiet motion with clearance does.
    """
    names = [name for name in CURVES if name != "transmitted_rms" or "foundation.mass" in values]

    @eqx.filter_jit
    def at(speed: Scalar) -> Array:
        orbit = jc.periodic_orbit(jc.build_scene({**values, "speed": speed}).ideal(), nodes=NODES)
        return jnp.stack([orbit[name] for name in names])

    forces = np.array([at(jnp.asarray(speed)) for speed in speeds])
    return dict(zip(names, forces.T, strict=True))


def draw(
    orbit: PeriodicOrbit, speeds: np.ndarray, curves: dict[str, np.ndarray], path: Path
) -> None:
    """Draw what shakes over the speed, with the speeds whose harmonics meet a natural frequency."""
    fig, ax = plt.subplots(figsize=(7, 3.2))
    minutes = 30 / np.pi * speeds
    for name, values in curves.items():
        ax.plot(minutes, 1e-3 * values, label=f"RMS of the {CURVES[name]}")
    ax.axvline(60 * running_frequency(orbit), color="0.3", lw=0.8, label="running speed")
    if orbit.scene.supports is not None:
        for frequency in jc.natural_modes(orbit.scene).frequency.values:
            for order, style in ((1, "-"), (2, ":")):
                critical = 60 * frequency / order
                if minutes[0] <= critical <= minutes[-1]:
                    ax.axvline(critical, color="C3", ls=style, lw=0.8)
    ax.set(xlabel="shaft speed, rpm", ylabel="force, kN", xlim=(minutes[0], minutes[-1]))
    ax.set_title("ideal joints", fontsize=8)
    ax.set_ylim(bottom=0)
    ax.legend(fontsize=8)
    fig.tight_layout()
    write_figure(path, fig, dpi=150)


def _number(value: float | str) -> str:
    if isinstance(value, str):
        return value
    return f"{value:.0f}" if abs(value) >= 1e4 else f"{value:z.4g}"


def cells(row: Row) -> tuple[str, ...]:
    """Return the texts of a row, for the screen and the page."""
    if isinstance(row.phase, str):
        return row.name, _number(row.value), row.unit, row.remark
    phase = np.degrees(row.phase)
    return row.name, _number(row.order), _number(row.value), row.unit, f"{phase:z.1f}"


def texts(rows: Sequence[Row]) -> dict[str, list[tuple[str, ...]]]:
    """Return the texts of the rows by the part of the sheet."""
    parts: dict[str, list[tuple[str, ...]]] = {}
    for row in rows:
        parts.setdefault(row.part, []).append(cells(row))
    return parts


def table(part: str, lines: Sequence[tuple[str, ...]]) -> Table:
    """Return a part of the sheet for the screen."""
    harmonic = part == "harmonics"
    headings = ("", "order", "amplitude", "unit", "phase, deg") if harmonic else ("", "", "", "")
    shown = Table(*headings, title=part, title_justify="left", box=None, show_header=harmonic)
    for line in lines:
        shown.add_row(*line)
    return shown


def across(lines: Sequence[tuple[str, ...]]) -> tuple[list[str], list[list[str]]]:
    """Return the orders of the harmonics, and a row of each quantity: name, unit, harmonics."""
    by_name: dict[str, list[str]] = {}
    for name, _, amplitude, unit, phase in lines:
        by_name.setdefault(name, [name, unit]).append(f"{amplitude} at {phase}°")
    return list(dict.fromkeys(order for _, order, *_ in lines)), list(by_name.values())


def page(
    orbit: PeriodicOrbit, rows: Sequence[Row], given: Sequence[tuple[str, str]], picture: str
) -> str:
    """Return the printable page."""
    parts = texts(rows)
    orders, harmonics = across(parts.pop("harmonics", []))
    clamped = orbit.scene.supports is None
    return (
        Environment(autoescape=True)
        .from_string(PAGE.read_text(encoding="utf-8"))
        .render(
            title=f"{TITLE}: {joint_states(orbit.scene)}",
            parts=parts,
            orders=orders,
            harmonics=harmonics,
            given=given,
            picture=picture,
            source="" if clamped else SOURCE,
            running=f"{running_frequency(orbit):.3f} Hz",
            made=provenance("")["source"],
        )
    )

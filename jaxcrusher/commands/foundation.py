"""`python -m jaxcrusher foundation`: the load sheet of a crusher's foundation."""

import base64
import dataclasses
import datetime
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
from jaxcrusher.basics.checks import require, require_positive, require_whole
from jaxcrusher.commands.crushers import borrowed_by, read_machine, settings_of
from jaxcrusher.commands.options import Crusher, Foundation
from jaxcrusher.crusher.capacity import stroke, stroke_ratio
from jaxcrusher.crusher.scene import Scene
from jaxcrusher.files.progress import stages
from jaxcrusher.files.provenance import provenance
from jaxcrusher.files.results import listed, write_figure, write_json, write_table, write_text
from jaxcrusher.files.resume import begin_beside
from jaxcrusher.files.table import digits, with_scatter
from jaxcrusher.mechanism.linkage_scene import LinkageScene
from jaxcrusher.mechanism.reductions import require_orders, samples_of
from jaxcrusher.mechanism.scene import AbstractScene
from jaxcrusher.motion.turns import Turns, require_turns, run_turns
from jaxcrusher.orbits.load_sheet import (
    MOVING,
    Row,
    Site,
    beside,
    joint_states,
    quantities_of,
    running_frequency,
    sheet,
)
from jaxcrusher.orbits.severity import SOURCE
from jaxcrusher.orbits.solving import NODES
from jaxcrusher.scenes.build import build_chamber
from jaxcrusher.scenes.described import Described
from jaxcrusher.scenes.echo import all_said
from jaxcrusher.scenes.parameters import NUMBERS
from jaxcrusher.scenes.scene_file import points_of, quantity_in, read_range

TITLE = "Load sheet of a machine's foundation"
FILES = ("sheet.csv", "sheet.html", "run_up.png", "sheet.json")
# Statistic -> its name in the picture; of a clamped frame the first alone.
CURVES = {"shaking_rms": "shaking force", "transmitted_rms": "force on the ground"}
PAGE = Path(__file__).with_name("load_sheet.html")
SIGNS = (
    "Forces are those on the ground: x to the right, y up, moments counterclockwise. Harmonics are "
    "A cos(k theta + phi) of the shaft angle theta at mean speed, 0 where the eccentric is at +x."
)
FACTOR = "The dynamic factor counts what moves; 3 is the fatigue factor of DIN 4024-1, from memory."


def run(options: Foundation, console: Console) -> int:
    """Solve, run, print, write; 1 if the loose machine's run failed. ValueError for bad options."""
    require_orders(options.orders)
    require_whole("points", options.points, 2)
    require_positive("seconds", options.seconds, "s")
    require_turns(options.settle, options.turns)
    found = read_machine(options.crusher)
    values, scene = found.values, found.scene
    site = site_of(values, options)
    low, high = _speeds(options, float(values["speed"]))
    numbers = {name: getattr(options, name) for name in ("orders", "points", "settle", "turns")}
    told = {"site": asdict(site), "speeds": [low, high], "seconds": options.seconds}
    folder = begin_beside(
        options.results.folder,
        settings_of("foundation", values, **numbers, **told, **found.structure),
        *FILES,
    )
    with stages(console, "ideal joints"):
        orbit = jc.periodic_orbit(quiet(scene))
        require(bool(orbit.success), "scene", "have an orbit with ideal joints", orbit.failure)
        rows, turns = sheet(orbit, options.orders, site), None
    if not scene.is_ideal:
        with stages(console, "loose joints"):
            turns = run_turns(
                scene,
                samples_of(quantities_of(scene)),
                settle=options.settle,
                turns=options.turns,
                seconds=options.seconds,
            )
        if not turns.failure:
            rows = beside(sheet(turns, options.orders, site), rows)
    speeds = np.linspace(low, high, options.points)
    with console.status("run-up"):
        curves = run_up(scene, speeds)
    head = heading(found, options.crusher, turns)
    write_table(folder / "sheet.csv", [asdict(row) for row in rows])
    write_json(
        folder / "sheet.json",
        provenance("Load sheet of a foundation", scene=values)
        | {"rows": [asdict(row) for row in rows], "speed": speeds, "about": head, **curves},
    )
    draw(scene, speeds, curves, folder / "run_up.png")
    picture = base64.b64encode((folder / "run_up.png").read_bytes()).decode()
    write_text(folder / "sheet.html", page(scene, rows, head, picture))
    console.print(TITLE)
    for name, text in head.items():
        console.print(f"{name}: {text}")
    for part, lines in grids(rows).items():
        console.print(table(part, lines), soft_wrap=False)
    console.print(f"{SIGNS} {FACTOR}")
    if scene.supports is None:
        console.print("The frame is clamped: foundation.mass puts it on supports.")
    else:
        console.print(f"Zones of {SOURCE}.")
    console.print(listed(folder, FILES[:3]))
    return 1 if turns is not None and turns.failure else 0


def site_of(values: dict[str, Any], options: Foundation) -> Site:
    """Return what the sheet knows besides the motion; ValueError for what is out of range."""
    low, high = options.resonance
    require(0 < low < high, "resonance", "be two numbers, 0 < LOW < HIGH", options.resonance)
    factor = options.dynamic_factor
    require(1 <= factor < np.inf, "dynamic_factor", "be >= 1 and finite", factor)
    seconds = quantity_in("s", "run_up", options.run_up)
    require_positive("run_up", seconds, "s")
    power, frame = values.get("motor_power"), values.get("frame_mass")
    return Site(power, frame, points_of(values), (low, high), options.dynamic_factor, seconds)


def heading(found: Described, crusher: Crusher, turns: Turns | None) -> dict[str, str]:
    """Return what the sheet is of: machine, joints, loads, masses, and what was assumed."""
    units, values, scene, given = found.units, found.values, found.scene, found.given
    name = "PE250x400" if crusher.scene is None else crusher.scene.stem
    if crusher.overrides:
        name += f" with {', '.join(f'{key} {value}' for key, value in crusher.overrides)}"

    def told(*keys: str) -> str:
        return all_said({key: values[key] for key in keys if key in values}, units)

    parts = [key for key in NUMBERS if key.startswith(("foundation.", "rollers."))]
    assumed = [key for key in (*parts, "load_law", "contact_law") if key not in given]
    head = {
        "machine": name,
        "date": datetime.date.today().isoformat(),
        "joints": joint_states(scene),
        "running": f"{told('speed')}, {running_frequency(scene):.4g} Hz",
    }
    if isinstance(scene, Scene):
        loads = "load_law", "load", "load_point", "load_edge", "load_scatter"
        masses = "shaft.mass", "jaw.mass", "toggle.mass", "counterweight.mass", "frame_mass"
        head |= {
            "crushing": _crushing(scene, values),
            "loads": told(*loads),
            "masses": told(*masses),
        }
        assumed = told(*assumed)
    else:
        head["masses"] = told(*(f"bodies.{name}.mass" for name in scene.linkage.bodies.names))
        assumed = ", ".join(found.defaults)
    head |= {
        "foundation": told(*(n for n in parts if n in given and "foundation" in n)) or "clamped",
        "assumed": assumed or "nothing",
    }
    if isinstance(scene, Scene):
        head["from the PE250x400"] = ", ".join(borrowed_by(crusher, found)) or "nothing"
    if turns is not None and turns.failure:
        head["loose joints"] = f"the run failed: {turns.failure}"
    elif turns is not None:
        head["loose joints"] = (
            f"{turns.pieces} turns after {turns.settled}; ideal | loose ± standard error, of peaks "
            "± standard deviation of the turns' peaks. Impacts rest on the edge of the load and on "
            "damping, which are assumed: `python -m jaxcrusher bearing` has half and twice of them"
        )
    return head


def _crushing(scene: Scene, values: dict[str, Any]) -> str:
    """Say stroke and capacity of a machine."""
    travel, ratio = 1e3 * float(stroke(scene.machine)), float(stroke_ratio(scene.machine))
    capacity = float(build_chamber(values).capacity(scene.drive.speed))
    told = (
        f"stroke at the discharge {travel:.3g} mm horizontally, {ratio:.2f} times that vertically"
    )
    return f"{told}, capacity {capacity:.3g} m3/h by laminating theory"


def _speeds(options: Foundation, speed: float) -> tuple[float, float]:
    if options.speeds is None:
        return speed / 2, 2 * speed
    low, high = read_range("speed", *options.speeds)
    require(low < high, "speeds", "be LOW HIGH, the first below the second", options.speeds)
    return low, high


def quiet(scene: AbstractScene) -> AbstractScene:
    """Return the machine with ideal joints, and without what closes inside it.

    Load and rod, and forces and springs of another linkage, push the frame as they push its
    bodies, whose motion is given: the ground feels none of them.
    """
    inside: dict[str, Any] = {"load": None, "rod": None}
    if isinstance(scene, LinkageScene):
        inside = {"pushes": (), "springs": ()}
    return dataclasses.replace(scene.ideal(), **inside)


def run_up(scene: AbstractScene, speeds: np.ndarray) -> dict[str, np.ndarray]:
    """Return the RMS of what shakes over the speed with ideal joints, N.

    These have an orbit at every speed, and shake as a quiet motion with clearance does.
    """
    names = [name for name in CURVES if name != "transmitted_rms" or scene.supports is not None]
    still = quiet(scene)

    @eqx.filter_jit
    def at(speed: Scalar) -> Array:
        orbit = jc.periodic_orbit(eqx.tree_at(lambda s: s.drive.speed, still, speed), nodes=NODES)
        return jnp.stack([orbit[name] for name in names])

    forces = np.array([at(jnp.asarray(speed)) for speed in speeds])
    return dict(zip(names, forces.T, strict=True))


def draw(
    scene: AbstractScene, speeds: np.ndarray, curves: dict[str, np.ndarray], path: Path
) -> None:
    """Draw what shakes over the speed, with the speeds whose harmonics meet a natural frequency."""
    fig, ax = plt.subplots(figsize=(4.4, 3.2))
    minutes = 30 / np.pi * speeds
    for name, values in curves.items():
        ax.plot(minutes, 1e-3 * values, label=f"RMS of the {CURVES[name]}")
    ax.axvline(60 * running_frequency(scene), color="0.3", lw=0.8, label="running speed")
    if scene.supports is not None:
        for frequency in jc.natural_modes(scene).frequency.values:
            for order, style in ((1, "-"), (2, ":")):
                critical = 60 * frequency / order
                if minutes[0] <= critical <= minutes[-1]:
                    ax.axvline(critical, color="C3", ls=style, lw=0.8)
    ax.set(xlabel="shaft speed, rpm", ylabel="force, kN", xlim=(minutes[0], minutes[-1]))
    ax.set_title("ideal joints", fontsize=8)
    ax.set_ylim(bottom=0)
    ax.legend(fontsize=8)
    fig.tight_layout()
    write_figure(path, fig, dpi=200)


def _number(value: float | str, least: float) -> str:
    """Return a number with four digits, and zero for one below the least."""
    if isinstance(value, str):
        return value
    return digits(_seen(value, least))


def _seen(value: float, least: float) -> float:
    return value if abs(value) >= least else 0.0


def _amount(row: Row, largest: float) -> str:
    """Return a number with its scatter and phase, and that of ideal joints where it differs.

    Nothing is seen below half of a thousandth of the unit, or of the `largest` of a small machine;
    a millionth of the unit is rounding.
    """
    least = 5e-4 * float(np.clip(largest, 1e-6, 1.0))
    value, ideal = _number(row.value, least), _number(row.ideal, least)
    before = "" if ideal in ("", value) else f"{ideal} | "
    if row.scatter != "" and float(row.scatter) > 1e-4 * abs(row.value):
        value = with_scatter(_seen(row.value, least), _seen(float(row.scatter), least))
    phase = "" if isinstance(row.phase_rad, str) else f" at {np.degrees(row.phase_rad):z.0f}°"
    return f"{before}{value}{phase if value != '0' else ''}"


def grids(rows: Sequence[Row]) -> dict[str, list[tuple[str, ...]]]:
    """Return the parts of the sheet as grids of text with a line of headings.

    A line is a quantity, with a column for each of its orders, and remarks in the last one.
    """
    found = {}
    # What moves is long, and stands in the file alone.
    for part in dict.fromkeys(row.part for row in rows if row.part != MOVING):
        inside = [row for row in rows if row.part == part]
        orders = list(dict.fromkeys(row.order for row in inside))
        named = [order if isinstance(order, str) else f"order {order:g}" for order in orders]
        lines = [("", "unit", *named, "")] if any(named) else []
        for name in dict.fromkeys(row.name for row in inside):
            own = {row.order: row for row in inside if row.name == name}
            unit = next(iter(own.values())).unit
            largest = max(abs(row.value) for row in inside if row.unit == unit)
            amounts = [_amount(own[order], largest) if order in own else "" for order in orders]
            remarks = "; ".join(row.remark for row in own.values() if row.remark)
            lines.append((name, unit, *amounts, remarks))
        found[part] = lines
    return found


def table(part: str, lines: Sequence[tuple[str, ...]]) -> Table:
    """Return a part of the sheet for the screen."""
    shown = Table(title=part, title_justify="left", box=None, show_header=False)
    for line in lines:
        shown.add_row(*line)
    return shown


def page(scene: AbstractScene, rows: Sequence[Row], head: dict[str, str], picture: str) -> str:
    """Return the printable page."""
    return (
        Environment(autoescape=True)
        .from_string(PAGE.read_text(encoding="utf-8"))
        .render(
            title=TITLE,
            head=head,
            grids=grids(rows),
            picture=picture,
            signs=f"{SIGNS} {FACTOR}",
            source="" if scene.supports is None else SOURCE,
            made=provenance("")["source"],
        )
    )

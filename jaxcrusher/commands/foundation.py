"""`python -m jaxcrusher foundation`: the load sheet of a crusher's foundation."""

import base64
import dataclasses
import datetime
from collections.abc import Mapping, Sequence
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
from jaxcrusher.basics.checks import renamed, require, require_positive, require_whole
from jaxcrusher.commands.machines import borrowed_by, read_machine, settings_of, variants_of
from jaxcrusher.commands.options import Crusher, Foundation
from jaxcrusher.files.progress import stages
from jaxcrusher.files.provenance import provenance
from jaxcrusher.files.results import listed, write_figure, write_json, write_table, write_text
from jaxcrusher.files.resume import begin_beside
from jaxcrusher.files.text import number, with_error
from jaxcrusher.mechanism.reductions import require_orders
from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.mechanism.supports import Clamped
from jaxcrusher.motion.turns import Turns, require_turns, run_turns
from jaxcrusher.orbits.solving import NODES
from jaxcrusher.scenes.machine import Machine
from jaxcrusher.scenes.reader import read_range
from jaxcrusher.scenes.units import all_said, points_of, quantity_in
from jaxcrusher.sheets.load_sheet import (
    AMPLIFIED,
    MATTERS,
    MOVING,
    Row,
    Site,
    beside,
    between,
    joint_states,
    knocks,
    loses_contact,
    moving_rms,
    outputs_of,
    running_frequency,
    sheet,
    static_loads,
)
from jaxcrusher.sheets.natural_modes import amplification
from jaxcrusher.sheets.severity import SOURCE

TITLE = "Load sheet of a machine's foundation"
FILES = ("sheet.csv", "sheet.html", "run_up.png", "sheet.json")
# RMS -> its name, colour and mark in the picture; of a clamped frame the first alone.
CURVES = {
    "exciting_rms": ("exciting force", "C0", "o"),
    "transmitted_rms": ("force on the ground", "C1", "s"),
}
PAGE = Path(__file__).with_name("load_sheet.html")
SIGNS = (
    "Forces are those on the frame and on the ground: x to the right, y up, moments "
    "counterclockwise. Harmonics are A cos(k theta + phi) of the shaft angle theta at mean speed, "
    "0 where the eccentric is at +x. An exciting force is that on a frame at rest, less its mean, "
    "and belongs into a model that has the machine's whole mass."
)
RESONANCE = (
    "A mode is in resonance with an order near its natural frequency if it amplifies that order "
    f"{AMPLIFIED:g} times or more, and makes {100 * MATTERS:g} % or more of the block's RMS speed."
)
FACTOR = "The dynamic factor counts what moves; 3 is the fatigue factor of DIN 4024-1, from memory."


def run(options: Foundation, console: Console) -> int:
    """Solve, run, print, write; 1 if the loose machine's run failed. ValueError for bad options."""
    require_orders(options.orders)
    require_whole("points", options.points, 2)
    require_positive("seconds", options.seconds, "s")
    require_turns(options.settle, options.turns)
    found = read_machine(options.crusher)
    values, scene = found.values, found.scene()
    site = site_of(values, options)
    low, high = _speeds(options, float(values["speed"]))
    numbers = {name: getattr(options, name) for name in ("orders", "points", "settle", "turns")}
    told = {"site": asdict(site), "speeds": [low, high], "seconds": options.seconds}
    settings = settings_of("foundation", found, **numbers, **told)
    folder = begin_beside(options.results.folder, settings, *FILES)
    with stages(console, "ideal joints"):
        orbit = jc.periodic_orbit(quiet(scene))
        require(bool(orbit.success), "scene", "have an orbit with ideal joints", orbit.failure)
        rows, turns = sheet(orbit, options.orders, site), None
    loose, varied = {}, ""
    if not scene.is_ideal:
        outputs = outputs_of(scene)

        def run_of(one: Scene, seconds: float) -> Turns:
            how = {"settle": options.settle, "turns": options.turns, "seconds": seconds}
            return run_turns(one, outputs, **how)

        with stages(console, "loose joints"):
            turns = run_of(scene, options.seconds)
        if not turns.failure:
            rows, loose = beside(sheet(turns, options.orders, site), rows), moving_rms(turns)
        if not turns.failure and loses_contact(turns):
            scenes, refused = variants_of(found, values, found.units)
            runs = {}
            for title, other in scenes.items():
                with stages(console, title):
                    runs[title] = run_of(other, options.seconds / (2 * len(scenes)))
            refused += [f"Without {t}: {run.failure}" for t, run in runs.items() if run.failure]
            runs = {title: run for title, run in runs.items() if not run.failure}
            rows = between(rows, [static_loads(run, site) for run in runs.values()])
            varied = " ".join([ranges(list(runs)), *refused])
    speeds = np.linspace(low, high, options.points)
    with console.status("run-up"):
        curves = run_up(scene, speeds)
    head = heading(found, options.crusher, turns)
    if varied and turns is not None:
        head["equivalent loads"] = varied
        head["knocks"] = knocks(turns, rows, options.orders)
    write_table(folder / "sheet.csv", [asdict(row) for row in rows])
    write_json(
        folder / "sheet.json",
        provenance("Load sheet of a foundation", scene=values)
        | {"rows": [asdict(row) for row in rows], "speed": speeds, "about": head, **curves}
        | {f"loose_{name}": values for name, values in loose.items()},
    )
    draw(scene, speeds, curves, loose, folder / "run_up.png")
    picture = base64.b64encode((folder / "run_up.png").read_bytes()).decode()
    write_text(folder / "sheet.html", page(scene, rows, head, picture))
    console.print(TITLE)
    for name, text in head.items():
        console.print(f"{name}: {text}")
    for part, lines in grids(rows).items():
        shown = Table(title=part, title_justify="left", box=None, show_header=False)
        for line in lines:
            shown.add_row(*line)
        console.print(shown, soft_wrap=False)
    console.print(f"{SIGNS} {FACTOR}")
    if scene.supports is None:
        console.print("The frame is clamped: foundation.mass puts it on supports.")
    else:
        console.print(f"{RESONANCE} Zones of {SOURCE}.")
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


def heading(found: Machine, crusher: Crusher, turns: Turns | None) -> dict[str, str]:
    """Return what the sheet is of: machine, joints, loads, masses, and what was assumed."""
    name = "PE250x400" if crusher.scene is None else crusher.scene.stem
    if crusher.overrides:
        name += f" with {', '.join(f'{key} {value}' for key, value in crusher.overrides)}"
    speed, scene = all_said({"speed": found.values["speed"]}, found.units), found.scene()
    head = {
        "machine": name,
        "date": datetime.date.today().isoformat(),
        "joints": joint_states(scene),
        "running": f"{speed}, {running_frequency(scene):.4g} Hz",
        **found.structure.about(found),
    }
    if borrowed := borrowed_by(crusher, found):
        head["from the PE250x400"] = ", ".join(borrowed)
    if turns is not None and turns.failure:
        head["loose joints"] = f"the run failed: {turns.failure}"
    elif turns is not None:
        head["loose joints"] = (
            f"{turns.pieces} turns after {turns.settled}; ideal | loose ± standard error, of peaks "
            "± standard deviation of the turns' peaks"
        )
    return head


def ranges(titles: Sequence[str]) -> str:
    """Say over what the equivalent loads of a machine that knocks have a range."""
    rests = "impacts rest on the edge of the load and on damping, which are assumed"
    over = f"in brackets is the range over {', '.join(titles)}"
    return f"{rests}; {over if titles else 'the scene has no number of either to be varied'}"


def _speeds(options: Foundation, speed: float) -> tuple[float, float]:
    if options.speeds is None:
        return speed / 2, 2 * speed
    with renamed(speed="speeds"):
        low, high = read_range("speed", *options.speeds)
    require(low < high, "speeds", "be LOW HIGH, the first below the second", options.speeds)
    return low, high


def quiet(scene: Scene) -> Scene:
    """Return the machine with ideal joints, and without what closes inside it.

    Forces and springs push the frame as they push its bodies, whose motion is given: the ground
    feels none of them.
    """
    return dataclasses.replace(scene.ideal(), pushes=(), springs=())


def run_up(scene: Scene, speeds: np.ndarray) -> dict[str, np.ndarray]:
    """Return the RMS of what shakes over the speed with ideal joints, N.

    These have an orbit at every speed, and shake as a quiet motion with clearance does. A frame on
    supports is excited as one at rest shakes.
    """
    still, supports = quiet(scene), scene.supports
    held, loads = still, list(CURVES)[:1]
    if supports is not None:
        held, loads = dataclasses.replace(still, foundation=Clamped(supports.point)), list(CURVES)

    @eqx.filter_jit
    def at(speed: Scalar) -> list[Array]:
        forces = []
        for one, name in ((held, "shaking_rms"), (still, "transmitted_rms"))[: len(loads)]:
            turning = eqx.tree_at(lambda s: s.drive.speed, one, speed)
            forces.append(jc.periodic_orbit(turning, nodes=NODES)[name])
        return forces

    forces = np.array([at(jnp.asarray(speed)) for speed in speeds])
    return dict(zip(loads, forces.T, strict=True))


def draw(
    scene: Scene,
    speeds: np.ndarray,
    curves: Mapping[str, np.ndarray],
    loose: Mapping[str, np.ndarray],
    path: Path,
) -> None:
    """Draw what shakes over the speed, and the speeds whose harmonics meet a natural frequency.

    `curves` (N) are of ideal joints. `loose` has the turns of a run with loose joints at the
    running speed: their mean and their standard deviation are drawn. A mode that is damped too well
    to amplify anything has no speed of its own.
    """
    fig, ax = plt.subplots(figsize=(4.4, 3.6), layout="constrained")
    minutes, running = 30 / np.pi * speeds, 60 * running_frequency(scene)
    for name, values in curves.items():
        words, colour, _ = CURVES[name]
        ax.plot(minutes, 1e-3 * values, color=colour, label=f"{words}, ideal")
    for name, values in loose.items():
        words, colour, mark = CURVES[name]
        mean, scatter = 1e-3 * values.mean(), 1e-3 * values.std(ddof=1)
        style = {"color": colour, "fmt": mark, "mfc": "none", "ms": 5, "capsize": 3}
        ax.errorbar(running, mean, scatter, **style, label=f"{words}, loose ± scatter")
    ax.axvline(running, color="0.3", lw=0.8, label="running speed")
    if scene.supports is not None:
        modes = jc.natural_modes(scene)
        both = zip(modes.frequency.values, modes.damping_ratio.values, strict=True)
        for frequency in [f for f, ratio in both if amplification(1.0, ratio) >= AMPLIFIED]:
            for order, style in ((1, "-"), (2, ":")):
                critical = 60 * frequency / order
                if minutes[0] <= critical <= minutes[-1]:
                    ax.axvline(critical, color="C3", ls=style, lw=0.8)
    ax.set(xlabel="shaft speed, rpm", ylabel="RMS of what moves, kN")
    ax.set(xlim=(minutes[0], minutes[-1]), ylim=(0, None))
    fig.legend(fontsize=7, ncols=2, loc="outside upper center")
    write_figure(path, fig, dpi=200)


def _seen(value: float, least: float) -> float:
    return value if abs(value) >= least else 0.0


def _amount(row: Row, largest: float) -> str:
    """Return a number with scatter, phase and range, and that of ideal joints where it differs.

    Nothing is seen below half of a thousandth of the unit, or of the `largest` of a small machine;
    a millionth of the unit is rounding. Of a share nothing is seen below half of a thousandth.
    """
    least = 0.05 if row.unit == "%" else 5e-4 * float(np.clip(largest, 1e-6, 1.0))
    value, ideal, low, high = (
        of if isinstance(of, str) else number(_seen(of, least))
        for of in (row.value, row.ideal, row.lowest, row.highest)
    )
    before = "" if ideal in ("", value) else f"{ideal} | "
    scatter = 0.0 if row.scatter == "" else _seen(float(row.scatter), least)
    if scatter > 1e-4 * abs(row.value):
        value = with_error(_seen(row.value, least), scatter)
    phase = "" if isinstance(row.phase_rad, str) else f" at {np.degrees(row.phase_rad):z.0f}°"
    reach = f" ({low} to {high})" if low else ""
    return f"{before}{value}{phase if value != '0' else ''}{reach}"


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
        # A column that is a share has its unit in its heading.
        shares = {row.order for row in inside if row.unit == "%"}
        named = [f"{n}, %" if o in shares else n for n, o in zip(named, orders, strict=True)]
        lines = [("", "unit", *named, "")] if any(named) else []
        largest = {
            unit: max(abs(row.value) for row in inside if row.unit == unit)
            for unit in {row.unit for row in inside}
        }
        for name in dict.fromkeys(row.name for row in inside):
            own = {row.order: row for row in inside if row.name == name}
            unit = next(iter(own.values())).unit
            amounts = [
                _amount(own[order], largest[own[order].unit]) if order in own else ""
                for order in orders
            ]
            remarks = "; ".join(row.remark for row in own.values() if row.remark)
            lines.append((name, unit, *amounts, remarks))
        found[part] = lines
    return found


def page(scene: Scene, rows: Sequence[Row], head: dict[str, str], picture: str) -> str:
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
            resonance=RESONANCE,
            made=provenance("")["source"],
        )
    )

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
from rich.console import Console
from rich.table import Table

import jaxcrusher as jc
from jaxcrusher.basics.checks import renamed, require, require_positive, require_whole
from jaxcrusher.commands.load_page import (
    FACTOR,
    HOLDING,
    NOT_LOOKED_UP,
    RESONANCE,
    SIGNS,
    SOIL_KEYS,
    TITLE,
    has_soil,
    listed,
    norms,
    page,
)
from jaxcrusher.commands.machines import borrowed_by, read_machine, settings_of, variants_of
from jaxcrusher.commands.options import Crusher, Foundation
from jaxcrusher.files.progress import stages
from jaxcrusher.files.provenance import provenance
from jaxcrusher.files.results import listed as listed_files
from jaxcrusher.files.results import write_figure, write_json, write_table, write_text
from jaxcrusher.files.resume import begin_beside
from jaxcrusher.mechanism.named import Named
from jaxcrusher.mechanism.reductions import require_orders
from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.mechanism.supports import Clamped
from jaxcrusher.motion.turns import Turns, require_turns, run_turns
from jaxcrusher.orbits.solving import NODES
from jaxcrusher.pictures.site_sketch import draw_site
from jaxcrusher.scenes.machine import Machine
from jaxcrusher.scenes.reader import read_range
from jaxcrusher.scenes.units import all_said, points_of, quantity_in
from jaxcrusher.sheets.load_sheet import (
    AMPLIFIED,
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

FILES = ("sheet.csv", "sheet.html", "run_up.png", "sketch.png", "sheet.json")
# RMS -> its name, colour and mark in the picture. A clamped frame has only the first RMS.
CURVES = {
    "exciting_rms": ("exciting force", "C0", "o"),
    "transmitted_rms": ("force on the ground", "C1", "s"),
}
# Column of the sheet -> the factor on the shear modulus of the soil, and its title.
SOILS = {"softer": (0.5, "half the modulus"), "stiffer": (1.5, "1.5 times the modulus")}


def run(options: Foundation, console: Console) -> int:
    """Solve, run, print and write. Return 1 if the run failed; ValueError for bad options."""
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

    def of_ideal_joints(one: Scene) -> list[Row]:
        """Return the sheet of the orbit of `quiet(one)`. Raises ValueError without an orbit."""
        orbit = jc.periodic_orbit(quiet(one))
        require(bool(orbit.success), "scene", "have an orbit with ideal joints", orbit.failure)
        return sheet(orbit, options.orders, site)

    with stages(console, "ideal joints"):
        ideal = rows = of_ideal_joints(scene)
    others, without = {}, []
    for column, (times, title) in SOILS.items() if has_soil(values) else ():
        with stages(console, f"soil of {title}"):
            try:
                others[column] = of_ideal_joints(soil_times(found, times))
            except ValueError as error:  # on soil that is too soft the block topples
                without.append(f"none with {title}: {error}")
    turns, loose, varied = None, {}, ""
    if not scene.is_ideal:
        outputs = outputs_of(scene)

        def run_of(one: Scene, seconds: float) -> Turns:
            how = {"settle": options.settle, "turns": options.turns, "seconds": seconds}
            return run_turns(one, outputs, **how)

        with stages(console, "loose joints"):
            turns = run_of(scene, options.seconds)
        if not turns.failure:
            rows, loose = sheet(turns, options.orders, site), moving_rms(turns)
            rows = beside(rows, ideal=ideal)
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
    rows = beside(rows, **others)
    speeds = np.linspace(low, high, options.points)
    with console.status("run-up"):
        curves = run_up(scene, speeds)
    head = heading(found, options.crusher, turns)
    if without:
        head["other soil"] = " ".join(without)
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
    write_figure(folder / "sketch.png", draw_site(scene, site.points), dpi=200)
    pictures = {
        name: base64.b64encode((folder / f"{name}.png").read_bytes()).decode()
        for name in ("sketch", "run_up")
    }
    soil = {SOILS[column][1]: sheet for column, sheet in others.items()}
    soil = {"its own modulus": ideal, **soil} if soil else {}
    told = page(found, rows, head, pictures, factor=site.factor, soil=soil)
    write_text(folder / "sheet.html", told)
    console.print(TITLE)
    for name, text in head.items():
        console.print(f"{name}: {text}")
    for grid in listed(rows):
        shown = Table(*grid.headings, title=grid.title, title_justify="left", box=None)
        for line in grid.lines:
            shown.add_row(*line)
        console.print(shown, soft_wrap=False)
    console.print(f"{SIGNS} {FACTOR}")
    if scene.supports is None:
        console.print("The frame is clamped: foundation.mass puts it on supports.")
    else:
        console.print(f"{HOLDING} {RESONANCE}")
    console.print(f"¹ {NOT_LOOKED_UP} {'; '.join(norms(scene, soil=has_soil(values)))}.")
    console.print(listed_files(folder, FILES[:4]))
    return 1 if turns is not None and turns.failure else 0


def soil_times(found: Machine, times: float) -> Scene:
    """Return the scene with `times` the shear modulus of the soil; ValueError beyond its limits."""
    powers = {f"{SOIL_KEYS}shear_modulus": times, f"{SOIL_KEYS}shear_wave_speed": times**0.5}
    given = {name: found.values[name] * by for name, by in powers.items() if name in found.values}
    return found.scene(**given)


def site_of(values: dict[str, Any], options: Foundation) -> Site:
    """Return the data of the sheet besides the motion; ValueError for options out of range."""
    low, high = options.resonance
    require(0 < low < high, "resonance", "be two numbers, 0 < LOW < HIGH", options.resonance)
    factor = options.dynamic_factor
    require(1 <= factor < np.inf, "dynamic_factor", "be >= 1 and finite", factor)
    seconds = quantity_in("s", "run_up", options.run_up)
    require_positive("run_up", seconds, "s")
    power, frame = values.get("motor_power"), values.get("frame_mass")
    return Site(power, frame, points_of(values), (low, high), options.dynamic_factor, seconds)


def heading(found: Machine, crusher: Crusher, turns: Turns | None) -> dict[str, str]:
    """Return the heading of the sheet: machine, joints, loads, masses and assumptions."""
    name = "PE250x400" if crusher.scene is None else crusher.scene.stem
    changed = ", ".join(f"{key} {value}" for key, value in crusher.overrides)
    speed, scene = all_said({"speed": found.values["speed"]}, found.units), found.scene()
    head = {
        "machine": name,
        **({"changed": changed} if changed else {}),
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
            f"{turns.pieces} turns after {turns.settled}; loose ± standard error, of peaks "
            "± standard deviation of the turns' peaks"
        )
    return head


def ranges(titles: Sequence[str]) -> str:
    """Say over which assumptions the equivalent loads have a range, if the joints lose contact."""
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
    """Return the machine with ideal joints, and without its internal forces and springs.

    These push the frame as much as the moving bodies. The motion of the bodies is prescribed, so
    the ground does not feel them.
    """
    return dataclasses.replace(scene.ideal(), pushes=(), springs=())


def run_up(scene: Scene, speeds: np.ndarray) -> dict[str, np.ndarray]:
    """Return the RMS (N) of the forces in `CURVES` at each speed (rad/s), with ideal joints.

    Ideal joints have an orbit at every speed, and their forces are nearly those of a motion with
    clearance in steady contact. The exciting force is the shaking force of a frame at rest.
    """
    still, supports = quiet(scene), scene.supports
    held, loads = still, list(CURVES)[:1]
    if supports is not None:
        clamped = Clamped(supports.point)
        # The points of a frame at rest do not move.
        held = dataclasses.replace(still, foundation=clamped, points=Named())
        loads = list(CURVES)

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
    """Draw forces over the speed, and the speeds at which a harmonic meets a natural frequency.

    `curves` (N) are RMS forces with ideal joints. `loose` (N) has the RMS of each turn of a run
    with loose joints at the running speed: their mean and standard deviation are drawn. Modes that
    amplify less than `AMPLIFIED` times are left out.
    """
    fig, ax = plt.subplots(figsize=(4.4, 3.2), layout="constrained")
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
    fig.legend(fontsize=9, ncols=2, loc="outside upper center")
    write_figure(path, fig, dpi=200)

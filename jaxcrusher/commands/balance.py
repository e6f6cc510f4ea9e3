"""`python -m jaxcrusher balance`: the counterweight that makes the first order smallest."""

import cmath
import math
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from rich.console import Console

import jaxcrusher as jc
from jaxcrusher.basics.checks import require_positive
from jaxcrusher.commands.machines import read_machine, settings_of
from jaxcrusher.commands.options import Balance as Options
from jaxcrusher.files.progress import stages
from jaxcrusher.files.provenance import provenance
from jaxcrusher.files.results import listed, write_figure, write_json
from jaxcrusher.files.resume import begin_beside
from jaxcrusher.files.text import Table, number, quantity
from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.orbits.result import PeriodicOrbit
from jaxcrusher.pictures.plots import BLUE, ORANGE, STYLE, WIDTH, force_size
from jaxcrusher.scenes.machine import Machine
from jaxcrusher.scenes.units import quantity_in
from jaxcrusher.sheets.balance import Balance, Ellipse, balance_of, with_moment

FILES = "balance.json", "balance.png"
MASS, RADIUS, ANGLE = (f"counterweight.{name}" for name in ("mass", "radius", "angle"))
SIDES = "horizontal", "vertical"
STEPS = 720  # points of the picture in one turn


def run(options: Options, console: Console) -> int:
    """Balance, confirm, print and write. Return 1 without an orbit; ValueError for bad options."""
    found = read_machine(options.crusher)
    scene, own = found.scene(), present(found)
    radius = reach(found, scene) if options.radius is None else _radius(options.radius)
    settings = settings_of("balance", found, radius=radius, effort=options.effort)
    folder = begin_beside(options.results.folder, settings, *FILES)
    with stages(console, "ideal joints"):
        balance = balance_of(scene)
    best, *_ = moments = [own + added for added in balance.moments.values()]
    heavier = balanced(found, scene, best, radius)
    orbits = {}
    for title, one in (("as it is", scene), ("balanced", heavier)):
        with stages(console, f"orbit, {title}"):
            orbits[title] = jc.periodic_orbit(one, effort=options.effort)
        if not bool(orbits[title].success):
            break
    failures = [f"{title}: {one.failure}" for title, one in orbits.items() if not one.success]
    numbers = compared(balance, heavier, {} if failures else orbits)
    kept = {"radius": radius, "counterweight": weights(moments, balance, radius), "forces": numbers}
    about = provenance("Counterweight", scene=found.values)
    write_json(folder / "balance.json", about | kept)
    draw(balance, scene, heavier, folder / "balance.png")
    for line in answer(found, best, own, radius):
        console.print(line, markup=False)  # a table of a scene file is in brackets
    console.print(shown(kept["counterweight"], balance.first, radius).printed(), soft_wrap=False)
    rows = [{"N": name} | values for name, values in numbers.items()]
    console.print(Table.of(rows).printed(), soft_wrap=False)
    for line in failures:
        console.print(f"Ideal joints alone are compared: no periodic orbit, {line}")
    console.print(listed(folder, FILES))
    return int(bool(failures))


def _radius(text: str) -> float:
    """Return the radius (m) that the command line gives; ValueError unless it is positive."""
    radius = quantity_in("m", "radius", text)
    require_positive("radius", radius, "m")
    return radius


def present(machine: Machine) -> complex:
    """Return the first moment (kg m) about O of the machine's counterweight, zero without one."""
    if MASS not in machine.numbers:
        return 0j
    mass, radius, angle = (machine.number(name) for name in (MASS, RADIUS, ANGLE))
    return cmath.rect(mass * radius, angle)


def reach(machine: Machine, scene: Scene) -> float:
    """Return the default radius (m): the machine's own one, or the farthest joint of the crank."""
    if RADIUS in machine.numbers:
        return machine.number(RADIUS)
    linkage = scene.linkage
    centre = linkage.side_of(linkage.bearing, linkage.crank).vector()
    sides = [
        side.arm.vector() - centre
        for joint in linkage.joints.values
        for side in (joint.bore, joint.pin)
        if side.body == linkage.crank
    ]
    return max(math.hypot(float(side.x), float(side.y)) for side in sides)


def balanced(machine: Machine, scene: Scene, moment: complex, radius: float) -> Scene:
    """Return the scene whose counterweight has this first moment (kg m) at this radius (m)."""
    if MASS not in machine.numbers:
        return with_moment(scene, moment, radius)
    numbers = {MASS: abs(moment) / radius, RADIUS: radius, ANGLE: cmath.phase(moment)}
    return machine.scene(**numbers)


def weights(moments: list[complex], balance: Balance, radius: float) -> list[dict[str, Any]]:
    """Return each counterweight and the remaining first order, in SI units."""
    found = []
    for (way, added), moment in zip(balance.moments.items(), moments, strict=True):
        size, left = abs(moment), balance.with_moment(added).sides
        told = {"least": way, "moment": size, "mass": size / radius, "angle": cmath.phase(moment)}
        found.append(told | dict(zip(SIDES, left, strict=True)))
    return found


def compared(
    balance: Balance, heavier: Scene, orbits: dict[str, PeriodicOrbit]
) -> dict[str, dict[str, float]]:
    """Compare forces (N) without and with the counterweight, for ideal joints and for orbits."""
    after = balance_of(heavier)
    pairs = {
        "first order, largest, ideal joints": [balance.first.largest, after.first.largest],
        "second order, largest, ideal joints": [balance.second.largest, after.second.largest],
    }
    for name in dict.fromkeys(("shaking_rms", "shaking_peak", heavier.headline)) if orbits else ():
        words = heavier.statistics[name].meaning
        pairs[f"{words}, orbit"] = [float(one[name]) for one in orbits.values()]
    titles = "as it is", "balanced"
    return {name: dict(zip(titles, pair, strict=True)) for name, pair in pairs.items()}


def answer(machine: Machine, best: complex, own: complex, radius: float) -> list[str]:
    """Describe the counterweight in a sentence, and as lines of a scene file where it has keys."""
    mass, angle = abs(best) / radius, math.degrees(cmath.phase(best))
    first = (
        f"A counterweight of {quantity(mass, 'kg')} at a radius of {quantity(radius, 'm')} and "
        f"{number(angle)} deg ahead of the crank leaves the least of the first order."
    )
    if MASS not in machine.numbers:
        return [first]
    instead = f" It stands in place of the one of {quantity(abs(own), 'kg m')}." if own else ""
    return [
        f"{first}{instead}",
        "In a scene file:",
        "[counterweight]",
        f'mass = "{mass:.6g} kg"',
        f'radius = "{1e3 * radius:.6g} mm"',
        f'angle = "{angle:.6g} deg"',
    ]


def shown(found: list[dict[str, Any]], before: Ellipse, radius: float) -> Table:
    """Return the table of counterweights and of the remaining first order, for the screen."""
    rows: list[tuple[object, ...]] = [("as it is", "", "", "", *before.sides)]
    for one in found:
        # A force that cancels is only rounding error.
        left = [one[side] if one[side] > 1e-9 * before.largest else 0.0 for side in SIDES]
        rows.append((one["least"], one["moment"], one["mass"], math.degrees(one["angle"]), *left))
    mass = f"kg at {quantity(radius, 'm')}"
    headings = "least first order", "kg m", mass, "ahead, deg", "F_x, N", "F_y, N"
    return Table(headings, rows, "Amplitudes of the first order, ideal joints")


def draw(balance: Balance, scene: Scene, heavier: Scene, path: Path) -> None:
    """Draw the ellipse of the first order, and the shaking force of ideal joints over a turn."""
    phases = np.linspace(0, 2 * np.pi, STEPS + 1)
    styles = {"as it is": (ORANGE, "--"), "balanced": (BLUE, "-")}
    firsts = balance.first, balance.with_moment(balance.moments["in all directions"])
    with plt.rc_context(STYLE):
        fig, (ellipse, force) = plt.subplots(
            1, 2, figsize=(WIDTH, 2.8), width_ratios=(1, 1.6), layout="constrained"
        )
        pairs = zip(styles.items(), firsts, (scene, heavier), strict=True)
        for (title, (colour, line)), first, one in pairs:
            style = {"color": colour, "linestyle": line, "label": title}
            turning = np.exp(1j * phases)
            tip = (first.forward * turning + first.backward / turning) / 1e3
            ellipse.plot(tip.real, tip.imag, **style)
            seen = jc.periodic_orbit(one.ideal()).motion(phases, ("shaking_force",))
            force.plot(np.degrees(phases), force_size(seen["shaking_force"]), **style)
        ellipse.set(aspect="equal", title="first order", xlabel="$F_x$ (kN)", ylabel="$F_y$ (kN)")
        title = "shaking force, ideal joints"
        force.set(title=title, xlabel="shaft angle (deg)", ylabel="kN", xlim=(0, 360))
        force.set_ylim(bottom=0)
        force.set_xticks(range(0, 361, 90))
        force.legend()
        write_figure(path, fig)

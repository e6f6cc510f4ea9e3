"""`python -m jaxcrusher orbit`: the periodic orbit, and its slopes by every parameter."""

from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from jaxtyping import Scalar
from rich.console import Console
from rich.table import Table

import jaxcrusher as jc
from jaxcrusher.basics.checks import require_whole
from jaxcrusher.commands.machines import borrowed_by, read_machine, settings_of, write_dataset
from jaxcrusher.commands.options import Orbit
from jaxcrusher.files import table as table_of
from jaxcrusher.files.progress import stages
from jaxcrusher.files.provenance import provenance
from jaxcrusher.files.results import listed, write_figure, write_json
from jaxcrusher.files.resume import begin_beside
from jaxcrusher.files.text import number, quantity, to_error
from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.motion.simulation import headline_force
from jaxcrusher.orbits.result import PeriodicOrbit
from jaxcrusher.pictures.motions import (
    coincide,
    entitle,
    pins_and_force,
    plot_difference,
    plot_force,
)
from jaxcrusher.pictures.style import style
from jaxcrusher.scenes.machine import Machine
from jaxcrusher.scenes.parameters import Parameter, numbers_of
from jaxcrusher.scenes.units import per, said, unit_of

ANGLES = 720  # points of the picture in one turn
DEGREE = float(np.radians(1.0))
LEAST = 1e-6  # least change of a force (%) by a step; parameters below it have no row
REMEDY = (
    "Where the free oscillation of the pin meets a harmonic of the drive, or contact is lost, "
    "there may be no orbit of this period, or several. Try a value a thousandth off, another "
    "--period, or jaxcrusher.coexisting_orbits, which searches from many starts. Any motion has "
    "means: `python -m jaxcrusher foundation` makes a load sheet of them, with their scatter."
)
ROUGH = "under the mean load: what load_scatter adds is told by jaxcrusher.feed_response"


def run(options: Orbit, console: Console) -> int:
    """Solve, print and write. Return 1 if there is no orbit; ValueError for bad options."""
    found = read_machine(options.crusher)
    values = found.values
    metrics = tuple(dict.fromkeys(("shaking_rms", found.scene().headline)))
    require_whole("period", options.period, 1)
    asked = {"period": options.period, "effort": options.effort}
    settings = settings_of("orbit", found, **asked)
    matlab = ("orbit.mat",)
    written = "orbit.json", "orbit.csv", *(matlab if options.mat else ()), "orbit.png"
    folder = begin_beside(options.results.folder, settings, *written, spared=matlab)
    numbers = {
        name: jnp.asarray(values[name], dtype=float) for name in numbers_of(values, found.numbers)
    }

    @eqx.filter_jit
    def build(numbers: dict[str, Any]) -> Scene:
        return found.scene(**numbers)

    # Without `jax.jit`, one compiled program serves the orbit and its slopes.
    def solve(numbers: dict[str, Any], **how: Any) -> PeriodicOrbit:
        return jc.periodic_orbit(build(numbers), **how)

    with stages(console, "solving (the first time half a minute, most of it compilation)"):
        try:
            orbit = solve(numbers, period=options.period, effort=options.effort)
        except KeyboardInterrupt as stop:
            console.print(*stop.args)
            raise
    if not bool(orbit.success):
        console.print(f"no periodic orbit: {orbit.failure}")
        console.print(REMEDY)
        return 1
    with stages(console, "differentiating"):
        slopes = slopes_of(lambda n: solve(n, **orbit.alike), numbers, metrics)
    path = folder / "orbit.json"
    write_json(path, provenance("Periodic orbit", scene=values) | content(orbit, slopes))
    seen = history(orbit)
    for name in written[1:-1]:
        write_dataset(folder / name, seen)
    draw(orbit, found.units, folder / "orbit.png")
    for line in summary(orbit):
        console.print(line)
    marked = borrowed_by(options.crusher, found)
    shares = changes(orbit, slopes, found)
    console.print(table(shares, slopes, found, marked), soft_wrap=False)
    for line in notes(found, marked, shares):
        console.print(line)
    console.print(listed(folder, written))
    return 0


def slopes_of(
    solve: Callable[[dict[str, Any]], PeriodicOrbit],
    numbers: dict[str, Any],
    names: tuple[str, ...],
) -> dict[str, dict[str, float]]:
    """Return the slopes of statistics by every number: one orbit, and one VJP per statistic."""

    def metrics(numbers: dict[str, Any]) -> dict[str, Scalar]:
        orbit = solve(numbers)
        return {metric: orbit[metric] for metric in names}

    found, back = jax.vjp(metrics, numbers)
    slopes = {}
    for metric in names:
        (by_number,) = back({name: jnp.asarray(float(name == metric)) for name in found})
        slopes[metric] = {name: float(slope) for name, slope in by_number.items()}
    return slopes


def history(orbit: PeriodicOrbit) -> xr.Dataset:
    """Return all observables over the angle of the shaft, at each degree of the period."""
    degrees = np.arange(360 * orbit.period + 1)
    seen = orbit.motion(np.radians(degrees))
    values = {name: np.asarray(column) for name, column in seen.items()}
    angle = ("angle", degrees, {"units": "deg", "long_name": "shaft angle at mean speed"})
    coordinates = {"angle": angle, "direction": ["x", "y"]}
    columns = table_of.vector_columns(orbit.scene.observables, values)
    return table_of.dataset(("angle",), values, columns, coordinates)


def draw(orbit: PeriodicOrbit, units: Mapping[str, str], path: Path) -> None:
    """Draw each pin in its bore, and the headline force beside the force with ideal joints."""
    angles = 2 * np.pi * np.arange(ANGLES * orbit.period + 1) / ANGLES
    scene = orbit.scene
    shown, headline = headline_force(scene), scene.headline
    names = [f"{scene.prefix(joint)}eccentricity" for joint in scene.joints.names]
    seen = orbit.motion(angles, (shown, *names))
    ideal = jc.periodic_orbit(scene.ideal()).motion(angles, (shown,)) if names else None
    told = [said("speed", float(scene.drive.speed), units), turns_of(orbit)]
    told.append(f"RMS {quantity(float(orbit[headline]), scene.statistics[headline].unit)}")
    with plt.rc_context(style()):
        fig, force = pins_and_force(scene, seen)
        plot_force(seen, ideal, force, angles=angles, label="periodic orbit")
        if ideal is not None and coincide(force):
            plot_difference(force)
        entitle(fig, ", ".join([*told, settling(orbit)]))
        write_figure(path, fig)


def turns_of(orbit: PeriodicOrbit) -> str:
    """Return the name of an orbit with its period in turns."""
    return "periodic orbit" if orbit.period == 1 else f"periodic orbit of {orbit.period} turns"


def settling(orbit: PeriodicOrbit) -> str:
    """Say how fast disturbances of an orbit decay, or that they grow."""
    if orbit.eccentricity is None:
        return "nothing oscillates"
    if bool(orbit.undecided):
        return "it is not known whether the motion is stable"
    return f"settles in {number(float(orbit.settling_turns))} turns" if orbit.stable else "unstable"


def summary(orbit: PeriodicOrbit) -> list[str]:
    """Return a few lines on the forces of the orbit, its stability and its contact."""
    share, values = float(orbit.error), {n: float(one) for n, one in orbit.values.items()}
    # The errors of peaks and means are not estimated.
    rms = {name: to_error(one, share * one, 10) for name, one in values.items()}
    lines = [
        f"shaking force: RMS {rms['shaking_rms']} N (error {share:.1g} of it), "
        f"peak {number(values['shaking_peak'])} N"
    ]
    if "foundation_rms" in values:
        lines.append(
            f"force on the foundation, {orbit.scene.observables['foundation_force'].meaning}: "
            f"RMS {rms['foundation_rms']} N, mean {number(values['foundation_mean'])} N, "
            f"peak {number(values['foundation_peak'])} N"
        )
    if orbit.scene.steady() is not orbit.scene:
        lines.append(ROUGH)
    if orbit.eccentricity is None:
        return [*lines, f"ideal joints: {settling(orbit)}"]
    moduli = ", ".join(f"{abs(value):.6f}" for value in np.asarray(orbit.multipliers))
    lines.append(f"multipliers {moduli} a period: {settling(orbit)}")
    lines += [orbit.instability] if orbit.instability else []
    if np.isfinite(orbit.least_penetration):
        lines.append(f"least penetration {float(orbit.least_penetration):.4g} clearances")
    lines += [
        f"thinnest film at {orbit.scene.template.joint(joint).title}: "
        f"{float(orbit[f'{orbit.scene.prefix(joint)}film_ratio']):.4g} least thicknesses"
        for joint in orbit.scene.lubricated
    ]
    return [*lines, orbit.validity.verdict()]


def table(
    shares: dict[str, dict[str, float]],
    slopes: dict[str, dict[str, float]],
    machine: Machine,
    marked: Collection[str],
) -> Table:
    """Return the table of slopes of the forces' RMS by each parameter, in the machine's units.

    Parameters are the keys of `shares`, which `changes` returns. The parameter whose `step` changes
    the shaking force most comes first. `marked` parameters have a *.
    """
    shaking, *others = slopes

    def slope(metric: str, name: str, size: float) -> str:
        """Return a slope per unit of its parameter, 0 where a step changes less than `LEAST`."""
        return number(slopes[metric][name] * size if shares[name][metric] else 0.0)

    # Without borders every key fits into one line of 80 columns.
    headings = ["parameter", "value", "shaking", "% a step"]
    headings += [name.removesuffix("_rms") for name in others]
    shown = Table(*headings, box=None, padding=(0, 1, 0, 0), pad_edge=False)
    shown.columns[0].overflow = "fold"  # users copy the whole key

    def rank(name: str) -> tuple[bool, float]:
        """Return the sorting key of a parameter; parameters without a slope come last."""
        share = shares[name][shaking]
        return bool(np.isnan(share)), -abs(share)

    for name in sorted(shares, key=rank):
        unit, size = unit_of(name, machine.units)
        value = f"{machine.values[name] / size:.6g} {unit}".rstrip() + " *" * (name in marked)
        first = f"{slope(shaking, name, size)} {per('N', unit)}", f"{shares[name][shaking]:.3g}"
        shown.add_row(name, value, *first, *(slope(other, name, size) for other in others))
    return shown


def changes(
    orbit: PeriodicOrbit, slopes: dict[str, dict[str, float]], machine: Machine
) -> dict[str, dict[str, float]]:
    """Return the change (%) of each force by a `step` of each number that changes any force.

    A change below `LEAST` is 0.
    """
    found = {}
    for name in next(iter(slopes.values())):
        percent = 100 * step(machine.numbers[name], machine.values[name])
        shares = {
            metric: percent * of[name] / float(orbit[metric]) for metric, of in slopes.items()
        }
        shares = {metric: 0.0 if abs(one) < LEAST else one for metric, one in shares.items()}
        if any(shares.values()):  # NaN counts as a change
            found[name] = shares
    return found


def step(of: Parameter, value: float) -> float:
    """Return a small design change of a parameter, in SI units: 1 %, or 1 deg of an angle."""
    if of.unit == "rad":  # the value of an angle depends on its reference direction
        return DEGREE
    return 0.01 * (abs(value) or of.scale)


def notes(machine: Machine, marked: Collection[str], shown: Collection[str]) -> list[str]:
    """Explain the columns and marks of the table, and name the parameters without a row."""
    values, known = machine.values, machine.numbers
    names = numbers_of(values, known)
    zero = [n for n in names if values[n] == 0 and known[n].unit != "rad"]
    of_zero = "".join(
        f", {said(name, step(known[name], 0.0), machine.units)} of {name}" for name in zero
    )
    lines = [
        "Slopes are of the RMS of each force. A step is 1 % of the value, 1 deg of an "
        f"angle{of_zero}."
    ]
    idle = [name for name in names if name not in shown]
    if idle:
        lines.append(f"No force changes by {LEAST:g} % with a step of {', '.join(idle)}.")
    if marked:
        lines.append("* is the PE250x400's value, because the scene file has none.")
    return lines


def content(orbit: PeriodicOrbit, slopes: dict[str, dict[str, float]]) -> dict[str, Any]:
    """Return an orbit and its slopes as JSON stores them."""
    forces = ("foundation_rms", "foundation_mean", "foundation_peak", "shaking_rms", "shaking_peak")
    names = (*(name for name in forces if name in orbit.values), "error", "least_penetration")
    values = [] if orbit.multipliers is None else np.asarray(orbit.multipliers)
    return {
        "period": orbit.period,
        **{name: float(getattr(orbit, name)) for name in names},
        "multipliers": [[float(value.real), float(value.imag)] for value in values],
        "stable": bool(orbit.stable),
        "undecided": bool(orbit.undecided),
        "settling_turns": float(orbit.settling_turns),
        **{f"slopes_of_{metric}": of for metric, of in slopes.items()},
    }

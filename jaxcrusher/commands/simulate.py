"""`python -m jaxcrusher simulate`: one crusher's motion, as a file and a picture."""

import math
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from rich.console import Console

import jaxcrusher as jc
from jaxcrusher.basics.checks import require, require_positive, require_whole
from jaxcrusher.batch.engines import stack
from jaxcrusher.commands.machines import read_machine, settings_of, write_dataset
from jaxcrusher.commands.options import Simulate
from jaxcrusher.crusher.template import CALLED
from jaxcrusher.files import table as table_of
from jaxcrusher.files.progress import progress
from jaxcrusher.files.provenance import provenance
from jaxcrusher.files.results import listed, write_figure
from jaxcrusher.files.resume import begin_beside
from jaxcrusher.files.table import Column, vector_columns
from jaxcrusher.files.text import number, with_error
from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.motion.method import require_tolerance
from jaxcrusher.motion.simulation import Trajectory, headline_force
from jaxcrusher.motion.statistics import Statistics
from jaxcrusher.pictures.motions import (
    coincide,
    entitle,
    pins_and_force,
    plot_difference,
    plot_force,
)
from jaxcrusher.pictures.style import style
from jaxcrusher.scenes.machine import Machine
from jaxcrusher.scenes.units import said

# The default number of simulated turns, and how many of the last turns are drawn.
TURNS, DRAWN = 10.0, 2
# The entries of the energy ledger, J.
LEDGER = {
    "kinetic": "kinetic energy",
    "potential": "potential energy of weight, zero at the height of the frame's origin",
    "elastic": "energy stored in the contact",
    "drive_work": "work of the drive since time zero",
    "load_work": "work of the load since time zero",
    "contact_loss": "dissipated by the contact's damping since time zero",
    "friction_loss": "dissipated by friction since time zero",
    "imbalance": "what the ledger fails to account for",
    "support_loss": "taken by the supports",
    "rod_loss": "taken by the rod's damper",
    "spring_loss": "taken by the dampers beside springs",
}

ANGLE = {"units": "rad", "long_name": "shaft angle since time zero"}
# A standard error beyond this share of the RMS gets a line of advice.
SCATTERED = 0.01


def run(options: Simulate, console: Console) -> int:
    """Simulate, write and print. Return 1 if a run failed; ValueError for bad options."""
    found = read_machine(options.crusher)
    values, scene = found.values, found.scene()
    span = _span(options, values["speed"])
    settle = _settle(options, span)
    require_whole("samples", options.samples, 2)
    require_tolerance(options.rtol)
    numbers = {"turns": span, "settle": settle, "samples": options.samples, "rtol": options.rtol}
    settings = settings_of("simulate", found, **numbers)
    asked = {"motion.csv": options.csv, "motion.mat": options.mat}
    written = "motion.nc", *(name for name, wanted in asked.items() if wanted), "motion.png"
    folder = begin_beside(options.results.folder, settings, *written, spared=asked)
    turn = 2 * np.pi / values["speed"]
    times = np.linspace(0, span * turn, options.samples)
    whole = int(span) - settle
    with progress(console) as bars:
        bar = bars.add_task("simulation", total=3)
        motion = jc.simulate(scene, times, rtol=options.rtol)
        kept = dataset(motion, scene, values)
        for name in written[:-1]:
            write_dataset(folder / name, kept)
        bars.update(bar, completed=1, description="statistics")
        summary = None
        if bool(motion.success) and whole >= 1:
            summary = _statistics(scene, settle, whole, options.rtol)
        bars.update(bar, completed=2, description="figure")
        first = 0.0 if motion.failure else max(span - DRAWN, 0.0)
        with plt.rc_context(style()):
            figure = draw(motion, scene, times >= first * turn)
            entitle(figure, title(found, first, span, motion, summary))
            write_figure(folder / "motion.png", figure)
        bars.update(bar, completed=3, description="simulation")
    failure = motion.failure or (summary.failure if summary else "")
    if failure:
        console.print(f"FAILED: {failure}", style="red")
    else:
        console.print(closing(motion, summary, settle, scene))
        if summary is not None and (advice := scattered(summary, scene.headline)):
            console.print(advice)
    console.print(listed(folder, written))
    return 1 if failure else 0


def _statistics(scene: Scene, settle: int, turns: int, rtol: float) -> Statistics:
    """Return statistics of a batch of one scene: lanes compile in half the time."""
    function = eqx.Partial(jc.statistics, settle_turns=settle, turns=turns, rtol=rtol)
    return jax.tree.map(lambda leaf: jnp.asarray(leaf[0]), jc.map_all(function, stack([scene])))


def _span(options: Simulate, speed: float) -> float:
    """Return the time span in turns, rounded if it differs from whole turns only by rounding."""
    if options.seconds is not None:
        require(options.turns is None, "turns", "not be given with seconds", options.turns)
        require_positive("seconds", options.seconds, "s")
        span = options.seconds * speed / (2 * np.pi)
        return float(round(span)) if math.isclose(span, round(span)) else span
    turns = TURNS if options.turns is None else options.turns
    require_positive("turns", turns, "")
    return turns


def _settle(options: Simulate, span: float) -> int:
    if options.settle is None:
        return int(span / 2)
    require_whole("settle", options.settle, 0)
    good = options.settle < span
    require(good, "settle", f"be under the time span, {span:g} turns", options.settle)
    return options.settle


def dataset(motion: Trajectory, scene: Scene, values: dict[str, Any]) -> xr.Dataset:
    """Return the motion as a dataset with units, long names and provenance."""
    table = dict(motion.known)
    seen = [name for name in table if name in motion.values]
    arrays = {name: np.asarray(motion[name]) for name in seen}
    # Losses of supports, rod or springs are None in a scene without these parts.
    ledger = {n: part for n in LEDGER if (part := getattr(motion.energy, n)) is not None}
    arrays |= {name: np.asarray(part) for name, part in ledger.items()}
    kept = vector_columns(table, arrays) | {name: Column("J", LEDGER[name]) for name in ledger}
    angle = jax.vmap(lambda time: scene.drive.crank(time, None).angle)(motion.time)
    coordinates = {
        "time": ("time", np.asarray(motion.time), {"units": "s", "long_name": "time"}),
        "angle": ("time", np.asarray(angle), ANGLE),
        "direction": ("direction", ["x", "y"], {"long_name": "to the right and up"}),
    }
    failure = motion.failure or "none"
    attributes = provenance("Motion of a mechanism", scene=values, failure=failure)
    return table_of.dataset(("time",), arrays, kept, coordinates, attributes)


def draw(motion: Trajectory, scene: Scene, drawn: np.ndarray) -> Figure:
    """Draw the path of each loose joint's pin, and the headline force, at the instants `drawn`."""
    shown, joints = headline_force(scene), scene.joints.names
    names = (shown, *(f"{scene.prefix(joint)}eccentricity" for joint in joints))
    seen = {name: motion[name][drawn] for name in names}
    part = Trajectory(motion.time[drawn], motion.outcome, seen)
    fig, ax = pins_and_force(scene, part)
    if not joints:
        plot_force(part, ax=ax, label="ideal joint")
        return fig
    plot_force(part, jc.simulate(scene.ideal(), part.time, outputs=(shown,)), ax)
    if coincide(ax):
        plot_difference(ax)
    return fig


def title(
    machine: Machine, first: float, last: float, motion: Trajectory, summary: Statistics | None
) -> str:
    """Return a title: speed, drawn turns, start, and whether the motion has settled."""
    values = machine.values
    parts = [said("speed", values["speed"], machine.units), f"turns {first:g} to {last:g}"]
    if machine.scene().joints.names and "start" in values:
        parts.append(f"start {values['start']}")
    if motion.failure:
        parts.append("failed")
    elif summary is not None and summary.turns > 1:
        parts.append("settled" if bool(summary.settled) else "still settling")
    return ", ".join(parts)


def scattered(summary: Statistics, headline: str) -> str:
    """Return advice on an average that still changes or scatters, else an empty text."""
    error = float(summary.error(headline))
    if bool(summary.whirl) or not math.isfinite(error):
        return ""
    if not bool(summary.settled):
        return (
            "The motion has not settled: the ± counts what is left of its start. python -m "
            "jaxcrusher orbit solves for the motion that it settles on."
        )
    share = error / float(summary[headline])
    if share <= SCATTERED:
        return ""
    return (
        f"The average still scatters by {share:.0%}: more --turns make it narrower. Where the pin "
        "keeps contact, python -m jaxcrusher orbit solves for the steady state."
    )


def closing(motion: Trajectory, summary: Statistics | None, settle: int, scene: Scene) -> str:
    """Return one line: RMS of headline and shaking force, peak, contact, whirl and validity."""
    names = tuple(dict.fromkeys((scene.headline, "shaking_rms")))

    def contact(share: Callable[[str], Any]) -> list[str]:
        """Return the contact share of each loose joint; `share` takes the joint's prefix."""
        pairs = ((joint, scene.prefix(joint)) for joint in scene.joints.names)
        of = {f"{joint} " if at else "": at for joint, at in pairs}
        return [f"{title}contact share {float(share(at)):.3f}" for title, at in of.items()]

    if summary is None:
        parts = []
        for name, force in zip(names, (headline_force(scene), "shaking_force"), strict=False):
            squares = np.asarray(motion[force]) ** 2
            rms = np.sqrt(np.mean(squares.sum(axis=1) if squares.ndim > 1 else squares))
            parts.append(f"{CALLED[name]} {number(rms)} N")
        parts += contact(lambda of: np.mean(motion[f"{of}penetration_ratio"] > 0))
        return (
            f"{', '.join(parts)}, over the samples (no whole turn after settling: no verdict on "
            "whirl and contact model)"
        )
    # A single turn gives no error.
    rms = with_error(float(summary[scene.headline]), float(summary.error(scene.headline)))
    parts = [f"{CALLED[scene.headline]} {rms} N"]
    if (peak := scene.headline.replace("_rms", "_peak")) in summary.values:
        # Impacts are harder in some turns than in others.
        median = f"{number(np.median(summary.by_turn[peak]))} N"
        several = f" (median of the turns' peaks {median})" if summary.turns > 1 else ""
        parts.append(f"peak {number(float(summary[peak]))} N{several}")
    parts += [f"{CALLED[name]} {number(float(summary[name]))} N" for name in names[1:]]
    if not scene.is_ideal:
        parts += contact(lambda of: summary[f"{of}contact_fraction"])
        parts.append("FRICTION WHIRL" if bool(summary.whirl) else "no whirl")
        parts.append(summary.validity.verdict())
    return f"{', '.join(parts)} (turns {settle + 1} to {settle + summary.turns})"

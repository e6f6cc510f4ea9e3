"""`python -m jaxcrusher simulate`: one crusher's motion, as a file and a picture."""

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from rich.console import Console

import jaxcrusher as jc
from jaxcrusher.basics.checks import require, require_positive, require_whole
from jaxcrusher.commands.options import Crusher, Results
from jaxcrusher.crusher.observables import OBSERVABLES
from jaxcrusher.files.results import progress, provenance, write_netcdf
from jaxcrusher.pictures import plots

# The figure shows this many turns, the last ones.
DRAWN = 2
# What the energy ledger holds, J.
LEDGER = {
    "kinetic": "kinetic energy",
    "potential": "potential energy of weight, zero at C's height",
    "elastic": "energy stored in the contact",
    "drive_work": "work of the drive since time zero",
    "load_work": "work of the crushing load since time zero",
    "contact_loss": "dissipated by the contact's damping since time zero",
    "friction_loss": "dissipated by friction since time zero",
    "imbalance": "what the ledger fails to account for",
}


@dataclass(frozen=True)
class Simulate:
    """Simulate one crusher.

    Writes OUT/NAME/motion.nc (forces, positions, powers and energies over time) and motion.png
    (orbit of the pin and force on the foundation, the last two turns, with the ideal joint's).
    Ten turns take about 20 s, most of it compilation.
    """

    crusher: Crusher = field(default_factory=Crusher)
    turns: float = 10.0
    """Time span in turns of the shaft."""
    seconds: float | None = None
    """Time span in s, in place of --turns."""
    samples: int = 10_001
    """Instants written, evenly over the time span."""
    settle: int | None = None
    """Turns before the closing line's statistics start; half of the time span."""
    rtol: float = 1e-11
    """Tolerance of a step, in clearances and m/s."""
    results: Results = field(default_factory=lambda: Results("simulate"))

    def run(self, console: Console) -> int:
        """Simulate, write, print; 1 if the integration failed. ValueError for bad options."""
        values = self.crusher.values()
        span = self._span(values["speed"])
        settle = self._settle(span)
        require_whole("samples", self.samples, 2)
        require_positive("rtol", self.rtol, "")
        folder = self.results.folder()
        scene, turn = jc.build_scene(values), 2 * np.pi / values["speed"]
        times = np.linspace(0, span * turn, self.samples)
        whole = int(span) - settle
        with progress(console) as bars:
            bar = bars.add_task("simulation", total=3)
            motion = jc.simulate(scene, times, rtol=self.rtol)
            write_netcdf(folder / "motion.nc", dataset(motion, values))
            bars.update(bar, completed=1, description="figure")
            drawn = times >= (0 if motion.failure else times[-1] - DRAWN * turn)
            draw(folder / "motion.png", motion, scene, drawn)
            bars.update(bar, completed=2, description="statistics")
            summary = None
            if bool(motion.success) and whole >= 1:
                summary = jc.statistics(scene, settle, whole, rtol=self.rtol)
            bars.update(bar, completed=3, description="simulation")
        failure = motion.failure or (summary.failure if summary else "")
        if failure:
            console.print(f"FAILED: {failure}", style="red", highlight=False)
        else:
            console.print(closing(motion, summary, settle, values), highlight=False, soft_wrap=True)
        console.print(f"{folder / 'motion.nc'}, {folder / 'motion.png'}", highlight=False)
        return 1 if failure else 0

    def _span(self, speed: float) -> float:
        """The time span in turns."""
        if self.seconds is not None:
            require_positive("seconds", self.seconds, "s")
            return self.seconds * speed / (2 * np.pi)
        require_positive("turns", self.turns, "")
        return self.turns

    def _settle(self, span: float) -> int:
        if self.settle is None:
            return int(span / 2)
        require_whole("settle", self.settle, 0)
        require(
            self.settle < span, "settle", f"be under the time span, {span:g} turns", self.settle
        )
        return self.settle


def dataset(motion: jc.Trajectory, values: dict[str, Any]) -> xr.Dataset:
    """The motion with units, long names and provenance."""
    variables: dict[str, Any] = {}
    for name, observable in OBSERVABLES.items():
        array = np.asarray(getattr(motion, name))
        dims = ("time", "direction")[: array.ndim]
        labels = {"units": observable.unit, "long_name": observable.meaning}
        variables[name] = (dims, array, labels)
    for name, meaning in LEDGER.items():
        labels = {"units": "J", "long_name": meaning}
        variables[name] = ("time", np.asarray(getattr(motion.energy, name)), labels)
    coordinates = {
        "time": ("time", np.asarray(motion.time), {"units": "s", "long_name": "time"}),
        "direction": ("direction", ["x", "y"], {"long_name": "to the right and up"}),
    }
    attributes = provenance("Motion of a jaw crusher", values)
    attributes["failure"] = motion.failure or "none"
    return xr.Dataset(variables, coordinates, attributes)


def draw(path: Path, motion: jc.Trajectory, scene: jc.Scene, drawn: np.ndarray) -> None:
    """Orbit and foundation force at the instants `drawn`; without an orbit for an ideal joint."""
    assert motion.foundation_force is not None and motion.eccentricity is not None
    part = jc.Trajectory(
        motion.time[drawn],
        motion.outcome,
        foundation_force=motion.foundation_force[drawn],
        eccentricity=motion.eccentricity[drawn],
    )
    fig = plt.figure(figsize=(10, 4), layout="constrained")
    if scene.joint is None:
        ax = fig.add_subplot()
        plots.plot_force(part, ax=ax).set_title("ideal joint")
        ax.legend().remove()
    else:
        orbit, force = fig.subplots(1, 2, width_ratios=[1, 1.6])
        clearance, speed = float(scene.joint.clearance), float(scene.drive.speed)
        plots.plot_orbit(part, clearance, orbit)
        orbit.set_title(f"radial clearance {1e3 * clearance:.4g} mm")
        ideal = jc.simulate(scene.ideal(), part.time, outputs=("foundation_force",))
        plots.plot_force(part, ideal, force).set_title(f"{speed:.4g} rad/s")
    fig.savefig(path, dpi=150)
    plt.close(fig)


def closing(
    motion: jc.Trajectory, summary: jc.Statistics | None, settle: int, values: dict[str, Any]
) -> str:
    """RMS, contact share, whirl and what is outside the model, on one line."""
    ideal = values["joint"] == "ideal"
    if summary is None:
        rms = float(np.sqrt(np.mean(np.asarray(motion.foundation_force) ** 2)))
        contact = "" if ideal else f", contact share {float(motion.contact_fraction):.3f}"
        return (
            f"RMS of |R_O| + |R_C| {rms:.0f} N{contact}, over the samples (no whole turn after "
            "settling: no verdict on whirl and contact model)"
        )
    error = float(summary.foundation_rms_error)
    scatter = f" ± {error:.2g}" if math.isfinite(error) else ""
    parts = [f"RMS of |R_O| + |R_C| {float(np.asarray(summary.foundation_rms)):.0f}{scatter} N"]
    if not ideal:
        parts.append(f"contact share {float(np.asarray(summary.contact_fraction)):.3f}")
        parts.append("FRICTION WHIRL" if bool(summary.whirl) else "no whirl")
        assert summary.validity is not None
        remarks = summary.validity.remarks()
        parts.append(
            f"OUTSIDE the contact model: {'; '.join(remarks)}"
            if remarks
            else "inside the contact model"
        )
    return f"{', '.join(parts)} (turns {settle + 1} to {settle + summary.turns})"

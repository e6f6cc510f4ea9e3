"""`python -m benchmarks.orbits.tongues --out docs`: events of the box over speed and clearance."""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

import jaxcrusher as jc
from jaxcrusher.files.program import program
from jaxcrusher.files.results import results_folder, write_figure
from jaxcrusher.pictures.page import STYLE, WIDTH, plain_powers

SPEEDS, CLEARANCES = np.linspace(36.0, 40.0, 81), np.linspace(0.06e-3, 0.12e-3, 61)
BOUNDS = ((35.9, 40.1), (0.058e-3, 0.122e-3))
SCALES = (1.0, 3e-6)
# Where branches are followed, m: the speeds between which each meets an event, rad/s.
WINDOWS = (
    (0.1e-3, 37.25, 37.4),
    (0.11e-3, 37.9, 38.1),
    (0.09e-3, 38.0, 38.15),
    (0.07e-3, 37.0, 37.1),
)
COLOURS = {"fold": "tab:red", "period doubling": "tab:orange", "Neimark-Sacker": "tab:purple"}


def scene(speed, clearance) -> "jc.Scene":
    """Return a scene of the box."""
    return jc.build_scene({"speed": speed, "clearance": clearance})


def main(out: Path = Path("results/orbits")) -> None:
    """Follow events over speed and clearance; draw them over the map.

    Args:
        out: Folder of tongues.png.
    """
    jc.set_up()
    folder = results_folder(out)
    with plt.rc_context(STYLE):
        write_figure(folder / "tongues.png", figure())
    print(folder / "tongues.png")


def figure() -> Figure:
    """Draw the map, and the curves of events over it."""
    fig, ax = plt.subplots(figsize=(WIDTH, 4.0), layout="constrained")
    ideal = np.array([float(jc.periodic_orbit(jc.ideal_scene(s)).foundation_rms) for s in SPEEDS])
    cells = jc.orbit_map({"speed": SPEEDS, "clearance": CLEARANCES})
    excess = np.abs(cells.foundation_rms.values - ideal[:, None])
    norm = LogNorm(*np.nanpercentile(excess, (2, 99.5)))
    image = ax.pcolormesh(
        SPEEDS, 1e3 * CLEARANCES, excess.T, shading="nearest", norm=norm, rasterized=True
    )
    bar = fig.colorbar(image, ax=ax, label="RMS off an ideal joint's, N", extend="both")
    plain_powers(bar.ax)
    for clearance, low, high in WINDOWS:
        draw_events(ax, clearance, low, high)
    ax.set(xlabel="speed, rad/s", ylabel="clearance, mm", xlim=SPEEDS[[0, -1]])
    ax.set_ylim(1e3 * CLEARANCES[0], 1e3 * CLEARANCES[-1])
    ax.legend(loc="lower left")
    return fig


def draw_events(ax: Axes, clearance: float, low: float, high: float) -> None:
    """Draw the curve of each event on the branch between two speeds."""
    branch = jc.orbit_branch(
        lambda speed: scene(speed, clearance), low, (low - 0.1, high), scale=1.0, points=40
    )
    print(f"{1e3 * clearance:g} mm from {low:g} rad/s: {len(branch.orbits)} orbits. {branch.ended}")
    for event in branch.events:
        print(f"  {event.kind} at {event.parameter:.6f} rad/s", flush=True)
        curve = jc.bifurcation_curve(scene, event, clearance, BOUNDS, scales=SCALES, points=80)
        speeds, clearances = curve.table.parameter.values, curve.table.second.values
        print(f"    {len(speeds)} points, {speeds.min():.3f} to {speeds.max():.3f} rad/s, ", end="")
        print(f"{1e3 * clearances.min():.5f} to {1e3 * clearances.max():.5f} mm. {curve.ended}")
        known = event.kind in ax.get_legend_handles_labels()[1]
        label = None if known else event.kind
        ax.plot(speeds, 1e3 * clearances, color=COLOURS[event.kind], lw=1, label=label)
        for cusp in curve.events:
            print(f"    {cusp.kind} at {1e3 * cusp.parameter:.6f} mm", flush=True)


if __name__ == "__main__":
    program(main)

"""Maps of the steady-state RMS, and two stable motions for one design."""

from collections import Counter
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

import jaxcrusher as jc
from benchmarks.timing import spent
from jaxcrusher.files.results import results_folder, write_figure
from jaxcrusher.pictures.page import STYLE, WIDTH, plain_powers
from jaxcrusher.scenes.parameters import PE250X400, numbers_of

SPEEDS, CLEARANCES = np.linspace(25, 40, 61), np.linspace(0.03e-3, 0.12e-3, 46)
# The fold at this clearance, from both of its sides.
FOLDED = 0.1e-3
SIDES = ((36.9, True), (37.9, False))
BOUNDS = (36.8, 38.0)
# 192 a turn lose the branch from 37.9 rad/s at 37.33.
NODES = 384


def run(out: Path) -> None:
    """Compute, print, draw."""
    jc.set_up()
    folder = results_folder(out)
    with plt.rc_context(STYLE):
        write_figure(folder / "orbits.png", figure())
    print(folder / "orbits.png")


def figure() -> Figure:
    """Draw two maps, and below them the branch."""
    fig, panels = plt.subplot_mosaic(
        [["centre", "surface"], ["branch", "branch"]],
        figsize=(WIDTH, 5.8),
        layout="constrained",
        height_ratios=(5, 4),
    )
    ideal = np.array([float(jc.periodic_orbit(jc.ideal_scene(s)).foundation_rms) for s in SPEEDS])
    for slip in ("centre", "surface"):
        took, found = spent(
            lambda slip=slip: jc.orbit_map(
                {"speed": SPEEDS, "clearance": CLEARANCES},
                base={"slip": slip},
                slopes=tuple(numbers_of(PE250X400)),
            )
        )
        report(slip, found, *took)
        draw_map(fig, panels[slip], found, ideal, slip)
    draw_branch(panels["branch"])
    return fig


def report(slip: str, found: xr.Dataset, wall: float, cpu: float) -> None:
    """Print what was solved, and its time."""
    solved = float(found.success.mean())
    print(f"slip of the {slip}: {solved:.2%} of {found.success.size} designs solved, ", end="")
    print(f"{float(found.stable.mean()):.2%} stable, {wall:.0f} s, {cpu:.0f} s of processors")
    error = np.nanmax(found.error)
    print(f"  largest estimated error {error:.1e}, above 1e-8: ", end="")
    print(f"{float((found.error > 1e-8).mean()):.1%}")
    for why, count in Counter(found.failure.values.ravel().tolist()).items():
        if why:
            print(f"  {count}: {why}")


def draw_map(fig, ax, found: xr.Dataset, ideal: np.ndarray, slip: str) -> None:
    """Draw how far the RMS is off an ideal joint's; designs without an orbit are red."""
    excess = np.abs(found.foundation_rms.values - ideal[:, None])
    norm = LogNorm(*np.nanpercentile(excess, (2, 99.5)))
    millimetres = 1e3 * CLEARANCES
    ax.set_facecolor("tab:red")
    image = ax.pcolormesh(
        SPEEDS, millimetres, excess.T, shading="nearest", norm=norm, rasterized=True
    )
    bar = fig.colorbar(image, ax=ax, label="RMS off an ideal joint's, N", extend="both")
    plain_powers(bar.ax)
    ax.set(xlabel="speed, rad/s", ylabel="clearance, mm", title=f"slip of the {slip}s")


def scene(speed) -> jc.Scene:
    """Return a scene of the folded branch."""
    return jc.build_scene({"speed": speed, "clearance": FOLDED})


def draw_branch(ax) -> None:
    """Draw the RMS along the branch from both sides; unstable motions are dashed."""
    for i, (start, upwards) in enumerate(SIDES):
        branch = jc.orbit_branch(
            scene, start, BOUNDS, upwards=upwards, scale=1.0, nodes=NODES, points=80
        )
        speed, rms = branch.table.parameter.values, branch.table.foundation_rms.values
        stable = branch.table.stable.values
        for good, line in ((True, "-"), (False, "--")):
            shown = np.where(stable == good, rms, np.nan)
            label = {True: "stable", False: "unstable"}[good] if i == 0 else None
            ax.plot(speed, shown, line, color="tab:blue", label=label)
        for event in branch.events:
            print(f"at {1e3 * FOLDED:g} mm: {event.kind} at {event.parameter:.6f} rad/s")
            ax.axvline(event.parameter, color="0.6", lw=0.8)
            ax.annotate(f" {event.kind} {event.parameter:.4f}", (event.parameter, 21060))
        print(f"  from {start:g} rad/s: {len(branch.orbits)} points. {branch.ended}")
    ax.legend()
    ax.set(
        xlabel="speed, rad/s", ylabel="RMS, N", title=f"{1e3 * FOLDED:g} mm, slip of the centres"
    )
    ax.set_ylim(21030, 21460)

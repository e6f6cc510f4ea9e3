"""`python -m benchmarks.orbits.basins --out docs`: how many starts come to the likeliest motion."""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import jaxcrusher as jc
from jaxcrusher.files.program import program
from jaxcrusher.files.results import results_folder, write_figure
from jaxcrusher.pictures.page import STYLE, WIDTH

SPEEDS, CLEARANCES = np.linspace(37.0, 40.0, 7), np.linspace(0.08e-3, 0.12e-3, 5)
STARTS, TURNS = 16, 400


def main(out: Path = Path("results/orbits")) -> None:
    """Look at a grid of designs from random starts, and draw what they come to; three minutes.

    Args:
        out: Folder of basins.png.
    """
    jc.set_up()
    folder = results_folder(out)
    axes = {"speed": SPEEDS, "clearance": CLEARANCES}
    found = jc.basin_map(axes, starts=STARTS, turns=TURNS)
    print(f"largest standard error of a share: {float(found.share_error.max()):.3f}")
    print(f"designs with two motions and more: {int(((found.share > 0).sum('orbit') > 1).sum())}")
    shown = {
        "share of the likeliest motion": found.share.isel(orbit=0),
        "share that is unsettled": found.unsettled,
        "loudest over likeliest RMS": found.worst_rms / found.likeliest_rms,
    }
    with plt.rc_context(STYLE):
        fig, panels = plt.subplots(1, 3, figsize=(WIDTH, 2.6), sharey=True, layout="constrained")
        for ax, (title, values) in zip(panels, shown.items(), strict=True):
            image = ax.pcolormesh(SPEEDS, 1e3 * CLEARANCES, values.values.T, shading="nearest")
            fig.colorbar(image, ax=ax, location="bottom")
            ax.set(title=title, xlabel="speed, rad/s")
        panels[0].set_ylabel("clearance, mm")
        write_figure(folder / "basins.png", fig)
    print(folder / "basins.png")


if __name__ == "__main__":
    program(main)

"""Redraw this folder's pictures: `python docs/pictures/make.py`, about a minute."""

from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import jaxcrusher as jc
from jaxcrusher.pictures import plots
from jaxcrusher.pictures.film import animate
from jaxcrusher.pictures.mechanism import DRAWN, plot_mechanism

HERE = Path(__file__).parent


def main() -> None:
    """The mechanism, a turn of it, and a map that names what its cells are."""
    jc.set_up()
    scene = jc.paper_scene(30.0, 0.06e-3, start="contact")
    motion = jc.simulate(scene, 2 * np.pi / 30 * np.arange(36) / 36, outputs=DRAWN, rtol=1e-9)
    fig, ax = plt.subplots(figsize=(7, 5.6), layout="constrained")
    plot_mechanism(scene, motion, 12, ax)
    fig.savefig(HERE / "mechanism.png", dpi=90)
    animate(scene, motion, HERE / "turn.gif", dpi=55)

    speeds, clearances = np.linspace(25, 40, 12), np.linspace(0.03e-3, 0.12e-3, 7)
    grid = jc.sweep(speeds, clearances, 15, 10, slip="surface", friction=0.05, rtol=1e-6)
    fig, ax = plt.subplots(figsize=(7, 4.2), layout="constrained")
    plots.plot_sweep(grid, ax=ax)
    fig.savefig(HERE / "whirls.png", dpi=90)


if __name__ == "__main__":
    main()

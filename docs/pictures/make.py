"""`python docs/pictures/make.py`: this folder's pictures."""

from __future__ import annotations

import shlex
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

from jaxcrusher.files.program import program

if TYPE_CHECKING:
    from matplotlib.figure import Figure


# A pin of 0.5 mm play, which flies while the jaw goes back without a load.
FILM = """-m jaxcrusher film --motion run --turns 1 --set load_law closing_stroke --set load "30 kN"
--set clearance 0.5mm --set speed "35 rad/s" --set restitution 0.5 --set start contact"""


def main(out: Path = Path("results/pictures")) -> None:
    """Draw the pictures of the documentation, some minutes: letters, mechanism, film, a map.

    Args:
        out: Folder that they are written to; docs/pictures for the documentation's own.
    """
    import matplotlib.pyplot as plt
    import numpy as np
    from geometry import plot_geometry

    import jaxcrusher as jc
    from jaxcrusher.files.results import results_folder, write_figure
    from jaxcrusher.pictures import plots
    from jaxcrusher.pictures.mechanism import DRAWN, plot_mechanism
    from jaxcrusher.pictures.plots import WIDTH
    from jaxcrusher.scenes.build import build_linkage

    folder = results_folder(out)
    write_figure(folder / "geometry.png", plot_geometry(build_linkage({})), dpi=90)
    scene = jc.paper_scene(30.0, 0.06e-3, start="contact")
    motion = jc.simulate(scene, 2 * np.pi / 30 * np.arange(36) / 36, outputs=DRAWN, rtol=1e-9)
    fig, ax = plt.subplots(figsize=(WIDTH, 5.4), layout="constrained")
    # Two thirds of a turn: R_C, small beside R_O, is long enough for its name.
    plot_mechanism(scene, motion, 24, ax)
    write_figure(folder / "mechanism.png", fig)
    film(folder)
    axes = {"speed": np.linspace(25, 40, 12), "clearance": np.linspace(0.03e-3, 0.12e-3, 7)}
    machine = jc.paper_machine(slip="surface", friction=0.05)
    grid = jc.sweep(machine, axes, 15, 10, rtol=1e-6)
    fig, ax = plt.subplots(figsize=(WIDTH, 4.0), layout="constrained")
    plots.plot_sweep(grid, ax=ax)
    write_figure(folder / "whirls.png", fig)
    write_figure(folder / "bearings.png", bearings())
    write_figure(folder / "linkages.png", linkages(), dpi=70)
    write_figure(folder / "loose_guide.png", loose_guide(), dpi=90)


def film(folder: Path) -> None:
    """Film impacts by the command that the captions name."""
    with tempfile.TemporaryDirectory() as aside:
        line = [sys.executable, *shlex.split(FILM), "--out", aside]
        subprocess.run(line, check=True)
        for name in ("film.gif", "film.png"):
            shutil.copy(Path(aside) / "film" / name, folder / name)


def loose_guide() -> Figure:
    """Draw two turns of a slider in its gap, and its force on the guide."""
    import numpy as np

    import jaxcrusher as jc
    from jaxcrusher.pictures.plots import pins_and_force

    scene = jc.read_machine("examples/loose_guide.toml").scene()
    turns = np.linspace(0, 2, 2001)
    times = 2 * np.pi / float(scene.drive.speed) * turns
    motion = jc.simulate(scene, times, outputs=("guide_eccentricity", "guide_force"), rtol=1e-9)
    fig, ax = pins_and_force(scene, motion)
    ax.plot(turns, np.asarray(motion["guide_force"]) / 1e3, linewidth=0.8)
    ax.set(xlabel="turns of the crank", ylabel="force on the guide, to the left (kN)")
    return fig


def linkages() -> Figure:
    """Draw the linkages of the examples with the force in their loose joints."""
    import matplotlib.pyplot as plt
    import numpy as np

    import jaxcrusher as jc
    from jaxcrusher.pictures.mechanism import plot_mechanism

    fig, axes = plt.subplots(1, 3, figsize=(17, 5), layout="constrained")
    examples = Path(__file__).parents[2] / "examples"
    loose = {"slider_crank": "B", "four_bar": "B", "double_toggle": "A"}
    for ax, (name, joint) in zip(axes, loose.items(), strict=True):
        scene = jc.read_scene(examples / f"{name}.toml")
        turn = 2 * np.pi / float(scene.drive.speed)
        motion = jc.simulate(scene, turn / 40 * np.arange(41), outputs=(f"{joint}_reaction",))
        plot_mechanism(scene, motion, 6, ax).set_title(name)
    return fig


def bearings() -> Figure:
    """Draw the stiffness of the contact laws over the load, and how fast rollers settle."""
    import jax
    import jax.numpy as jnp
    import matplotlib.pyplot as plt
    import numpy as np

    import jaxcrusher as jc
    from jaxcrusher.mechanism.observables import bearing_stiffness
    from jaxcrusher.pictures.plots import WIDTH

    fig, (stiff, settling) = plt.subplots(1, 2, figsize=(WIDTH, 3.4), layout="constrained")
    forces = np.geomspace(300.0, 3e5, 40)
    line = "jaxcrusher.joint.cylinders:"
    named = {"paper, sphere": "lankarani_nikravesh", "rollers": "rollers"}
    named |= {f"line, {one}": line + one for one in ("Johnson", "Esdu", "Liu")}
    for label, law in named.items():
        scene = jc.build_scene({"contact_law": law})
        found = jax.vmap(lambda force, scene=scene: bearing_stiffness(scene, force))(
            jnp.asarray(forces)
        )
        stiff.loglog(forces / 1e3, found / 1e9, label=label)
    stiff.set(xlabel="load, kN", ylabel="stiffness dF/de, GN/m")
    stiff.legend(fontsize=8)

    def turns(damping: jax.Array) -> jax.Array:
        values = {"contact_law": "rollers", "rollers.damping": damping}
        return jc.periodic_orbit(jc.build_scene(values)).settling_turns

    dampings = np.geomspace(100.0, 3e4, 12)
    settling.loglog(dampings / 1e3, jax.vmap(turns)(jnp.asarray(dampings)), "o-", ms=3)
    pin = float(jc.periodic_orbit(jc.build_scene({})).settling_turns)
    settling.axhline(pin, color="gray", ls="--")
    settling.annotate("the paper's pin", (0.1, pin), (0, -12), textcoords="offset points")
    settling.set(xlabel="damping of a bearing, kN s/m", ylabel="turns to 1/e")
    return fig


if __name__ == "__main__":
    program(main)

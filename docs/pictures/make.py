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
# The block of docs/foundation.md.
BLOCK = {
    "foundation.mass": 6e3,  # kg
    "foundation.inertia": 2.5e3,  # kg m2
    "foundation.x": 0.3,  # m, as what follows
    "foundation.y": 0.2,
    "foundation.left": -0.7,
    "foundation.right": 0.9,
    "foundation.base": -0.6,
}


def main(out: Path = Path("results/pictures")) -> None:
    """Draw the pictures of the documentation, some minutes.

    Args:
        out: Folder that they are written to; docs/pictures for the documentation's own.
    """
    import matplotlib.pyplot as plt
    import numpy as np
    from geometry import plot_geometry
    from slopes import plot_slopes

    import jaxcrusher as jc
    from jaxcrusher.commands.orbit import draw
    from jaxcrusher.files.results import results_folder, write_figure
    from jaxcrusher.pictures import plots
    from jaxcrusher.pictures.mechanism import DRAWN, plot_mechanism
    from jaxcrusher.pictures.plots import WIDTH
    from jaxcrusher.pictures.site_sketch import draw_site
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
    write_figure(folder / "block.png", draw_site(jc.build_scene({"joint": "ideal"} | BLOCK)))
    write_figure(folder / "loads.png", loads())
    write_figure(folder / "identified.png", identified())
    write_figure(folder / "slopes.png", plot_slopes())
    write_figure(folder / "gallery.png", gallery())
    # As `python -m jaxcrusher orbit --set clearance "0.05 mm"` writes it.
    draw(jc.periodic_orbit(jc.build_scene({"clearance": 0.05e-3})), folder / "orbit.png")


def gallery() -> Figure:
    """Draw orders, multipliers, phase portrait and Campbell diagram of a crusher on soft mounts."""
    import matplotlib.pyplot as plt
    import numpy as np

    import jaxcrusher as jc
    from jaxcrusher.pictures import plots

    mounts = {"foundation.horizontal_stiffness": 8e6, "foundation.vertical_stiffness": 12e6}
    mounts |= {"foundation.horizontal_damping": 2e4, "foundation.vertical_damping": 3e4}
    machine = jc.paper_machine(**BLOCK, **mounts)
    orbit = jc.periodic_orbit(machine.scene())
    still = [
        jc.periodic_orbit(machine.scene(joint="ideal", speed=w)) for w in np.arange(16.0, 41.0)
    ]
    spectra = [jc.harmonics(one, 4, outputs=("transmitted_force",)) for one in still]
    fast = jc.paper_scene(35.0, 0.3e-3, start="contact", load_law="closing_stroke", load=30e3)
    turn = 2 * np.pi / 35.0
    flying = jc.simulate(fast, turn * np.linspace(4, 6, 4001), outputs=("eccentricity",))
    with plt.rc_context(plots.STYLE):
        fig, axes = plt.subplots(2, 2, figsize=(plots.WIDTH, 5.6), layout="constrained")
        plots.plot_orders(jc.harmonics(orbit, 4), axes[0, 0])
        plots.plot_multipliers(orbit.multipliers, axes[0, 1], error=float(orbit.multipliers_error))
        plots.plot_phase(flying, 0.3e-3, axes[1, 0])
        natural = jc.natural_modes(orbit.scene).frequency.to_numpy()
        plots.plot_campbell(spectra, "transmitted_force_y", axes[1, 1], natural=natural)
        fig.draw_without_rendering()  # square axes have their place after a first layout
    return fig


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


def loads() -> Figure:
    """Draw the load of each law over a turn of the ideal PE250x400 at 30 rad/s."""
    import matplotlib.pyplot as plt
    import numpy as np

    import jaxcrusher as jc
    from jaxcrusher.pictures.plots import STYLE, WIDTH, force_size

    angles = np.radians(np.linspace(0, 360, 1441))
    given = np.radians(np.arange(0, 360, 30))
    curve = np.stack([given, 9e3 + 3e3 * np.cos(given - 2.0)], axis=1)
    laws = {
        "along_jaw, normal_to_jaw": ({"load_law": "along_jaw"}, "-"),
        "closing_stroke": ({"load_law": "closing_stroke"}, "--"),
        "closing_stroke, load_edge": (
            {"load_law": "closing_stroke", "load_edge": np.radians(20.0)},
            "-.",
        ),
        "by_angle, twelve points": ({"load_law": "by_angle", "load_curve": curve}, ":"),
        "chamber": ({"load_law": "chamber"}, (0, (5, 1, 1, 1, 1, 1))),
    }
    with plt.rc_context(STYLE):
        fig, ax = plt.subplots(figsize=(WIDTH, 3.4), layout="constrained")
        for label, (described, style) in laws.items():
            scene = jc.build_scene({"joint": "ideal", "speed": 30.0} | described)
            seen = jc.simulate(scene, angles / 30.0, outputs=("crushing_load",))
            force = force_size(seen["crushing_load"])
            ax.plot(np.degrees(angles), force, linestyle=style, linewidth=1.4, label=label)
        ax.plot(np.degrees(given), curve[:, 1] / 1e3, "o", color="C3", markersize=3)
        ax.set(xlabel="angle of the shaft (degrees)", ylabel="load on the jaw (kN)")
        ax.set(xlim=(0, 360), xticks=range(0, 361, 45), ylim=(0, None))
        ax.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3, frameon=False)
        fig.draw_without_rendering()
    return fig


def identified() -> Figure:
    """Draw amplitudes of a block as measured, here drawn by chance, and as fitted."""
    import matplotlib.pyplot as plt
    import numpy as np

    import jaxcrusher as jc
    from jaxcrusher.identification.measurements import Measurement
    from jaxcrusher.pictures.plots import BLUE, ORANGE, STYLE, WIDTH

    sigma, sides = 0.03e-3, ("frame_velocity_x", "frame_velocity_y")
    numbers = {"foundation.mass": 6e3, "foundation.x": 0.3, "foundation.y": 0.2}
    block = jc.paper_machine(joint="ideal", **numbers)
    names = ["foundation.vertical_stiffness", "foundation.horizontal_stiffness"]

    def amplitudes(machine: jc.Machine, speed: float) -> list[float]:
        orbit = jc.periodic_orbit(machine.scene(speed=speed), nodes=32)
        found = jc.harmonics(orbit, 1, outputs=("frame_velocity",)).amplitude.sel(order=1)
        return [float(found.sel(quantity=side)) for side in sides]

    speeds, rng = np.linspace(24.0, 36.0, 5), np.random.default_rng(1)
    measured = [
        Measurement(float(speed), side, 1, exact + sigma * float(rng.standard_normal()), sigma)
        for speed in speeds
        for side, exact in zip(sides, amplitudes(block, float(speed)), strict=True)
    ]
    begin = block.replace(**{names[0]: 1.2e8, names[1]: 0.8e8})
    found = jc.identify(begin, measured, names, starts=1, nodes=32)
    fine = np.linspace(22.0, 38.0, 17)
    ways = {
        "begin of the search": (begin, ":", "0.4"),
        "fitted": (block.replace(**found.values), "-", BLUE),
    }
    with plt.rc_context(STYLE):
        fig, axes = plt.subplots(1, 2, figsize=(WIDTH, 3.0), layout="constrained")
        shown = {
            label: np.array([amplitudes(machine, float(speed)) for speed in fine])
            for label, (machine, *_) in ways.items()
        }
        for k, (ax, way) in enumerate(zip(axes, ("horizontal", "vertical"), strict=True)):
            for label, (_, style, colour) in ways.items():
                ax.plot(
                    fine * 30 / np.pi, 1e3 * shown[label][:, k], style, color=colour, label=label
                )
            values = [1e3 * one.amplitude for one in measured if one.quantity == sides[k]]
            bars = {"yerr": 2e3 * sigma, "fmt": "o", "ms": 3.5, "capsize": 2, "color": ORANGE}
            ax.errorbar(speeds * 30 / np.pi, values, label="measured, 2 sigma", **bars)
            ax.set(xlabel="speed of the shaft (rpm)", ylabel=f"{way} amplitude, order 1 (mm/s)")
        axes[0].legend(loc="upper left", frameon=False)
        fig.draw_without_rendering()
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

"""`python -m jaxcrusher film`: a motion as a film, and as a page that plays it offline."""

from pathlib import Path
from typing import NamedTuple

import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
from jaxtyping import Array
from matplotlib.animation import FFMpegWriter
from rich.console import Console

import jaxcrusher as jc
from jaxcrusher.basics.checks import require, require_whole
from jaxcrusher.commands.machines import read_machine, settings_of
from jaxcrusher.commands.options import Film as Options
from jaxcrusher.files.progress import progress, stages
from jaxcrusher.files.results import listed, write_figure
from jaxcrusher.files.resume import begin_beside
from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.motion.section import fine
from jaxcrusher.motion.simulation import Trajectory, headline_force
from jaxcrusher.orbits.forced import tracks, unrepeatable
from jaxcrusher.orbits.result import PeriodicOrbit
from jaxcrusher.pictures.film import STYLE, Film
from jaxcrusher.pictures.frames import pictures_of, write_film
from jaxcrusher.pictures.mechanism import drawn_of
from jaxcrusher.scenes.units import said

# Instants of the force and of paths in a turn. Impacts last some thousandths of a turn.
INSTANTS = 4000
# With more pictures the page would exceed 10 MB.
MOST = 150
SPEED, DPI = 20, 140  # pictures a second; dots an inch
RTOL = 1e-9  # tolerance of a run
FILES = ("film.html", "film.gif", "film.mp4", "film.png")
NO_FFMPEG = "film.mp4 is not written: it needs ffmpeg, which is not installed."


class Motion(NamedTuple):
    """A motion to be filmed: its name, and the force with ideal joints (None if not known)."""

    kind: str
    trajectory: Trajectory
    ideal: Array | None


def run(options: Options, console: Console) -> int:
    """Compute, draw and write. Return 1 if the run failed; ValueError for bad options."""
    found = read_machine(options.crusher)
    scene = found.scene()
    for name, least in {"period": 1, "settle": 0, "turns": 1, "frames": 2}.items():
        require_whole(name, getattr(options, name), least)
    must = f"be at most {MOST}, so that the page stays under 10 MB"
    require(options.frames <= MOST, "frames", must, options.frames)
    named = ("motion", "period", "effort", "settle", "turns", "frames")
    settings = settings_of("film", found, **{name: getattr(options, name) for name in named})
    folder = begin_beside(options.results.folder, settings, *FILES)
    orbit = _orbit(scene, options, console) if options.motion == "orbit" else None
    force = shown_force(scene)
    with stages(console, "computing the motion"):
        motion = _run(scene, options, force) if orbit is None else _along(orbit, options, force)
    if failure := motion.trajectory.failure:
        console.print(f"FAILED: {failure}", style="red")
        return 1
    if motion.ideal is None and not scene.is_ideal:
        console.print("The force with ideal joints is not drawn: they have no such motion.")
    machine = "PE250x400" if options.crusher.scene is None else options.crusher.scene.stem
    speed = said("speed", found.values["speed"], found.units)
    title = f"{machine}, {speed}: {motion.kind}"
    with plt.rc_context(STYLE):
        _film(scene, motion, force, title, options.frames, folder, console)
    console.print(listed(folder, FILES))
    return 0


def shown_force(scene: Scene) -> str:
    """Return the name of the drawn force: the force through supports, or the headline force."""
    on_supports = "transmitted_force" in scene.observables
    return "transmitted_force" if on_supports else headline_force(scene)


def _orbit(scene: Scene, options: Options, console: Console) -> PeriodicOrbit | None:
    """Return the periodic orbit; or print why there is none, and return None."""
    # The orbit holds a tracked impact velocity at the value that the motion reaches.
    if (refused := unrepeatable(scene)) and not tracks(scene):
        why = f"the machine must {refused}."
    else:
        with stages(console, "solving for the orbit (the first time half a minute)"):
            try:
                orbit = jc.periodic_orbit(scene, period=options.period, effort=options.effort)
            except KeyboardInterrupt as stop:
                console.print(*stop.args)
                raise
        if bool(orbit.success):
            if orbit.instability:
                console.print(orbit.instability)
            return orbit
        why = orbit.failure
    console.print(f"no periodic orbit, so the film is of a run: {why}")
    return None


def times_of(scene: Scene, first: int, turns: int, frames: int) -> np.ndarray:
    """Return evenly spaced instants, the same number between pictures, to the end of the turns."""
    count = frames * -(-INSTANTS * turns // frames)
    return 2 * np.pi / float(scene.drive.speed) * (first + turns * np.arange(count + 1) / count)


def _outputs(scene: Scene, force: str) -> tuple[str, ...]:
    return tuple(dict.fromkeys((force, *drawn_of(scene))))


def _run(scene: Scene, options: Options, force: str) -> Motion:
    """Return the motion from the scene's start, after the turns to settle."""
    first, turns = options.settle, options.turns
    times = times_of(scene, first, turns, options.frames)
    seen = jc.simulate(scene, times, outputs=_outputs(scene, force), rtol=RTOL)
    ideal = None
    if not scene.is_ideal:
        bare = jc.simulate(scene.ideal(), times, outputs=(force,), rtol=RTOL)
        ideal = bare[force] if bool(bare.success) else None
    return Motion(f"run, turns {first} to {first + turns}", seen, ideal)


def _along(orbit: PeriodicOrbit, options: Options, force: str) -> Motion:
    """Return the motion along a periodic orbit over one period."""
    scene = orbit.scene
    times = times_of(scene, 0, orbit.period, options.frames)
    angles = float(scene.drive.speed) * times
    seen = orbit.motion(angles, _outputs(scene, force))
    ideal = None
    if not scene.is_ideal:
        bare = jc.periodic_orbit(scene.ideal())
        ideal = bare.motion(angles, (force,))[force] if bool(bare.success) else None
    kind = "periodic orbit" if orbit.period == 1 else f"periodic orbit of {orbit.period} turns"
    kind += " under the mean load" if scene.steady() is not scene else ""
    kind += ", unstable" if not bool(orbit.stable | orbit.undecided) and not scene.is_ideal else ""
    return Motion(kind, Trajectory(jnp.asarray(times), fine(), seen), ideal)


def _film(
    scene: Scene,
    motion: Motion,
    force: str,
    title: str,
    frames: int,
    folder: Path,
    console: Console,
) -> None:
    """Draw the pictures, and write the film's files."""
    instants = range(
        0, len(motion.trajectory.time) - 1, (len(motion.trajectory.time) - 1) // frames
    )
    film = Film(scene, motion.trajectory, force, instants, title=title, ideal=motion.ideal)
    pictures = []
    with progress(console) as bars:
        bar = bars.add_task("pictures", total=frames)
        for picture in pictures_of(film.figure, film.show, instants, DPI):
            pictures.append(picture)
            bars.update(bar, advance=1)
    plt.close(film.figure)
    largest = int(np.argmax(film.size))
    still = Film(scene, motion.trajectory, force, [largest], title=title, ideal=motion.ideal)
    still.show(largest)
    write_figure(folder / "film.png", still.figure, DPI)
    for name in FILES[:-1]:
        if name.endswith(".mp4") and not FFMpegWriter.isAvailable():
            console.print(NO_FFMPEG)
            continue
        write_film(folder / name, pictures, SPEED, title, caption(scene, motion))


def caption(scene: Scene, motion: Motion) -> str:
    """Return the caption, which explains the parts of the picture."""
    parts = ["Left: the mechanism to scale, with its forces."]
    if not scene.is_ideal:
        parts.append(
            "Middle: what is loose, its clearance magnified, with the path of the pin so far; a "
            "dot marks where it touches."
        )
    beside = "" if motion.ideal is None else " beside that with ideal joints (dashed)"
    parts.append(f"Right: the force over the angle of the shaft at its mean speed{beside}.")
    return " ".join(parts)

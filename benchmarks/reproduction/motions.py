"""The motions behind the figures: histories over two turns, and sections once a turn."""

from dataclasses import dataclass
from typing import Literal

import jax.numpy as jnp
import numpy as np

import jaxcrusher as jc
from benchmarks.batch import map_scenes
from benchmarks.peers.equations import Crusher
from benchmarks.peers.exudyn_peer import Model
from benchmarks.peers.motion import Motion
from benchmarks.reproduction.readings import SETTLE_TURNS, Point, Slip, Start
from jaxcrusher.basics.plane import Vector
from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.mechanism.starts import shifted_start

SHOWN_TURNS = 2
HISTORY = 4000  # instants over them
FORMULATIONS: dict[str, Literal["eccentricity", "multiplier"]] = {
    "two degrees of freedom": "eccentricity",
    "multipliers (20)": "multiplier",
}
SECTIONS = 200  # turns of the Poincaré map


@dataclass(frozen=True)
class Portrait:
    """One motion as the paper shows it; the ideal joint's force beside it."""

    clearance: float  # mm
    turns: np.ndarray  # of the shaft, shape (HISTORY,)
    orbit: np.ndarray  # e, mm, shape (HISTORY, 2)
    force: np.ndarray  # on the foundation, N
    ideal_force: np.ndarray
    section: np.ndarray  # penetration, um, and its rate, mm/s, shape (SECTIONS, 2)


def _row(scene: Scene) -> dict:
    turn = 2 * jnp.pi / scene.drive.speed
    history = SETTLE_TURNS + SHOWN_TURNS * jnp.arange(float(HISTORY)) / HISTORY
    sections = SETTLE_TURNS + SHOWN_TURNS + jnp.arange(float(SECTIONS))
    assert scene.joints["main"] is not None
    names = ("eccentricity", "foundation_force", "penetration_ratio", "penetration_rate")
    motion = jc.simulate(
        scene, turn * jnp.concatenate([history, sections]), outputs=names, rtol=1e-6
    )
    depths, rates = motion.penetration_ratio, motion.penetration_rate
    orbit, force = motion.eccentricity, motion.foundation_force
    section = jnp.stack([1e6 * scene.joints.at("main").clearance * depths, 1e3 * rates], axis=1)
    return {"orbit": 1e3 * orbit[:HISTORY], "force": force[:HISTORY], "section": section[HISTORY:]}


def portraits(points: list[Point], slip: Slip) -> dict[Point, Portrait]:
    """Run from the centred start, settled as the paper's Figure 5."""
    scenes = [
        shifted_start(jc.paper_scene(speed, 1e-3 * c, slip=slip), Vector(0.0, 0.0))
        for speed, c in points
    ]
    turns = SETTLE_TURNS + SHOWN_TURNS * np.arange(HISTORY) / HISTORY
    found = {}
    for (speed, clearance), own in zip(points, map_scenes(_row, scenes), strict=True):
        times = 2 * np.pi / speed * turns
        ideal = jc.simulate(jc.ideal_scene(speed), times, outputs=("foundation_force",))
        found[speed, clearance] = Portrait(
            clearance, turns, ideal_force=np.asarray(ideal.foundation_force), **own
        )
    return found


@dataclass(frozen=True)
class Comparison:
    """Curves of one quantity by several programs, over time."""

    time: dict[str, np.ndarray]  # s
    force: dict[str, np.ndarray]  # magnitude of the force at A, N
    motion: dict[str, tuple[np.ndarray, np.ndarray]]  # of B in x: displacement, m, velocity, m/s


def compare(start: Start, end: float, step: float) -> Comparison:
    """Run 30 rad/s, 0.06 mm, surface slip, `end` seconds from `start`, by ours and by EXUDYN.

    EXUDYN stands in for the paper's Adams; `step` (s) is its.
    """
    times = np.linspace(0, end, 3001)
    clock, force, motion = {}, {}, {}
    names = ("joint_force", "jaw_position", "jaw_velocity")
    for label, formulation in FORMULATIONS.items():
        scene = jc.paper_scene(30.0, 0.06e-3, slip="surface", start=start, formulation=formulation)
        run = jc.simulate(scene, times, outputs=names, rtol=1e-9)
        clock[label] = times
        force[label] = np.linalg.norm(np.asarray(run.joint_force), axis=1)
        motion[label] = (np.asarray(run.jaw_displacement)[:, 0], np.asarray(run.jaw_velocity)[:, 0])
    scene = jc.paper_scene(30.0, 0.06e-3, slip="surface", start=start)
    assert scene.start is not None
    at = [
        complex(float(one.x), float(one.y))
        for play in scene.start.eccentricities(scene)
        for one in play.values
    ]
    crusher = Crusher(clearance=0.06e-3, friction=0.1, speed=30.0)
    seen = Model(Motion(crusher, e=at[0], rate=at[1])).run(end, step, every=1e-5)
    # Its sensors have no force before the first step.
    clock["EXUDYN"], force["EXUDYN"] = seen["time"][1:], seen["contact_force"][1:]
    return Comparison(clock, force, motion)

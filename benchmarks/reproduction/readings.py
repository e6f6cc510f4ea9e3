"""The readings that the paper's text allows, measured at the paper's operating points.

The paper says neither which slip speed its friction sees, nor what the force on the foundation
is, nor how long its windows are. Its Figure 5 shows two turns after 12 s, at 30 rad/s the 57th
turn: so motions settle for 57 turns, and peaks are those of windows of two turns.
"""

import functools
import itertools
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Literal, get_args

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

import jaxcrusher as jc
from benchmarks.batch import map_scenes, stacked
from jaxcrusher.basics.plane import Vector
from jaxcrusher.joint.validity import validity
from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.mechanism.starts import shifted_start

Slip = Literal["centre", "surface"]
Start = Literal["centred", "contact"]
Point = tuple[float, float]  # driving speed, rad/s, and radial clearance, mm

SPEED_POINTS: list[Point] = [(speed, 0.06) for speed in (25.0, 30.0, 35.0, 40.0)]
CLEARANCE_POINTS: list[Point] = [(30.0, clearance) for clearance in (0.03, 0.06, 0.09, 0.12)]
CHOICE: Point = (39.0, 0.03)
POINTS = list(dict.fromkeys([*SPEED_POINTS, *CLEARANCE_POINTS, CHOICE]))

FORCES = {"sum": "foundation_force", "net": "net_foundation_force"}
SAMPLES = 2048  # instants a turn: about ten to a revolution of a friction whirl
WINDOW_TURNS = 2
SETTLE_TURNS = 57
TURNS = 8
# Centred starts, this many clearances apart: the motions part before the second turn ends.
OFFSETS = (0.0, 1e-3, 2e-3)


@dataclass(frozen=True)
class Reading:
    """One way to read the paper; the default is the one this package decided for."""

    slip: Slip = "centre"
    impact_law: Literal["constant", "tracked"] = "constant"
    start: Start = "centred"
    load_law: str = "along_jaw"
    force: str = "sum"
    settle: int = SETTLE_TURNS

    def options(self) -> dict[str, Any]:
        """Return the options of `jaxcrusher.paper_scene`, without the start."""
        return {"slip": self.slip, "impact_law": self.impact_law, "load_law": self.load_law}


DECIDED = Reading()
# The decided reading and those that differ from it in one thing.
SINGLE_CHANGES = {
    "decided": DECIDED,
    "surface slip": Reading(slip="surface"),
    "tracked impact velocity": Reading(impact_law="tracked"),
    "start in contact": Reading(start="contact"),
    "load normal to jaw": Reading(load_law="normal_to_jaw"),
    "net force": Reading(force="net"),
    "settled 5 turns": Reading(settle=5),
}
# Every combination, but for the load, which is changed alone.
COMBINATIONS = [
    Reading(slip, law, start, "along_jaw", force)
    for slip, law, start, force in itertools.product(
        get_args(Slip), ("constant", "tracked"), get_args(Start), tuple(FORCES)
    )
]
READINGS = list(dict.fromkeys([*COMBINATIONS, *SINGLE_CHANGES.values()]))


def window_statistics(
    scene: Scene, settle: int, turns: int, windows: int, rtol: float
) -> dict[str, Array]:
    """Return sampled statistics of both forces; peaks (N) of each window, shape (windows,)."""
    turn = 2 * jnp.pi / scene.drive.speed
    count = turns * SAMPLES
    times = turn * (settle + jnp.arange(1, count + 1) / SAMPLES)
    names = (*FORCES.values(), "normal_force", "penetration_ratio", "penetration_rate")
    motion = jc.simulate(scene, times, outputs=names, rtol=rtol)
    seen = {"collision_peak": _peaks(motion.normal_force, windows)}
    for name, output in FORCES.items():
        force = motion[output]
        seen[f"{name}_mean"] = jnp.mean(force)
        seen[f"{name}_rms"] = jnp.sqrt(jnp.mean(force**2))
        seen[f"{name}_peak"] = _peaks(force, windows)
    if scene.joints["main"] is not None:
        deepest, fastest = jnp.max(motion.penetration_ratio), jnp.max(motion.penetration_rate)
        seen["hertzian"] = validity(scene.joints.at("main"), deepest, fastest).hertzian
    return seen


def _peaks(force: Array, windows: int) -> Array:
    return jnp.max(force.reshape(windows, -1), axis=1)


@functools.cache
def ideal_statistics(speed: float, load_law: str) -> dict[str, np.ndarray]:
    """Return the same statistics of the ideal joint, over one turn."""
    seen = window_statistics(jc.ideal_scene(speed, load_law=load_law), 0, 1, 1, 1e-9)
    return {name: np.asarray(value) for name, value in seen.items()}


@dataclass(frozen=True)
class Measured:
    """Every statistic of one reading, point and start, stacked over the runs."""

    statistics: dict[str, np.ndarray]

    def __getitem__(self, name: str) -> np.ndarray:
        return self.statistics[name]


Measurements = dict[tuple[Reading, Point], Measured]


def measure(
    readings: list[Reading],
    points: list[Point] = POINTS,
    turns: int = TURNS,
    done: Callable[[str], None] = lambda what: None,
) -> Measurements:
    """Run every reading at every point, and its ideal joint; `done` hears of each program.

    Keys have the reading's `force` set: both forces come from the same runs. The ideal joint's
    are under clearance 0.
    """
    found: Measurements = {}
    for options, settle, group in _by_program(readings):
        starts: dict[Start, None] = dict.fromkeys(reading.start for reading in group)
        runs: list[tuple[Start, Point, float]] = [
            (start, point, offset)
            for start in starts
            for point in points
            for offset in (OFFSETS if start == "centred" else OFFSETS[:1])
        ]
        scenes = [
            shifted_start(
                jc.paper_scene(speed, 1e-3 * c, start=start, **options), Vector(offset, 0.0)
            )
            for start, (speed, c), offset in runs
        ]
        function = eqx.Partial(
            window_statistics,
            settle=settle,
            turns=turns,
            windows=max(1, turns // WINDOW_TURNS),
            rtol=1e-6,
        )
        results = map_scenes(function, scenes)
        for reading in group:
            for point in points:
                key = reading.start, point
                own = (one for run, one in zip(runs, results, strict=True) if run[:2] == key)
                found[reading, point] = Measured(stacked(own))
            for speed in {speed for speed, _ in points}:
                found[reading, (speed, 0.0)] = Measured(ideal_statistics(speed, reading.load_law))
        done(", ".join(f"{name} {value}" for name, value in options.items()))
    return found


def _by_program(readings: list[Reading]) -> Iterator[tuple[dict, int, list[Reading]]]:
    """Yield readings that run together: they differ only in start and force."""
    groups: dict[tuple, list[Reading]] = {}
    for reading in readings:
        groups.setdefault((*reading.options().values(), reading.settle), []).append(reading)
    for group in groups.values():
        yield group[0].options(), group[0].settle, group

"""Ours of the cases: instant by instant and by statistics, of all at once in lanes."""

from collections.abc import Iterable
from typing import NamedTuple

import jaxcrusher as jc
from benchmarks.batch import map_scenes
from benchmarks.stability.case import Case, Formulation
from benchmarks.stability.reference import SETTLE, TIMES, TURNS
from jaxcrusher.motion.simulation import Trajectory
from jaxcrusher.motion.statistics import Statistics

# The most steps of a span and of a turn: a bound of seconds a case.
MOST_STEPS = 1_000_000
METHOD = jc.Method(max_steps=MOST_STEPS)


class Ours(NamedTuple):
    """A motion of a case."""

    history: Trajectory
    statistics: Statistics


def simulate(scene: jc.Scene) -> Trajectory:
    """Return our motion at the reference's instants."""
    played = (f"{scene.prefix(name)}eccentricity" for name, _ in scene.joints.items())
    return jc.simulate(scene, TIMES, outputs=("foundation_force", *played), method=METHOD)


def statistics(scene: jc.Scene) -> Statistics:
    """Return our statistics over the reference's turns."""
    return jc.statistics(scene, SETTLE, TURNS, method=METHOD)


def _motion(scene: jc.Scene) -> Ours:
    return Ours(simulate(scene), statistics(scene))


def motions(cases: Iterable[Case], formulation: Formulation) -> dict[Case, Ours | ValueError]:
    """Return the motion of every case, or why its scene is refused."""
    found: dict[Case, Ours | ValueError] = {}
    scenes: dict[Case, jc.Scene] = {}
    for case in cases:
        try:
            scenes[case] = case.scene(formulation)
        except ValueError as error:
            found[case] = error
    return found | dict(zip(scenes, map_scenes(_motion, list(scenes.values())), strict=True))

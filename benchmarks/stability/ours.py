"""Ours of the cases: instant by instant and by statistics, of all at once in lanes."""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import jax
import numpy as np

import jaxcrusher as jc
from benchmarks.stability.case import AbstractCase, Formulation
from benchmarks.stability.reference import SETTLE, TIMES, TURNS
from jaxcrusher.batch.engines import stack
from jaxcrusher.crusher.joints import before

# Steps of a span and of a turn, at most: a bound of seconds a case.
MOST_STEPS = 1_000_000
METHOD = jc.Method(max_steps=MOST_STEPS)


class Ours(NamedTuple):
    """A motion of a case."""

    history: jc.Trajectory
    statistics: jc.Statistics


def simulate(scene: jc.Scene) -> jc.Trajectory:
    """Ours at the reference's instants."""
    played = (f"{before(name)}eccentricity" for name, _ in scene.joints.present())
    return jc.simulate(scene, TIMES, outputs=("foundation_force", *played), method=METHOD)


def statistics(scene: jc.Scene) -> jc.Statistics:
    """Ours over the reference's turns."""
    return jc.statistics(scene, SETTLE, TURNS, method=METHOD)


def motion(scene: jc.Scene) -> Ours:
    """Both."""
    return Ours(simulate(scene), statistics(scene))


def in_lanes(function, scenes: Sequence[jc.Scene]) -> list:
    """A function of each scene; those of one structure side by side."""
    found: dict[int, object] = {}
    kinds = [jax.tree.structure(scene) for scene in scenes]
    for kind in dict.fromkeys(kinds):
        places = [i for i, other in enumerate(kinds) if other == kind]
        results = jc.map_all(function, stack([scenes[i] for i in places]))
        for at, i in enumerate(places):
            found[i] = jax.tree.map(lambda leaf, at=at: np.asarray(leaf[at]), results)
    return [found[i] for i in range(len(scenes))]


def motions(
    cases: Iterable[AbstractCase], formulation: Formulation
) -> dict[AbstractCase, Ours | ValueError]:
    """Of every case; why there is none, where its scene is refused."""
    found: dict[AbstractCase, Ours | ValueError] = {}
    scenes: dict[AbstractCase, jc.Scene] = {}
    for case in cases:
        try:
            scenes[case] = case.scene(formulation)
        except ValueError as error:
            found[case] = error
    return found | dict(zip(scenes, in_lanes(motion, list(scenes.values())), strict=True))

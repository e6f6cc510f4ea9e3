"""The programs, all integrating the same designs with the same tableau, controller and tolerance.

Each is a function that runs all designs in the current process and returns its answer.
"""

from collections.abc import Callable
from typing import Literal, NamedTuple

import diffrax
import equinox as eqx
import jax
import numpy as np

import jaxcrusher as jc
from benchmarks.peers import numba_peer
from benchmarks.peers.equations import Crusher
from benchmarks.timing import timed_in_turn
from jaxcrusher.basics.plane import Vector
from jaxcrusher.batch import engines
from jaxcrusher.mechanism.starts import shifted_start

# The tolerance hardly matters to the quiet motion, whose steps are limited by stability.
RTOL, FIRST_STEP = 1e-6, 1e-5
FRICTION = 0.1


class Designs(NamedTuple):
    """The same crushers as scenes for ours and as numbers for the others, over whole turns."""

    scenes: jc.Scene  # stacked
    starts: np.ndarray  # (designs, 5): e / c, e' (m/s), 0
    numbers: np.ndarray  # (designs, 24), see `numba_peer.numbers`
    turns: int


class Found(NamedTuple):
    """The answer of a program for each design."""

    rms: np.ndarray  # N
    steps: np.ndarray  # accepted and rejected


class Cost(NamedTuple):
    """Medians over the repeats; the first run apart."""

    cpu: float  # s a step
    first: float  # CPU seconds of the first run less a later one: trace and compile
    found: Found


Start = Literal["centred", "contact"]
Program = Callable[[], Found]


def designs(start: Start, turns: int, side: int = 8) -> Designs:
    """Return `side` squared crushers round 30 rad/s and 0.06 mm, with the slip of the surfaces."""
    speeds, clearances = np.meshgrid(np.linspace(28, 32, side), np.linspace(0.05e-3, 0.07e-3, side))
    speeds, clearances = speeds.ravel(), clearances.ravel()

    def scene(speed, clearance):
        crusher = jc.paper_scene(speed, clearance, start=start, slip="surface", friction=FRICTION)
        return shifted_start(crusher, Vector(0.0, 0.0))

    scenes = jax.jit(jax.vmap(scene))(speeds, clearances)
    place, rate = (one["main"] for one in (scenes.start.relative, scenes.start.rate))
    starts = np.stack([place.x, place.y, rate.x, rate.y, np.zeros_like(speeds)], axis=1)
    crushers = [
        Crusher(clearance=c, speed=w, friction=FRICTION)
        for w, c in zip(speeds.tolist(), clearances.tolist(), strict=True)
    ]
    return Designs(scenes, starts, np.stack([numba_peer.numbers(c) for c in crushers]), turns)


def statistics_of(scene: jc.Scene, turns: int) -> Found:
    """Integrate by `jaxcrusher.statistics`."""
    result = jc.statistics(
        scene,
        0,
        turns,
        outputs=("foundation_rms",),
        rtol=RTOL,
        method=jc.Method(diffrax.Dopri5(), dt0=FIRST_STEP),
    )
    return Found(result.foundation_rms, result.outcome.steps)  # pyright: ignore


def in_lanes(d: Designs) -> Program:
    """Return the program of the engine of `jaxcrusher.sweep`: lanes."""
    return _ours(d, engines.in_lanes)


def in_turn(d: Designs) -> Program:
    """Return the program that lanes hand over to: one scene after the other."""
    return _ours(d, engines.in_turn)


def _ours(d: Designs, engine: engines.Engine) -> Program:
    function = eqx.Partial(statistics_of, turns=d.turns)
    return lambda: engines.run_all(function, d.scenes, len(d.starts), engine)


def vmap(d: Designs) -> Program:
    """Return the program of `jax.vmap` over `jaxcrusher.statistics`."""
    compiled = eqx.filter_jit(jax.vmap(lambda scene: statistics_of(scene, d.turns)))
    return lambda: jax.tree.map(np.asarray, compiled(d.scenes))


def numba(d: Designs) -> Program:
    """Return the crusher by hand for numba."""

    def run() -> Found:
        pairs = [
            numba_peer.integrate(start.copy(), numbers, 0, d.turns, RTOL, FIRST_STEP)
            for start, numbers in zip(d.starts, d.numbers, strict=True)
        ]
        mean_squares, steps = np.array(pairs).T
        return Found(np.sqrt(mean_squares), steps)

    return run


def costs(programs: dict[str, Program], repeats: int) -> dict[str, Cost]:
    """Return the cost of a step of each program."""
    found = {}
    for name, (first, again, result) in timed_in_turn(programs, repeats).items():
        steps = int(result.steps.sum())
        found[name] = Cost(again.cpu / steps, first.cpu - again.cpu, result)
    return found

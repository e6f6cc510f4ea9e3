"""The programs, small, each by lanes and one motion after the other."""

import itertools
from collections.abc import Callable
from unittest import mock

import numpy as np

import jaxcrusher as jc
from benchmarks.pages import table
from benchmarks.reproduction.motions import portraits
from benchmarks.setting import setting
from benchmarks.stability.cases import cases
from benchmarks.stability.ours import motions
from benchmarks.timing import timed
from jaxcrusher.batch import engines
from optimize.evaluate import Window, evaluate
from optimize.options import Options
from optimize.problem import resolve

RTOL = 1e-6


def _bifurcation() -> None:
    def scene(clearance: float) -> jc.Scene:
        return jc.paper_scene(30.0, clearance, start="contact")

    clearances = np.linspace(4e-5, 8e-5, 64)
    jc.bifurcation(scene, clearances, direction="cold", settle_turns=0, turns=20, rtol=RTOL)


def _settled_motions() -> None:
    scene = jc.paper_scene(30.0, 6e-5, friction=0.02, slip="surface")
    jc.coexisting_orbits(scene, starts=16, turns=96)


def _landscape() -> None:
    case = resolve(Options()).case
    units = np.random.default_rng(0).uniform(size=(64, len(case.design.names)))
    evaluate(case, units, Window(0, 3, RTOL))


def _portraits() -> None:
    portraits([(speed, c) for speed in (25.0, 30.0) for c in (0.06, 0.12)], "surface")


def _stability() -> None:
    motions(itertools.islice(cases(), 16), "eccentricity")


def _sweep() -> None:
    axes = {"speed": np.linspace(28, 32, 16), "clearance": np.linspace(5e-5, 7e-5, 16)}
    jc.sweep(axes, 0, 3, base={"start": "contact"}, rtol=RTOL)


# Programs that users call, by name.
PROGRAMS: dict[str, Callable[[], None]] = {
    "sweep: 256 crushers, 3 turns": _sweep,
    "bifurcation diagram: 64 clearances, 20 turns": _bifurcation,
    "periodic orbits: 16 starts, 96 turns": _settled_motions,
    "search's landscape: 64 points, two starts, 3 turns": _landscape,
    "portraits of the paper's: 4 motions": _portraits,
    "stiff and extreme cases: 16 of them": _stability,
}


def run() -> None:
    """Print the table."""
    print(f"{setting()}. CPU seconds; first runs in brackets.\n")
    rows = []
    for name, program in PROGRAMS.items():
        lanes = timed(program, 1)
        with mock.patch.dict(engines.ENGINES, lanes=engines.in_turn):
            turn = timed(program, 1)
        times = (f"{one.again.cpu:.2f} ({one.first.cpu:.1f})" for one in (turn, lanes))
        rows.append([name, *times, f"{turn.again.cpu / lanes.again.cpu:.1f}"])
    print(table(("program", "in turn", "lanes", "in turn / lanes"), rows))

"""Times of first orbits in fresh processes, of slopes of a run, and growth; medians of three."""

import functools
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import diffrax
import jax
import jax.numpy as jnp
import numpy as np

import jaxcrusher as jc
from benchmarks.pages import publish, table
from benchmarks.timing import timed, timed_in_turn
from jaxcrusher.files.results import results_folder

REPEATS = 3
# A pin at rest in each bore, held there by the rod.
ROD = {"rod.stiffness": 2e5, "rod.preload": 2e4, "load_law": "normal_to_jaw"}
LOOSE = {
    "A": ROD,
    "A and B": ROD | {"elbow.clearance": 5e-5},
    "A, B and C": ROD | {"elbow.clearance": 5e-5, "pivot.clearance": 4e-5},
}
# What a fresh process computes.
FIRST = {
    "no orbit: the imports and a scene": "jc.paper_scene(30.0, 6e-5)",
    "the paper's crusher": "jc.periodic_orbit(jc.paper_scene(30.0, 6e-5))",
    "A, B and C loose": f"jc.periodic_orbit(jc.build_scene({LOOSE['A, B and C']}))",
}
NODES, DESIGNS = (48, 96, 192, 384), (1, 16, 256, 4096)
NUMBERS = ("speed", "clearance", "friction", "load")
NUMBERS += ("restitution", "jaw.mass", "jaw.inertia", "toggle.mass")
COUNTS, TURNS, REVERSE = (1, 2, 4, 8), 3, diffrax.RecursiveCheckpointAdjoint()


def run(out: Path) -> None:
    """Measure and publish."""
    folder, began = results_folder(out), time.perf_counter()
    tables = {
        "first": table(("a fresh process", "empty caches, s", "full caches, s"), _first_rows()),
        "nodes": table(("nodes a turn", "ms"), _orbits({str(n): ({}, n) for n in NODES})),
        "joints": table(("loose joints", "ms"), _orbits({n: (m, 96) for n, m in LOOSE.items()})),
        "designs": table(("designs", "us a turn of a design"), _sweeps()),
        "slopes": table(("slopes by", "forward sensitivities", "steps backwards"), _slopes()),
    }
    minutes = (time.perf_counter() - began) / 60
    publish(folder, "waits.md", tables, "jax", "jaxlib", "diffrax", "equinox", minutes=minutes)


def _first_rows() -> list[Sequence[object]]:
    """Return seconds of processes by the clock, without compiled programs and with them."""
    rows = []
    for name, what in FIRST.items():
        spans = []
        for _ in range(REPEATS):
            with tempfile.TemporaryDirectory() as folder:
                spans.append([_process(what, folder) for _ in range(2)])
        rows.append([name, *(f"{span:.1f}" for span in np.median(spans, axis=0))])
    return rows


def _process(what: str, caches: str) -> float:
    """Return the seconds of a process that computes `what` with compiled programs in a folder."""
    code = f"import jaxcrusher as jc; jc.set_up(); print({what})"
    kept = {"JAX_COMPILATION_CACHE_DIR": caches, "JAX_ENABLE_COMPILATION_CACHE": "1"}
    environment = os.environ | kept
    began = time.perf_counter()
    subprocess.run([sys.executable, "-c", code], env=environment, check=True, capture_output=True)
    return time.perf_counter() - began


def _orbits(cases: dict[str, tuple[dict, int]]) -> list[Sequence[object]]:
    """Return the milliseconds of compiled orbits of crushers with so many nodes a turn."""

    def program(numbers: dict, nodes: int) -> Callable[[], jax.Array]:
        machine = jc.paper_machine(**numbers)

        @jax.jit
        def rms(clearance: jax.Array) -> jax.Array:
            scene = machine.replace(clearance=clearance).scene()
            return jc.periodic_orbit(scene, nodes=nodes).foundation_rms

        return lambda: rms(jnp.asarray(6e-5))

    found = timed_in_turn({name: program(*case) for name, case in cases.items()}, 4 * REPEATS)
    return [[name, f"{1e3 * one.again.wall:.2f}"] for name, one in found.items()]


def _sweeps() -> list[Sequence[object]]:
    """Return the microseconds of a turn of a design, in sweeps of more and more designs."""
    machine, rows = jc.paper_machine(start="contact"), []
    for count in DESIGNS:
        axes = {"speed": np.linspace(25.0, 32.0, count), "clearance": [6e-5]}
        sweep = functools.partial(jc.sweep, machine, axes, 0, TURNS, rtol=1e-6)
        spent = timed(sweep, REPEATS).again
        rows.append([count, f"{1e6 * spent.wall / (TURNS * count):.1f}"])
    return rows


def _slopes() -> list[Sequence[object]]:
    """Return times of an RMS's gradient over those of its value, by more and more numbers."""
    machine = jc.paper_machine(start="contact")
    at = jnp.array([machine.number(name) for name in NUMBERS])

    def rms(values: jax.Array, method: jc.Method) -> jax.Array:
        numbers = dict(zip(NUMBERS, values, strict=False))
        found = jc.statistics(machine.replace(**numbers).scene(), 0, TURNS, method=method)
        return found.foundation_rms

    def program(function: Callable, count: int, method: jc.Method) -> Callable:
        compiled = jax.jit(lambda values: function(rms)(values, method))
        return lambda: compiled(at[:count])

    ways = {"forward": jc.Method(), "backwards": jc.Method(adjoint=REVERSE)}
    programs = {(0, "value"): program(lambda value: value, len(NUMBERS), ways["forward"])}
    for count in COUNTS:
        for name, method in ways.items():
            programs[count, name] = program(jax.grad, count, method)
    found = timed_in_turn(programs, 3 * REPEATS)
    value = found[0, "value"].again.wall
    spent = {key: f"{one.again.wall / value:.1f}" for key, one in found.items()}
    return [[count, spent[count, "forward"], spent[count, "backwards"]] for count in COUNTS]

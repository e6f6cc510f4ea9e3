"""Operations, trace and compile time, and the time of a run, of scenes that leave things out."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import diffrax
import jax
import numpy as np

import jaxcrusher as jc
from benchmarks.pages import publish, table
from benchmarks.scenes.operations import field_operations, operations, traced
from benchmarks.timing import spent, timed_in_turn
from jaxcrusher.files.progress import progress
from jaxcrusher.files.results import results_folder

RUNS = 40
TIMES = np.linspace(0, 2 * np.pi / 30, 513)
# As many steps for every scene: times are then those of a step.
STEPS = 2048
BY_ANGLE, BY_TIME = (
    jc.Method(stepsize_controller=diffrax.ConstantStepSize(), dt0=float(span) / STEPS)
    for span in (2 * np.pi, TIMES[-1])
)
Look = Callable[[jc.Scene], Any]


def _simulated(outputs: tuple[str, ...] | None) -> Look:
    chosen: dict[str, Any] = {} if outputs is None else {"outputs": outputs}
    return lambda scene: jc.simulate(scene, TIMES, method=BY_TIME, **chosen)


RMS = "the rms over a turn"
LOOKS: dict[str, Look] = {
    RMS: lambda s: jc.statistics(s, 0, 1, outputs=("foundation_rms",), method=BY_ANGLE),
    "every statistic of a turn": lambda s: jc.statistics(s, 0, 1, method=BY_ANGLE),
    "the foundation force at 513 instants": _simulated(("foundation_force",)),
    "the foundation force and the energy ledger": _simulated(("foundation_force", "energy")),
    "every output at 513 instants": _simulated(None),
}
FULL: dict[str, Any] = {"slip": "surface", "start": "contact"}


def _loose(*joints: str) -> tuple[dict[str, Any], tuple[str, ...]]:
    """Return the full scene with joints loose besides, under a load that keeps them in contact."""
    numbers = {f"{joint}.{name}": v for joint in joints for name, v in SEAT.items()}
    return FULL | {"load_law": "normal_to_jaw"} | numbers, (RMS,)


SEAT = {"clearance": 1e-4, "slip": "surface"}
# Scenes by name: numbers of a description, and what is computed of each.
SCENES: dict[str, tuple[dict[str, Any], tuple[str, ...]]] = {
    "ideal joint": ({"joint": "ideal"}, (RMS, "every output at 513 instants")),
    "no friction, no load": ({"start": "contact", "friction": 0, "load_law": "none"}, (RMS,)),
    "no friction": ({"start": "contact", "friction": 0}, (RMS,)),
    "full": (FULL, tuple(LOOKS)),
    "full, impact velocity tracked": (FULL | {"impact_law": "tracked"}, (RMS,)),
    "full, multipliers": (FULL | {"formulation": "multiplier"}, (RMS,)),
    "full, B loose too": _loose("elbow"),
    "full, C loose too": _loose("pivot"),
    "full, B and C loose too": _loose("elbow", "pivot"),
}


def compiled(look: Look, scene: jc.Scene) -> tuple[dict[str, float], Callable[[], Any]]:
    """Return operations, seconds of tracing and compiling, and the program, ready to run."""
    program, numbers = traced(look, scene)
    count = operations(jax.make_jaxpr(program)(numbers).jaxpr)
    traces, lowered = spent(lambda: program.lower(numbers))
    compiles, ready = spent(lowered.compile)
    found = {"program_operations": count, "trace_s": traces.wall, "compile_s": compiles.wall}
    return found, lambda: ready(numbers)


def run(out: Path) -> None:
    """Measure every scene; write the csv and the page."""
    folder, rows, programs = results_folder(out), [], []
    pairs = [(name, look) for name, (_, looks) in SCENES.items() for look in looks]
    with progress() as bars:
        for name, look in bars.track(pairs, description="scenes"):
            scene = jc.build_scene({"speed": 30.0, "clearance": 0.06e-3} | SCENES[name][0])
            found, program = compiled(LOOKS[look], scene)
            count = field_operations(scene)
            rows.append({"scene": name, "computed": look, "field_operations": count} | found)
            programs.append(program)
    for at, one in timed_in_turn(dict(enumerate(programs)), RUNS).items():
        rows[at]["run_ms"] = 1e3 * one.again.wall
    publish(folder, "scenes.md", tables(rows), rows=rows)


def tables(rows: list[dict[str, Any]]) -> dict[str, str]:
    """Return the table of scenes, and that of the unit of their times."""
    base = next(r["run_ms"] for r in rows if (r["scene"], r["computed"]) == ("full", RMS))
    cells = [
        [
            *(r["scene"], r["computed"], r["field_operations"], r["program_operations"]),
            *(f"{r['trace_s']:.1f}", f"{r['compile_s']:.1f}", f"{r['run_ms'] / base:.2f}"),
        ]
        for r in rows
    ]
    heads = ("scene", "computed", "operations: field", "program", "trace s", "compile s", "run")
    unit = table(("unit of a run, ms", "us a step"), [[f"{base:.2f}", f"{1e3 * base / STEPS:.2f}"]])
    return {"unit": unit, "scenes": table(heads, cells)}

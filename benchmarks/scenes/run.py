"""Operations, trace and compile time, and the time of a run, of scenes that leave things out."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import diffrax
import jax
import numpy as np

import jaxcrusher as jc
from benchmarks.scenes.operations import field_operations, operations, traced
from benchmarks.setting import setting
from jaxcrusher.files.progress import progress
from jaxcrusher.files.provenance import command
from jaxcrusher.files.results import results_folder, write_table, write_text

RUNS = 41
TIMES = np.linspace(0, 2 * np.pi / 30, 513)
# As many steps for every scene: times are then those of a step.
STEPS = 2048
BY_ANGLE, BY_TIME = (
    jc.Method(stepsize_controller=diffrax.ConstantStepSize(), dt0=float(span) / STEPS)
    for span in (2 * np.pi, TIMES[-1])
)


def compiled(function, scene: jc.Scene) -> tuple[dict[str, float], Callable[[], Any]]:
    """Operations, seconds of tracing and compiling; and the program, ready to run."""
    program, numbers = traced(function, scene)
    count = operations(jax.make_jaxpr(program)(numbers).jaxpr)
    began = time.perf_counter()
    lowered = program.lower(numbers)
    middle = time.perf_counter()
    ready = lowered.compile()
    end = time.perf_counter()
    found = {"program_operations": count, "trace_s": middle - began, "compile_s": end - middle}
    return found, lambda: jax.block_until_ready(ready(numbers))


def median_times(programs: list[Callable[[], Any]]) -> list[float]:
    """Milliseconds of each, run in turn so that a slow moment of the machine meets all."""
    times = []
    for _ in range(RUNS):
        times.append([])
        for program in programs:
            start = time.perf_counter()
            program()
            times[-1].append(1e3 * (time.perf_counter() - start))
    return np.median(times[1:], axis=0).tolist()


def rms_only(scene: jc.Scene):
    """The RMS over a turn."""
    return jc.statistics(scene, 0, 1, outputs=("foundation_rms",), method=BY_ANGLE)


def all_statistics(scene: jc.Scene):
    """Every statistic of a turn."""
    return jc.statistics(scene, 0, 1, method=BY_ANGLE)


def one_history(scene: jc.Scene):
    """The foundation force at 513 instants."""
    return jc.simulate(scene, TIMES, outputs=("foundation_force",), method=BY_TIME)


def with_ledger(scene: jc.Scene):
    """The foundation force and the energy ledger."""
    return jc.simulate(scene, TIMES, outputs=("foundation_force", "energy"), method=BY_TIME)


def all_histories(scene: jc.Scene):
    """Every output at 513 instants."""
    return jc.simulate(scene, TIMES, method=BY_TIME)


def cases() -> list[tuple[str, jc.Scene, list]]:
    """Name, scene and what to compute of it."""
    full = jc.paper_scene(30.0, 0.06e-3, start="contact", slip="surface")
    functions = [rms_only, all_statistics, one_history, with_ledger, all_histories]
    return [
        ("ideal joint", jc.ideal_scene(30.0), [rms_only, all_histories]),
        (
            "no friction, no load",
            jc.paper_scene(30.0, 0.06e-3, start="contact", friction=0, load_law="none"),
            [rms_only],
        ),
        ("no friction", jc.paper_scene(30.0, 0.06e-3, start="contact", friction=0), [rms_only]),
        ("full", full, functions),
        (
            "full, impact velocity tracked",
            jc.paper_scene(30.0, 0.06e-3, start="contact", slip="surface", impact_law="tracked"),
            [rms_only],
        ),
        (
            "full, multipliers",
            jc.paper_scene(
                30.0, 0.06e-3, start="contact", slip="surface", formulation="multiplier"
            ),
            [rms_only],
        ),
        *(
            (f"full, {words} loose too", _worn(joints), [rms_only])
            for words, joints in (
                ("B", ("elbow",)),
                ("C", ("pivot",)),
                ("B and C", ("elbow", "pivot")),
            )
        ),
    ]


def _worn(joints: tuple[str, ...]) -> jc.Scene:
    """The full scene with these joints loose, under a load that keeps them in contact."""
    values = {"slip": "surface", "start": "contact", "load_law": "normal_to_jaw"}
    for joint in joints:
        values |= {f"{joint}.clearance": 1e-4, f"{joint}.slip": "surface"}
    return jc.build_scene(values)


def run(out: Path) -> None:
    """Measure every case; write the csv and the page."""
    folder, rows, programs = results_folder(out), [], []
    pairs = [(n, s, f) for n, s, functions in cases() for f in functions]
    with progress() as bars:
        for name, scene, function in bars.track(pairs, description="scenes"):
            what = (function.__doc__ or "").rstrip(".").lower()
            found, program = compiled(function, scene)
            field = field_operations(scene)
            rows.append({"scene": name, "computed": what, "field_operations": field} | found)
            programs.append(program)
    for row, milliseconds in zip(rows, median_times(programs), strict=True):
        row["run_ms"] = milliseconds
    write_table(folder / "scenes.csv", rows)
    text = page(rows)
    write_text(folder / "scenes.md", text)
    print(text)


def page(rows: list[dict]) -> str:
    """The page in Markdown."""
    base = next(r for r in rows if r["scene"] == "full" and "rms" in r["computed"])["run_ms"]
    lines = [
        "# What a scene leaves out",
        "",
        f"Made by `{command()}`; not edited by hand. One turn of the quiet motion",
        f"at 30 rad/s, 0.06 mm, in {STEPS} equal steps of Tsit5, on",
        f"{setting()}.",
        f"Runs are medians of {RUNS - 1} rounds, in units of the full scene's RMS ({base:.2f} ms,",
        f"{1e3 * base / STEPS:.2f} us a step).",
        "",
        "| scene | computed | operations: field | program | trace s | compile s | run |",
        "|---|---|---|---|---|---|---|",
    ]
    lines += [
        f"| {r['scene']} | {r['computed']} | {r['field_operations']} | {r['program_operations']} | "
        f"{r['trace_s']:.1f} | {r['compile_s']:.1f} | {r['run_ms'] / base:.2f} |"
        for r in rows
    ]
    return "\n".join(lines) + "\n"

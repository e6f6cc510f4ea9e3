"""`python -m benchmarks.scenes`: what each thing left out of a scene saves.

Operations of the traced program, trace and compile time, and the time of a run: one turn of the
quiet motion at 30 rad/s, 0.06 mm. Writes docs/scenes.md and docs/scenes.csv.
"""

import csv
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from rich.progress import track

import jaxcrusher as jc
from benchmarks.setting import setting

RUNS = 41
TIMES = np.linspace(0, 2 * np.pi / 30, 513)
# As many steps for every scene: times are then those of a step.
STEPS = 2048
BY_ANGLE, BY_TIME = (
    jc.Method(stepsize_controller=diffrax.ConstantStepSize(), dt0=float(span) / STEPS)
    for span in (2 * np.pi, TIMES[-1])
)


def operations(jaxpr) -> int:
    """Equations of a traced program, with those of its inner programs."""
    total = 0
    for equation in jaxpr.eqns:
        inner = [
            leaf
            for value in equation.params.values()
            for leaf in jax.tree.leaves(value, is_leaf=lambda x: hasattr(x, "jaxpr"))
        ]
        programs = [getattr(leaf, "jaxpr", leaf) for leaf in inner]
        programs = [program for program in programs if hasattr(program, "eqns")]
        total += sum(operations(program) for program in programs) if programs else 1
    return total


def traced(function, scene: jc.Scene):
    """The program of `function(scene)`, its numbers as arguments."""
    numbers, rest = eqx.partition(scene, eqx.is_array)
    return jax.jit(lambda numbers: jax.tree.leaves(function(eqx.combine(numbers, rest)))), numbers


def field_operations(scene: jc.Scene) -> int:
    """Operations of one evaluation of the equations of motion."""
    state = scene.formulation.initial(scene)

    def rate(scene):
        snapshot = scene.formulation.snapshot(jnp.array(0.1), state, scene)
        return scene.formulation.rate(snapshot, state, scene), snapshot.joint_force

    program, numbers = traced(rate, scene)
    return operations(jax.make_jaxpr(program)(numbers).jaxpr)


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
    ]


def main() -> None:
    """Measure every case; write the csv and the page."""
    rows, programs = [], []
    pairs = [(n, s, f) for n, s, functions in cases() for f in functions]
    for name, scene, function in track(pairs, "scenes"):
        what = (function.__doc__ or "").rstrip(".").lower()
        found, program = compiled(function, scene)
        rows.append(
            {"scene": name, "computed": what, "field_operations": field_operations(scene)} | found
        )
        programs.append(program)
    for row, milliseconds in zip(rows, median_times(programs), strict=True):
        row["run_ms"] = milliseconds
    docs = Path(__file__).parents[2] / "docs"
    with (docs / "scenes.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
    (docs / "scenes.md").write_text(_page(rows))
    print((docs / "scenes.md").read_text())


def _page(rows: list[dict]) -> str:
    base = next(r for r in rows if r["scene"] == "full" and "rms" in r["computed"])["run_ms"]
    lines = [
        "# What a scene leaves out",
        "",
        "Made by `python -m benchmarks.scenes`; not edited by hand. One turn of the quiet motion",
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


if __name__ == "__main__":
    jc.set_up()
    main()

"""The rows as csv, page and figure."""

from collections.abc import Callable

import numpy as np

from benchmarks.setting import setting
from benchmarks.work_precision.cases import Case, Reference
from benchmarks.work_precision.measure import Row
from jaxcrusher.files.provenance import command

PACKAGES = ("scipy", "numba", "exudyn", "scikit-sundae")
# Heading -> error, run time, and the level asked for.
GOALS: dict[str, tuple[Callable[[Row], float], Callable[[Row], float], float]] = {
    "RMS 1e-6": (lambda r: r.rms_error, lambda r: r.run_s, 1e-6),
    "RMS 1e-3": (lambda r: r.rms_error, lambda r: r.run_s, 1e-3),
    "history 1e-5": (lambda r: r.history_error, lambda r: r.run_s, 1e-5),
    "history 1e-2": (lambda r: r.history_error, lambda r: r.run_s, 1e-2),
    "slope 1e-3": (lambda r: r.slope_error, lambda r: r.slope_run_s, 1e-3),
}
# What the page shows, below its figures' own names.
FIGURES = """\
![Error of the RMS against run time, few programs](work_precision.png)

In every figure the black line is jaxcrusher as it comes, with Tsit5; to the left is faster, lower
is more exact. Where there is clearance, the other solvers, formulations, settings and programs
by the same error (without it the solvers are alike: see its table):

![Error of the RMS against run time, all other programs](work_precision_rest.png)

By the largest error of the force history (numba, CVODE Adams and EXUDYN: see the tables):

![Error of the history against run time, all other programs](work_precision_history.png)"""


def reaching(rows: list[Row], error: Callable, seconds: Callable, level: float) -> float:
    """Least seconds of a program's runs from which on every tighter one is within the level.

    So a single lucky error does not count. NaN if there is none. `rows` tighten.
    """
    best = np.nan
    for row in reversed([row for row in rows if not row.failure]):
        if not error(row) <= level:
            break
        best = np.fmin(best, seconds(row))
    return float(best)


def programs(rows: list[Row]) -> dict[str, list[Row]]:
    """Rows by program."""
    found: dict[str, list[Row]] = {}
    for row in rows:
        found.setdefault(row.program, []).append(row)
    return found


def ranked(rows: list[Row]) -> list[str]:
    """One scene's table: times in units of the fastest to reach the level."""
    by_program = programs(rows)
    times = {
        name: [reaching(mine, *goal) for goal in GOALS.values()]
        for name, mine in by_program.items()
    }
    columns = np.array(list(times.values()))
    fastest = [np.nanmin(column) if np.isfinite(column).any() else np.nan for column in columns.T]
    lines = [
        f"| program | {' | '.join(GOALS)} | least error of RMS | of history | of slope |",
        "|" + "---|" * (len(GOALS) + 4),
        "| fastest, ms | " + " | ".join(_number(1e3 * t) for t in fastest) + " | | | |",
    ]
    order = sorted(times, key=lambda name: [np.nan_to_num(t, nan=np.inf) for t in times[name]])
    for name in order:
        cells = [_number(t / f) for t, f in zip(times[name], fastest, strict=True)]
        for error in ("rms_error", "history_error", "slope_error"):
            found = [getattr(row, error) for row in by_program[name]]
            found = [value for value in found if np.isfinite(value)]
            cells.append(f"{min(found):.0e}" if found else "-")
        lines.append(f"| {name} | {' | '.join(cells)} |")
    return lines


def _number(value: float) -> str:
    return f"{value:.3g}" if np.isfinite(value) else "-"


def page(cases: list[Case], references: dict[str, Reference], rows: list[Row]) -> str:
    """All scenes' tables, references, compilation and failures."""
    lines = [
        "# Error against run time",
        "",
        f"Made by `{command()}`; not edited by hand. Every row:",
        "[work_precision.csv](work_precision.csv); `--table docs/work_precision.csv` draws the",
        "figures again from it.",
        "",
        f"{setting(*PACKAGES)}.",
        "",
        FIGURES,
        "",
        "One run gives the RMS of |R_O| + |R_C| over the span, its square integrated as one more",
        "state, and the force at 256 instants; EXUDYN's RMS is the trapezoidal sum over all of its",
        "steps. Times are medians of runs after the first, of single solves. The slope is by",
        "clearance at the same e/c and e' (by speed for the ideal joint), from a run of its own;",
        "no other program here has one. With multipliers it is measured for Tsit5 alone, and not",
        "at all for Kvaerno5, fixed steps and float32. SciPy, CVODE and numba share one right-hand",
        "side compiled by numba, with our smoothed corner; `events` is SciPy on the sharp laws in",
        "plain Python, stopped at every touch. EXUDYN's friction acts in the middle of the",
        "overlap, in the others on the bore: with friction its error includes that. EXUDYN's time",
        "includes building the model. float32 is asked for less, as its digits allow.",
        "",
        "Tables: time to reach an error, in units of the fastest. It is that of the cheapest",
        "setting from which on all tighter ones are within it too, `-` if there is none.",
    ]
    for case in cases:
        known = references[case.name]
        mine = [row for row in rows if row.scene == case.name]
        lines += [
            "",
            f"## {case.name.capitalize()}",
            "",
            f"{case.about.capitalize()}; {case.crusher.speed:g} rad/s"
            + ("" if case.ideal else f", {1e3 * case.crusher.clearance:g} mm, surface slip")
            + f". Reference: RMS {known.answer.rms:.9g} N (its own error",
            f"{known.rms_error:.0e}, of the history {known.history_error:.0e}), slope",
            f"{known.slope:.6g} N per {'rad/s' if case.ideal else 'm'} ({known.slope_error:.0e}),",
            "by the closed form." if case.ideal else "by DOP853 with events and CVODE at 1e-12.",
            "",
            *ranked(mine),
        ]
    lines += ["", *_compilation(rows), "", *_failures(rows)]
    return "\n".join(lines) + "\n"


def _compilation(rows: list[Row]) -> list[str]:
    """Trace and compile of each of our programs; first runs of the others."""
    lines = [
        "## Before the first run",
        "",
        "Trace and compile of our programs, once for all scenes with clearance; for the others the",
        "first run less the next, where numba may find its program in its cache.",
        "",
        "| program | scene | setting | value s | slope s |",
        "|---|---|---|---|---|",
    ]
    for row in rows:
        if np.isfinite([row.compile_s, row.slope_compile_s]).any():
            cells = f"{_number(row.compile_s)} | {_number(row.slope_compile_s)}"
        elif row.program == "numba Dopri5" and row.first_s > 2 * row.run_s:
            cells = f"{_number(row.first_s - row.run_s)} | -"
        else:
            continue
        lines.append(f"| {row.program} | {row.scene} | {row.setting} | {cells} |")
    return lines


def _failures(rows: list[Row]) -> list[str]:
    failed = [f"- {r.scene}, {r.program}, {r.setting}: {r.failure}" for r in rows if r.failure]
    return ["## Failed or left out", "", *(failed or ["None."])]

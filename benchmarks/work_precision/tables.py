"""The tables of the page work_precision.md."""

from collections.abc import Mapping, Sequence

import numpy as np

from benchmarks.pages import table
from benchmarks.work_precision.cases import Case, Reference
from benchmarks.work_precision.measure import Row

# Heading -> error, run time, and the level asked for.
GOALS = {
    "RMS 1e-6": ("rms_error", "run_s", 1e-6),
    "RMS 1e-3": ("rms_error", "run_s", 1e-3),
    "slope 1e-3": ("slope_error", "slope_run_s", 1e-3),
}
IDEAL = "ideal joint"


def tables(rows: Sequence[Row]) -> dict[str, str]:
    """Return a table of the scenes with clearance, and those of the ideal joint and the rest."""
    scenes = dict.fromkeys(row.scene for row in rows)
    failed = [(r.scene, r.program, r.setting, r.failure) for r in rows if r.failure]
    return {
        "clearance": ranked(rows, [scene for scene in scenes if scene != IDEAL]),
        IDEAL: ranked(rows, [scene for scene in scenes if scene == IDEAL]),
        "failures": table(("scene", "program", "setting", "why"), failed),
    }


def reaching(rows: Sequence[Row], error: str, seconds: str, level: float) -> float:
    """Return the least seconds from which on every tighter run is within the level, or NaN.

    So a single lucky error does not count. `rows` are of one program, and tighten.
    """
    best = np.nan
    for row in reversed([row for row in rows if not row.failure]):
        if not getattr(row, error) <= level:
            break
        best = np.fmin(best, getattr(row, seconds))
    return float(best)


def ranked(rows: Sequence[Row], scenes: Sequence[str]) -> str:
    """Return the table of these scenes: times in units of the fastest to reach the level."""
    by_program: dict[str, list[Row]] = {}
    for row in rows:
        if row.scene in scenes:
            by_program.setdefault(row.program, []).append(row)
    times = {
        name: [
            reaching([row for row in mine if row.scene == scene], *goal)
            for scene in scenes
            for goal in GOALS.values()
        ]
        for name, mine in by_program.items()
    }
    columns = np.array(list(times.values())).T
    fastest = [np.nanmin(column) if np.isfinite(column).any() else np.nan for column in columns]
    lines = [["fastest, ms", *(_number(1e3 * t) for t in fastest)]]
    for name in sorted(times, key=lambda name: [np.nan_to_num(t, nan=np.inf) for t in times[name]]):
        lines.append([name, *(_number(t / f) for t, f in zip(times[name], fastest, strict=True))])
    headings = [f"{scene}: {goal}" for scene in scenes for goal in GOALS]
    return table(("program", *headings), lines)


def references_table(cases: Sequence[Case], known: Mapping[str, Reference]) -> str:
    """Return the table of the references and their own errors."""
    lines = []
    for case in cases:
        of = known[case.name]
        errors = f"{of.rms_error:.0e}", f"{of.history_error:.0e}"
        per = "rad/s" if case.ideal else "m"
        slope = f"{of.slope:.6g} N per {per}", f"{of.slope_error:.0e}"
        lines.append([case.name, f"{of.answer.rms:.9g}", *errors, *slope])
    own = ("its own error", "of the history")
    return table(("scene", "RMS, N", *own, "slope of the RMS", "its own error"), lines)


def _number(value: float) -> str:
    return f"{value:.3g}" if np.isfinite(value) else "-"

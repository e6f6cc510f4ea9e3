"""The tables of the pages stability.md and stability_seats.md."""

from collections import Counter
from collections.abc import Sequence

import numpy as np

from benchmarks.pages import table
from benchmarks.stability.judgement import DISAGREES, OUTSIDE, VERDICTS, WHIRL, Judged


def tables(
    rows: Sequence[Judged], refused: Sequence[Judged] = (), by_start: bool = True
) -> dict[str, str]:
    """Return the counts of verdicts, the exceptions, and a row for each axis, or its starts."""
    motions, inputs = (Counter(row.verdict for row in judged) for judged in (rows, refused))
    counted = [[verdict, motions[verdict], inputs[verdict] or ""] for verdict in VERDICTS]
    apart = [row for row in (*rows, *refused) if row.agreement not in ("yes", "")]
    exceptions = [
        (r.axis, r.value, r.start, r.formulation, _marked(r), r.agreement, r.remark) for r in apart
    ]
    labels = ("axis", "case", "start", "formulation", "verdict", "agrees", "remark")
    found = {
        "verdicts": table(["verdict", "motions", "inputs without a motion"], counted),
        "exceptions": table(labels, exceptions),
        "axes": _axes(rows, by_start),
    }
    if refused:
        found["inputs"] = _inputs(refused)
    return found


def _marked(row: Judged) -> str:
    return f"**{row.verdict}**" if row.verdict == DISAGREES else row.verdict


def _axes(rows: Sequence[Judged], by_start: bool) -> str:
    """A row for each axis, or each start of it: what was judged how, and the worst of it."""
    groups: dict[tuple[str, ...], list[Judged]] = {}
    for row in rows:
        start = "its own" if row.start == row.value else row.start
        groups.setdefault((row.axis, start) if by_start else (row.axis,), []).append(row)
    headings = [
        *(("axis", "start") if by_start else ("axis",)),
        *("cases", "agrees", "whirl at", "outside the model at"),
        *("error / allowed", "RMS: error / allowed", "steps a turn"),
    ]
    return table(headings, [[*labels, *_summary(group)] for labels, group in groups.items()])


def _summary(rows: Sequence[Judged]) -> list[str]:
    values = list(dict.fromkeys(row.value for row in rows))
    ends = values if len(values) < 3 else [values[0], "...", values[-1]]
    agrees = sum(row.agreement == "yes" for row in rows)
    at = [
        "; ".join(dict.fromkeys(row.value for row in rows if row.verdict == verdict))
        for verdict in (WHIRL, OUTSIDE)
    ]
    errors = [row.error / row.allowed for row in rows]
    rms = [row.rms_error / row.rms_allowed for row in rows]
    worst = [f"{np.nanmax(ratios):.2g}" for ratios in (errors, rms)]
    steps = [row.steps_a_turn for row in rows]
    taken = f"{np.nanmin(steps):.0f} to {np.nanmax(steps):.0f}"
    return ["; ".join(ends), f"{agrees} of {len(rows)}", *at, *worst, taken]


def _inputs(refused: Sequence[Judged]) -> str:
    """A row for each input and verdict, with the values that get it."""
    groups: dict[tuple[str, str], list[str]] = {}
    for row in refused:
        groups.setdefault((row.axis, _marked(row)), []).append(row.value)
    cells = [(axis, "; ".join(values), verdict) for (axis, verdict), values in groups.items()]
    return table(["input", "values", "verdict"], cells)

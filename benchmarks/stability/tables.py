"""The tables of the pages stability.md and stability_seats.md."""

import math
from collections import Counter
from collections.abc import Sequence

import numpy as np

from benchmarks.pages import table
from benchmarks.stability.baumgarte import TOLERANCES, Stabilised
from benchmarks.stability.drift import Drift
from benchmarks.stability.judgement import DISAGREES, OUTSIDE, VERDICTS, WHIRL, Judged

# Of 1/s; a greater alpha or beta is 1/h, h the mean step.
GREATEST = 100.0


def tables(rows: Sequence[Judged], refused: Sequence[Judged] = ()) -> dict[str, str]:
    """Return the counts of verdicts, the exceptions, and a row for each axis and start."""
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
        "axes": _axes(rows),
    }
    if refused:
        found["inputs"] = _inputs(refused)
    return found


def _marked(row: Judged) -> str:
    return f"**{row.verdict}**" if row.verdict == DISAGREES else row.verdict


def _axes(rows: Sequence[Judged]) -> str:
    """A row for each axis and start: what was judged how, and the worst of it."""
    groups: dict[tuple[str, str], list[Judged]] = {}
    for row in rows:
        start = "its own" if row.start == row.value else row.start
        groups.setdefault((row.axis, start), []).append(row)
    headings = [
        *("axis", "start", "cases", "agrees", "whirl at", "outside the model at"),
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
    """A row for each input and message, with the values that get it."""
    groups: dict[tuple[str, str, str], list[str]] = {}
    for row in refused:
        # Without the value and the instant, which differ.
        message = row.remark.split(", but is")[0].split("of phase: ")[-1]
        groups.setdefault((row.axis, _marked(row), message), []).append(row.value)
    cells = [(axis, "; ".join(v), verdict, text) for (axis, verdict, text), v in groups.items()]
    return table(["input", "values", "verdict", "message"], cells)


def drift_table(rows: Sequence[Drift]) -> str:
    """Return the table of a thousand turns."""
    cells = []
    for r in rows:
        energy = [f"{value / r.turned_over:.1e}" for value in r.imbalance]
        kept = ["none"] if r.residual is None else [f"{value:.1e}" for value in r.residual]
        theirs = [
            f"{mean:.6g} ± {scatter:.2g}"
            for mean, scatter in zip(r.reference_rms, r.reference_scatter, strict=True)
        ]
        pairs = (energy, kept, [f"{value:.6g}" for value in r.rms], theirs)
        ended = r.failure or ("whirl" if r.whirl else "yes")
        cells.append([r.start, r.formulation, ended, *map(" to ".join, pairs)])
    return table(
        ["start", "formulation", "ended", "energy", "constraints", "RMS, N", "numba's"], cells
    )


def baumgarte_tables(rows: Sequence[Stabilised]) -> dict[str, str]:
    """Return a table for each tolerance; a row has the least and the greatest of its pairs."""
    headings = (
        *("alpha, 1/s", "beta, 1/s", "runs", "violation", "error"),
        *("steps a turn", "CPU s", "failures"),
    )
    found = {}
    for rtol in TOLERANCES:
        groups: dict[tuple[str, str], list[Stabilised]] = {}
        for row in rows:
            if row.rtol == rtol:
                groups.setdefault((_rate(row.alpha), _rate(row.beta)), []).append(row)
        cells = [[*pair, *_of_pairs(group)] for pair, group in groups.items()]
        found[f"Baumgarte {rtol:g}"] = table(headings, cells)
    return found


def _rate(rate: float) -> str:
    if math.isnan(rate):
        return "eccentricities"
    return f"0 to {GREATEST:g}" if rate <= GREATEST else f"1/h = {rate:.4g}"


def _of_pairs(rows: Sequence[Stabilised]) -> list[str]:
    free = math.isnan(rows[0].alpha)
    failures = sum(bool(row.failure) for row in rows)
    return [
        str(len(rows)),
        "none" if free else _between([row.residual for row in rows], ".1e"),
        _between([row.force_error for row in rows], ".1e"),
        _between([row.steps_a_turn for row in rows], ".0f"),
        _between([row.seconds for row in rows], ".2f"),
        str(failures or "none"),
    ]


def _between(values: Sequence[float], style: str) -> str:
    """Return the least and the greatest, as one number where both look alike."""
    return " to ".join(dict.fromkeys(format(f(values), style) for f in (min, max)))

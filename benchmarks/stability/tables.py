"""The tables of the pages stability.md and stability_seats.md."""

import math
from collections import Counter
from collections.abc import Sequence

from benchmarks.pages import table
from benchmarks.stability.baumgarte import TOLERANCES, Stabilised
from benchmarks.stability.drift import Drift
from benchmarks.stability.judgement import DISAGREES, VERDICTS, Judged

NUMBERS = ("error / allowed", "over ms", "RMS, N", "its error / allowed", "steps a turn")
COLUMNS = ("case", "start", "formulation", "verdict", "agrees", *NUMBERS, "remark")


def tables(rows: Sequence[Judged], refused: Sequence[Judged] = ()) -> dict[str, str]:
    """Return the counts of verdicts, the exceptions, and a table for each axis."""
    motions, inputs = (Counter(row.verdict for row in judged) for judged in (rows, refused))
    counted = [[verdict, motions[verdict], inputs[verdict] or ""] for verdict in VERDICTS]
    apart = [row for row in (*rows, *refused) if row.agreement not in ("yes", "")]
    exceptions = [
        (r.axis, r.value, r.start, r.formulation, r.verdict, r.agreement, r.remark) for r in apart
    ]
    found = {
        "verdicts": table(["verdict", "motions", "inputs without a motion"], counted),
        "exceptions": table(["axis", *COLUMNS[:5], "remark"], exceptions),
    }
    for axis in dict.fromkeys(row.axis for row in rows):
        found[axis] = table(COLUMNS, [_cells(row) for row in rows if row.axis == axis])
    if refused:
        cells = [(r.axis, r.value, _marked(r), r.remark) for r in refused]
        found["inputs"] = table(["input", "value", "verdict", "message"], cells)
    return found


def _marked(row: Judged) -> str:
    return f"**{row.verdict}**" if row.verdict == DISAGREES else row.verdict


def _cells(r: Judged) -> list[str]:
    numbers = [
        f"{r.error:.1e} / {r.allowed:.1e}",
        f"{r.span_ms:.1f}",
        f"{r.rms:.6g}",
        f"{r.rms_error:.1e} / {r.rms_allowed:.1e}",
        f"{r.steps_a_turn:.0f}",
    ]
    known = ["" if "nan" in number else number for number in numbers]
    return [r.value, r.start, r.formulation, _marked(r), r.agreement, *known, r.remark]


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
    """Return a table of alpha and beta for each tolerance."""
    headings = ("alpha, 1/s", "beta, 1/s", "violation", "error", "steps a turn", "CPU s", "ended")
    return {
        f"Baumgarte {rtol:g}": table(headings, [_of_pair(r) for r in rows if r.rtol == rtol])
        for rtol in TOLERANCES
    }


def _of_pair(r: Stabilised) -> list[str]:
    free = math.isnan(r.alpha)
    pair = ["eccentricities", ""] if free else [f"{r.alpha:.4g}", f"{r.beta:.4g}"]
    kept = "none" if free else f"{r.residual:.1e}"
    numbers = [f"{r.force_error:.1e}", f"{r.steps_a_turn:.0f}", f"{r.seconds:.2f}"]
    return [*pair, kept, *numbers, r.failure or "yes"]

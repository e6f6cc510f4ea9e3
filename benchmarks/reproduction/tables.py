"""The tables of the page claims.md."""

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from benchmarks.pages import table
from benchmarks.reproduction.claims import Claim, Evidence
from benchmarks.reproduction.readings import COMBINATIONS, DECIDED, POINTS, SINGLE_CHANGES, Reading
from benchmarks.reproduction.verdict import (
    INCONSISTENT,
    NOT_REPRODUCED,
    REPRODUCED,
    UNCHECKED,
    Estimate,
    verdict,
)

KINDS = (REPRODUCED, NOT_REPRODUCED, INCONSISTENT, UNCHECKED)


def tables(listed: Sequence[Claim], evidence: Evidence) -> dict[str, str]:
    """Return all tables of the page."""
    return {
        "counts": counts_table(listed, evidence),
        "claims": verdict_table(listed, evidence),
        "readings": reading_table(reading_rows(listed, evidence)),
        "combinations": ranking(listed, evidence),
    }


def plain(value: float) -> str:
    """Format a number with three digits, or four below ten thousand."""
    digits = 4 if abs(value) < 1e4 else 3
    return f"{value:.{digits}g}".replace("e+0", "e").replace("e+", "e")


def spread(found: Estimate | None) -> str:
    """Format a value, with its range where that differs."""
    if found is None:
        return "-"
    value, low, high = map(plain, found)
    return value if low == high else f"{value} ({low} to {high})"


def judged(claim: Claim, evidence: Evidence, reading: Reading) -> tuple[Estimate | None, str]:
    """Return a claim's number under a reading, and the verdict."""
    found = claim.by.compute(evidence, reading)
    return found, verdict(claim.number, found, claim.by.implied)


def paper_value(claim: Claim) -> str:
    """Format the printed number with its unit."""
    digits = f"{claim.number.value:.5g}".replace("e+0", "e")
    return digits if claim.unit == "1" else f"{digits} {claim.unit}"


def verdict_table(listed: Sequence[Claim], evidence: Evidence) -> str:
    """Return the table of every claim under the decided reading."""
    rows = []
    for claim in listed:
        found, word = judged(claim, evidence, DECIDED)
        rows.append([claim.where, claim.text, paper_value(claim), spread(found), word])
    return table(["section", "claim", "paper", "computed (range)", "verdict"], rows)


def counts_table(listed: Sequence[Claim], evidence: Evidence) -> str:
    """Return the table of the number of claims of each verdict."""
    words = Counter(judged(claim, evidence, DECIDED)[1] for claim in listed)
    return table(["verdict", "claims"], [[kind, words[kind]] for kind in KINDS])


def reading_rows(listed: Sequence[Claim], evidence: Evidence) -> list[dict[str, Any]]:
    """Return the numbers of each claim that a reading can change, under each single change."""
    rows = []
    for claim in (c for c in listed if c.by.by_reading):
        for name, reading in SINGLE_CHANGES.items():
            found, word = judged(claim, evidence, reading)
            value, low, high = found or (math.nan,) * 3
            row = {"claim": claim.text, "paper": paper_value(claim), "reading": name}
            row |= {"value": value, "low": low, "high": high, "met": word == REPRODUCED}
            rows.append(row)
    return rows


def reading_table(rows: Sequence[Mapping[str, Any]]) -> str:
    """Return the table of how many claims each reading meets, of the rows of `reading_rows`."""
    met = dict.fromkeys((row["reading"] for row in rows), 0)
    for row in rows:
        met[row["reading"]] += bool(row["met"])
    claims = len({row["claim"] for row in rows})
    cells = [[name, f"{count} of {claims}"] for name, count in met.items()]
    return table(["reading", "claims met"], cells)


def ranking(listed: Sequence[Claim], evidence: Evidence) -> str:
    """Return the table of all combinations of readings, by the number of claims they meet."""
    able, rows = [claim for claim in listed if claim.by.by_reading], []
    for reading in COMBINATIONS:
        met = sum(judged(claim, evidence, reading)[1] == REPRODUCED for claim in able)
        runs = [evidence.measurements[reading, point]["hertzian"] for point in POINTS]
        outside, of = sum(int((~run).sum()) for run in runs), sum(run.size for run in runs)
        velocity = "tracked" if reading.impact_law == "tracked" else "0.5"
        name = "|R_O|+|R_C|" if reading.force == "sum" else "|R_O+R_C|"
        cells = [reading.slip, velocity, reading.start, name]
        rows.append((met, [*cells, f"{met} of {len(able)}", f"{outside} of {of}"]))
    rows.sort(key=lambda row: -row[0])
    headings = ["slip", "impact velocity", "start", "force", "claims met", "runs not Hertzian"]
    return table(headings, [cells for _, cells in rows])

"""The tables of the page claims.md."""

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from benchmarks.pages import table
from benchmarks.reproduction.claims import Claim, Evidence
from benchmarks.reproduction.readings import COMBINATIONS, DECIDED, POINTS, SINGLE_CHANGES, Reading
from benchmarks.reproduction.search import TARGETS, Found
from benchmarks.reproduction.verdict import (
    INCONSISTENT,
    NOT_REPRODUCED,
    REPRODUCED,
    UNCHECKED,
    Estimate,
    verdict,
)

SMALL, LARGE = (0.03, 0.06), (0.09, 0.12)  # mm
KINDS = (REPRODUCED, NOT_REPRODUCED, INCONSISTENT, UNCHECKED)


def tables(listed: Sequence[Claim], evidence: Evidence, found: Sequence[Found]) -> dict[str, str]:
    """Return all tables of the page."""
    return {
        "counts": counts_table(listed, evidence),
        "claims": verdict_table(listed, evidence),
        "readings": reading_table(reading_rows(listed, evidence)),
        "combinations": ranking(listed, evidence),
        "nearest": nearest_table(found),
        "whirls": whirl_table(found),
        "variants": search_table(search_rows(found)),
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
    """Return the table of the claims that each reading meets, of the rows of `reading_rows`."""
    met: dict[str, list[str]] = {}
    for row in rows:
        met.setdefault(row["reading"], []).extend([row["claim"]] if row["met"] else [])
    claims = len({row["claim"] for row in rows})
    cells = [[name, f"{len(of)} of {claims}", "; ".join(of)] for name, of in met.items()]
    return table(["reading", "claims met", "which"], cells)


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


def search_rows(found: Sequence[Found]) -> list[dict[str, Any]]:
    """Return each variant's peaks; NaN where all of its runs ran away, after `turns`."""
    return [
        {
            "variant": one.variant.name,
            "clearance_mm": c,
            "paper_N": TARGETS[c],
            "peak_N": one.value(c),
            "runs": one.statistics[c]["foundation_peak"].size,
            "whirls": one.whirling(c),
            "turns": one.value(c, "turns"),
        }
        for one in found
        for c in TARGETS
    ]


def search_table(rows: Sequence[Mapping[str, Any]]) -> str:
    """Return the table of how the variants end, of the rows of `search_rows`."""
    variants: dict[str, list[Mapping[str, Any]]] = {}
    for row in rows:
        variants.setdefault(row["variant"], []).append(row)
    ends: dict[str, list[list[Mapping[str, Any]]]] = {
        end: [] for end in ("every run whirls", "some runs whirl", "no run whirls", "runs away")
    }
    for of in variants.values():
        if any(math.isnan(row["peak_N"]) for row in of):
            end = "runs away"
        elif all(row["whirls"] == row["runs"] for row in of):
            end = "every run whirls"
        else:
            end = "some runs whirl" if any(row["whirls"] for row in of) else "no run whirls"
        ends[end].append(of)
    cells = []
    for end, group in ends.items():
        peaks = [
            _between([row["peak_N"] for of in group for row in of if row["clearance_mm"] == c])
            for c in TARGETS
        ]
        cells.append([end, len(group), *peaks])
    headings = [f"{c:g} mm (paper {plain(TARGETS[c])})" for c in TARGETS]
    return table(["end", "variants", *headings], cells)


def _between(values: Sequence[float]) -> str:
    known = [value for value in values if math.isfinite(value)]
    return " to ".join(dict.fromkeys(plain(f(known)) for f in (min, max))) if known else "-"


def nearest_table(found: Sequence[Found]) -> str:
    """Return the table of the variants nearest to the paper's peaks."""
    rows = []
    wanted = {"the two large": LARGE, "the two small": SMALL, "all four": tuple(TARGETS)}
    for name, at in wanted.items():
        best = min(found, key=lambda one, at=at: one.distance(at))
        peaks = (plain(best.value(c)) for c in TARGETS)
        rows.append([name, best.variant.name, f"{math.exp(best.distance(at)):.2f}", *peaks])
    return table(["peaks", "variant", "off by a factor", *(f"{c:g} mm" for c in TARGETS)], rows)


def whirl_table(found: Sequence[Found]) -> str:
    """Return the table of ratios over the variants whose every run at large clearances whirls."""
    whirls = [
        one
        for one in found
        if all(one.whirling(c) == one.statistics[c]["winding"].size for c in LARGE)
    ]
    mean = [one.value(0.12) / one.value(0.12, "foundation_mean") for one in whirls]
    growth = [one.value(0.12) / one.value(0.09) for one in whirls]
    rows = [
        [name, f"{paper:.2f}", f"{min(ours):.2f} to {max(ours):.2f}" if ours else "-", len(whirls)]
        for name, paper, ours in (
            ("peak over mean, 0.12 mm", 1.7e6 / 8e5, mean),
            ("peak at 0.12 over peak at 0.09 mm", 1.7 / 1.1, growth),
        )
    ]
    return table(["ratio", "paper", "whirling variants", "their number"], rows)

"""docs/reproduction/claims.md: the tables, and sentences that follow from them."""

import math
from pathlib import Path

from benchmarks.reproduction.claims import Claim, Evidence
from benchmarks.reproduction.readings import (
    COMBINATIONS,
    DECIDED,
    OFFSETS,
    POINTS,
    SETTLE_TURNS,
    SINGLE_CHANGES,
    WINDOW_TURNS,
    Reading,
)
from benchmarks.reproduction.readings import TURNS as TURNS_MEASURED
from benchmarks.reproduction.search import OFFSETS as SEARCH_OFFSETS
from benchmarks.reproduction.search import SETTLE, TARGETS, TURNS, Found
from benchmarks.reproduction.verdict import (
    INCONSISTENT,
    NOT_REPRODUCED,
    REPRODUCED,
    RULE,
    UNCHECKED,
    Estimate,
    verdict,
)
from jaxcrusher.files.provenance import command
from jaxcrusher.files.results import write_text

SMALL, LARGE = (0.03, 0.06), (0.09, 0.12)  # mm


def plain(value: float) -> str:
    """Three digits, four below ten thousand."""
    digits = 4 if abs(value) < 1e4 else 3
    return f"{value:.{digits}g}".replace("e+0", "e").replace("e+", "e")


def spread(found: Estimate | None) -> str:
    """The value, with its range where that differs."""
    if found is None:
        return "-"
    value, low, high = map(plain, found)
    return value if low == high else f"{value} ({low} to {high})"


def table(headings: list[str], rows: list[list[str]]) -> str:
    """A Markdown table."""
    lines = [headings, ["---"] * len(headings), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def judged(claim: Claim, evidence: Evidence, reading: Reading) -> tuple[Estimate | None, str]:
    """What a reading gives for a claim, and the verdict."""
    found = claim.compute(evidence, reading)
    return found, verdict(claim.number, found, claim.implied)


def paper_value(claim: Claim) -> str:
    """As printed, with its unit."""
    digits = f"{claim.number.value:.5g}".replace("e+0", "e")
    return digits if claim.unit == "1" else f"{digits} {claim.unit}"


def verdict_table(listed: list[Claim], evidence: Evidence) -> str:
    """Every claim under the decided reading."""
    rows = []
    for claim in listed:
        found, word = judged(claim, evidence, DECIDED)
        rows.append([claim.where, claim.text, paper_value(claim), spread(found), word])
    return table(["section", "claim", "paper", "computed (range)", "verdict"], rows)


def counts(listed: list[Claim], evidence: Evidence) -> str:
    """How many of each verdict."""
    words = [judged(claim, evidence, DECIDED)[1] for claim in listed]
    kinds = (REPRODUCED, NOT_REPRODUCED, INCONSISTENT, UNCHECKED)
    return ", ".join(f"{words.count(kind)} {kind}" for kind in kinds)


def reading_table(listed: list[Claim], evidence: Evidence) -> str:
    """Claims that a reading can change, under each single change."""
    rows = []
    for claim in (c for c in listed if c.by_reading):
        cells = []
        for reading in SINGLE_CHANGES.values():
            found, word = judged(claim, evidence, reading)
            cells.append(f"**{spread(found)}**" if word == REPRODUCED else spread(found))
        rows.append([claim.text, paper_value(claim), *cells])
    return table(["claim", "paper", *SINGLE_CHANGES], rows)


def ranking(listed: list[Claim], evidence: Evidence) -> str:
    """All combinations of readings, by the number of claims they meet."""
    able = [claim for claim in listed if claim.by_reading]
    rows = []
    for reading in COMBINATIONS:
        met = sum(judged(claim, evidence, reading)[1] == REPRODUCED for claim in able)
        runs = [evidence.measurements[reading, point]["hertzian"] for point in POINTS]
        outside = sum(int((~run).sum()) for run in runs)
        of = sum(run.size for run in runs)
        velocity = "tracked" if reading.impact_law == "tracked" else "0.5"
        cells = [reading.slip, velocity, reading.start]
        name = "\\|R_O\\|+\\|R_C\\|" if reading.force == "sum" else "\\|R_O+R_C\\|"
        rows.append((met, [*cells, name, f"{met} of {len(able)}", f"{outside} of {of}"]))
    rows.sort(key=lambda row: -row[0])
    headings = ["slip", "impact velocity", "start", "force", "claims met", "runs not Hertzian"]
    return table(headings, [cells for _, cells in rows])


def search_table(found: list[Found]) -> str:
    """The peaks of every variant, nearest first; the count of whirls in brackets."""
    rows = []
    for one in found:
        cells = []
        for c in TARGETS:
            runs, whirls = one.statistics[c]["foundation_peak"].size, one.whirling(c)
            text = plain(one.value(c)) + (f" [{whirls} of {runs}]" if whirls else "")
            gone = f"runs away, turn {one.value(c, 'turns'):.2g}"
            cells.append(text if math.isfinite(one.value(c)) else gone)
        distances = (one.distance(LARGE), one.distance(tuple(TARGETS)))
        factors = [f"{math.exp(d):.3g}" if d < math.inf else "-" for d in distances]
        rows.append([one.variant.name, *cells, *factors])
    headings = ["variant", *(f"{c:g} mm (paper {plain(TARGETS[c])})" for c in TARGETS)]
    return table([*headings, "off by a factor, 0.09 and 0.12", "off, all four"], rows)


def answer(found: list[Found]) -> str:
    """The search's result in sentences; every number is looked up."""
    hits = [one.variant.name for one in found if one.distance(LARGE) <= math.log(1.05)]
    lines = [
        f"{len(hits) or 'None'} of {len(found)} variants met both large peaks within a factor of "
        f"1.05{': ' if hits else ''}{'; '.join(hits)}."
    ]
    for title, clearances in (
        ("the two large peaks", LARGE),
        ("the two small peaks", SMALL),
        ("all four", tuple(TARGETS)),
    ):
        best = min(found, key=lambda one, wanted=clearances: one.distance(wanted))
        peaks = ", ".join(f"{plain(best.value(c))} N at {c:g} mm" for c in TARGETS)
        lines.append(
            f"- Nearest to {title}: **{best.variant.name}**, off by a factor of "
            f"{math.exp(best.distance(clearances)):.2f} there. It gives {peaks}."
        )
    whirls = [
        one
        for one in found
        if all(one.whirling(c) == one.statistics[c]["winding"].size for c in LARGE)
    ]
    if whirls:
        over_mean = [one.value(0.12) / one.value(0.12, "foundation_mean") for one in whirls]
        growth = [one.value(0.12) / one.value(0.09) for one in whirls]
        lines.append(
            f"- In the {len(whirls)} variants whose every run at 0.09 and 0.12 mm is a whirl, "
            f"peak over mean at 0.12 mm is {min(over_mean):.2f} to {max(over_mean):.2f}; the "
            f"paper's, of 1.7e6 and 8e5 N, is {1.7e6 / 8e5:.2f}. The peak grows from 0.09 to "
            f"0.12 mm by a factor of {min(growth):.2f} to {max(growth):.2f}; the paper's by "
            f"{1.7 / 1.1:.2f}."
        )
    return "\n".join(lines)


NOTES = f"""Wang, Cui, Wang, *Appl. Sci.* 2023, 13, 238. This page and the figures beside it are
made by `{{command}}`; nothing in the tables is typed in.

{RULE}

The paper's Figure 5 shows two turns after 12 s, its 57th turn at 30 rad/s; so motions settle for
{SETTLE_TURNS} turns, and a peak is that of a window of {WINDOW_TURNS} turns. A value is the median
over runs and windows, its range the least and the largest: {len(OFFSETS)} centred starts,
{OFFSETS[1]:g} clearances apart, of {TURNS_MEASURED} turns each (their motions part within the first
turn), or one start in contact. Means and RMS are over whole runs. Two runs of
the same program give the same page; another compiler or processor moves the impacting motions
inside their ranges.

The decided reading: slip of the centres, impact velocity 0.5 m/s, centred start, load along the
jaw, force |R_O| + |R_C|."""

READING_NOTES = """Each column changes one thing of the decided reading. Values that meet the claim
by the rule are **bold**. "settled 5 turns" is the decided reading seen earlier, while the start's
impacts still ring."""

RANKING_NOTES = """All combinations of slip, impact velocity, start and force, by the claims of the
second table that they meet. Among so many combinations some meet a number by chance. A run is not
Hertzian, and outside the contact model, where the contact's half-width exceeds half the bore's
radius."""

SEARCH_NOTES = f"""At 30 rad/s and 0.09 and 0.12 mm the paper has peaks of 1.1e6 and 1.7e6 N. Which
reading, error or solver leads there? Each variant changes what its name says in the decided
reading, with either slip. Peaks are those of {TURNS} turns after {SETTLE}. Each
variant has {len(SEARCH_OFFSETS)} centred starts, {SEARCH_OFFSETS[1]:g} clearances apart; they may
end on different attractors, and the one nearer to the paper's peak is shown: which
variant comes nearest is a matter of chance, and changes with the build. In brackets, how many
whirl: the pin rolls round the bore more than ten times a turn. "(19) as printed" has x reversed,
phi from (3) in [0, pi] and no moments, so that forces act at the mass centres. "ode45 at its
default tolerances" is Dormand and Prince's pair on the nine coordinates with tolerances of 1e-3,
relative, and 1e-6, absolute. "stiffness with c in mm" is a slip of units in (9), radii in m. It and
the other changes of the stiffness have no ground in the paper's text."""


def write_claims(path: Path, listed: list[Claim], evidence: Evidence, found: list[Found]) -> None:
    """The whole page."""
    parts = [
        "# The paper's numbers, and ours",
        NOTES.format(command=command()),
        "## Claims",
        f"Of {len(listed)} claims: {counts(listed, evidence)}.",
        verdict_table(listed, evidence),
        "## The same under other readings",
        READING_NOTES,
        reading_table(listed, evidence),
        RANKING_NOTES,
        ranking(listed, evidence),
        "## Where do 1.1e6 and 1.7e6 N come from?",
        SEARCH_NOTES,
        answer(found),
        search_table(found),
        "## Figures",
        FIGURES,
    ]
    write_text(path, "\n\n".join(parts) + "\n")


FIGURES = """Rows of Figures 8 to 13 and 16: slip of the centres (decided) above, of the surfaces
below; centred start, from turn 57. Poincaré maps show 200 turns.

- `fig05.png`: 30 rad/s, 0.06 mm, surface slip. EXUDYN takes the place of Adams in (c) and (d);
  its sensors here give no motion of B. (a) to (c): first turn of a start in contact,
  where motions can be compared pointwise; (d): first 30 ms of the centred start. The paper's window
  after 12 s cannot be compared curve by curve: impacting motions part like exp(200 t).
- `fig07a.png`, `fig07b.png`: displacement of B at two clearances; capacity over speed.
- `fig08.png` to `fig10.png`: orbit, foundation force, Poincaré map at 0.06 mm over the speed.
- `fig11.png` to `fig13.png`: the same at 30 rad/s over the clearance.
- `fig14.png`, `fig15.png`: RMS and peak over the box, decided reading. Left the centred start's, a
  cell a run: neighbours differ by chance, and contours through them would show it. Right those of
  the settled motion, which carry contours; lines in kN, grey where it is unstable or not solved.
- `fig16.png`: the paper's choice, 39 rad/s and 0.03 mm."""

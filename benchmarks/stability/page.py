"""The page and the csv of the stability run."""

from collections import Counter
from collections.abc import Iterable

from benchmarks.setting import setting
from benchmarks.stability import baumgarte, drift
from benchmarks.stability.baumgarte import Stabilised
from benchmarks.stability.cases import AXES, BASE
from benchmarks.stability.drift import Drift
from benchmarks.stability.judgement import DISAGREES, PREDICTABLE, PROMISED, VERDICTS, Judged
from benchmarks.stability.reference import FEW, MANY, OFFSET, OURS, SETTLE, SPAN, TURNS
from jaxcrusher.files.provenance import command

INTRODUCTION = """\
# Stiff and extreme cases

Made by `{command}` in {minutes:.0f} minutes; not edited by hand. {machine}.

![Verdicts by axis, start and formulation](stability.png)

A cell is a motion, its number the steps of a turn in thousands; the errors are in the tables.

{summary}

Base case: {speed:g} rad/s, {clearance:g} mm, friction {friction:g} with the slip of the surfaces;
one number is changed at a time (csv: [stability.csv](stability.csv)). Centred: e = e' = 0. In
contact: resting in the bore. Violent: from e = 0 at 5 m/s. All are of the main bearing A; the seats
B and C have [a page of their own](stability_seats.md).

Every motion is compared twice, at the default tolerances. First instant by instant over
{span:g} ms, force on the foundation and eccentricity, with SUNDIALS' CVODE on the published laws
without smoothing (`benchmarks/peers/`, written without jaxcrusher). Allowed: {promised:g} of the
largest value, or the errors of the programs at a contact, times the contacts so far, grown as
CVODE's own motions part from starts 1e-10 m apart; where these exceed {predictable:g} nothing is
compared. Then the RMS over turns {first} to {last} with a program written by hand for numba, from
{few} starts 1e-5 clearances apart, {many} (and up to {ours} of ours) where they scatter. Allowed:
Student's quantile of that scatter which one number in 10 000 exceeds by chance, and 1e-9 a step.

Verdicts: *agrees* with both. *whirl*: named by `Statistics.whirl`. *outside the model*: flagged by
`Statistics.validity`. *refused*: a ValueError, or `success` False with a `failure`. *DISAGREES*: a
number that nothing warns of and that is not the reference's. Whirls and motions outside the model
are compared too: column "agrees"; "but for smoothing" where a hundredth of the widths agrees.
"""
COLUMNS = (
    "case",
    "start",
    "formulation",
    "verdict",
    "agrees",
    "error / allowed",
    "over ms",
    "RMS, N",
    "its error / allowed",
    "steps a turn",
    "remark",
)


def page(
    rows: list[Judged],
    refused: list[Judged],
    long: list[Drift],
    stabilised: list[Stabilised],
    minutes: float,
) -> str:
    """The page in Markdown."""
    lines = [
        introduction(
            INTRODUCTION,
            minutes,
            summary(rows, refused),
            speed=BASE.speed,
            clearance=1e3 * BASE.clearance,
            friction=BASE.friction,
        )
    ]
    for name in (*AXES, "start"):
        unit = "" if name == "start" else f", {AXES[name].unit}".removesuffix(", 1")
        lines += [f"## By {name}{unit}", "", *table_of(r for r in rows if r.axis == name), ""]
    lines += [
        "## Inputs without a motion",
        "",
        "| input | value | verdict | in words |",
        "|---|---|---|---|",
    ]
    lines += [f"| {r.axis} | {r.value} | {_marked(r)} | {r.remark} |" for r in refused]
    return "\n".join([*lines, "", *_drift(long), "", *_baumgarte(stabilised), ""])


def introduction(text: str, minutes: float, counts: str, **base: object) -> str:
    """A page's beginning: how it was made and judged, and numbers of its base case."""
    return text.format(
        command=command(),
        minutes=minutes,
        machine=setting("scikit-sundae", "numba"),
        summary=counts,
        span=1e3 * SPAN,
        promised=PROMISED,
        offset=OFFSET,
        predictable=PREDICTABLE,
        first=SETTLE + 1,
        last=SETTLE + TURNS,
        few=FEW,
        many=MANY,
        ours=OURS,
        **base,
    )


def summary(rows: list[Judged], refused: list[Judged]) -> str:
    """Counts of the verdicts, and what does not agree."""
    counts = Counter(row.verdict for row in rows)
    parts = ", ".join(f"{counts[verdict]} {verdict}" for verdict in VERDICTS)
    bad = Counter(row.verdict for row in refused)
    lines = [f"{len(rows)} motions: {parts}."]
    if refused:
        lines[0] += (
            f" {len(refused)} inputs without a motion: {bad['refused']} refused, "
            f"{bad[DISAGREES]} not."
        )
    for row in (*rows, *refused):
        if row.agreement not in ("yes", ""):
            start = "" if row.start == row.value else row.start
            case = ", ".join(filter(None, (f"{row.axis} {row.value}", start, row.formulation)))
            agreement = "does not agree" if row.agreement == "no" else f"agrees {row.agreement}"
            lines.append(f"- {case}: {row.verdict}, {agreement}. {row.remark}".rstrip())
    return "\n".join(lines)


def _marked(row: Judged) -> str:
    return f"**{row.verdict}**" if row.verdict == DISAGREES else row.verdict


def table_of(rows: Iterable[Judged]) -> list[str]:
    """Lines of a table, a row each."""
    lines = [f"| {' | '.join(COLUMNS)} |", "|" + "---|" * len(COLUMNS)]
    for r in rows:
        cells = (
            r.value,
            r.start,
            r.formulation,
            _marked(r),
            r.agreement,
            f"{r.error:.1e} / {r.allowed:.1e}",
            f"{r.span_ms:.1f}",
            f"{r.rms:.6g}",
            f"{r.rms_error:.1e} / {r.rms_allowed:.1e}",
            f"{r.steps_a_turn:.0f}",
            r.remark,
        )
        lines.append(f"| {' | '.join('' if 'nan' in cell else cell for cell in cells)} |")
    return lines


def _drift(rows: list[Drift]) -> list[str]:
    lines = [
        f"## {drift.TURNS} turns",
        "",
        f"Base case; of the first {drift.BLOCK} turns and of all. Energy: largest imbalance of the "
        "ledger over the work that the drive turns over, at 1e-9. Constraints: largest violation, "
        f"m or rad. RMS: of the first and the last {drift.BLOCK} turns, beside numba's mean and "
        f"scatter over {drift.MEMBERS} starts.",
        "",
        "| start | formulation | ended | energy | constraints | RMS, N | numba's |",
        "|---|---|---|---|---|---|---|",
    ]
    for r in rows:
        energy = " to ".join(f"{value / r.turned_over:.1e}" for value in r.imbalance)
        kept = "none" if r.residual is None else " to ".join(f"{v:.1e}" for v in r.residual)
        theirs = (
            f"{mean:.6g} ± {sd:.2g}"
            for mean, sd in zip(r.reference_rms, r.reference_scatter, strict=True)
        )
        ended = r.failure or ("whirl" if r.whirl else "yes")
        lines.append(
            f"| {r.start} | {r.formulation} | {ended} | {energy} | {kept} | "
            f"{' to '.join(f'{value:.6g}' for value in r.rms)} | {' to '.join(theirs)} |"
        )
    return lines


def _baumgarte(rows: list[Stabilised]) -> list[str]:
    lines = [
        "## Baumgarte's alpha and beta",
        "",
        f"Quiet motion, {baumgarte.TURNS} turns. Violation: the largest of any constraint, m or "
        "rad. Error: the largest of the force on the foundation, over its largest value, from "
        "the eccentricities at 1e-11. The last value of alpha and beta is 1/h, h the mean step "
        "of (20, 20). CPU seconds of a second run.",
    ]
    for rtol in baumgarte.TOLERANCES:
        lines += [
            "",
            f"Tolerance {rtol:g}:",
            "",
            "| alpha, 1/s | beta, 1/s | violation | error | steps a turn | CPU s | ended |",
            "|---|---|---|---|---|---|---|",
        ]
        for r in (row for row in rows if row.rtol == rtol):
            free = r.alpha is None
            pair = "eccentricities | " if free else f"{r.alpha:.4g} | {r.beta:.4g}"
            kept = "none" if free else f"{r.residual:.1e}"
            lines.append(
                f"| {pair} | {kept} | {r.force_error:.1e} | {r.steps_a_turn:.0f} | "
                f"{r.seconds:.2f} | {r.failure or 'yes'} |"
            )
    return lines

"""The tables of the report's page: headings in words with units, and rows."""

import math
import numbers
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from jaxcrusher.batch.rows import meanings

from jaxcrusher.joint.validity import ELASTIC_IMPACT_SPEED, WIDEST_CLEARANCE, WIDEST_CONTACT
from jaxcrusher.scenes.echo import said, unit_of
from jaxcrusher.scenes.parameters import NUMBERS, in_words
from optimize import words
from optimize.answer import Answer, Confirmed, Refinement
from optimize.forces import besides
from optimize.objectives import OBJECTIVES
from optimize.words import shown

# What the stages and the ways of descent are called.
STAGES = {
    "settled": "map of settled motions",
    "landscape": "both starts over the box",
    "refinement": "descents",
    "confirmation": "long runs",
    "regimes": "regimes and slopes",
    "companions": "motions of random starts, decay",
    "fronts": "fronts",
    "motions": "motions of the cells",
}
DESCENTS = {"gradient": "exact gradients", "fits": "fits to noisy runs"}
# What the numbers cannot say.
LIMITS = (
    "The force is |R_O| + |R_C|, the reactions of the frame on shaft and toggle: the source "
    "of the crusher's data never defines its foundation force. It holds the weight and the "
    "crushing load. The ground feels the shaking force: the load closes inside the machine.",
    f"Hertz's contact needs a half-width of at most {WIDEST_CONTACT:g} bore radii, a bearing a "
    f"clearance of at most {WIDEST_CLEARANCE:g} of them; impacts above "
    f"{ELASTIC_IMPACT_SPEED:g} m/s are not elastic. Motions beyond any are marked.",
    "A friction whirl penetrates by the order of the clearance: its numbers are outside the "
    "theory and rank as nothing.",
    "Impacting motions diverge exponentially: a motion drawn here is one of many that start "
    "almost alike. Only their statistics can be compared.",
    "A ± of a cell is the scatter within one run; runs can differ from each other by more.",
)


@dataclass(frozen=True)
class Table:
    """Rows under headings; the first column names its row. `about` and `caption` may be empty."""

    headings: Sequence[str]
    rows: Sequence[Sequence[object]]
    caption: str = ""
    about: str = ""


def as_text(value: object) -> str:
    """A value in words; what is not a number says so."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, numbers.Real) and not math.isfinite(value):
        return "no value"
    return words.number(value) if isinstance(value, float) else str(value)


def is_number(value: object) -> bool:
    """Whether a cell aligns right."""
    if isinstance(value, str):
        return re.fullmatch(r"[-+]?\d[\d.e+±-]*", value) is not None
    return isinstance(value, numbers.Real) and not isinstance(value, bool)


def answer(found: Answer) -> Table:
    """The closing table."""
    objective, unit = found.objective, found.objective.unit
    others = besides(objective.meaning)
    rows = [
        (
            title,
            *_chosen(found, design),
            words.settled(design),
            *(words.interval(runs) for runs in design.transient.values()),
            *(getattr(design, name) for name in others),
            f"{design.ideal_rms:.0f}",
            f"{design.capacity:.2f}",
            words.turns(design),
        )
        for title, design in found.designs.items()
    ]
    starts = next(iter(found.designs.values())).transient
    headings = (
        "design",
        *_parameters(found),
        f"settled, {unit}",
        *(f"{start} start after {found.settle_turns} turns, {unit}" for start in starts),
        *(f"{meaning}, N" for meaning in others.values()),
        "ideal joint's RMS, N",
        "capacity, m³/h",
        "turns to settle",
    )
    return Table(headings, rows, caption=f"{objective.meaning}, {unit}")


def checks(found: Answer) -> Table:
    """What was checked, each with its verdict."""
    rows = [(check.name, check.verdict, check.detail) for check in found.checks]
    return Table(("check", "verdict", "detail"), rows)


def slopes(found: Answer) -> Table | None:
    """The slopes at the optimum, in the units of the tables; None where there are none."""
    best, report, unit = found.optimum, found.gradient_report, found.objective.unit
    if best is not None and best.settled is not None and best.settles:
        orbit = best.settled
        rows = [
            (_per(found, name, unit), slope * factor, _two(orbit.slopes_apart[name] * factor))
            for name, slope in orbit.slopes.items()
            for _, factor in [unit_of(name, found.box.units)]
        ]
        about = "Of the settled motion, exact; beside them, how far differences are from them."
        return Table(("by", "slope", "differences off by"), rows, about=about)
    if report is None:
        return None
    unit, meaning = meanings().get(report.metric, ("its unit", report.metric))
    rows = [
        (
            _per(found, slope.parameter, unit),
            slope.value * factor,
            _two(slope.standard_error * factor),
            slope.estimator,
            slope.verdict,
            "; ".join(slope.reasons),
        )
        for slope in report.slopes.values()
        for _, factor in [unit_of(slope.parameter, found.box.units)]
    ]
    headings = ("by", "slope", "standard error", "estimator", "verdict", "why")
    return Table(headings, rows, about=f"Of the {meaning}, start in contact, {report.regime}.")


def fronts(found: Answer) -> list[Table]:
    """What the least objective costs in another number; none where nothing has to be traded."""
    unit, told = found.objective.unit, found.objective.meaning
    tables = []
    for front in found.fronts:
        if len(front.objective) == 1:
            continue
        of = OBJECTIVES[front.of].meaning if front.of in OBJECTIVES else front.of
        others = besides(told, of)
        headings = (
            f"{in_words(front.of)}, {front.unit}",
            f"objective, {unit}",
            *(f"{meaning}, N" for meaning in others.values()),
            *_parameters(found),
        )
        columns = (
            [f"{other:.5g}" for other in front.other],
            front.objective.tolist(),
            *(front.forces[name].tolist() for name in others),
            *(
                [f"{number:.5g}" for number in shown(name, numbers, found.box.units)]
                for name, numbers in front.values.items()
            ),
        )
        rows = list(zip(*columns, strict=True))
        tables.append(Table(headings, rows, caption=f"{told} against {in_words(front.of)}"))
    return tables


def candidates(found: Answer) -> Table:
    """Where the descents ended, confirmed."""
    unit, others = found.objective.unit, besides(found.objective.meaning)
    headings = (
        "",
        *_parameters(found),
        f"objective, {unit}",
        f"±, {unit}",
        *(f"{meaning}, N" for meaning in others.values()),
        "worse start",
    )
    rows = [
        (
            i + 1,
            *_chosen(found, one),
            one.objective,
            _two(one.half_width),
            *(getattr(one, name) for name in others),
            one.worse_start,
        )
        for i, one in enumerate(found.candidates)
    ]
    return Table(headings, rows)


def descents(found: Answer) -> Table:
    """The local searches from end to end; those that are alike in a row."""
    unit = found.objective.unit
    ends = [f"{name} {end}" for end in ("first", "last") for name in _parameters(found)]
    headings = ("", "by", "evaluations", *ends, f"first, {unit}", f"last, {unit}")
    rows = [(i + 1, *_descent(found, one)) for i, one in enumerate(found.refinement)]
    return Table(headings, rows)


def _descent(found: Answer, one: Refinement) -> Iterable[object]:
    path = one.path.items()
    ends = (
        f"{shown(name, float(points[end]), found.box.units):.5g}"
        for end in (0, -1)
        for name, points in path
    )
    return (DESCENTS.get(one.by, one.by), one.evaluations, *ends, one.first, one.last)


def runs(design: Confirmed, unit: str) -> Table:
    """Every variable of every run of a design."""
    known = meanings() | {
        "objective": (unit, "objective"),
        "steps": ("1", "integration steps"),
        "counts": ("1", "may be chosen"),
    }
    first, *_ = design.transient.values()
    rows = []
    for name in first.by_run:
        of, meaning = known.get(name, ("1", name))
        columns = (one.by_run[name].tolist() for one in design.transient.values())
        rows.append(
            (
                meaning if of == "1" else f"{meaning}, {of}",
                *(", ".join(map(as_text, column)) for column in columns),
            )
        )
    return Table(("of each run", *(f"{start} start" for start in design.transient)), rows)


def box(found: Answer) -> Table:
    """Where it was searched."""
    rows = [
        (name, *(f"{shown(key, value, found.box.units):.5g}" for value in ends))
        for name, (key, ends) in zip(_parameters(found), found.box.bounds.items(), strict=True)
    ]
    low, high = found.box.derived_speed
    rows += [
        ("capacity, m³/h", f"{found.box.capacity_floor:.3g}", "none"),
        ("speed by capacity, rad/s", f"{low:.4g}", f"{high:.4g}"),
    ]
    return Table(("", "lowest", "highest"), rows)


def stages(found: Answer) -> Table:
    """What took how long."""
    rows = [
        (STAGES.get(name, name), f"{spent:.1f}", found.steps.get(name, ""))
        for name, spent in found.seconds.items()
    ]
    return Table(("", "seconds", "integration steps"), rows)


def fixed(found: Answer) -> Table:
    """The numbers and choices that were not free."""
    rows = [
        (in_words(name), said(name, value, found.box.units) if name in NUMBERS else str(value))
        for name, value in found.fixed.items()
    ]
    return Table(("", "value"), rows)


def versions(found: Answer) -> Table:
    """Of the packages."""
    return Table(("", "version"), list(found.versions.items()))


def _chosen(found: Answer, design: Confirmed) -> Iterable[str]:
    units = found.box.units
    return (f"{shown(name, value, units):.5g}" for name, value in design.values.items())


def _two(error: float) -> str:
    """The digits that an uncertainty deserves."""
    return f"{float(f'{error:.2g}'):g}" if math.isfinite(error) else as_text(error)


def _parameters(found: Answer) -> list[str]:
    units = found.box.units
    return [
        f"{in_words(name)}, {unit_of(name, units)[0]}".rstrip(", ") for name in found.box.bounds
    ]


def _per(found: Answer, name: str, unit: str) -> str:
    return f"{in_words(name)}, {unit} per {unit_of(name, found.box.units)[0] or '1'}"

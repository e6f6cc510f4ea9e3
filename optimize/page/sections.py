"""The sections of the report's page that tell the answer in tables."""

from collections.abc import Iterable

import jaxcrusher as jc
from jaxcrusher.batch.rows import VARIABLES
from jaxcrusher.joint.validity import ELASTIC_IMPACT_SPEED, WIDEST_CONTACT
from optimize import words
from optimize.answer import Answer, Confirmed, Refinement
from optimize.page.markup import Html, as_text, element, missing, section, table
from optimize.words import design_unit, shown


def answer(found: Answer) -> Html:
    """The closing table, what is outside the model, and what the search leaves out."""
    if not found.designs:
        return section("The answer", missing("answer"))
    objective, unit = found.objective, found.objective.unit
    rows = [
        (
            title,
            *(f"{shown(name, value)[0]:.5g}" for name, value in design.values.items()),
            words.settled(design),
            *(words.interval(runs) for runs in design.transient.values()),
            f"{design.ideal_rms:.0f}",
            f"{design.capacity:.2f}",
            words.turns(design),
        )
        for title, design in found.designs.items()
    ]
    starts = next(iter(found.designs.values())).transient
    headings = (
        "design",
        *map(_with_unit, found.box.bounds),
        f"settled, {unit}",
        *(f"{start} start after {found.settle_turns} turns, {unit}" for start in starts),
        "ideal joint's RMS, N",
        "capacity, m³/h",
        "turns to settle",
    )
    remarks = [
        element("li", f"{title}: {remark}")
        for title, design in found.designs.items()
        for remark in (words.regimes(design), words.limits(design))
        if remark
    ]
    return section(
        "The answer",
        element("p", words.answer(found), class_="first"),
        table(headings, rows, caption=f"{objective.meaning}, {unit}"),
        element("p", f"{words.error(found)}."),
        element("ul", *remarks),
        element("p", found.claim.words) if found.claim else missing("claim"),
        element("h3", "What the search leaves out"),
        element("p", found.remark) if found.remark else missing("remark"),
    )


def checks(found: Answer) -> Html:
    """What was checked, each with its verdict."""
    if not found.checks:
        return section("Checks", missing("checks"))
    rows = [
        (
            check.name,
            element("span", check.verdict, class_="ok" if check.passed else "failed"),
            check.detail,
        )
        for check in found.checks
    ]
    failed, count = sum(not check.passed for check in found.checks), len(rows)
    verdict = f"{failed} of {count} failed." if failed else f"All {count} passed."
    return section("Checks", element("p", verdict), table(("check", "verdict", "detail"), rows))


def slopes(found: Answer) -> Html:
    """The slopes at the optimum, in the units of the tables, and what holds it there."""
    best, report, unit = found.optimum, found.gradient_report, found.objective.unit
    parts: list[Html] = []
    if best is not None and best.settled is not None and best.settles:
        orbit = best.settled
        rows = [
            (_per(name, unit), slope / factor, orbit.slopes_apart[name] / factor)
            for name, slope in orbit.slopes.items()
            for _, factor in [design_unit(name)]
        ]
        about = "Of the settled motion, exact; beside them, how far differences are from them."
        parts = [element("p", about), table(("by", "slope", "differences off by"), rows)]
    elif report is not None:
        unit, _ = VARIABLES.get(report.metric, ("its unit", ""))
        rows = [
            (
                _per(slope.parameter, unit),
                slope.value / factor,
                slope.standard_error / factor,
                slope.estimator,
                slope.verdict,
                "; ".join(slope.reasons),
            )
            for slope in report.slopes.values()
            for _, factor in [design_unit(slope.parameter)]
        ]
        headings = ("by", "slope", "standard error", "estimator", "verdict", "why")
        about = f"Of {report.metric}, start in contact, {report.regime}."
        parts = [element("p", about), table(headings, rows)]
    else:
        parts = [missing("slopes")]
    limits = (words.held(one, found.objective.unit) for one in found.held)
    return section(
        "Slopes at the optimum", *parts, element("ul", *(element("li", x) for x in limits))
    )


def _per(name: str, unit: str) -> str:
    return f"{name}, {unit} per {design_unit(name)[0] or '1'}"


def search(found: Answer) -> Html:
    """Candidates, descents, and the long runs in full."""
    unit, parameters = found.objective.unit, list(map(_with_unit, found.box.bounds))
    candidates = table(
        ("", *parameters, f"objective, {unit}", f"±, {unit}", "worse start"),
        (
            (
                i + 1,
                *(shown(name, value)[0] for name, value in one.values.items()),
                one.objective,
                one.half_width,
                one.worse_start,
            )
            for i, one in enumerate(found.candidates)
        ),
    )
    ends = [f"{name} {end}" for end in ("first", "last") for name in parameters]
    descents = table(
        ("", "by", "evaluations", *ends, f"first, {unit}", f"last, {unit}"),
        ((i + 1, *_descent(one)) for i, one in enumerate(found.refinement)),
    )
    return section(
        "How it was found",
        element("h3", "Candidates"),
        candidates if found.candidates else missing("candidates"),
        element("h3", "Refinement"),
        descents if found.refinement else missing("refinement"),
        *(_all_numbers(title, design, unit) for title, design in found.designs.items()),
    )


def _descent(one: Refinement) -> Iterable[object]:
    path = one.path.items()
    ends = (shown(name, float(points[end]))[0] for end in (0, -1) for name, points in path)
    return (one.by, one.evaluations, *ends, one.first, one.last)


def _all_numbers(title: str, design: Confirmed, unit: str) -> Html:
    """Every variable of every run of a design."""
    units = {name: of for name, (of, _) in VARIABLES.items()} | {"objective": unit}
    first, *_ = design.transient.values()
    rows = [
        (
            name,
            *(
                ", ".join(map(as_text, runs.by_run[name].tolist()))
                for runs in design.transient.values()
            ),
            units.get(name, "1"),
        )
        for name in first.by_run
    ]
    headings = ("of each run", *(f"{start} start" for start in design.transient), "unit")
    return element("details", element("summary", f"All numbers: {title}"), table(headings, rows))


def settings(found: Answer) -> Html:
    """Box, seconds, versions, seed."""
    box = found.box
    limits = [
        (_with_unit(name), *(shown(name, value)[0] for value in ends))
        for name, ends in box.bounds.items()
    ]
    limits += [
        ("capacity, m³/h", box.capacity_floor, "none"),
        ("speed by capacity, rad/s", *box.derived_speed),
    ]
    stages = [(name, spent, found.steps.get(name, "")) for name, spent in found.seconds.items()]
    fixed = [(name, value, _unit(name)) for name, value in found.fixed.items()]
    parts = (
        ("Box", table(("", "lowest", "highest"), limits)),
        ("Stages", table(("", "seconds", "steps"), stages) if stages else missing("stages")),
        ("Fixed of the crusher", table(("", "value", "unit"), fixed) if fixed else "nothing"),
        ("Versions", table(("", "version"), found.versions.items())),
        ("Seed of random points", found.seed),
    )
    columns = (element("div", element("h3", title), content) for title, content in parts)
    return section("How it was run", element("div", *columns, class_="columns"))


def _with_unit(name: str) -> str:
    return f"{name}, {design_unit(name)[0]}".rstrip(", ")


def _unit(name: str) -> str:
    return jc.PARAMETERS[name].unit if name in jc.PARAMETERS else ""


def limits() -> Html:
    """What the numbers cannot say."""
    limits = (
        "The force is |R_O| + |R_C|, the reactions of the frame on shaft and toggle: the source "
        "of the crusher's data never defines its foundation force.",
        f"Hertz's contact needs a half-width of at most {WIDEST_CONTACT:g} bore radii; impacts "
        f"above {ELASTIC_IMPACT_SPEED:g} m/s are not elastic. Motions beyond either are marked.",
        "A friction whirl penetrates by the order of the clearance: its numbers are outside the "
        "theory and rank as nothing.",
        "Impacting motions diverge exponentially: a motion drawn here is one of many that start "
        "almost alike. Only their statistics can be compared.",
        "A ± of a cell is the scatter within one run; runs can differ from each other by more.",
    )
    return section("Limits of validity", element("ul", *(element("li", x) for x in limits)))

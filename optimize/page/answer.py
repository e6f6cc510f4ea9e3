"""The answer of a search as a section of the report's page."""

from collections.abc import Mapping

import jaxcrusher as jc
from optimize.page.data import design_unit, shown
from optimize.page.markup import Html, as_text, element, known, missing, section, table

DESIGNS = {"optimum": "optimum", "seed_choice": "paper's choice"}


def answer(result: Mapping) -> Html:
    """The closing table, what is outside the model, and what the search leaves out."""
    designs = {title: result[key] for key, title in DESIGNS.items() if result.get(key)}
    if not designs:
        return section("The answer", missing("answer"))
    rows = [_design_row(title, design) for title, design in designs.items()]
    remarks = [
        element("li", f"{title}: {remark}")
        for title, design in designs.items()
        for remark in (_regimes(design), _limits(design.get("runs") or {}))
        if remark
    ]
    objective = result.get("objective") or {"meaning": "RMS of |R_O| + |R_C|", "unit": "N"}
    unit = objective.get("unit")
    names = _values(next(iter(designs.values())))
    headings = (
        "design",
        *(f"{name}, {design_unit(name)[0]}".rstrip(", ") for name in names),
        f"centred start, {unit}",
        f"contact start, {unit}",
        "ideal joint's RMS, N",
        "capacity, m³/h",
    )
    claim = (result.get("claim") or {}).get("words")
    remark = result.get("remark")
    return section(
        "The answer",
        table(headings, rows, caption=f"{objective.get('meaning')}, {unit}"),
        element("p", _interval(designs)),
        element("ul", *remarks),
        element("p", claim) if claim else "",
        element("h3", "What the search leaves out"),
        element("p", remark) if remark else missing("remark"),
    )


def _values(design: Mapping) -> dict:
    """The parameters of a design."""
    found = design.get("values")
    return {name: design.get(name) for name in ("speed", "clearance")} if found is None else found


def _design_row(title: str, design: Mapping) -> tuple:
    values = [
        shown(name, value)[0] if known(value) else value for name, value in _values(design).items()
    ]
    runs = design.get("runs") or {}
    return (
        title,
        *(f"{value:.5g}" if known(value) else "no value" for value in values),
        *(_run(runs.get(start)) for start in ("centred", "contact")),
        _fixed(design.get("ideal_rms"), 0),
        _fixed(design.get("capacity"), 2),
    )


def _interval(designs: Mapping[str, Mapping]) -> str:
    counts = {
        run.get("runs")
        for design in designs.values()
        for run in (design.get("runs") or {}).values()
    }
    if counts <= {None}:
        return "± is the standard error within one run."
    return f"± is half a 95 % interval from {max(filter(None, counts))} independent runs."


def _regimes(design: Mapping) -> str:
    """How the motions of a design move."""
    return "; ".join(
        f"{start} start {kind.get('name')}" for start, kind in (design.get("regime") or {}).items()
    )


def _fixed(value: float | None, digits: int, factor: float = 1.0) -> str:
    return f"{factor * value:.{digits}f}" if value is not None and known(value) else "no value"


def _run(run: Mapping | None) -> str:
    """An RMS with its standard error, or what is wrong with it."""
    if run is None:
        return "no run"
    if not run.get("success"):
        return "failed"
    value, error = run.get("foundation_rms"), run.get("foundation_rms_error")
    if "objective_mean" in run:
        value, error = run["objective_mean"], run.get("objective_half_width")
    whole = value is not None and known(value) and abs(value) >= 1e4
    text = _fixed(value, 0) if whole else as_text(value)
    if known(error):
        text += f" ± {float(f'{error:.2g}'):g}"
    return f"{text}, friction whirl" if run.get("whirl") else text


def outside(runs: Mapping[str, Mapping]) -> list[str]:
    """What of a design's runs is outside the contact model, run by run."""
    found = []
    for start, run in runs.items():
        limits = run.get("validity") or {}
        if not limits or not all(map(known, limits.values())):
            found.append(f"{start} start, not known")
            continue
        found += [f"{start} start, {remark}" for remark in jc.Validity(**limits).remarks()]
    return found


def _limits(runs: Mapping[str, Mapping]) -> str:
    """The same in a sentence."""
    if found := outside(runs):
        return "outside the contact model: " + "; ".join(found)
    return "inside the contact model" if runs else "no runs"

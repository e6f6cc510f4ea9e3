"""The tables of the report's page: headings in words with units, and rows."""

import math
from collections.abc import Mapping

from jaxcrusher.crusher.capacity import CAUTION
from jaxcrusher.files.text import Table, as_text, number, two_digits
from jaxcrusher.joint.validity import ELASTIC_IMPACT_SPEED, WIDEST_CLEARANCE, WIDEST_CONTACT
from jaxcrusher.scenes.parameters import NUMBERS, in_words, readable
from jaxcrusher.scenes.plausibility import borrowed
from jaxcrusher.scenes.units import said, unit_of
from jaxcrusher.sheets.load_sheet import MOVING, Row, joint_states
from jaxcrusher.sheets.severity import SOURCE
from optimize.answer import Answer, Confirmed, Runs
from optimize.search.confirm import long_window
from optimize.tell import words as formatting
from optimize.tell.forces import besides, name_of
from optimize.tell.words import shown

# Names of the stages and of the ways of descent.
STAGES = {
    "orbits": "map of periodic orbits",
    "scouts": "some designs over the box",
    "landscape": "both starts over the box",
    "motions": "motions of the cells",
    "refinement": "descents",
    "confirmation": "long runs",
    "bound": "cells halved for the bound",
    "coexisting": "orbits of random starts",
    "fronts": "fronts",
}
DESCENTS = {"gradient": "exact gradients", "fits": "fits to noisy runs"}
# Limits of what the numbers say.
OF_A_CRUSHER = (
    "The force is |R_O| + |R_C|, the reactions of the frame on shaft and toggle: the source "
    "of the crusher's data never defines its foundation force. It holds the weight and the "
    "crushing load. The ground feels the shaking force: the load closes inside the machine.",
)
LIMITS = (
    f"Hertz's contact needs a half-width of at most {WIDEST_CONTACT:g} radii, a bearing a "
    f"clearance of at most {WIDEST_CLEARANCE:g} of them; impacts above "
    f"{ELASTIC_IMPACT_SPEED:g} m/s are not elastic. Motions beyond any are marked.",
    "A friction whirl penetrates by the order of the clearance: its numbers are outside the "
    "theory and rank as nothing.",
    "Impacting motions diverge exponentially: a motion drawn here is one of many that start "
    "almost alike. Only their statistics can be compared.",
    "A ± of a cell is the scatter within one run; runs can differ from each other by more.",
)


def limits(found: Answer) -> tuple[str, ...]:
    """Return the limits of what the numbers say, of a crusher more than of another linkage."""
    return LIMITS if found.problem.speeds is None else (*OF_A_CRUSHER, *LIMITS)


def caution(found: Answer) -> str:
    """Return what must be known to read a crusher's capacity, or nothing."""
    return CAUTION if any(one.crushing is not None for one in found.designs.values()) else ""


def answer(found: Answer) -> Table:
    """Return the designs, a row each, for the page; turned, for the screen."""
    objective, unit = found.problem.objective, found.problem.objective.unit
    rows = []
    for title, design in found.designs.items():
        others = besides(design.forces, objective.meaning)
        of_ideal = others.get(next(iter(design.forces)), "RMS")
        row: dict[str, object] = {"design": title, **_chosen(found, design.values)}
        row |= _following(found, design) | {f"periodic orbit, {unit}": formatting.orbit(design)}
        for start, runs in design.transient.items():
            heading = (
                f"{start} start after {long_window(found.problem.effort).settle} turns, {unit}"
            )
            row[heading] = formatting.interval(runs)
        row |= {f"{meaning}, N": design.forces[name] for name, meaning in others.items()}
        row[f"ideal joints' {of_ideal}, N"] = number(design.ideal_rms)
        row |= _crushing(found, title, design)
        rows.append(row | {"turns to 1/e": formatting.turns(design)})
    name = name_of(objective.meaning)
    caption = objective.meaning if name == objective.meaning else f"{name}: {objective.meaning}"
    return Table.of(rows, caption=f"{caption}, {unit}")


def _crushing(found: Answer, title: str, design: Confirmed) -> dict[str, str]:
    """Return the numbers of a design as a crusher, by heading; none of another linkage."""
    if design.crushing is None:
        return {}
    one = design.crushing
    return {
        "capacity, m³/h": f"{one.capacity:.2f}",
        **({"capacity, t/h": f"{found.throughput[title]:.2f}"} if found.throughput else {}),
        "stroke at the discharge, mm": number(1e3 * one.stroke),
        "stroke, vertical over horizontal": number(one.stroke_ratio),
    }


def _following(found: Answer, design: Confirmed) -> dict[str, str]:
    """Return the numbers of a design that follow from the free ones, by heading."""
    units = found.problem.units
    return {
        f"{in_words(name)} that follows, {unit_of(name, units)[0]}": _number(name, value, units)
        for name, value in design.follows.items()
    }


def load_sheet(found: Answer) -> Table | None:
    """Return the load sheets of the foundation side by side; None where no design has one."""
    if not found.load_sheets:
        return None
    sheets = [
        {_heading(row): row for row in sheet if row.part != MOVING}
        for sheet in found.load_sheets.values()
    ]
    # An overdamped design has more free motions than another.
    part_of = {heading: row.part for sheet in sheets for heading, row in sheet.items()}
    parts = list(dict.fromkeys(part_of.values()))
    rows = [
        (heading, *(_carried(sheet[heading]) if heading in sheet else "" for sheet in sheets))
        for heading in sorted(part_of, key=lambda heading: parts.index(part_of[heading]))
    ]
    judged = any("zone" in row.remark for sheet in sheets for row in sheet.values())
    zones = f" Zones of {SOURCE}." if judged else ""
    states = [
        f" Of the {name} the {joint_states(design.orbit.solution.scene)}."
        for name, design in found.designs.items()
        if name in found.load_sheets and design.orbit is not None
    ]
    about = (
        "Forces on frame and ground: x to the right, y up. An exciting force is that on a frame at "
        "rest, less its mean. Harmonics of the shaft's speed have their "
        f"phase, by the angle from the right.{zones}{''.join(states)}"
    )
    return Table(("", *found.load_sheets), rows, about=about)


def _heading(row: Row) -> str:
    order = f", order {row.order:g}" if isinstance(row.order, float) else f", {row.order}"
    order = order if row.order else ""
    return f"{row.name}{order}, {row.unit}"


def _carried(row: Row) -> str:
    phase = "" if isinstance(row.phase_rad, str) else f" at {math.degrees(row.phase_rad):z.0f}°"
    remark = f" ({row.remark})" if row.remark else ""
    return f"{number(row.value)}{phase}{remark}"


def checks(found: Answer) -> Table:
    """Return the checks with their verdicts."""
    rows = [(check.name, check.verdict, check.detail) for check in found.checks]
    return Table(("check", "verdict", "detail"), rows)


def slopes(found: Answer) -> Table | None:
    """Return the slopes at the optimum, in the units of the tables; None where there are none."""
    best, unit = found.optimum, found.problem.objective.unit
    if best is not None and best.orbit is not None and best.settles:
        orbit = best.orbit
        rows = []
        for name, slope in orbit.slopes.items():
            factor = unit_of(name, found.problem.units)[1]
            row = {
                "by": _per(found, name, unit),
                "slope": slope * factor,
                "differences off by": two_digits(orbit.slopes_apart[name] * factor),
            }
            rows.append(row)
        about = "The slopes on the periodic orbit are exact. Differences of orbits check them."
        return Table.of(rows, about=about)
    return None


def fronts(found: Answer) -> list[Table]:
    """Return the fronts of more than one point."""
    unit, told = found.problem.objective.unit, found.problem.objective.meaning
    tables = []
    for front in found.fronts:
        if len(front.objective) == 1:
            continue
        others = besides(front.forces, told, front.meaning)
        rows = [
            {
                f"{in_words(front.of)}, {front.unit}": number(front.other[i]),
                f"objective, {unit}": float(front.objective[i]),
                **{f"{others[name]}, N": float(front.forces[name][i]) for name in others},
                **_chosen(found, {name: column[i] for name, column in front.values.items()}),
            }
            for i in range(len(front.objective))
        ]
        tables.append(Table.of(rows, caption=f"{told} against {in_words(front.of)}"))
    return tables


def candidates(found: Answer) -> Table:
    """Return the ends of the descents, confirmed."""
    unit, rows = found.problem.objective.unit, []
    for i, one in enumerate(found.candidates):
        others = besides(one.forces, found.problem.objective.meaning)
        row = {
            "": i + 1,
            **_chosen(found, one.values),
            f"objective, {unit}": one.objective,
            f"±, {unit}": two_digits(one.half_width),
            **{f"{meaning}, N": one.forces[name] for name, meaning in others.items()},
            "worse start": one.worse_start,
        }
        rows.append(row)
    return Table.of(rows)


def descents(found: Answer) -> Table:
    """Return both ends of each local search."""
    unit, rows = found.problem.objective.unit, []
    for i, one in enumerate(found.refinement):
        row = {"": i + 1, "by": DESCENTS.get(one.by, one.by), "evaluations": one.evaluations}
        for end, at in (("first", 0), ("last", -1)):
            point = _chosen(found, {name: points[at] for name, points in one.path.items()})
            row |= {f"{heading} {end}": value for heading, value in point.items()}
        rows.append(row | {f"first, {unit}": one.first, f"last, {unit}": one.last})
    return Table.of(rows)


def motions(found: Answer) -> Table:
    """Return how each design moves from each start."""
    rows = [
        (f"{title}, {start} start", _motion(runs, design))
        for title, design in found.designs.items()
        for start, runs in design.transient.items()
    ]
    return Table(("", "motion"), rows)


def _motion(runs: Runs, design: Confirmed) -> str:
    if not runs.settles or design.orbit is None:
        return "no orbit; `python -m jaxcrusher regimes` names it"
    return "towards the orbit, in contact"


def coexisting(found: Answer) -> Table | None:
    """Return the stable orbits that random starts come to; None where none was looked for."""
    unit = found.problem.objective.unit
    rows = [
        (title, f"{one.share:.0%}", one.solution.period, one.objective)
        for title, design in found.designs.items()
        for one in design.coexisting
    ]
    headings = ("", "random starts that come to it", "turns", f"objective, {unit}")
    return Table(headings, rows) if rows else None


def runs(found: Answer, design: Confirmed) -> Table:
    """Return every variable of every run of a design."""
    first, *_ = design.transient.values()
    rows = []
    for name in first.by_run:
        of, meaning, *_ = found.problem.columns[name]
        columns = (one.by_run[name].tolist() for one in design.transient.values())
        rows.append(
            (
                meaning if of == "1" else f"{meaning}, {of}",
                *(", ".join(map(as_text, column)) for column in columns),
            )
        )
    return Table(("of each run", *(f"{start} start" for start in design.transient)), rows)


def box(found: Answer) -> Table:
    """Return the box that was searched."""
    bounds = found.problem.design.bounds.items()
    ends = [_chosen(found, {name: pair[end] for name, pair in bounds}) for end in (0, 1)]
    rows = [(heading, lowest, ends[1][heading]) for heading, lowest in ends[0].items()]
    if found.problem.speeds is not None:
        unit, one = unit_of("speed", found.problem.units)
        low, high = (speed / one for speed in found.problem.speeds)
        rows += [
            ("capacity, m³/h", number(found.problem.capacity_floor), "none"),
            (f"speed by capacity, {unit}", number(low), number(high)),
        ]
    rows += [
        (f"{in_words(limit.statistic)}, {limit.unit}", "none", number(limit.most))
        for limit in found.problem.limits
    ]
    return Table(("", "lowest", "highest"), rows)


def stages(found: Answer) -> Table:
    """Return the seconds and steps of each stage, whichever of concurrent ones ended first."""
    rows = [
        (STAGES[name], f"{found.seconds[name]:.1f}", found.steps.get(name, ""))
        for name in sorted(found.seconds, key=[*STAGES].index)
    ]
    return Table(("", "seconds", "integration steps"), rows)


def fixed(found: Answer) -> Table:
    """Return the numbers and choices that were not free."""
    rows = [
        (
            in_words(name),
            said(name, value, found.problem.units) if isinstance(value, float) else str(value),
        )
        for name, value in found.problem.design.fixed.items()
    ]
    if found.problem.speeds is None:
        return Table(("", "value"), rows)
    rows += [
        (in_words(name), f"{readable(name, NUMBERS[name].default)} *")
        for name in borrowed(
            {**found.problem.design.fixed, **found.problem.design.bounds, **_follow(found)}
        )
    ]
    return Table(("", "value, * of the PE250x400"), rows)


def _follow(found: Answer) -> dict[str, float]:
    """Return what follows from the free numbers, of any design."""
    return next((design.follows for design in found.designs.values()), {})


def versions(found: Answer) -> Table:
    """Return the versions of the packages."""
    return Table(("", "version"), list(found.versions.items()))


def _chosen(found: Answer, values: Mapping[str, float]) -> dict[str, str]:
    """Return values of the free parameters as text, by heading."""
    units, chosen = found.problem.units, {}
    for name, value in values.items():
        heading = f"{in_words(name)}, {unit_of(name, units)[0]}".rstrip(", ")
        chosen[heading] = _number(name, value, units)
    return chosen


def _number(name: str, value: float, units: Mapping[str, str]) -> str:
    """Return a parameter as text, in the unit that it was given in."""
    return f"{shown(name, value, units):.6g}"


def _per(found: Answer, name: str, unit: str) -> str:
    return f"{in_words(name)}, {unit} per {unit_of(name, found.problem.units)[0] or '1'}"

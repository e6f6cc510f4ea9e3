"""The tables of the report's page: headings with units, and rows."""

import math
from collections.abc import Callable, Mapping

from jaxcrusher.crusher.capacity import CAUTION
from jaxcrusher.files.text import Table, as_text, number, quantity, two_digits
from jaxcrusher.joint.validity import ELASTIC_IMPACT_SPEED, WIDEST_CLEARANCE, WIDEST_CONTACT
from jaxcrusher.scenes.parameters import NUMBERS, in_words, readable
from jaxcrusher.scenes.plausibility import borrowed
from jaxcrusher.scenes.units import said, unit_of
from jaxcrusher.sheets.load_sheet import MOVING, Row, joint_states
from jaxcrusher.sheets.severity import REPLACED, SOURCE
from optimize.answer import Answer, Confirmed
from optimize.search.confirm import long_window
from optimize.tell import words as formatting
from optimize.tell.words import besides, name_of, shown

# Names of the stages and of the ways of descent.
STAGES = {
    "orbits": "map of periodic orbits",
    "landscape": "both starts over the box",
    "refinement": "descents",
    "confirmation": "long runs",
    "bound": "cells halved for the bound",
    "coexisting": "orbits of random starts",
    "fronts": "fronts",
}
DESCENTS = {"gradient": "exact gradients", "fits": "fits to noisy runs"}
# Limits of the theory, which the page states.
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
    "Impacting motions diverge exponentially: only statistics of them can be compared.",
)


def limits(found: Answer) -> tuple[str, ...]:
    """Return the limits of the theory; a crusher has an additional one."""
    return LIMITS if found.problem.speeds is None else (*OF_A_CRUSHER, *LIMITS)


def caution(found: Answer) -> str:
    """Return the caution on the capacity of crushers; an empty text for another linkage."""
    return CAUTION if any(one.crushing is not None for one in found.designs.values()) else ""


def headline(found: Answer) -> list[tuple[str, str, str]]:
    """Return the three main numbers of the optimum: meaning, value, and a remark.

    They are a free number, the speed if it is free, the RMS shaking force, and the capacity of a
    crusher. A linkage has its objective or a second free number in place of the capacity.
    """
    best, other = found.optimum, found.reference
    if best is None or other is None:
        return []
    ends = formatting.at_bounds(found, best)
    free = sorted(best.values, key=lambda name: name != "speed")
    told, where = [], found.problem.compared_with

    def add(meaning: str, one: float, of: float, words: Callable[[float], str]) -> None:
        change = 100 * (one / of - 1) if of and one != of else math.nan
        than = f"{'less' if change < 0 else 'more'} than {words(of)}"
        more = f"{abs(change):.3g} % {than} at the {where}"
        told.append((meaning, words(one), more if math.isfinite(change) else ""))

    shakes = best.forces["shaking_rms"], other.forces["shaking_rms"]
    add("RMS shaking force", *shakes, lambda one: quantity(one, "N"))
    if best.crushing is not None and other.crushing is not None:
        capacities = best.crushing.capacity, other.crushing.capacity
        add("capacity", *capacities, lambda one: f"{one:.2f} m³/h")
    elif found.problem.objective.name != "shaking_rms":
        objectives, unit = (best.objective, other.objective), found.problem.objective.unit
        add(name_of(found.problem.objective.meaning), *objectives, lambda one: quantity(one, unit))
    room = 3 - len(told)
    left = []
    for i, name in enumerate(free):
        value, end = said(name, best.values[name], found.problem.units), ends.get(name)
        if i >= room:
            left.append(", ".join(filter(None, (f"{in_words(name)} {value}", end))))
            continue
        value, _, in_other_unit = value.rstrip(")").partition(" (")
        told.insert(i, (in_words(name), value, ", ".join(filter(None, (in_other_unit, end)))))
    if len(left) > 2:
        left = [f"{len(left)} more numbers that are free, in the table"]
    if left:
        meaning, value, remark = told[room - 1]
        others = f"with {'; '.join(left)}"
        told[room - 1] = meaning, value, "; ".join(filter(None, (remark, others)))
    return told


def answer(found: Answer) -> Table:
    """Return the designs side by side: numbers with units, and their relative change."""
    columns = [_number_texts(found, title, design) for title, design in found.designs.items()]
    both = len(columns) == 2
    rows = []
    for named in columns[0]:
        texts, values = zip(*(column[named] for column in columns), strict=True)
        rows.append((*named, *texts, *([_change(*values)] if both else [])))
    return Table(("", "unit", *found.designs, *(["change"] if both else [])), rows)


def _change(one: float, other: float) -> str:
    """Return the change from the second number to the first, if it is below 1000 %."""
    change = 100 * (one / other - 1) if other and one != other else math.nan
    return f"{change:+.1f} %" if abs(change) < 1e3 else ""


def _number_texts(
    found: Answer, title: str, design: Confirmed
) -> dict[tuple[str, str], tuple[str, float]]:
    """Return the numbers of a design, as text and as floats, by meaning and unit."""
    objective, units = found.problem.objective, found.problem.units
    told: dict[tuple[str, str], tuple[str, float]] = {}
    for name, value in design.values.items():
        told[in_words(name), unit_of(name, units)[0]] = _number(name, value, units), value
    for name, value in design.follows.items():
        meaning = f"{in_words(name)} that follows"
        told[meaning, unit_of(name, units)[0]] = _number(name, value, units), value
    told[objective.meaning, objective.unit] = _objective(design), design.objective
    others = besides(design.forces, objective.meaning)
    for name, meaning in others.items():
        told[meaning, "N"] = as_text(design.forces[name]), design.forces[name]
    of_ideal = others.get(next(iter(design.forces)), "RMS")
    told[f"ideal joints' {of_ideal}", "N"] = as_text(design.ideal_rms), design.ideal_rms
    if (one := design.crushing) is not None:
        told["capacity", "m³/h"] = f"{one.capacity:.2f}", one.capacity
        if found.throughput:
            tonnes = found.throughput[title]
            told["capacity", "t/h"] = f"{tonnes:.2f}", tonnes
        told["stroke at the discharge", "mm"] = number(1e3 * one.stroke), one.stroke
        ratio = number(one.stroke_ratio), one.stroke_ratio
        told["stroke, up over across", ""] = ratio
    return told


def _objective(design: Confirmed) -> str:
    """Return the objective on the deciding orbit, or as the mean of the worse start's runs."""
    if not design.counts:
        return as_text(math.nan)
    if design.averaged:
        return formatting.interval(design.transient[design.worse_start])
    if design.orbit is not None and design.orbit.objective == design.objective:
        return formatting.orbit(design)
    return number(design.objective)


def load_sheet(found: Answer) -> Table | None:
    """Return the load sheets of the foundation side by side; None without any sheet."""
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
    unseen = f"its numbers could not be looked up, nor those of {REPLACED}"
    zones = f" Zones of {SOURCE}; {unseen}." if judged else ""
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


def slopes(found: Answer) -> Table | None:
    """Return the slopes at the optimum, in the units of the tables; None without an orbit."""
    best, of = found.optimum, found.problem.objective.unit
    if best is None or best.orbit is None or not best.settles:
        return None
    rows = []
    for name, slope in best.orbit.slopes.items():
        unit, factor = unit_of(name, found.problem.units)
        apart = two_digits(best.orbit.slopes_apart[name] * factor)
        rows.append((f"{in_words(name)}, {of} per {unit or '1'}", slope * factor, apart))
    about = "The slopes on the periodic orbit are exact. Differences of orbits check them."
    return Table(("by", "slope", "differences off by"), rows, about=about)


def fronts(found: Answer) -> list[Table]:
    """Return a table for each front with more than one point."""
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
    """Return the ends of the descents with their confirmed objectives."""
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
    """Return both ends of each descent."""
    unit, rows = found.problem.objective.unit, []
    for i, one in enumerate(found.refinement):
        row = {"": i + 1, "by": DESCENTS.get(one.by, one.by), "evaluations": one.evaluations}
        for end, at in (("first", 0), ("last", -1)):
            point = _chosen(found, {name: points[at] for name, points in one.path.items()})
            row |= {f"{heading} {end}": value for heading, value in point.items()}
        rows.append(row | {f"first, {unit}": one.first, f"last, {unit}": one.last})
    return Table.of(rows)


def motions(found: Answer) -> Table:
    """Return the motion of each design from each start."""
    rows = [
        (
            f"{title}, {start} start",
            "towards the periodic orbit, in contact"
            if runs.settles
            else "not known to settle; `python -m jaxcrusher regimes` names the motion",
            formatting.turns(design),
            formatting.interval(runs),
        )
        for title, design in found.designs.items()
        for start, runs in design.transient.items()
    ]
    problem = found.problem
    after = f"mean after {long_window(problem.effort).settle} turns, {problem.objective.unit}"
    return Table(("", "motion", "turns to 1/e", after), rows)


def coexisting(found: Answer) -> Table | None:
    """Return the stable orbits to which random starts converge; None without any."""
    unit = found.problem.objective.unit
    rows = [
        (title, f"{one.share:.0%}", one.solution.period, one.objective)
        for title, design in found.designs.items()
        for one in design.coexisting
    ]
    headings = ("", "random starts that come to it", "turns", f"objective, {unit}")
    return Table(headings, rows) if rows else None


def box(found: Answer) -> Table:
    """Return the bounds of the searched box, and the other constraints."""
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
    """Return the seconds and steps of each stage, in a fixed order."""
    rows = [
        (STAGES[name], f"{found.seconds[name]:.1f}", found.steps.get(name, ""))
        for name in sorted(found.seconds, key=[*STAGES].index)
    ]
    return Table(("", "seconds", "integration steps"), rows)


def fixed(found: Answer) -> Table:
    """Return the fixed numbers and choices."""
    design, units = found.problem.design, found.problem.units
    rows = [
        (in_words(name), said(name, value, units) if isinstance(value, float) else str(value))
        for name, value in design.fixed.items()
    ]
    if found.problem.speeds is None:
        return Table(("", "value"), rows)
    follows = next((one.follows for one in found.designs.values()), {})
    rows += [
        (in_words(name), f"{readable(name, NUMBERS[name].default)} *")
        for name in borrowed({**design.fixed, **design.bounds, **follows})
    ]
    return Table(("", "value, * of the PE250x400"), rows)


def _chosen(found: Answer, values: Mapping[str, float]) -> dict[str, str]:
    """Return the values of the free parameters as text, by heading."""
    units, chosen = found.problem.units, {}
    for name, value in values.items():
        heading = f"{in_words(name)}, {unit_of(name, units)[0]}".rstrip(", ")
        chosen[heading] = _number(name, value, units)
    return chosen


def _number(name: str, value: float, units: Mapping[str, str]) -> str:
    """Return a parameter as text, in the unit in which it was given."""
    return f"{shown(name, value, units):.6g}"

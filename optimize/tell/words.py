"""The numbers and sentences of an answer as text, for the console and the page."""

import math
from collections.abc import Iterable, Mapping
from typing import TypeVar

import numpy as np

from jaxcrusher.crusher.template import CALLED, STATISTIC
from jaxcrusher.files.text import number, quantity, with_error
from jaxcrusher.joint.validity import Validity
from jaxcrusher.scenes.parameters import in_words
from jaxcrusher.scenes.units import said, unit_of
from optimize.answer import Active, Answer, Confirmed, Runs
from optimize.search.confirm import long_window

# A number this near to a bound of its box, as a share, is at the bound: the rest is rounding.
AT_END = 1e-12
# A force that changes by a smaller share counts as unchanged.
UNCHANGED = 1e-3


def name_of(meaning: str) -> str:
    """Return the name in sentences of the quantity with this meaning."""
    known = {STATISTIC[force].meaning: name for force, name in CALLED.items()}
    return known.get(meaning, meaning)


def besides(forces: Iterable[str], *told: str) -> dict[str, str]:
    """Return the names and meanings of forces, without the meanings in `told`."""
    meanings = {name: STATISTIC[name].meaning for name in forces}
    return {name: meaning for name, meaning in meanings.items() if meaning not in told}


def interval(runs: Runs) -> str:
    """Return a mean with its interval, and failures or whirl of the runs."""
    failed = runs.count - int(runs.by_run["success"].sum())
    if failed:
        return "failed" if failed == runs.count else f"{failed} of {runs.count} failed"
    if math.isnan(runs.objective_mean):  # an objective of periodic orbits only
        return "no value"
    text = with_error(runs.objective_mean, runs.objective_half_width)
    return f"{text}, friction whirl" if runs.by_run["whirl"].any() else text


def orbit(design: Confirmed) -> str:
    """Return the objective on the orbit and its stability, or say that there is no orbit."""
    found = design.orbit
    if found is None or not found.found:
        return "none" if found is None else "none found"
    text = f"{found.objective:.2f}" if abs(found.objective) >= 100 else f"{found.objective:.6g}"
    if found.undecided:
        return f"{text}, not known to be stable"
    return text if found.stable else f"{text}, unstable"


def turns(design: Confirmed) -> str:
    """Return the turns in which a disturbance of the orbit decays to 1/e, or "unknown"."""
    found = design.orbit
    if found is None or not found.found or found.undecided:
        return "unknown"
    return f"{float(found.solution.settling_turns):.0f}" if found.stable else "never"


def coexisting(design: Confirmed) -> str:
    """Return the orbits to which random starts converge, and the share without an orbit."""
    found = [
        f"{one.share:.0%} of random starts come to {number(one.objective)}"
        + (f" over {one.solution.period} turns" if one.solution.period > 1 else "")
        for one in design.coexisting
    ]
    left = 1 - sum(one.share for one in design.coexisting)
    # Shares of a few starts are large, so a smaller remainder is rounding.
    if found and left > 1e-6:
        found.append(f"{left:.0%} to no motion that repeats")
    return ", ".join(found)


def active(one: Active, unit: str, units: Mapping[str, str]) -> str:
    """Return an active constraint with its multiplier, as text."""
    of, factor = (one.unit, 1.0) if one.unit else unit_of(one.parameter, units)
    by = "the floor of the capacity" if one.limit == "capacity" else f"its {one.limit} value"
    per = f" per {of}" if of else ""
    return f"{one.parameter} is at {by}, multiplier {number(one.multiplier * factor)} {unit}{per}"


Number = TypeVar("Number", float, np.ndarray)


def shown(name: str, value: Number, units: Mapping[str, str]) -> Number:
    """Return a parameter in the unit in which it was given, or in the unit of drawings."""
    return value / unit_of(name, units)[1]


def answer(found: Answer) -> str:
    """Return the answer in a sentence, which recommends a design only if nothing is against it.

    Reasons against it are failed checks, a map without a stable orbit, and motion outside the
    contact model. If one force falls and the other rises, a first sentence says so.
    """
    best, other = found.optimum, found.reference
    if best is None or other is None:
        return f"No design may be chosen: {found.empty}." if found.empty else ""
    ends = at_bounds(found, best)
    at_speed = f", {ends['speed']}" if "speed" in ends else ""
    values = {"speed": f"{best.speed:.4g} rad/s ({best.speed * 30 / math.pi:.0f} rpm{at_speed})"}
    if best.crushing is not None:
        values["clearance"] = f"{1e3 * best.crushing.clearance:.3g} mm of radial clearance"
    for name, value in best.values.items():
        told = f"{in_words(name)} {said(name, value, found.problem.units)}"
        values.setdefault(name, told)
    shown = [
        f"{value} ({ends[name]})" if name in ends and name != "speed" else value
        for name, value in values.items()
    ]
    against, reasons = [], []
    if found.maps is not None and found.maps.stable_orbits == 0:
        against.append("the map of the box found no stable orbit of one turn")
    if why := _unconfirmed(found):
        against.append("not confirmed")
        reasons.append(why)
    if beyond := outside(best):
        against.append("outside the contact model")
        reasons.append(f"because of {'; '.join(beyond)}")
    place = " with ".join(filter(None, (shown[0], ", ".join(shown[1:]))))
    if best.crushing is not None and at_speed.endswith("lowest allowed"):
        place += ", if wear and rock that waits for the jaw, which are not counted, allow it"
    text = f"the best is {place}, " if against else f"Run it at {place}: "
    unit = found.problem.objective.unit
    text += f"{name_of(found.problem.objective.meaning)} {quantity(best.objective, unit)}"
    if best.averaged:
        text += " as the mean of long runs"
    if other.counts and other.objective > best.objective > 0:
        less = 100 * (1 - best.objective / other.objective)
        than = quantity(other.objective, unit)
        text += f", {less:.1f} % less than {than} at the {found.problem.compared_with}"
    for name, meaning in besides(best.forces, found.problem.objective.meaning).items():
        text += f"; {name_of(meaning)} {quantity(best.forces[name], 'N')}"
        text += f" against {quantity(other.forces[name], 'N')}" if other.counts else ""
    before = f"{'; '.join(against)}: " if against else ""
    text = "; ".join([before + text, *reasons])
    return " ".join(filter(None, (trade(found), f"{text[0].upper()}{text[1:]}.")))


def at_bounds(found: Answer, best: Confirmed) -> dict[str, str]:
    """Name the end for each free number at an end of the box or at the capacity's floor."""
    limits = {}
    for name, bounds in found.problem.design.bounds.items():
        for bound, words in zip(bounds, ("lowest", "highest"), strict=True):
            if math.isclose(best.values[name], bound, rel_tol=AT_END, abs_tol=0.0):
                limits[name] = words
    limits |= {one.parameter: one.limit for one in found.active}
    floor = {"capacity": "where the capacity is at its floor"}
    return {name: floor.get(limit, f"the {limit} allowed") for name, limit in limits.items()}


def trade(found: Answer) -> str:
    """Say which force falls and which rises against the compared design; else an empty text."""
    old, new = found.reference, found.optimum
    if old is None or new is None or not (old.counts and new.counts):
        return ""
    change = {name: new.forces[name] / old.forces[name] - 1 for name in old.forces}
    falls, rises = min(change, key=lambda n: change[n]), max(change, key=lambda n: change[n])
    if not change[falls] < -UNCHANGED < UNCHANGED < change[rises]:
        return ""
    called = CALLED | {"shaking_rms": f"{CALLED['shaking_rms']}, which the ground feels,"}
    return (
        f"Against the {found.problem.compared_with} the {called[falls]} falls by "
        f"{-100 * change[falls]:.3g} %, but the {called[rises]} rises by "
        f"{100 * change[rises]:.3g} %, from {quantity(old.forces[rises], 'N')} to "
        f"{quantity(new.forces[rises], 'N')}."
    )


def _unconfirmed(found: Answer) -> str:
    """Say why an answer is not confirmed; an empty text if it is confirmed."""
    if not found.checks:
        return "because the search ended before its checks"
    failed = [f"“{check.name}”" for check in found.checks if not check.passed]
    if not failed:
        return ""
    checks = "the check" if len(failed) == 1 else f"{len(failed)} of {len(found.checks)} checks"
    return f"because {checks} failed: {', '.join(failed)}"


def outside(design: Confirmed) -> list[str]:
    """Say for each start how the runs of a design leave the contact model."""
    found = []
    for start, runs in design.transient.items():
        known = bool(runs.first("success"))
        remarks = runs.validity.remarks() if known else ["not known"]
        found += [f"{start} start, {remark}" for remark in remarks]
    return found


def limits(design: Confirmed) -> str:
    """Say how a design's runs leave the contact model, or how far inside they are."""
    if found := outside(design):
        return "OUTSIDE the contact model: " + "; ".join(found)
    contacts = [
        one
        for runs in design.transient.values()
        for one in (runs.validity, *runs.validity.others.values())
        if isinstance(one, Validity)
    ]
    return (
        "inside the contact model (half-width "
        f"{max(np.asarray(one.half_width_ratio) for one in contacts):.2f} radii, approach "
        f"{max(np.asarray(one.impact_speed_ratio) for one in contacts):.2f} of the elastic limit)"
    )


def error(answer: Answer) -> str:
    """Explain the averages of both starts and their intervals."""
    counts = {runs.count for one in answer.designs.values() for runs in one.transient.values()}
    settled = long_window(answer.problem.effort).settle
    return (
        f"Numbers of the starts are averages after {settled} turns; ± is half a 95 % interval, "
        f"from {max(counts)} independent runs"
    )

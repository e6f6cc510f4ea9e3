"""What a search found in words, for the console and for the page."""

import math
from collections.abc import Mapping
from typing import TypeVar

import numpy as np

from jaxcrusher.scenes.echo import said, unit_of
from jaxcrusher.scenes.parameters import in_words
from optimize.answer import Answer, Confirmed, Held, Runs
from optimize.decay import GONE, rate, resolved
from optimize.forces import FORCES, besides, opposed


def number(value: float) -> str:
    """Five digits, and all of those before the point."""
    return f"{value:.0f}" if abs(value) >= 1e4 else f"{value:.5g}"


def interval(runs: Runs) -> str:
    """A mean with its interval, and what is wrong with the runs."""
    failed = runs.count - int(runs.by_run["success"].sum())
    if failed:
        return "failed" if failed == runs.count else f"{failed} of {runs.count} failed"
    text = f"{number(runs.objective_mean)}±{float(f'{runs.objective_half_width:.2g}'):g}"
    return f"{text}, friction whirl" if runs.by_run["whirl"].any() else text


def settled(design: Confirmed) -> str:
    """The settled motion's objective with the digits it has, or why there is none."""
    orbit = design.settled
    if orbit is None or orbit.failure:
        return "none" if orbit is None else "none found"
    text = f"{orbit.objective:.2f}" if abs(orbit.objective) >= 100 else f"{orbit.objective:.6g}"
    return text if orbit.stable else f"{text}, unstable"


def force(design: Confirmed, name: str) -> str:
    """One of `FORCES` of the motion that a design is judged by, in N, if it has one."""
    value = getattr(design, name)
    return number(value) if math.isfinite(value) else "none"


def turns(design: Confirmed) -> str:
    """Turns to settle: in which a disturbance falls to 1/e."""
    orbit = design.settled
    if orbit is None or orbit.failure:
        return "unknown"
    return f"{orbit.settling_turns:.0f}" if orbit.stable else "never"


def regimes(design: Confirmed) -> str:
    """How a design moves, from both starts."""
    found = []
    for start, runs in design.transient.items():
        if runs.settles:
            found.append(f"{start} start: in contact, {decay(runs, design)}")
        elif start in design.regime:
            found.append(f"{start} start: {design.regime[start].name}, by its time average")
    return "; ".join(filter(None, (*found, companions(design))))


def decay(runs: Runs, design: Confirmed) -> str:
    """How a start's swing dies, and how long that takes at most."""
    swing = runs.decay
    if swing is None or design.settled is None:
        return "its swing dies towards the settled motion"
    if swing.last < resolved(swing):
        return f"on the settled motion, to {resolved(swing):.1g} clearances"
    in_the_end = rate(design.settled)
    text = (
        f"its swing of {swing.last:.2g} clearances dies by {100 * swing.rate:.2g}±"
        f"{200 * swing.error:.1g} % a turn (in the end by {100 * in_the_end:.2g} %: the multiplier)"
    )
    if swing.last <= GONE:
        return text
    turns = float(f"{np.log(swing.last / GONE) / in_the_end:.2g}")
    return f"{text}, to {GONE:g} within {turns:.0f} turns"


def companions(design: Confirmed) -> str:
    """What random starts come to."""
    found = [
        f"{one.share:.0%} to {number(one.objective)}"
        + (f" over {one.period} turns" if one.period > 1 else "")
        for one in design.companions
    ]
    return f"of random starts {', '.join(found)}" if found else ""


def held(one: Held, unit: str, units: Mapping[str, str]) -> str:
    """A limit and what it costs."""
    of, factor = ("m3/h", 1.0) if one.parameter == "capacity" else unit_of(one.parameter, units)
    by = "the floor of the capacity" if one.limit == "capacity" else f"its {one.limit} value"
    per = f" per {of}" if of else ""
    return f"{one.parameter} held at {by} by {number(one.multiplier * factor)} {unit}{per}"


Number = TypeVar("Number", float, np.ndarray)


def shown(name: str, value: Number, units: Mapping[str, str]) -> Number:
    """A parameter in the unit that it was given in, or that drawings have."""
    return value / unit_of(name, units)[1]


def answer(found: Answer) -> str:
    """The answer in a sentence; it recommends a design only where nothing speaks against it.

    Before it stands a sentence where the two forces go different ways.
    """
    best, other = found.optimum, found.seed_choice
    if best is None or other is None:
        return f"No design may be chosen: {found.empty}." if found.empty else ""
    shown = [f"{best.speed:.4g} rad/s ({best.speed * 30 / math.pi:.0f} rpm)"]
    shown.append(f"{1e3 * best.clearance:.3g} mm of radial clearance")
    shown += [
        f"{in_words(name)} {said(name, value, found.box.units)}"
        for name, value in best.values.items()
        if name not in ("speed", "clearance")
    ]
    against, reasons = [], []
    if found.orbits == 0:
        against.append("no stable orbit of one turn was found in the box")
    if why := _unconfirmed(found):
        against.append("not confirmed")
        reasons.append(why)
    if beyond := outside(best):
        against.append("outside the contact model")
        reasons.append(f"because of {'; '.join(beyond)}")
    place = f"{shown[0]} with {', '.join(shown[1:])}"
    text = f"the best is {place}, " if against else f"Run it at {place}: "
    text += f"{found.objective.meaning} {number(best.objective)} {found.objective.unit}"
    if not best.settles:
        text += " as the mean of long runs"
    if other.counts and other.objective > best.objective > 0:
        less = 100 * (1 - best.objective / other.objective)
        text += f", {less:.1f} % less than {number(other.objective)} at the {found.compared_with}"
    for name, meaning in besides(found.objective.meaning).items():
        text += f"; {meaning} {force(best, name)} N"
        text += f" against {force(other, name)} N" if other.counts else ""
    before = f"{'; '.join(against)}: " if against else ""
    text = "; ".join([before + text, *reasons])
    return " ".join(filter(None, (trade(found), f"{text[0].upper()}{text[1:]}.")))


def trade(found: Answer) -> str:
    """Say that one force falls and the other rises, from the design compared with, or nothing."""
    before, after = found.seed_choice, found.optimum
    if before is None or after is None or not (before.counts and after.counts):
        return ""
    stood, stand = ({name: getattr(one, name) for name in FORCES} for one in (before, after))
    return opposed(stood, stand, found.compared_with)


def _unconfirmed(found: Answer) -> str:
    """Why an answer is not confirmed, or nothing."""
    if not found.checks:
        return "because the search ended before its checks"
    failed = [f"“{check.name}”" for check in found.checks if not check.passed]
    if not failed:
        return ""
    checks = "the check" if len(failed) == 1 else f"{len(failed)} of {len(found.checks)} checks"
    return f"because {checks} failed: {', '.join(failed)}"


def outside(design: Confirmed) -> list[str]:
    """Say what of a design's runs is outside the contact model, start by start."""
    found = []
    for start, runs in design.transient.items():
        known = bool(runs.first("success"))
        remarks = runs.validity.remarks() if known else ["not known"]
        found += [f"{start} start, {remark}" for remark in remarks]
    return found


def limits(design: Confirmed) -> str:
    """What of a design's runs is outside the contact model."""
    if found := outside(design):
        return "OUTSIDE the contact model: " + "; ".join(found)
    limits = [runs.validity for runs in design.transient.values()]
    return (
        "inside the contact model (half-width "
        f"{max(float(one.half_width_ratio) for one in limits):.2f} bore radii, approach "
        f"{max(float(one.impact_speed_ratio) for one in limits):.2f} of the elastic limit)"
    )


def error(answer: Answer) -> str:
    """What the numbers of the starts mean."""
    counts = {runs.count for one in answer.designs.values() for runs in one.transient.values()}
    return (
        f"starts: time average after {answer.settle_turns} turns; ± is half a 95 % interval, from "
        f"{max(counts)} independent runs"
    )


def spent(answer: Answer) -> list[str]:
    """Of every stage that came to its end."""
    return [
        f"{name} {seconds:.0f} s"
        + (f" ({answer.steps[name] / 1e6:.1f}e6 steps)" if name in answer.steps else "")
        for name, seconds in answer.seconds.items()
    ]

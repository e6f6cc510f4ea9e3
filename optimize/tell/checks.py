"""The checks of a search's answer, each with its rule, and remarks on the answer's limits."""

from dataclasses import replace

import numpy as np

from jaxcrusher.files.text import number, quantity
from jaxcrusher.scenes.parameters import in_words
from jaxcrusher.scenes.units import said, unit_of
from jaxcrusher.sheets.feed_response import TURNS
from optimize.answer import Answer, Check, Confirmed
from optimize.ask.limits import OF_ORBIT, OF_RUN, Found
from optimize.ask.problem import DesignProblem
from optimize.search.confirm import least_contact, long_window
from optimize.search.orbits import worse
from optimize.tell.words import active, coexisting, shown

# Greatest remaining slope after a descent, times the width of the box, as a share of the
# objective.
VANISHED = 1e-6
# Time averages that differ by a smaller share are of one motion.
ALIKE = 0.01
# Greatest deviation of differences from a slope, as a share of the slope: rounding.
APART = 0.02
# Greatest share by which a bearing's clearance lowers the RMS of a motion in contact.
BELOW_IDEAL = 0.003
NO_SLOPES = (
    "slopes are not known: at the optimum or beside it no orbit was solved for, or that of another "
    "motion"
)


def judge(answer: Answer) -> Answer:
    """Return an answer with its checks and its remark."""
    remarks = remark(answer), quieter(answer)
    return replace(answer, checks=checks(answer), remark=" ".join(filter(None, remarks)))


def checks(answer: Answer) -> tuple[Check, ...]:
    """Return the checks of an answer; without a design to choose it is one failed check."""
    problem, effort = answer.problem, answer.problem.effort
    best, other, window = answer.optimum, answer.reference, long_window(effort)
    if best is None or other is None:
        return (Check("a design may be chosen", False, answer.empty),)
    unit, units = problem.objective.unit, problem.units
    there = f"{number(other.objective)} {unit}" if other.counts else "nothing that counts"
    return (
        Check(
            "inside the box",
            _inside(best, problem),
            ", ".join(
                f"{name} {shown(name, best.values[name], units):.6g} in "
                f"{shown(name, low, units):.6g} to {shown(name, high, units):.6g} "
                f"{unit_of(name, units)[0]}".rstrip()
                for name, (low, high) in problem.design.bounds.items()
            ),
        ),
        *_capacity(best, problem),
        *_limits(best, problem),
        Check(
            "long runs from both starts succeed without whirl",
            best.counts,
            f"all of {effort.runs} runs each, {window.settle} + {window.turns} turns at rtol "
            f"{window.rtol:g}",
        ),
        *_motion(answer, best),
        Check(
            "not worse than any point of the map",
            answer.bound is not None and answer.bound.gain >= -VANISHED * abs(best.objective),
            _beside_map(answer, unit),
        ),
        *_ideal(best, problem),
        Check(
            f"better than the {problem.compared_with}",
            not other.objective < best.objective,
            f"{number(best.objective)} <= {there}",
        ),
        *_slopes(best, problem),
    )


def _inside(best: Confirmed, problem: DesignProblem) -> bool:
    """Tell whether all free numbers are inside their bounds, up to rounding."""
    inside = []
    for name, (low, high) in problem.design.bounds.items():
        slack = 1e-12 * max(abs(low), abs(high))
        inside.append(low - slack <= best.values[name] <= high + slack)
    return all(inside)


def _limits(best: Confirmed, problem: DesignProblem) -> tuple[Check, ...]:
    """Check limits on all motions of the optimum, and the contact model on coexisting orbits."""
    checked = []
    if problem.inside_model and best.coexisting:
        inside = [bool(one.solution.validity.inside) for one in best.coexisting]
        told = f"{sum(inside)} of {len(inside)}"
        checked.append(Check("orbits of random starts are inside the model", all(inside), told))
    for limit in problem.limits:
        name = limit.statistic
        motions: list[tuple[Found, float]] = [(one.solution, OF_ORBIT) for one in best.coexisting]
        if best.orbit is not None and best.settles:
            motions.append((best.orbit.solution, OF_ORBIT))
        else:
            means = [{name: runs.by_run[name].mean()} for runs in best.transient.values()]
            motions += [(mean, OF_RUN) for mean in means]
        kept = all(limit.kept(found, share) for found, share in motions)
        highest = float(np.max([np.asarray(found[name]) for found, _ in motions]))
        told = f"{highest:.6g} <= {limit.most:.6g} {limit.unit}"
        checked.append(Check(f"{name} at most its limit", kept, told))
    return tuple(checked)


def _capacity(best: Confirmed, problem: DesignProblem) -> tuple[Check, ...]:
    """Check the capacity of a crusher."""
    if best.crushing is None:
        return ()
    capacity = best.crushing.capacity
    detail = f"{capacity:.2f} >= {problem.capacity_floor:.2f} m3/h"
    return (Check("capacity at least the floor", bool(problem.reaches(capacity)), detail),)


def _ideal(best: Confirmed, problem: DesignProblem) -> tuple[Check, ...]:
    """Check that a crusher's RMS force is at most slightly below the force with ideal joints."""
    if problem.chamber is None:
        return ()
    of_runs = (float(runs.by_run["foundation_rms"].min()) for runs in best.transient.values())
    least, below = min(best.forces["foundation_rms"], *of_runs), _below_ideal(problem, best)
    return (
        Check(
            "not below the ideal joint",
            least >= best.ideal_rms * (1 - below),
            f"RMS {least:.0f} N >= {best.ideal_rms:.0f} N less {100 * below:.2g} %",
        ),
    )


def _below_ideal(problem: DesignProblem, best: Confirmed) -> float:
    """Return the greatest share by which a loose joint can lower the RMS of the ideal joint.

    Friction by the slip of the surfaces has a moment of constant sign on the jaw, at most the
    coefficient times bore radius and force. This moment over the jaw's length is the change of the
    forces at toggle and bearing.
    """
    described = problem.design.whole(problem.design.completed(best.values))
    if described["slip"] != "surface":
        return BELOW_IDEAL
    lever = described["bore_radius"] / described["jaw.length"]
    return BELOW_IDEAL + 2 * described["friction"] * lever


def _slopes(best: Confirmed, problem: DesignProblem) -> tuple[Check, ...]:
    """Check the slopes against differences of orbits, if the optimum settles on its orbit."""
    name, orbit = "the slopes at the optimum may be believed", best.orbit
    if orbit is None or not best.settles:
        return ()
    if np.isnan(list(orbit.slopes.values())).any():
        return (Check(name, False, NO_SLOPES),)
    good, details = True, []
    for parameter, slope in orbit.slopes.items():
        low, high = problem.design.bounds[parameter]
        apart = orbit.slopes_apart[parameter]
        of_slope, of_value = apart / max(abs(slope), 1e-300), apart * (high - low)
        of_value /= max(abs(best.objective), 1e-300)
        # For a vanishing slope only the share of the objective is meaningful.
        good &= of_slope <= APART or of_value <= VANISHED
        details.append(f"by {parameter} {of_slope:.1g} and {of_value:.1g}")
    check = Check(
        name,
        good,
        "differences of orbits are off by shares of the slope, and of the objective over "
        f"the box: {', '.join(details)}; rule: <= {APART:g} or <= {VANISHED:g}",
    )
    return (check,)


def _beside_map(answer: Answer, unit: str) -> str:
    """Say how far the optimum lies below or above the best point of the map."""
    if answer.bound is None:
        return "the map has no bound"
    if not (answer.maps and answer.maps.stable_orbits):
        return "the map has no stable orbit to compare the optimum with"
    gain, least = answer.bound.gain, answer.optimum and abs(answer.optimum.objective)
    where = "below" if gain >= 0 else "above"
    return (
        f"the optimum lies {abs(gain):.3g} {unit} {where} the map's best point; rule: at most "
        f"{VANISHED * (least or 0):.2g} {unit} above it"
    )


def _agree(best: Confirmed, unit: str) -> Check:
    """Check that the time averages from both starts belong to one motion."""
    one, two = best.transient.values()
    widths = [runs.objective_half_width for runs in (one, two)]
    apart = abs(one.objective_mean - two.objective_mean)
    return Check(
        "both starts agree",
        apart <= max(sum(widths), ALIKE * abs(best.objective)),
        f"{apart:.3g} {unit} apart, intervals ±{widths[0]:.3g} and ±{widths[1]:.3g} {unit}; rule: "
        f"within both, or within {100 * ALIKE:g} %, which a weakly damped oscillation leaves",
    )


def _motion(answer: Answer, best: Confirmed) -> tuple[Check, ...]:
    """Check that the motion from each start converges to the reported numbers."""
    orbit = best.orbit
    if orbit is None or not orbit.stable:
        return (_agree(best, answer.problem.objective.unit),)
    contact = ", ".join(
        f"{start} start {100 * least_contact(runs.by_run):.4g} %"
        for start, runs in best.transient.items()
    )
    comes = Check(
        "both starts come to the periodic orbit",
        best.settles,
        f"largest multiplier {float(orbit.solution.largest_multiplier):.6f} < 1, and in contact "
        f"all the time of all long runs: {contact}",
    )
    # A motion without a value of the objective excludes the design.
    worst = [
        one
        for one in best.coexisting
        if np.isnan(one.objective) or worse(one.objective, orbit.objective)
    ]
    alone = Check(
        "no random start comes to a worse motion",
        not worst,
        coexisting(best) or "none came to a motion that repeats",
    )
    return comes, alone, _stationary(answer, best)


def _stationary(answer: Answer, best: Confirmed) -> Check:
    """Check the conditions of Karush, Kuhn and Tucker at the optimum."""
    problem = answer.problem
    name = "a minimum: each parameter at an active constraint, or without slope"
    if np.isnan(list(answer.free_slopes.values())).any():
        return Check(name, False, NO_SLOPES)
    bounds = problem.design.bounds
    left = [
        (name, abs(slope) * (bounds[name][1] - bounds[name][0]) / abs(best.objective))
        for name, slope in answer.free_slopes.items()
    ]
    unit, units = problem.objective.unit, problem.units
    details = [active(one, unit, units) for one in answer.active]
    details += [
        f"slope by {name} {share:.1g} of the objective over the box" for name, share in left
    ]
    return Check(
        name,
        all(share <= VANISHED for _, share in left),
        "; ".join(details) + f"; rule: slopes <= {VANISHED:g}",
    )


def remark(answer: Answer) -> str:
    """Say what the answer does not cover."""
    problem, best = answer.problem, answer.optimum
    if best is None:
        return "There is no least value. Maps and runs show how the designs of the box move."
    if problem.objective.name == "expected_rms":
        return (
            f"Least {problem.objective.meaning}, by the response of orbits to it. All other "
            "numbers, and the motions of long runs, are those under the mean load. Designs that "
            f"lose contact under the feed more than once in {TURNS:g} turns do not count."
        )
    if problem.objective.name != "rms":
        return f"Least {problem.objective.meaning}; the other numbers are reported beside it."
    speeds = problem.design.bounds.get("speed")
    if speeds is None:
        return "The RMS of the foundation force at a fixed speed."
    if best.values["speed"] > speeds[0] * 1.001:
        return "The least RMS lies above the lowest speed allowed."
    return (
        "The least RMS lies at the lowest speed allowed, because the force rises with the speed. "
        "The clearance matters only through the motion that it allows. The paper rules out low "
        "speeds because of wear, which this objective does not count."
    )


def quieter(answer: Answer) -> str:
    """Name the map's point of least shaking force, if this is over 1 % below the optimum's."""
    problem, best, maps = answer.problem, answer.optimum, answer.maps
    orbits = None if maps is None else maps.counting_orbits
    if best is None or maps is None or orbits is None or len(best.forces) == 1:
        return ""
    if "shaking_rms" in problem.objective.outputs:
        return ""
    shaking = orbits.shaking_rms.where(orbits.counts).to_numpy().ravel()
    least = int(np.nanargmin(shaking))
    if not shaking[least] < best.forces["shaking_rms"] * (1 - ALIKE):
        return ""
    at = ", ".join(
        f"{in_words(name)} {said(name, value, problem.units)}"
        for name, value in problem.design.numbers(maps.points[least]).items()
    )
    rms = float(orbits.foundation_rms.to_numpy().ravel()[least])
    now = quantity(best.forces["shaking_rms"], "N")
    return (
        f"The ground is shaken less elsewhere: at {at} the RMS shaking force is "
        f"{quantity(shaking[least], 'N')} instead of {now}, and the "
        f"RMS force on the foundation is {quantity(rms, 'N')}. The objective shaking_rms searches "
        "for the least."
    )

"""What was checked of a search's answer, and how far its claim goes."""

import numpy as np
import xarray as xr

from optimize.answer import Answer, Check, Claim, Confirmed
from optimize.confirm import CONFIDENCE
from optimize.evaluate import Case
from optimize.landscape import spacing_bound, worst
from optimize.options import Options
from optimize.stages import CONFIRM_RTOL, LONGER


def claim(data: xr.Dataset, best: Confirmed, grid: Confirmed) -> Claim:
    """How far the optimum is the box's, as far as landscape and intervals can tell.

    The bound is what the objective may change within half a cell of the landscape's best point;
    the gain is what the descents bought against that point.
    """
    confident = f"{100 * CONFIDENCE:.0f} %"
    unit = data.objective.attrs["units"]
    bound = spacing_bound(worst(data)) if "sample" not in data.dims else None
    if bound is None:
        words = (
            f"The best of {data.sizes['sample']} points of a Sobol sequence and of the descents "
            f"from them, known to {best.half_width:.3g} {unit} at {confident}; nothing is said of "
            "what lies between the points."
        )
    else:
        words = (
            f"Global within the box to {bound + best.half_width:.3g} {unit}, provided the "
            f"objective is no rougher between the grid's points than among them: {bound:.3g} "
            f"{unit} for half a cell, {best.half_width:.3g} {unit} for the {confident} interval."
        )
    gain_half_width = float(np.hypot(best.half_width, grid.half_width))
    gain = grid.objective - best.objective
    return Claim(CONFIDENCE, best.half_width, bound, gain, gain_half_width, words)


def checks(answer: Answer, case: Case, options: Options) -> tuple[Check, ...]:
    """What was checked of an answer that came to its evidence."""
    best, other, claim = answer.optimum, answer.seed_choice, answer.claim
    slopes = answer.gradient_report
    assert best is not None and other is not None and claim is not None and slopes is not None
    unit = case.objective.unit
    one, two = best.runs.values()
    widths = [runs.objective_half_width for runs in (one, two)]
    apart = abs(one.objective_mean - two.objective_mean)
    inside = [
        low * (1 - 1e-12) <= best.values[name] <= high * (1 + 1e-12)
        for name, (low, high) in case.design.bounds.items()
    ]
    least = min(float(runs.by_run["foundation_rms"].min()) for runs in (one, two))
    there = f"{other.objective:.0f}" if np.isfinite(other.objective) else "nothing that counts"
    return (
        Check(
            "inside the box",
            all(inside),
            ", ".join(f"{name} {value:.6g}" for name, value in best.values.items()),
        ),
        Check(
            "capacity at least the floor",
            best.capacity >= case.capacity_floor * (1 - 1e-12),
            f"{best.capacity:.2f} against {case.capacity_floor:.2f} m3/h",
        ),
        Check(
            "long runs from both starts succeed without whirl",
            bool(np.isfinite(best.objective)),
            f"{options.runs} runs each, {LONGER * options.settle} + {LONGER * options.turns} "
            f"turns at rtol {CONFIRM_RTOL:g}",
        ),
        Check(
            "both starts agree",
            # Within both intervals, or 1 %, which a swing that hardly damps leaves.
            apart <= max(sum(widths), 0.01 * abs(best.objective)),
            f"{apart:.3g} {unit} apart, intervals ±{widths[0]:.3g} and ±{widths[1]:.3g} {unit}",
        ),
        Check(
            "not worse than the landscape's best point",
            claim.gain >= -claim.gain_half_width,
            f"{claim.gain:.3g} ± {claim.gain_half_width:.3g} {unit} better, both confirmed alike",
        ),
        Check(
            "not below the ideal joint",
            # A quiet clearance changes the RMS by under 0.3 % of the ideal joint's.
            least >= best.ideal_rms * (1 - 0.003),
            f"RMS {least:.0f} N against {best.ideal_rms:.0f} N",
        ),
        Check(
            "better than the paper's choice",
            not other.objective <= best.objective,
            f"{there} {unit} there",
        ),
        Check(
            "the slopes at the optimum may be believed",
            slopes.usable,
            ", ".join(f"by {name}: {slope.verdict}" for name, slope in slopes.slopes.items()),
        ),
    )


def remark(best: Confirmed, case: Case, options: Options) -> str:
    """The answer in words, with what it leaves out."""
    if options.objective != "rms":
        return f"Least {case.objective.meaning}; the other numbers are reported beside it."
    speeds = case.design.bounds.get("speed")
    if speeds is None:
        return "The RMS of the foundation force at a fixed speed."
    if best.values["speed"] > speeds[0] * 1.001:
        return "The least RMS lies inside the range of speeds."
    return (
        "The least RMS lies at the lowest speed allowed: the RMS alone is least there, for the "
        "force follows the speed, and the clearance matters only through the motion it allows. "
        "The paper rules low speeds out for wear, which this objective does not count."
    )

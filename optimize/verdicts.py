"""What was checked of a search's answer, and how far its claim goes."""

import numpy as np
import xarray as xr

from optimize.confirm import CONFIDENCE, Confirmed
from optimize.evaluate import STARTS, Case
from optimize.landscape import spacing_bound, worst
from optimize.options import Options
from optimize.stages import CONFIRM_RTOL, LONGER


def claim(data: xr.Dataset, best: Confirmed, grid: Confirmed) -> dict:
    """How far the optimum is the box's, as far as landscape and intervals can tell.

    `bound` is what the objective may change within half a cell of the landscape's best point
    (None without a grid); `gain` is what the descents bought against that point.
    """
    confident = f"{100 * CONFIDENCE:.0f} %"
    unit = data.objective.attrs["units"]
    gain = grid.value - best.value
    bound = spacing_bound(worst(data)) if "sample" not in data.dims else None
    found: dict = {
        "confidence": CONFIDENCE,
        "half_width": best.error,
        "bound": bound,
        "gain": gain,
        "gain_half_width": float(np.hypot(best.error, grid.error)),
    }
    if bound is None:
        words = (
            f"The best of {data.sizes['sample']} points of a Sobol sequence and of the descents "
            f"from them, known to {best.error:.3g} {unit} at {confident}; nothing is said of what "
            "lies between the points."
        )
    else:
        words = (
            f"Global within the box to {bound + best.error:.3g} {unit}, provided the objective is "
            f"no rougher between the grid's points than among them: {bound:.3g} {unit} for half a "
            f"cell, {best.error:.3g} {unit} for the {confident} interval."
        )
    return found | {"words": words}


def checks(result: dict, case: Case, options: Options, best: Confirmed) -> list[dict]:
    """What was checked of the answer, each with its verdict."""
    optimum, seed = result["optimum"], result["seed_choice"]
    value, unit = optimum["objective"], case.objective.unit
    means = [best.mean(i) for i in range(len(STARTS))]
    widths = [best.half_width(i) for i in range(len(STARTS))]
    apart = abs(means[0] - means[1])
    inside = [
        low * (1 - 1e-12) <= optimum["values"][name] <= high * (1 + 1e-12)
        for name, (low, high) in case.design.bounds.items()
    ]
    numbers = ", ".join(f"{name} {value:.6g}" for name, value in optimum["values"].items())
    rows = [
        ("inside the box", all(inside), numbers),
        (
            "capacity at least the floor",
            optimum["capacity"] >= case.capacity_floor * (1 - 1e-12),
            f"{optimum['capacity']:.2f} against {case.capacity_floor:.2f} m3/h",
        ),
        (
            "long runs from both starts succeed without whirl",
            best.counts,
            f"{options.runs} runs each, {LONGER * options.settle} + {LONGER * options.turns} "
            f"turns at rtol {CONFIRM_RTOL:g}",
        ),
        (
            "both starts agree",
            # Within both intervals, or 1 %, which a swing that hardly damps leaves.
            apart <= max(sum(widths), 0.01 * abs(value)),
            f"{apart:.3g} {unit} apart, intervals ±{widths[0]:.3g} and ±{widths[1]:.3g} {unit}",
        ),
        (
            "not worse than the landscape's best point",
            result["claim"]["gain"] >= -result["claim"]["gain_half_width"],
            f"{result['claim']['gain']:.3g} ± {result['claim']['gain_half_width']:.3g} {unit} "
            "better, both confirmed alike",
        ),
        (
            "not below the ideal joint",
            # A quiet clearance changes the RMS by under 0.3 % of the ideal joint's.
            best.rows["foundation_rms"].min() >= optimum["ideal_rms"] * (1 - 0.003),
            f"RMS {best.rows['foundation_rms'].min():.0f} N against {optimum['ideal_rms']:.0f} N",
        ),
        (
            "better than the paper's choice",
            not seed["objective"] <= value,
            f"{_number(seed['objective'])} {unit} there",
        ),
        (
            "the slopes at the optimum may be believed",
            all(s["verdict"] == "ok" for s in result["gradient_report"]["slopes"].values()),
            ", ".join(
                f"by {name}: {slope['verdict']}"
                for name, slope in result["gradient_report"]["slopes"].items()
            ),
        ),
    ]
    return [
        {
            "name": name,
            "passed": bool(passed),
            "verdict": "ok" if passed else "failed",
            "detail": detail,
        }
        for name, passed, detail in rows
    ]


def _number(value: float) -> str:
    return f"{value:.0f}" if np.isfinite(value) else "nothing that counts"


def remark(result: dict, case: Case, options: Options) -> str:
    """The answer in words, with what it leaves out."""
    if options.objective != "rms":
        return f"Least {case.objective.meaning}; the other numbers are reported beside it."
    speeds = case.design.bounds.get("speed")
    if speeds is None:
        return "The RMS of the foundation force at a fixed speed."
    if result["optimum"]["values"]["speed"] > speeds[0] * 1.001:
        return "The least RMS lies inside the range of speeds."
    return (
        "The least RMS lies at the lowest speed allowed: the RMS alone is least there, for the "
        "force follows the speed, and the clearance matters only through the motion it allows. "
        "The paper rules low speeds out for wear, which this objective does not count."
    )

"""The designs of a study and their forces, in tables and in words."""

import numpy as np

import jaxcrusher as jc
from jaxcrusher.joint.validity import Validity
from optimize.balance.evidence import AS_IT_IS, STANDING
from optimize.evaluate import STARTS
from optimize.forces import FORCES, NAMES, opposed, quantity

# Of the inputs of completions, which are no parameters.
UNITS = {"counterweight.moment_along": "kg m", "counterweight.moment_across": "kg m"}
FIGURES = {
    "foundation_rms": ("RMS of \\|R_O\\| + \\|R_C\\|", "N", 0),
    "foundation_mean": ("its mean", "N", 0),
    "foundation_variation": ("its variation about the mean (RMS)", "N", 0),
    "foundation_peak": ("its peak", "N", 0),
    "bearing_rms": ("RMS of \\|R_O\\|", "N", 0),
    "toggle_rms": ("RMS of \\|R_C\\|", "N", 0),
    "net_rms": ("RMS of \\|R_O + R_C\\|", "N", 0),
    "net_variation": ("its variation about the mean (RMS)", "N", 0),
    "shaking_rms": ("RMS of the shaking force", "N", 0),
    "drive_power_rms": ("RMS of the drive power", "W", 0),
    "drive_power_peak": ("peak of the drive power", "W", 0),
    "stroke": ("horizontal travel of B", "m", 5),
    "vertical_travel": ("vertical travel of B", "m", 5),
}


def designs(result: dict) -> tuple[list[str], list[list[str]]]:
    """Headings and rows of the table of parameters."""
    chosen, bounds = result["designs"]["chosen"], result["designs"]["bounds"]
    rows = []
    for name, (low, high) in bounds.items():
        unit = UNITS.get(name) or jc.PARAMETERS[name].unit
        unit, factor = ("deg", 180 / np.pi) if unit == "rad" else (unit, 1.0)
        cells = [f"{name}, {unit}", f"{factor * low:.4g} to {factor * high:.4g}"]
        for design in chosen.values():
            position = design["point"][list(bounds).index(name)]
            at = " *" if min(position, 1 - position) < 1e-3 else ""
            cells.append(f"{factor * design['values'][name]:.4g}{at}")
        lost = chosen["optimised"]["one_by_one"]
        rows.append([*cells, *(f"{lost[force][name]:.0f}" for force in FORCES)])
    for key, label in (
        ("eccentricity", "eccentricity that follows, m"),
        ("counterweight_mass", "counterweight that follows, kg"),
        ("capacity", "capacity, m3/h"),
    ):
        numbers = (f"{round(d[key], 6):.4g}" for d in chosen.values())
        rows.append([label, "", *numbers, *("" for _ in FORCES)])
    back = ("N more if it alone goes back", "N more of the shaking force")
    return ["parameter (* at a bound)", "bounds", *chosen, *back], rows


def forces(result: dict) -> tuple[list[str], list[list[str]]]:
    """Headings and rows of the table of forces in quiet motion."""
    found = result["figures"]
    rows = [
        [f"{label}, {unit}", *(f"{found[name][key]:.{digits}f}" for name in found)]
        for key, (label, unit, digits) in FIGURES.items()
    ]
    return ["over a turn, started in contact", *found], rows


def origins(result: dict) -> tuple[list[str], list[list[str]]]:
    """Headings and rows of the table of what the force is made of."""
    found = {name: design["variants"] for name, design in result["designs"]["chosen"].items()}
    rms, shaking = FORCES
    names = next(iter(found.values()))[rms]
    rows = [
        [name, *(f"{of[rms][name]:.0f} ({of[shaking][name]:.0f})" for of in found.values())]
        for name in names
    ]
    return ["RMS with the ideal joint, N (of the shaking force)", *found], rows


def long_runs(result: dict) -> tuple[list[str], list[list[str]]]:
    """Headings and rows of the table of confirmations."""
    found = result["long_runs"]
    rows = [
        [f"{start} start", *(_long_run(runs[start]) for runs in found.values())] for start in STARTS
    ]
    turns = result["settings"]["settle"]
    return [f"RMS over {turns} turns after {turns}, N (of the shaking force)", *found], rows


def _long_run(run: dict) -> str:
    """An RMS with its standard error, that of the shaking force, and what is wrong with them."""
    if not run["success"]:
        return "failed"
    wrong = ["friction whirl"] if run["whirl"] else []
    wrong += Validity(**run["validity"]).remarks()
    text = f"{run['foundation_rms']:.0f} ± {run['foundation_rms_error']:.1f}"
    return ", ".join([f"{text} ({run['shaking_rms']:.0f})", *wrong])


def robust(result: dict) -> tuple[list[str], list[list[str]]]:
    """Headings and rows of the table of tolerances."""
    sigmas = result["settings"]["sigmas"]
    rows = []
    for name, column in result["robust"]["values"].items():
        values = np.array(column, dtype=float)
        rows.append(
            [
                name,
                f"{values.mean():.1f}",
                f"{values.std():.1f}",
                f"{values.mean() + sigmas * values.std():.1f}",
                f"{values.max():.1f}",
                f"{np.mean(result['robust']['shaking'][name]):.1f}",
            ]
        )
    headings = ("mean, N", "spread, N", f"mean + {sigmas:g} spreads, N", "worst, N")
    return ["design", *headings, "mean of the shaking force, N"], rows


def headline(result: dict) -> str:
    """Return the RMS of both forces before and after; first, where they go different ways, that."""
    found = result["figures"]
    first = next(iter(found))
    before, after = found[first], found["optimised"]
    numbers = [
        f"{name}: {quantity(before[force], 'N')} before, {quantity(after[force], 'N')} after."
        for force, name in NAMES.items()
    ]
    return " ".join(filter(None, (opposed(before, after, f"{first}'s machine"), *numbers)))


def remarks(result: dict) -> list[str]:
    """Say what the optimum owes its force to."""
    chosen, found = result["designs"]["chosen"], result["figures"]
    rms, _ = FORCES
    first = next(iter(found))
    before, after = (chosen[name]["variants"][rms] for name in (first, "optimised"))
    old, new = found[first], found["optimised"]
    whole, standing = (before[key] - after[key] for key in (AS_IT_IS, STANDING))
    inertia = {
        name: [v[AS_IT_IS] - v[f"{name} of a slender rod"] for v in (before, after)]
        for name in ("J2", "J3")
    }
    lost = chosen["optimised"]["one_by_one"][rms]
    worst = sorted(lost, key=lambda name: -lost[name])[:3]
    bounds = [
        name
        for name, unit in zip(
            result["designs"]["bounds"], chosen["optimised"]["point"], strict=True
        )
        if min(unit, 1 - unit) < 1e-3
    ]
    return [
        f"Of {whole:.0f} N, {standing:.0f} N come from the machine standing (weight and load at "
        f"1 rad/s, {before[STANDING]:.0f} N before): |R_O| + |R_C| contains the weight. The RMS of "
        f"|R_C| goes from {old['toggle_rms']:.0f} to {new['toggle_rms']:.0f} N, that of |R_O| from "
        f"{old['bearing_rms']:.0f} to {new['bearing_rms']:.0f} N.",
        f"The ground feels the shaking force: its RMS goes from {old['shaking_rms']:.0f} to "
        f"{new['shaking_rms']:.0f} N. The variation of R_O + R_C, which holds the crushing load, "
        f"goes from {old['net_variation']:.0f} to {new['net_variation']:.0f} N.",
        f"The eccentricity goes from {1e3 * chosen[first]['eccentricity']:.2f} to "
        f"{1e3 * chosen['optimised']['eccentricity']:.2f} mm: other links give B the same "
        f"horizontal travel with less motion of the jaw (vertical travel of B "
        f"{1e3 * old['vertical_travel']:.1f} to {1e3 * new['vertical_travel']:.1f} mm). The upper "
        "end of the jaw moves less too; neither objective nor capacity counts that.",
        "Dearest to lose, one at a time: "
        + ", ".join(f"{name} ({lost[name]:.0f} N)" for name in worst)
        + ". The load acts at S2 and moves with the jaw's mass centre; without load the RMS falls "
        f"from {before['without load']:.0f} to {after['without load']:.0f} N.",
        f"Table 2's J2 adds {inertia['J2'][0]:.0f} N before and {inertia['J2'][1]:.0f} N after, J3 "
        f"{inertia['J3'][0]:.0f} and {inertia['J3'][1]:.0f} N, against slender rods; "
        f"the load adds {before[AS_IT_IS] - before['without load']:.0f} and "
        f"{after[AS_IT_IS] - after['without load']:.0f} N.",
        f"At a bound: {', '.join(bounds) or 'nothing'}. The counterweight is "
        f"{chosen['optimised']['counterweight_mass']:.1f} kg at "
        f"{chosen['optimised']['values']['counterweight.radius']:.3g} m, "
        f"{np.degrees(chosen['optimised']['counterweight_angle']) % 360:.0f} deg ahead of O-A.",
    ]

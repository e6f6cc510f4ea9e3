"""The design study in tables and words."""

import numpy as np
from rich.console import Console
from rich.table import Table

import jaxcrusher as jc
from optimize.balance_evidence import AS_IT_IS, STANDING, STARTS
from optimize.compare import METHODS, Search, spent_until

# A search has arrived when this share of the gain of the best one is all it still lacks.
ARRIVED = 1e-3
# Name, unit and factor of the rows of the table of designs.
UNITS = {
    "counterweight.moment_along": ("kg m", 1.0), "counterweight.moment_across": ("kg m", 1.0),
    "counterweight.radius": ("m", 1.0), "jaw.mass_centre_distance": ("m", 1.0),
    "jaw.mass_centre_angle": ("deg", 180 / np.pi), "toggle.length": ("m", 1.0),
    "bearing.distance": ("m", 1.0), "bearing.inclination": ("deg", 180 / np.pi),
    "jaw.length": ("m", 1.0),
}  # fmt: skip
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


def by_method(result: dict) -> dict[str, list[Search]]:
    """The searches that found a number, under each method."""
    searches = [Search(**found) for found in result["searches"]]
    return {method: [s for s in searches if s.method == method and s.best] for method in METHODS}


def comparison(result: dict) -> tuple[list[str], list[list[str]]]:
    """Headings and rows of the table of methods."""
    scale, spent = result["cost"]["scale"], _spent(result)
    rows = []
    for method, found in by_method(result).items():
        if not found:
            rows.append([method] + ["none"] * 7)
            continue
        end = scale * np.array([s.best[-1] for s in found])
        work, seconds = spent[method]
        rows.append([
            method, f"{np.median(end):.2f}", f"{end.min():.2f} to {end.max():.2f}",
            f"{np.isfinite(work).sum()} of {len(found)}", _range(work), _range(seconds, 2),
            f"{np.median([s.evaluations for s in found]):.0f}",
            f"{np.median([s.steps for s in found]):.0f}",
        ])  # fmt: skip
    headings = ["method", "RMS at the end, N: median", "range", "arrived",
                "work until then, values: median (range)", "CPU seconds until then",
                "evaluations", "integration steps"]  # fmt: skip
    return headings, rows


def _spent(result: dict) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Work and CPU seconds of each search until it arrived; infinite where it never did."""
    grouped = by_method(result)
    goal = _goal(grouped)
    return {
        method: (np.array([spent_until(s, s.work, goal) for s in found]),
                 np.array([spent_until(s, s.seconds, goal) for s in found]))
        for method, found in grouped.items() if found
    }  # fmt: skip


def _goal(grouped: dict[str, list[Search]]) -> float:
    """The value at which a search has arrived; the paper's machine has 1."""
    least = min(s.best[-1] for found in grouped.values() for s in found)
    return least + ARRIVED * max(1 - least, 0)


def verdict(result: dict) -> str:
    """Who arrives with the least work and in the least time, in words."""
    spent = {name: [_median(v) for v in both] for name, both in _spent(result).items()}
    by_work, by_time = (sorted(spent, key=lambda name, i=i: spent[name][i]) for i in (0, 1))

    def ranked(order: list[str], i: int, digits: int) -> str:
        return ", ".join(
            f"{name} {spent[name][i]:.{digits}f}" if np.isfinite(spent[name][i])
            else f"{name} never" for name in order
        )  # fmt: skip

    cost = result["cost"]["gradient_seconds"] / result["cost"]["value_seconds"]
    gradients = spent.get("L-BFGS-B", [float("inf")])[0] / cost
    text = (
        f"Ranked by median work until arrival: {ranked(by_work, 0, 0)} values. By CPU time: "
        f"{ranked(by_time, 1, 2)} s."
    )
    if np.isfinite(gradients):
        text += f" The gradient search arrives after {gradients:.0f} gradients; what it spends"
        text += " is their cost."
    return text


def _range(values: np.ndarray, digits: int = 0) -> str:
    """Median and range; a search that never arrived counts as infinite."""
    low, middle, high = (f"{v:.{digits}f}" if np.isfinite(v) else "never"
                         for v in (values.min(), _median(values), values.max()))  # fmt: skip
    return f"{middle} ({low} to {high})"


def _median(values: np.ndarray) -> float:
    """The median with infinities among the values."""
    ordered = np.sort(values)
    return float(ordered[[(len(values) - 1) // 2, len(values) // 2]].max())


def designs(result: dict) -> tuple[list[str], list[list[str]]]:
    """Headings and rows of the table of parameters."""
    chosen, bounds = result["designs"]["chosen"], result["designs"]["bounds"]
    rows = []
    for name, (low, high) in bounds.items():
        unit, factor = UNITS[name]
        cells = [f"{name}, {unit}", f"{factor * low:.4g} to {factor * high:.4g}"]
        for design in chosen.values():
            position = design["point"][list(bounds).index(name)]
            at = " (bound)" if min(position, 1 - position) < 1e-3 else ""
            cells.append(f"{factor * design['values'][name]:.4g}{at}")
        lost = chosen["optimised"]["one_by_one"][name]
        rows.append([*cells, f"{lost:.0f}"])
    for key, label in (("eccentricity", "eccentricity that follows, m"),
                       ("counterweight_mass", "counterweight that follows, kg"),
                       ("capacity", "capacity, m3/h")):  # fmt: skip
        rows.append([label, "", *(f"{round(d[key], 6):.4g}" for d in chosen.values()), ""])
    return ["parameter", "bounds", *chosen, "RMS added if it alone goes back, N"], rows


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
    chosen = result["designs"]["chosen"]
    names = next(iter(chosen.values()))["variants"]
    rows = [[name, *(f"{d['variants'][name]:.0f}" for d in chosen.values())] for name in names]
    return ["RMS with the ideal joint, N", *chosen], rows


def long_runs(result: dict) -> tuple[list[str], list[list[str]]]:
    """Headings and rows of the table of confirmations."""
    found = result["long_runs"]
    rows = [
        [f"{start} start", *(_long_run(runs[start]) for runs in found.values())]
        for start in STARTS
    ]  # fmt: skip
    turns = result["options"]["settle"]
    return [f"RMS over {turns} turns after {turns}, N", *found], rows


def _long_run(run: dict) -> str:
    """An RMS with its standard error, and what is wrong with it."""
    if not run["success"]:
        return "failed"
    wrong = ["friction whirl"] if run["whirl"] else []
    wrong += jc.Validity(**run["validity"]).remarks()
    return ", ".join([f"{run['foundation_rms']:.0f} ± {run['foundation_rms_error']:.1f}", *wrong])


def robust(result: dict) -> tuple[list[str], list[list[str]]]:
    """Headings and rows of the table of tolerances."""
    sigmas = result["options"]["sigmas"]
    rows = []
    for name, column in result["robust"]["values"].items():
        values = np.array(column, dtype=float)
        rows.append([name, f"{values.mean():.1f}", f"{values.std():.1f}",
                     f"{values.mean() + sigmas * values.std():.1f}",
                     f"{values.max():.1f}"])  # fmt: skip
    return ["design", "mean, N", "spread, N", f"mean + {sigmas:g} spreads, N", "worst, N"], rows


def remarks(result: dict) -> list[str]:
    """What the optimum owes its force to, in words."""
    chosen, found = result["designs"]["chosen"], result["figures"]
    before, after = (chosen[name]["variants"] for name in ("paper", "optimised"))
    old, new = found["paper"], found["optimised"]
    whole, standing = (before[key] - after[key] for key in (AS_IT_IS, STANDING))
    inertia = {name: [v[AS_IT_IS] - v[f"{name} of a slender rod"] for v in (before, after)]
               for name in ("J2", "J3")}  # fmt: skip
    lost = chosen["optimised"]["one_by_one"]
    worst = sorted(lost, key=lambda name: -lost[name])[:3]
    bounds = [name for name, unit in zip(result["designs"]["bounds"],
                                         chosen["optimised"]["point"], strict=True)
              if min(unit, 1 - unit) < 1e-3]  # fmt: skip
    return [
        f"Of {whole:.0f} N, {standing:.0f} N come from the machine standing (weight and load at "
        f"1 rad/s, {before[STANDING]:.0f} N before): |R_O| + |R_C| contains the weight. The RMS of "
        f"|R_C| goes from {old['toggle_rms']:.0f} to {new['toggle_rms']:.0f} N, that of |R_O| from "
        f"{old['bearing_rms']:.0f} to {new['bearing_rms']:.0f} N.",
        f"What shakes falls more: the shaking force from {old['shaking_rms']:.0f} to "
        f"{new['shaking_rms']:.0f} N, the variation of R_O + R_C from {old['net_variation']:.0f} "
        f"to {new['net_variation']:.0f} N.",
        f"The eccentricity goes from {1e3 * chosen['paper']['eccentricity']:.2f} to "
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


def print_tables(console: Console, result: dict) -> None:
    """The methods, the designs and their forces."""
    for make in (comparison, designs, forces, long_runs, origins, robust):
        headings, rows = make(result)
        table = Table()
        for i, heading in enumerate(headings):
            table.add_column(heading.replace("\\", ""), justify="right" if i else "left")
        for row in rows:
            table.add_row(*(cell.replace("\\", "") for cell in row))
        console.print(table)


def markdown(result: dict) -> str:
    """The study as a page."""
    options, cost = result["options"], result["cost"]
    gain = result["figures"]["paper"]["foundation_rms"]
    least = result["figures"]["optimised"]["foundation_rms"]
    ratio = cost["gradient_seconds"] / cost["value_seconds"]
    wide = dict(zip(("clearance", "friction", "load"), options["tolerance"], strict=True))
    parts = [
        "# Counterweight and links that shake the foundation least",
        f"Made by `{result['command']}`. Speed {options['speed']:g} rad/s, clearance "
        f"{options['clearance']:g} mm, load and joint as in the paper; nine free parameters. The "
        "eccentricity follows from the rest so that the jaw's lower end B keeps its horizontal "
        "travel; with the same discharge opening (set by moving C, as on the machine) and the "
        "same speed, the capacity by laminating crushing theory is the same too.",
        f"RMS of |R_O| + |R_C|: {gain:.0f} N before, {least:.0f} N after.",
        "![best so far, forces and power](balance.png)",
        "## The searches",
        f"{options['starts']} random starts, the same for each method, at most "
        f"{options['budget']} values of work each. A value ({options['turns']} turns, "
        f"{cost['value_steps']} steps) took {1e3 * cost['value_seconds']:.1f} ms of CPU time, a "
        f"gradient by all parameters ({cost['gradient_steps']} steps with tangents) "
        f"{1e3 * cost['gradient_seconds']:.1f} ms: it counts as {ratio:.1f} values. Arrived: "
        f"within {ARRIVED:.1%} of the gain of the best search. Seconds include the method's own.",
        _table(*comparison(result)),
        verdict(result),
        "## The designs",
        _table(*designs(result)),
        "The counterweight is given by its first moment about O, along and across O-A; its radius "
        "then only decides its weight, and goes to its bound.",
        "## What the search exploits",
        "\n".join(f"- {remark}" for remark in remarks(result)),
        "## Forces",
        _table(*forces(result)),
        _table(*long_runs(result)),
        "## What the force is made of",
        _table(*origins(result)),
        "## Tolerances",
        f"{options['samples']} conditions, the same for each design, uniform within "
        + ", ".join(f"±{100 * width:g} % of {name}" for name, width in wide.items())
        + f"; the robust design has the least mean + {options['sigmas']:g} spreads "
        f"({result['robust']['gradients']} gradients of all conditions, from the optimum).",
        _table(*robust(result)),
    ]
    return "\n\n".join(parts) + "\n"


def _table(headings: list[str], rows: list[list[str]]) -> str:
    lines = [headings, ["---", *["---:"] * (len(headings) - 1)], *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)

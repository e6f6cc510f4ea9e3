"""The page and its tables, all of it computed from the rows."""

import math
from pathlib import Path

from benchmarks.setting import setting
from benchmarks.step_cost import fewer, profile, programs
from jaxcrusher.files.provenance import command
from jaxcrusher.files.results import write_table, write_text
from jaxcrusher.lanes.code import WIDTH

OURS, TURN = "jaxcrusher, lanes", "jaxcrusher, `lax.map`"
VMAP = "`jax.vmap` over `jaxcrusher.statistics`"
PLAIN = "`lax.map` over `diffrax.diffeqsolve`"
NUMBA = "numba, scalar"
C = {"C, scalar": 1, "C, 8 lanes": 8, "C, 16 lanes": 16, "C, 32 lanes": 32}
# The aims: a step of these takes at least so many of ours.
GOALS = ((NUMBA, 4.0), (VMAP, 8.0), ("C, 16 lanes", 1.0))
# Relative errors of the RMS at which methods are compared.
ERRORS = (1e-3, 1e-4, 1e-6)


def write(
    folder: Path,
    costs: list[dict],
    counted: dict,
    evaluation: float,
    instructions: dict,
    of_lanes: float,
    steps: list[dict],
    doubt: dict,
) -> str:
    """Write step_cost.md and its two csv files; returns the page."""
    where = setting("numba")
    for name, rows in (("step_cost", costs), ("step_cost_steps", steps)):
        write_table(folder / f"{name}.csv", rows, where)
    page = (
        "\n".join(
            [
                "# What a step costs",
                "",
                f"Made by `{command()}`; not edited by hand. All numbers:",
                "[step_cost.csv](step_cost.csv), [step_cost_steps.csv](step_cost_steps.csv).",
                f"Measured on {where}.",
                "",
                *_cost_lines(costs),
                *_lanes_lines(instructions, of_lanes, costs),
                *_profile_lines(counted, evaluation, costs),
                *_steps_lines(steps, doubt),
            ]
        )
        + "\n"
    )
    write_text(folder / "step_cost.md", page)
    return page


def _cost_lines(costs: list[dict]) -> list[str]:
    lines = [
        "64 crushers round 30 rad/s and 0.06 mm, one core, a process for each motion with and",
        "without XLA's loop flag (`jaxcrusher.set_up`). Dopri5, PI 0.4, 0.3, tolerance",
        f"{programs.RTOL:g}, steps accepted and rejected. Microseconds a step, medians of repeats",
        "taken in turn; *numbas* is CPU time in units of the scalar program for numba in the same",
        "process, which takes the machine's mood out. *RMS* is the largest relative difference to",
        "numba's over the crushers; impacting motions part, and theirs means nothing.",
        "",
        "| motion | program | XLA | wall us | CPU us | numbas | trace + compile s | steps | RMS |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for row in costs:
        compiled = f"{row['first_s']:.1f}" if row["program"] in (OURS, TURN, VMAP, PLAIN) else ""
        differs = f"{row['difference']:.1e}" if row["motion"] == "quiet" else ""
        lines.append(
            f"| {row['motion']} | {row['program']} | {row['XLA']} | {row['wall_us']:.2f} | "
            f"{row['cpu_us']:.2f} | {row['in_numba']:.2f} | {compiled} | {row['steps']} | "
            f"{differs} |"
        )
    lines += ["", "Aims, in CPU time of a step:", ""]
    for motion in dict.fromkeys(row["motion"] for row in costs):
        least = _least(costs, motion)
        for name, factor in GOALS:
            if name in least:
                ratio = least[name] / least[OURS]
                verdict = "met" if ratio >= factor else "not met"
                lines.append(
                    f"- {motion}: {name} takes {ratio:.2f} of ours; aim: at least {factor:g}: "
                    f"{verdict}."
                )
    return [*lines, ""]


def _least(costs: list[dict], motion: str) -> dict[str, float]:
    """Of each program with and without the flag, in units of numba."""
    least: dict[str, float] = {}
    for row in costs:
        if row["motion"] == motion:
            name = row["program"]
            least[name] = min(row["in_numba"], least.get(name, math.inf))
    return least


def _lanes_lines(instructions: dict, evaluation: float, costs: list[dict]) -> list[str]:
    step = min(r["cpu_us"] for r in costs if (r["motion"], r["program"]) == ("quiet", OURS))
    share = 6e-3 * evaluation / step
    counted = ", ".join(f"{count} {kind}" for kind, count in instructions.items())
    return [
        "## What lanes do",
        "",
        f"Arithmetic of the machine code of the field, of {WIDTH} designs at once: {counted}.",
        f"An evaluation takes {evaluation:.1f} ns a design; six are {share:.0%} of a step of "
        f"{step:.3f} us",
        "on the quiet motion, and the stepper takes the rest.",
        "",
    ]


def _profile_lines(counted: dict, evaluation: float, costs: list[dict]) -> list[str]:
    heads = [*counted, "an evaluation by hand"]
    columns = [*counted.values(), profile.BY_HAND]
    lines = [
        "## What the compiled program does",
        "",
        "Operations of XLA's program with the loop flag. A stage evaluates the equations of motion",
        "once; a step of Dopri5 has six stages. XLA computes a value again in every fusion that",
        "needs it; LLVM then merges some of these, so more operations here are not all lost time.",
        "",
        f"| | {' | '.join(heads)} |",
        "|---|" + "---|" * len(heads),
    ]
    for operation in profile.COSTLY:
        cells = [str(column[operation]) if operation in column else "" for column in columns]
        lines.append(f"| {operation} | {' | '.join(cells)} |")
    step = min(r["cpu_us"] for r in costs if (r["motion"], r["program"]) == ("quiet", TURN))
    lines += [
        "",
        f"One evaluation alone, in a loop of XLA's, takes {evaluation:.3f} us of CPU time; six are",
        f"{6 * evaluation / step:.0%} of a step by `lax.map` on the quiet motion ({step:.2f} us).",
    ]
    least = _least(costs, "quiet")
    by_hand = ", ".join(f"{name} {least[name]:.2f}" for name in C if name in least)
    if by_hand:
        lines += ["", f"By hand the quiet motion takes, in numbas a step: {by_hand};"]
        lines += [f"ours in lanes {least[OURS]:.2f}."]
    return [*lines, ""]


def _steps_lines(rows: list[dict], doubt: dict) -> list[str]:
    limits = [(motion, error) for motion in fewer.MOTIONS for error in ERRORS]
    doubts = ", ".join(f"{motion} {value:.0e}" for motion, value in doubt.items())
    lines = [
        "## Fewer steps at equal error",
        "",
        "Least evaluations of the equations a turn (steps in brackets) with which the RMS is right",
        "to a relative error, over the tolerances "
        f"{', '.join(f'{t:g}' for t in fewer.TOLERANCES)} and {', '.join(map(str, fewer.FIXED))}",
        "fixed steps a turn; - where none is, bold the least of all. References at "
        f"{fewer.REFERENCE:g} by Dopri8 and",
        f"Tsit5 differ by {doubts}. Two turns of the quiet motion and 20 ms of impacts, 30 rad/s,",
        "0.06 mm.",
        "",
        "| solver | controller | " + " | ".join(f"{m}, {e:g}" for m, e in limits) + " |",
        "|---|---|" + "---|" * len(limits),
    ]
    least: dict[tuple, dict] = {}
    for motion, error in limits:
        good = [row for row in rows if row["motion"] == motion and row["error"] <= error]
        for row in sorted(good, key=lambda row: row["evaluations"]):
            for who in (None, (row["solver"], row["controller"])):
                least.setdefault((who, motion, error), row)
    for who in dict.fromkeys((row["solver"], row["controller"]) for row in rows):
        cells = []
        for limit in limits:
            best = least.get((who, *limit))
            cell = f"{best['evaluations']:.0f} ({best['steps']:.0f})" if best else "-"
            cells.append(f"**{cell}**" if best and best is least[None, *limit] else cell)
        lines.append(f"| {' | '.join((*who, *cells))} |")
    return lines

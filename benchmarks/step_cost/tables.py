"""The tables of the page step_cost.md, all of them computed from rows."""

import math
from collections.abc import Iterable, Mapping
from typing import Any

from benchmarks.pages import table
from benchmarks.step_cost import fewer, profile

OURS, TURN = "jaxcrusher, lanes", "jaxcrusher, `lax.map`"
VMAP = "`jax.vmap` over `jaxcrusher.statistics`"
PLAIN = "`lax.map` over `diffrax.diffeqsolve`"
NUMBA = "numba, scalar"
C = {"C, scalar": 1, "C, 8 lanes": 8, "C, 16 lanes": 16, "C, 32 lanes": 32}
# The aims: a step of these takes at least so many of ours.
GOALS = ((NUMBA, 4.0), (VMAP, 8.0), ("C, 16 lanes", 1.0))
# Relative errors of the RMS at which methods are compared.
ERRORS = (1e-3, 1e-4, 1e-6)
UNITS = ("CPU us", "numbas", "trace + compile s", "RMS")
Rows = Iterable[Mapping[str, Any]]


def cost_tables(costs: list[dict[str, Any]]) -> dict[str, str]:
    """Return the table of costs, and that of the aims in CPU time of a step."""
    cells = []
    for row in costs:
        compiled = f"{row['first_s']:.1f}" if row["program"] in (OURS, TURN, VMAP, PLAIN) else ""
        differs = f"{row['difference']:.1e}" if row["motion"] == "quiet" else ""
        times = (f"{row[name]:.2f}" for name in ("cpu_us", "in_numba"))
        labels = row["motion"], row["program"], row["XLA"]
        cells.append([*labels, *times, compiled, differs])
    aims = []
    for motion in dict.fromkeys(row["motion"] for row in costs):
        least = _least(costs, motion)
        for name, factor in GOALS:
            if name in least:
                ratio = least[name] / least[OURS]
                verdict = "met" if ratio >= factor else "**not met**"
                aims.append([motion, name, f"{ratio:.2f}", f"{factor:g}", verdict])
    return {
        "costs": table(("motion", "program", "XLA", *UNITS), cells),
        "aims": table(("motion", "program", "steps of ours", "aim, at least", "verdict"), aims),
    }


def _least(costs: Rows, motion: str) -> dict[str, float]:
    """Return the CPU time of each program, the better with and without the flag, in numbas."""
    least: dict[str, float] = {}
    for row in costs:
        if row["motion"] == motion:
            name = row["program"]
            least[name] = min(row["in_numba"], least.get(name, math.inf))
    return least


def profile_tables(found: Mapping[str, Any], costs: Rows) -> dict[str, str]:
    """Return tables of operations, machine instructions, and the time of one evaluation."""
    counted = {**found["operations"], "an evaluation by hand": profile.BY_HAND}
    operations = [[what, *(of.get(what, "") for of in counted.values())] for what in profile.COSTLY]
    evaluations = []
    for name, program in (("lanes", OURS), ("XLA, one after the other", TURN)):
        of = (r["cpu_us"] for r in costs if (r["motion"], r["program"]) == ("quiet", program))
        step, one = 1e3 * min(of), found["nanoseconds"][name]
        evaluations.append([name, f"{one:.1f}", f"{step:.0f}", f"{6 * one / step:.0%}"])
    heads = ("program", "an evaluation, ns", "a step, ns", "six evaluations of a step")
    return {
        "instructions": table(("arithmetic", "instructions"), found["instructions"].items()),
        "operations": table(("operation", *counted), operations),
        "evaluations": table(heads, evaluations),
    }


def steps_tables(rows: list[dict[str, Any]], doubt: Mapping[str, float]) -> dict[str, str]:
    """Return the fewest evaluations at equal error, and the references' difference."""
    limits = [(motion, error) for motion in fewer.MOTIONS for error in ERRORS]
    least: dict[tuple, Mapping[str, Any]] = {}
    for motion, error in limits:
        good = [row for row in rows if row["motion"] == motion and row["error"] <= error]
        for row in sorted(good, key=lambda row: row["evaluations"]):
            for who in (None, (row["solver"], row["controller"])):
                least.setdefault((who, motion, error), row)
    lines = []
    for who in dict.fromkeys((row["solver"], row["controller"]) for row in rows):
        cells = []
        for limit in limits:
            best = least.get((who, *limit))
            cell = f"{best['evaluations']:.0f} ({best['steps']:.0f})" if best else "-"
            cells.append(f"**{cell}**" if best and best is least[None, *limit] else cell)
        lines.append([*who, *cells])
    heads = ("solver", "controller", *(f"{motion}, {error:g}" for motion, error in limits))
    apart = [[motion, f"{value:.0e}"] for motion, value in doubt.items()]
    return {"steps": table(heads, lines), "references": table(("motion", "difference"), apart)}

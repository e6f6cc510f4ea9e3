"""The costs of all programs on two motions, their tables and page."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from benchmarks.pages import publish, table
from benchmarks.step_cost import programs
from jaxcrusher.files.progress import progress
from jaxcrusher.files.results import results_folder

# Start and whole turns. With the slip of the surfaces the centred start ends in the whirl.
MOTIONS: dict[str, tuple[programs.Start, int]] = {
    "quiet": ("contact", 2),
    "impacting": ("centred", 1),
}
OURS, TURN = "jaxcrusher, lanes", "jaxcrusher, `lax.map`"
VMAP = "`jax.vmap` over `jaxcrusher.statistics`"
NUMBA = "numba, scalar"
# The aims: a step of these takes at least as long as so many of ours.
AIMS = {NUMBA: 4.0, VMAP: 8.0}
UNITS = ("CPU us", "numbas", "trace + compile s", "RMS")


def costs(motion: str) -> list[dict[str, Any]]:
    """Return the cost of a step of each program on a motion, CPU time in microseconds."""
    designs = programs.designs(*MOTIONS[motion])
    asked = {
        OURS: programs.in_lanes(designs),
        TURN: programs.in_turn(designs),
        VMAP: programs.vmap(designs),
        NUMBA: programs.numba(designs),
    }
    measured = programs.costs(asked, 5)
    numba = measured[NUMBA]
    return [
        {
            "motion": motion,
            "program": name,
            "cpu_us": 1e6 * cost.cpu,
            "in_numba": cost.cpu / numba.cpu,
            "first_s": cost.first,
            "steps": int(cost.found.steps.sum()),
            "difference": float(abs(cost.found.rms / numba.found.rms - 1).max()),
        }
        for name, cost in measured.items()
    ]


def tables(rows: Sequence[dict[str, Any]]) -> dict[str, str]:
    """Return the table of costs, and that of the aims in CPU time of a step."""
    cells = []
    for row in rows:
        compiled = "" if row["program"] == NUMBA else f"{row['first_s']:.1f}"
        differs = f"{row['difference']:.1e}" if row["motion"] == "quiet" else ""
        times = (f"{row[name]:.2f}" for name in ("cpu_us", "in_numba"))
        cells.append([row["motion"], row["program"], *times, compiled, differs])
    aims = []
    for motion in MOTIONS:
        cost = {row["program"]: row["in_numba"] for row in rows if row["motion"] == motion}
        for name, aim in AIMS.items():
            ratio = cost[name] / cost[OURS]
            verdict = "met" if ratio >= aim else "**not met**"
            aims.append([motion, name, f"{ratio:.2f}", f"{aim:g}", verdict])
    return {
        "costs": table(("motion", "program", *UNITS), cells),
        "aims": table(("motion", "program", "steps of ours", "aim, at least", "verdict"), aims),
    }


def run(out: Path) -> None:
    """Measure every program; write the page and its data."""
    folder, rows = results_folder(out), []
    with progress() as bars:
        for motion in bars.track(MOTIONS, description="motions"):
            rows += costs(motion)
    publish(folder, "step_cost.md", tables(rows), "numba", rows=rows)

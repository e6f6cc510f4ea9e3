"""Every measurement in a process of its own, one after the other; their tables and page."""

import os
from pathlib import Path

from rich.console import Console

from benchmarks.pages import publish
from benchmarks.peers import c_peer
from benchmarks.setting import run_apart, setting
from benchmarks.step_cost.measure import MOTIONS
from benchmarks.step_cost.tables import cost_tables, profile_tables, steps_tables
from jaxcrusher.files.progress import progress
from jaxcrusher.files.results import results_folder, write_json, write_table

COSTS = [("costs", motion, flag) for flag in ("loop flag", "no flag") for motion in MOTIONS]
JOBS = [*COSTS, ("profiled",), ("steps",)]


def run(out: Path) -> None:
    """Run every measurement; write the page, its tables and their data."""
    folder, console = results_folder(out), Console()
    if c_peer.missing():
        console.print(f"The programs in C are left out: {c_peer.missing()}.")
    if not hasattr(os, "sched_setaffinity"):
        console.print("This system does not pin a process to a core: times may be of several.")
    found = {}
    with progress(console) as bars:
        for job in bars.track(JOBS, description="measurements"):
            # Without the flag nothing else is set; one core means one device anyway.
            bare = ["--bare"] if "no flag" in job else []
            words = ["benchmarks.step_cost.measure", *job, *bare]
            found[job] = list(run_apart("benchmarks.worker", *words, cores=1))
    costs = [row for job in COSTS for row in found[job]]
    (profile,), (*steps, doubt) = found[JOBS[-2]], found[JOBS[-1]]
    write_table(folder / "step_cost_steps.csv", steps, setting("numba"))
    write_json(folder / "step_cost_profile.json", {"profile": profile, "references": doubt})
    tables = cost_tables(costs) | profile_tables(profile, costs) | steps_tables(steps, doubt)
    publish(folder, "step_cost.md", tables, "numba", rows=costs)

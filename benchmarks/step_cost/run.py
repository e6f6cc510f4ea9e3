"""Every measurement in a process of its own, one after the other, and what becomes of them."""

import os
from pathlib import Path

from rich.console import Console

from benchmarks.peers import c_peer
from benchmarks.setting import run_apart
from benchmarks.step_cost import report
from benchmarks.step_cost.measure import MOTIONS
from jaxcrusher.files.progress import progress
from jaxcrusher.files.results import results_folder

COSTS = [("costs", motion, flag) for flag in ("loop flag", "no flag") for motion in MOTIONS]
JOBS = [*COSTS, ("profile", "quiet", "loop flag"), ("fewer", "", "loop flag")]


def run(out: Path) -> None:
    """Run every measurement, and write page and tables."""
    folder, console = results_folder(out), Console()
    if c_peer.missing():
        console.print(f"The programs in C are left out: {c_peer.missing()}.")
    if not hasattr(os, "sched_setaffinity"):
        console.print("This system does not pin a process to a core: times may be of several.")
    found = {}
    with progress(console) as bars:
        for job in JOBS:
            bar = bars.add_task(", ".join(part for part in job if part), total=None)
            for said in run_apart("benchmarks.step_cost.worker", *job, cores=1):
                if "answer" in said:
                    found[job] = said["answer"]
                else:
                    bars.update(bar, completed=said["done"], total=said["total"])
    costs = [row for job in COSTS for row in found[job]]
    console.print(report.write(folder, costs, *found[JOBS[-2]], *found[JOBS[-1]]))

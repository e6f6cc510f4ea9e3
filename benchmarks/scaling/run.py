"""Every measurement in a process of its own; their table, figure and page."""

from pathlib import Path
from typing import Any

from benchmarks.pages import publish
from benchmarks.scaling.measure import DESIGNS, DIFFERENTIATED, METHODS, SWEEP_SIDES, TURNS
from benchmarks.scaling.tables import figure, tables
from benchmarks.setting import run_apart, setting
from jaxcrusher.files.progress import progress
from jaxcrusher.files.results import results_folder, write_table

# The measurements, and their cores.
BATCHES = {"designs": len(DESIGNS), "turns": len(TURNS), "sweeps": len(SWEEP_SIDES)}
JOBS = (*((what, cores) for what in BATCHES for cores in (1, 2)), *((m, 1) for m in METHODS))


def run(out: Path) -> None:
    """Run every job; write the rows so far after each one."""
    folder = results_folder(out)
    rows: list[dict[str, Any]] = []
    with progress() as bars:
        total = sum(BATCHES.get(what, len(DIFFERENTIATED)) for what, _ in JOBS)
        task = bars.add_task("scaling", total=total)
        for what, cores in JOBS:
            job = "benchmarks.scaling.measure", "measure", what
            for row in run_apart("benchmarks.worker", *job, cores=cores):
                rows.append({"what": what, "cores": cores} | row)
                write_table(folder / "scaling.csv", rows, setting("numba"))
                bars.advance(task)
    publish(folder, "scaling.md", tables(rows), "numba", draw=lambda: figure(rows))

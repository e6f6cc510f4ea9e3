"""Every measurement in a process of its own, and what becomes of them."""

from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt

from benchmarks.scaling.measure import DESIGNS, DIFFERENTIATED, METHODS, SWEEP_SIDES, TURNS
from benchmarks.scaling.page import figure, page
from benchmarks.setting import run_apart, setting
from jaxcrusher.files.progress import progress
from jaxcrusher.files.results import results_folder, write_figure, write_table, write_text
from jaxcrusher.pictures.page import STYLE

# What to measure, and on how many cores.
JOBS = (
    *(("designs", cores) for cores in (1, 2)),
    *(("turns", cores) for cores in (1, 2)),
    *(("sweeps", cores) for cores in (1, 2)),
    *((method, 1) for method in METHODS),
)
ROWS = {"designs": len(DESIGNS), "turns": len(TURNS), "sweeps": len(SWEEP_SIDES)}


def run(out: Path) -> None:
    """Run every job; write what has come after each row."""
    folder = results_folder(out)
    rows: list[dict[str, Any]] = []
    with progress() as bars:
        total = sum(ROWS.get(what, len(DIFFERENTIATED)) for what, _ in JOBS)
        task = bars.add_task("scaling", total=total)
        for what, cores in JOBS:
            for row in run_apart("benchmarks.scaling.worker", what, cores=cores):
                rows.append({"what": what, "cores": cores} | row)
                write_table(folder / "scaling.csv", rows, setting("numba"))
                bars.advance(task)
    with plt.rc_context(STYLE):
        write_figure(folder / "scaling.png", figure(rows))
    write_text(folder / "scaling.md", page(rows, setting("numba")))
    print((folder / "scaling.md").read_text(encoding="utf-8"))

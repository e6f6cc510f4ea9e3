"""All comparisons, on the screen and as a page."""

import time
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from benchmarks.comparison import Comparison, table_of
from benchmarks.crosschecks import clearance, longrun, loose, pointwise, programs
from benchmarks.crosschecks.tables import rows, summary
from benchmarks.pages import publish, table
from jaxcrusher.files.progress import progress
from jaxcrusher.files.results import results_folder

CASES = {
    "instants": pointwise.instants,
    "ideal": pointwise.ideal,
    "clearance": clearance.clearance,
    "smoothing": clearance.smoothing,
    "torque": pointwise.torque,
    "loose": loose.loose,
    "impacts": longrun.impacts,
    "swings": longrun.swings,
    "whirl": longrun.whirl,
}
PACKAGES = ("scipy", "numba", "scikit-sundae", "exudyn")


def run(names: Sequence[str], out: Path) -> None:
    """Run the named cases, or all and write the page."""
    folder = None if names else results_folder(out)
    begin = time.perf_counter()
    found: dict[str, list[Comparison]] = {}
    for name in names or CASES:
        with progress() as bars:
            found[name] = list(bars.track(CASES[name](), description=name))
        print(f"{name}:\n\n{table_of(found[name])}")
    compared = list(rows(found))
    print(summary(compared))
    if folder is not None:
        seconds = [[name, _rounded(spent)] for name, spent in programs.seconds.items()]
        tables = {
            "summary": summary(compared),
            "programs": table(("program", "all its runs, s"), seconds),
        }
        minutes = (time.perf_counter() - begin) / 60
        every = map(asdict, compared)
        publish(folder, "crosschecks.md", tables, *PACKAGES, rows=every, minutes=minutes)


def _rounded(spent: float) -> str:
    return f"{spent:.0f}" if spent < 10 else f"{round(spent, -1):.0f}"

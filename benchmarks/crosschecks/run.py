"""All comparisons, on the screen and as a page."""

import time
from collections.abc import Sequence
from pathlib import Path

from benchmarks.comparison import Comparison, table_of
from benchmarks.crosschecks import clearance, longrun, loose, pointwise, programs
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


def summary(found: dict[str, list[Comparison]]) -> str:
    """Return the table of how many comparisons of each case agree."""
    counts = [[name, sum(c.agrees for c in of), len(of)] for name, of in found.items()]
    total = ["all", *(sum(column) for column in zip(*(row[1:] for row in counts), strict=True))]
    return table(("case", "agree", "of"), [*counts, total])


def run(names: Sequence[str], out: Path) -> None:
    """Run the named cases, or all and write the page."""
    folder = None if names else results_folder(out)
    begin, found = time.perf_counter(), {}
    for name in names or CASES:
        with progress() as bars:
            found[name] = list(bars.track(CASES[name](), description=name))
        print(f"{name}:\n\n{table_of(found[name])}")
    print(summary(found))
    if folder is not None:
        seconds = [[name, _rounded(spent)] for name, spent in programs.seconds.items()]
        tables = {name: table_of(comparisons) for name, comparisons in found.items()} | {
            "summary": summary(found),
            "programs": table(("program", "all its runs above, s"), seconds),
        }
        minutes = (time.perf_counter() - begin) / 60
        publish(folder, "crosschecks.md", tables, *PACKAGES, minutes=minutes)


def _rounded(spent: float) -> str:
    return f"{spent:.0f}" if spent < 10 else f"{round(spent, -1):.0f}"

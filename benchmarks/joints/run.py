"""All machines, one group after the other; their table, figure and page."""

from collections.abc import Callable
from pathlib import Path

import jaxcrusher as jc
from benchmarks.joints.cases import ACROSS, ALONG, WORN, Case, alone, together
from benchmarks.joints.figure import draw
from benchmarks.joints.measure import Row, averages, settled, settled_with_slopes
from benchmarks.joints.tables import tables
from benchmarks.pages import publish
from jaxcrusher.files.progress import progress
from jaxcrusher.files.results import results_folder


def run(out: Path, slip: str) -> None:
    """Measure, write, print."""
    jc.set_up()
    folder, rows = results_folder(out), []
    with progress(remaining=False) as bars:
        bar = bars.add_task("", total=len(GROUPS))
        for name, group in GROUPS.items():
            bars.update(bar, description=name)
            rows += group(slip)
            bars.advance(bar)
    data = [flat(row) for row in rows]
    publish(folder, "which_joint.md", tables(rows), rows=data, draw=lambda: draw(rows))


def _settled(cases: list[Case], load: str) -> list[Row]:
    return [settled(case, load)[0] for case in cases]


# Friction matters where pins leave their bores; a periodic orbit in contact has no use for it.
GROUPS: dict[str, Callable[[str], list[Row]]] = {
    "load across the jaw, all loose": lambda slip: [
        settled_with_slopes(case, ACROSS) for case in together()
    ],
    "load along the jaw, all loose": lambda slip: averages(together(), ALONG, slip),
    "load along the jaw, A alone loose": lambda slip: _settled(alone("A"), ALONG),
    "load along the jaw, B alone loose": lambda slip: averages(alone("B"), ALONG, slip),
    "load along the jaw, C alone loose": lambda slip: averages(alone("C"), ALONG, slip),
    "load across the jaw, A alone loose": lambda slip: _settled(alone("A"), ACROSS),
    "load across the jaw, B alone loose": lambda slip: _settled(alone("B"), ACROSS),
    "load across the jaw, C alone loose": lambda slip: _settled(alone("C"), ACROSS),
}


def flat(row: Row) -> dict[str, float | str | int | None]:
    """Return a row of the csv: clearances in m, forces in N, speeds in m/s, powers in W."""
    return {
        "load": row.load,
        "worn": row.case.worn,
        **{f"clearance_{joint}": row.case.clearances.get(joint) for joint in WORN},
        "how": row.how,
        "inside": row.inside,
        "whirls": row.whirls,
        **row.values,
        **{f"{name}_error": error for name, error in row.errors.items()},
    }

"""All measurements, written as they come, and the page and figures made of them."""

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from benchmarks.pages import publish
from benchmarks.setting import setting
from benchmarks.work_precision import figure, ours
from benchmarks.work_precision.cases import cases, reference
from benchmarks.work_precision.measure import Compiled, Row, measured
from benchmarks.work_precision.others import peers
from benchmarks.work_precision.tables import references_table, tables
from jaxcrusher.basics.checks import require_choice
from jaxcrusher.files.progress import progress
from jaxcrusher.files.results import read_table, results_folder, write_figure, write_table

PACKAGES = ("scipy", "numba", "exudyn", "scikit-sundae")


def run(out: Path, scenes: Sequence[str], small: bool) -> None:
    """Measure and write; `small` takes a few settings only."""
    known, references, rows, compiled = cases(), {}, [], Compiled()
    for name in scenes:
        require_choice("scenes", name, tuple(known))
    chosen = [known[name] for name in scenes or known]
    folder, where = results_folder(out), setting(*PACKAGES)
    with progress() as bars:
        task = bars.add_task("references", total=0)
        for case in chosen:
            bars.update(task, description=f"{case.name}: reference")
            exact = references[case.name] = reference(case)
            runs = [*peers(case, small), *ours.runs(case, small)]
            bars.update(task, total=(bars.tasks[0].total or 0) + len(runs))
            for row in measured(case, exact, compiled, runs):
                rows.append(row)
                write_table(folder / "work_precision.csv", map(asdict, rows), where)
                told = f"{case.name}: {row.program}, {row.setting}"
                bars.update(task, advance=1, description=told)
    _draw(folder, rows)
    made = {"references": references_table(chosen, references), **tables(rows)}
    publish(folder, "work_precision.md", made, *PACKAGES)


def redraw(out: Path, table: Path) -> None:
    """Draw the figures of an earlier run's rows, without a measurement."""
    _draw(results_folder(out), read_table(table, Row))


def _draw(folder: Path, rows: list[Row]) -> None:
    write_figure(folder / "work_precision.png", figure.draw_first(rows))
    write_figure(folder / "work_precision_rest.png", figure.draw_rest(rows, "rms_error"))
    write_figure(folder / "work_precision_history.png", figure.draw_rest(rows, "history_error"))

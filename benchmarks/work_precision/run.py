"""All measurements, written as they come, and the page and figures made of them."""

from dataclasses import asdict
from pathlib import Path

from benchmarks.pages import publish
from benchmarks.setting import setting
from benchmarks.work_precision import figure, ours
from benchmarks.work_precision.cases import cases, reference
from benchmarks.work_precision.measure import Compiled, measured
from benchmarks.work_precision.others import peers
from benchmarks.work_precision.tables import references_table, tables
from jaxcrusher.files.progress import progress
from jaxcrusher.files.results import results_folder, write_figure, write_table

PACKAGES = ("scipy", "numba", "exudyn", "scikit-sundae")


def run(out: Path) -> None:
    """Measure, write and draw."""
    chosen, references, rows, compiled = list(cases().values()), {}, [], Compiled()
    folder, where = results_folder(out), setting(*PACKAGES)
    with progress() as bars:
        task = bars.add_task("references", total=0)
        for case in chosen:
            bars.update(task, description=f"{case.name}: reference")
            exact = references[case.name] = reference(case)
            runs = [*peers(case), *ours.runs(case)]
            bars.update(task, total=(bars.tasks[0].total or 0) + len(runs))
            for row in measured(case, exact, compiled, runs):
                rows.append(row)
                write_table(folder / "work_precision.csv", map(asdict, rows), where)
                told = f"{case.name}: {row.program}, {row.setting}"
                bars.update(task, advance=1, description=told)
    for name, drawn in (
        ("", figure.draw_first(rows)),
        ("_rest", figure.draw_rest(rows, "rms_error")),
        ("_history", figure.draw_rest(rows, "history_error")),
    ):
        write_figure(folder / f"work_precision{name}.png", drawn)
    made = {"references": references_table(chosen, references), **tables(rows)}
    publish(folder, "work_precision.md", made, *PACKAGES)

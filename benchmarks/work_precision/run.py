"""`python -m benchmarks.work_precision`: error against run time, for every program and scene.

Writes docs/work_precision.csv as it goes, then docs/work_precision.md and .png.
"""

from pathlib import Path

import tyro
from rich.progress import Progress

from benchmarks.work_precision import ours, report
from benchmarks.work_precision.cases import cases, reference
from benchmarks.work_precision.measure import Compiled, of_ours, of_peers
from benchmarks.work_precision.others import peers
from jaxcrusher.basics.setup import set_up


def main(
    out: Path = Path(__file__).parents[2] / "docs",
    scenes: tuple[str, ...] = (),
    small: bool = False,
) -> None:
    """Measure and write.

    Args:
        out: the folder to write to
        scenes: names of the scenes, all if none
        small: a few settings only, to try it
    """
    known, references, rows, compiled = cases(), {}, [], Compiled()
    chosen = [known[name] for name in scenes or known]
    table = report.Table(out / "work_precision.csv")
    with Progress() as progress:
        task = progress.add_task("references", total=None)
        for case in chosen:
            progress.update(task, description=f"{case.name}: reference")
            exact = references[case.name] = reference(case)
            programs, runs = list(peers(case, small)), list(ours.runs(case, small))
            progress.update(task, total=(progress.tasks[0].total or 0) + len(programs) + len(runs))
            for make in (of_peers(case, exact, programs), of_ours(case, exact, compiled, runs)):
                for row in make:
                    rows.append(row)
                    table.add(row)
                    progress.update(
                        task, advance=1, description=f"{case.name}: {row.program}, {row.setting}"
                    )
    found = report.page(chosen, references, rows)
    (out / "work_precision.md").write_text(found)
    report.draw(out / "work_precision.png", chosen, rows)
    print(found)


if __name__ == "__main__":
    set_up()
    tyro.cli(main)

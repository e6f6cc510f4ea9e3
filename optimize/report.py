"""The closing table of a search."""

from rich.console import Console
from rich.table import Table

import jaxcrusher as jc
from optimize import words
from optimize.answer import Answer
from optimize.evaluate import STARTS


def print_table(console: Console, answer: Answer) -> None:
    """The designs, the checks, and what to make of the answer."""
    objective, unit = answer.objective, answer.objective.unit
    table = Table(title=f"{objective.meaning}, {unit}")
    free = [f"{name}\n{jc.PARAMETERS[name].unit}" for name in answer.box.bounds]
    runs = [f"{start} start\n{unit}" for start in STARTS]
    for heading in ("", *free, *runs, "ideal RMS\nN", "capacity\nm3/h"):
        table.add_column(heading, justify="right" if heading else "left")
    for title, design in answer.designs.items():
        table.add_row(
            title,
            *(f"{value:.5g}" for value in design.values.values()),
            *(words.interval(design.runs[start]) for start in STARTS),
            f"{design.ideal_rms:.0f}",
            f"{design.capacity:.2f}",
        )
    console.print(table)

    def tell(line: str) -> None:
        console.print(line, highlight=False, markup=False)

    tell(words.error(answer))
    for title, design in answer.designs.items():
        tell(f"{title}: {words.regimes(design)}")
        tell(f"{title}: {words.limits(design)}")
    report = answer.gradient_report
    for name, slope in report.slopes.items() if report is not None else ():
        why = f" ({'; '.join(slope.reasons)})" if slope.reasons else ""
        tell(
            f"slope of {report.metric} by {name}: {slope.value:.5g}, {slope.estimator}, "
            f"{slope.verdict}{why}"
        )
    for check in answer.checks:
        colour = "green" if check.passed else "red"
        console.print(f"[{colour}]{check.verdict:>6}[/] {check.name}: {check.detail}")
    if answer.claim is not None:
        tell(answer.claim.words)
    tell(answer.remark)
    tell(f"spent: {', '.join(words.spent(answer))}")

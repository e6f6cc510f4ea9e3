"""The answer of a search on one screen: a sentence, a table, and a line about the checks."""

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from jaxcrusher.scenes.echo import unit_of
from optimize import formatting
from optimize.answer import Answer
from optimize.evaluate import STARTS
from optimize.forces import besides, name_of


def print_answer(console: Console, answer: Answer) -> None:
    """Print the answer; everything else stands in report.html."""

    def tell(line: str) -> None:
        console.print(line, highlight=False, markup=False)

    tell(formatting.answer(answer))
    console.print(_table(answer))
    failed = [check for check in answer.checks if not check.passed]
    count = len(answer.checks)
    tell(f"{count - len(failed)} of {count} checks passed.")
    for check in failed:
        console.print(f"[red]failed[/] {check.name}: {check.detail}")
    if answer.bound is not None:
        tell(answer.bound.statement)
    tell(answer.remark)


def _table(answer: Answer) -> Table:
    """Return the table of the designs, a column each: any number of parameters fits a screen."""
    objective, unit, units = answer.objective, answer.objective.unit, answer.box.units
    name = name_of(objective.meaning)
    title = objective.meaning if name == objective.meaning else f"{name}: {objective.meaning}"
    table = Table("", title=title, box=SIMPLE_HEAD)
    others = besides(objective.meaning)
    headings = (
        *(f"{name}, {unit_of(name, units)[0]}".rstrip(", ") for name in answer.box.bounds),
        f"periodic orbit, {unit}",
        *(f"{start} start, {unit}" for start in STARTS),
        *(f"{meaning}, N" for meaning in others.values()),
        "ideal joints' RMS, N",
        "capacity, m3/h",
        *(["capacity, t/h"] if answer.throughput else []),
        "turns to 1/e",
    )
    columns = []
    for title, design in answer.designs.items():
        table.add_column(title, justify="right")
        columns.append(
            (
                *(f"{formatting.shown(name, of, units):.5g}" for name, of in design.values.items()),
                formatting.orbit(design),
                *(formatting.interval(design.transient[start]) for start in STARTS),
                *(formatting.force(design, name) for name in others),
                f"{design.ideal_rms:.0f}",
                f"{design.capacity:.2f}",
                *([f"{answer.throughput[title]:.2f}"] if answer.throughput else []),
                formatting.turns(design),
            )
        )
    for row in zip(headings, *columns, strict=True):
        table.add_row(*row)
    return table

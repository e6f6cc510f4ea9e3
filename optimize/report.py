"""The closing table of a search."""

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from jaxcrusher.scenes.echo import unit_of
from optimize import words
from optimize.answer import Answer
from optimize.evaluate import STARTS
from optimize.forces import besides


def print_table(console: Console, answer: Answer) -> None:
    """The designs, the checks, and what to make of the answer."""
    objective, unit, units = answer.objective, answer.objective.unit, answer.box.units
    # A column a design: any number of free parameters fits 80 columns.
    table = Table("", title=objective.meaning, box=SIMPLE_HEAD)
    rows = [f"{name}, {unit_of(name, units)[0]}".rstrip(", ") for name in answer.box.bounds]
    rows += [f"settled, {unit}", *(f"{start} start, {unit}" for start in STARTS)]
    others = besides(objective.meaning)
    rows += [f"{meaning}, N" for meaning in others.values()]
    rows += ["ideal joints' RMS, N", "capacity, m3/h", "turns to settle"]
    columns = []
    for title, design in answer.designs.items():
        table.add_column(title, justify="right")
        columns.append(
            (
                *(f"{words.shown(name, of, units):.5g}" for name, of in design.values.items()),
                words.settled(design),
                *(words.interval(design.transient[start]) for start in STARTS),
                *(words.force(design, name) for name in others),
                f"{design.ideal_rms:.0f}",
                f"{design.capacity:.2f}",
                words.turns(design),
            )
        )
    for row in zip(rows, *columns, strict=True):
        table.add_row(*row)

    def tell(line: str) -> None:
        console.print(line, highlight=False, markup=False)

    tell(words.answer(answer))
    console.print(table)

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

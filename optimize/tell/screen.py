"""The answer of a search on one screen: a sentence, a table, and a line about the checks."""

from rich.console import Console

from optimize.answer import Answer
from optimize.tell import tables
from optimize.tell import words as formatting


def print_answer(console: Console, answer: Answer) -> None:
    """Print the answer; everything else stands in report.html."""

    def tell(line: str) -> None:
        console.print(line, highlight=False, markup=False)

    if not answer.finished:
        tell(f"The search {answer.status}. The same command goes on from there.")
    tell(formatting.answer(answer))
    if answer.designs:
        console.print(tables.answer(answer).printed())
        tell(tables.caution(answer))
    failed = [check for check in answer.checks if not check.passed]
    if count := len(answer.checks):
        tell(f"{count - len(failed)} of {count} checks passed.")
    for check in failed:
        console.print(f"[red]failed[/] {check.name}: {check.detail}")
    if answer.bound is not None:
        tell(answer.bound.statement)
    tell(answer.remark)

"""The tables of the page crosschecks.md, and the rows of its csv."""

import statistics
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass

from benchmarks.comparison import Comparison
from benchmarks.pages import table

HEADINGS = ("case", "program", "tolerance by", "agree")
MEASURES = ("median difference", "largest difference", "largest share of its tolerance")


@dataclass(frozen=True)
class Row(Comparison):
    """A comparison of a case."""

    case: str = ""


def rows(found: Mapping[str, Sequence[Comparison]]) -> Iterator[Row]:
    """Yield the comparisons of all cases."""
    for case, comparisons in found.items():
        for one in comparisons:
            yield Row(**asdict(one), case=case)


def summary(compared: Sequence[Row]) -> str:
    """Return the table of how many comparisons agree, and how closely.

    A row has those of a case with one program whose tolerances have one reason.
    """
    groups: dict[tuple[str, str, str], list[Row]] = {}
    for row in compared:
        groups.setdefault((row.case, row.program, row.reason), []).append(row)
    cells = [[*labels, *_cells(group)] for labels, group in groups.items()]
    return table((*HEADINGS, *MEASURES), [*cells, ["all", "", "", *_cells(compared)]])


def _cells(compared: Sequence[Row]) -> list[str]:
    agree = sum(row.agrees for row in compared)
    differences = [row.difference for row in compared]
    share = max(row.difference / row.tolerance for row in compared)
    return [
        f"{agree if agree == len(compared) else f'**{agree}**'} of {len(compared)}",
        f"{statistics.median(differences):.1e}",
        f"{max(differences):.1e}",
        f"{share:.2g}",
    ]

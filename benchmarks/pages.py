"""Tables that programs make, in pages of docs/ that a person writes.

A table stands between `<!-- table: NAME -->` and `<!-- end -->`. Programs compute rows and fill
these places; they write no other word of a page.
"""

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
from matplotlib.figure import Figure

from benchmarks.setting import setting
from jaxcrusher.files.provenance import command
from jaxcrusher.files.results import write_figure, write_table, write_text
from jaxcrusher.pictures.plots import STYLE

DOCS = Path(__file__).parents[1] / "docs"
NOT_MEASURED = "Not part of this run.\n"
_PLACE = re.compile(r"(<!-- table: (.+?) -->\n)\n(.*?)\n(<!-- end -->)", re.DOTALL)


def table(headings: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Return a table in Markdown; bars inside of cells are escaped."""
    cells = ([str(cell).replace("|", r"\|") for cell in row] for row in (headings, *rows))
    head, *lines = (f"| {' | '.join(row)} |\n" for row in cells)
    return "".join([head, "|" + "---|" * len(headings) + "\n", *lines])


def run_table(*packages: str, minutes: float | None = None) -> str:
    """Return the table of what made a page: its command, machine and versions, and minutes."""
    took = {} if minutes is None else {"minutes": f"{minutes:.0f}"}
    row = {"made by": f"`{command()}`", "on": setting(*packages), **took}
    return table(list(row), [list(row.values())])


def tables_of(page: str) -> dict[str, str]:
    """Return the tables that stand in a page, by name."""
    return {name: text for _, name, text, _ in _PLACE.findall(page)}


def filled(page: str, tables: Mapping[str, str]) -> str:
    """Return a page with new tables; a place that gets none says that it was not measured.

    ValueError for a table that has no place.
    """
    if unknown := set(tables) - set(tables_of(page)):
        raise ValueError(f"Argument `tables` must have places in the page, but has {unknown}.")
    return _PLACE.sub(
        lambda place: f"{place[1]}\n{tables.get(place[2], NOT_MEASURED)}\n{place[4]}", page
    )


def publish(
    folder: Path,
    page: str,
    tables: Mapping[str, str],
    *packages: str,
    rows: Iterable[Mapping[str, Any]] = (),
    draw: Callable[[], Figure] | None = None,
    minutes: float | None = None,
) -> None:
    """Fill the page `page` of docs/ and write it to `folder`; print the tables.

    Its place "run" gets the table of what made it, with the versions of `packages`. `rows` become
    a csv and `draw` a figure of the page's name.
    """
    path, template = folder / Path(page).name, (DOCS / page).read_text(encoding="utf-8")
    if rows := list(rows):
        write_table(path.with_suffix(".csv"), rows, setting(*packages))
    if draw is not None:
        with plt.rc_context(STYLE):
            write_figure(path.with_suffix(".png"), draw())
    tables = {"run": run_table(*packages, minutes=minutes), **tables}
    # First, so that a place that is missing in the page loses nothing.
    for title, text in tables.items():
        print(f"{title}:\n\n{text}")
    write_text(path, filled(template, tables))
    print(path)

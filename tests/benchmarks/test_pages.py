"""The pages of the benchmarks: their tables are those that programs make of the committed data."""

import csv
import re

import pytest
from matplotlib.figure import Figure

from benchmarks import pages
from benchmarks.crosschecks.tables import Row as Crosscheck
from benchmarks.crosschecks.tables import summary
from benchmarks.pages import DOCS, NOT_MEASURED, filled, table, tables_of
from benchmarks.reproduction.tables import reading_table
from benchmarks.stability.judgement import Judged
from benchmarks.stability.tables import tables as stability
from benchmarks.work_precision.measure import Row
from benchmarks.work_precision.tables import tables as work_precision
from tests.tables import read_table

PAGE = "Words.\n\n<!-- table: one -->\n\nold\n\n<!-- end -->\n\nMore <!-- words -->.\n"


def csv_rows(name):
    """The rows of a committed table; what looks like a number is one, and nothing is left out."""
    lines = (DOCS / name).read_text().splitlines()
    rows = csv.DictReader(line for line in lines if not line.startswith("#"))
    return [{key: _number(text) for key, text in row.items() if text} for row in rows]


def _number(text):
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            pass
    return text


def made():
    """Page -> the tables that its program makes of the committed data."""
    read = [row | {"met": row["met"] == "True"} for row in csv_rows("reproduction/readings.csv")]
    rows = read_table(DOCS / "stability.csv", Judged)
    moving = [row for row in rows if row.formulation]
    refused = [row for row in rows if not row.formulation]
    return {
        "stability.md": stability(moving, refused),
        "stability_seats.md": stability(
            read_table(DOCS / "stability_seats.csv", Judged), by_start=False
        ),
        "crosschecks.md": {"summary": summary(read_table(DOCS / "crosschecks.csv", Crosscheck))},
        "reproduction/claims.md": {"readings": reading_table(read)},
        "work_precision.md": work_precision(read_table(DOCS / "work_precision.csv", Row)),
    }


@pytest.mark.parametrize("page", made())
def test_the_page_has_the_tables_of_its_data(page):
    standing = tables_of((DOCS / page).read_text())
    for name, text in made()[page].items():
        assert standing[name] == text, name


def test_only_places_are_filled():
    new = table(("a", "b"), [[1, "|x|"]])
    assert new == "| a | b |\n|---|---|\n| 1 | \\|x\\| |\n"
    page = filled(PAGE, {"one": new})
    assert tables_of(page) == {"one": new}
    assert filled(page, {"one": "old\n"}) == PAGE
    # A run of some parts does not pass old figures for its own.
    assert tables_of(filled(page, {})) == {"one": NOT_MEASURED}
    with pytest.raises(ValueError, match="must have places in the page"):
        filled(PAGE, {"two": new})


def test_a_program_writes_its_page_whole(tmp_path, monkeypatch, capsys):
    (tmp_path / "docs").mkdir()
    monkeypatch.setattr(pages, "DOCS", tmp_path / "docs")
    template = PAGE + "\n<!-- table: run -->\n\n\n<!-- end -->\n"
    (tmp_path / "docs" / "x.md").write_text(template)
    rows, empty = [{"a": 1}], Figure
    pages.publish(tmp_path, "x.md", {"one": "new\n"}, "numba", rows=rows, draw=empty, minutes=2.4)
    found = tables_of((tmp_path / "x.md").read_text())
    assert found["one"] == "new\n"
    assert found["run"].startswith("| made by | on | minutes |") and "numba" in found["run"]
    assert found["run"].endswith("| 2 |\n")
    assert (tmp_path / "x.csv").read_text().splitlines()[1:] == ["a", "1"]
    assert (tmp_path / "x.png").stat().st_size > 0
    assert "one:\n\nnew\n" in capsys.readouterr().out


def test_pages_are_short():
    """What CONTRIBUTING.md says of them: 3000 words, and 40 rows a table."""
    for page in DOCS.rglob("*.md"):
        text = page.read_text()
        assert len(text.split()) <= 3000, page
        tables = re.findall(r"(?:^\|.*\n)+", text, re.MULTILINE)
        assert max((rows.count("\n") - 2 for rows in tables), default=0) <= 40, page


def test_every_place_stands_once():
    for page in DOCS.rglob("*.md"):
        text = page.read_text()
        assert text.count("<!-- table: ") == len(tables_of(text)), page

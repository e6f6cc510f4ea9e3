"""Notebooks teach by one plan, and their pictures are of their code."""

import re

import nbformat
import pytest

from notebooks.make import DIGEST, digest, export
from tests.notebooks.lessons import FOLDER, NOTEBOOKS, cells

pytestmark = pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)


def test_nine_short_ones(path):
    assert len(NOTEBOOKS) == 9
    assert len(nbformat.read(path, as_version=4).cells) <= 15


def test_opens_with_its_question_and_explains_its_symbols(path):
    opening, symbols = (cell.source for cell in cells(path, "markdown")[:2])
    assert re.match(r"# .+\n\n\*\*[^*]+\?\*\*", opening)
    assert re.match(r"\| (symbol|word) \|", symbols)
    # A picture stands on the first screen.
    assert re.search(r"\n!\[[^]]+\]\(\.\./docs/[\w/]+\.png\)$", opening)


def test_checks_stand_in_the_last_cell_alone(path):
    *lesson, checks = (cell.source for cell in cells(path, "code"))
    assert nbformat.read(path, as_version=4).cells[-1].source == checks
    assert checks.startswith("# Checks\n") and "assert" in checks
    assert not any("assert" in source for source in lesson)


def test_ends_with_two_exercises_and_a_next_step(path):
    text = "\n".join(cell.source for cell in cells(path, "markdown"))
    exercises, after = text.split("## Exercises\n")[1].split("## Next\n")
    items = re.split(r"^\d\. ", exercises, flags=re.MULTILINE)[1:]
    assert len(items) == 2 and all(re.search(r"\*Answer:\s[^*]+\*", item) for item in items)
    links = re.findall(r"\]\(([^)#]+)", after)
    assert any(link.endswith(".ipynb") for link in links)
    assert any(link.startswith("../docs/") for link in links)


def test_links_lead_somewhere(path):
    text = "\n".join(cell.source for cell in cells(path, "markdown"))
    for link in re.findall(r"\]\(([^)#]+)", text):
        assert (FOLDER / link).exists(), link


def test_shows_its_pictures_small_and_current(path):
    """Made by `python notebooks/make.py`."""
    notebook = nbformat.read(path, as_version=4)
    shown = [output for cell in cells(path, "code") for output in cell.outputs]
    kinds = {kind for output in shown for kind in output.get("data", {})}
    assert "image/png" in kinds and kinds <= {"image/png", "text/plain"}
    assert notebook.metadata[DIGEST] == digest(notebook), "run python notebooks/make.py"
    # Pictures of 60 kB in all, a third more in base64, and the text.
    assert path.stat().st_size < 100e3


def test_is_exported_as_a_page_that_needs_no_network(path, tmp_path):
    export(path.stem, tmp_path)
    page = (tmp_path / f"{path.stem}.html").read_text()
    assert not re.search(r'<(link|script|img)\b[^>]*(src|href)="(https?:)?//', page)
    assert "cdnjs" not in page and "MathJax" not in page
    text = "\n".join(cell.source for cell in cells(path, "markdown"))
    assert page.count("<math") == text.replace("$$", "$").count("$") / 2 > 0
    assert re.findall(r'src="(?!data:)', page) == []

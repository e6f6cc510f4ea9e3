"""The notebooks are there, short, and committed without output; nbmake runs them."""

from pathlib import Path

import nbformat
import pytest

NOTEBOOKS = sorted((Path(__file__).parents[2] / "notebooks").glob("*.ipynb"))


def test_all_are_there():
    assert len(NOTEBOOKS) == 6


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_short_without_output_and_checking_itself(path):
    cells = nbformat.read(path, as_version=4).cells
    assert len(cells) <= 15
    code = [cell for cell in cells if cell.cell_type == "code"]
    assert not any(cell.outputs or cell.execution_count for cell in code)
    assert any("assert" in cell.source for cell in code)

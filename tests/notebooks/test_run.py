"""Notebooks run, and print what is kept in them."""

import re

import nbformat
import pytest

from notebooks.make import execute
from tests.notebooks.lessons import FOLDER, NOTEBOOKS, cells

pytestmark = pytest.mark.usefixtures("compiled_once")
# What these print hangs on no clock and on no chaotic motion.
SAME_EVERYWHERE = ("01", "07", "08")
SHORTEST = FOLDER / "03_map_of_regimes.ipynb"
# The eighth fits 40 times, and the ninth follows a branch by shooting.
OPTIMISED = ("04", "08", "09")
CASES = [
    pytest.param(path, marks=[pytest.mark.optimised] * path.stem.startswith(OPTIMISED))
    for path in NOTEBOOKS
    if path.name != SHORTEST.name
]
NUMBER = re.compile(r"-?\d+(?:\.(\d+))?(?:e([-+]\d+))?")


@pytest.mark.slow
@pytest.mark.usefixtures("promoting")  # optax mixes types
@pytest.mark.parametrize("path", CASES, ids=lambda path: path.stem)
def test_runs_and_prints_what_it_shows(path, monkeypatch, capsys):
    """In this process: a kernel imports for longer than most compute."""
    monkeypatch.chdir(FOLDER)
    names, code = {}, cells(path, "code")
    for cell in code:
        exec(compile(cell.source, path.name, "exec"), names)
    if path.stem.startswith(SAME_EVERYWHERE):
        printed = capsys.readouterr().out
        outputs = [output for cell in code for output in cell.outputs]
        shown = "".join(output.get("text", "") for output in outputs)
        assert NUMBER.sub("", printed).split() == NUMBER.sub("", shown).split()
        for now, before in zip(NUMBER.finditer(printed), NUMBER.finditer(shown), strict=True):
            # Other processors and programs round the last digit to either side; counts are exact.
            is_count = re.fullmatch(r"\d{1,3}", before[0])
            last = 10.0 ** (int(before[2] or 0) - len(before[1] or "")) * (not is_count)
            assert abs(float(now[0]) - float(before[0])) <= 1.01 * last, (now[0], before[0])


@pytest.mark.slow
def test_the_shortest_runs_in_a_kernel_and_shows_its_pictures(monkeypatch):
    monkeypatch.delenv("MPLBACKEND", raising=False)
    notebook = nbformat.read(SHORTEST, as_version=4)
    execute(notebook)
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    assert sum("image/png" in output.get("data", {}) for output in outputs) == 3

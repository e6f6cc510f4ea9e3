"""What is measured on a GPU: nothing without one, and a table that the page has a place for."""

import pytest

from benchmarks.gpu import run as program
from benchmarks.gpu.run import Row, designs_table
from benchmarks.pages import DOCS, tables_of
from tests.lanes.cards import Card, simulated_card  # noqa: F401


def test_without_a_card_one_line_is_all(monkeypatch, tmp_path):
    monkeypatch.setattr(program, "finds_card", lambda: False)
    with pytest.raises(RuntimeError, match=r"^CuPy finds no GPU [^\n]*$"):
        program.run(tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_the_page_has_a_place_for_the_table():
    made = designs_table([Row(1000, 6.0, 0.04, 0.02)], 2.4e-4, 16)
    standing = tables_of((DOCS / "gpu.md").read_text())
    assert {"run", "designs"} == set(standing)
    assert made.splitlines()[0] == standing["designs"].splitlines()[0]
    # 40 and 20 us of the card, 240 us of the cores.
    assert made.splitlines()[2] == "| 1000 | 6.00 | 40.0 | 20.0 | 240 | 6.0 |"


@pytest.mark.slow
def test_a_card_fills_the_page(simulated: Card, monkeypatch, tmp_path):
    class Event:
        def record(self):
            self.at = simulated.used["kernels"]

    simulated.__version__ = "14"
    simulated.cuda.Event = Event
    # Each kernel takes a millisecond.
    simulated.cuda.get_elapsed_time = lambda began, ended: float(ended.at - began.at)
    simulated.cuda.runtime.getDeviceProperties = lambda device: {"name": b"a card"}
    monkeypatch.setattr(program, "finds_card", lambda: True)
    monkeypatch.setattr(program, "SIDES", ((2, 1),))
    monkeypatch.setattr(program, "ON_CORES", (2, 1))
    program.run(tmp_path)
    standing = tables_of((tmp_path / "gpu.md").read_text())
    assert "| a card; " in standing["run"]
    # A sweep of two designs has one kernel.
    assert standing["designs"].splitlines()[2].split(" | ")[3] == "500.0"

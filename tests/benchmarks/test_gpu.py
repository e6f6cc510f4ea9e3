"""What is measured on a GPU: nothing without one, tables that the page has places for, counts."""

import pytest

from benchmarks.gpu import run as program
from benchmarks.gpu.roofline import counted, instructions, peak
from benchmarks.gpu.run import Row, tables
from benchmarks.pages import DOCS, tables_of
from jaxcrusher.motion.statistic import SAMPLES
from tests.lanes.test_card import Card, simulated  # noqa: F401


def test_without_a_card_one_line_is_all(monkeypatch, tmp_path):
    monkeypatch.setattr(program, "finds_card", lambda: False)
    with pytest.raises(RuntimeError, match=r"^CuPy finds no GPU [^\n]*$"):
        program.run(tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_the_page_has_places_for_all_tables():
    made = tables([Row(1000, 6.0, 0.04, 0.02)], 2.4e-4, 16, 3e6, 6e11)
    standing = tables_of((DOCS / "gpu.md").read_text())
    assert {"run", *made} == set(standing)
    for name, text in made.items():
        assert text.splitlines()[0] == standing[name].splitlines()[0], name
    # 40 and 20 us of the card, 240 us of the cores; 5 ms of the units in 20 ms.
    assert made["designs"].splitlines()[2] == "| 1000 | 6.00 | 40.0 | 20.0 | 240 | 6.0 |"
    assert made["roofline"].splitlines()[2] == "| 1000 | 0.020 | 0.005 | 25 % |"


@pytest.mark.slow
def test_a_card_fills_the_page(simulated: Card, monkeypatch, tmp_path):  # noqa: F811
    class Event:
        def record(self):
            self.at = simulated.used["kernels"]

    simulated.__version__ = "14"
    simulated.cuda.Event = Event
    # Each kernel takes a millisecond.
    simulated.cuda.get_elapsed_time = lambda began, ended: float(ended.at - began.at)
    simulated.cuda.runtime.getDeviceProperties = lambda device: {"name": b"a card"}
    device = simulated.cuda.Device()
    device.id, device.attributes["ClockRate"] = 0, 1_000_000
    monkeypatch.setattr(program, "finds_card", lambda: True)
    monkeypatch.setattr(program, "SIDES", ((2, 1),))
    monkeypatch.setattr(program, "ON_CORES", (2, 1))
    monkeypatch.setattr(program, "COUNTED", 2)
    program.run(tmp_path)
    standing = tables_of((tmp_path / "gpu.md").read_text())
    assert "| a card; " in standing["run"]
    # A sweep of two designs has one kernel.
    assert standing["roofline"].splitlines()[2].startswith("| 2 | 0.001 | ")


PTX = """
.func field(
	.param .b64 field_param_0
)
{
	.reg .f64 %fd<3>;
	ld.f64 	%fd1, [%rd1];
	fma.rn.f64 	%fd2, %fd1, %fd1, %fd1;
	neg.f64 	%fd2, %fd2;
	div.rn.f64 	%fd3, %fd1, %fd2;
	setp.lt.f64 	%p1, %fd1, %fd2;
	ret;

}
.func step(
	.param .b64 step_param_0
)
{
	add.f64 	%fd2, %fd1, %fd1;
	@%p1 mul.rn.f64 	%fd3, %fd1, %fd2;
	ret;

}
.func accept() 
{
	min.f64 	%fd2, %fd1, %fd1;
	ret;

}
.func look()
{
	sqrt.rn.f64 	%fd2, %fd1;
	cvt.rn.f64.s64 	%fd2, %rd1;
	ret;

}
"""


def test_instructions_for_units_of_64_bits_are_counted():
    assert counted(PTX) == {"field": 1 + 8 + 1, "step": 2, "accept": 1, "look": 8}
    # Six evaluations of the field a step.
    assert instructions(PTX, 100.0, 3) == 100 * (2 + 6 * 10 + 1) + 3 * SAMPLES * 8


def test_the_peak_is_that_of_the_data_sheet():
    # H100 SXM: 34 TFLOPS of 64 bits, two for each instruction.
    h100 = peak("90", {"MultiProcessorCount": 132, "ClockRate": 1_980_000})
    assert 2 * h100 == pytest.approx(34e12, rel=0.02)  # told to two digits

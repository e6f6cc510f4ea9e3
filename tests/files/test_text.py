"""Numbers, values and tables as text."""

import math

import numpy as np
import pytest
from rich.console import Console

from jaxcrusher.files.text import Table, as_text, is_number, number, prefixed, quantity, with_error


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.0, "0"),
        (-0.0, "0"),
        (12.34567, "12.35"),
        (-0.000123456, "-0.0001235"),
        (999.97, "1000"),
        (1234.56, "1235"),
        (9999.7, "10000"),  # four digits of it are 1e+04
        (-123456.7, "-123457"),
        (9999999.4, "9999999"),
        (2.1e11, "2.1e+11"),
        (math.inf, "inf"),
        (math.nan, "no value"),
    ],
)
def test_a_number_keeps_four_digits_and_all_before_the_point(value, text):
    assert number(value) == number(np.float64(value)) == as_text(value) == text
    assert is_number(text) == (text[-1].isdigit())


@pytest.mark.parametrize(
    ("value", "error", "text"),
    [
        (12.3456, 0.0123, "12.346 ± 0.012"),
        (12.3456, 0.0999, "12.35 ± 0.10"),
        (18249.6, 1234.0, "18200 ± 1200"),
        (239511.0, 4100.0, "239500 ± 4100"),
        (-0.00034567, 0.000012, "-0.000346 ± 0.000012"),
        (3.4567e-6, 1.2e-7, "3.46e-06 ± 1.2e-07"),
        (3.4567e9, 1.2e8, "3.46e+09 ± 1.2e+08"),
        (19102.318412, 1e-6, "19102.3 ± 1e-06"),  # six digits at most
        (0.3, 12.0, "0 ± 12"),
        (-0.3, 12.0, "0 ± 12"),
        (2.0, 0.04, "2.000 ± 0.040"),
        (3.0, 0.0, "3 ± 0"),
        (3.0, math.nan, "3"),  # one turn tells none
        (math.nan, math.nan, "no value"),
    ],
)
def test_a_number_has_the_digits_that_its_error_leaves(value, error, text):
    assert with_error(value, error) == text and is_number(text) == (text != "no value")


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (999.0, "N", "999 N"),
        (-18249.6, "N", "-18.25 kN"),
        (1.2e6, "N", "1200 kN"),
        (2.5e6, "J/m3", "2.5 MJ/m3"),
        (2.5e3, "J/m3", "2.5 kJ/m3"),
        (6e-5, "m", "0.06 mm"),
        (12345.6, "rpm", "12346 rpm"),
        (1.25, "1", "1.25"),
        (math.nan, "N", "no value"),
    ],
)
def test_a_quantity_has_the_unit_that_suits_its_size(value, unit, text):
    assert quantity(value, unit) == text
    if not math.isnan(value):
        factor, told = prefixed(abs(value), unit)
        assert text.removesuffix(f" {told}") == number(value / factor)


def test_values_of_any_kind():
    assert [as_text(value) for value in (True, False, 12, "12 ± 3", None)] == [
        *("yes", "no", "12", "12 ± 3", "None")
    ]
    numbers = [1, 2.0, math.nan, "-1.2e+05", "12 ± 3"]
    assert all(map(is_number, numbers))
    assert not any(map(is_number, (True, None, "no value", "3 to 4", "12 ± ", "0.06 mm", "-")))


def test_a_table_on_the_screen():
    table = Table.of([{"name": "a", "force": 12345.6}, {"name": "b", "force": math.nan}])
    console = Console(width=60)
    with console.capture() as seen:
        console.print(table.printed())
    lines = [line.split() for line in seen.get().splitlines() if line.strip()]
    assert lines[0] == ["name", "force"]
    assert lines[2:] == [["a", "12346"], ["b", "no", "value"]]
    assert Table.of([]).headings == ()

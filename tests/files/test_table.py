"""Tables of results: every column has a unit and a meaning."""

import pint

from jaxcrusher.files.table import COLUMNS


def test_every_column_has_a_unit_and_a_meaning():
    registry = pint.UnitRegistry()
    for name, column in COLUMNS.items():
        for unit in column.unit.split(", "):
            registry.parse_units("" if unit == "1" else unit)
        assert len(column.meaning) > 5, name

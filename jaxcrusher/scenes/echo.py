"""Values in the units that they were given in: mm in, mm out.

`units` maps the name of a number to its unit as it was written; a name that it lacks has the unit
that drawings have: mm, degrees, GPa, and what else is SI.
"""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from jaxcrusher.scenes.parameters import DRAWN_IN, NUMBERS, readable
from jaxcrusher.scenes.scene_file import key_of, quantity_in, read_entries, written_unit


def units_of(written: Iterable[tuple[str, Any]]) -> dict[str, str]:
    """Return the units in the texts of named values; a text without a unit is left out."""
    keys = ((key_of(name), text) for name, text in written)
    units = {key: written_unit(str(text)) for key, text in keys if key in NUMBERS}
    return {name: unit for name, unit in units.items() if unit}


def units_of_file(path: Path | None) -> dict[str, str]:
    """Return the units that a scene file uses; ValueError as `read_scene_file` says."""
    return {} if path is None else units_of(read_entries(path))


def unit_of(name: str, units: Mapping[str, str]) -> tuple[str, float]:
    """The unit that a number is shown in, "" for none, and what one of it is in SI units."""
    if name not in NUMBERS or NUMBERS[name].unit == "1":
        return "", 1.0
    si = NUMBERS[name].unit
    unit = units.get(name) or DRAWN_IN.get(si, (1.0, si))[1]
    return unit, quantity_in(si, name, f"1 {unit}")


def per(what: str, unit: str) -> str:
    """The unit of a slope."""
    if not unit:
        return what
    return f"{what}/({unit})" if "/" in unit or " " in unit else f"{what}/{unit}"


def said(name: str, value: float | str, units: Mapping[str, str]) -> str:
    """A value with its unit; a speed in rpm and in rad/s."""
    if isinstance(value, str) or units.get(name, "rad/s") == "rad/s":
        return readable(name, value)
    unit, size = unit_of(name, units)
    text = f"{value / size:.6g} {unit}"
    return f"{text} ({value:.4g} rad/s)" if NUMBERS[name].unit == "rad/s" else text


def all_said(values: Mapping[str, float | str], units: Mapping[str, str]) -> str:
    """Return names with their values, each as `said`."""
    return ", ".join(f"{name} {said(name, value, units)}" for name, value in values.items())

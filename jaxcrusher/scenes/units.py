"""Quantities with their unit, as they are read and as they are printed: mm in, mm out.

`units` maps the name of a number to its unit as it was written; a name that it lacks has the unit
of drawings: mm, degrees, GPa, and SI units for all others.
"""

import re
from collections.abc import Iterable, Mapping
from decimal import Decimal
from functools import cache
from typing import TYPE_CHECKING, Any
from unicodedata import normalize

import numpy as np

from jaxcrusher.basics.checks import require
from jaxcrusher.scenes.parameters import DRAWN_IN, NUMBERS, POINTS, key_of, readable

if TYPE_CHECKING:
    import pint

# A rotational speed as data sheets write it, in any case; elsewhere "1/min" may be another rate.
_TURNS_A_MINUTE = ("1/min", "min-1", "min^-1", "min**-1", "rpm", "upm")
_TURNS_A_MINUTE += tuple(f"{turn}/min" for turn in ("u", "r", "tr", "rev", "ob", "obr"))
# SI unit -> units that data sheets have for it, and how their slips are told.
_USUAL = {
    "rad/s": ("rpm", "rad/s"),
    "rad": ("deg", "rad", "gon"),
    "m": ("mm", "m", "um", "cm", "in", "ft"),
    "kg": ("kg", "t", "g", "lb"),
    "kg m2": ("kg m2", "t m2", "kg cm2"),
    "kg/m3": ("kg/m3", "t/m3", "g/cm3"),
    "N": ("N", "kN", "MN", "kp", "kgf", "lbf"),
    "N/m": ("N/m", "N/mm", "kN/m", "kN/mm", "MN/m"),
    "N s/m": ("N s/m", "kN s/m", "MN s/m", "N s/mm"),
    "N m": ("N m", "kN m"),
    "N m/rad": ("N m/rad", "kN m/rad", "MN m/rad"),
    "N m s/rad": ("N m s/rad", "kN m s/rad", "MN m s/rad"),
    "Pa": ("Pa", "kPa", "MPa", "GPa", "N/mm2", "bar", "psi"),
    "Pa s": ("Pa s", "mPa s", "cP"),
    "W": ("W", "kW", "MW", "hp", "PS"),
}
# Words that mean different units in different places, in any case and number -> what to write.
_UNCLEAR = {
    "ton": "may be 907, 1000 or 1016 kg: write t or tonne of 1000 kg, or lb",
    "cwt": "may be 45.4 or 50.8 kg: write kg or lb",
    "gr": "may be grams or grains: write g",
    "grad": "may be degrees or gon: write deg or gon",
}

# Quotes that a word processor puts in the place of straight ones.
TYPOGRAPHIC = "[\u201c\u201d\u201e\u2018\u2019\u00ab\u00bb]"
NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_QUANTITY = re.compile(rf"\s*((?>{NUMBER}))\s*([^,].*)")
# Names with one digit of exponent, "m2", "m^2", "m**2", "s-1", or a decimal one after a sign of a
# power, "m^1.5", and between them *, /, · or a space.
_FACTOR = r"(?:[^\W\d_]+|%|°)(?:(?:\^|\*\*)-?\d(?:\.\d+)?|-?\d)?"
_UNIT = re.compile(rf"(?:1\s*/\s*)?{_FACTOR}(?:\s*[\s*/·]\s*{_FACTOR})*")
_EXPONENT = re.compile(r"(?<=[^\W\d_])(-?\d)")


def typed_in(unit: str, name: str, text: str) -> float:
    """Return `quantity_in` of a command line, where a number without a unit has no quotes.

    Raises ValueError as `quantity_in` does.
    """
    if unit == "1" and re.fullmatch(NUMBER, text.strip()):
        return float(text)
    return quantity_in(unit, name, text)


def quantity_in(unit: str, name: str, text: str) -> float:
    """A quantity such as "0.06 mm" in an SI unit; `name` is what messages call it.

    Raises ValueError for no unit, an unknown one, and one of another kind. Angles are a kind of
    their own: "5 Hz" may mean turns or radians.
    """
    match = _QUANTITY.fullmatch(text)
    if match is None:
        why = "is none"
        if re.fullmatch(rf"\s*{NUMBER}\s*", text):
            why = "needs no quotes" if unit == "1" else "has no unit"
        elif re.match(r"\s*[+-]?\d+,\d", text):
            why = f"has a decimal comma: write {text.replace(',', '.', 1)!r}"
        raise ValueError(f"Argument `{name}` must be {_wanted(unit)}, but {text!r} {why}.")
    written = match[2].strip()
    if unit == "rad/s" and written.replace(" ", "").casefold() in _TURNS_A_MINUTE:
        written = "rpm"
    if unclear := _unclear(written):
        raise ValueError(f"Argument `{name}` must have a clear unit, but {written!r} {unclear}.")
    registry = _registry()
    try:
        wanted = parse_unit(unit)
    except _no_unit():
        must = 'be of a law that gives its field a known unit, such as "N/m^1.5"'
        require(False, name, must, f"in {unit!r}")
    try:
        given = parse_unit(written)
        number = registry.Quantity(Decimal(match[1]), given)
        # Compared by base units, because pint takes rad/s for 1/s.
        base, wanted_base = (registry.get_base_units(each)[1] for each in (given, wanted))
        result = float(number.to(wanted).magnitude) if base == wanted_base else None
        if result is not None and registry.Quantity(Decimal(0), given).to(wanted).magnitude != 0:
            raise ValueError("a scale with a zero of its own, such as decibel")
    except ArithmeticError:
        raise ValueError(
            f"Argument `{name}` must be {_wanted(unit)}, but {text!r} has an exponent of too many "
            "digits."
        ) from None
    except _no_unit():
        raise ValueError(
            f"Argument `{name}` must have a unit of the kind {unit}, but {written!r} is unknown"
            f"{_meant(unit, written)}"
        ) from None
    if result is None:
        cycles = unit == "rad/s" and base == registry.Unit("1/s")
        hint = " (turns or radians? Write rpm or rad/s)." if cycles else _meant(unit, written)
        raise ValueError(
            f"Argument `{name}` must have a unit of the kind {unit}, but has {written!r}{hint}"
        )
    # The description's own angles are np.radians of degrees, to the last digit.
    return float(np.radians(float(match[1]))) if given == registry.degree else result


def _unclear(written: str) -> str:
    """Say of a unit whose word means several things what to write, or nothing."""
    for word in re.findall(r"[^\W\d_]+", written.casefold()):
        if match := re.fullmatch(rf"[km]?({'|'.join(_UNCLEAR)})s?", word):
            return _UNCLEAR[match[1]]
    return ""


def _meant(unit: str, written: str) -> str:
    """End a refusal with the usual units of a kind, or those of them that are written so alike."""

    def plain(one: str) -> str:
        return re.sub(r"[\s*·.^]", "", normalize("NFKC", one)).casefold()

    usual = _USUAL.get(unit, ())
    alike = [one for one in usual if plain(one) == plain(written)]
    if alike:
        return f"; did you mean {' or '.join(alike)}?"
    return f"; usual are {', '.join(usual)}." if usual else "."


# A `pint.UnitRegistry`, which beartype cannot check as pint writes it for Python 3.12 and later.
@cache
def _registry() -> Any:
    """Decimal, so that "0.06 mm" is the float 0.06e-3.

    Pint takes an eighth of the time that the package is imported in, and numbers in SI units need
    none of it.
    """
    import pint

    registry = pint.UnitRegistry(non_int_type=Decimal)  # pyright: ignore
    for known, alias in (("turn", "rev"), ("metric_horsepower", "PS"), ("force_kilogram", "kp")):
        registry.define(f"@alias {known} = {alias}")
    return registry


def _no_unit() -> tuple[type[Exception], ...]:
    """Return what pint raises for a text that is no unit."""
    import pint

    # TypeError: decibel and the like; KeyError: an exponent of zero.
    return pint.UndefinedUnitError, ValueError, TypeError, KeyError


def parse_unit(text: str) -> "pint.Unit":
    """Return the unit of a text such as "kg m2"; "1" means a number without a unit."""
    if text == "1":
        return _registry().dimensionless
    if not _UNIT.fullmatch(text):
        raise ValueError(text)
    plain = text.replace("·", "*").replace("^", "**")
    return _registry().parse_units(_EXPONENT.sub(r"**\1", plain))


def written_unit(text: str) -> str:
    """The unit of a quantity as it is written, or nothing."""
    match = _QUANTITY.fullmatch(text)
    return match[2].strip() if match else ""


def _example(unit: str) -> str:
    examples = {
        "rad/s": "286 rpm",
        "rad": "22.5 deg",
        "m": "0.06 mm",
        "Pa": "207 GPa",
        "kg/m3": "1.6 t/m3",
        "1": "10 %",
    }
    return f'"{examples.get(unit, f"1.5 {unit}")}"'


def _wanted(unit: str) -> str:
    either = "a number or " if unit == "1" else ""
    return f"{either}a quoted quantity such as {_example(unit)}"


def points_of(values: Mapping[str, Any]) -> dict[str, tuple[float, float]]:
    """Return the points of the frame that a description names, m from C."""
    there = (name for name in values if name.startswith(POINTS))
    return {name.removeprefix(POINTS): point_of(name, values[name]) for name in there}


def point_of(name: str, value: Any) -> tuple[float, float]:
    """Return a point of the frame, m from C, of two quantities such as "1.2 m, -0.4 m".

    Raises ValueError as `quantity_in` does.
    """
    two = value.split(",") if isinstance(value, str) else ()
    must = 'be a place from C, to the right and up, such as "1.2 m, -0.4 m"'
    require(len(two) == 2, name, must, repr(value))
    x, y = (quantity_in("m", name, one) for one in two)
    return x, y


def number_in(unit: str, name: str, value: Any) -> float:
    """Return a number as TOML has it, in an SI unit: a bare one is refused if it may have a unit.

    Raises ValueError as `quantity_in` does.
    """
    if isinstance(value, str):
        if re.search(TYPOGRAPHIC, value):
            raise ValueError(f"Argument `{name}` must have no typographic quotes, but is {value}.")
        return quantity_in(unit, name, value)
    if not isinstance(value, int | float) or isinstance(value, bool):
        kind = "table" if isinstance(value, dict) else type(value).__name__
        raise ValueError(f"Argument `{name}` must be {_wanted(unit)}, but is a {kind}.")
    number = float(str(value))  # infinite if a whole number is too large for a float
    require(unit == "1" or bool(np.isfinite(number)), name, "be finite", number)
    if unit != "1" and value != 0:
        raise ValueError(
            f"Argument `{name}` must have a unit, as in {_example(unit)}, but is "
            f'{number:.12g} (write "{number:.12g} {unit}" if that is meant).'
        )
    return number


def units_of(written: Iterable[tuple[str, Any]]) -> dict[str, str]:
    """Return the units in the texts of named values; a text without a unit is left out."""
    units = {key_of(name): written_unit(str(text)) for name, text in written}
    return {name: unit for name, unit in units.items() if unit}


def unit_of(name: str, units: Mapping[str, str]) -> tuple[str, float]:
    """The unit that a number is shown in, "" for none, and what one of it is in SI units."""
    si = NUMBERS[name].unit if name in NUMBERS else ""
    unit = units.get(name) or DRAWN_IN.get(si, (1.0, si))[1]
    if si == "1" or not unit:
        return "", 1.0
    if si:
        return unit, quantity_in(si, name, f"1 {unit}")
    size = size_of(unit)
    return ("", 1.0) if size is None else (unit, size)


def size_of(unit: str) -> float | None:
    """Return the size of a unit in SI units; None for an unknown unit, and for a bare number."""
    try:
        size = _registry().Quantity(Decimal(1), parse_unit(unit)).to_base_units()
    except _no_unit():
        return None
    if size.units == _registry().dimensionless:
        return None
    return float(np.radians(1.0)) if unit == "deg" else float(size.magnitude)


def per(what: str, unit: str) -> str:
    """The unit of a slope."""
    if unit in ("", "1"):
        return what
    return f"{what}/({unit})" if "/" in unit or " " in unit else f"{what}/{unit}"


def said(name: str, value: float | str, units: Mapping[str, str]) -> str:
    """A value with its unit; a speed in rpm and in rad/s."""
    if isinstance(value, str):
        return value
    unit, size = unit_of(name, units)
    text = f"{value / size:.6g} {unit}".rstrip()
    if name not in NUMBERS or NUMBERS[name].unit != "rad/s":
        return text
    return readable(name, value) if unit == "rad/s" else f"{text} ({value:.4g} rad/s)"


def all_said(values: Mapping[str, float | str], units: Mapping[str, str]) -> str:
    """Return names with their values, each as `said`."""
    return ", ".join(f"{name} {said(name, value, units)}" for name, value in values.items())

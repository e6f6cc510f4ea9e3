"""A crusher from a TOML file: quantities with their unit, checked by name.

```toml
speed = "286 rpm"
clearance = "0.06 mm"
friction = 0.1
start = "contact"

[jaw]
mass = "524 kg"
```

Keys and tables are the names of `PARAMETERS`, `CHAMBER` and `CHOICES` of
`jaxcrusher.scenes.parameters`; one that is missing takes the paper's value. A bare number is
refused where a unit could be meant: 0.10 may be millimetres to the one who writes it, and 250 rpm.
"""

import re
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from decimal import Decimal
from difflib import get_close_matches
from functools import cache
from pathlib import Path
from typing import Any
from unicodedata import normalize

import numpy as np
import pint

from jaxcrusher.basics.checks import renamed, require, require_choice
from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.scenes.build import build_scene, by_stroke
from jaxcrusher.scenes.own_laws import is_own, law_class, make_known
from jaxcrusher.scenes.parameters import (
    CHAMBER,
    CHOICES,
    FILES,
    NUMBERS,
    OF_LINKAGES,
    POINTS,
    SITE,
    WHOLE,
    check_number,
)

# A diameter of a drawing -> the radius that it gives.
DIAMETERS = {"diametral_clearance": "clearance", "bore_diameter": "bore_radius"}
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
_TYPOGRAPHIC = "[\u201c\u201d\u201e\u2018\u2019\u00ab\u00bb]"
_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_QUANTITY = re.compile(rf"\s*((?>{_NUMBER}))\s*([^,].*)")
# Names with one digit of exponent, "m2", "m^2", "m**2", "s-1", or a decimal one after a sign of a
# power, "m^1.5", and between them *, /, · or a space.
_FACTOR = r"(?:[^\W\d_]+|%|°)(?:(?:\^|\*\*)-?\d(?:\.\d+)?|-?\d)?"
_UNIT = re.compile(rf"(?:1\s*/\s*)?{_FACTOR}(?:\s*[\s*/·]\s*{_FACTOR})*")
_EXPONENT = re.compile(r"(?<=[^\W\d_])(-?\d)")


def _keys() -> tuple[str, ...]:
    """Return every name that a file may have now: laws of one's own add to them."""
    return (*NUMBERS, *CHOICES, *FILES)


def _tables(keys: Iterable[str]) -> tuple[str, ...]:
    """Return the names of the tables that keys stand in."""
    return tuple(dict.fromkeys(name.partition(".")[0] for name in keys if "." in name))


def read_scene_file(
    path: Path | str, overrides: Iterable[tuple[str, str]] = ()
) -> dict[str, float | str]:
    """The values for `jaxcrusher.build_scene` in a TOML file, numbers in SI units.

    `overrides` as of `--set` stand in place of the file's. Its stroke is that of the links with
    them, unless a stroke or an eccentricity is among them.

    Raises ValueError of one line, with the file and the key, for a file that cannot be read or is
    not TOML, a key that is unknown, a wrong type or unit, a missing unit, a number outside its
    limits, and an unknown choice. Whether the values make a crusher together, `build_scene` says.
    """
    path = Path(path)
    given = _written_in(path)
    over = read_overrides(overrides)
    throws = {"stroke", "shaft.eccentricity"}
    if throws & over.keys():
        given = {name: value for name, value in given.items() if name not in throws}
    values = given | over
    with naming(path, values):
        return by_stroke(values)


def _written_in(path: Path) -> dict[str, float | str]:
    values: dict[str, float | str] = {}
    written: dict[str, str] = {}  # key -> its name in the file
    entries = read_entries(path)
    with naming(path):
        make_known(entries, path.parent)
        for name, value in entries:
            if (name, value) == ("kind", "crusher"):
                continue
            key = key_of(name)
            if (other := written.get(key, name)) != name:
                raise ValueError(f"Argument `{name}` must not stand beside `{other}`, but does.")
            if key in written:
                raise ValueError(f"Argument `{key}` must be given once, but is given twice.")
            written[key] = name
            values[key] = read_value(name, value, path.parent)
    return values


def read_entries(path: Path) -> list[tuple[str, Any]]:
    """Dotted names and what a TOML file has for them, as it is written.

    Raises ValueError of one line for a file that cannot be read or is not TOML.
    """
    try:
        text = _decoded(path.read_bytes())
        entries = tomllib.loads(text)
    except OSError as error:
        raise ValueError(f"{path}: cannot be read: {error.strerror}.") from None
    except UnicodeDecodeError as error:
        raise ValueError(f"{path}: must be UTF-8 text, but {error.reason}.") from None
    except (ValueError, RecursionError) as error:
        raise ValueError(f"{path}: is not TOML: {_slip(text, str(error))}.") from None
    with naming(path):
        return list(flattened(entries))


def _decoded(content: bytes) -> str:
    """UTF-8 text, with or without a byte order mark, with any ends of lines.

    Raises UnicodeDecodeError whose reason is a clause.
    """
    if content.startswith((b"\xff\xfe", b"\xfe\xff")) or b"\0" in content[:100]:
        raise UnicodeDecodeError("utf-8", content, 0, 1, "is UTF-16 or UTF-32: save it as UTF-8")
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        error.reason = f"byte {error.start} is not: save it as UTF-8"
        raise
    return text.replace("\r\n", "\n").replace("\r", "\n")


def _slip(text: str, error: str) -> str:
    """Guess the slip behind TOML's error: a decimal comma, or quotes that were forgotten."""
    place = re.search(r"at line (\d+)", error)
    if "Cannot overwrite" in error:
        return f"line {place[1]} gives a key a second time" if place else "a key is given twice"
    if place is None:
        return error
    line = text.split("\n")[int(place[1]) - 1]
    if re.search(rf"=\s*{_TYPOGRAPHIC}", line):
        return f'line {place[1]} has typographic quotes: write straight ones, "..."'
    if comma := re.match(r"[^#\"']*=\s*([+-]?\d+),(\d+)", line):
        return f"line {place[1]} has a decimal comma: write {comma[1]}.{comma[2]}"
    if bare := re.match(rf"[^#\"']*=\s*({_NUMBER}\s*[^\W\d][^#]*)", line):
        return f'line {place[1]} has a quantity without quotes: write "{bare[1].strip()}"'
    return error


def key_of(name: str) -> str:
    """Return the key of `PARAMETERS` that a name of a scene file gives, a diameter's too."""
    head, dot, tail = name.rpartition(".")
    key = f"{head}{dot}{DIAMETERS.get(tail, tail)}"
    return key if key in NUMBERS else name


def read_value(name: str, value: Any, folder: Path = Path()) -> float | str:
    """Return a value by its dotted name, as TOML has it: a quantity, a number, a choice, a file.

    A diameter is halved; a file is looked for from `folder`. Raises ValueError as
    `read_scene_file` does.
    """
    if (key := key_of(name)) != name:
        with renamed(**{key: name}):
            return float(read_value(key, value)) / 2
    if is_own(name, value):
        law_class(name, value)
        return value
    if name in CHOICES:
        require_choice(name, value, CHOICES[name])
        return value
    if name in FILES:
        if not isinstance(value, str):
            raise ValueError(f"Argument `{name}` must be a file's name, but is {value!r}.")
        return str(folder / value)
    if name.startswith(POINTS):
        point_of(name, value)
        return value
    require_parameter(name)
    parameter = NUMBERS[name]
    if isinstance(value, str):
        if re.search(_TYPOGRAPHIC, value):
            raise ValueError(f"Argument `{name}` must have no typographic quotes, but is {value}.")
        number = quantity_in(parameter.unit, name, value)
    elif isinstance(value, int | float) and not isinstance(value, bool):
        number = float(str(value))  # infinite if a whole number is too large for a float
        if parameter.unit != "1" and value != 0:
            raise ValueError(
                f"Argument `{name}` must have a unit, as in {_example(parameter.unit)}, but is "
                f'{number:.12g} (write "{number:.12g} {parameter.unit}" if that is meant).'
            )
    else:
        kind = "table" if isinstance(value, dict) else type(value).__name__
        raise ValueError(f"Argument `{name}` must be {_wanted(parameter.unit)}, but is a {kind}.")
    check_number(name, number)
    return float(number)


def read_text(name: str, text: str) -> float | str:
    """One value of a command line: as `read_value`, but a number needs no quotes.

    Raises ValueError as `read_scene_file` does.
    """
    if key_of(name) in NUMBERS and re.fullmatch(_NUMBER, text.strip()):
        return read_value(name, float(text))
    return read_value(name, text)


def read_overrides(pairs: Iterable[tuple[str, str]]) -> dict[str, float | str]:
    """Return the values of `--set KEY VALUE`, by key; the last of each counts.

    Raises ValueError as `read_scene_file` does.
    """
    pairs = list(pairs)
    make_known(pairs)
    return {key_of(name): read_text(name, text) for name, text in pairs}


def read_range(name: str, low: str, high: str) -> tuple[float, float]:
    """A lowest and a highest value; a lowest one without a unit has the other's.

    Those of a diameter are halved. Raises ValueError as `read_scene_file` does, and for a choice.
    """
    require_parameter(key_of(name))
    if re.fullmatch(_NUMBER, low.strip()):
        low = f"{low} {written_unit(high)}"
    return float(read_text(name, low)), float(read_text(name, high))


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


def require_parameter(name: str) -> None:
    """ValueError, with near misses, for a name that is not of `jaxcrusher.PARAMETERS`."""
    if name in CHOICES:
        raise ValueError(f"Argument `{name}` must be a number's key, but is a choice's.")
    if name not in NUMBERS:
        raise unknown(name, _keys())


def unknown(name: str, keys: tuple[str, ...]) -> ValueError:
    """Return the error, with near misses, of a name that is none of the keys."""
    return ValueError(f"Argument `{name}` must be a known key, but is not{_suggestion(name, keys)}")


def require_moving(argument: str, name: str) -> None:
    """ValueError, of the `argument`, for a name that is no number of the motion."""
    key = key_of(name)
    require(key == name, argument, f"name the radius, {key}", name)
    require_parameter(name)
    must = "name numbers of the motion, such as speed, jaw.mass or toggle.length"
    require(name not in CHAMBER, argument, must, f"{name}, the capacity's")
    require(name not in SITE, argument, must, f"{name}, which a scene file or --set alone may have")


def require_continuous(argument: str, name: str) -> None:
    """ValueError, of the `argument`, for a name that is no number that motions have slopes by."""
    require_moving(argument, name)
    require(name not in WHOLE, argument, "name a number that may vary continuously", name)


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


def typed_in(unit: str, name: str, text: str) -> float:
    """Return what `quantity_in` does, of a command line: there a number of no unit has no quotes.

    Raises ValueError as that does.
    """
    if unit == "1" and re.fullmatch(_NUMBER, text.strip()):
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
        if re.fullmatch(rf"\s*{_NUMBER}\s*", text):
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
    except (pint.UndefinedUnitError, ValueError):
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
    # TypeError: decibel and the like; KeyError: an exponent of zero.
    except (pint.UndefinedUnitError, ValueError, TypeError, KeyError):
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
    """Decimal, so that "0.06 mm" is the float 0.06e-3."""
    registry = pint.UnitRegistry(non_int_type=Decimal)  # pyright: ignore
    for known, alias in (("turn", "rev"), ("metric_horsepower", "PS"), ("force_kilogram", "kp")):
        registry.define(f"@alias {known} = {alias}")
    return registry


def parse_unit(text: str) -> pint.Unit:
    """Return the unit of a text such as "kg m2"; "1" is that of a number without one."""
    if text == "1":
        return _registry().dimensionless
    if not _UNIT.fullmatch(text):
        raise ValueError(text)
    plain = text.replace("·", "*").replace("^", "**")
    return _registry().parse_units(_EXPONENT.sub(r"**\1", plain))


def flattened(table: dict[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Yield dotted names and values of nested tables."""
    for key, value in table.items():
        name = prefix + key
        if isinstance(value, dict) and value and name not in _keys():
            yield from flattened(value, f"{name}.")
        elif name not in _tables((*NUMBERS, *OF_LINKAGES)):
            yield name, value
        elif value != {}:
            raise ValueError(f"Argument `{name}` must be a table [{name}], but is {value!r}.")


def _suggestion(name: str, keys: tuple[str, ...]) -> str:
    """Near misses, or what there is."""
    head, _, tail = name.rpartition(".")
    top, tables = name.partition(".")[0], _tables(keys)
    known = dict.fromkeys([*(key for key in keys if "." not in key), *tables])
    if head and top not in tables:
        near = [f"[{table}]" for table in get_close_matches(top, tables, n=1)]
        return f"; did you mean {near[0]}?" if near else f"; there are {', '.join(known)}."
    inside = [key for key in keys if head and key.startswith(f"{head}.")]
    elsewhere = [key for key in keys if key.rpartition(".")[2] == tail]
    elsewhere = [key for key in elsewhere if key.partition(".")[0] == top] or elsewhere
    if inside:
        short = {key.rpartition(".")[2]: key for key in inside}
        near = [short[each] for each in get_close_matches(tail, short, n=1)] or elsewhere
    else:
        near = elsewhere or get_close_matches(name, (*keys, *tables), n=1)
    if near:
        return f"; did you mean {' or '.join(near)}?"
    return f"; there are {', '.join(inside or known)}."


def scene_of(values: Mapping[str, Any], path: Path | None, given: Iterable[str] = ()) -> Scene:
    """Return `build_scene`, with refusals as `naming` makes them."""
    with naming(path, given):
        return build_scene(values)


@contextmanager
def naming(path: Path | None, given: Iterable[str] = NUMBERS) -> Iterator[None]:
    """Let refusals begin with the file that a description is from.

    They name those of their numbers that are not among the `given` ones, and so the PE250x400's.
    Without `given` all numbers are.
    """
    try:
        yield
    except ValueError as error:
        if path is None:
            raise
        said = str(error).removeprefix("Argument ")
        left = [name for name in NUMBERS if f"`{name}`" in said and name not in set(given)]
        also = f" The file leaves {' and '.join(left)} to the PE250x400." if left else ""
        raise ValueError(f"{path}: {said}{also}") from None

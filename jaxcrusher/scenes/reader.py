"""The one reader of what describes a machine: a TOML file, a command line, or tables in Python.

```toml
speed = "286 rpm"
clearance = "0.06 mm"
friction = 0.1
start = "contact"

[jaw]
mass = "524 kg"
```

Keys and tables are the names of `PARAMETERS`, `CHAMBER` and `CHOICES` of
`jaxcrusher.scenes.parameters`; a missing key takes the paper's value. With
`kind = "linkage"` they are those of `jaxcrusher.scenes.linkages`. A bare number is refused where a
unit could be meant: its author may mean 0.10 in millimetres, and 250 in rpm.

A description goes through the same steps whatever it describes: entries by their names, what ties
the machine together, units, unknown keys, what comes with what, limits, and whether links close.
"""

import re
import sys
import tomllib
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

from jaxcrusher.basics.checks import renamed, require, require_choice
from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.scenes.build import Crusher
from jaxcrusher.scenes.linkages import drawn
from jaxcrusher.scenes.machine import Machine
from jaxcrusher.scenes.own_laws import is_own, law_class
from jaxcrusher.scenes.parameters import (
    CHAMBER,
    CHOICES,
    FILES,
    NUMBERS,
    OF_LINKAGES,
    POINTS,
    SITE,
    check_number,
    key_of,
    openers,
    refuse_others,
    tables_of,
    unknown,
)
from jaxcrusher.scenes.units import (
    NUMBER,
    TYPOGRAPHIC,
    number_in,
    point_of,
    quantity_in,
    units_of,
    written_unit,
)

KINDS = ("crusher", "linkage")
TABLES = frozenset(tables_of((*NUMBERS, *OF_LINKAGES, POINTS)))
# The paper's crusher, of whose names those are that no machine is named for.
PAPER = Machine(Crusher())
# Reads a number of a unit, by its name and what is given.
Number = Callable[[str, str, Any], Any]


def read_machine(path: Path | str | None, overrides: Sequence[tuple[str, str]] = ()) -> Machine:
    """Return the machine of a TOML file, a crusher or, with `kind = "linkage"`, any linkage.

    `overrides` are names with texts that replace the file's. With no file they change the paper's
    crusher. Raises ValueError of one line, with the file and the key, for a machine that cannot be
    read or built.
    """
    path = None if path is None else Path(path)
    found = _read(() if path is None else read_entries(path), path, overrides, number_in)
    # A linkage takes nothing from the PE250x400.
    with naming(path, found.given if isinstance(found.structure, Crusher) else NUMBERS):
        found.scene()
    return found


def read_scene(path: Path | str) -> Scene:
    """Return the scene of a TOML file, a crusher's or, with `kind = "linkage"`, of any linkage.

    Raises ValueError of one line, with the file and the key.
    """
    return read_machine(path).scene()


def linkage_machine(**description: Any) -> Machine:
    """Return a linkage as a machine: the tables of a file as keywords, numbers in SI units.

    **Arguments:** as in a file of `kind = "linkage"` (see `jaxcrusher.scenes.linkages`), each table
    a mapping: `crank`, `speed`, `bodies`, `joints`, `slides`, `forces`, `springs`, `points`,
    `assembly`, `foundation`. A number is in SI units, or a text with its unit.

    **Returns:** a `Machine`, for sweeps, maps, identification and the search.

    Raises ValueError of one line as `read_machine` does.
    """

    def number(unit: str, name: str, value: Any) -> Any:
        return number_in(unit, name, value) if isinstance(value, str) else value

    found = _read(flattened(description | {"kind": "linkage"}), None, (), number)
    found.scene()
    return found


def linkage(**description: Any) -> Scene:
    """Return the scene of a linkage; arguments and errors as of `linkage_machine`."""
    return linkage_machine(**description).scene()


def read_scene_file(
    path: Path | str | None, overrides: Iterable[tuple[str, str]] = ()
) -> dict[str, Any]:
    """The values for `jaxcrusher.build_scene` in a crusher's TOML file, numbers in SI units.

    `overrides`, as of `--set`, replace the file's values. The file's stroke is
    that of the overridden links, unless a stroke or an eccentricity is overridden. Without a file
    the overrides are all values.

    Raises ValueError of one line, with the file and the key, for a file that cannot be read or is
    not TOML, a key that is unknown, a wrong type or unit, a missing unit, a number outside its
    limits, and an unknown choice. `build_scene` checks whether the values together make a crusher.
    """
    path = None if path is None else Path(path)
    entries = () if path is None else read_entries(path)
    return dict(_read(entries, path, overrides, number_in).given)


def kind_of(path: Path | None) -> str:
    """Return the `kind` of a scene file; without one it is a crusher's.

    Raises ValueError for an unknown kind.
    """
    kind = dict(() if path is None else read_entries(path)).get("kind", KINDS[0])
    with naming(path):
        require_choice("kind", kind, KINDS)
    return kind


def _read(
    entries: Iterable[tuple[str, Any]],
    path: Path | None,
    overrides: Iterable[tuple[str, str]],
    number: Number,
) -> Machine:
    """Return the machine of entries and of what overrides them; its scene is not made yet."""
    entries, overrides = list(entries), list(overrides)
    folder, crushes = Path() if path is None else path.parent, True
    with naming(path):
        structure, left, rest = Crusher(), (), [one for one in entries if one[0] != "kind"]
        kind = dict(entries).get("kind", KINDS[0])
        require_choice("kind", kind, KINDS)
        if kind == "linkage":
            (structure, rest, left), crushes = drawn(entries, folder), False
        known, written = Machine(structure, _laws(rest, folder)), {}
        for name, _ in rest:
            key = _key(name, known)
            if crushes:
                refuse_others(key)
            other = written.get(key, name)
            require(other == name, name, f"not stand beside `{other}`", "given")
            require(key not in written, name, "be given once", "given twice")
            written[key] = name
        given = {_key(n, known): read_value(n, one, folder, known, number) for n, one in rest}
    over = read_overrides(overrides, known)
    with naming(path, {**given, **over} if crushes else NUMBERS):
        values = structure.merged(given, over)
        found = Machine(structure, values, units_of(rest) | units_of(overrides))
        own = () if crushes else (n for n in found.values if n in found.numbers and n not in values)
        return replace(found, defaults=(*(n for n in own if n.startswith("joints.")), *left))


def _laws(entries: Iterable[tuple[str, Any]], folder: Path = Path()) -> dict[str, str]:
    """Return the laws of one's own that entries choose; their modules may be in the folder."""
    laws = {name: text for name, text in entries if is_own(name, text)}
    for name, text in laws.items():
        law_class(name, text, folder)
    return laws


def _key(name: str, machine: Machine) -> str:
    """Return the name of a machine's number that is meant, of a diameter its radius."""
    return key_of(name) if key_of(name) in machine.numbers else name


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
    if "integer string conversion" in error:
        return f"a whole number has more than {sys.get_int_max_str_digits()} digits"
    if place is None:
        return error
    line = text.split("\n")[int(place[1]) - 1]
    if re.search(rf"=\s*{TYPOGRAPHIC}", line):
        return f'line {place[1]} has typographic quotes: write straight ones, "..."'
    if comma := re.match(r"[^#\"']*=\s*([+-]?\d+),(\d+)", line):
        return f"line {place[1]} has a decimal comma: write {comma[1]}.{comma[2]}"
    if bare := re.match(rf"[^#\"']*=\s*({NUMBER}\s*[^\W\d][^#]*)", line):
        return f'line {place[1]} has a quantity without quotes: write "{bare[1].strip()}"'
    return error


def read_value(
    name: str,
    value: Any,
    folder: Path = Path(),
    machine: Machine = PAPER,
    number: Number = number_in,
) -> float | str:
    """Return a value by its dotted name, as TOML has it: a quantity, a number, a choice, a file.

    A diameter is halved; a file is looked for from `folder`; `number` reads numbers. Raises
    ValueError as `read_scene_file` does.
    """
    if (key := _key(name, machine)) != name:
        with renamed(**{key: name}):
            return float(read_value(key, value, folder, machine, number)) / 2
    if name in machine.choices:
        if is_own(name, value):
            law_class(name, value, folder)
        else:
            require_choice(name, value, machine.choices[name])
        return value
    if name in FILES:
        if not isinstance(value, str):
            raise ValueError(f"Argument `{name}` must be a file's name, but is {value!r}.")
        return str(folder / value)
    if name.startswith(POINTS):
        point_of(name, value)
        return value
    require_parameter(name, machine)
    found = number(machine.numbers[name].unit, name, value)
    check_number(name, found, machine.numbers)
    return float(found)


def read_text(name: str, text: str, machine: Machine = PAPER) -> float | str:
    """One value of a command line: as `read_value`, but a number needs no quotes.

    Raises ValueError as `read_scene_file` does.
    """
    if _key(name, machine) in machine.numbers and re.fullmatch(NUMBER, text.strip()):
        return read_value(name, float(text), machine=machine)
    return read_value(name, text, machine=machine)


def read_overrides(
    pairs: Iterable[tuple[str, str]], machine: Machine = PAPER
) -> dict[str, float | str]:
    """Return the values of `--set KEY VALUE`, by key; the last of each counts.

    Raises ValueError as `read_scene_file` does.
    """
    pairs, laws = list(pairs), _laws(pairs)
    known = Machine(machine.structure, {**machine.given, **laws}) if laws else machine
    return {_key(name, known): read_text(name, text, known) for name, text in pairs}


def read_range(name: str, low: str, high: str, machine: Machine = PAPER) -> tuple[float, float]:
    """Return a lowest and a highest value; a lowest one without a unit has the other's.

    Diameters are halved. Raises ValueError as `read_scene_file` does, and for a choice.
    """
    require_parameter(_key(name, machine), machine)
    if re.fullmatch(NUMBER, low.strip()):
        low = f"{low} {written_unit(high)}"
    return float(read_text(name, low, machine)), float(read_text(name, high, machine))


def read_bulk_density(written: str | None) -> float | None:
    """Return a bulk density in kg/m3, None where none is written.

    Raises ValueError for a text that is no positive density.
    """
    if written is None:
        return None
    density = quantity_in("kg/m3", "bulk_density", written)
    require(density > 0, "bulk_density", "be > 0", written)
    return density


def require_parameter(name: str, machine: Machine = PAPER) -> None:
    """Raise ValueError, with similar names, for a name that is no number of a machine."""
    if name in machine.choices:
        raise ValueError(f"Argument `{name}` must be a number's key, but is a choice's.")
    if name not in machine.numbers:
        files = FILES if isinstance(machine.structure, Crusher) else ()
        raise unknown(name, (*machine.numbers, *machine.choices, *files))


def require_moving(argument: str, name: str, machine: Machine = PAPER) -> None:
    """Raise ValueError, with the `argument`, for a name that is no number of the motion."""
    key = _key(name, machine)
    require(key == name, argument, f"name the radius, {key}", name)
    require_parameter(name, machine)
    must = "name numbers of the motion, such as speed, jaw.mass or toggle.length"
    require(name not in CHAMBER, argument, must, f"{name}, the capacity's")
    require(name not in SITE, argument, must, f"{name}, which a scene file or --set alone may have")


def require_continuous(argument: str, name: str, machine: Machine = PAPER) -> None:
    """Raise ValueError, with the `argument`, for a name that motions have no slopes by."""
    require_moving(argument, name, machine)
    must = "name a number that may vary continuously"
    require(not machine.numbers[name].whole, argument, must, name)


def flattened(table: dict[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Yield dotted names and values of nested tables."""
    for key, value in table.items():
        name = prefix + key
        if isinstance(value, dict) and value and name not in (*NUMBERS, *CHOICES, *FILES):
            yield from flattened(value, f"{name}.")
            continue
        _require_written(name, value)
        if name not in TABLES:
            yield name, value
        elif value != {}:
            raise ValueError(f"Argument `{name}` must be a table [{name}], but is {value!r}.")


def _require_written(name: str, value: Any) -> None:
    """Refuse whole numbers of so many digits that Python does not write them."""
    try:
        str(value)
    except ValueError:
        most = f"more than {sys.get_int_max_str_digits()}"
        raise ValueError(f"Argument `{name}` must have fewer digits, but has {most}.") from None


@contextmanager
def naming(path: Path | None, given: Iterable[str] = NUMBERS) -> Iterator[None]:
    """Let errors begin with the file that a description is from.

    An error also names those of its numbers that are not `given`, and so are the PE250x400's: of a
    part that is there by its own number alone, such as a clearance of joint B, it has none. Without
    `given` all numbers count as given.
    """
    try:
        yield
    except ValueError as error:
        if path is None:
            raise
        said = str(error).removeprefix("Argument ")
        theirs = (name for name in NUMBERS if name not in (*given, *openers(name)))
        left = [name for name in theirs if f"`{name}`" in said]
        also = f" The file leaves {' and '.join(left)} to the PE250x400." if left else ""
        raise ValueError(f"{path}: {said}{also}") from None

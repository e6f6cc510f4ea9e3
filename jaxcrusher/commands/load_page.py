"""The page of a load sheet: tables for screen and paper, which an engineer reads and signs."""

import itertools
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import equinox as eqx
import numpy as np
from jinja2 import Environment

from jaxcrusher.files.provenance import provenance
from jaxcrusher.files.text import number, with_error
from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.scenes.machine import Machine
from jaxcrusher.scenes.parameters import in_words
from jaxcrusher.scenes.units import said
from jaxcrusher.sheets.load_sheet import (
    AMPLIFIED,
    ANCHOR,
    HARMONICS,
    MATTERS,
    MOVING,
    STATIC,
    SUPPORTS,
    UPLIFT,
    VERDICTS,
    Row,
)
from jaxcrusher.sheets.severity import REPLACED, SOURCE

TITLE = "Load sheet of a machine's foundation"
PAGE = Path(__file__).with_name("load_sheet.html")
SIGNS = (
    "Forces are those on the frame and on the ground: x to the right, y up, moments "
    "counterclockwise. Harmonics are A cos(k theta + phi) of the shaft angle theta at mean speed, "
    "0 where the eccentric is at +x. An exciting force is that on a frame at rest, less its mean, "
    "and belongs into a model that has the machine's whole mass."
)
RESONANCE = (
    "A mode is in resonance with an order near its natural frequency if it amplifies that order "
    f"{AMPLIFIED:g} times or more, and makes {100 * MATTERS:g} % or more of the block's RMS speed."
)
FACTOR = "The dynamic factor counts what moves; 3 is the fatigue factor of DIN 4024-1¹."
HOLDING = (
    "A support carries the dead load G, and what moves lifts it by Z at most. With the dynamic "
    "factor it presses with G - factor Z at least; where that is below zero it pulls, and needs an "
    "anchor force of factor Z - G. The springs of the model pull as they press: its motion holds "
    "if the anchors are tightened to that force or more. Soil cannot pull: a block on it gapes "
    "there, and has to be heavier or wider. No partial factors are in these numbers."
)
NOT_LOOKED_UP = (
    "Norms and tables that nobody could look up while this program was written, and whose numbers "
    "no print has confirmed:"
)
DYNAMIC_FACTOR = "DIN 4024-1 (the dynamic factor of 3)"
SOIL = "Pais and Kausel (1988), tables 2-2 and 2-3 of NIST GCR 12-917-21 (springs of soil)"
SOIL_KEYS = "foundation.soil."
# Entries of the heading that the inputs or the assumptions repeat.
IN_TABLES = ("machine", "date", "loads", "masses", "foundation", "assumed", "from the PE250x400")
IN_TABLES += ("equivalent loads",)
SMALL = 5e-4  # share of the unit below which a number is shown as 0


class Grid(NamedTuple):
    """A table: its title, headings that span several columns, headings of columns, and lines.

    `words` says how many columns at the left hold words, and whether the last column does.
    """

    title: str
    spans: Sequence[tuple[str, int]]
    headings: Sequence[str]
    lines: Sequence[Sequence[str]]
    words: tuple[int, bool] = (2, True)


def _above_noise(value: float, least: float) -> float:
    return value if abs(value) >= least else 0.0


class Amount(NamedTuple):
    """A number of the sheet as text: with ideal joints, with its scatter, and its phase.

    `value` ends with the range over the assumptions, if there is a range.
    """

    ideal: str
    value: str
    phase: str


def amount(row: Row, largest: float) -> Amount:
    """Return a number as text; `ideal` is empty where the row has no ideal number.

    Numbers below `SMALL` units are shown as 0, or below `SMALL` times the `largest` if this is less
    than a unit. A `largest` below 1e-6 units is rounding. Shares below 0.05 % are shown as 0.
    """
    least = 0.05 if row.unit == "%" else SMALL * float(np.clip(largest, 1e-6, 1.0))
    value, ideal, low, high = (
        of if isinstance(of, str) else number(_above_noise(of, least))
        for of in (row.value, row.ideal, row.lowest, row.highest)
    )
    still = value == "0"
    scatter = 0.0 if row.scatter == "" else _above_noise(float(row.scatter), least)
    if scatter > 1e-4 * abs(row.value):
        value = with_error(_above_noise(row.value, least), scatter)
    phase = "" if isinstance(row.phase_rad, str) else f"{np.degrees(row.phase_rad):z.0f}°"
    return Amount(ideal, f"{value}\n({low} to {high})" if low else value, "" if still else phase)


def _amounts(rows: Sequence[Row]) -> dict[tuple[str, float | str], Amount]:
    """Return the rows of a part of the sheet as text, by name and order."""
    largest = {}
    for row in rows:
        largest[row.unit] = max(largest.get(row.unit, 0.0), abs(row.value))
    return {(row.name, row.order): amount(row, largest[row.unit]) for row in rows}


def _named(order: float | str) -> str:
    return order if isinstance(order, str) else f"order {order:g}"


def has_soil(values: Iterable[str]) -> bool:
    """Tell from the names of a machine's numbers whether it stands on soil."""
    return any(name.startswith(SOIL_KEYS) for name in values)


def is_loose(rows: Sequence[Row]) -> bool:
    """Tell whether the rows have numbers of ideal joints beside those of loose joints."""
    return any(row.ideal != "" for row in rows)


def listed(rows: Sequence[Row]) -> list[Grid]:
    """Return the parts of the sheet for a screen, with one line for each number.

    The harmonics of the motion are long, and only the file contains them.
    """
    grids, columns = [], ["ideal", "loose ± error"] if is_loose(rows) else ["ideal"]
    for part in dict.fromkeys(row.part for row in rows if row.part != MOVING):
        inside = [row for row in rows if row.part == part]
        told, lines = _amounts(inside), []
        for row in inside:
            one = told[row.name, row.order]
            value = f"{one.value} at {one.phase}" if one.phase else one.value
            numbers = [one.ideal, value][-len(columns) :]
            lines.append((row.name, _named(row.order), row.unit, *numbers, row.remark))
        grids.append(Grid(part, [], ["", "", "unit", *columns, ""], lines))
    return grids


def by_name(title: str, rows: Sequence[Row], *, remarks: bool = True) -> Grid:
    """Return a table with a line for each quantity, and columns for its orders and kinds."""
    told = _amounts(rows)
    orders = list(dict.fromkeys(row.order for row in rows))
    alike = all(one.ideal in ("", one.value) for one in told.values())
    kinds = [""] if alike else ["ideal", "loose"]
    lines = []
    for name in dict.fromkeys(row.name for row in rows):
        own = {row.order: row for row in rows if row.name == name}
        units = list(dict.fromkeys(row.unit for row in own.values() if row.unit != "%"))
        cells = []
        for order in orders:
            one = told.get((name, order), Amount("", "", ""))
            cells += [one.ideal, one.value][-len(kinds) :]
        remark = "; ".join(dict.fromkeys(row.remark for row in own.values() if row.remark))
        lines.append((name, "/".join(units), *cells, *([remark] if remarks else [])))
    shares = {row.order for row in rows if row.unit == "%"}
    spans = [(f"{_named(o)}, %" if o in shares else _named(o), len(kinds)) for o in orders]
    headings = ["", "unit", *kinds * len(orders), *([""] if remarks else [])]
    spans = [("", 2), *spans, *([("", 1)] if remarks else [])] if any(orders) else []
    return Grid(title, spans, headings, lines, (2, remarks))


def by_order(title: str, rows: Sequence[Row], names: Sequence[str]) -> Grid:
    """Return a spectrum: lines for each order and for all orders above, columns for quantities."""
    inside = [row for row in rows if row.name in names]
    told, units = _amounts(inside), {row.name: row.unit for row in inside}
    kinds = ["ideal", "loose", "phase"] if is_loose(inside) else ["ideal", "phase"]
    lines = []
    for order in dict.fromkeys(row.order for row in inside):
        cells = [told[name, order][3 - len(kinds) :] for name in names]
        lines.append((_named(order), *itertools.chain(*cells)))
    spans = [("", 1), *((f"{name}, {units[name]}", len(kinds)) for name in names)]
    return Grid(title, spans, ["", *kinds * len(names)], lines, (1, False))


def spectra(title: str, rows: Sequence[Row], which: Callable[[str], bool]) -> list[Grid]:
    """Return the spectra of the quantities that `which` selects, two or three side by side."""
    inside = [row for row in rows if row.part == HARMONICS and which(row.name)]
    names = list(dict.fromkeys(row.name for row in inside))
    width = 3 if len(names) % 2 else 2
    groups = [names[i : i + width] for i in range(0, len(names), width)]
    return [by_order("" if i else title, inside, group) for i, group in enumerate(groups)]


def soils(sheets: Mapping[str, Sequence[Row]]) -> Grid | None:
    """Compare the sheets of ideal joints on several soils; None with fewer than two sheets."""
    if len(sheets) < 2:
        return None
    wanted: dict[tuple[str, str, float | str], str] = {}
    for row in itertools.chain(*sheets.values()):
        kept = (
            row.part == "springs and dampers"
            or (row.part == "natural modes" and "undamped" in row.name)
            or (row.part == HARMONICS and row.order == 1.0 and SUPPORTS[-1] in row.name)
            or (row.part == "motion" and row.order == "RMS" and "of G" in row.name)
            or row.order == ANCHOR
        )
        if kept:
            wanted[row.part, row.name, row.order] = row.unit
    found = [{(r.part, r.name, r.order): r for r in rows} for rows in sheets.values()]
    lines = []
    for (part, name, order), unit in wanted.items():
        cells = [amount(one[part, name, order], 1.0).value for one in found]
        lines.append((f"{name}, {_named(order)}" if order else name, unit, *cells))
    remarks = [one[VERDICTS, "overall zone", ""].remark.partition(",")[0] for one in found]
    lines.append(("overall zone", "", *remarks))
    lines.append(
        ("resonances", "", *(f"{one[VERDICTS, 'resonances', ''].value:g}" for one in found))
    )
    title = "The same with other soil, ideal joints"
    return Grid(title, [], ["", "unit", *sheets], lines, (2, False))


class Input(NamedTuple):
    """A number or choice of a machine in words, with its value and its meaning."""

    name: str
    value: str
    meaning: str


def inputs(machine: Machine) -> tuple[list[Input], list[Input]]:
    """Return the numbers and choices that were given, and those that are defaults.

    Defaults that do not influence the scene are left out, such as Young's modulus beside rollers.
    """
    base, given, left = machine.scene(), [], []
    for name, value in machine.values.items():
        if name not in machine.given or name in machine.defaults:
            if _counts(machine, base, name, value):
                left.append(_input(machine, name, value))
        else:
            given.append(_input(machine, name, value))
    return given, left


def _input(machine: Machine, name: str, value: Any) -> Input:
    if np.ndim(value):
        return Input(in_words(name), f"a curve of {len(value)} points", "")
    parameter = machine.numbers.get(name)
    meaning = "" if parameter is None else parameter.meaning.partition("; none")[0]
    text = value if isinstance(value, str) else said(name, value, machine.units)
    choice = name in machine.choices
    return Input(in_words(name), in_words(text) if choice else text, meaning)


def _counts(machine: Machine, base: Scene, name: str, value: Any) -> bool:
    """Tell whether the scene depends on a default; choices and curves always count."""
    if isinstance(value, str) or np.ndim(value):
        return True
    try:
        other = machine.scene(**{name: value + 1e-3 * (abs(value) or 1.0)})
    except ValueError:  # a number whose limit is checked is in use
        return True
    return not eqx.tree_equal(base, other)


def norms(scene: Scene, *, soil: bool) -> list[str]:
    """Return the norms and tables of the sheet whose numbers could not be checked in print."""
    found = [DYNAMIC_FACTOR]
    found += [] if scene.supports is None else [f"{SOURCE} (zones), and {REPLACED}"]
    return found + ([SOIL] if soil else [])


def assumed(scene: Scene, head: Mapping[str, str], factor: float, *, soil: bool) -> list[str]:
    """Return the assumptions of the sheet, one sentence each."""
    found = [
        "The machine is plane: nothing moves across the drawing, and no force acts there.",
        "Bodies are rigid. The crushing load closes inside the machine and does not reach the "
        "ground; pull of belts and the starting torque of the motor are left out.",
        f"The dynamic factor is {factor:g}; partial safety factors are left to whoever signs.",
    ]
    if scene.supports is None:
        found.append("The frame is clamped: foundation.mass puts it on supports.")
    else:
        found.append("Frame and block are one rigid body. Springs and dampers are linear.")
    if soil:
        found.append(
            "Soil is an even elastic half space. Its springs are those at the running frequency. "
            "They are drawn where they act: so far apart that they turn with its rocking "
            "stiffness, and above the base where its sides carry."
        )
    if varied := head.get("equivalent loads"):
        found.append(f"Of equivalent loads: {varied}.")
    return found


def checked(scene: Scene, head: Mapping[str, str], rows: Sequence[Row]) -> list[str]:
    """Return the checks of this sheet and of the program's tests, and what is not checked."""
    found = ["Ideal joints: the motion is a periodic orbit that Newton's method has converged to."]
    if is_loose(rows):
        found.append(f"Loose joints: {head.get('loose joints', 'a run')}.")
    if scene.supports is not None:
        found.append(RESONANCE)
    tests = "momentum and energy at an instant, to rounding"
    if scene.supports is not None:
        tests += (
            "; a linear model of the block under these exciting forces, to 1e-4 in the first order;"
            " EXUDYN, to 2e-4"
        )
    found.append(f"Tests of the program compare such sheets with {tests} (docs/foundation.md).")
    found.append(
        "Not checked: strength of block and anchors, bearing capacity and settlement of the "
        "ground, other machines near by."
    )
    return found


def css_text(text: str) -> str:
    """Return a text escaped for a quoted string in a style sheet of a page."""
    return "".join(c if c.isalnum() or c in " .,-_()" else f"\\{ord(c):x} " for c in text)


def page(
    machine: Machine,
    rows: Sequence[Row],
    head: Mapping[str, str],
    pictures: Mapping[str, str],
    *,
    factor: float = 3.0,
    soil: Mapping[str, Sequence[Row]] = {},
) -> str:
    """Return the page as HTML, which prints on A4.

    **Arguments:**

    - `machine`: the machine, whose inputs the sheet lists in words.
    - `rows`: the rows that `jaxcrusher.sheets.load_sheet.sheet` returns.
    - `head`: texts of the heading, by their titles.
    - `pictures`: `sketch` and `run_up`, PNG in base 64.
    - `factor`: the dynamic factor.
    - `soil`: rows of ideal joints on each soil, by title; empty without soil.
    """
    scene, loose = machine.scene(), is_loose(rows)
    parts = {part: [row for row in rows if row.part == part] for part in {r.part for r in rows}}
    ground = has_soil(machine.values)

    def table(part: str, title: str = "", **how: Any) -> list[Grid]:
        return [by_name(title or part, parts[part], **how)] if part in parts else []

    def peaks(which: Callable[[str], bool]) -> list[Grid]:
        inside = [row for row in parts.get("peaks", []) if which(row.name) and row.unit != "%"]
        return [by_name("largest, least and RMS", inside, remarks=False)] if inside else []

    def excites(name: str) -> bool:
        return name.startswith("exciting")

    def carries(name: str) -> bool:
        return not excites(name)

    first = [row for row in parts.get(HARMONICS, []) if row.order == 1.0 and excites(row.name)]
    other = soils(soil)
    sections = {
        "Summary": [
            *table(VERDICTS),
            *([by_name("exciting force, first order", first[:3])] if first else []),
            *table(UPLIFT, "uplift and anchors"),
        ],
        "Exciting forces and moments, frame at rest": [
            *spectra("spectrum: amplitudes by orders of the shaft", rows, excites),
            *peaks(excites),
        ],
        "Loads on the ground": [
            *table(STATIC),
            *spectra("spectrum of the supports' forces", rows, carries),
            *peaks(carries),
        ],
        "Springs, natural modes and resonance": [
            *(table("springs and dampers") if other is None else [other]),
            *table("natural modes"),
        ],
        "Motion of the block": [*table("motion"), *table("run-up and run-down")],
    }
    given, left = inputs(machine)
    return (
        Environment(autoescape=True)
        .from_string(PAGE.read_text(encoding="utf-8"))
        .render(
            title=TITLE,
            head=head,
            about={name: text for name, text in head.items() if name not in IN_TABLES},
            running_head=css_text(f"{TITLE}: {head.get('machine', '')[:60]}"),
            inputs={"given": given, "left to defaults": left},
            sections={name: grids for name, grids in sections.items() if grids},
            loose=loose,
            pictures=pictures,
            signs=f"{SIGNS} {FACTOR}",
            holding=HOLDING if UPLIFT in parts else "",
            supports=scene.supports is not None,
            assumed=assumed(scene, head, factor, soil=ground),
            checked=checked(scene, head, rows),
            not_looked_up=NOT_LOOKED_UP,
            norms=norms(scene, soil=ground),
            made=provenance("")["source"],
        )
    )

"""`python -m jaxcrusher bearing`: loads and life of a machine's bearings, side by side."""

import itertools
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import xarray as xr
from rich.console import Console
from rich.table import Table

from jaxcrusher.basics.checks import require, require_positive
from jaxcrusher.commands.machines import (
    bounds,
    read_axes,
    read_machine,
    settings_of,
    variants_of,
    write_dataset,
)
from jaxcrusher.commands.options import Bearing
from jaxcrusher.files import table
from jaxcrusher.files.progress import stages
from jaxcrusher.files.provenance import provenance
from jaxcrusher.files.results import listed
from jaxcrusher.files.resume import begin_beside
from jaxcrusher.files.text import with_error
from jaxcrusher.joint.rollers import (
    SOURCE_OF_CLASSES,
    STATIC_PRESSURE,
    RollerBearing,
    clearance_class,
)
from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.motion.turns import Turns, require_turns, run_turns
from jaxcrusher.scenes.machine import Machine
from jaxcrusher.scenes.units import all_said, quantity_in, units_of
from jaxcrusher.sheets.bearing_sheet import (
    COLUMNS,
    NUMBERS,
    SHAKING,
    bearing_sheet,
    bearings_of,
    outputs_of,
    shaking_rms,
)
from jaxcrusher.sheets.wear import PUBLISHED, Archard

# Unit -> the unit on the screen, and the factor from the first to the second.
SHOWN = {
    "N": ("kN", 1e-3),
    "Pa": ("GPa", 1e-9),
    "W": ("kW", 1e-3),
    "h": ("h", 1.0),
    "m/h": ("mm in 1000 h", 1e6),
}
SAFETY, LIFE = 3.0, 20e3
ADVICE = (
    f"Roller bearings under shocks are asked for a static safety of {SAFETY:g} or more, and "
    f"machines of 8 h a day for 20 000 to 30 000 h (guidelines of SKF's catalogue)."
)


def run(options: Bearing, console: Console) -> int:
    """Run, print and write. Return 1 if a run failed; ValueError for bad options."""
    require_positive("seconds", options.seconds, "s")
    require_turns(options.settle, options.turns)
    wear, last = _archard(options.wear), 0.0
    for hours in options.hours:
        require(wear is not None, "hours", "come with --wear", "alone")
        require(hours > last, "hours", "increase from 0", hours)
        last = hours
    machine = read_machine(options.crusher)
    axes = read_axes(options.over, machine) if options.over else {}
    values, units = machine.values, machine.units | units_of(bounds(options.over))
    designs = [dict(zip(axes, point, strict=True)) for point in itertools.product(*axes.values())]
    for design in designs:
        machine.replace(**design).unusual()
    scenes = [machine.scene(**design) for design in designs]
    first, *_ = bearings_of(scenes[0], options.joint)
    names = "settle", "turns", "seconds", "wear", "hours"
    numbers = {name: getattr(options, name) for name in names}
    settings = settings_of("bearing", machine, over=axes, joint=first, **numbers)
    folder = begin_beside(options.results.folder, settings, "bearing.csv")

    def ended(cases: Sequence[tuple[str, Scene]]) -> dict[int, tuple[str, Turns]]:
        """Run machines and print why some fail; return the others by their place in `cases`."""
        how = {"settle": options.settle, "turns": options.turns}
        runs = []
        for title, scene in cases:
            with stages(console, title or "turns"):
                seconds = options.seconds / (2 * len(cases) * (1 + len(options.hours)))
                runs.append(
                    (title, run_turns(scene, outputs_of(scene, first), seconds=seconds, **how))
                )
        for title, run in runs:
            if run.failure:
                console.print(f"FAILED{', ' * bool(title)}{title}: {run.failure}", style="red")
        return {i: runs[i] for i in range(len(runs)) if not runs[i][1].failure}

    titles = [all_said(design, units) for design in designs]
    by_place = ended(list(zip(titles, scenes, strict=True)))
    if not by_place:
        return 1
    found = list(by_place.values())
    status, now, before = int(len(found) < len(scenes)), by_place, 0.0
    given = {place: designs[place] for place in now}
    for hours in options.hours:
        cases: dict[int, tuple[str, Scene]] = {}
        for place, (_, run) in now.items():
            title = ", ".join(filter(None, (titles[place], f"{hours:g} h")))
            given[place] = aged(machine, given[place], run, hours - before, first, wear)
            try:
                cases[place] = title, machine.scene(**given[place])
            except ValueError as error:  # a worn clearance may be too wide for the links
                console.print(f"FAILED, {title}: {error}", style="red")
        after, places = ended(list(cases.values())), list(cases)
        status, before = max(status, int(len(after) < len(now))), hours
        now = {places[i]: one for i, one in after.items()}
        found += now.values()
    kept = dataset(found, values, first, wear)
    write_dataset(folder / "bearing.csv", kept)
    for joint in kept.bearing.values:
        console.print(
            shown(
                kept.sel(bearing=joint, drop=True),
                f"bearing {scenes[0].template.joint(joint).title}",
            )
        )
    turns = ", ".join(f"{one.pieces} after {one.settled}" for _, one in found)
    console.print(
        f"Turns: {turns}. ± is the standard error, of a peak the turns' scatter. {ADVICE}"
    )
    told = scenes[0].template.joint(first).title
    for line in (
        *verdicts(kept, first, told),
        *clearances(found, first),
        *([] if wear is None else changes(found[0][1], first, wear)),
    ):
        console.print(line)
    if (lost := float(kept.impacts.sel(bearing=first)[0])) and np.isfinite(lost):
        place, (begun, _) = next(iter(by_place.items()))
        variants, refused = variants_of(machine, {**values, **designs[place]}, units)
        for line in refused:
            console.print(line)
        if variants:
            whole = ended(list(variants.items()))
            beside = dataset([found[0], *whole.values()], values, first)
            rests = ["peak_load", "impacts", "impact_speed", "contact_lost"]
            title = f"bearing {told}{', ' * bool(begun)}{begun}: impacts rest on what is assumed"
            console.print(shown(beside.sel(bearing=first, drop=True), title, rests))
            status = max(status, int(len(whole) < len(variants)))
    console.print(listed(folder, ["bearing.csv"]))
    return status


def _archard(written: tuple[str, str] | None) -> Archard | None:
    """Return Archard's law as the command line gives it; ValueError for numbers not above 0."""
    if written is None:
        return None
    units = "m2/N", "m"
    found = [quantity_in(unit, "wear", text) for unit, text in zip(units, written, strict=True)]
    for value, unit in zip(found, units, strict=True):
        require_positive("wear", value, unit)
    return Archard(*found)


def aged(
    machine: Machine,
    design: dict[str, Any],
    run: Turns,
    hours: float,
    first: str,
    wear: Archard | None,
) -> dict[str, Any]:
    """Return a design after `hours` of the run's wear: clearances of sliding joints have grown."""
    grown = dict(design)
    for joint, numbers in bearing_sheet(run, first, wear).items():
        if "wear" in numbers:
            names = f"{joint}.clearance", f"joints.{joint}.clearance", "clearance"
            name = next(name for name in names if name in machine.values)
            grown[name] = float(run.scene.joints.at(joint).clearance) + hours * numbers["wear"][0]
    return grown


def changes(run: Turns, joint: str, wear: Archard) -> list[str]:
    """Say after how many hours wear doubles each clearance, and how uncertain this is."""
    lines = []
    for one, numbers in bearing_sheet(run, joint, wear).items():
        if "wear" in numbers:
            clearance = float(run.scene.joints.at(one).clearance)
            title, hours = run.scene.template.joint(one).title, clearance / numbers["wear"][0]
            lines.append(
                f"The clearance of {1e3 * clearance:.3g} mm at {title} doubles in {hours:.2g} h at "
                f"{wear.coefficient:g} m2/N."
            )
    if lines:
        low, high = PUBLISHED
        lines.append(
            f"Published coefficients of steel on steel span {low:g} m2/N, well greased, to "
            f"{high:g} m2/N, dry (Rabinowicz, from memory), and hours are as their inverse: "
            "measure a clearance twice, and take the coefficient that it tells."
        )
    return lines


def verdicts(kept: xr.Dataset, joint: str, title: str) -> list[str]:
    """Say for each design which limits the bearing of a joint exceeds; `title` names the joint."""
    lines = []
    for design in kept.design.values:
        one = kept.sel(design=design, bearing=joint)
        passed = [
            words
            for words, beyond in (
                (f"its static safety is below {SAFETY:g}", float(one.static_safety) < SAFETY),
                (f"its life is below {LIFE:g} h", float(one.life) < LIFE),
                ("its rollers are pressed beyond 4 GPa", float(one.pressure) > STATIC_PRESSURE),
                ("it loses contact", float(one.contact_lost) > 0),
            )
            if beyond
        ]
        lines.append(
            f"Bearing {title}{', ' * bool(design)}{design}: {'; '.join(passed) or 'no limit'}."
        )
    return lines


def clearances(found: list[tuple[str, Turns]], joint: str) -> list[str]:
    """Say which clearance class a joint's roller bearing has in each design."""
    lines = []
    for title, one in found:
        bearing = one.scene.joints[joint]
        if isinstance(bearing, RollerBearing):
            try:
                name, told = clearance_class(float(bearing.bore), float(bearing.clearance))
                kind = f"is {name} ({told})"
            except ValueError:
                kind = "has no class for this bore"
            lines.append(
                f"{title + ': ' if title else ''}a play of {2e6 * float(bearing.clearance):.0f} um "
                f"in a bore of {1e3 * float(bearing.bore):.0f} mm {kind}"
            )
    return [*dict.fromkeys(lines), *([f"Classes of {SOURCE_OF_CLASSES}."] if lines else [])]


def dataset(
    found: list[tuple[str, Turns]],
    values: dict[str, Any],
    joint: str,
    wear: Archard | None = None,
) -> xr.Dataset:
    """Return the numbers of each design and bearing, the bearing of `joint` first."""
    sheets = [bearing_sheet(one, joint, wear) for _, one in found]
    joints = list(sheets[0])
    arrays = {}
    for name in NUMBERS:
        both = np.array(
            [[sheet[joint].get(name, (np.nan, np.nan)) for joint in joints] for sheet in sheets]
        )
        arrays |= {name: both[..., 0], f"{name}_scatter": both[..., 1]}
    ground = np.array([shaking_rms(one) for _, one in found])
    arrays |= {
        name: np.repeat(ground[:, i : i + 1], len(joints), axis=1)
        for i, name in enumerate(("shaking_rms", "shaking_rms_scatter"))
    }
    return table.dataset(
        ("design", "bearing"),
        arrays,
        COLUMNS,
        {"design": [title for title, _ in found], "bearing": joints},
        provenance("Bearings of a mechanism", scene=values),
    )


def shown(
    numbers: xr.Dataset, title: str, names: Iterable[str] = (*NUMBERS, "shaking_rms")
) -> Table:
    """Return the table of one bearing for the screen, with a column for each design."""
    grid = Table("", *map(str, numbers.design.values), title=title, title_justify="left", box=None)
    for name in names:
        if bool(np.isnan(numbers[name]).all()):
            continue
        column = (NUMBERS | {"shaking_rms": SHAKING})[name]
        unit, factor = SHOWN.get(column.unit, (column.unit, 1.0))
        pairs = zip(numbers[name].values, numbers[f"{name}_scatter"].values, strict=True)
        texts = [with_error(factor * value, factor * scatter) for value, scatter in pairs]
        grid.add_row(f"{column.meaning}{'' if unit == '1' else f', {unit}'}", *texts)
    return grid

"""The machines and grids of a command line in SI units, and the settings stored with results."""

import itertools
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import equinox as eqx
import numpy as np
import xarray as xr

import jaxcrusher as jc
from jaxcrusher.basics.checks import require, require_choice
from jaxcrusher.commands.options import Crusher, Ranges
from jaxcrusher.files.results import write_mat, write_netcdf, write_text
from jaxcrusher.files.table import as_csv
from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.scenes.machine import Machine, tell_about
from jaxcrusher.scenes.own_laws import is_own, with_digests
from jaxcrusher.scenes.parameters import key_of
from jaxcrusher.scenes.reader import naming, read_range, require_moving
from jaxcrusher.scenes.units import all_said

# Usually assumed numbers, not measured ones, on which impacts depend besides restitution.
ASSUMED = ("load_edge", "rollers.damping")


def read_machine(crusher: Crusher) -> Machine:
    """Return the machine of a scene file and the command line: a crusher, or any linkage.

    Lines on standard error report unusual numbers, and the numbers that a scene file leaves to the
    PE250x400 or, for a linkage, to defaults. Raises ValueError as `jaxcrusher.read_machine` does,
    and for impossible numbers.
    """
    found = jc.read_machine(crusher.scene, crusher.overrides)
    with naming(crusher.scene, found.given):
        tell_about(found, crusher.scene)
    return found


def borrowed_by(crusher: Crusher, found: Machine) -> list[str]:
    """Name the numbers that the scene file leaves to the PE250x400; none without a file."""
    return [] if crusher.scene is None else found.structure.borrowed(found.given)


def variants_of(
    found: Machine, values: Mapping[str, Any], units: Mapping[str, str]
) -> tuple[dict[str, Scene], list[str]]:
    """Return scenes with half and twice each assumed number, and reasons for impossible variants.

    For a coefficient of restitution its difference from 1 is halved and doubled: 0.9 becomes 0.95
    and 0.8. A number that does not influence the scene has no variants.
    """
    base, scenes, refused = found.scene(**values), {}, []
    losses = [name for name in values if name.rpartition(".")[2] == "restitution"]
    for name, factor in itertools.product((*ASSUMED, *losses), (0.5, 2.0)):
        if not (given := values.get(name)):
            continue
        value = 1 - factor * (1 - given) if name in losses else factor * given
        title = all_said({name: value}, units)
        try:
            scene = found.scene(**{**values, name: value})
        except ValueError as error:
            refused.append(f"Without {title}: {error}")
        else:
            scenes |= {} if eqx.tree_equal(base, scene) else {title: scene}
    return scenes, refused


def settings_of(command: str, machine: Machine, **numbers: Any) -> dict[str, Any]:
    """Return the settings stored with results: command, machine, and options that decide them."""
    kept = {"command": command, "scene": with_digests(machine.values), **numbers}
    return kept | machine.structure.record


def write_dataset(path: Path, dataset: xr.Dataset) -> None:
    """Write a dataset in the format of the path's suffix: .nc, .csv, or .mat for MATLAB."""
    if path.suffix == ".csv":
        write_text(path, as_csv(dataset))
    else:
        {".nc": write_netcdf, ".mat": write_mat}[path.suffix](path, dataset)


def read_moving(crusher: Crusher) -> Machine:
    """Read a machine that has a loose joint. ValueError also if all joints are ideal."""
    found = read_machine(crusher)
    require(not found.scene().is_ideal, "joint", "have clearance to move in", "ideal")
    return found


def bounds(over: Ranges) -> list[tuple[str, str]]:
    """Return the text of each axis's highest value, whose unit serves the lowest one too."""
    return [(name, rest[1]) for name, *rest in over if len(rest) == 3]


def read_axes(over: Ranges, machine: Machine) -> dict[str, list]:
    """Return the axes of a grid of machines: name -> values in SI units, or choices.

    Raises ValueError for an unknown or repeated name, a bad bound or count, and without any axis.
    """
    require(len(over) > 0, "over", "be given at least once: NAME LOW HIGH COUNT", "missing")
    require(all(over), "over", "be NAME LOW HIGH COUNT, or the name of a choice", "empty")
    axes: dict[str, list] = {}
    for name, *rest in over:
        key = key_of(name)
        require(key not in axes, "over", "name a parameter once", f"given twice for {key}")
        if name in machine.choices:
            for choice in rest:
                if not is_own(name, choice):
                    require_choice(name, choice, machine.choices[name])
            require(len(rest) > 0, "over", f"name choices of {name}", "empty")
            axes[name] = rest
            continue
        require_moving("over", key, machine)
        require(len(rest) == 3, "over", f"be {name} LOW HIGH COUNT", " ".join([name, *rest]))
        lowest, highest, count = rest
        low, high = read_range(name, lowest, highest, machine)
        good = count.isdecimal() and int(count) >= 2
        require(good, "over", f"have a whole COUNT >= 2 for {name}", count)
        require(low < high, "over", f"have LOW < HIGH for {name}", f"{lowest} {highest}")
        axes[key] = np.linspace(low, high, int(count)).tolist()
    return axes

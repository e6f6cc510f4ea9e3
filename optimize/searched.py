"""What is searched: a machine, its free numbers with their bounds, and what to compare with."""

from dataclasses import replace
from typing import NamedTuple

from jaxcrusher.basics.checks import require
from jaxcrusher.crusher.capacity import CrushingChamber
from jaxcrusher.mechanism.scene import AbstractScene
from jaxcrusher.scenes.machine import Machine
from jaxcrusher.scenes.parameters import key_of
from jaxcrusher.scenes.reader import read_range, require_continuous
from optimize.design import Design
from optimize.options import Options
from optimize.sets import SETS, Bounds


class Searched(NamedTuple):
    """A machine and the box of its designs, as the options of a search describe them."""

    machine: Machine  # as it was given, but for its start
    design: Design
    scene: AbstractScene  # of one of the designs
    chamber: CrushingChamber | None  # None of a linkage that is no crusher
    capacity_floor: float  # m3/h
    reference: dict[str, float]  # the free numbers of the design to compare with
    compared_with: str


def startless(machine: Machine) -> Machine:
    """Return a machine without a start of its own: the search tries both itself."""
    return replace(machine, given={n: v for n, v in machine.given.items() if n != "start"})


def sets(options: Options) -> list[str]:
    """Return the sets that lines `--design` name; ValueError for one of neither kind."""
    for words in options.design:
        must = f"be NAME LOW HIGH, or one of {', '.join(SETS)}"
        require(len(words) in (1, 3), "design", must, " ".join(words))
    return [words[0] for words in options.design if len(words) == 1]


def ranges(options: Options) -> list[tuple[str, str, str]]:
    """Return the ranges of single parameters as they are written."""
    if not options.design:
        return [("speed", *options.speed), ("clearance", *options.clearance)]
    lines = (words for words in options.design if len(words) == 3)
    return [(name, low, high) for name, low, high in lines]


def written_bounds(options: Options, machine: Machine) -> Bounds:
    """Return the bounds of single parameters of a machine, in SI units.

    Raises ValueError for unknown names, for values without a unit, and for no LOW < HIGH.
    """
    found = {}
    for name, low, high in ranges(options):
        key = key_of(name)
        require_continuous("design", key, machine)
        found[key] = read_range(name, low, high, machine)
        good = found[key][0] < found[key][1]
        require(good, name, "have LOW < HIGH", f"{low} {high}")
    return found

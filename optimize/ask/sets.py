"""Free parameters of `--design`: a single parameter with its range, or a set by its name."""

import numpy as np

from jaxcrusher.basics.checks import require
from jaxcrusher.scenes.build import Crusher
from jaxcrusher.scenes.linkages import LinkageStructure
from jaxcrusher.scenes.machine import Machine
from jaxcrusher.scenes.parameters import key_of
from jaxcrusher.scenes.reader import read_range, require_continuous
from optimize.ask.design import CounterweightMoment
from optimize.ask.options import Options

# Name -> lowest and highest value, in SI units.
Bounds = dict[str, tuple[float, float]]
LINKS = ("toggle.length", "bearing.distance", "bearing.inclination", "jaw.length")
# The parameters of the set `machine` besides those of `balance`.
PARTS = (
    "shaft.mass",
    "shaft.inertia",
    "shaft.mass_centre_radius",
    "shaft.mass_centre_angle",
    "jaw.mass",
    "jaw.inertia",
    "toggle.mass",
    "toggle.inertia",
    "load",
    "bore_radius",
    "young",
    "restitution",
)
SETS = ("balance", "machine")
# A number of links or parts may change by this share of its value. With more than 5 % of the links
# no eccentricity may give the stroke (flat toggle); with more than 10 % restitution may exceed 1.
OF_LINKS, OF_PARTS = 0.05, 0.1
# A flywheel of the PE250x400 has room for this; both parts at 14 kg m are 200 kg at 0.1 m.
COUNTERWEIGHT = {
    **dict.fromkeys(CounterweightMoment.inputs, (-14.0, 14.0)),
    "counterweight.radius": (0.1, 0.35),
}
# The mass centre of the jaw may move by this share of its distance, and by this angle (rad).
DISTANCE, ANGLE = 0.1, float(np.radians(10))


def of_crusher(word: str, machine: Machine) -> Bounds:
    """Return the 9 free numbers of `balance` or the 21 of `machine`, with their bounds.

    The bounds lie around the machine's own numbers, except for the counterweight.
    """
    values = machine.values
    angle = values["jaw.mass_centre_angle"]
    found = {**COUNTERWEIGHT, "jaw.mass_centre_angle": (angle - ANGLE, angle + ANGLE)}
    shares = {"jaw.mass_centre_distance": DISTANCE, **dict.fromkeys(LINKS, OF_LINKS)}
    if word == "machine":
        shares |= dict.fromkeys(PARTS, OF_PARTS)
    for name, share in shares.items():
        low, high = sorted((values[name] * (1 - share), values[name] * (1 + share)))
        found[name] = low, high
    return found


def of_linkage(word: str, machine: Machine) -> Bounds:
    """Return bounds of mass centres for `balance`; `machine` adds masses, inertias and bearings.

    Joints stay in place on their bodies, so the motion stays the same. A mass centre may move by a
    tenth of the distance from the body's origin to its farthest joint. The mass centre of the
    crank, which carries counterweights, may move by the whole distance.
    """
    drawing, values, found = machine.structure, machine.values, Bounds()
    assert isinstance(drawing, LinkageStructure)
    for body in drawing.bodies:
        ends = [f"joints.{name}.bore" for name, bore, _ in drawing.joints if bore == body]
        ends += [f"joints.{name}.pin" for name, _, pin in drawing.joints if pin == body]
        reach = max(np.hypot(*(values.get(f"{end}.{x}", 0.0) for x in "xy")) for end in ends)
        room = float(reach) * (1.0 if body == drawing.crank else OF_PARTS)
        for axis in "xy" if room else "":
            name = f"bodies.{body}.mass_centre.{axis}"
            at = values.get(name, 0.0)
            found[name] = at - room, at + room
    shares = [f"bodies.{body}.{of}" for body in drawing.bodies for of in ("mass", "inertia")]
    for joint, *_ in drawing.joints:
        shares += [f"joints.{joint}.{of}" for of in ("bore_radius", "young", "restitution")]
    for name in shares if word == "machine" else ():
        if name in values:
            most = 1.0 if name.endswith("restitution") else np.inf
            low, high = values[name] * (1 - OF_PARTS), values[name] * (1 + OF_PARTS)
            found[name] = low, min(high, most)
    return found


# Kind of machine -> the function that returns its sets.
SETS_OF = {Crusher: of_crusher, LinkageStructure: of_linkage}


def sets(options: Options) -> list[str]:
    """Return the names of sets in `--design`; ValueError unless a line has one or three words."""
    for words in options.design:
        must = f"be NAME LOW HIGH, or one of {', '.join(SETS)}"
        require(len(words) in (1, 3), "design", must, " ".join(words))
    return [words[0] for words in options.design if len(words) == 1]


def ranges(options: Options) -> list[tuple[str, str, str]]:
    """Return the ranges of single parameters as text: name, lowest and highest value."""
    if not options.design:
        return [("speed", *options.speed), ("clearance", *options.clearance)]
    lines = (words for words in options.design if len(words) == 3)
    return [(name, low, high) for name, low, high in lines]


def written_bounds(options: Options, machine: Machine) -> Bounds:
    """Return the bounds of single parameters of a machine, in SI units.

    Raises ValueError for unknown names, for values without a unit, and unless LOW < HIGH.
    """
    found = {}
    for name, low, high in ranges(options):
        key = key_of(name)
        require_continuous("design", key, machine)
        found[key] = read_range(name, low, high, machine)
        good = found[key][0] < found[key][1]
        require(good, name, "have LOW < HIGH", f"{low} {high}")
    return found

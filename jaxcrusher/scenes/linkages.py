"""Any linkage by a TOML file or in Python: bodies, joints, slides, forces, springs, supports.

```toml
kind = "linkage"
crank = "crank"
speed = "5000 rpm"

[bodies.rod]
mass = "0.21 kg"
inertia = "2.5e-4 kg m2"
mass_centre = ["60 mm", "0 mm"]  # in the body's axes; its origin without

[joints.B]
bore = ["rod", "120 mm", "0 mm"]  # a body, or "frame", and a point in its axes
pin = ["slider", "0 mm", "0 mm"]
clearance = "0.5 mm"              # or diametral_clearance: loose; ideal without
bore_radius = "10 mm"

[slides.guide]
body = "slider"
along = [1, 0]
```

Besides there are `[forces.NAME]` (body, at, force; or curve and along), `[springs.NAME]` (begin,
end, stiffness, length, damping, preload), `[points]` whose motion is told, `[foundation]` as of a
crusher, and `[assembly]`: the side of each dyad, by one of its bodies. Two links meet to the left
(1) or to the right (-1) of the line from the outer joint of the named one to the other's; a link
and a slider meet ahead (1) or behind (-1) along the slide. The dyads follow from the joints.
Numbers are named by their place, as `joints.B.clearance` and `bodies.rod.mass_centre.x`.
"""

import dataclasses
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxcrusher.basics.checks import (
    concrete,
    is_concrete,
    nan_unless,
    renamed,
    require,
    require_choice,
    require_known,
)
from jaxcrusher.basics.plane import Arm, Vector
from jaxcrusher.joint.clearance import AbstractBearing, ClearanceJoint
from jaxcrusher.joint.friction import AmbrosioFriction
from jaxcrusher.mechanism.acting import AbstractPush, Push, PushByAngle, Spring
from jaxcrusher.mechanism.linkage import Body, Joint, Linkage, Point, Slide
from jaxcrusher.mechanism.motion import ideal_at_rest
from jaxcrusher.mechanism.named import Named
from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.mechanism.topology import FRAME, dyads_of
from jaxcrusher.scenes.build import drive_of, foundation_of, joint_of
from jaxcrusher.scenes.echo import all_said
from jaxcrusher.scenes.laws import LAWS
from jaxcrusher.scenes.load_curve import load_curve, read_curve
from jaxcrusher.scenes.machine import AbstractStructure, Machine
from jaxcrusher.scenes.parameters import (
    CHOICES,
    CHOICES_OF_A_JOINT,
    NUMBERS,
    NUMBERS_OF_A_JOINT,
    PARAMETERS,
    Parameter,
    check_number,
    complete,
    readable,
    within_limits,
)
from jaxcrusher.scenes.scene_file import (
    DIAMETERS,
    flattened,
    key_of,
    naming,
    read_entries,
    read_value,
    unknown,
)

_ANYWHERE = (-1e3, 1e3)
_PLACE = Parameter(0.0, "m", "of a point in its body's axes", _ANYWHERE, 1.0)
_DIRECTION = Parameter(0.0, "1", "of a direction", (-1e6, 1e6), 1.0)
_FORCE = Parameter(0.0, "N", "of a force in the frame's axes", (-1e12, 1e12), 1e3)
# Section -> its numbers, then its pairs of numbers; those not `_WITH_DEFAULT` are needed.
_NUMBERS = {
    "bodies": {
        "mass": Parameter(1.0, "kg", "of the body"),
        "inertia": Parameter(1.0, "kg m2", "of the body about its mass centre"),
    },
    "joints": {name: PARAMETERS[name] for name in NUMBERS_OF_A_JOINT}
    | {
        "clearance": Parameter(0.06e-3, "m", "radial clearance c of the joint"),
        "bore_radius": Parameter(0.13, "m", "radius R_i of the bore"),
        "static_speed": Parameter(0.1, "m/s", "v0 of the friction law"),
        "full_speed": Parameter(1.0, "m/s", "v1 of the friction law"),
    },
    "slides": {},
    "forces": {},
    "springs": {
        "stiffness": Parameter(1e5, "N/m", "of the spring", (0, 1e15)),
        "length": Parameter(0.1, "m", "of the spring without its preload", (0, 1e3)),
        "damping": Parameter(0.0, "N s/m", "beside the spring", (0, 1e12), 1e3),
        "preload": Parameter(0.0, "N", "pull of the spring at its length", (-1e12, 1e12), 1e3),
    },
    "points": {},
}
_PAIRS = {
    "bodies": {"mass_centre": _PLACE},
    "slides": {"along": _DIRECTION, "through": _PLACE},
    "forces": {"at": _PLACE, "force": _FORCE, "along": _DIRECTION},
}
# Of points of bodies: a body, and a pair.
_POINTS = {"joints": ("bore", "pin"), "springs": ("begin", "end")}
_CHOICES = {name: CHOICES[name] for name in ("start", "formulation")}
_TOP = ("speed", "speed_fluctuation", "fluctuation_order", "fluctuation_phase", "gravity")
_UNEVEN = _TOP[1:4]
# What a loose joint takes from the paper's joint.
_BORROWED = tuple(n for n in _NUMBERS["joints"] if n not in ("clearance", "bore_radius"))
# Numbers whose default counts where they are not given.
_WITH_DEFAULT = (*_BORROWED, "damping", "preload")
# Numbers and choices that come with a joint's clearance.
_OF_LOOSE = ("bore_radius", *_BORROWED, *CHOICES_OF_A_JOINT)
_SECTIONS = (*_NUMBERS, "foundation", "assembly")
_NAME = re.compile("[A-Za-z][A-Za-z0-9_]*")
# Where the frame's G is; of a clamped frame, the point of its moment.
_PLACE_OF_FRAME = ("foundation.x", "foundation.y")
# Supports of the frame: what a file must give of them, besides where the frame's G is.
_SUPPORTS = tuple(
    name for name in complete({"foundation.mass": 1.0}) if name.startswith("foundation.")
)
# A number -> those that come with it, besides a loose joint's.
_BROUGHT = {
    "speed_fluctuation": _UNEVEN[1:],
    "foundation.mass": [n for n in _SUPPORTS if n not in ("foundation.mass", *_PLACE_OF_FRAME)],
}


@dataclass(frozen=True)
class Drawing(AbstractStructure):
    """Which bodies a linkage has and what ties them.

    The numbers and choices go by the names that they have in a file, in SI units. Two drawings of
    one structure are equal, and share compiled programs.
    """

    crank: str
    bodies: tuple[str, ...]
    joints: tuple[tuple[str, str, str], ...]  # name, body of the bore, body of the pin
    slides: tuple[tuple[str, str], ...]  # name, body
    forces: tuple[tuple[str, str, tuple | None], ...]  # name, body, points of a curve
    springs: tuple[tuple[str, str, str], ...]
    points: tuple[tuple[str, str], ...]
    sides: tuple[int, ...]

    def scene(self, values: Mapping[str, Any]) -> Scene:
        """Return the scene of these numbers, which may be traced.

        A number that only `jax.jit` knows and that lies outside its limits becomes NaN. Raises
        ValueError as `complete` does, for a known one outside its limits, and for an unknown
        choice.
        """
        v = self._within_limits(self.complete(values))
        bearings = {
            name: _bearing(v, f"joints.{name}.")
            for name, *_ in self.joints
            if f"joints.{name}.clearance" in v
        }
        return Scene(
            linkage=self.linkage(v),
            bearings=Named(bearings),
            drive=drive_of(v),
            pushes=tuple(_push(v, *force) for force in self.forces),
            springs=tuple(_spring(v, *spring) for spring in self.springs),
            formulation=LAWS["formulation"][v.get("formulation", "eccentricity")](),
            start=LAWS["start"][v.get("start", "centred")]() if bearings else None,
            foundation=foundation_of(v),
            points=Named({name: _point(v, f"points.{name}", body) for name, body in self.points}),
        )

    def complete(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Return numbers and choices, with the defaults of those that others bring along.

        Raises ValueError of one line for a name that the linkage does not have, for one that stands
        without what it belongs to, and for what is missing of the drive, of a body, of a spring, of
        a loose joint or of supports.
        """
        known, v = self._always_known(), dict(values)
        if not v.keys().isdisjoint(("foundation.mass", *_PLACE_OF_FRAME)):
            v = dict.fromkeys(_PLACE_OF_FRAME, 0.0) | v
        if "speed_fluctuation" in v:
            v = {name: PARAMETERS[name].default for name in _UNEVEN} | v
        loose = {
            f"joints.{joint}.clearance": [f"joints.{joint}.{of}" for of in _OF_LOOSE]
            for joint, *_ in self.joints
        }
        for first, names in (_BROUGHT | loose).items():
            for name in names:
                require(first in v or name not in v, name, f"come with {first}", "alone")
                require(first not in v or name in v, name, f"be given with {first}", "missing")
            known += [first, *names] if first in v else []
        for name in v:
            if name not in known:
                raise unknown(name, tuple(known))
        for name in ("speed", *self._of_bodies_and_springs()):
            require(name in v, name, "be given", "missing")
        return v

    def _within_limits(self, values: dict[str, Any]) -> dict[str, Any]:
        """Return numbers and choices, each of which is checked as one of a file is."""
        choices = self.choices(values)
        for name, value in values.items():
            if name in choices:
                _require_choice(name, value, choices[name])
                continue
            NUMBERS.setdefault(name, _parameter(name))
            check_number(name, value)
        return within_limits(values)

    def numbers(self, values: Mapping[str, Any]) -> Mapping[str, Parameter]:
        """Return those that it has, given or not."""
        names = dict.fromkeys((*self._always_known(), *values))
        return {name: _parameter(name) for name in names if name not in self.choices(values)}

    def choices(self, values: Mapping[str, Any]) -> Mapping[str, tuple[str, ...]]:
        """Return those of the motion, and of loose joints."""
        laws = CHOICES_OF_A_JOINT.items()
        return _CHOICES | {
            f"joints.{joint}.{of}": known for joint, *_ in self.joints for of, known in laws
        }

    def left_open(self, machine: Machine) -> list[str]:
        """Return which numbers and sides the file leaves to defaults."""
        values, names = machine.values, machine.defaults
        told = [f"{name} {readable(name, values[name])}" for name in names if name in values]
        told += [f"{name} 1" for name in names if name not in values]
        return [f"leaves {len(told)} numbers to defaults: {', '.join(told)}."] if told else []

    def about(self, machine: Machine) -> dict[str, str]:
        """Return its masses and its foundation, and what is left to defaults."""
        masses = {name: machine.values[name] for name in (f"bodies.{n}.mass" for n in self.bodies)}
        given = {n: v for n, v in machine.given.items() if n.startswith("foundation.")}
        return {
            "masses": all_said(masses, machine.units),
            "foundation": all_said(given, machine.units) or "clamped",
            "assumed": ", ".join(machine.defaults) or "nothing",
        }

    @property
    def record(self) -> dict[str, str]:
        """Return the drawing in words."""
        return {"drawing": repr(self)}

    def _of_bodies_and_springs(self) -> list[str]:
        """Return the names of the numbers that each body and each spring has."""
        return [
            *(f"bodies.{name}.{of}" for name in self.bodies for of in _NUMBERS["bodies"]),
            *(f"springs.{name}.{of}" for name, *_ in self.springs for of in _NUMBERS["springs"]),
        ]

    def _always_known(self) -> list[str]:
        """Return the names that are read whatever joints are loose and the frame stands on."""
        pairs = [
            *(f"bodies.{name}.mass_centre" for name in self.bodies),
            *(f"joints.{name}.{end}" for name, *_ in self.joints for end in _POINTS["joints"]),
            *(f"slides.{name}.{of}" for name, _ in self.slides for of in _PAIRS["slides"]),
            *(f"forces.{name}.at" for name, *_ in self.forces),
            *(f"forces.{name}.{'along' if curve else 'force'}" for name, _, curve in self.forces),
            *(f"springs.{name}.{end}" for name, *_ in self.springs for end in _POINTS["springs"]),
            *(f"points.{name}" for name, _ in self.points),
        ]
        return [
            *(*_TOP, *_PLACE_OF_FRAME, *_CHOICES),
            *self._of_bodies_and_springs(),
            *(f"{pair}.{axis}" for pair in pairs for axis in "xy"),
        ]

    def linkage(self, values: Mapping[str, Any]) -> Linkage:
        """Return bodies, joints and slides."""
        v, bodies, joints, slides = values, {}, {}, {}
        for name in self.bodies:
            at = f"bodies.{name}"
            bodies[name] = Body(v[f"{at}.mass"], v[f"{at}.inertia"], _arm(v, f"{at}.mass_centre"))
        for name, bore, pin in self.joints:
            at = f"joints.{name}"
            joints[name] = Joint(_point(v, f"{at}.bore", bore), _point(v, f"{at}.pin", pin))
        for name, body in self.slides:
            at = f"slides.{name}"
            slides[name] = Slide(body, _vector(v, f"{at}.along"), _arm(v, f"{at}.through"))
        gravity = v.get("gravity", PARAMETERS["gravity"].default)
        parts = Named(bodies), Named(joints), self.crank, self.bearing, self.sides, gravity
        return Linkage(*parts, slides=Named(slides))

    @property
    def bearing(self) -> str:
        """Return the joint of crank and frame."""
        return next(n for n, *both in self.joints if {self.crank, FRAME} == set(both))


def _parameter(name: str) -> Parameter:
    """Return what is known of a number by its name, as of `joints.B.bore.x`."""
    section, _, rest = name.partition(".")
    if section not in _NUMBERS:
        return NUMBERS[name]
    key = rest.partition(".")[2]
    pairs = _PAIRS.get(section, {})
    return _NUMBERS[section].get(key) or pairs.get(key.rpartition(".")[0], _PLACE)


def _arm(values: Mapping[str, Any], name: str) -> Arm:
    """Return a point of a body; a number that is not given is zero, and is never traced."""
    return Arm(values.get(f"{name}.x"), values.get(f"{name}.y"))


def _vector(values: Mapping[str, Any], name: str) -> Vector:
    return Vector(values.get(f"{name}.x", 0.0), values.get(f"{name}.y", 0.0))


def _point(values: Mapping[str, Any], name: str, body: str) -> Point:
    return Point(body, _arm(values, name))


def _bearing(values: Mapping[str, Any], prefix: str) -> AbstractBearing:
    """Return the bearing of a loose joint."""
    bearing = joint_of(values, prefix)
    if not isinstance(bearing, ClearanceJoint) or not isinstance(
        bearing.friction, AmbrosioFriction
    ):
        return bearing
    speeds = {name: values[f"{prefix}{name}"] for name in ("static_speed", "full_speed")}
    static, full = map(concrete, speeds.values())
    if static is None or full is None:
        in_order = speeds["static_speed"] < speeds["full_speed"]
        speeds["static_speed"] = nan_unless(in_order, speeds["static_speed"])
    else:
        good = bool((static < full).all())
        require(good, f"{prefix}static_speed", f"be less than full_speed {full} m/s", static)
    friction = dataclasses.replace(bearing.friction, **speeds)
    return dataclasses.replace(bearing, friction=friction)


def _push(values: Mapping[str, Any], name: str, body: str, curve: tuple | None) -> AbstractPush:
    at = _point(values, f"forces.{name}.at", body)
    if curve is None:
        return Push(at, _vector(values, f"forces.{name}.force"))
    along = _vector(values, f"forces.{name}.along")
    return PushByAngle(at, along, load_curve(np.array(curve)))


def _spring(values: Mapping[str, Any], name: str, begin: str, end: str) -> Spring:
    at = f"springs.{name}"
    ends = _point(values, f"{at}.begin", begin), _point(values, f"{at}.end", end)
    return Spring(ends, *(values[f"{at}.{n}"] for n in _NUMBERS["springs"]))


class _Reading:
    """What the entries of a description come to, one after the other."""

    def __init__(self, entries: Iterable[tuple[str, Any]], number: Callable[[str, Any], float]):
        self.number = number
        self.values: dict[str, Any] = {}
        self.defaults: list[str] = []  # names of numbers and sides that are not given
        self.left: dict[str, Any] = {}
        self.sections: dict[str, dict[str, dict[str, Any]]] = {name: {} for name in _SECTIONS}
        self.written: dict[str, str] = {}  # name -> what is given, maybe a diameter
        for name, value in entries:
            section, _, rest = name.partition(".")
            if not rest or section == "foundation":
                self.left[name] = value
                continue
            require_known(section, _SECTIONS)
            item, _, key = rest.partition(".")
            table = self.sections[section].setdefault(item, {})
            radius = DIAMETERS.get(key, key) if section == "joints" else key
            require(radius not in table, name, f"not stand beside {radius} or its double", "given")
            table[radius] = value
            self.written[f"{section}.{item}.{radius}"] = name
        for section in _NUMBERS:
            for item, keys in self.sections[section].items():
                must = "be named by letters, digits and _, as results and MATLAB's variables are"
                require(bool(_NAME.fullmatch(item)), f"{section}.{item}", must, repr(item))
                for key in keys:
                    require_known(f"{section}.{item}.{key}".rstrip("."), _known(section, item))
        for name in self.left:
            require_known(name, ("kind", "crank", *_TOP, *_CHOICES, *_SUPPORTS))

    def keep(self, name: str, value: Any) -> None:
        """Keep a number, whose name is known from now on."""
        NUMBERS[name] = _parameter(name)
        self.values[name] = self.number(self.written.get(name, name), value)

    def pair(self, name: str, given: Any) -> None:
        """Keep the two numbers of a point or a vector but for zeros."""
        good = isinstance(given, list | tuple) and len(given) == 2
        require(good, name, f"be a pair [x, y] in {_parameter(f'{name}.x').unit}", repr(given))
        for axis, one in zip("xy", given, strict=True):
            self.keep(f"{name}.{axis}", one)
            if self.values[f"{name}.{axis}"] == 0:
                del self.values[f"{name}.{axis}"]

    def point(self, name: str, given: Any) -> str:
        """Keep a point of a body, and return the body."""
        good = isinstance(given, list | tuple) and len(given) == 3
        require(good, name, "be a point [body, x, y]", "missing" if given is None else repr(given))
        assert given is not None
        body, *pair = given
        self.body(name, body)
        self.pair(name, pair)
        return body

    def ends(self, section: str, item: str) -> tuple[str, str]:
        """Keep the two points of a joint or a spring, and return their bodies."""
        at, keys = f"{section}.{item}", self.sections[section][item]
        one, other = (self.point(f"{at}.{end}", keys.pop(end, None)) for end in _POINTS[section])
        require(one != other, at, "join two bodies", f"of {one} alone")
        return one, other

    def body(self, name: str, body: Any) -> str:
        """Return a body's name, if there is such a body."""
        known = (*self.sections["bodies"], FRAME)
        must = f"name a body: {', '.join(known)}"
        require(body in known, name, must, "missing" if body is None else repr(body))
        return str(body)

    def numbers(self, section: str, item: str) -> None:
        """Keep the numbers of an item; one without a default must be there."""
        for key, parameter in _NUMBERS[section].items():
            name, given = f"{section}.{item}.{key}", self.sections[section][item].pop(key, None)
            if given is None and key in _WITH_DEFAULT:
                NUMBERS[name], self.values[name] = parameter, parameter.default
                self.defaults += [name] if section == "joints" else []
                continue
            require(given is not None, name, f"be given in {parameter.unit}", "missing")
            self.keep(name, given)

    def ended(self) -> None:
        """Check that all has been used: a radius of a joint without clearance would be in vain."""
        for section in _NUMBERS:
            for item, keys in self.sections[section].items():
                for key in keys:
                    must = "come with what it belongs to, as a clearance or a curve"
                    require(False, f"{section}.{item}.{key}", must, "alone")


def _known(section: str, item: str) -> list[str]:
    """Return the keys that a table of a section may have."""
    if section == "points":
        return [f"points.{item}"]
    keys = [*_NUMBERS[section], *_PAIRS.get(section, ()), *_POINTS.get(section, ())]
    further = {
        "joints": tuple(CHOICES_OF_A_JOINT),
        "forces": ("body", "curve"),
        "slides": ("body",),
    }
    return [f"{section}.{item}.{key}" for key in (*keys, *further.get(section, ()))]


def _joints(reading: _Reading) -> tuple[tuple[str, str, str], ...]:
    """Read joints, and the numbers and laws of loose ones."""
    found = []
    for item, keys in reading.sections["joints"].items():
        found.append((item, *reading.ends("joints", item)))
        if "clearance" not in keys:
            continue
        reading.numbers("joints", item)
        for key, laws in CHOICES_OF_A_JOINT.items():
            name = f"joints.{item}.{key}"
            CHOICES[name] = laws  # known from now on, as numbers are
            reading.values[name] = law = keys.pop(key, laws[0])
            _require_choice(name, law, laws)
    return tuple(found)


def _require_choice(name: str, value: Any, choices: tuple[str, ...]) -> None:
    """Raise ValueError for a law that is none of the package, also for a class of one's own."""
    own = isinstance(value, str) and ":" in value
    must = "name a law of the package (one of your own is put into the joint of a scene in Python)"
    require(not own, name, must, value)
    require_choice(name, value, choices)


def drawn(
    entries: Iterable[tuple[str, Any]],
    number: Callable[[str, Any], float],
    folder: Path = Path(),
) -> Machine:
    """Return the machine of a description.

    Raises ValueError of one line for a key that is unknown or missing, a body that there is not,
    bodies that are no dyads, and links that do not close at some angle of the crank.
    """
    reading = _Reading(entries, number)
    bodies = tuple(reading.sections["bodies"])
    require(bool(bodies), "bodies", "have a table [bodies.NAME] each", "missing")
    require(FRAME not in bodies, "bodies", f"have other names than {FRAME!r}", repr(FRAME))
    crank = str(reading.left.pop("crank", "missing"))
    must = f"name the body that the drive turns: {', '.join(bodies)}"
    require(crank in bodies, "crank", must, crank)
    for item, keys in reading.sections["bodies"].items():
        reading.numbers("bodies", item)
        reading.pair(f"bodies.{item}.mass_centre", keys.pop("mass_centre", [0, 0]))
    joints = _joints(reading)
    held = any({crank, FRAME} == {bore, pin} for _, bore, pin in joints)
    require(held, "crank", "have a joint to the frame", f"{crank!r} without one")
    slides, forces, springs = [], [], []
    for item, keys in reading.sections["slides"].items():
        at = f"slides.{item}"
        slides.append((item, reading.body(f"{at}.body", keys.pop("body", None))))
        reading.pair(f"{at}.along", keys.pop("along", None))
        reading.pair(f"{at}.through", keys.pop("through", [0, 0]))
    for item, keys in reading.sections["forces"].items():
        at, curve = f"forces.{item}", None
        body = reading.body(f"{at}.body", keys.pop("body", None))
        require(body != FRAME, f"{at}.body", "be a body that moves", repr(FRAME))
        reading.pair(f"{at}.at", keys.pop("at", [0, 0]))
        if "curve" in keys:
            curve = _curve(at, keys.pop("curve"), folder)
            reading.pair(f"{at}.along", keys.pop("along", None))
        else:
            reading.pair(f"{at}.force", keys.pop("force", None))
        forces.append((item, body, curve))
    for item in reading.sections["springs"]:
        springs.append((item, *reading.ends("springs", item)))
        reading.numbers("springs", item)
    points = [
        (item, reading.point(f"points.{item}", keys.pop("", None)))
        for item, keys in reading.sections["points"].items()
    ]
    _whole(reading)
    names = tuple((name, FRAME, body) for name, body in slides)
    dyads = dyads_of((*joints, *names), tuple(n for n, _ in slides), bodies, crank)
    drawing = Drawing(
        crank,
        bodies,
        joints,
        tuple(slides),
        tuple(forces),
        tuple(springs),
        tuple(points),
        _sides(reading, dyads),
    )
    reading.ended()
    values = drawing.complete(reading.values)
    require_closing(drawing.scene(values))
    return Machine(drawing, values, defaults=tuple(reading.defaults))


def _whole(reading: _Reading) -> None:
    """Read what stands outside of tables: the drive, gravity, the start, and the supports."""
    left = reading.left
    left.pop("kind", None)
    require("speed" in left, "speed", "be given, as in '5000 rpm'", "missing")
    for name in (*_TOP, *_SUPPORTS):
        if name in left:
            reading.values[name] = reading.number(name, left.pop(name))
    for name, choices in _CHOICES.items():
        if name in left:
            require_choice(name, left[name], choices)
            reading.values[name] = left.pop(name)


def _sides(reading: _Reading, dyads: Iterable[Any]) -> tuple[int, ...]:
    """Return the side of each dyad, seen from its first body; 1 where none is given."""
    given = {body: keys.get("", keys) for body, keys in reading.sections["assembly"].items()}
    for body, side in given.items():
        good = not isinstance(side, bool) and side in (-1, 1)
        require(good, f"assembly.{body}", "be 1 or -1", repr(side))
    sides = []
    for dyad in dyads:
        slid = dyad.second_joint in reading.sections["slides"]
        seen = {dyad.first: 1, dyad.second: 1 if slid else -1}
        said = {seen[body] * given.pop(body) for body in seen if body in given}
        reading.defaults += [] if said else [f"assembly.{dyad.first}"]
        both = f"two by {dyad.first} and {dyad.second}"
        require(len(said) < 2, f"assembly.{dyad.first}", "be one side of a dyad", both)
        sides.append(int(said.pop()) if said else 1)
    for body in given:
        require(False, f"assembly.{body}", "name a body of a dyad", "none")
    return tuple(sides)


def _curve(at: str, given: Any, folder: Path) -> tuple:
    """Return the points of a curve, a file's or an array's, as tuples."""
    with renamed(load_curve=f"{at}.curve"):
        points = read_curve(folder / given if isinstance(given, str | Path) else given)
        load_curve(points)
    return tuple(map(tuple, points.tolist()))


# Least sine of the angle between two links, or between a link and the perpendicular of its slide. A
# linkage that passes a dead point comes as close to zero within half a degree of its crank.
LEAST_LEVER = 0.02


@eqx.filter_jit
def _levers(linkage: Linkage, angles: Any) -> list[Any]:
    """Return that sine of each dyad at angles of the crank; it is NaN where a dyad is open."""

    def one(angle: Any) -> list[Any]:
        motion, found = ideal_at_rest(linkage, angle), []
        for dyad in linkage.dyads:

            def at(joint: str, body: str) -> Vector:
                return motion.position(Point(body, linkage.side_of(joint, body)))

            meeting = at(dyad.meeting, dyad.first)
            u = meeting - at(dyad.first_joint, dyad.first)
            if dyad.second_joint in linkage.slides:
                v = linkage.slide(dyad.second_joint).direction.perp()
            else:
                v = at(dyad.second_joint, dyad.second) - meeting
            found.append(jnp.abs(u.cross(v)) / jnp.sqrt(u.dot(u) * v.dot(v)))
        return found

    return jax.vmap(one)(angles)


def require_closing(scene: Scene) -> None:
    """Raise ValueError for known numbers by which a dyad is open, or dead, at some degree."""
    linkage = scene.linkage
    if not is_concrete(linkage):
        return
    levers = _levers(linkage, jnp.radians(jnp.arange(360.0)))
    for dyad, lever in zip(linkage.dyads, map(np.asarray, levers), strict=True):
        must = f"let {dyad.first} and {dyad.second} meet at every angle of the crank"
        for bad, told in (
            (np.isnan(lever), "open"),
            (lever < LEAST_LEVER, "at a dead point, from which they may go on either way,"),
        ):
            value = f"{told} at a crank angle of {np.argmax(bad)} deg"
            require(not bad.any(), "bodies", must, value)


def _number(name: str, value: Any) -> float:
    """Return a number as Python gives it: in SI units, or a text with its unit."""
    if isinstance(value, str):
        return float(read_value(name, value))
    key = key_of(name)
    check_number(key, value)
    return float(value) if key == name else float(value) / 2  # a diameter


def linkage_machine(**description: Any) -> Machine:
    """Return a linkage as a machine: the tables of a file as keywords, numbers in SI units.

    **Arguments:** as in a file of `kind = "linkage"` (see `jaxcrusher.scenes.linkages`), each table
    a mapping: `crank`, `speed`, `bodies`, `joints`, `slides`, `forces`, `springs`, `points`,
    `assembly`, `foundation`. A number is in SI units, or a text with its unit.

    **Returns:** a `Machine`, for sweeps, maps, identification and the search.

    Raises ValueError of one line as `drawn` does.
    """
    return drawn(flattened(description), _number)


def linkage(**description: Any) -> Scene:
    """Return the scene of a linkage; arguments and errors as of `linkage_machine`."""
    read = linkage_machine(**description)
    assert isinstance(read.structure, Drawing)
    return read.structure.scene(read.given)


def read_linkage(path: Path | str) -> Machine:
    """Return the machine of a file of `kind = "linkage"`.

    Raises ValueError of one line, with the file and the key, as `drawn` and `read_scene_file` do.
    """
    path = Path(path)
    entries = read_entries(path)
    with naming(path):
        return drawn(entries, lambda name, value: float(read_value(name, value)), path.parent)

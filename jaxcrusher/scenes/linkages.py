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
contact_law = "my_laws:Impact"    # or one of the package's; with numbers of its own

[slides.guide]
body = "slider"
along = [1, 0]
```

Further tables are `[forces.NAME]` (body, at, force; or curve and along; of a rough feed scatter,
bandwidth and seed), `[springs.NAME]` (begin, end, stiffness, length, damping, preload), `[points]`
of bodies or of a frame on supports, where sensors sit, `[foundation]` as of a crusher, and
`[assembly]`: the side of each dyad, by one of its bodies. Two links meet to the left (1) or to the
right (-1) of the line from the outer joint of the named link to that of the other link; a link and
a slider meet ahead (1) or behind (-1) along the slide. In a triad, a middle body meets three others
that hang on bodies before them. For it the table gives a rough pose at crank angle zero:
`coupler = ["300 mm", "0 mm", "10 deg"]`, the place of its origin and the angle of its x axis. Dyads
and triads follow from the joints.
Numbers are named by their place, as `joints.B.clearance` and `bodies.rod.mass_centre.x`.
"""

import operator
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from typing_extensions import override

from jaxcrusher.basics.checks import is_concrete, renamed, require, require_choice
from jaxcrusher.basics.plane import Arm, Vector
from jaxcrusher.basics.smooth import norm
from jaxcrusher.joint.clearance import AbstractGap
from jaxcrusher.mechanism.acting import AbstractPush, Push, PushByAngle, Spring, rough_feed
from jaxcrusher.mechanism.linkage import (
    Body,
    Joint,
    Linkage,
    Point,
    Slide,
    require_direction,
)
from jaxcrusher.mechanism.motion import (
    COUNT,
    Motion,
    continued,
    followed,
    ideal_at_rest,
    moving,
    triad_lever,
)
from jaxcrusher.mechanism.named import Named
from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.mechanism.topology import (
    FRAME,
    Dyad,
    Ends,
    Triad,
    dyads_of,
    groups_of,
    other_body,
    triads_of,
)
from jaxcrusher.mechanism.triads import Guess
from jaxcrusher.scenes.build import drive_of, foundation_of, friction_of, guide_of, joint_of
from jaxcrusher.scenes.load_curve import load_curve, read_curve
from jaxcrusher.scenes.machine import AbstractStructure, Machine
from jaxcrusher.scenes.own_laws import is_own, law_numbers, require_one_law_each
from jaxcrusher.scenes.parameters import (
    CHOICES,
    CHOICES_OF_A_JOINT,
    FILM,
    LAWS,
    NUMBERS_OF_A_JOINT,
    PARAMETERS,
    Parameter,
    check_number,
    complete,
    filled,
    key_of,
    unknown,
    within_limits,
)
from jaxcrusher.scenes.plausibility import RULES_OF_FRAME, remarks_by, rules_of_joint
from jaxcrusher.scenes.units import all_said, said

NEEDED = object()


@dataclass(frozen=True)
class Key:
    """A key of a description: a number, the laws to choose from, or None for what ties bodies.

    A key for more than a number or choice has a `shape`: a "pair" of numbers, a "point" (a body and
    a pair), a "body" or a "curve". A key needs one of `comes_with`: another key, or a key with its
    choice. If `by_curve` is not None, the key is only for tables with a curve (True), or without
    one (False). A key whose default is None may be left out.
    """

    of: Parameter | tuple[str, ...] | None
    shape: str = ""
    default: Any = NEEDED
    comes_with: tuple[str, ...] = ()
    by_curve: bool | None = None


def _usual(name: str, *comes_with: str) -> Key:
    """A number of the crusher's, whose default counts where it is not given."""
    return Key(PARAMETERS[name], default=PARAMETERS[name].default, comes_with=comes_with)


_LOOSE, _LUBRICATED, _RUBBING = ("clearance",), ("film.viscosity",), ("friction",)
_PLACE = Parameter(0.0, "m", "of a point in its body's axes", (-1e3, 1e3), 1.0)
_DIRECTION = Parameter(0.0, "1", "of a direction", (-1e6, 1e6), 1.0)
_GUESS = {
    "x": Key(_PLACE),
    "y": Key(_PLACE),
    "angle": Key(Parameter(0.0, "rad", "of the body's x axis, roughly", (-10, 10), 1.0)),
}
_FORCE = Parameter(0.0, "N", "of a force in the frame's axes", (-1e12, 1e12), 1e3)
# Section of a file -> the keys of each of its tables. A body, a curve and the body of a point tie
# the drawing together; all else are numbers and choices of the machine.
SECTIONS: dict[str, dict[str, Key]] = {
    "bodies": {
        "mass": Key(Parameter(1.0, "kg", "of the body")),
        "inertia": Key(Parameter(1.0, "kg m2", "of the body about its mass centre")),
        "mass_centre": Key(_PLACE, "pair", None),
    },
    "joints": {
        "bore": Key(_PLACE, "point"),
        "pin": Key(_PLACE, "point"),
        "clearance": Key(Parameter(0.06e-3, "m", "radial clearance c"), default=None),
        "bore_radius": Key(Parameter(0.13, "m", "radius R_i of the bore"), "", NEEDED, _LOOSE),
        **{n: _usual(n, *_LOOSE) for n in NUMBERS_OF_A_JOINT[2:]},
        "static_speed": Key(Parameter(0.1, "m/s", "v0 of the friction law"), "", 0.1, _LOOSE),
        "full_speed": Key(Parameter(1.0, "m/s", "v1 of the friction law"), "", 1.0, _LOOSE),
        **{
            n: Key(CHOICES[n], "", CHOICES[n][0], _LUBRICATED if n == "film_law" else _LOOSE)
            for n in CHOICES_OF_A_JOINT
        },
        **{n: _usual(n, "contact_law=rollers") for n in PARAMETERS if n.startswith("rollers.")},
        **{n: _usual(n, *_LUBRICATED) for n in FILM},
        "film.viscosity": Key(FILM["film.viscosity"], default=None, comes_with=_LOOSE),
    },
    "slides": {
        "body": Key(None, "body"),
        "along": Key(_DIRECTION, "pair"),
        "through": Key(_PLACE, "pair", None),
        "length": Key(Parameter(0.05, "m", "of the slider between its ends"), default=None),
        "height": Key(Parameter(0.05, "m", "of the slider across its slide"), "", NEEDED, _LOOSE),
        "clearance": Key(Parameter(0.5e-3, "m", "gap c on either side"), default=None),
        "corner_radius": Key(Parameter(1e-3, "m", "of the slider's corners"), "", NEEDED, _LOOSE),
        **{n: _usual(n, *_LOOSE) for n in ("restitution", "impact_velocity", "young", "poisson")},
        "friction": Key(PARAMETERS["friction"], default=None),
        "static_speed": Key(Parameter(0.1, "m/s", "v0 of the friction law"), "", 0.1, _RUBBING),
        "full_speed": Key(Parameter(1.0, "m/s", "v1 of the friction law"), "", 1.0, _RUBBING),
        **{
            n: Key(CHOICES[n], "", CHOICES_OF_A_JOINT[n][0], _LOOSE)
            for n in ("contact_law", "impact_law")
        },
        "friction_law": Key(CHOICES["friction_law"], "", CHOICES["friction_law"][0], _RUBBING),
    },
    "forces": {
        "body": Key(None, "body"),
        "curve": Key(None, "curve", None),
        "at": Key(_PLACE, "pair", None),
        "force": Key(_FORCE, "pair", by_curve=False),
        "along": Key(_DIRECTION, "pair", by_curve=True),
        "scatter": Key(PARAMETERS["load_scatter"], default=None),
        "bandwidth": _usual("load_bandwidth", "scatter"),
        "seed": _usual("load_seed", "scatter"),
    },
    "springs": {
        "begin": Key(_PLACE, "point"),
        "end": Key(_PLACE, "point"),
        "stiffness": Key(Parameter(1e5, "N/m", "of the spring", (0, 1e15))),
        "length": Key(Parameter(0.1, "m", "of the spring without its preload", (0, 1e3))),
        "damping": Key(Parameter(0.0, "N s/m", "beside the spring", (0, 1e12), 1e3), default=0.0),
        "preload": Key(
            Parameter(0.0, "N", "pull of the spring at its length", (-1e12, 1e12), 1e3),
            default=0.0,
        ),
    },
    "points": {"": Key(_PLACE, "point")},
}
_G = ("foundation.x", "foundation.y")  # where the frame's mass centre is; the point of its moment
_SUPPORTS = [n for n in complete({"foundation.mass": 1.0}) if n.startswith("foundation.")]
# What stands outside of these tables.
TOP: dict[str, Key] = {
    "speed": Key(PARAMETERS["speed"]),
    "gravity": Key(PARAMETERS["gravity"], default=None),
    "speed_fluctuation": Key(PARAMETERS["speed_fluctuation"], default=None),
    **{n: _usual(n, "speed_fluctuation") for n in ("fluctuation_order", "fluctuation_phase")},
    **{n: Key(CHOICES[n], default=None) for n in ("start", "formulation")},
    "foundation.mass": Key(PARAMETERS["foundation.mass"], default=None),
    **{n: _usual(n, "foundation.mass", *_G) for n in _G},
    **{
        n: Key(PARAMETERS[n], comes_with=("foundation.mass",))
        for n in _SUPPORTS
        if n not in ("foundation.mass", *_G)
    },
}
_PLACED = ("pair", "point")
# Numbers of a joint of which the first is less than the second.
_LESS = (
    ("clearance", "bore_radius"),
    ("static_speed", "full_speed"),
    ("rollers.diameter", "rollers.pitch_diameter"),
)
_OF_SPRING = ("stiffness", "length", "damping", "preload")
_NAME = re.compile("[A-Za-z][A-Za-z0-9_]*")


@dataclass(frozen=True)
class LinkageStructure(AbstractStructure):
    """The bodies of a linkage, and what ties them together.

    The numbers and choices have the names of a file, and SI units. Two drawings of one
    structure are equal, and share compiled programs.
    """

    crank: str
    bodies: tuple[str, ...]
    joints: tuple[tuple[str, str, str], ...]  # name, body of the bore, body of the pin
    slides: tuple[tuple[str, str], ...]  # name, body
    forces: tuple[tuple[str, str, tuple | None], ...]  # name, body, points of a curve
    springs: tuple[tuple[str, str, str], ...]
    points: tuple[tuple[str, str], ...]
    sides: tuple[int, ...]

    @override
    def scene(self, values: Mapping[str, Any]) -> Scene:
        """Return the scene of these numbers, which may be traced.

        A number that only `jax.jit` knows and that lies outside its limits becomes NaN. Raises
        ValueError as `complete` does, for a known number outside its limits, for an unknown choice,
        and for links that do not close with every position of the pins in their clearances.
        """
        v = self._within_limits(self.complete(values))
        bearings: dict[str, AbstractGap] = {
            name: joint_of(v, f"joints.{name}.")
            for name, *_ in self.joints
            if f"joints.{name}.clearance" in v
        }
        guides = {}
        for name, _ in self.slides:
            at = f"slides.{name}."
            if f"{at}clearance" in v:
                bearings[name] = guide_of(v, at)
            else:
                guides[name] = friction_of(v, at)
        linkage = self.linkage(v)
        require_closing(linkage, {name: one.clearance for name, one in bearings.items()})
        return Scene(
            linkage=linkage,
            joints=Named(bearings),
            guides=Named(guides),
            drive=drive_of(v),
            pushes=tuple(_push(v, *force) for force in self.forces),
            springs=tuple(_spring(v, *spring) for spring in self.springs),
            formulation=LAWS["formulation"][v.get("formulation", "eccentricity")](),
            start=LAWS["start"][v.get("start", "centred")]() if bearings else None,
            foundation=foundation_of(v),
            points=Named({name: _point(v, f"points.{name}", body) for name, body in self.points}),
        )

    @cached_property
    def keys(self) -> Mapping[str, Key]:
        """Return the numbers and choices that the linkage may have, by name."""
        found, curved = dict(TOP), {name for name, _, curve in self.forces if curve is not None}
        for section, words in SECTIONS.items():
            for item in (one if section == "bodies" else one[0] for one in getattr(self, section)):
                stands = (None, section == "forces" and item in curved)
                for word, key in words.items():
                    at, opening = f"{section}.{item}.", key.comes_with
                    own = replace(key, comes_with=tuple(at + one for one in opening))
                    if key.shape in _PLACED and key.by_curve in stands:
                        zero = replace(own, default=None)
                        found |= {f"{at}{word}".rstrip(".") + axis: zero for axis in (".x", ".y")}
                    elif not key.shape:
                        found[at + word] = own
        for triad in triads_of(_groups(self.joints, self.slides, self.bodies, self.crank)):
            found |= {f"assembly.{triad.middle}.{word}": key for word, key in _GUESS.items()}
        return found

    @override
    def complete(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Return numbers and choices, with the defaults of those that others bring along.

        Raises ValueError of one line for a name that the linkage does not have, for a name without
        the one that it belongs to, and for a missing number of the drive, of a body, of a spring,
        of a loose joint or of supports.
        """
        numbers, keys = self.numbers(values), self.keys
        for name in values:
            if name not in keys and name not in numbers:
                raise unknown(name, (*numbers, *self.choices(values)))
        defaults = {n: key.of if key.default is NEEDED else key.default for n, key in keys.items()}
        return filled(values, defaults, lambda name: keys[name].comes_with if name in keys else ())

    def _within_limits(self, values: dict[str, Any]) -> dict[str, Any]:
        """Return numbers and choices, each of which is checked as one of a file is."""
        numbers, choices = self.numbers(values), self.choices(values)
        require_one_law_each(values, law_numbers(values, self.keys))
        for name, value in values.items():
            if name in numbers:
                check_number(name, value, numbers)
            elif not is_own(name, value):
                require_choice(name, value, choices[name])
        places = [f"joints.{joint}" for joint, *_ in self.joints]
        places += [f"slides.{slide}" for slide, _ in self.slides]
        pairs = [
            (f"{at}.{one}", operator.lt, f"{at}.{other}") for at in places for one, other in _LESS
        ]
        return within_limits(values, numbers, pairs)

    @override
    def numbers(self, values: Mapping[str, Any]) -> Mapping[str, Parameter]:
        """Return the numbers of its tables, and of your own laws that the values name."""
        own = {n: key.of for n, key in self.keys.items() if isinstance(key.of, Parameter)}
        return own | law_numbers(values, self.keys)

    @override
    def choices(self, values: Mapping[str, Any]) -> Mapping[str, tuple[str, ...]]:
        return {n: key.of for n, key in self.keys.items() if isinstance(key.of, tuple)}

    def merged(self, given: Mapping[str, Any], over: Mapping[str, Any]) -> dict[str, Any]:
        """Return a file's values and those over them, without the zeros of points and directions.

        These zeros are never traced.
        """
        both, places = {**given, **over}, {n for n, key in self.keys.items() if key.shape}
        return {name: value for name, value in both.items() if value != 0 or name not in places}

    @override
    def unusual(self, values: Mapping[str, Any]) -> list[str]:
        """Return unlikely numbers of the frame, of gravity and of loose joints."""
        rules = [rule for name, *_ in self.joints for rule in rules_of_joint(f"joints.{name}.")]
        return remarks_by((*RULES_OF_FRAME, *rules), self.complete(values), self.numbers(values))

    @override
    def left_open(self, machine: Machine) -> list[str]:
        """Return which numbers and sides the file leaves to defaults."""
        values = machine.values
        told = [f"{n} {said(n, values.get(n, 1), machine.units)}" for n in machine.defaults]
        return [f"leaves {len(told)} numbers to defaults: {', '.join(told)}."] if told else []

    @override
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
    @override
    def record(self) -> dict[str, str]:
        return {"drawing": repr(self)}

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
            sizes = v.get(f"{at}.length"), v.get(f"{at}.height")
            along, through = _direction(v, f"{at}.along"), _arm(v, f"{at}.through")
            slides[name] = Slide(body, along, through, *sizes)
        gravity = v.get("gravity", PARAMETERS["gravity"].default)
        bearing = next(n for n, *both in self.joints if {self.crank, FRAME} == set(both))
        guesses = {
            name: Guess(_vector(v, f"assembly.{name}"), v[f"assembly.{name}.angle"])
            for name in self.bodies
            if f"assembly.{name}.angle" in self.keys
        }
        parts = Named(bodies), Named(joints), self.crank, bearing, self.sides, gravity
        return continued(Linkage(*parts, slides=Named(slides), guesses=Named(guesses)))


def _groups(
    joints: Ends, slides: tuple[tuple[str, str], ...], bodies: tuple[str, ...], crank: str
) -> tuple[Dyad | Triad, ...]:
    """Return the groups of a drawing's bodies."""
    ends = (*joints, *((name, FRAME, body) for name, body in slides))
    return groups_of(ends, tuple(name for name, _ in slides), bodies, crank)


def _arm(values: Mapping[str, Any], name: str) -> Arm:
    """Return a point of a body; a number that is not given is zero, and is never traced."""
    return Arm(values.get(f"{name}.x"), values.get(f"{name}.y"))


def _vector(values: Mapping[str, Any], name: str) -> Vector:
    return Vector(values.get(f"{name}.x", 0.0), values.get(f"{name}.y", 0.0))


def _direction(values: Mapping[str, Any], name: str) -> Vector:
    """Return a vector of any length but zero."""
    along = _vector(values, name)
    require_direction(along, name)
    return along


def _point(values: Mapping[str, Any], name: str, body: str) -> Point:
    return Point(body, _arm(values, name))


def _push(values: Mapping[str, Any], name: str, body: str, curve: tuple | None) -> AbstractPush:
    """Return a force, of a rough feed where it scatters."""
    at = _point(values, f"forces.{name}.at", body)
    if curve is None:
        push = Push(at, _vector(values, f"forces.{name}.force"))
    else:
        along = _direction(values, f"forces.{name}.along")
        push = PushByAngle(at, along, load_curve(np.array(curve)))
    if f"forces.{name}.scatter" not in values:
        return push
    numbers = (values[f"forces.{name}.{of}"] for of in ("scatter", "bandwidth", "seed"))
    return rough_feed(push, *numbers)


def _spring(values: Mapping[str, Any], name: str, begin: str, end: str) -> Spring:
    at = f"springs.{name}"
    ends = _point(values, f"{at}.begin", begin), _point(values, f"{at}.end", end)
    return Spring(ends, *(values[f"{at}.{n}"] for n in _OF_SPRING))


class _Tables:
    """What a description has in its tables, from which the drawing takes what ties it together.

    Raises ValueError for an unknown key, with near misses, and for a table with a name that is no
    variable's.
    """

    def __init__(self, entries: Iterable[tuple[str, Any]], folder: Path):
        self.folder = folder
        # Numbers and choices, which are left in the end, and all else, by name.
        self.entries: dict[str, Any] = {}
        for name, value in entries:
            require(name not in self.entries, name, "be given once", "given twice")
            self.entries[name] = value
        self.items = {
            section: tuple(dict.fromkeys(n.split(".")[1] for n in self.entries if n.startswith(at)))
            for section, at in ((section, f"{section}.") for section in SECTIONS)
        }
        known = [
            *("kind", "crank", *TOP, *(f"assembly.{name}" for name in self.items["bodies"])),
            *(
                f"{section}.{item}.{word}".rstrip(".")
                for section, words in SECTIONS.items()
                for item in self.items[section] or ("NAME",)
                for word in words
            ),
        ]
        own = {n.rpartition(".")[0] for n, value in self.entries.items() if is_own(n, value)}
        for name in self.entries:
            # The numbers of a law of one's own are known once it has been imported.
            if key_of(name) not in known and name.rpartition(".")[0] not in own:
                raise unknown(name, known)
        for section, items in self.items.items():
            for item in items:
                must = "be named by letters, digits and _, as results and MATLAB's variables are"
                require(bool(_NAME.fullmatch(item)), f"{section}.{item}", must, repr(item))

    def ties(self, section: str, item: str) -> tuple[Any, ...]:
        """Return a table's name and what ties it: bodies, and of a force the curve's points."""
        at, found = f"{section}.{item}", []
        curved = f"{at}.curve" in self.entries
        for word, key in SECTIONS[section].items():
            name = f"{at}.{word}".rstrip(".")
            if not key.shape:
                continue
            value = self.entries.pop(name, None)
            if key.shape == "body":
                found.append(self.body(name, value))
            elif key.shape == "curve":
                found.append(None if value is None else _curve(name, value, self.folder))
            elif key.by_curve in (None, curved):
                found += self.placed(name, key, value)
            else:
                must = f"not stand beside `{at}.curve`" if curved else f"come with `{at}.curve`"
                require(value is None, name, must, "given" if curved else "alone")
        if section in ("joints", "springs"):
            require(found[0] != found[1], at, "join two bodies", f"of {found[0]} alone")
        return item, *found

    def placed(self, name: str, key: Key, value: Any) -> list[str]:
        """Leave the two numbers of a pair or a point to be read, and return the point's body."""
        if value is None and key.default is None:
            return []
        assert isinstance(key.of, Parameter)
        is_point = key.shape == "point"
        must = "be a point [body, x, y]" if is_point else f"be a pair [x, y] in {key.of.unit}"
        good = isinstance(value, list | tuple) and len(value) == 2 + is_point
        require(good, name, must, "missing" if value is None else repr(value))
        assert value is not None
        body = [self.body(name, value[0])] if is_point else []
        self.entries |= {f"{name}.x": value[-2], f"{name}.y": value[-1]}
        return body

    def body(self, name: str, body: Any) -> str:
        """Return a body's name, if there is such a body."""
        known = (*self.items["bodies"], FRAME)
        must = f"name a body: {', '.join(known)}"
        require(body in known, name, must, "missing" if body is None else repr(body))
        return str(body)

    def sides(self, groups: tuple[Dyad | Triad, ...]) -> tuple[tuple[int, ...], list[str]]:
        """Return the side of each dyad, seen from its first body, and which are not given: 1.

        Leave the numbers of the guess of each triad to be read.
        """
        named = [name for name in self.entries if name.startswith("assembly.")]
        given = {name.partition(".")[2]: self.entries.pop(name) for name in named}
        for triad in triads_of(groups):
            name, guess = f"assembly.{triad.middle}", given.pop(triad.middle, None)
            good = isinstance(guess, list | tuple) and len(guess) == 3
            must = "say roughly where the body is at crank angle zero, [x, y, angle]"
            must += f", as it meets {', '.join(triad.bodies[1:])} in a triad"
            require(good, name, must, "missing" if guess is None else repr(guess))
            assert guess is not None
            self.entries |= {f"{name}.{word}": one for word, one in zip(_GUESS, guess, strict=True)}
        for body, side in given.items():
            good = not isinstance(side, bool) and side in (-1, 1)
            require(good, f"assembly.{body}", "be 1 or -1", repr(side))
        sides, left = [], []
        for dyad in dyads_of(groups):
            slid = dyad.second_joint in self.items["slides"]
            seen = {dyad.first: 1, dyad.second: 1 if slid else -1}
            told = {seen[body] * given.pop(body) for body in seen if body in given}
            left += [] if told else [f"assembly.{dyad.first}"]
            both = f"two by {dyad.first} and {dyad.second}"
            require(len(told) < 2, f"assembly.{dyad.first}", "be one side of a dyad", both)
            sides.append(int(told.pop()) if told else 1)
        for body in given:
            require(False, f"assembly.{body}", "name a body of a dyad", "none")
        return tuple(sides), left


def drawn(
    entries: Iterable[tuple[str, Any]], folder: Path = Path()
) -> tuple[LinkageStructure, list[tuple[str, Any]], list[str]]:
    """Return the drawing of a description, its numbers and choices, and which sides it leaves out.

    The numbers and choices are as they are written, each by its name. Raises ValueError of one line
    for an unknown key or body, and for bodies that form no dyads or triads.
    """
    tables = _Tables(entries, folder)
    bodies = tables.items["bodies"]
    require(bool(bodies), "bodies", "have a table [bodies.NAME] each", "missing")
    require(FRAME not in bodies, "bodies", f"have other names than {FRAME!r}", repr(FRAME))
    crank, _ = str(tables.entries.pop("crank", "missing")), tables.entries.pop("kind", None)
    must = f"name the body that the drive turns: {', '.join(bodies)}"
    require(crank in bodies, "crank", must, crank)
    tied: dict[str, Any] = {
        section: tuple(tables.ties(section, item) for item in items)
        for section, items in tables.items.items()
    }
    joints, slides, forces = tied["joints"], tied["slides"], tied["forces"]
    held = any({crank, FRAME} == {bore, pin} for _, bore, pin in joints)
    require(held, "crank", "have a joint to the frame", f"{crank!r} without one")
    for item, body, _ in forces:
        require(body != FRAME, f"forces.{item}.body", "be a body that moves", repr(FRAME))
    sides, left = tables.sides(_groups(joints, slides, bodies, crank))
    drawing = LinkageStructure(**tied | {"crank": crank, "bodies": bodies, "sides": sides})
    return drawing, list(tables.entries.items()), left


def _curve(name: str, given: Any, folder: Path) -> tuple:
    """Return the points of a curve, a file's or an array's, as tuples."""
    with renamed(load_curve=name):
        points = read_curve(folder / given if isinstance(given, str | Path) else given)
        load_curve(points)
    return tuple(map(tuple, points.tolist()))


# Least sine of the angle between two links, or between a link and the perpendicular of its slide. A
# linkage that passes a dead point comes as close to zero within half a degree of its crank, and
# contacts let pins go a little further than their clearance. Of a triad it is the determinant of
# the lines of force on the body in the middle, over its size (`triads`), a product of such sines.
LEAST_LEVER = 0.02


@eqx.filter_jit
def _levers(linkage: Linkage, clearances: Mapping[str, Any], angles: Any) -> list[tuple]:
    """Return that sine of each dyad at angles of the crank, and the least by all eccentricities.

    It is NaN where a dyad is open. The pin of a loose joint is anywhere in its clearance, so that
    the outer joints of a dyad come nearer to each other, or farther apart, by `total` at most: by
    what moves them, and by the clearances of its three joints. The least sine is that of an end of
    that interval. Where it is s, a link of length l turns by total / (l s) at most on the way.
    """

    def play(*joints: str) -> Any:
        return sum(clearances.get(name, 0.0) for name in joints)

    def one(angle: Any) -> list[tuple]:
        motion, found = ideal_at_rest(linkage, angle), []
        zero = Vector(jnp.zeros(()), jnp.zeros(()))
        # Body -> one of its points, by how much that may be off, m, and the body be turned, rad.
        reach = {FRAME: (zero, 0.0, 0.0), linkage.crank: (zero, play(linkage.bearing), 0.0)}

        def outer(joint: str, body: str) -> tuple[Vector, Any]:
            at = motion.position(Point(body, linkage.side_of(joint, body)))
            place, off, turned = reach[other_body(linkage.ends, joint, body)]
            return at, off + norm(at - place, 0.0) * turned + play(joint)

        for group in linkage.groups:
            if isinstance(group, Triad):
                least, moved = _shifted(linkage, clearances, motion, group)
                found.append((jnp.abs(triad_lever(motion, group)), least))
                reach |= moved
                continue
            dyad = group
            meeting = motion.position(Point(dyad.first, linkage.side_of(dyad.meeting, dyad.first)))
            begin, off = outer(dyad.first_joint, dyad.first)
            u, total = meeting - begin, off + play(dyad.meeting)
            length = norm(u, 0.0)
            if dyad.second_joint in linkage.slides:
                end, off_end, other = meeting, off, None  # which slides
                slide = linkage.slides.at(dyad.second_joint)
                if slide.length is not None:  # between its edges it tilts, and its joint moves
                    lever = norm(linkage.side_of(dyad.meeting, dyad.second).vector(), 0.0)
                    total = total + play(dyad.second_joint) * (1 + lever / slide.half_length)
                share = jnp.abs(slide.direction.cross(u)) / length
                cosines = jnp.array([share, share + total / length])
            else:
                end, off_end = outer(dyad.second_joint, dyad.second)
                other, apart = norm(end - meeting, 0.0), norm(end - begin, 0.0)
                total = total + off_end
                spans = jnp.array([apart, jnp.maximum(apart - total, 0.0), apart + total])
                cosines = (length**2 + other**2 - spans**2) / (2 * length * other)
            levers = jnp.sqrt(1 - cosines**2)
            least = jnp.min(levers)
            found.append((levers[0], least))
            reach[dyad.first] = begin, off, total / (length * least)
            slid = meeting, total + total / least, 0.0
            reach[dyad.second] = slid if other is None else (end, off_end, total / (other * least))
        return found

    return jax.vmap(one)(angles)


def _shifted(
    linkage: Linkage, clearances: Mapping[str, Any], motion: Motion, triad: Triad
) -> tuple[Any, dict[str, tuple]]:
    """Return the least lever of a triad by all eccentricities, and the reach of its bodies.

    These are bounds of first order: each pin goes its clearance in the direction that counts most.
    That of the lever is of its square, which falls evenly to where a triad opens.
    """
    count = len(triad.bodies)

    def seen(e: Any) -> Any:
        pins = Named({name: Vector(*at) for name, at in zip(clearances, e, strict=True)})
        off = moving(linkage, motion.crank, pins, Named())
        turned = [motion.axis(body).cross(off.axis(body)) for body in triad.bodies]
        begins = [off.position(Point(body)) for body in triad.bodies]
        every = [triad_lever(off, triad) ** 2, *turned]
        return jnp.stack([*every, *(at.x for at in begins), *(at.y for at in begins)])

    slopes = jax.jacfwd(seen)(jnp.zeros((len(clearances), 2)))
    radii = jnp.array([clearances[name] for name in clearances])
    most = jnp.hypot(slopes[:, :, 0], slopes[:, :, 1]) @ radii
    turned, x, y = most[1 : count + 1], most[count + 1 : -count], most[-count:]
    places = [motion.position(Point(body)) for body in triad.bodies]
    moved = zip(places, jnp.hypot(x, y), turned, strict=True)
    least = jnp.sqrt(triad_lever(motion, triad) ** 2 - most[0])
    return least, dict(zip(triad.bodies, moved, strict=True))


def require_closing(linkage: Linkage, clearances: Mapping[str, Any]) -> None:
    """Raise ValueError for known numbers if a group opens, or is at a dead point, at some degree.

    The pins of loose joints may be anywhere in their clearance. A triad must also come back to its
    first pose after a turn.
    """
    if not is_concrete((linkage, clearances)):
        return
    with jax.ensure_compile_time_eval():
        levers = _levers(linkage, clearances, jnp.radians(jnp.arange(360.0)))
    for group, both in zip(linkage.groups, levers, strict=True):
        must = f"let {' and '.join(group.bodies)} meet at every angle of the crank"
        missed = "open"
        if isinstance(group, Triad):
            _require_following(linkage, group, must)
            missed = "open, or goes too unevenly to be found,"
        for lever, where in zip(map(np.asarray, both), ("", " with all clearances"), strict=True):
            for bad, told in (
                (np.isnan(lever), missed),
                (lever < LEAST_LEVER, "at a dead point, from which they may go on either way,"),
            ):
                value = f"{told} at a crank angle of {np.argmax(bad)} deg"
                require(not bad.any(), "bodies", must + where, value)


def _require_following(linkage: Linkage, triad: Triad, must: str) -> None:
    """Raise ValueError for a triad that cannot be followed from its guess round a turn."""
    with jax.ensure_compile_time_eval():
        spots, levers = jax.device_get(followed(linkage))
    bad = np.isnan(levers[:, linkage.triads.index(triad)])
    value = f"open at a crank angle of {360 // COUNT * np.argmax(bad)} deg"
    require(not bad.any(), "bodies", must, value)
    spot = spots.at(triad.middle)
    off = jnp.stack([part[-1] - part[0] for part in jax.tree.leaves(spot)])
    must = f"come back to where {triad.middle} was after a turn of the crank"
    require(bool(jnp.abs(off).max() < 1e-6), "bodies", must, "together in another way then")

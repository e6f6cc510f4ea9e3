"""A crusher described by named numbers and choices.

The names serve scene files, the command line, sweeps and the design search. Defaults are the
PE250x400 of Wang, Cui, Wang, Appl. Sci. 2023, 13, 238, Tables 1 and 2.
"""

import operator
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, replace
from difflib import get_close_matches
from types import MappingProxyType
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import ArrayLike

from jaxcrusher.basics.checks import (
    concrete,
    nan_unless,
    primal,
    require,
    require_positive,
    require_within,
)
from jaxcrusher.crusher.loads import (
    AlongJaw,
    ByAngle,
    ClosingStroke,
    CrushingBed,
    NormalToJaw,
    along_jaw,
    normal_to_jaw,
)
from jaxcrusher.crusher.machine import LETTERS
from jaxcrusher.joint.film import Film, FiniteFilm
from jaxcrusher.joint.friction import AmbrosioFriction, CentreSlip, SurfaceSlip
from jaxcrusher.joint.normal import (
    ConstantImpactVelocity,
    Flores,
    Gonthier,
    HuGuo,
    HuntCrossley,
    LankaraniNikravesh,
    TrackedImpactVelocity,
    ZhiyingQishao,
)
from jaxcrusher.joint.rollers import RollerBearing
from jaxcrusher.mechanism.eccentricity import EccentricityFormulation
from jaxcrusher.mechanism.multiplier import MultiplierFormulation
from jaxcrusher.mechanism.starts import Centred, InContact

Value = ArrayLike | str


@dataclass(frozen=True)
class Parameter:
    """A number of a description, in SI units. `limits` None means finite and > 0.

    `zero_scale` is the scale where the default is 0.
    """

    default: float
    unit: str
    meaning: str
    limits: tuple[float, float] | None = None
    zero_scale: float | None = None
    whole: bool = False  # nothing has slopes by a whole number

    @property
    def scale(self) -> float:
        """Return the scale against which a change is small, > 0."""
        return abs(self.default) if self.zero_scale is None else self.zero_scale


_TURN = (-2 * np.pi, 2 * np.pi)

# Name -> default, unit, meaning and limits of every number of a crusher.
_PARAMETERS = {
    "speed": Parameter(30.0, "rad/s", "driving speed omega"),
    "clearance": Parameter(0.06e-3, "m", "radial clearance c of the main bearing"),
    "bore_radius": Parameter(0.13, "m", "radius R_i of the jaw's bore"),
    "friction": Parameter(0.1, "1", "friction coefficient c_f; 0 leaves friction out", (0, 10)),
    "restitution": Parameter(0.9, "1", "coefficient of restitution c_e", (0.01, 1)),
    "impact_velocity": Parameter(0.5, "m/s", "of the contact law, unless tracked"),
    "young": Parameter(207e9, "Pa", "Young's modulus of pin and bore"),
    "poisson": Parameter(0.29, "1", "Poisson's ratio of pin and bore", (0, 0.5)),
    "load": Parameter(8.8e3, "N", "crushing load F_load on the jaw", (0, 1e9)),
    "gravity": Parameter(9.81, "m/s2", "acceleration of gravity", (0, 100)),
    "shaft.mass": Parameter(95.0, "kg", "m1"),
    "shaft.inertia": Parameter(0.2, "kg m2", "J1 about S1"),
    "shaft.eccentricity": Parameter(0.01, "m", "l1, from O to A"),
    # Table 2 prints l21 twice; 0.006 m is l11.
    "shaft.mass_centre_radius": Parameter(0.006, "m", "l11, from O to S1", (0, 1)),
    "shaft.mass_centre_angle": Parameter(np.radians(30.0), "rad", "of S1, ahead of O-A", _TURN),
    "jaw.mass": Parameter(524.0, "kg", "m2"),
    # J2 and J3 are far too large for central inertias of such bodies, and are kept as printed.
    "jaw.inertia": Parameter(128.48, "kg m2", "J2 about S2"),
    "jaw.length": Parameter(0.695, "m", "l2, from B to A"),
    "jaw.mass_centre_distance": Parameter(0.3, "m", "l21, from A to S2", (-5, 5)),
    "jaw.mass_centre_angle": Parameter(np.radians(15.0), "rad", "of A-S2, ahead of A-B", _TURN),
    "toggle.mass": Parameter(22.0, "kg", "m3"),
    "toggle.inertia": Parameter(0.7154, "kg m2", "J3 about S3"),
    "toggle.length": Parameter(0.3, "m", "l3, from C to B"),
    "bearing.distance": Parameter(0.64, "m", "from C to O"),
    "bearing.inclination": Parameter(np.radians(22.5), "rad", "of C-O, off the vertical", _TURN),
    "counterweight.mass": Parameter(0.0, "kg", "of a point mass on the shaft", (0, 1e5), 100.0),
    "counterweight.radius": Parameter(0.2, "m", "of the counterweight about O", (0, 5)),
    "counterweight.angle": Parameter(np.pi, "rad", "of the counterweight, ahead of O-A", _TURN),
}

# Joints that may be loose besides the main bearing, and the bodies of bore and pin.
LOOSE_JOINTS = {
    "elbow": ("jaw", "toggle"),
    "pivot": ("frame", "toggle"),
    "shaft_bearing": ("frame", "shaft"),
}
# Before the numbers of a joint, those of the main bearing first.
PREFIXES = ("", *(f"{joint}." for joint in LOOSE_JOINTS))
# Radii of their bores, m; judged.
_BORES = {"elbow": 0.04, "pivot": 0.04, "shaft_bearing": 0.07}
NUMBERS_OF_A_JOINT = (
    "clearance",
    "bore_radius",
    "friction",
    "restitution",
    "impact_velocity",
    "young",
    "poisson",
)


def _loose_joint_number(name: str, joint: str) -> Parameter:
    """The number of B, C or O; it has the main bearing's default, but for the bore's radius."""
    letter, (bore, pin) = LETTERS[joint], LOOSE_JOINTS[joint]
    main = _PARAMETERS[name]
    if name == "bore_radius":
        return Parameter(_BORES[joint], "m", f"radius of the {bore}'s bore at {letter}")
    if name == "clearance":
        return Parameter(main.default, "m", f"of the {pin}'s pin at {letter}; none: ideal")
    return replace(main, meaning=f"{main.meaning.partition(';')[0]}, at {letter}")


_PARAMETERS |= {
    f"{joint}.{name}": _loose_joint_number(name, joint)
    for joint in LOOSE_JOINTS
    for name in NUMBERS_OF_A_JOINT
}

# What the frame stands on. A scene has these names only where one of `_openers` is given.
# Defaults of a frame on supports are judged: 6 t with a block's soil under each side.
_PLACE = (-100.0, 100.0)
_POINT = ("foundation.x", "foundation.y")
_PARAMETERS |= {
    "foundation.x": Parameter(0.0, "m", "frame's G, or point of its moment", _PLACE, 1.0),
    "foundation.y": Parameter(0.0, "m", "likewise, above C", _PLACE, 1.0),
    "foundation.mass": Parameter(6000.0, "kg", "of frame and block on supports; none: clamped"),
    "foundation.inertia": Parameter(2500.0, "kg m2", "of frame and block about G"),
    "foundation.left": Parameter(-0.7, "m", "left support, from C", _PLACE),
    "foundation.right": Parameter(0.9, "m", "right support, from C", _PLACE),
    "foundation.base": Parameter(-0.6, "m", "height of both supports above C", _PLACE),
    "foundation.horizontal_stiffness": Parameter(1e8, "N/m", "of each support"),
    "foundation.vertical_stiffness": Parameter(1.5e8, "N/m", "of each support"),
    "foundation.horizontal_damping": Parameter(1.5e5, "N s/m", "of each support", (0, 1e12)),
    "foundation.vertical_damping": Parameter(2.5e5, "N s/m", "of each support", (0, 1e12)),
    # In place of the distance of the supports.
    "foundation.rocking_stiffness": Parameter(
        2e8, "N m/rad", "about the base's middle; none: of springs"
    ),
    "foundation.rocking_damping": Parameter(
        2e5, "N m s/rad", "likewise; none: of dampers", (0, 1e15)
    ),
}

# Soil under the block, in place of springs and dampers; a scene has these names only where one of
# the first two is given. Defaults are judged: sand of middling density.
_SOIL = ("foundation.soil.shear_modulus", "foundation.soil.shear_wave_speed")
_SPRINGS = tuple(n for n in _PARAMETERS if n.endswith(("_stiffness", "_damping")))
_PARAMETERS |= {
    "foundation.soil.shear_modulus": Parameter(6e7, "Pa", "of the soil; or its wave speed"),
    "foundation.soil.shear_wave_speed": Parameter(180.0, "m/s", "of the soil; or its modulus"),
    "foundation.soil.density": Parameter(1800.0, "kg/m3", "of the soil"),
    "foundation.soil.poisson": Parameter(0.35, "1", "Poisson's ratio of the soil", (0, 0.5)),
    "foundation.soil.length": Parameter(2.0, "m", "side of the block's base in the plane"),
    "foundation.soil.width": Parameter(2.0, "m", "side of it across the plane"),
    "foundation.soil.embedment": Parameter(
        0.0, "m", "of the base in soil at its sides", (0, 100), 1.0
    ),
}

# The tension rod; a scene has these names only where one of its `openers` is given. The places of
# its ends are judged: below the toggle, behind it at the frame.
_PARAMETERS |= {
    "rod.stiffness": Parameter(0.0, "N/m", "of the tension rod's spring", (0, 1e12), 1e5),
    "rod.preload": Parameter(0.0, "N", "its tension at shaft angle 0", (0, 1e9), 1e4),
    "rod.damping": Parameter(0.0, "N s/m", "of the tension rod", (0, 1e12), 1e3),
    "rod.jaw_along": Parameter(0.65, "m", "its end on the jaw, from A towards B", (-10, 10)),
    "rod.jaw_across": Parameter(-0.05, "m", "and from there towards the fixed jaw", (-10, 10)),
    "rod.x": Parameter(-0.3, "m", "its end on the frame, from C", _PLACE),
    "rod.y": Parameter(-0.15, "m", "likewise, above C", _PLACE),
}

# Of a roller bearing at A; a scene has these names only where `openers` says so. They are those of
# one of `rollers.bearings` equal ones. Defaults are judged: the size 22324 fits the jaw's bore, its
# ratings are near those of catalogues, and its rollers follow from the static rating by ISO 76.
_PARAMETERS |= {
    "rollers.bearings": Parameter(2.0, "1", "equal bearings side by side", (1, 100)),
    "rollers.count": Parameter(30.0, "1", "rollers Z of a bearing, all rows", (3, 1000)),
    "rollers.length": Parameter(0.032, "m", "length l of a roller's contact"),
    "rollers.diameter": Parameter(0.034, "m", "diameter D_w of a roller"),
    "rollers.pitch_diameter": Parameter(0.19, "m", "diameter D_pw of the rollers' circle"),
    "rollers.bore": Parameter(0.12, "m", "bore d of the inner ring, of friction"),
    # Judged from 0.25e-5 to 2.5e-5 s times the stiffness (Kraemer, Dynamics of Rotors and
    # Foundations, 1993).
    "rollers.damping": Parameter(1e4, "N s/m", "where half of the rollers are loaded", (0, 1e9)),
    "rollers.friction": Parameter(0.0018, "1", "mu of the moment mu F d / 2", (0, 1)),
    "rollers.static_rating": Parameter(1.12e6, "N", "C_0 of a bearing"),
    "rollers.dynamic_rating": Parameter(0.98e6, "N", "C of a bearing"),
}

# Of a film of oil or grease; a scene has these names only with the first of them. Defaults are
# judged: a heavy mineral oil, warm (ISO VG 220 has 0.07 Pa s at 60 degrees Celsius), in a bearing
# as wide as the chamber leaves room for, whose surfaces are ground.
FILM = {
    "film.viscosity": Parameter(0.07, "Pa s", "mu of the oil between pin and bore; none: dry"),
    "film.width": Parameter(0.1, "m", "length L of the film along the pin"),
    "film.least_thickness": Parameter(2e-6, "m", "at which roughness takes over"),
}
_PARAMETERS |= FILM
_PARAMETERS |= {
    f"{joint}.{name}": replace(number, meaning=f"{number.meaning}, at {LETTERS[joint]}")
    for joint in LOOSE_JOINTS
    for name, number in FILM.items()
}

# Of a shaft whose speed is uneven; a scene has these names only with the first of them.
_PARAMETERS |= {
    "speed_fluctuation": Parameter(0.01, "1", "of the speed, a share of it; none: 0", (0, 0.99)),
    "fluctuation_order": Parameter(
        1.0, "1", "a whole number, so often a turn", (1, 40), None, True
    ),
    "fluctuation_phase": Parameter(0.0, "rad", "of the fluctuation at angle 0", _TURN, 1.0),
}

# Of a crushing load; a scene has these names only where `openers` says so.
_PARAMETERS |= {
    "load_point": Parameter(0.3, "m", "from A towards B to where the load acts; none: S2", (0, 10)),
    # Judged: a bed of rock takes the jaw up over some twenty degrees.
    "load_edge": Parameter(np.radians(20.0), "rad", "of a closing load, half a sine", (1e-3, 1.5)),
    "load_factor": Parameter(1.0, "1", "by which load_curve is multiplied", (0, 1e6)),
    # Judged: some ten lumps break in a stroke, each with a force of its own.
    "load_scatter": Parameter(0.1, "1", "standard deviation of the load, a share of it", (0, 1)),
    "load_bandwidth": Parameter(10.0, "1", "orders of the shaft up to which it is", (0.01, 40)),
    "load_seed": Parameter(
        0.0, "1", "a whole number, one for each random feed", (0, 2**31), 100.0, True
    ),
    # Judged: the mean of the resultant is then near the paper's 8.8 kN.
    "chamber.bed_modulus": Parameter(2e7, "Pa", "pressure of a bed pressed to nothing", (0, 1e12)),
    "chamber.bed_exponent": Parameter(2.0, "1", "of its compression ratio", (1, 10)),
}

PARAMETERS: Mapping[str, Parameter] = MappingProxyType(_PARAMETERS)

# The crushing chamber: of the capacity, not of the motion. The paper gives its length, height and
# loosening; its capacity of 9.41 m3/h at 25 rad/s implies 2b - s = 60.6 mm, and so this b with the
# stroke s of its links. The nip angle makes the mouth the 250 mm of a PE250x400.
CHAMBER = {
    "chamber.width": Parameter(0.4, "m", "length L of the discharge opening"),
    "chamber.height": Parameter(0.6, "m", "height H"),
    "chamber.discharge": Parameter(0.0340246, "m", "discharge opening b, of the open side"),
    "chamber.nip_angle": Parameter(np.radians(20.0), "rad", "between the jaws", (0, np.pi / 2)),
    "chamber.loosening": Parameter(0.7, "1", "mu of the material crushed", (0.01, 1)),
}

# What a description is told besides the motion, for its load sheet; the numbers are judged.
SITE = {
    # In place of shaft.eccentricity, which follows from it when a file is read.
    "stroke": Parameter(0.0074492, "m", "horizontal travel of the jaw's lower end"),
    "motor_power": Parameter(15e3, "W", "of the motor; none: not known"),
    "frame_mass": Parameter(1500.0, "kg", "of frame and fixed jaw, clamped; none: not known"),
}

# What a design search may vary in the place of the counterweight's mass and angle.
MOMENTS = {
    f"counterweight.moment_{where}": Parameter(
        0.0, "kg m", f"of the counterweight about O, {where} O-A", (-1e4, 1e4), 1.0
    )
    for where in ("along", "across")
}

# Name of a choice -> name of a law or a method, the paper's first -> its class, or the function
# that it stands for.
_LAWS: dict[str, dict[str, Any]] = {
    "start": {"centred": Centred, "contact": InContact},
    "slip": {"centre": CentreSlip, "surface": SurfaceSlip},
    "load_law": {
        "along_jaw": AlongJaw,
        "normal_to_jaw": NormalToJaw,
        "closing_stroke": ClosingStroke,
        "by_angle": ByAngle,
        "chamber": CrushingBed,
        "none": None,
    },
    "load_direction": {"normal_to_jaw": normal_to_jaw, "along_jaw": along_jaw},
    "contact_law": {
        "lankarani_nikravesh": LankaraniNikravesh,
        "hunt_crossley": HuntCrossley,
        "flores": Flores,
        "gonthier": Gonthier,
        "zhiying_qishao": ZhiyingQishao,
        "hu_guo": HuGuo,
        "rollers": RollerBearing,
    },
    "friction_law": {"ambrosio": AmbrosioFriction},
    "film_law": {"short": Film, "finite": FiniteFilm},
    "impact_law": {"constant": ConstantImpactVelocity, "tracked": TrackedImpactVelocity},
    "formulation": {"eccentricity": EccentricityFormulation, "multiplier": MultiplierFormulation},
}
LAWS: Mapping[str, Mapping[str, Any]] = MappingProxyType(
    {name: MappingProxyType(laws) for name, laws in _LAWS.items()}
)

# Name -> what may be chosen, the paper's choice first.
_CHOICES = {
    "joint": ("clearance", "ideal"),
    **{name: tuple(laws) for name, laws in LAWS.items()},
}

# B and C are a toggle's seats, which have no rollers; O, and joints of other linkages, are not
# written with rollers yet.
CHOICES_OF_A_JOINT = {
    name: tuple(choice for choice in _CHOICES[name] if choice != "rollers")
    for name in ("slip", "contact_law", "friction_law", "impact_law", "film_law")
}
_CHOICES |= {
    f"{joint}.{name}": choices
    for joint in LOOSE_JOINTS
    for name, choices in CHOICES_OF_A_JOINT.items()
}
CHOICES: Mapping[str, tuple[str, ...]] = MappingProxyType(_CHOICES)

# Before the name of a point of the frame, whose value is its place from C, such as "1.2 m, -0.4 m".
POINTS = "foundation.points."

# Names whose value is a file, or in Python the array that it would hold.
FILES: Mapping[str, str] = MappingProxyType(
    {"load_curve": "force over the shaft's angle: angle_deg, force_kN"}
)

# Before the names of any linkage.
OF_LINKAGES = ("bodies.", "joints.", "slides.", "forces.", "springs.", "points.", "assembly.")

# Every number of a crusher; a scene file may not have the moments.
NUMBERS: Mapping[str, Parameter] = MappingProxyType({**PARAMETERS, **CHAMBER, **SITE, **MOMENTS})

# A diameter of a drawing -> the radius that it gives.
DIAMETERS = {"diametral_clearance": "clearance", "bore_diameter": "bore_radius"}

# A name, or the beginning of names -> what a description must have one of to have them: a name, or
# the choice of a law.
_OPENERS: dict[str, tuple[str, ...]] = {
    "speed_fluctuation": ("speed_fluctuation",),
    "fluctuation_order": ("speed_fluctuation",),
    "fluctuation_phase": ("speed_fluctuation",),
    "load_point": ("load_point",),
    "load_edge": ("load_edge",),
    "load_scatter": ("load_scatter",),
    "load_bandwidth": ("load_scatter",),
    "load_seed": ("load_scatter",),
    "load_curve": ("load_law=by_angle",),
    "load_factor": ("load_law=by_angle",),
    "load_direction": ("load_law=by_angle",),
    "chamber.bed_modulus": ("load_law=chamber",),
    "chamber.bed_exponent": ("load_law=chamber",),
    **{f"{joint}.": (f"{joint}.clearance",) for joint in LOOSE_JOINTS},
    "rollers.": ("contact_law=rollers",),
    **{at + name: (f"{at}film.viscosity",) for at in PREFIXES for name in (*FILM, "film_law")},
    "rod.": ("rod.stiffness", "rod.preload"),
    "foundation.": ("foundation.mass",),
    **{name: (name,) for name in ("foundation.rocking_stiffness", "foundation.rocking_damping")},
    **{n: (n,) if n in _SOIL else _SOIL for n in PARAMETERS if n.startswith("foundation.soil.")},
    # A clamped frame has a point of its moment alone.
    **dict.fromkeys(_POINT, ("foundation.mass", *_POINT)),
}

# Two numbers of a description, and how the first must compare with the second.
_PAIRS = (
    ("clearance", operator.lt, "bore_radius"),
    *((f"{at}.clearance", operator.lt, f"{at}.bore_radius") for at in LOOSE_JOINTS),
    ("load_point", operator.le, "jaw.length"),
    ("rollers.diameter", operator.lt, "rollers.pitch_diameter"),
    ("foundation.left", operator.lt, "foundation.right"),
)

# Numbers whose law is a choice of its own.
_LAW_OF = {"load": "load_law", "impact_velocity": "impact_law"}

_DEFAULTS: dict[str, float | str] = {
    **{name: parameter.default for name, parameter in PARAMETERS.items()},
    **{name: choices[0] for name, choices in CHOICES.items()},
}


def openers(name: str) -> tuple[str, ...]:
    """Return the names of which a description needs one to have this name, if it needs any.

    Each is a name, or the choice of a law as "load_law=by_angle". The numbers of joints B, C and O
    come with their clearance.
    """
    head, dot, _ = name.partition(".")
    return _OPENERS.get(name) or _OPENERS.get(head + dot, ())


# The paper's crusher: every number and every choice of its motion by name.
PE250X400 = {name: value for name, value in _DEFAULTS.items() if not openers(name)}
PAPER_CHAMBER = {name: parameter.default for name, parameter in CHAMBER.items()}


def complete(values: Mapping[str, Any]) -> dict[str, Any]:
    """A description with the default of every name that it lacks, if one of its `openers` is there.

    Raises ValueError for a name without any of its openers, as of B, C or O without its clearance,
    and for springs and dampers beside the soil that stands in their place.
    """
    instead = _SPRINGS if any(name in _SOIL for name in values) else ()
    for name in values:
        require(name not in instead, name, "not stand beside `foundation.soil`", "given")
    left = {name: value for name, value in _DEFAULTS.items() if name not in instead}
    return filled(values, left, openers)


def filled(
    values: Mapping[str, Any],
    defaults: Mapping[str, Any],
    openers: Callable[[str], tuple[str, ...]],
) -> dict[str, Any]:
    """Return values with the default of each name that they lack, if one of its openers is there.

    An opener is a name, or a name with a choice; a name without openers is always there. A name
    whose default is None may be left out. A name that has no default has its `Parameter` instead.

    Raises ValueError for a name without any of its openers, and for a missing one without default.
    """
    there = {*values, *(f"{name}={v}" for name, v in values.items() if isinstance(v, str))}

    def belongs(name: str) -> bool:
        opening = openers(name)
        return not opening or any(one in there for one in opening)

    for name in values:
        require(belongs(name), name, f"come with `{(*openers(name), '')[0]}`", "alone")
    found = {}
    for name, default in defaults.items():
        if name in values or default is None or not belongs(name):
            continue
        if isinstance(default, Parameter):
            with_it = "".join(f" with `{one}`" for one in openers(name)[:1])
            require(False, name, f"be given in {default.unit}{with_it}", "missing")
        found[name] = default
    return found | dict(values)


def numbers_of(values: Mapping[str, Any], numbers: Mapping[str, Parameter] = NUMBERS) -> list[str]:
    """Return the names of numbers that the motion has slopes by, in the order of `numbers`.

    The chamber's numbers are among them only if the load is its bed of rock.
    """
    none = () if values.get("load_law") == "chamber" else CHAMBER
    known = (name for name in numbers if name in values and name not in none)
    return [name for name in known if not numbers[name].whole]


def refuse_others(name: str) -> None:
    """Raise ValueError for a name that belongs to a linkage or a search, not to a crusher."""
    require(not name.startswith(OF_LINKAGES), name, "be of a linkage", "of a crusher")
    must = "be given as counterweight.mass and counterweight.angle"
    require(name not in MOMENTS, name, must, "a moment, which a design search alone has")


def within_limits(
    values: Mapping[str, Any],
    numbers: Mapping[str, Parameter] = NUMBERS,
    pairs: Iterable[tuple[str, Callable[[Any, Any], Any], str]] = _PAIRS,
) -> dict[str, Any]:
    """The same description, with NaN for every traced number that lies outside its limits.

    A check cannot raise an error for a value that only `jax.jit` will know. NaN makes the motion
    a failure, in place of a number that means nothing. Each of `pairs` limits a number by another
    one: the number, the comparison, and the other number. Known pairs are checked where they are
    used, and traced pairs here.
    """
    limited = dict(values)
    for name, value in values.items():
        if name in numbers and concrete(value) is None:
            limited[name] = nan_unless(_is_within(numbers[name], value), value)
    for name, compare, other in pairs:
        both = [limited[one] for one in (name, other) if one in limited]
        if len(both) == 2 and any(primal(one) is None for one in both):
            limited[name] = nan_unless(compare(*both), limited[name])
    return limited


def _is_within(parameter: Parameter, value: Any) -> Any:
    if parameter.limits is None:
        return (value > 0) & (value < jnp.inf)
    low, high = parameter.limits
    good = (value >= low) & (value <= high)
    return good & (value == jnp.round(value)) if parameter.whole else good


def check_number(name: str, value: ArrayLike, numbers: Mapping[str, Parameter] = NUMBERS) -> None:
    """Raise ValueError if a value is no number, scalar or array, or outside its limits."""
    parameter = numbers[name]
    if value is None or isinstance(value, str | list | tuple):
        law = _LAW_OF.get(name)
        listed = f"; its law, one of {CHOICES[law]}, is `{law}`" if law else ""
        unit = "" if parameter.unit == "1" else f" in {parameter.unit}"
        require(False, name, f"be a number{unit} ({parameter.meaning}{listed})", repr(value))
    if parameter.limits is None:
        ideal = " (an ideal joint has `joint=ideal`)" if name == "clearance" else ""
        if name.endswith(".clearance"):
            ideal = " (an ideal joint has none: leave it out)"
        require_positive(name, value, parameter.unit + ideal)
    else:
        unit = "" if parameter.unit == "1" else parameter.unit
        require_within(name, value, *parameter.limits, unit)
    known = primal(value)
    if parameter.whole and known is not None:
        require(bool(np.all(known == np.round(known))), name, "be a whole number", known)


# SI unit -> how many of the unit of drawings and data sheets it is, and that unit.
DRAWN_IN = {"m": (1e3, "mm"), "rad": (180 / np.pi, "deg"), "Pa": (1e-9, "GPa")}


def in_words(name: str) -> str:
    """A key of a description as a heading."""
    return name.replace(".", " ").replace("_", " ")


def readable(name: str, value: float | str, numbers: Mapping[str, Parameter] = NUMBERS) -> str:
    """A value in the unit that drawings have: mm, degrees, GPa, and rpm beside rad/s."""
    if isinstance(value, str):
        return value
    unit = numbers[name].unit
    factor, written = DRAWN_IN.get(unit, (1.0, "" if unit == "1" else unit))
    text = f"{value * factor:.6g} {written}".rstrip()
    return f"{text} ({value * 30 / np.pi:.4g} rpm)" if unit == "rad/s" else text


def key_of(name: str) -> str:
    """Return the name of the number that is meant: of a diameter its radius, else the name."""
    head, dot, tail = name.rpartition(".")
    return f"{head}{dot}{DIAMETERS.get(tail, tail)}"


def unknown(name: str, keys: Collection[str]) -> ValueError:
    """Return the error, with near misses, of a name that is none of the keys."""
    inside = [key for key in keys if key.startswith(f"{name}.")]
    if inside:  # a value in the place of a table, an empty table, or [[a table]]
        must = f"must be a table [{name}] with keys such as {inside[0]}, but has none."
        return ValueError(f"Argument `{name}` {must}")
    near = _suggestion(name, tuple(keys))
    return ValueError(f"Argument `{name}` must be a known key, but is not{near}")


def _suggestion(name: str, keys: tuple[str, ...]) -> str:
    """Near misses, or what there is."""
    head, _, tail = name.rpartition(".")
    top, tables = name.partition(".")[0], [one for one in tables_of(keys) if "." not in one]
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


def tables_of(keys: Iterable[str]) -> tuple[str, ...]:
    """Return the names of the tables that keys stand in, and of tables inside these."""
    parts = (name.split(".") for name in keys)
    return tuple(dict.fromkeys(".".join(one[:i]) for one in parts for i in range(1, len(one))))

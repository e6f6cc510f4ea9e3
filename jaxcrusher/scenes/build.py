"""The scene of a crusher's description with its parts, and a crusher as a machine.

The paper is Wang, Cui, Wang, Appl. Sci. 2023, 13, 238: the PE250x400 of Tables 1 and 2.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.lax import stop_gradient
from jaxtyping import ArrayLike, Scalar
from typing_extensions import override

from jaxcrusher.basics.checks import (
    concrete,
    nan_unless,
    primal,
    require,
    require_own_process,
    require_x64,
)
from jaxcrusher.basics.plane import Arm, Vector, arm_to, direction
from jaxcrusher.crusher.capacity import CrushingChamber, stroke, stroke_ratio
from jaxcrusher.crusher.loads import ByAngle, HalfSineStroke, closing_stroke_of, crushing_bed
from jaxcrusher.crusher.machine import crusher_linkage, require_crusher, with_counterweight
from jaxcrusher.crusher.template import CRUSHER
from jaxcrusher.joint.clearance import AbstractBearing, ClearanceJoint
from jaxcrusher.joint.friction import AbstractFriction
from jaxcrusher.joint.guide import Guide
from jaxcrusher.joint.normal import (
    AbstractNormalForce,
    ConstantImpactVelocity,
    TrackedImpactVelocity,
    cylinder_stiffness,
    sphere_stiffness,
)
from jaxcrusher.joint.rollers import RollerBearing, Rollers
from jaxcrusher.mechanism.acting import AbstractPush, Spring, rough_feed
from jaxcrusher.mechanism.drives import ConstantSpeed, UnevenSpeed
from jaxcrusher.mechanism.eccentricity import EccentricityFormulation
from jaxcrusher.mechanism.linkage import Body, Linkage, Point
from jaxcrusher.mechanism.motion import ideal_at_rest
from jaxcrusher.mechanism.named import Named
from jaxcrusher.mechanism.scene import Scene, require_clearance
from jaxcrusher.mechanism.supports import AbstractFoundation, Clamped, OnSupports, soil_under
from jaxcrusher.mechanism.topology import FRAME
from jaxcrusher.scenes.load_curve import load_curve
from jaxcrusher.scenes.machine import AbstractStructure, Machine
from jaxcrusher.scenes.own_laws import built, check_description, is_own, law_numbers
from jaxcrusher.scenes.parameters import (
    CHAMBER,
    CHOICES,
    LAWS,
    LOOSE_JOINTS,
    NUMBERS,
    PAPER_CHAMBER,
    PE250X400,
    POINTS,
    SITE,
    Parameter,
    Value,
    check_number,
    complete,
    openers,
    readable,
    within_limits,
)
from jaxcrusher.scenes.plausibility import borrowed, has_constant_load, remarks, warn_of_unusual
from jaxcrusher.scenes.units import all_said, points_of

# What bodies and joints are made of.
_OF_LINKAGE = [
    name
    for name in PE250X400
    if name.partition(".")[0] in ("shaft", "jaw", "toggle", "bearing", "counterweight", "gravity")
]
# What the stroke of the jaw's lower end depends on.
LINKS = (
    "shaft.eccentricity",
    "jaw.length",
    "toggle.length",
    "bearing.distance",
    "bearing.inclination",
)

# Scalings that lead from a stroke to its eccentricity, and the share that it may be off.
STEPS, STROKE_ERROR = 8, 1e-9
# Widths of the contact's corner and of |e| (m), and what narrows them where the contact is stiffer
# or the clearance smaller than in the paper's box: the penetration under this force (N), so that
# the corner is off by 0.5 N at touch-down at most, and this share of the clearance.
_CORNER, _CORNER_FORCE = 1e-8, 4.0
_NORM, _NORM_SHARE = 1e-9, 4e-5
# Width of the corner where the tension rod goes slack, N.
_SLACK = 1.0


def build_scene(values: Mapping[str, Value]) -> Scene:
    """The scene of a description; names that are missing take the paper's value.

    `values` maps names of `PARAMETERS` to scalars in SI units, which may be traced, and names of
    `CHOICES` to one of their options; names of `CHAMBER` belong to `build_chamber`. A number that
    only `jax.jit` knows and that lies outside its limits becomes NaN, and the motion a failure. A
    friction of exactly 0 that is not traced leaves friction out. A law may be "module:Class", a
    class of your own, whose numbers are `contact.NAME`, `elbow.NAME`, `pivot.NAME`, or
    `crushing.NAME` of a load. Joint B is loose with an `elbow.clearance`, C with a
    `pivot.clearance`, O with a `shaft_bearing.clearance`; their other numbers and choices have the
    same prefix. With a `speed_fluctuation` the shaft turns unevenly.
    With a `load_edge` a load of the closing stroke rises and falls over this angle. With
    `load_law="by_angle"` a `load_curve` is a CSV file or an array of shape (n, 2) of angles
    (rad) and forces (N). A `load_scatter` makes any load a rough feed. With a
    `foundation.mass` the frame stands on supports, without it is clamped. With a `rod.stiffness`
    or a `rod.preload` a tension rod pulls at the jaw. With `contact_law="rollers"` the main bearing
    is a roller bearing of the numbers `rollers.NAME`, and numbers of sliding steel (friction,
    slip, restitution, elasticity) are not used. Numbers that are unlikely together, such as a speed
    given in rpm, raise one warning in a process for each of their values.

    Raises ValueError as `check_described`, `complete`, `Scene` and `require_crusher` do, the
    last one for all clearances at once.
    """
    require_x64()
    numbers = check_description(values)
    v = within_limits(complete(values), numbers)
    linkage, drive = build_linkage(v), drive_of(v)
    load, foundation, rod = _fed(_load(v, linkage), v), foundation_of(v), _rod(v, linkage)
    loose = {} if v["joint"] == "ideal" else {"main": joint_of(v, "")}
    worn = {joint: joint_of(v, f"{joint}.") for joint in LOOSE_JOINTS if f"{joint}.clearance" in v}
    for film in (f"{joint}.film.viscosity" for joint in LOOSE_JOINTS if joint not in worn):
        gap = film.replace("film.viscosity", "clearance")
        require(film not in v, film, f"come with `{gap}`", "alone")
    loose |= worn
    require_crusher(linkage, sum(joint.clearance for joint in loose.values()))
    warn_of_unusual(values)
    formulation = LAWS["formulation"][v["formulation"]] if loose else EccentricityFormulation
    return Scene(
        linkage=linkage,
        joints=Named(loose),
        drive=drive,
        pushes=() if load is None else (load,),
        springs=() if rod is None else (rod,),
        formulation=formulation(),
        start=LAWS["start"][v["start"]]() if loose else None,
        foundation=foundation,
        points=Named({n: Point(FRAME, Arm(*at)) for n, at in points_of(values).items()}),
        template=CRUSHER,
    )


def build_linkage(values: Mapping[str, Any]) -> Linkage:
    """The bodies and joints of a description, as in `build_scene`.

    Other names are ignored. Raises ValueError as `require_crusher` does.
    """
    v: dict[str, Any] = {**PE250X400, **values}
    linkage = _linkage({name: v[name] for name in _OF_LINKAGE})
    require_crusher(linkage)
    return linkage


@jax.jit  # one program: its operations one by one took half of the time of a scene
def _linkage(v: dict[str, Any]) -> Linkage:
    """Return the bodies and joints of a crusher; what they must be is checked of known numbers."""
    s1 = v["shaft.mass_centre_radius"] * direction(v["shaft.mass_centre_angle"])
    shaft = Body(v["shaft.mass"], v["shaft.inertia"], arm_to(s1))
    # The paper's: S2 = A + l21 (sin(theta2 + 15 deg), -cos(theta2 + 15 deg)).
    s2 = -v["jaw.mass_centre_distance"] * direction(v["jaw.mass_centre_angle"])
    tilt = v["bearing.inclination"]
    weight = v["counterweight.radius"] * direction(v["counterweight.angle"])
    return crusher_linkage(
        with_counterweight(shaft, v["counterweight.mass"], weight),
        Body(v["jaw.mass"], v["jaw.inertia"], arm_to(s2)),
        Body(v["toggle.mass"], v["toggle.inertia"], Arm(v["toggle.length"] / 2)),
        eccentricity=v["shaft.eccentricity"],
        jaw_length=v["jaw.length"],
        toggle_length=v["toggle.length"],
        bearing=v["bearing.distance"] * Vector(jnp.sin(tilt), jnp.cos(tilt)),
        gravity=v["gravity"],
    )


def build_chamber(values: Mapping[str, Any]) -> CrushingChamber:
    """The chamber of a description, its stroke from the links; differentiable by both.

    The paper's chamber has 2b - s = 60.6 mm exactly; other numbers change it by their difference.
    A number that only `jax.jit` knows and that lies outside its limits becomes NaN. Raises
    ValueError for known ones, as `build_linkage` does, and for a discharge opening that the stroke
    closes.
    """
    require_own_process()
    v = within_limits({**PE250X400, **PAPER_CHAMBER, **values})
    for number in CHAMBER:
        check_number(number, v[number])
    paper = CrushingChamber()
    name = "chamber.discharge"
    double_width = paper.double_width + 2 * (v[name] - PAPER_CHAMBER[name])
    if any(_differs(v[link], PE250X400[link]) for link in LINKS):
        travel = jax.jit(stroke)
        double_width = double_width - (travel(build_linkage(v)) - travel(build_linkage({})))
    width, discharge = primal(double_width), primal(v[name])
    if width is None or discharge is None:
        double_width = nan_unless(double_width > v[name], double_width)
    else:
        largest = readable(name, float(np.max(2 * discharge - width)))
        must = f"be wider than the jaw's stroke at its lower end, {largest}"
        given = readable(name, float(np.max(discharge)))
        require(bool(np.all(width > discharge)), name, must, given)
    return CrushingChamber(
        v["chamber.width"], v["chamber.height"], v["chamber.loosening"], double_width, v["gravity"]
    )


def by_stroke(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return a description whose stroke, if it has one, has become its shaft's eccentricity.

    The stroke is nearly proportional to the eccentricity, which is scaled by the ratio of the
    wanted stroke to its own until that is one. Raises ValueError where the description has both, or
    links that do not reach the stroke.
    """
    described = dict(values)
    wanted = described.pop("stroke", None)
    if wanted is None:
        return described
    both = "shaft.eccentricity" in described
    require(not both, "stroke", "not stand beside shaft.eccentricity", "given with it")
    travel, found = jax.jit(stroke), float(wanted) / 2
    for _ in range(STEPS):
        links = build_linkage(described | {"shaft.eccentricity": found})
        found *= float(wanted / travel(links))
    off = abs(float(travel(build_linkage(described | {"shaft.eccentricity": found}))) / wanted - 1)
    must = "be one that the links reach"
    require(off < STROKE_ERROR, "stroke", must, readable("stroke", float(wanted)))
    return described | {"shaft.eccentricity": found}


def _differs(value: Any, other: Any) -> bool:
    """Return whether a value is, or may be, another one."""
    known = concrete(value)
    return known is None or bool(np.any(known != other))


def _of(values: Mapping[str, Any], prefix: str) -> dict[str, Any]:
    """Return the values whose names have a prefix, by what follows it."""
    return {n.removeprefix(prefix): value for n, value in values.items() if n.startswith(prefix)}


def drive_of(values: Mapping[str, Any]) -> ConstantSpeed | UnevenSpeed:
    """Return what turns the shaft."""
    speed = values["speed"]
    if "speed_fluctuation" not in values:
        return ConstantSpeed(speed)
    names = "speed_fluctuation", "fluctuation_order", "fluctuation_phase"
    return UnevenSpeed(speed, *(values[name] for name in names))


def _load(values: Mapping[str, Any], linkage: Linkage) -> AbstractPush | None:
    """Return the crushing load, None without."""
    law, along = values["load_law"], values.get("load_point")
    if along is not None:
        length, at = primal(values["jaw.length"]), primal(along)
        if length is not None and at is not None:
            must = f"lie on the jaw, from 0 to its length {float(np.min(length)):g} m"
            require(bool(np.all(at <= length)), "load_point", must, at)
    if "load_edge" in values:
        require(law == "closing_stroke", "load_edge", "come with `load_law=closing_stroke`", law)
        middle, span = closing_stroke_of(linkage, along)
        rise = values["load_edge"]
        width, edge = primal(span), primal(rise)
        if width is None or edge is None:
            rise = nan_unless(2 * rise <= span, rise)
        else:
            must = "come with a point of the jaw that closes once in a turn"
            require(not np.isnan(width).any(), "load_edge", must, "with another one")
            must = f"be at most half of the closing stroke, {np.degrees(np.min(width)) / 2:.4g} deg"
            fits = bool(np.all(2 * edge <= width))
            require(fits, "load_edge", must, f"{np.degrees(np.max(edge)):.4g} deg")
        return HalfSineStroke(values["load"], along, middle, span, rise)
    if law == "none":
        require(along is None, "load_point", "not come with `load_law=none`", "given")
        return None
    if is_own("load_law", law):
        return built("load_law", law, values, magnitude=values["load"], along=along)
    if law == "chamber":
        require(along is None, "load_point", "not come with `load_law=chamber`", "given")
        v = {**PAPER_CHAMBER, **values}
        names = "width", "height", "discharge", "nip_angle", "bed_modulus", "bed_exponent"
        return crushing_bed(linkage, *(v[f"chamber.{name}"] for name in names))
    if law != "by_angle":
        return LAWS["load_law"][law](values["load"], along=along)
    require("load_curve" in values, "load_curve", "be given with `load_law=by_angle`", "missing")
    direction = LAWS["load_direction"][values["load_direction"]]
    return ByAngle(load_curve(values["load_curve"]), direction, values["load_factor"], along)


def _fed(load: AbstractPush | None, values: Mapping[str, Any]) -> AbstractPush | None:
    """Return the load of a rough feed, or the load itself where that does not scatter."""
    if "load_scatter" not in values:
        return load
    require(load is not None, "load_scatter", "not come with `load_law=none`", "given")
    assert load is not None
    if not _differs(values["load_scatter"], 0):
        return load
    names = "load_scatter", "load_bandwidth", "load_seed"
    return rough_feed(load, *(values[name] for name in names))


def foundation_of(values: Mapping[str, Any]) -> AbstractFoundation | None:
    """Return what the frame stands on; None: clamped, with moments about C."""
    numbers, soil = _of(values, "foundation."), _of(values, "foundation.soil.")
    for name in ("rocking_stiffness", "rocking_damping", *(f"soil.{name}" for name in soil)):
        known = name not in numbers or "mass" in numbers
        require(known, f"foundation.{name}", "come with `foundation.mass`", "alone")
    if "x" not in numbers:
        return None
    point = Vector(numbers.pop("x"), numbers.pop("y"))
    if "mass" not in numbers:
        return Clamped(point)
    numbers = {name: value for name, value in numbers.items() if "." not in name}
    if soil:
        numbers |= _on_soil(soil, values["speed"])
        numbers["base"] = numbers["base"] + numbers.pop("lever")
    arm = (numbers["right"] - numbers["left"]) / 2
    if "rocking_stiffness" in numbers:
        # Two vertical springs so far apart that they turn with it.
        middle = (numbers["left"] + numbers["right"]) / 2
        arm = jnp.sqrt(numbers.pop("rocking_stiffness") / (2 * numbers["vertical_stiffness"]))
        numbers |= {"left": middle - arm, "right": middle + arm}
    if "rocking_damping" in numbers:
        # What the two vertical dampers leave of it.
        rest = numbers["rocking_damping"] - 2 * numbers["vertical_damping"] * arm**2
        numbers["rocking_damping"] = rest
    return OnSupports(point=point, **numbers)


def _on_soil(soil: Mapping[str, Any], speed: Any) -> dict[str, Any]:
    """Return the numbers of each of two supports that stand for soil, and of its rocking."""
    both = "shear_modulus" in soil and "shear_wave_speed" in soil
    require(not both, "foundation.soil.shear_wave_speed", "not stand beside its modulus", "given")
    modulus = soil.get("shear_modulus")
    if modulus is None:
        modulus = soil["density"] * soil["shear_wave_speed"] ** 2
    names = "density", "poisson", "length", "width", "embedment"
    under = soil_under(modulus, *(soil[name] for name in names), speed=speed)._asdict()
    halved = (name for name in under if name.startswith(("horizontal", "vertical")))
    return under | {name: under[name] / 2 for name in halved}


def _rod(values: Mapping[str, Any], linkage: Linkage) -> Spring | None:
    """Return the tension rod, None without."""
    if "rod.stiffness" not in values:
        return None
    v = _of(values, "rod.")
    ends = (
        Point(FRAME, Arm(v["x"], v["y"])),
        Point("jaw", Arm(-v["jaw_along"], -v["jaw_across"])),
    )
    rod = Spring(ends, v["stiffness"], 0.0, v["damping"], v["preload"], _SLACK)
    # It has its preload at theta1 = 0 with ideal joints.
    length = rod.stretched(ideal_at_rest(linkage, 0.0)).stretch
    return replace(rod, length=length)


def friction_of(values: Mapping[str, Any], prefix: str) -> AbstractFriction | None:
    """Return the friction of a joint or a slide, None if it has none.

    Speeds of the ramp that are missing are the law's defaults. Sliders have the slip of surfaces.
    """
    if not _differs(values.get(f"{prefix}friction", 0), 0):
        return None
    name = f"{prefix}friction_law"
    known = {
        "slip": LAWS["slip"][values.get(f"{prefix}slip", "surface")](),
        "coefficient": values[f"{prefix}friction"],
    }
    law = values[name]
    if is_own(name, law):
        return built(name, law, values, **known)
    speeds = (of for of in ("static_speed", "full_speed") if prefix + of in values)
    ramp = {of: values[prefix + of] for of in speeds}
    written = [one for one in map(concrete, ramp.values()) if one is not None]
    if len(written) == 2:
        static, full = written
        good = bool((static < full).all())
        require(good, f"{prefix}static_speed", f"be less than full_speed {full} m/s", static)
    return LAWS["friction_law"][law](**known, **ramp)


def joint_of(values: Mapping[str, Any], prefix: str) -> AbstractBearing:
    """Return the joint whose names have the prefix."""
    v = _of(values, prefix)
    require_clearance(v["clearance"], v["bore_radius"], prefix)
    name, law = f"{prefix}contact_law", v["contact_law"]
    stiffness, width, norm_width = _stiffness(
        v["bore_radius"], v["clearance"], v["young"], v["poisson"]
    )
    film = None
    if "film.viscosity" in v:
        film = LAWS["film_law"][v["film_law"]](**_of(v, "film."))
    if law == "rollers":
        require(film is None, f"{prefix}film.viscosity", "not stand beside rollers", "given")
        return _roller_bearing(v, norm_width)
    known = {"stiffness": stiffness, "width": width, **_impacts(v)}
    place = {"bore_radius": v["bore_radius"], "clearance": v["clearance"]}
    normal = _contact_law(values, name, v, known, norm_width=norm_width, **place)
    if isinstance(normal, AbstractBearing):
        require(film is None, f"{prefix}film.viscosity", f"not stand beside {law}", "given")
        return normal
    friction = friction_of(values, prefix)
    return ClearanceJoint(
        **place, normal=normal, friction=friction, norm_width=norm_width, film=film
    )


def _impacts(v: Mapping[str, Any]) -> dict[str, Any]:
    """Return what a contact law takes of its impacts, from the numbers of a gap."""
    tracked = v["impact_law"] == "tracked"
    velocity = TrackedImpactVelocity() if tracked else ConstantImpactVelocity(v["impact_velocity"])
    return {"restitution": v["restitution"], "impact_velocity": velocity}


def _contact_law(
    values: Mapping[str, Any], name: str, v: Mapping[str, Any], known: dict[str, Any], **place: Any
) -> Any:
    """Return the law of a gap with the numbers `v`, by the choice of that name.

    Laws take what is `known` of their impacts; one of one's own takes its place too.
    """
    law = v["contact_law"]
    if not is_own(name, law):
        return LAWS["contact_law"][law](**known)
    modulus = v["young"] / (2 * (1 - v["poisson"] ** 2))
    return built(name, law, values, modulus=modulus, **place, **known)


def guide_of(values: Mapping[str, Any], prefix: str) -> Guide:
    """Return the guide with a gap whose names have the prefix."""
    v, name = _of(values, prefix), f"{prefix}contact_law"
    stiffness, width = _corner_stiffness(v["corner_radius"], v["young"], v["poisson"])
    known = {"stiffness": stiffness, "width": width, **_impacts(v)}
    normal = _contact_law(values, name, v, known, clearance=v["clearance"])
    told = f"a whole bearing, {v['contact_law']}"
    is_force = isinstance(normal, AbstractNormalForce)
    require(is_force, name, "be a normal force at a guide", told)
    sizes = {"clearance": v["clearance"], "corner_radius": v["corner_radius"]}
    return Guide(**sizes, normal=normal, friction=friction_of(values, prefix))


@jax.jit  # as above
def _corner_stiffness(radius: Any, young: Any, poisson: Any) -> tuple[Scalar, Scalar]:
    """Return the stiffness of a corner on an edge, and the width of its contact's corner."""
    stiffness = sphere_stiffness(radius, young, poisson)
    return stiffness, _corner_width(stiffness)


def _corner_width(stiffness: Scalar) -> Scalar:
    """No part of the model, so no derivative: each would be one more tangent to integrate."""
    return stop_gradient(jnp.minimum(_CORNER, (_CORNER_FORCE / stiffness) ** (2 / 3)))


@jax.jit  # as above
def _stiffness(
    bore_radius: Any, clearance: Any, young: Any, poisson: Any
) -> tuple[Scalar, Scalar, Scalar]:
    """Return the stiffness of pin and bore, and the widths of the contact's corner and of |e|."""
    stiffness = cylinder_stiffness(bore_radius, clearance, young, poisson)
    norm_width = stop_gradient(jnp.minimum(_NORM, _NORM_SHARE * clearance))
    return stiffness, _corner_width(stiffness), norm_width


def _roller_bearing(values: Mapping[str, Any], norm_width: Any) -> RollerBearing:
    """Return the roller bearing of a description."""
    v = _of(values, "rollers.")
    wheels, pitch, many = primal(v["diameter"]), primal(v["pitch_diameter"]), v["bearings"]
    if wheels is not None and pitch is not None:
        must = "be smaller than the pitch diameter"
        fits = bool(np.all(wheels < pitch))
        require(fits, "rollers.diameter", must, readable("rollers.diameter", float(np.max(wheels))))
    rollers = Rollers(
        clearance=values["clearance"],
        count=many * v["count"],
        length=v["length"],
        damping=many * v["damping"],
    )
    return RollerBearing(
        values["bore_radius"],
        values["clearance"],
        rollers,
        bearings=many,
        roller_diameter=v["diameter"],
        pitch_diameter=v["pitch_diameter"],
        bore=v["bore"],
        rolling_friction=v["friction"],
        static_rating=v["static_rating"],
        dynamic_rating=v["dynamic_rating"],
        norm_width=norm_width,
    )


def paper_scene(speed: ArrayLike, clearance: ArrayLike, **values: Value) -> Scene:
    """The paper's crusher with clearance in its main bearing.

    **Arguments:**

    - `speed`: of the shaft, rad/s, constant.
    - `clearance`: radial, R_i - R_j, m, in (0, 0.13).
    - `values`: any other names of `jaxcrusher.PE250X400`, as in `jaxcrusher.build_scene`, such as
      `start="contact"`, `slip="surface"`, `friction=0`, `load_law="closing_stroke"`,
      `impact_law="tracked"` or `formulation="multiplier"` (the paper's).

    Numbers may be traced. Raises ValueError as `build_scene` does.
    """
    return build_scene({"speed": speed, "clearance": clearance, **values})


def ideal_scene(speed: ArrayLike, **values: Value) -> Scene:
    """The paper's crusher without clearance: the reference for any clearance.

    `speed` in rad/s, constant; `values` and errors as in `paper_scene`. The ideal twin of
    any other scene is `scene.ideal()`.
    """
    return build_scene({"speed": speed, **values, "joint": "ideal"})


@dataclass(frozen=True)
class Crusher(AbstractStructure):
    """A single-toggle jaw crusher: what is not given of it is the paper's."""

    @override
    def complete(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Return the values with the paper's in the place of missing ones.

        Raises ValueError as `check_described` and `complete` do.
        """
        check_description(values)
        return complete(values)

    @override
    def scene(self, values: Mapping[str, Any]) -> Scene:
        return build_scene(values)

    @override
    def numbers(self, values: Mapping[str, Any]) -> Mapping[str, Parameter]:
        laws = law_numbers(values)
        return {**NUMBERS, **laws} if laws else NUMBERS

    @override
    def choices(self, values: Mapping[str, Any]) -> Mapping[str, tuple[str, ...]]:
        return CHOICES

    def merged(self, given: Mapping[str, Any], over: Mapping[str, Any]) -> dict[str, Any]:
        """Return a file's values with overrides, and the eccentricity in place of a stroke.

        `by_stroke` finds the eccentricity and raises its errors. An eccentricity or a stroke in
        `over` replaces either of them in the file.
        """
        throws = {"stroke", "shaft.eccentricity"}
        left = throws if throws & over.keys() else ()
        return by_stroke({n: v for n, v in given.items() if n not in left} | dict(over))

    @override
    def unusual(self, values: Mapping[str, Any]) -> list[str]:
        """Return `remarks`; ValueError as there, and for an impossible chamber."""
        build_chamber(values)
        return remarks(values)

    @override
    def borrowed(self, given: Mapping[str, Any]) -> list[str]:
        return borrowed(given)

    @override
    def left_open(self, machine: Machine) -> list[str]:
        """Return which numbers a file leaves to the PE250x400, and whether its load is chosen."""
        names, told = borrowed(machine.given), []
        if names:
            listed = ", ".join(f"{name} {readable(name, NUMBERS[name].default)}" for name in names)
            told.append(f"leaves {len(names)} numbers to the PE250x400: {listed}.")
        if "load_law" not in machine.given:
            told.append(
                "has no load_law: the load is the paper's, constant along the jaw. Rock presses "
                'while the jaw closes: load_law = "closing_stroke".'
            )
        return told

    @override
    def about(self, machine: Machine) -> dict[str, str]:
        """Return stroke and capacity, loads, masses and foundation, and what is assumed."""
        values, given = machine.values, machine.given

        def told(*keys: str) -> str:
            return all_said({key: values[key] for key in keys if key in values}, machine.units)

        constant = ("load",) if has_constant_load(values) else ("load_curve", "load_factor")
        parts = [key for key in NUMBERS if key.startswith(("foundation.", "rollers."))]
        assumed = [key for key in (*parts, "load_law", "contact_law") if key not in given]
        held = [key for key in parts if key in given and key.startswith("foundation.")]
        return {
            "crushing": _crushing(values),
            "loads": told("load_law", *constant, "load_point", "load_edge", "load_scatter"),
            "masses": told(
                "shaft.mass", "jaw.mass", "toggle.mass", "counterweight.mass", "frame_mass"
            ),
            "foundation": told(*held) or "clamped",
            "assumed": told(*assumed) or "nothing",
        }

    @override
    def idle(self, values: Mapping[str, Any]) -> set[str]:
        """Return names that only the load sheet and the capacity need; a bed needs the chamber."""
        rock = "chamber" in np.atleast_1d(values.get("load_law", ""))
        points = {name for name in values if name.startswith(POINTS)}
        return {*SITE, *(() if rock else CHAMBER), *points}

    @override
    def beside(
        self, fixed: Mapping[str, Any], varied: Mapping[str, tuple[Any, ...]]
    ) -> dict[str, Any]:
        """Return what all designs of a grid share, but nothing that a varied choice brings."""
        chosen = {f"{name}={value}" for name, values in varied.items() for value in values}
        found = super().beside(fixed, varied)
        return {n: v for n, v in found.items() if n in fixed or not chosen & {*openers(n)}}


def _crushing(values: Mapping[str, Any]) -> str:
    """Say stroke and capacity of a crusher."""
    links, capacity = build_linkage(values), build_chamber(values).capacity(values["speed"])
    return (
        f"stroke at the discharge {1e3 * float(stroke(links)):.3g} mm horizontally, "
        f"{float(stroke_ratio(links)):.2f} times that vertically, capacity {float(capacity):.3g} "
        "m3/h by laminating theory"
    )


def paper_machine(**values: Value | Path) -> Machine:
    """Return the paper's crusher as a machine, for sweeps, maps, identification and the search.

    `values` are names of `jaxcrusher.PE250X400` and others of `jaxcrusher.build_scene` that are not
    the paper's, as `start="contact"`; names with a dot go by `**{"jaw.mass": 600.0}`. Raises
    ValueError in one line as `build_scene` does.
    """
    described = {name: str(one) if isinstance(one, Path) else one for name, one in values.items()}
    return Machine(Crusher()).replace(**described)

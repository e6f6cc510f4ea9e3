"""What can be asked of a scene, made from its parts: observables and statistics by name.

They are of joints, slides, bodies and points, of the drive, of what shakes the ground, and of
supports. A template says what they are called, and adds what its machines alone have.
"""

import functools
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float, Scalar

from jaxcrusher.basics.checks import require, require_names
from jaxcrusher.basics.plane import Vector, or_zero, plus
from jaxcrusher.basics.smooth import norm
from jaxcrusher.joint.rollers import STATIC_PRESSURE, RollerBearing
from jaxcrusher.joint.validity import RollerLoad, Turning
from jaxcrusher.mechanism import observables as seen
from jaxcrusher.mechanism.observables import (
    acceleration_width,
    crank_speed,
    drive_power,
    drive_torque,
    fatigue,
    force_at,
    force_width,
    frame_displacement,
    frame_speed,
    ground_moment,
    on_bore,
    roller_pressure,
    shaking_size,
    static_load,
    stiffness_now,
    support_size,
    torque_width,
    transmitted_size,
)
from jaxcrusher.mechanism.reductions import (
    LARGEST,
    LEAST,
    PEAK,
    Deviation,
    Lasting,
    PowerMean,
    Sampled,
    ShareAboveZero,
    Statistic,
    top,
)
from jaxcrusher.mechanism.snapshot import Observable, OfPart, Snapshot

if TYPE_CHECKING:
    from jaxcrusher.mechanism.scene import Scene
else:
    Scene = Any  # which holds these tables

Observables = dict[str, Observable]
Statistics = dict[str, Statistic]
# A verdict on statistics, and their names.
Limits = dict[str, tuple[Callable[..., Any], tuple[str, ...]]]


class Parts(NamedTuple):
    """What a scene has by name, and whether it has supports, springs, and a crank that may rest."""

    joints: tuple[str, ...]
    loose: tuple[str, ...]
    rubbing: tuple[str, ...] = ()
    rolling: tuple[str, ...] = ()
    slides: tuple[str, ...] = ()
    points: tuple[str, ...] = ()
    supports: bool = False
    springs: bool = False
    rests: bool = False


class Title(NamedTuple):
    """What results call a part: before their names, in their meanings, and in a sentence."""

    prefix: str
    title: str
    words: str


CRANK = Title("crank_", "free crank", "crank")


def _winding(s: Snapshot, scene: Scene, joint: str) -> Scalar:
    """Revolutions of the pin round the bore over those of the shaft, as long as they touch.

    In flight past the bore's centre the angle jumps, and no step of the integration sees that.
    """
    contact = s.contacts[joint]
    if contact is None:
        return jnp.zeros_like(scene.drive.speed)
    touching = jnp.where(contact.penetration > 0, contact.orbit_speed, 0.0)
    return touching / scene.drive.speed


def _sliding_power(s: Snapshot, scene: Scene, joint: str) -> Scalar:
    """F_n times the slip of the surfaces, whatever slip the friction law reads: Archard's rate."""
    contact = s.contacts[joint]
    assert contact is not None and contact.surface_speed is not None, "nothing rubs there"
    return contact.normal_force * jnp.abs(contact.surface_speed)


def _largest_excursion(samples: Float[Array, "n 2"]) -> Scalar:
    """Return how far a point comes from its mean place."""
    x, y = (samples[:, i] - jnp.mean(samples[:, i]) for i in (0, 1))
    return top(jnp.sqrt(x**2 + y**2))


def _place_of_frame(s: Snapshot, scene: Scene) -> Float[Array, "2"]:
    return frame_displacement(s, scene).array()


# A place is smooth where forces are impacts, and 1024 instants a turn resolve it.
_EXCURSION = Sampled(_largest_excursion, jnp.max)
_CONTACT = ShareAboveZero()


def _always_at(joint: str, part: Title, table: Observables) -> Statistics:
    """Return the statistics of a joint that are computed without being asked for."""
    prefix, winding = part.prefix, OfPart(_winding, joint)
    depth, rate = table[f"{prefix}penetration_ratio"], table[f"{prefix}penetration_rate"]
    return {
        prefix + name: Statistic(unit, f"{meaning}, at {part.title}", quantity, reduction)
        for name, unit, meaning, quantity, reduction in (
            ("contact_fraction", "1", "share of time in contact", depth, _CONTACT),
            ("penetration_ratio", "1", "largest penetration / clearance", depth, LARGEST),
            ("impact_speed", "m/s", "fastest approach of pin and bore", rate, LARGEST),
            ("winding", "1", "revolutions round the bore a turn, in contact", winding, PowerMean()),
        )
    }


def _of_rollers(joint: str, part: Title) -> Statistics:
    """Return the statistics of a joint with rollers, computed without being asked for."""
    at, pressure = f"a bearing at {part.title}", OfPart(roller_pressure, joint)
    load, used = OfPart(static_load, joint), OfPart(fatigue, joint)
    pressed = "largest pressure between a roller and the inner ring"
    return {
        f"{part.prefix}roller_pressure": Statistic("Pa", pressed, pressure, LARGEST),
        f"{part.prefix}static_load_ratio": Statistic(
            "1", f"largest load of {at} over its static rating", load, LARGEST
        ),
        f"{part.prefix}bearing_life": Statistic("h", f"L10 of {at} by ISO 281", used, Lasting()),
    }


def _roller_load(pressure: Scalar, load: Scalar) -> RollerLoad:
    return RollerLoad(pressure / STATIC_PRESSURE, load)


# Of the machine as a whole.
OF_MACHINE = {
    # The force on the ground less its mean. Over a period the momentum comes back to itself, so
    # that the mean of -sum of m a is zero; over turns of a transient the mean is the momentum's
    # change over their time, and is not taken off.
    "shaking_rms": Statistic("N", "RMS of the shaking force", shaking_size, PowerMean(2)),
    "shaking_peak": Statistic("N", "peak of the shaking force", shaking_size, PEAK),
    # About the point of the foundation, and about its mean: a moment of weight stays.
    "shaking_moment_rms": Statistic(
        "N m", "RMS of what moves of the moment on the ground", ground_moment, Deviation()
    ),
    "drive_power": Statistic("W", "mean power of the drive", drive_power, PowerMean()),
}
# Of a frame on supports, when asked. The moving part of a force is what it has beside all weight,
# its mean over a period; a support carries its whole force.
OF_SUPPORTS = {
    "transmitted_rms": Statistic(
        "N", "RMS of what moves of the force on the ground", transmitted_size, PowerMean(2)
    ),
    "transmitted_peak": Statistic(
        "N", "peak of what moves of the force on the ground", transmitted_size, PEAK
    ),
    **{
        f"{side}_peak": Statistic(
            "N", f"largest force of the {side} support", OfPart(support_size, side), PEAK
        )
        for side in ("left", "right")
    },
    "frame_displacement_peak": Statistic(
        "m", "how far the frame's G comes from its mean place", _place_of_frame, _EXCURSION
    ),
    "frame_velocity_rms": Statistic("m/s", "RMS of the speed of G", frame_speed, PowerMean(2)),
}


def may_rest(scene: Scene) -> bool:
    """Return whether a free crank turns under friction, also of rollers, which might hold it."""
    rubs = any(
        joint.friction is not None or isinstance(joint, RollerBearing)
        for joint in scene.joints.values
    )
    return rubs and scene.drive.initial() is not None


def _position(s: Snapshot, scene: Scene, name: str) -> Vector:
    return s.motion.position(scene.point(name))


def _velocity(s: Snapshot, scene: Scene, name: str) -> Vector:
    return s.motion.velocity(scene.point(name))


def _acceleration(s: Snapshot, scene: Scene, name: str) -> Vector:
    """Return r_S'' + phi'' perp(arm) - phi'^2 arm past the ground, in the frame's axes."""
    point = scene.point(name)
    centre = s.accelerations.centres.at(point.body)
    arm = (point.arm - scene.linkage.body(point.body).mass_centre).along(s.motion.axis(point.body))
    if arm is None:
        return centre
    spin = plus(s.motion.spin(point.body), None if s.frame is None else s.frame.spin)
    spin_up = s.accelerations.spin_ups[point.body]
    turned = None if spin_up is None else spin_up * arm.perp()
    inward = None if spin is None else -(spin**2) * arm
    return centre + or_zero(plus(turned, inward))


def _acceleration_size(s: Snapshot, scene: Scene, name: str) -> Scalar:
    return norm(_acceleration(s, scene, name), acceleration_width(scene))


def _slide_force(s: Snapshot, scene: Scene, slide: str) -> Scalar:
    return s.accelerations.slides.at(slide).force


def _slide_moment(s: Snapshot, scene: Scene, slide: str) -> Scalar:
    return s.accelerations.slides.at(slide).moment


def _size(number: Scalar, width: Scalar) -> Scalar:
    """Return the size of a force or a torque, with a derivative at zero too."""
    return norm(Vector(number, jnp.zeros(())), width)


def _slide_size(s: Snapshot, scene: Scene, slide: str) -> Scalar:
    return _size(_slide_force(s, scene, slide), force_width(s, scene))


def _sizes(
    name: str, unit: str, meaning: str, size: Callable[[Snapshot, Any], Scalar]
) -> dict[str, Statistic]:
    """Return RMS and peak of the size of a quantity."""
    return {
        f"{name}_rms": Statistic(unit, f"RMS of the {meaning}", size, PowerMean(2)),
        f"{name}_peak": Statistic(unit, f"peak of the {meaning}", size, PEAK),
    }


def _torque_size(s: Snapshot, scene: Scene) -> Scalar:
    return _size(drive_torque(s, scene), torque_width(s, scene))


def _seen(function: Any, part: str, unit: str, meaning: str) -> Observable:
    return Observable(OfPart(function, part), unit, meaning)


def seen_of_linkage(parts: Parts) -> Observables:
    """Return what is seen of joints, slides, bodies and points; vectors x to the right and y up.

    Raises ValueError for names of parts of which two observables would have one name.
    """
    of_joints = {
        f"{joint}_reaction": _seen(on_bore, joint, "N", f"force on the bore of {joint}")
        for joint in parts.joints
    }
    found: Observables = {}
    for slide in parts.slides:
        found[f"{slide}_force"] = _seen(
            _slide_force, slide, "N", f"force on the slide {slide}, to the left of its direction"
        )
        found[f"{slide}_moment"] = _seen(
            _slide_moment, slide, "N m", f"moment on the slide {slide} about its body's origin"
        )
    for point in parts.points:
        found[f"{point}_position"] = _seen(
            _position, point, "m", f"place of {point}, from the frame"
        )
        found[f"{point}_velocity"] = _seen(
            _velocity, point, "m/s", f"velocity of {point}, past the frame"
        )
        found[f"{point}_acceleration"] = _seen(
            _acceleration, point, "m/s2", f"acceleration of {point}, past the ground"
        )
    _require_new(found, of_joints)
    return of_joints | found


def _require_new(found: Mapping[str, Any], others: Mapping[str, Any]) -> None:
    twice = ", ".join(sorted(found.keys() & others.keys()))
    must = "have other names than to be seen as what joints, machine or supports have"
    require(not twice, "slides and points", must, f"seen as {twice}")


def asked_of_linkage(parts: Parts) -> tuple[Statistics, Statistics]:
    """Return no usual statistics, and those of joints, slides, points and drive, when asked."""
    found: Statistics = _sizes("drive_torque", "N m", "size of the drive torque", _torque_size)
    for joint in parts.joints:
        found |= _sizes(f"{joint}_force", "N", f"force in {joint}", OfPart(force_at, joint))
    for slide in parts.slides:
        found |= _sizes(f"{slide}_force", "N", f"force on {slide}", OfPart(_slide_size, slide))
    for point in parts.points:
        size = OfPart(_acceleration_size, point)
        found |= _sizes(f"{point}_acceleration", "m/s2", f"acceleration of {point}", size)
    return {}, found


def no_limits(parts: Parts) -> Limits:
    """Return no limits."""
    return {}


@dataclass(frozen=True)
class Template:
    """What a kind of machine calls the parts of its scenes, and what it adds to what is asked.

    It is a part of a scene's structure, and equals its copies, also those of another process. One
    of its joints may have no prefix: results show it first, also where it is ideal.
    """

    joints: tuple[tuple[str, Title], ...] = ()  # of others the name says all
    crank: Title = CRANK
    springs: str = "spring_"
    origin: str = "the frame's origin"
    # The statistic by which errors of a motion are judged.
    leading: str = "shaking_rms"
    # Besides those of loose joints, of the machine, of its crank and of its supports.
    observables: Callable[[Parts], Observables] = seen_of_linkage
    # Those that are computed without being asked for, and others.
    statistics: Callable[[Parts], tuple[Statistics, Statistics]] = asked_of_linkage
    limits: Callable[[Parts], Limits] = no_limits
    # How pictures show a scene; None: by its joints and points.
    outline: Callable[[Any], Any] | None = None

    def joint(self, name: str) -> Title:
        """Return what a joint is called."""
        return dict(self.joints).get(name) or Title(f"{name}_", name, name.replace("_", " "))

    def watched(self, parts: Parts) -> dict[str, Title]:
        """Return the joints of whose contact there are statistics: a first one, and loose ones."""
        first = (name for name, title in self.joints if not title.prefix)
        return {name: self.joint(name) for name in (*first, *parts.loose)}


@functools.cache
def observables_of(template: Template, parts: Parts) -> Observables:
    """Return what can be observed of a scene, by name.

    Raises ValueError as the template's own `observables` do, and for a name that is taken.
    """
    found: Observables = {}
    for joint, title in template.watched(parts).items():
        found |= seen.observables_at(joint, title.prefix, title.title)
    crank = template.crank
    speed = Observable(crank_speed, "rad/s", f"speed of the {crank.words}")
    others = seen.OF_MACHINE | {f"{crank.prefix}speed": speed}
    others |= seen.OF_SUPPORTS if parts.supports else {}
    own = template.observables(parts)
    _require_new(own, found | others)
    return found | own | others


@functools.cache
def usual_of(template: Template, parts: Parts) -> Statistics:
    """Return the statistics of a scene that are computed without being asked for."""
    found = template.statistics(parts)[0] | {"shaking_rms": OF_MACHINE["shaking_rms"]}
    table = observables_of(template, parts)
    for joint, title in template.watched(parts).items():
        found |= _always_at(joint, title, table)
    for joint in parts.rolling:
        found |= _of_rollers(joint, template.joint(joint))
    if parts.rests:
        crank = template.crank
        meaning = f"least speed of a free {crank.words}, which friction does not hold at rest"
        found[f"{crank.prefix}speed_least"] = Statistic("rad/s", meaning, crank_speed, LEAST)
    return found


@functools.cache
def statistics_of(template: Template, parts: Parts) -> Statistics:
    """Return all statistics of a scene, the usual ones first."""
    found = usual_of(template, parts) | template.statistics(parts)[1] | OF_MACHINE
    for joint in parts.loose:
        at, now = template.joint(joint), OfPart(stiffness_now, joint)
        meaning = f"mean of dF/de at {at.title}"
        found[f"{at.prefix}bearing_stiffness"] = Statistic("N/m", meaning, now, PowerMean())
    for joint in parts.rubbing:
        at, wear = template.joint(joint), OfPart(_sliding_power, joint)
        meaning = f"mean of F_n |surface slip| at {at.title}: wear"
        found[f"{at.prefix}sliding_power"] = Statistic("W", meaning, wear, PowerMean())
    return found | (OF_SUPPORTS if parts.supports else {})


# What a scene may lack, and how its parts would be with it.
_WITH: dict[str, Callable[[Parts], Parts]] = {
    "a clearance there": lambda parts: parts._replace(loose=parts.joints),
    "friction there": lambda parts: parts._replace(rubbing=parts.joints),
    "rollers there": lambda parts: parts._replace(rolling=parts.joints),
    "supports": lambda parts: parts._replace(supports=True),
    "a spring": lambda parts: parts._replace(springs=True),
    "a crank that may rest": lambda parts: parts._replace(rests=True),
}


def require_asked(
    outputs: Any, table: Mapping[str, Any], template: Template, parts: Parts, *others: str
) -> None:
    """Check names of a scene's table, or `others`; ValueError says what an absent one needs."""
    for name in () if isinstance(outputs, str) or not isinstance(outputs, Iterable) else outputs:
        for lacking, change in _WITH.items() if name not in table else ():
            whole = template, change(parts)
            needs = name in observables_of(*whole) or name in statistics_of(*whole)
            require(not needs, "outputs", f"ask for {name} only of a scene with {lacking}", "asked")
    require_names("outputs", outputs, (*table, *others))


@functools.cache
def limits_of(template: Template, parts: Parts) -> Limits:
    """Return what a scene's model is limited by besides contacts, as far as statistics tell it."""
    found = template.limits(parts)
    if parts.rests:
        found |= {template.crank.title: (Turning, (f"{template.crank.prefix}speed_least",))}
    for joint in parts.rolling:
        at = template.joint(joint).prefix
        names = f"{at}roller_pressure", f"{at}static_load_ratio"
        found |= {f"{at}rollers": (_roller_load, names)}
    return found

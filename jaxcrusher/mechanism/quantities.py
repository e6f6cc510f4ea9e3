"""The observables and statistics of a scene by name, made from its parts.

They are of joints, slides, bodies and points, of the drive, of the forces that shake the ground,
and of supports. A template names them, and adds those that only its machines have.
"""

import functools
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple

import jax.numpy as jnp
from jax.lax import stop_gradient
from jaxtyping import Array, Float, Scalar

from jaxcrusher.basics.checks import require
from jaxcrusher.basics.plane import Vector
from jaxcrusher.basics.smooth import norm
from jaxcrusher.joint.rollers import STATIC_PRESSURE
from jaxcrusher.joint.validity import FilmThickness, Jamming, RollerLoad, Turning
from jaxcrusher.mechanism import observables as seen
from jaxcrusher.mechanism.observables import (
    PIN,
    acceleration_width,
    approach,
    crank_speed,
    drive_power,
    drive_torque,
    fatigue,
    film_ratio,
    force_at,
    force_width,
    frame_speed,
    ground_moment,
    on_bore,
    point_acceleration,
    point_velocity,
    roller_pressure,
    shaking_size,
    static_load,
    stiffness_now,
    support_size,
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
    lubricated: tuple[str, ...] = ()
    slides: tuple[str, ...] = ()
    guides: tuple[str, ...] = ()  # slides that rub
    bodies: tuple[str, ...] = ()
    points: tuple[str, ...] = ()  # of bodies, and of a frame on supports
    supports: bool = False
    springs: bool = False
    rests: bool = False


@dataclass(frozen=True)
class Asked:
    """Observables and statistics of a scene, and limits of its model besides contacts, by name.

    `measurable` are the observables that sensors on a plant's machine show.
    """

    observables: Mapping[str, Observable]
    usual: Statistics  # computed without being asked for
    further: Statistics  # when asked; of a usual one the same
    limits: Limits  # as far as statistics tell them
    measurable: tuple[str, ...] = ()

    @functools.cached_property
    def statistics(self) -> Mapping[str, Statistic]:
        """Return all statistics, the usual ones first; scenes of the same parts share the table."""
        return MappingProxyType(self.usual | self.further)


class Title(NamedTuple):
    """The names of a part in results: before their names, in their meanings, in a sentence."""

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


def sliding_power(s: Snapshot, scene: Scene, joint: str) -> Scalar:
    """F_n times the slip of the surfaces, whatever slip the friction law reads: Archard's rate."""
    contact = s.contacts[joint]
    assert contact is not None and contact.surface_speed is not None, "nothing rubs there"
    return contact.normal_force * jnp.abs(contact.surface_speed)


def _largest_excursion(samples: Float[Array, "n 2"]) -> Scalar:
    """Return how far a point comes from its mean place."""
    x, y = (samples[:, i] - jnp.mean(samples[:, i]) for i in (0, 1))
    return top(jnp.sqrt(x**2 + y**2))


# A place is smooth where forces are impacts, and 1024 instants a turn resolve it.
_EXCURSION = Sampled(_largest_excursion, jnp.max)
_CONTACT = ShareAboveZero()


def _always_at(joint: str, part: Title, table: Observables) -> Statistics:
    """Return the statistics of a joint that are computed without being asked for."""
    prefix, winding = part.prefix, OfPart(_winding, joint)
    depth, rate = table[f"{prefix}penetration_ratio"], OfPart(approach, joint)
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
        "m",
        "how far the frame's G comes from its mean place",
        seen.OF_SUPPORTS["frame_displacement"],
        _EXCURSION,
    ),
    "frame_velocity_rms": Statistic("m/s", "RMS of the speed of G", frame_speed, PowerMean(2)),
}


def position(s: Snapshot, scene: Scene, name: str) -> Vector:
    """Return where a point is, or the mass centre of a body, by its name, m."""
    return s.motion.position(scene.point(name))


def _acceleration_size(s: Snapshot, scene: Scene, name: str) -> Scalar:
    return norm(point_acceleration(s, scene, name), acceleration_width(scene))


def _slide_force(s: Snapshot, scene: Scene, slide: str) -> Scalar:
    return s.accelerations.slides.at(slide).force


def _slide_moment(s: Snapshot, scene: Scene, slide: str) -> Scalar:
    return s.accelerations.slides.at(slide).moment


def _slide_friction(s: Snapshot, scene: Scene, slide: str) -> Scalar:
    friction = s.accelerations.slides.at(slide).friction
    assert friction is not None, "nothing rubs there"
    return friction


def _slide_feedback(s: Snapshot, scene: Scene, slide: str) -> Scalar:
    feedback = s.accelerations.slides.at(slide).feedback
    assert feedback is not None, "nothing rubs there"
    return feedback


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
    # The width is the torque of that of forces at the crank's pin.
    return _size(drive_torque(s, scene), force_width(s, scene) * stop_gradient(scene.throw))


def _component(function: Any, part: str, unit: str, meaning: str) -> Observable:
    return Observable(OfPart(function, part), unit, meaning)


def sensors_at(
    name: str,
    part: str,
    velocity: Any = point_velocity,
    acceleration: Any = point_acceleration,
    called: str = "",
) -> Observables:
    """Return what a sensor at a part shows, relative to the ground and in the ground's axes."""
    called = called or name
    return {
        f"{name}_velocity": _component(velocity, part, "m/s", f"velocity of {called}"),
        f"{name}_acceleration": _component(acceleration, part, "m/s2", f"acceleration of {called}"),
    }


def require_new(found: Mapping[str, Any], others: Mapping[str, Any]) -> None:
    """Raise ValueError for observables of parts that have names of others."""
    twice = ", ".join(sorted(found.keys() & others.keys()))
    must = "have other names than to be seen as what joints, machine or supports have"
    require(not twice, "slides and points", must, f"seen as {twice}")


def own_of_linkage(parts: Parts) -> Asked:
    """Return what is asked of joints, slides, bodies and points.

    Vectors have x to the right and y up. Raises ValueError for part names that give two
    observables one name.
    """
    of_joints: Observables = {}
    found: Observables = {}
    usual: Statistics = {}
    limits: Limits = {}
    further = _sizes("drive_torque", "N m", "size of the drive torque", _torque_size)
    for joint in parts.joints:
        meaning = f"force on the bore of {joint}"
        of_joints[f"{joint}_reaction"] = _component(on_bore, joint, "N", meaning)
        further |= _sizes(f"{joint}_force", "N", f"force in {joint}", OfPart(force_at, joint))
    for slide in parts.slides:
        left = f"force on the slide {slide}, to the left of its direction"
        about = f"moment on the slide {slide} about its body's origin"
        found[f"{slide}_force"] = _component(_slide_force, slide, "N", left)
        found[f"{slide}_moment"] = _component(_slide_moment, slide, "N m", about)
        further |= _sizes(f"{slide}_force", "N", f"force on {slide}", OfPart(_slide_size, slide))
    for slide in parts.guides:
        ahead = f"friction on the slide {slide}, in its direction"
        found[f"{slide}_friction"] = _component(_slide_friction, slide, "N", ahead)
        meaning = f"largest share of the friction of {slide} that friction itself brings forth"
        own = OfPart(_slide_feedback, slide)
        usual[f"{slide}_feedback"] = Statistic("1", meaning, own, LARGEST)
        limits[slide] = Jamming, (f"{slide}_feedback",)
    for point in (*parts.bodies, *parts.points):
        found[f"{point}_position"] = _component(
            position, point, "m", f"place of {point}, in the frame"
        )
        found |= sensors_at(point, point)
        size = OfPart(_acceleration_size, point)
        further |= _sizes(f"{point}_acceleration", "m/s2", f"acceleration of {point}", size)
    require_new(found, of_joints)
    measurable = tuple(name for point in parts.points for name in sensors_at(point, point))
    return Asked(of_joints | found, usual, further, limits, measurable)


@dataclass(frozen=True)
class Template:
    """The names of parts in scenes of a kind of machine, and the observables that it adds.

    It is a part of a scene's structure, and equals its copies, also those of another process. One
    of its joints may have no prefix: results show it first, also where it is ideal.
    """

    joints: tuple[tuple[str, Title], ...] = ()  # of others the name says all
    crank: Title = CRANK
    springs: str = "spring_"
    origin: str = "the frame's origin"
    # The statistic by which errors of a motion are judged.
    headline: str = "shaking_rms"
    # Besides what is asked of loose joints, of the machine, of its crank and of its supports.
    own: Callable[[Parts], Asked] = own_of_linkage
    # How pictures show a scene; None: by its joints and points.
    outline: Callable[[Any], Any] | None = None

    def joint(self, name: str) -> Title:
        """Return what a joint is called."""
        return dict(self.joints).get(name) or Title(f"{name}_", name, name.replace("_", " "))

    @property
    def first(self) -> str | None:
        """Return the joint whose results have no prefix, if there is one."""
        return next((name for name, title in self.joints if not title.prefix), None)

    def watched(self, parts: Parts) -> dict[str, Title]:
        """Return the joints of whose contact there are statistics: a first one, and loose ones."""
        first = () if self.first is None else (self.first,)
        return {name: self.joint(name) for name in (*first, *parts.loose)}


@functools.cache
def asked_of(template: Template, parts: Parts) -> Asked:
    """Return what can be asked of a scene.

    Raises ValueError as the template's `own` does, and for a name that is taken.
    """
    own, crank, watched = template.own(parts), template.crank, template.watched(parts)
    speed = f"{crank.prefix}speed"
    others = seen.OF_MACHINE | {
        speed: Observable(crank_speed, "rad/s", f"speed of the {crank.words}")
    }
    others |= seen.OF_SUPPORTS if parts.supports else {}
    of_joints: Observables = {}
    for joint, at in watched.items():
        play = "way to the left, and tilt times half the length," if joint in parts.slides else PIN
        of_joints |= seen.observables_at(joint, at.prefix, at.title, play)
    require_new(own.observables, of_joints | others)

    usual = own.usual | {"shaking_rms": OF_MACHINE["shaking_rms"]}
    rests = {crank.title: (Turning, (f"{speed}_least",))} if parts.rests else {}
    limits = own.limits | rests
    for joint, at in watched.items():
        usual |= _always_at(joint, at, of_joints)
    for joint in parts.rolling:
        at = template.joint(joint)
        usual |= _of_rollers(joint, at)
        limits[f"{at.prefix}rollers"] = (
            lambda pressure, load: RollerLoad(pressure / STATIC_PRESSURE, load),
            (f"{at.prefix}roller_pressure", f"{at.prefix}static_load_ratio"),
        )
    for joint in parts.lubricated:
        at, ratio = template.joint(joint), OfPart(film_ratio, joint)
        meaning = f"thickness of the film at {at.title} over the least one, where it is thinnest"
        usual[f"{at.prefix}film_ratio"] = Statistic("1", meaning, ratio, LEAST)
        limits[f"{at.prefix}film"] = FilmThickness, (f"{at.prefix}film_ratio",)
    if parts.rests:
        meaning = f"least speed of a free {crank.words}, which friction does not hold at rest"
        usual[f"{speed}_least"] = Statistic("rad/s", meaning, crank_speed, LEAST)

    further = own.further | OF_MACHINE
    for joint in (one for one in parts.loose if one in parts.joints):
        at, now = template.joint(joint), OfPart(stiffness_now, joint)
        meaning = f"mean of dF/de at {at.title}"
        further[f"{at.prefix}bearing_stiffness"] = Statistic("N/m", meaning, now, PowerMean())
    for joint in parts.rubbing:
        at, wear = template.joint(joint), OfPart(sliding_power, joint)
        meaning = f"mean of F_n |surface slip| at {at.title}: wear"
        further[f"{at.prefix}sliding_power"] = Statistic("W", meaning, wear, PowerMean())
    further |= OF_SUPPORTS if parts.supports else {}
    # Scenes of the same parts share it.
    table = MappingProxyType({**of_joints, **own.observables, **others})
    # Of a frame on supports the force on it is inside of the machine.
    measurable = ("drive_torque", "drive_power", *own.measurable)
    measurable += (
        ("left_force", "right_force", "transmitted_force")
        if parts.supports
        else ("ground_force", "ground_moment")
    )
    measurable += ("frame_velocity",) if parts.supports and not parts.points else ()
    return Asked(table, usual, further, limits, measurable)


# What a scene may lack, and how its parts would be with it.
LACKING: dict[str, Callable[[Parts], Parts]] = {
    "a clearance there": lambda parts: parts._replace(loose=parts.joints),
    "friction there": lambda parts: parts._replace(rubbing=parts.joints, guides=parts.slides),
    "rollers there": lambda parts: parts._replace(rolling=parts.joints),
    "a film there": lambda parts: parts._replace(lubricated=parts.joints),
    "supports": lambda parts: parts._replace(supports=True),
    "a spring": lambda parts: parts._replace(springs=True),
    "a crank that may rest": lambda parts: parts._replace(rests=True),
}

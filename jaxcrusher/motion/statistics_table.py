"""Statistics and their table: a new statistic takes an entry here and nothing else."""

import abc
import functools
import operator
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import jax.numpy as jnp
from jaxtyping import Array, Float, Scalar

from jaxcrusher.crusher.bearing_load import fatigue, roller_pressure, static_load, stiffness_now
from jaxcrusher.crusher.joints import JOINTS, LETTERS, before
from jaxcrusher.crusher.observables import (
    OBSERVABLES,
    OfJoint,
    drive_power,
    force_at,
    foundation_force,
    frame_displacement,
    frame_speed,
    ground_moment,
    left_size,
    right_size,
    rod_margin,
    shaking_size,
    transmitted_size,
)
from jaxcrusher.crusher.scene import Scene
from jaxcrusher.files.table import Column
from jaxcrusher.joint.rollers import RollerBearing
from jaxcrusher.mechanism.snapshot import Snapshot

# A share of the time in contact that is all of it: a mean over many steps, with their rounding.
ALL_THE_TIME = 1 - 1e-9
# Instants a turn at which peaks, contact and the forces of an orbit are looked at: the length of a
# reaction that passes near zero bends more sharply than the motion does.
SAMPLES = 1024


# Smooths a deviation (in the unit of its quantity) where it vanishes.
DEVIATION_WIDTH = 1e-6


class AbstractMean(abc.ABC):
    """A number that follows from means over time, which are integrated with the motion."""

    @abc.abstractmethod
    def integrands(self, q: Array) -> tuple[Array, ...]:
        """Return the functions of the quantity whose means are taken."""

    @abc.abstractmethod
    def of_means(self, *means: Scalar) -> Scalar:
        """Return the number from the means."""

    @abc.abstractmethod
    def of_pieces(self, values: Float[Array, " n"]) -> Scalar:
        """Return the number over n equal pieces of a motion, from that of each."""


@dataclass(frozen=True)
class PowerMean(AbstractMean):
    """(mean of q^power)^(1/power) over time."""

    power: int = 1

    def integrands(self, q: Array) -> tuple[Array, ...]:
        """Return the power of the quantity."""
        return (q**self.power,)

    def of_means(self, *means: Scalar) -> Scalar:
        """Return the root of the mean."""
        (mean,) = means
        if self.power == 1:
            return mean
        return jnp.sqrt(mean) if self.power == 2 else mean ** (1 / self.power)

    def of_pieces(self, values: Float[Array, " n"]) -> Scalar:
        """Return the number over n equal pieces of a motion, from that of each."""
        return self.of_means(jnp.mean(values**self.power))


@dataclass(frozen=True)
class Deviation(AbstractMean):
    """RMS of q less its mean; over several turns each turn has a mean of its own.

    It is sqrt(mean of q^2 - (mean of q)^2), known to some 1e-8 of the mean.
    """

    def integrands(self, q: Array) -> tuple[Array, ...]:
        """Return the quantity and its square."""
        return q, q**2

    def of_means(self, *means: Scalar) -> Scalar:
        """Return the root of the variance."""
        mean, square = means
        return jnp.sqrt(jnp.maximum(square - mean**2, 0) + DEVIATION_WIDTH**2)

    def of_pieces(self, values: Float[Array, " n"]) -> Scalar:
        """Return the root mean square of the pieces."""
        return jnp.sqrt(jnp.mean(values**2))


@dataclass(frozen=True)
class Lasting(AbstractMean):
    """1 / mean of q: how long a stock lasts of which q is used in a unit of time."""

    def integrands(self, q: Array) -> tuple[Array, ...]:
        """Return the quantity."""
        return (q,)

    def of_means(self, *means: Scalar) -> Scalar:
        """Return the time."""
        (mean,) = means
        return 1 / mean

    def of_pieces(self, values: Float[Array, " n"]) -> Scalar:
        """Return the time over n equal pieces of a motion, from that of each."""
        return 1 / jnp.mean(1 / values)


@dataclass(frozen=True)
class Sampled:
    """Seen at `SAMPLES` instants a turn; how samples, and then n equal pieces, reduce to one."""

    of_samples: Callable[[Float[Array, "n ..."]], Scalar]
    of_pieces: Callable[[Float[Array, " n"]], Scalar]


@dataclass(frozen=True)
class Statistic:
    """A number of a motion: a quantity of its instants, reduced over time.

    Integrated means have slopes by any parameter; of a sampled peak the instant stays. Every orbit
    has all statistics, so `quantity` must have a value at an ideal joint too.
    """

    unit: str
    meaning: str
    quantity: Callable[[Snapshot, Scene], Array]
    reduction: AbstractMean | Sampled


def top(samples: Float[Array, " n"]) -> Scalar:
    """The top of the parabola through the largest sample and its neighbours."""
    index = jnp.clip(jnp.argmax(samples), 1, samples.size - 2)
    before, middle, after = samples[index - 1], samples[index], samples[index + 1]
    slope, bend = (after - before) / 2, before - 2 * middle + after
    concave = bend < 0
    shift = jnp.where(concave, -slope / jnp.where(concave, bend, 1), 0)
    vertex = middle + shift * (slope + shift * bend / 2)
    return jnp.where(jnp.abs(shift) <= 1, vertex, jnp.max(samples))


def _share_above_zero(samples: Float[Array, " n"]) -> Scalar:
    """NaN where a sample is; `jnp.heaviside` of JAX 0.10.0 would return a number there."""
    return jnp.mean(jnp.where(jnp.isnan(samples), jnp.nan, samples > 0))


def _winding(s: Snapshot, scene: Scene, joint: str) -> Scalar:
    """Revolutions of the pin round the bore over those of the shaft."""
    contact = s.contacts[joint]
    if contact is None:
        return jnp.zeros_like(scene.drive.speed)
    return contact.orbit_speed / scene.drive.speed


def _sliding_power(s: Snapshot, scene: Scene, joint: str) -> Scalar:
    """F_n times the slip of the surfaces, whatever slip the friction law reads: Archard's rate."""
    contact, prefix = s.contacts[joint], before(joint)
    if contact is None or contact.surface_speed is None:
        raise ValueError(
            f"Argument `outputs` must not ask for {prefix}sliding_power without friction, but does."
        )
    return contact.normal_force * jnp.abs(contact.surface_speed)


def _largest_excursion(samples: Float[Array, "n 2"]) -> Scalar:
    """Return how far a point comes from its mean place."""
    x, y = (samples[:, i] - jnp.mean(samples[:, i]) for i in (0, 1))
    return top(jnp.sqrt(x**2 + y**2))


def _place_of_frame(s: Snapshot, scene: Scene) -> Float[Array, "2"]:
    return frame_displacement(s, scene).array()


_PEAK, _LARGEST = Sampled(top, jnp.max), Sampled(jnp.max, jnp.max)
_LEAST = Sampled(jnp.min, jnp.min)
_EXCURSION = Sampled(_largest_excursion, jnp.max)
_CONTACT = Sampled(_share_above_zero, jnp.mean)


def _always_at(joint: str) -> dict[str, Statistic]:
    """Return the statistics of a joint that are computed without being asked for."""
    seen, prefix = OBSERVABLES, before(joint)
    depth, rate = seen[f"{prefix}penetration_ratio"], seen[f"{prefix}penetration_rate"]
    winding = OfJoint(_winding, joint)
    return {
        prefix + name: Statistic(unit, f"{meaning}, at {LETTERS[joint]}", quantity, reduction)
        for name, unit, meaning, quantity, reduction in (
            ("contact_fraction", "1", "share of time in contact", depth, _CONTACT),
            ("penetration_ratio", "1", "largest penetration / clearance", depth, _LARGEST),
            ("impact_speed", "m/s", "fastest approach of pin and bore", rate, _LARGEST),
            ("winding", "1", "revolutions of pin round bore per turn", winding, PowerMean()),
        )
    }


def _further_at(joint: str) -> dict[str, Statistic]:
    """Return the statistics of a joint that are computed if they are asked for."""
    prefix, force = before(joint), OfJoint(force_at, joint)
    wear = OfJoint(_sliding_power, joint)
    return {
        f"{prefix}joint_peak": Statistic("N", f"largest force at {LETTERS[joint]}", force, _PEAK),
        f"{prefix}sliding_power": Statistic(
            "W", f"mean of F_n |surface slip| at {LETTERS[joint]}: wear", wear, PowerMean()
        ),
    }


_BY_DEFAULT = {
    "foundation_rms": Statistic("N", "RMS of |R_O| + |R_C|", foundation_force, PowerMean(2)),
    "foundation_mean": Statistic("N", "mean of |R_O| + |R_C|", foundation_force, PowerMean()),
    "foundation_peak": Statistic("N", "peak of |R_O| + |R_C|", foundation_force, _PEAK),
    # The force on the ground less its mean. Over a period the momentum comes back to itself, so
    # that the mean of -sum of m a is zero; over turns of a transient the mean is the momentum's
    # change over their time, and is not taken off.
    "shaking_rms": Statistic("N", "RMS of the shaking force", shaking_size, PowerMean(2)),
    **_always_at("main"),
}
_FURTHER = {
    # Within 20 % of a peak that lasts 5 % of a turn, and differentiable where the instant of the
    # peak jumps.
    "foundation_smooth_peak": Statistic(
        "N", "(mean of (|R_O| + |R_C|)^16)^(1/16)", foundation_force, PowerMean(16)
    ),
    "shaking_peak": Statistic("N", "peak of the shaking force", shaking_size, _PEAK),
    # About the point of the foundation, and about its mean: a moment of weight stays.
    "shaking_moment_rms": Statistic(
        "N m", "RMS of what moves of the moment on the ground", ground_moment, Deviation()
    ),
    **_further_at("main"),
    "drive_power": Statistic("W", "mean power of the drive", drive_power, PowerMean()),
}
# Of a frame on supports, when asked. The moving part of a force is what it has beside all weight,
# its mean over a period; a support carries its whole force.
_OF_SUPPORTS = {
    "transmitted_rms": Statistic(
        "N", "RMS of what moves of the force on the ground", transmitted_size, PowerMean(2)
    ),
    "transmitted_peak": Statistic(
        "N", "peak of what moves of the force on the ground", transmitted_size, _PEAK
    ),
    "left_peak": Statistic("N", "largest force of the left support", left_size, _PEAK),
    "right_peak": Statistic("N", "largest force of the right support", right_size, _PEAK),
    "frame_displacement_peak": Statistic(
        "m", "how far the frame's G comes from its mean place", _place_of_frame, _EXCURSION
    ),
    "frame_velocity_rms": Statistic("m/s", "RMS of the speed of G", frame_speed, PowerMean(2)),
}
# Of a tension rod, when asked.
_OF_ROD = {
    "rod_tension_least": Statistic(
        "N", "least tension of the rod; where it is negative the rod is slack", rod_margin, _LEAST
    ),
}
# Of a free shaft under friction.
_OF_SHAFT = {
    "shaft_speed_least": Statistic(
        "rad/s",
        "least speed of a free shaft, which friction does not hold at rest",
        OBSERVABLES["shaft_speed"],
        _LEAST,
    ),
}
# Of a main bearing with clearance, and of rollers there, when asked.
_OF_MAIN = {
    "bearing_stiffness": Statistic("N/m", "mean of dF/de at A", stiffness_now, PowerMean()),
}
_OF_ROLLERS = {
    "roller_pressure": Statistic(
        "Pa", "largest pressure between a roller and the inner ring", roller_pressure, _LARGEST
    ),
    "static_load_ratio": Statistic(
        "1", "largest load of a bearing at A over its static rating", static_load, _LARGEST
    ),
    "bearing_life": Statistic("h", "L10 of a bearing at A by ISO 281", fatigue, Lasting()),
}
_FURTHER |= _OF_SUPPORTS | _OF_ROD | _OF_SHAFT | _OF_MAIN | _OF_ROLLERS
# Of each joint, what is computed without being asked, and what when asked.
_BY_JOINT = {joint: (_always_at(joint), _further_at(joint)) for joint in JOINTS}
_OF_OTHERS = [of_joint for joint in JOINTS[1:] for of_joint in _BY_JOINT[joint]]

# Name -> unit, meaning, quantity and reduction of what `statistics` computes when asked, the first
# of them without being asked. Those of elbow and pivot have these names before theirs.
STATISTIC = functools.reduce(operator.or_, _OF_OTHERS, _BY_DEFAULT | _FURTHER)
# What `statistics` computes without being asked, with the same of a loose elbow and pivot.
STATISTICS = tuple(_BY_DEFAULT)
# What it computes when asked, with the same of elbow and pivot.
FURTHER_STATISTICS = tuple(_FURTHER)

# Joint -> what `statistics` computes of it without being asked.
ALWAYS = {joint: tuple(always) for joint, (always, _) in _BY_JOINT.items()}

# What a program computes: it is compiled for the entries, since a name may get another one.
Chosen = tuple[tuple[str, Statistic], ...]


def chosen(names: Iterable[str]) -> Chosen:
    """Return the entries that these names have now."""
    return tuple((name, STATISTIC[name]) for name in names)


def columns(names: Iterable[str]) -> dict[str, Column]:
    """Return the columns of these statistics in a table."""
    return {name: Column(STATISTIC[name].unit, STATISTIC[name].meaning) for name in names}


def always_with(loose: Iterable[str]) -> tuple[str, ...]:
    """The names of what is computed without being asked where these joints are loose.

    Entries that were added to the table are among them.
    """
    found, left_out = {JOINTS[0], *loose}, set(FURTHER_STATISTICS)
    for joint, (always, further) in _BY_JOINT.items():
        left_out |= set(further) if joint in found else {*always, *further}
    return tuple(name for name in STATISTIC if name not in left_out)


def may_rest(scene: Scene) -> bool:
    """Return whether a free shaft turns under friction, which might hold it at rest."""
    rubs = any(joint.friction is not None for _, joint in scene.joints.items())
    return rubs and scene.drive.initial() is not None


def always_of(scene: Scene) -> tuple[str, ...]:
    """The names of what `statistics` computes of a scene without being asked."""
    found = always_with(joint for joint, _ in scene.joints.items())
    if scene.rod is not None:
        found = (*found, *_OF_ROD)
    if may_rest(scene):
        found = (*found, *_OF_SHAFT)
    return (*found, *_OF_ROLLERS) if isinstance(scene.joint, RollerBearing) else found


def statistics_of(scene: Scene) -> tuple[str, ...]:
    """The names of all that a scene has."""
    loose, left_out = dict(scene.joints.items()), set[str]()
    if scene.supports is None:
        left_out |= set(_OF_SUPPORTS)
    if scene.rod is None:
        left_out |= set(_OF_ROD)
    if not may_rest(scene):
        left_out |= set(_OF_SHAFT)
    if scene.joint is None:
        left_out |= set(_OF_MAIN)
    if not isinstance(scene.joint, RollerBearing):
        left_out |= set(_OF_ROLLERS)
    for joint, (always, further) in _BY_JOINT.items():
        if joint not in (JOINTS[0], *loose):
            left_out |= {*always, *further}
        elif joint not in loose or loose[joint].friction is None:
            left_out.add(f"{before(joint)}sliding_power")
    return tuple(name for name in STATISTIC if name not in left_out)

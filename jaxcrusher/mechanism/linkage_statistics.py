"""Statistics of any linkage: of its joints, of its drive, of what it shakes, of its supports."""

from collections.abc import Mapping

import jax.numpy as jnp
from jaxtyping import Array, Float, Scalar

from jaxcrusher.mechanism.observables import (
    crank_speed,
    drive_power,
    force_at,
    frame_displacement,
    frame_speed,
    ground_moment,
    left_size,
    right_size,
    shaking_size,
    transmitted_size,
)
from jaxcrusher.mechanism.reductions import (
    Deviation,
    PowerMean,
    Sampled,
    Statistic,
    share_above_zero,
    top,
)
from jaxcrusher.mechanism.scene import AbstractScene
from jaxcrusher.mechanism.snapshot import Observable, OfPart, Snapshot

Statistics = dict[str, Statistic]


def _winding(s: Snapshot, scene: AbstractScene, joint: str) -> Scalar:
    """Revolutions of the pin round the bore over those of the shaft."""
    contact = s.contacts[joint]
    if contact is None:
        return jnp.zeros_like(scene.drive.speed)
    return contact.orbit_speed / scene.drive.speed


def _sliding_power(s: Snapshot, scene: AbstractScene, joint: str) -> Scalar:
    """F_n times the slip of the surfaces, whatever slip the friction law reads: Archard's rate."""
    contact = s.contacts[joint]
    if contact is None or contact.surface_speed is None:
        raise ValueError(
            f"Argument `outputs` must not ask for the sliding_power of {joint}, which has no "
            "friction, but does."
        )
    return contact.normal_force * jnp.abs(contact.surface_speed)


def _largest_excursion(samples: Float[Array, "n 2"]) -> Scalar:
    """Return how far a point comes from its mean place."""
    x, y = (samples[:, i] - jnp.mean(samples[:, i]) for i in (0, 1))
    return top(jnp.sqrt(x**2 + y**2))


def _place_of_frame(s: Snapshot, scene: AbstractScene) -> Float[Array, "2"]:
    return frame_displacement(s, scene).array()


PEAK, LARGEST = Sampled(top, jnp.max), Sampled(jnp.max, jnp.max)
LEAST = Sampled(jnp.min, jnp.min)
_EXCURSION = Sampled(_largest_excursion, jnp.max)
_CONTACT = Sampled(share_above_zero, jnp.mean)


def always_at(joint: str, prefix: str, place: str, seen: Mapping[str, Observable]) -> Statistics:
    """Return the statistics of a joint that are computed without being asked for."""
    depth, rate = seen[f"{prefix}penetration_ratio"], seen[f"{prefix}penetration_rate"]
    winding = OfPart(_winding, joint)
    return {
        prefix + name: Statistic(unit, f"{meaning}, at {place}", quantity, reduction)
        for name, unit, meaning, quantity, reduction in (
            ("contact_fraction", "1", "share of time in contact", depth, _CONTACT),
            ("penetration_ratio", "1", "largest penetration / clearance", depth, LARGEST),
            ("impact_speed", "m/s", "fastest approach of pin and bore", rate, LARGEST),
            ("winding", "1", "revolutions of pin round bore per turn", winding, PowerMean()),
        )
    }


def further_at(joint: str, prefix: str, place: str) -> Statistics:
    """Return the statistics of a joint that are computed if they are asked for."""
    force, wear = OfPart(force_at, joint), OfPart(_sliding_power, joint)
    return {
        f"{prefix}joint_peak": Statistic("N", f"largest force at {place}", force, PEAK),
        f"{prefix}sliding_power": Statistic(
            "W", f"mean of F_n |surface slip| at {place}: wear", wear, PowerMean()
        ),
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
    "left_peak": Statistic("N", "largest force of the left support", left_size, PEAK),
    "right_peak": Statistic("N", "largest force of the right support", right_size, PEAK),
    "frame_displacement_peak": Statistic(
        "m", "how far the frame's G comes from its mean place", _place_of_frame, _EXCURSION
    ),
    "frame_velocity_rms": Statistic("m/s", "RMS of the speed of G", frame_speed, PowerMean(2)),
}
# Of a free shaft under friction.
OF_SHAFT = {
    "shaft_speed_least": Statistic(
        "rad/s",
        "least speed of a free shaft, which friction does not hold at rest",
        crank_speed,
        LEAST,
    ),
}


def may_rest(scene: AbstractScene) -> bool:
    """Return whether a free shaft turns under friction, which might hold it at rest."""
    rubs = any(joint.friction is not None for _, joint in scene.joints.items())
    return rubs and scene.drive.initial() is not None

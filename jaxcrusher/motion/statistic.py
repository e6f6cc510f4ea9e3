"""What a statistic is, and the table of all: an entry here is all that a new one takes."""

from collections.abc import Callable
from dataclasses import dataclass

import jax.numpy as jnp
from jaxtyping import Array, Float, Scalar

from jaxcrusher.basics.smooth import norm
from jaxcrusher.crusher.observables import FORCE_WIDTH, OBSERVABLES, drive_power, foundation_force
from jaxcrusher.crusher.scene import Scene
from jaxcrusher.crusher.snapshot import Snapshot

# Instants per turn at which peaks and contact are looked at.
SAMPLES = 1024


@dataclass(frozen=True)
class PowerMean:
    """(mean of q^power)^(1/power) over time: integrated with the motion."""

    power: int = 1

    def root(self, mean: Scalar) -> Scalar:
        """From the mean of the power."""
        if self.power == 1:
            return mean
        return jnp.sqrt(mean) if self.power == 2 else mean ** (1 / self.power)

    def of_pieces(self, values: Float[Array, " n"]) -> Scalar:
        """Over n equal pieces of a motion, from that of each."""
        return self.root(jnp.mean(values**self.power))


@dataclass(frozen=True)
class Sampled:
    """Seen at `SAMPLES` instants a turn; how samples, and then n equal pieces, reduce to one."""

    of_samples: Callable[[Float[Array, " n"]], Scalar]
    of_pieces: Callable[[Float[Array, " n"]], Scalar]


@dataclass(frozen=True)
class Statistic:
    """A number of a motion: a quantity of its instants, reduced over time.

    Integrated means have slopes by any parameter; of a sampled peak the instant stays.
    """

    unit: str
    meaning: str
    quantity: Callable[[Snapshot, Scene], Scalar]
    reduction: PowerMean | Sampled


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
    """NaN where a sample is."""
    return jnp.mean(jnp.heaviside(samples, 0.0))


def _joint_force(s: Snapshot, scene: Scene) -> Scalar:
    return norm(s.joint_force, FORCE_WIDTH)


def _winding(s: Snapshot, scene: Scene) -> Scalar:
    """Revolutions of the pin round the bore over those of the shaft."""
    if s.contact is None:
        return jnp.zeros_like(scene.drive.speed)
    return s.contact.orbit_speed / scene.drive.speed


def _sliding_power(s: Snapshot, scene: Scene) -> Scalar:
    """F_n times the slip of the surfaces, whatever slip the friction law reads: Archard's rate."""
    if s.contact is None or s.contact.surface_speed is None:
        raise ValueError(
            "Argument `outputs` must not ask for sliding_power without friction, but does."
        )
    return s.contact.normal_force * jnp.abs(s.contact.surface_speed)


_PEAK, _LARGEST = Sampled(top, jnp.max), Sampled(jnp.max, jnp.max)

_BY_DEFAULT = {
    "foundation_rms": Statistic("N", "RMS of |R_O| + |R_C|", foundation_force, PowerMean(2)),
    "foundation_mean": Statistic("N", "mean of |R_O| + |R_C|", foundation_force, PowerMean()),
    "foundation_peak": Statistic("N", "peak of |R_O| + |R_C|", foundation_force, _PEAK),
    "contact_fraction": Statistic(
        "1",
        "share of time in contact",
        OBSERVABLES["penetration_ratio"],
        Sampled(_share_above_zero, jnp.mean),
    ),
    "penetration_ratio": Statistic(
        "1", "largest penetration / clearance", OBSERVABLES["penetration_ratio"], _LARGEST
    ),
    "impact_speed": Statistic(
        "m/s", "fastest approach of pin and bore", OBSERVABLES["penetration_rate"], _LARGEST
    ),
    "winding": Statistic(
        "1", "revolutions of the pin round the bore per turn", _winding, PowerMean()
    ),
}
_FURTHER = {
    # Within 20 % of a peak that lasts 5 % of a turn, and differentiable where the instant of the
    # peak jumps.
    "foundation_smooth_peak": Statistic(
        "N", "(mean of (|R_O| + |R_C|)^16)^(1/16)", foundation_force, PowerMean(16)
    ),
    "joint_peak": Statistic("N", "largest force in the main bearing", _joint_force, _PEAK),
    "sliding_power": Statistic(
        "W", "mean of F_n |surface slip|: wear", _sliding_power, PowerMean()
    ),
    "drive_power": Statistic("W", "mean power of the drive", drive_power, PowerMean()),
}

# Name -> unit, meaning, quantity and reduction of what `statistics` computes when asked, the first
# of them without being asked.
STATISTIC = {**_BY_DEFAULT, **_FURTHER}
# What `statistics` computes without being asked.
STATISTICS = tuple(_BY_DEFAULT)
# What it computes when asked.
FURTHER_STATISTICS = tuple(_FURTHER)

"""Statistics: a quantity of the instants of a motion, reduced over time to one number."""

import abc
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree, Scalar

from jaxcrusher.basics.checks import require, require_whole
from jaxcrusher.mechanism.snapshot import Observable, Snapshot

# A share of the time in contact that is all of it: a mean over many steps, with their rounding.
ALL_THE_TIME = 1 - 1e-9
# Instants a turn at which peaks, contact and the forces of an orbit are looked at: the length of a
# reaction that passes near zero bends more sharply than the motion does.
SAMPLES = 1024
# Smooths a deviation where it vanishes, as a share of the RMS of its quantity, whatever its unit; a
# quantity that is zero throughout has slopes too.
DEVIATION_WIDTH, NOTHING = 1e-8, 1e-30


def require_orders(orders: int) -> None:
    """Check the highest harmonic that is asked for: instants of a turn determine no higher ones."""
    require_whole("orders", orders, 1)
    require(orders < SAMPLES // 2, "orders", f"be less than {SAMPLES // 2}", orders)


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
        least = DEVIATION_WIDTH**2 * square + NOTHING**2
        return jnp.sqrt(jnp.maximum(square - mean**2, 0) + least)

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


def of_slices(
    how: AbstractMean | Sampled, kept: PyTree[Float[Array, "slices ..."]], turns: int
) -> Scalar:
    """Return the number over whole turns from what each of their equal slices keeps of it.

    That are the means of the integrands, or all samples: what a slice makes of its own mean is not
    what its turn makes of it. A slice may be an instant, of which there are the integrands.
    """

    def of_turn(slices: PyTree[Float[Array, "slices ..."]]) -> Scalar:
        if isinstance(how, AbstractMean):
            return how.of_means(*map(jnp.mean, slices))
        return how.of_samples(slices.reshape(-1, *slices.shape[2:]))

    if turns == 1:  # a root of its own square has no slope at zero
        return of_turn(kept)
    by_turn = jax.tree.map(lambda leaf: jnp.reshape(leaf, (turns, -1, *leaf.shape[1:])), kept)
    return how.of_pieces(jax.vmap(of_turn)(by_turn))


@dataclass(frozen=True)
class Statistic:
    """A number of a motion: a quantity of its instants, reduced over time.

    Integrated means have slopes by any parameter; of a sampled peak the instant stays. Every orbit
    has all statistics, so `quantity` must have a value at an ideal joint too.
    """

    unit: str
    meaning: str
    quantity: Callable[[Snapshot, Any], Array]
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


def share_above_zero(samples: Float[Array, " n"]) -> Scalar:
    """NaN where a sample is, in which a comparison sees a number below zero."""
    return jnp.mean(jnp.where(jnp.isnan(samples), jnp.nan, (samples > 0).astype(float)))


# What a program computes: it is compiled for the entries, since a name may get another one.
Chosen = tuple[tuple[str, Statistic], ...]


def chosen(table: Mapping[str, Statistic], names: Iterable[str]) -> Chosen:
    """Return the entries that these names have now."""
    return tuple((name, table[name]) for name in names)


def _as_seen(samples: Array) -> Array:
    return samples


_SAMPLES = Sampled(_as_seen, _as_seen)


def samples_of(table: Mapping[str, Observable]) -> Chosen:
    """Return observables as entries whose value is what is seen, at `SAMPLES` instants a turn."""
    return tuple(
        (name, Statistic(one.unit, one.meaning, one, _SAMPLES)) for name, one in table.items()
    )

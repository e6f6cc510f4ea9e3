"""Statistics: a quantity of the instants of a motion, reduced over time to one number."""

import abc
import functools
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree, Scalar
from typing_extensions import override

from jaxcrusher.basics.checks import require, require_whole
from jaxcrusher.basics.following import Instant
from jaxcrusher.mechanism.snapshot import Observable, Snapshot

# A share of the time in contact that is all of it: a mean over many steps, with their rounding.
ALL_THE_TIME = 1 - 1e-9
# Instants a turn at which the forces of an orbit are looked at, and those of a run that is drawn:
# the length of a reaction that passes near zero bends more sharply than the motion does.
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

    @override
    def integrands(self, q: Array) -> tuple[Array, ...]:
        return (q**self.power,)

    @override
    def of_means(self, *means: Scalar) -> Scalar:
        (mean,) = means
        if self.power == 1:
            return mean
        return jnp.sqrt(mean) if self.power == 2 else mean ** (1 / self.power)

    @override
    def of_pieces(self, values: Float[Array, " n"]) -> Scalar:
        return self.of_means(jnp.mean(values**self.power))


@dataclass(frozen=True)
class Deviation(AbstractMean):
    """RMS of q less its mean; over several turns each turn has a mean of its own.

    It is sqrt(mean of q^2 - (mean of q)^2), known to some 1e-8 of the mean.
    """

    @override
    def integrands(self, q: Array) -> tuple[Array, ...]:
        return q, q**2

    @override
    def of_means(self, *means: Scalar) -> Scalar:
        mean, square = means
        least = DEVIATION_WIDTH**2 * square + NOTHING**2
        return jnp.sqrt(jnp.maximum(square - mean**2, 0) + least)

    @override
    def of_pieces(self, values: Float[Array, " n"]) -> Scalar:
        return jnp.sqrt(jnp.mean(values**2))


@dataclass(frozen=True)
class Lasting(AbstractMean):
    """1 / mean of q: how long a stock lasts if q is used of it in a unit of time."""

    @override
    def integrands(self, q: Array) -> tuple[Array, ...]:
        return (q,)

    @override
    def of_means(self, *means: Scalar) -> Scalar:
        (mean,) = means
        return 1 / mean

    @override
    def of_pieces(self, values: Float[Array, " n"]) -> Scalar:
        return 1 / jnp.mean(1 / values)


@dataclass(frozen=True)
class Sampled:
    """Samples at `SAMPLES` instants a turn; how samples, and then n equal pieces, reduce to one.

    It misses events between two instants, such as the peak of a hard impact; an
    `AbstractFollowed` does not.
    """

    of_samples: Callable[[Float[Array, "n ..."]], Scalar]
    of_pieces: Callable[[Float[Array, " n"]], Scalar]


class AbstractFollowed(abc.ABC):
    """A number of a scalar that is followed from step to step of the integration.

    The steps resolve each impact, however hard: the integrator makes them as short as the motion
    asks for. The numbers that are kept are begun anew in each piece of a motion.
    """

    @abc.abstractmethod
    def begin(self) -> tuple[float, ...]:
        """Return what is kept before the first step."""

    @abc.abstractmethod
    def follow(
        self, kept: tuple[Scalar, ...], before: Instant, start: Instant, end: Instant
    ) -> tuple[Scalar, ...]:
        """Return what is kept after a step from `start` to `end`.

        The step before it began at `before`; the first one has none, and `before` is its `start`.
        """

    @abc.abstractmethod
    def of_kept(self, kept: tuple[Scalar, ...], span: Scalar | float) -> Scalar:
        """Return the number from what is kept after a piece that lasts a `span`, in rad."""

    @abc.abstractmethod
    def of_samples(self, samples: Float[Array, " n"]) -> Scalar:
        """Return the number of a turn from equal steps that resolve it."""

    def of_pieces(self, values: Float[Array, " n"]) -> Scalar:
        """Return the number over n equal pieces of a motion, from that of each: their mean."""
        return jnp.mean(values)


# Less than all that is seen, and more; and yet numbers of which there are differences.
NOTHING_YET, ANYTHING = -1e300, 1e300


@dataclass(frozen=True)
class Largest(AbstractFollowed):
    """The largest value; inside a step it is the top of a parabola through the ends of three.

    Of a step there are two, with the step before it and with the next one, and the lower one
    counts: where a load ends at once one of them rises above all that is seen. The first step and
    the last one have one parabola, whose top counts in their half by the other one. Slopes are
    those of the motion at that instant.
    """

    lowest: float = -math.inf  # of a size it is zero

    @override
    def begin(self) -> tuple[float, ...]:
        """Return the largest value, the last step's top as yet, and what counts if none follows."""
        return (NOTHING_YET, ANYTHING, NOTHING_YET)

    @override
    def follow(
        self, kept: tuple[Scalar, ...], before: Instant, start: Instant, end: Instant
    ) -> tuple[Scalar, ...]:
        largest, waiting, _ = kept
        earlier, later = summits(before, start, end)
        seen = (start.seen, end.seen, jnp.minimum(waiting, earlier))
        alone = jnp.where(end.seen >= start.seen, ANYTHING, NOTHING_YET)
        return (
            functools.reduce(jnp.maximum, seen, largest),
            jnp.where(start.time > before.time, later, alone),
            jnp.where(end.seen <= start.seen, later, NOTHING_YET),
        )

    @override
    def of_kept(self, kept: tuple[Scalar, ...], span: Scalar | float) -> Scalar:
        largest, _, last = kept
        return jnp.maximum(largest, last)

    @override
    def of_samples(self, samples: Float[Array, " n"]) -> Scalar:
        return top(samples)

    @override
    def of_pieces(self, values: Float[Array, " n"]) -> Scalar:
        return jnp.max(values)


@dataclass(frozen=True)
class Least(AbstractFollowed):
    """The least value: minus the largest value of minus the quantity."""

    @override
    def begin(self) -> tuple[float, ...]:
        return LARGEST.begin()

    @override
    def follow(
        self, kept: tuple[Scalar, ...], before: Instant, start: Instant, end: Instant
    ) -> tuple[Scalar, ...]:
        opposite = (Instant(one.time, -one.seen) for one in (before, start, end))
        return LARGEST.follow(kept, *opposite)

    @override
    def of_kept(self, kept: tuple[Scalar, ...], span: Scalar | float) -> Scalar:
        return -LARGEST.of_kept(kept, span)

    @override
    def of_samples(self, samples: Float[Array, " n"]) -> Scalar:
        return -top(-samples)

    @override
    def of_pieces(self, values: Float[Array, " n"]) -> Scalar:
        return jnp.min(values)


@dataclass(frozen=True)
class ShareAboveZero(AbstractFollowed):
    """The share of the time in which a quantity is above zero; it passes zero in straight lines."""

    @override
    def begin(self) -> tuple[float, ...]:
        """Return zero time above zero, and zero time in all."""
        return (0.0, 0.0)

    @override
    def follow(
        self, kept: tuple[Scalar, ...], before: Instant, start: Instant, end: Instant
    ) -> tuple[Scalar, ...]:
        """Add the time of this step in which the line between its ends is above zero, and all."""
        above = jnp.maximum(start.seen, 0.0) + jnp.maximum(end.seen, 0.0)
        size = jnp.abs(start.seen) + jnp.abs(end.seen)
        share = above / jnp.where(size == 0, 1.0, size)
        step = end.time - start.time
        return kept[0] + step * share, kept[1] + step

    @override
    def of_kept(self, kept: tuple[Scalar, ...], span: Scalar | float) -> Scalar:
        """Return the share of all time, whose rounding is the same: a whole is 1 exactly."""
        return kept[0] / kept[1]

    @override
    def of_samples(self, samples: Float[Array, " n"]) -> Scalar:
        """Return the share of the samples; NaN where one is, which compares as one below zero."""
        return jnp.mean(jnp.where(jnp.isnan(samples), jnp.nan, (samples > 0).astype(float)))


@dataclass(frozen=True)
class RisesAboveZero(AbstractFollowed):
    """How often a turn a quantity comes from zero or below to above."""

    @override
    def begin(self) -> tuple[float, ...]:
        return (0.0,)

    @override
    def follow(
        self, kept: tuple[Scalar, ...], before: Instant, start: Instant, end: Instant
    ) -> tuple[Scalar, ...]:
        return (kept[0] + jnp.where((start.seen <= 0) & (end.seen > 0), 1.0, 0.0),)

    @override
    def of_kept(self, kept: tuple[Scalar, ...], span: Scalar | float) -> Scalar:
        return kept[0] / (span / (2 * math.pi))

    @override
    def of_samples(self, samples: Float[Array, " n"]) -> Scalar:
        rises = (jnp.roll(samples, 1) <= 0) & (samples > 0)
        return jnp.sum(jnp.where(rises, 1.0, 0.0))


LARGEST, PEAK, LEAST = Largest(), Largest(lowest=0.0), Least()


def of_slices(
    how: AbstractMean | AbstractFollowed | Sampled,
    kept: PyTree[Float[Array, "slices ..."]],
    turns: int,
) -> Scalar:
    """Return the number over whole turns from what each of their equal slices keeps of it.

    A slice keeps the means of the integrands, its number of a followed quantity, or all samples.
    (The number of a slice's own mean would not give the number of its turn.) A slice may be an
    instant, which has the integrands.
    """

    def of_turn(slices: PyTree[Float[Array, "slices ..."]]) -> Scalar:
        if isinstance(how, AbstractMean):
            return how.of_means(*map(jnp.mean, slices))
        if isinstance(how, AbstractFollowed):
            return how.of_pieces(slices)
        return how.of_samples(slices.reshape(-1, *slices.shape[2:]))

    if turns == 1:  # a root of its own square has no slope at zero
        return of_turn(kept)
    by_turn = jax.tree.map(lambda leaf: jnp.reshape(leaf, (turns, -1, *leaf.shape[1:])), kept)
    return how.of_pieces(jax.vmap(of_turn)(by_turn))


@dataclass(frozen=True)
class Statistic:
    """A number of a motion: a quantity of its instants, reduced over time.

    Integrated means have slopes by any parameter; slopes of a peak hold its instant fixed. Every
    orbit has all statistics, so `quantity` must have a value at an ideal joint too.
    """

    unit: str
    meaning: str
    quantity: Callable[[Snapshot, Any], Array]
    reduction: AbstractMean | AbstractFollowed | Sampled


def summits(before: Instant, start: Instant, end: Instant) -> tuple[Scalar, Scalar]:
    """Return the top of the parabola through three values, of the first step and of the second.

    That is `NOTHING_YET` for a step without the top inside, and where `before` is `start`.
    """
    first, second = start.time - before.time, end.time - start.time
    both = (first > 0) & (second > 0)
    rise = (start.seen - before.seen) / jnp.where(both, first, 1.0)
    fall = (end.seen - start.seen) / jnp.where(both, second, 1.0)
    span = jnp.where(both, first + second, 1.0)
    # At `start`: the slope, which falls by twice the curvature.
    slope, curvature = (rise * second + fall * first) / span, (rise - fall) / span
    concave = both & (curvature > 0)
    inside = (
        concave & (slope <= 0) & (slope >= -2 * curvature * first),
        concave & (slope > 0) & (slope <= 2 * curvature * second),
    )
    highest = start.seen + slope**2 / (4 * jnp.where(inside[0] | inside[1], curvature, 1.0))
    earlier, later = (jnp.where(one, highest, NOTHING_YET) for one in inside)
    return earlier, later


def top(samples: Float[Array, " n"]) -> Scalar:
    """The top of the parabola through the largest sample and its neighbours."""
    index = jnp.clip(jnp.argmax(samples), 1, samples.size - 2)
    before, middle, after = samples[index - 1], samples[index], samples[index + 1]
    slope, curvature = (after - before) / 2, before - 2 * middle + after
    concave = curvature < 0
    shift = jnp.where(concave, -slope / jnp.where(concave, curvature, 1), 0)
    vertex = middle + shift * (slope + shift * curvature / 2)
    return jnp.where(jnp.abs(shift) <= 1, vertex, jnp.max(samples))


# What a program computes: it is compiled for the entries, since a name may get another one.
Chosen = tuple[tuple[str, Statistic], ...]


def _as_seen(samples: Array) -> Array:
    return samples


_SAMPLES = Sampled(_as_seen, _as_seen)


def samples_of(table: Mapping[str, Observable]) -> Chosen:
    """Return observables as entries whose value is what is seen, at `SAMPLES` instants a turn."""
    return tuple(
        (name, Statistic(one.unit, one.meaning, one, _SAMPLES)) for name, one in table.items()
    )

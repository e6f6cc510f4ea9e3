"""What acts on the bodies of a linkage besides weight and joints: pushes and springs."""

import abc
import dataclasses
from collections.abc import Callable, Iterable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Scalar
from typing_extensions import override

from jaxcrusher.basics.checks import is_concrete, nan_unless, require
from jaxcrusher.basics.plane import Vector, optional_scalar, scalar
from jaxcrusher.basics.record import Printed, Record
from jaxcrusher.basics.smooth import norm, positive_part, positive_power_integral
from jaxcrusher.mechanism.equations import Wrench, wrench_at
from jaxcrusher.mechanism.linkage import Point, require_direction
from jaxcrusher.mechanism.motion import Motion
from jaxcrusher.mechanism.snapshot import Snapshot
from jaxcrusher.mechanism.supports import OnSupports
from jaxcrusher.mechanism.topology import FRAME


class AbstractPush(Printed):
    """A force between the frame and a point of a body.

    Its reaction acts on the frame in the same line, as gas pushes a piston and the cylinder's end,
    so that a push does not shake the ground by itself.
    """

    @property
    @abc.abstractmethod
    def body(self) -> str:
        """Return the name of the body that is pushed."""

    @abc.abstractmethod
    def action(self, motion: Motion) -> tuple[Point, Vector]:
        """Return the point of the body at which the force acts, and the force, N.

        The force is in the frame's axes; the point may depend on the motion.
        """

    def steady(self) -> "AbstractPush":
        """Return the push that repeats with the crank's turn: this push, or its mean.

        Raises ValueError for a push that is known not to repeat.
        """
        return self

    def later(self, angle: Any) -> "AbstractPush":
        """Return the push after the crank has turned by some whole turns, in rad."""
        return self


class Push(AbstractPush):
    """A constant force, in the frame's axes."""

    at: Point
    given: Vector  # N

    @property
    @override
    def body(self) -> str:
        return self.at.body

    @override
    def action(self, motion: Motion) -> tuple[Point, Vector]:
        return self.at, self.given


def _as_module(size: Callable[[Scalar], Scalar]) -> Callable[[Scalar], Scalar]:
    """Return what JAX takes as an argument; a plain function has no numbers of its own."""
    return size if isinstance(size, eqx.Module) else jax.tree_util.Partial(size)  # pyright: ignore


class PushByAngle(AbstractPush):
    """A force along a fixed direction, of a size by the angle of the crank.

    Raises ValueError for a direction without length.
    """

    at: Point
    along: Vector  # of any length
    size: Callable[[Scalar], Scalar] = eqx.field(converter=_as_module)  # N, by the angle in rad

    def __check_init__(self):
        require_direction(self.along)

    @property
    @override
    def body(self) -> str:
        return self.at.body

    @override
    def action(self, motion: Motion) -> tuple[Point, Vector]:
        return self.at, self.size(motion.crank.angle) * (self.along / norm(self.along, 0.0))

    @override
    def steady(self) -> "PushByAngle":
        """Return the push; ValueError (known numbers only) for a size that does not repeat."""
        if not is_concrete(self.size):
            return self
        with jax.ensure_compile_time_eval():
            angles = jnp.array([1.0, 2.5, 4.0])
            now, later = (
                np.array([self.size(one) for one in angles + turn]) for turn in (0.0, 2 * np.pi)
            )
        # Curves between their points are known to rounding.
        repeats = np.allclose(now, later, rtol=0, atol=1e-6 * np.abs(now).max())
        require(repeats, "size", "repeat with each turn of the crank", "another one a turn later")
        return self


# Cosines of the wave of a rough feed.
COSINES = 64


class RoughFeed(AbstractPush):
    """A push that differs from turn to turn: another push times 1 + s w, with the scatter s.

    w has a mean of 0, a variance of 1, and a flat spectrum from order 0 to the bandwidth, in
    multiples of the crank's speed: sqrt(2 / K) sum of K cosines of order nu_k and phase phi_k.
    Shinozuka and Jan, J. Sound Vib. 25, 1972. Each order lies at random in a K-th of the band, as
    equal steps would repeat the wave after some turns.
    """

    load: AbstractPush  # the mean
    scatter: Scalar = eqx.field(converter=scalar)  # s
    bandwidth: Scalar = eqx.field(converter=scalar)  # largest order
    places: Float[Array, " cosines"]  # nu_k / bandwidth
    phases: Float[Array, " cosines"]  # rad

    @property
    @override
    def body(self) -> str:
        return self.load.body

    @override
    def action(self, motion: Motion) -> tuple[Point, Vector]:
        return _times(1 + self.scatter * self.wave(motion.crank.angle), self.load, motion)

    @override
    def steady(self) -> AbstractPush:
        return self.load.steady()

    @override
    def later(self, angle: Any) -> "RoughFeed":
        phases = self.phases + self.places * (self.bandwidth * angle)
        return dataclasses.replace(self, phases=phases)

    def wave(self, angle: Scalar) -> Scalar:
        """Return w at an angle that the crank has turned by since time zero, rad."""
        turned = self.places * (self.bandwidth * angle) + self.phases
        return np.sqrt(2 / len(self.phases)) * jnp.sum(jnp.cos(turned))


class Multiplied(AbstractPush):
    """A push times a number."""

    load: AbstractPush
    factor: Scalar = eqx.field(converter=scalar)

    @property
    @override
    def body(self) -> str:
        return self.load.body

    @override
    def action(self, motion: Motion) -> tuple[Point, Vector]:
        return _times(self.factor, self.load, motion)


def _times(factor: Scalar, push: AbstractPush, motion: Motion) -> tuple[Point, Vector]:
    point, force = push.action(motion)
    return point, factor * force


def rough_feed(load: AbstractPush, scatter: Any, bandwidth: Any, seed: Any) -> RoughFeed:
    """Return a push with a wave of its own for each `seed`, a whole number that may be traced."""
    keys = jax.random.split(jax.random.key(jnp.asarray(seed).astype(jnp.uint32)))
    random = [jax.random.uniform(key, (COSINES,), float) for key in keys]
    places, phases = (jnp.arange(COSINES, dtype=float) + random[0]) / COSINES, 2 * np.pi * random[1]
    # A seed of NaN, which lies outside its limits, would be taken for 0.
    phases = nan_unless(jnp.isfinite(seed), phases)
    return RoughFeed(load, scatter, bandwidth, places, phases)


class Spring(Record):
    """A spring with a damper beside it, between two points of bodies or of the frame.

    It pulls its ends together by preload + stiffness (L - L0) + damping L', and pushes them apart
    where that is negative. A spring with a `slack` (N) goes slack there instead, and the error of
    its pull is at most a quarter of `slack`.
    """

    ends: tuple[Point, Point]
    stiffness: Scalar = eqx.field(converter=scalar)  # N/m
    length: Scalar = eqx.field(converter=scalar)  # L0, m
    damping: Scalar = eqx.field(converter=scalar, default=0.0)  # N s/m
    preload: Scalar = eqx.field(converter=scalar, default=0.0)  # N
    slack: Scalar | None = eqx.field(converter=optional_scalar, default=None)  # N

    def stretched(self, motion: Motion) -> "Stretched":
        """Return how far and how fast it is stretched in a motion."""
        begin, end = self.ends
        apart = motion.position(end) - motion.position(begin)
        length = norm(apart, 0.0)
        axis = apart / length
        rate = (motion.velocity(end) - motion.velocity(begin)).dot(axis)
        return Stretched(self, axis, length - self.length, rate)


class Stretched(Record):
    """A spring as it is stretched at an instant."""

    spring: Spring
    axis: Vector  # from its first to its second end, unit
    stretch: Scalar  # L - L0, m
    rate: Scalar  # m/s

    @property
    def pull(self) -> Scalar:
        """Return the force by which it pulls its ends together, N."""
        return self._kept(self.wanted)

    @property
    def wanted(self) -> Scalar:
        """Return the pull that it would have if it could push, N: negative where it is slack."""
        return self._elastic + self.spring.damping * self.rate

    @property
    def _elastic(self) -> Scalar:
        return self.spring.preload + self.spring.stiffness * self.stretch

    def _kept(self, pull: Scalar) -> Scalar:
        """Return what is left of a pull, which one with a slack has where it is positive."""
        slack = self.spring.slack
        return pull if slack is None else positive_part(pull, slack)

    @property
    def energy(self) -> Scalar:
        """Return the work of its spring since the length L0, J."""
        stiffness, preload, slack = self.spring.stiffness, self.spring.preload, self.spring.slack
        if slack is None:
            return (preload + 0.5 * stiffness * self.stretch) * self.stretch
        begin, end = (positive_power_integral(x, slack, 1.0) for x in (preload, self._elastic))
        elastic = stiffness > 0
        work = (end - begin) / jnp.where(elastic, stiffness, 1.0)
        return jnp.where(elastic, work, self._kept(preload) * self.stretch)

    @property
    def loss(self) -> Scalar:
        """Return the power that its damper takes, W; not negative."""
        if self.spring.slack is None:
            return self.spring.damping * self.rate**2
        return (self.pull - self._kept(self._elastic)) * self.rate


class Acting(Record):
    """What pushes and springs do: their `wrenches` on bodies, and on a frame that can move."""

    wrenches: tuple[Wrench, ...]
    pushes: tuple[tuple[Point, Vector], ...]
    springs: tuple[Stretched, ...]


def acting(
    motion: Motion,
    pushes: Iterable[AbstractPush],
    springs: Iterable[Spring],
    supports: OnSupports | None,
) -> Acting:
    """Return what pushes and springs do to bodies, and by their reactions to the frame."""

    def on_frame(point: Point, force: Vector) -> list[Wrench]:
        """Return what the frame feels of a force at the place of a point, if it can move."""
        if supports is None:
            return []
        arm = motion.position(point) - supports.point
        return [Wrench(FRAME, force, arm.cross(force))]

    wrenches, pushed = [], tuple(push.action(motion) for push in pushes)
    stretched = tuple(spring.stretched(motion) for spring in springs)
    for point, force in pushed:
        wrenches += [wrench_at(motion, point, force), *on_frame(point, -force)]
    for spring in stretched:
        pull = spring.pull * spring.axis
        for point, force in zip(spring.spring.ends, (pull, -pull), strict=True):
            is_frame = point.body == FRAME
            wrenches += on_frame(point, force) if is_frame else [wrench_at(motion, point, force)]
    return Acting(tuple(wrenches), pushed, stretched)


def push_power(s: Snapshot, scene: Any) -> Scalar:
    """Return the power of the pushes, W."""
    powers = (force.dot(s.motion.velocity(point)) for point, force in s.applied.pushes)
    return sum(powers, jnp.zeros_like(s.motion.crank.speed))


def spring_loss(s: Snapshot, scene: Any) -> Scalar:
    """Return the power that the dampers of springs take, W."""
    losses = (spring.loss for spring in s.applied.springs)
    return sum(losses, jnp.zeros_like(s.motion.crank.speed))

"""Drives that turn the crank: at a speed that is given, or by a torque."""

import abc

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import ArrayLike, Scalar
from typing_extensions import override

from jaxcrusher.basics.checks import concrete, is_concrete, nan_unless, require, require_positive
from jaxcrusher.basics.plane import scalar
from jaxcrusher.basics.record import Printed, Record
from jaxcrusher.mechanism.motion import Crank


class CrankState(Record):
    """A free crank: its angle (rad) and its speed over the drive's nominal speed."""

    angle: Scalar
    relative_speed: Scalar


class AbstractDrive(Printed):
    """A drive; the crank starts at angle 0.

    `speed` (rad/s) is the mean or nominal speed, and the unit of time of turns and windows: a turn
    lasts 2 pi / speed. Raises ValueError for a speed that is not positive.
    """

    speed: eqx.AbstractVar[Scalar]

    def __check_init__(self):
        require_positive("speed", self.speed, "rad/s")

    @abc.abstractmethod
    def initial(self) -> CrankState | None:
        """Return the state that a free crank adds to the motion, None where it is prescribed."""

    @abc.abstractmethod
    def crank(self, time: Scalar, state: CrankState | None) -> Crank:
        """Return the motion of the crank; a free one's acceleration is not known here."""

    @abc.abstractmethod
    def torque(self, time: Scalar, crank: Crank) -> Scalar | None:
        """Return the torque on a free crank, counterclockwise (N m); None where it is an output."""

    @abc.abstractmethod
    def rate(self, crank: Crank, acceleration: Scalar) -> CrankState | None:
        """Return the time derivative of the state under an acceleration (rad/s2)."""


class AbstractMotion(AbstractDrive):
    """A drive that turns the crank by a given motion; the torque that it takes is an output.

    Raises ValueError where speed or acceleration are not the derivatives of the angle, or where the
    crank does not turn once in a turn.
    """

    @override
    def __check_init__(self):
        if type(self) not in (ConstantSpeed, UnevenSpeed):
            _require_rates(self)

    @abc.abstractmethod
    def motion(self, time: Scalar) -> tuple[Scalar, Scalar, Scalar | None]:
        """Return angle (rad), speed (rad/s) and acceleration (rad/s2; None: zero) at a time (s)."""

    @override
    def initial(self) -> None:
        return None

    @override
    def crank(self, time: Scalar, state: None) -> Crank:
        return Crank(*self.motion(time))

    @override
    def torque(self, time: Scalar, crank: Crank) -> None:
        return None

    @override
    def rate(self, crank: Crank, acceleration: Scalar) -> None:
        return None


class ConstantSpeed(AbstractMotion):
    """The crank's angle is speed * time."""

    speed: Scalar = eqx.field(converter=scalar)  # omega, rad/s

    @override
    def motion(self, time: Scalar) -> tuple[Scalar, Scalar, None]:
        return self.speed * time, self.speed, None


def _whole(order: ArrayLike) -> Scalar:
    """Return an order; NaN where one that is only known to `jax.jit` is not a whole number."""
    order = scalar(order)
    return order if is_concrete(order) else nan_unless(order == jnp.round(order), order)


class UnevenSpeed(AbstractMotion):
    """The crank's speed is w (1 + share cos(order w t + phase)), the angle its integral.

    Raises ValueError for a share that is not inside (-1, 1), as the crank would turn back, and for
    an order that is not a whole number.
    """

    speed: Scalar = eqx.field(converter=scalar)  # w, rad/s
    fluctuation: Scalar = eqx.field(converter=scalar)  # share
    order: Scalar = eqx.field(converter=_whole, default=1.0)  # a turn
    phase: Scalar = eqx.field(converter=scalar, default=0.0)  # rad

    @override
    def __check_init__(self):
        share, order = concrete(self.fluctuation), concrete(self.order)
        good = share is None or bool(np.all(np.abs(share) < 1))
        require(good, "speed_fluctuation", "be less than 1 in size", share)
        good = order is None or bool(np.all((order >= 1) & (order == np.round(order))))
        require(good, "fluctuation_order", "be a whole number >= 1", order)

    @override
    def motion(self, time: Scalar) -> tuple[Scalar, Scalar, Scalar]:
        """Return w t + share / order (sin(order w t + phase) - sin(phase)), and its derivatives."""
        place = self.order * self.speed * time + self.phase
        swing = self.fluctuation / self.order * (jnp.sin(place) - jnp.sin(self.phase))
        return (
            self.speed * time + swing,
            self.speed * (1 + self.fluctuation * jnp.cos(place)),
            -self.order * self.fluctuation * self.speed**2 * jnp.sin(place),
        )


class AbstractTorque(AbstractDrive):
    """A drive that gives a torque to a free crank, which starts at `speed`."""

    @override
    def initial(self) -> CrankState:
        return CrankState(jnp.zeros_like(self.speed), jnp.ones_like(self.speed))

    @override
    def crank(self, time: Scalar, state: CrankState) -> Crank:
        return Crank(state.angle, state.relative_speed * self.speed)

    @override
    def rate(self, crank: Crank, acceleration: Scalar) -> CrankState:
        return CrankState(crank.speed, acceleration / self.speed)


class GivenTorque(AbstractTorque):
    """A constant torque on a free crank."""

    given: Scalar = eqx.field(converter=scalar)  # N m, counterclockwise
    speed: Scalar = eqx.field(converter=scalar)  # at the start, rad/s

    @override
    def torque(self, time: Scalar, crank: Crank) -> Scalar:
        return self.given


def _require_rates(drive: AbstractMotion) -> None:
    """Check that a motion's speed and acceleration are the derivatives of its angle.

    Numbers that only a traced program will know are tried with others in their place.
    """
    leaves, structure = jax.tree.flatten(drive)
    known = [
        np.full(jnp.shape(leaf), 1 + 0.1 * i) if concrete(leaf) is None else leaf
        for i, leaf in enumerate(leaves)
    ]
    drive = jax.tree.unflatten(structure, known)
    with jax.ensure_compile_time_eval():
        turn = 2 * np.pi / np.asarray(drive.speed)
        if turn.shape:  # of a batch the first, as all are of one kind
            return

        def part(i: int, time: Scalar) -> Scalar:
            found = drive.motion(time)[i]
            return jnp.zeros_like(time) if found is None else jnp.asarray(found)

        one = jnp.ones(())
        for share in (0.13, 0.4, 0.77):
            time = jnp.asarray(share * turn)
            for i, name in ((0, "speed"), (1, "acceleration")):
                _, rate = jax.jvp(lambda t, i=i: part(i, t), (time,), (one,))
                must = f"return as {name} the time derivative of the one before it"
                scale = float(drive.speed) ** (i + 1)
                good = abs(float(rate - part(i + 1, time))) <= 1e-9 * scale
                require(good, "drive", must, f"a {type(drive).__name__}, which does not")
            turned = float(part(0, time + turn) - part(0, time))
            good = abs(turned - 2 * np.pi) <= 1e-9 * 2 * np.pi
            must = "turn the crank once in 2 pi / speed"
            require(good, "drive", must, f"a {type(drive).__name__}, which turns it by {turned:g}")

"""Drives that turn the eccentric shaft."""

import abc

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Scalar

from jaxcrusher.basics.checks import concrete, require, require_positive
from jaxcrusher.basics.plane import scalar


class ShaftState(eqx.Module):
    """A free shaft: its angle (rad) and its speed over the drive's nominal speed."""

    angle: Scalar
    relative_speed: Scalar

    def unwound(self) -> "ShaftState":
        """With the angle counted from the nearest whole turn."""
        return ShaftState(from_nearest_turn(self.angle), self.relative_speed)


def from_nearest_turn(angle: Scalar) -> Scalar:
    """The same angle (rad), between -pi and pi."""
    return angle - 2 * jnp.pi * jnp.round(angle / (2 * jnp.pi))


class AbstractDrive(eqx.Module):
    """A drive; the shaft starts at angle 0 with `speed`.

    `speed` (rad/s) is also the unit of time of turns and windows: a turn lasts 2 pi / speed.

    Raises ValueError for a speed that is not positive, and for a drive of another form than
    formulations integrate: a prescribed speed is constant, and a free shaft has a torque that does
    not depend on its motion.
    """

    speed: eqx.AbstractVar[Scalar]

    def __check_init__(self):
        require_positive("speed", self.speed, "rad/s")
        if type(self) not in (ConstantSpeed, GivenTorque):
            _require_form(self)

    @abc.abstractmethod
    def initial(self) -> ShaftState | None:
        """The state that the shaft adds to the motion, or None where it is prescribed."""

    @abc.abstractmethod
    def motion(self, time: Scalar, state: ShaftState | None) -> tuple[Scalar, Scalar]:
        """Angle (rad) and speed (rad/s) of the shaft."""

    @abc.abstractmethod
    def acceleration(self, moment: Scalar, inertia: Scalar) -> Scalar | None:
        """Angular acceleration (rad/s2) under the other `moment` (N m); None: it is zero."""

    @abc.abstractmethod
    def rate(self, speed: Scalar, acceleration: Scalar | None) -> ShaftState | None:
        """The time derivative of the state."""


class ConstantSpeed(AbstractDrive):
    """theta1 = speed * time, prescribed; the torque that it takes is an output."""

    speed: Scalar = eqx.field(converter=scalar)  # omega, rad/s

    def initial(self) -> None:
        """Nothing to integrate."""
        return None

    def motion(self, time: Scalar, state: None) -> tuple[Scalar, Scalar]:
        """The angle omega t, and omega."""
        return self.speed * time, self.speed

    def acceleration(self, moment: Scalar, inertia: Scalar) -> None:
        """None."""
        return None

    def rate(self, speed: Scalar, acceleration: None) -> None:
        """Nothing to integrate."""
        return None


class GivenTorque(AbstractDrive):
    """A constant torque on a free shaft that starts at `speed`."""

    torque: Scalar = eqx.field(converter=scalar)  # N m, counterclockwise
    speed: Scalar = eqx.field(converter=scalar)  # at the start, rad/s

    def initial(self) -> ShaftState:
        """Angle 0 at the nominal speed."""
        return ShaftState(jnp.zeros_like(self.speed), jnp.ones_like(self.speed))

    def motion(self, time: Scalar, state: ShaftState) -> tuple[Scalar, Scalar]:
        """From the state."""
        return state.angle, state.relative_speed * self.speed

    def acceleration(self, moment: Scalar, inertia: Scalar) -> Scalar:
        """(torque + moment) / inertia."""
        return (self.torque + moment) / inertia

    def rate(self, speed: Scalar, acceleration: Scalar) -> ShaftState:
        """The speed, and the acceleration over the nominal speed."""
        return ShaftState(speed, acceleration / self.speed)


def _require_form(drive: AbstractDrive) -> None:
    """Refuse a drive of one's own that formulations would integrate as another one.

    They ask a prescribed drive for no acceleration: an uneven speed would count as constant.
    Numbers that only a traced program will know are tried with others in their place.
    """
    leaves, structure = jax.tree.flatten(drive)
    known = [
        np.full(jnp.shape(leaf), 1 + 0.1 * i) if concrete(leaf) is None else leaf
        for i, leaf in enumerate(leaves)
    ]
    drive = jax.tree.unflatten(structure, known)
    with jax.ensure_compile_time_eval():
        first, second = (drive.acceleration(scalar(m), scalar(j)) for m, j in ((2, 3), (7, 5)))
        if drive.initial() is None:
            must = "turn the shaft at a constant `speed` or leave it free, as `GivenTorque` does"
            good = first is None
            for share in (0.13, 0.4, 0.77):
                time = 2 * np.pi * share / drive.speed
                angle, speed = drive.motion(time, None)
                good = good and np.allclose(angle, drive.speed * time, rtol=1e-9, atol=0)
                good = good and np.allclose(speed, drive.speed, rtol=1e-9, atol=0)
        else:
            must = "accelerate a free shaft by (torque + moment) / inertia, with a constant torque"
            good = False
            if first is not None and second is not None:
                good = np.allclose(3 * first - 2, 5 * second - 7, rtol=1e-9, atol=1e-9)
    require(good, "drive", must, f"a {type(drive).__name__}, which does not")

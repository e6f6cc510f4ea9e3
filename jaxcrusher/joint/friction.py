"""Friction of the clearance joint, and the two readings of its slip speed.

All laws here are odd in the slip speed and regularised: without slip there is no force, so that
nothing sticks. The law of `jaxcrusher.joint.bristles` has a state, and sticks.
"""

import abc

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Scalar
from typing_extensions import override

from jaxcrusher.basics import smooth
from jaxcrusher.basics.plane import scalar
from jaxcrusher.basics.record import Printed

_SPEED = {"unit": "m/s"}


class AbstractSlip(Printed):
    """Which speed a friction law sees."""

    @abc.abstractmethod
    def speed(self, centre_speed: Scalar, surface_speed: Scalar) -> Scalar:
        """Choose among the speed of the centres and that of the surfaces, m/s."""


class CentreSlip(AbstractSlip):
    """The relative speed of the two centres along the tangent, without spin.

    What (5)-(6) of the paper mean where the bodies do not turn. Friction then acts only in
    hard impacts, and may do positive work.
    """

    @override
    def speed(self, centre_speed: Scalar, surface_speed: Scalar) -> Scalar:
        return centre_speed


class SurfaceSlip(AbstractSlip):
    """The relative speed of the two surfaces' material at the contact point.

    About -3.9 m/s in the PE250x400 at 30 rad/s: full sliding, always.
    """

    @override
    def speed(self, centre_speed: Scalar, surface_speed: Scalar) -> Scalar:
        return surface_speed


class AbstractFriction(Printed):
    """A tangential force as a function of the normal force and a slip speed.

    A law that remembers something along the motion says so by `initial` and `rate`, and its force
    takes the memory as a third argument.
    """

    slip: eqx.AbstractVar[AbstractSlip]

    def initial(self) -> Scalar | None:
        """The memory at the start, of order one; None: nothing is remembered."""
        return None

    def rate(self, memory: Scalar, in_contact: Scalar, slip_speed: Scalar) -> Scalar:
        """The time derivative of the memory, per second; `in_contact` is 1, or 0 in flight."""
        raise NotImplementedError

    @abc.abstractmethod
    def force(self, normal_force: Scalar, slip_speed: Scalar) -> Scalar:
        """F_t, N, along the tangent on the body whose slip is counted positive."""


class AmbrosioFriction(AbstractFriction):
    """F_t = -c_f c_d F_n sign(v_t), c_d a ramp from 0 at v0 to 1 at v1 (paper, (11)-(12)).

    The ramp's two corners, and the sign where v0 < width, are smoothed over `width` (m/s).
    """

    slip: AbstractSlip
    coefficient: Scalar = eqx.field(converter=scalar, default=0.1)  # c_f
    static_speed: Scalar = eqx.field(converter=scalar, default=0.1)  # v0, m/s
    full_speed: Scalar = eqx.field(converter=scalar, default=1.0)  # v1, m/s
    width: Scalar = eqx.field(converter=scalar, default=1e-4)  # m/s

    @override
    def force(self, normal_force: Scalar, slip_speed: Scalar) -> Scalar:
        ramp = self._ramp(slip_speed) - self._ramp(-slip_speed)
        return -self.coefficient * normal_force * ramp

    def _ramp(self, speed: Scalar) -> Scalar:
        """c_d for positive speeds, 0 for negative ones."""
        above_static = smooth.positive_part(speed - self.static_speed, self.width)
        above_full = smooth.positive_part(speed - self.full_speed, self.width)
        return (above_static - above_full) / (self.full_speed - self.static_speed)


class Threlfall(AbstractFriction):
    """F_t = -c_f F_n (1 - exp(-3 |v| / v1)) sign(v), constant above v1: Threlfall 1978.

    Above v1 it is 0.95 c_f F_n. Its slope jumps there, and is 3 c_f F_n / v1 on both sides of rest.
    """

    slip: AbstractSlip
    coefficient: Scalar = eqx.field(converter=scalar, default=0.1)  # c_f
    full_speed: Scalar = eqx.field(converter=scalar, default=1.0, metadata=_SPEED)  # v1

    @override
    def force(self, normal_force: Scalar, slip_speed: Scalar) -> Scalar:
        share = jnp.clip(jnp.abs(slip_speed) / self.full_speed, 0.0, 1.0)
        # From expm1(-3 x) / x, which has a value at rest.
        rest = share < 1e-8
        size = -jnp.expm1(-3 * share) / jnp.where(rest, 1.0, share)
        size = jnp.where(rest, 3.0, size)
        along = jnp.clip(slip_speed / self.full_speed, -1.0, 1.0)
        return -self.coefficient * normal_force * size * along


class BengisuAkay(AbstractFriction):
    """A parabola from rest to stiction at v0, then a decay to sliding: Bengisu and Akay 1994.

    |F_t| = F_s (1 - (|v| - v0)^2 / v0^2) below v0, F_c + (F_s - F_c) exp(-xi (|v| - v0)) above,
    with F_c = c_f F_n and F_s = r F_c. Its slope jumps at v0 by xi (F_s - F_c).
    """

    slip: AbstractSlip
    coefficient: Scalar = eqx.field(converter=scalar, default=0.1)  # c_f
    static_ratio: Scalar = eqx.field(converter=scalar, default=1.5)  # r, >= 1
    static_speed: Scalar = eqx.field(converter=scalar, default=0.1, metadata=_SPEED)  # v0
    decay: Scalar = eqx.field(converter=scalar, default=10.0, metadata={"unit": "s/m"})  # xi

    @override
    def force(self, normal_force: Scalar, slip_speed: Scalar) -> Scalar:
        v0, speed = self.static_speed, jnp.abs(slip_speed)
        # v (2 v0 - |v|) / v0^2 is the parabola with its sign.
        below = self.static_ratio * slip_speed * (2 * v0 - speed) / v0**2
        over = jnp.maximum(speed - v0, 0.0)
        above = 1 + (self.static_ratio - 1) * jnp.exp(-self.decay * over)
        share = jnp.where(speed < v0, below, above * jnp.sign(slip_speed))
        return -self.coefficient * normal_force * share


class Stribeck(AbstractFriction):
    """F_t = -(F_c + (F_s - F_c) exp(-(v / v_s)^2)) tanh(v / v_t), Stribeck's curve.

    After Bo and Pavelescu 1982 with the exponent 2, F_c = c_f F_n and F_s = r F_c. The jump at
    rest is smoothed over v_t, so that stiction is reached to 1 - exp(-2 v / v_t) of it.
    """

    slip: AbstractSlip
    coefficient: Scalar = eqx.field(converter=scalar, default=0.1)  # c_f
    static_ratio: Scalar = eqx.field(converter=scalar, default=1.5)  # r, >= 1
    stribeck_speed: Scalar = eqx.field(converter=scalar, default=0.3, metadata=_SPEED)  # v_s
    width: Scalar = eqx.field(converter=scalar, default=0.01, metadata=_SPEED)  # v_t

    @override
    def force(self, normal_force: Scalar, slip_speed: Scalar) -> Scalar:
        fall = jnp.exp(-((slip_speed / self.stribeck_speed) ** 2))
        size = 1 + (self.static_ratio - 1) * fall
        return -self.coefficient * normal_force * size * jnp.tanh(slip_speed / self.width)

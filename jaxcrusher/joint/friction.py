"""Friction of the clearance joint, and the two readings of its slip speed."""

import abc

import equinox as eqx
from jaxtyping import Scalar

from jaxcrusher.basics import smooth
from jaxcrusher.basics.plane import scalar


class AbstractSlip(eqx.Module):
    """Which speed a friction law sees."""

    @abc.abstractmethod
    def speed(self, centre_speed: Scalar, surface_speed: Scalar) -> Scalar:
        """Choose among the speed of the centres and that of the surfaces, m/s."""


class CentreSlip(AbstractSlip):
    """The relative speed of the two centres along the tangent, without spin.

    What (5)-(6) of the paper mean where the bodies do not turn. Friction then acts only in
    hard impacts, and may do positive work.
    """

    def speed(self, centre_speed: Scalar, surface_speed: Scalar) -> Scalar:
        """The centres' speed."""
        return centre_speed


class SurfaceSlip(AbstractSlip):
    """The relative speed of the two surfaces' material at the contact point.

    About -3.9 m/s in the PE250x400 at 30 rad/s: full sliding, always.
    """

    def speed(self, centre_speed: Scalar, surface_speed: Scalar) -> Scalar:
        """The surfaces' speed."""
        return surface_speed


class AbstractFriction(eqx.Module):
    """A tangential force as a function of the normal force and a slip speed."""

    slip: eqx.AbstractVar[AbstractSlip]

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

    def force(self, normal_force: Scalar, slip_speed: Scalar) -> Scalar:
        """F_t, N: odd in the slip speed."""
        ramp = self._ramp(slip_speed) - self._ramp(-slip_speed)
        return -self.coefficient * normal_force * ramp

    def _ramp(self, speed: Scalar) -> Scalar:
        """c_d for positive speeds, 0 for negative ones."""
        above_static = smooth.positive_part(speed - self.static_speed, self.width)
        above_full = smooth.positive_part(speed - self.full_speed, self.width)
        return (above_static - above_full) / (self.full_speed - self.static_speed)

"""The crushing load on the jaw, acting at its mass centre S2 without a moment."""

import abc

import equinox as eqx
from jaxtyping import Scalar

from jaxcrusher.basics import smooth
from jaxcrusher.basics.plane import Vector, scalar


class AbstractLoad(eqx.Module):
    """A force on the jaw."""

    @abc.abstractmethod
    def force(self, jaw_direction: Vector, velocity: Vector) -> Vector:
        """The force (N) on a jaw whose axis B-A is `jaw_direction`, S2 moving at `velocity`."""


class AlongJaw(AbstractLoad):
    """Constant, along the jaw towards B: (18) of the paper, taken literally."""

    magnitude: Scalar = eqx.field(converter=scalar)  # N

    def force(self, jaw_direction: Vector, velocity: Vector) -> Vector:
        """-F (B-A axis)."""
        return -self.magnitude * jaw_direction


class NormalToJaw(AbstractLoad):
    """Constant, normal to the jaw's face, away from the fixed jaw."""

    magnitude: Scalar = eqx.field(converter=scalar)  # N

    def force(self, jaw_direction: Vector, velocity: Vector) -> Vector:
        """F times the axis turned by 90 degrees."""
        return self.magnitude * jaw_direction.perp()


class ClosingStroke(AbstractLoad):
    """Normal to the jaw's face, only while S2 moves towards the fixed jaw.

    The switch at rest is smoothed over `width` (m/s) of the closing speed.
    """

    magnitude: Scalar = eqx.field(converter=scalar)  # N
    width: Scalar = eqx.field(converter=scalar, default=0.01)  # m/s

    def force(self, jaw_direction: Vector, velocity: Vector) -> Vector:
        """F times the axis turned by 90 degrees, or nothing."""
        away = jaw_direction.perp()
        closing = smooth.step(-velocity.dot(away), self.width)
        return self.magnitude * closing * away

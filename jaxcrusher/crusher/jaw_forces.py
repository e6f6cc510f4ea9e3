"""What acts on the jaw at an instant, besides its weight and its joints."""

import equinox as eqx
from jaxtyping import Scalar

from jaxcrusher.basics.plane import Vector, optional_scalar
from jaxcrusher.mechanism.equations import Wrench
from jaxcrusher.mechanism.scene import AbstractApplied


class JawForce(eqx.Module):
    """A force on the jaw, and how far from A towards B its line meets the jaw's axis."""

    force: Vector  # N
    along: Scalar | None = eqx.field(converter=optional_scalar, default=None)  # m; None: at S2


class RodPull(eqx.Module):
    """What the tension rod does to the jaw; its other end pulls at the frame by the opposite."""

    force: Vector  # on the jaw, N
    tension: Scalar  # N
    wanted: Scalar  # N, negative where the rod is slack
    stretch: Scalar  # L - L0, m
    rate: Scalar  # m/s


class Applied(AbstractApplied):
    """Forces on the jaw by their source, None where there is none, and all they do to bodies."""

    load: JawForce | None
    rod: RodPull | None
    wrenches: tuple[Wrench, ...]

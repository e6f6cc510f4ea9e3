"""Foundations of the frame: the ground itself, or two supports with springs and dampers.

Those of soil under a rectangular block are Pais and Kausel's (1988), as tables 2-2 and 2-3 of NIST
GCR 12-917-21 (2012) give them: a rigid block on, or embedded in, an even half space, its sides in
full contact with the soil. Stiffness and damping are those of one frequency; the soil's own damping
is left out.
"""

from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import ArrayLike, Scalar

from jaxcrusher.basics.checks import primal, require, require_positive, require_within
from jaxcrusher.basics.plane import Vector, arm_to, optional_scalar, scalar
from jaxcrusher.basics.record import Printed
from jaxcrusher.mechanism.equations import MovingFrame, Wrench
from jaxcrusher.mechanism.linkage import Body
from jaxcrusher.mechanism.snapshot import FrameMotion
from jaxcrusher.mechanism.topology import FRAME


class AbstractFoundation(Printed):
    """Ground under the frame; a scene without a foundation has a clamped frame.

    `point` (m, in the frame's axes) is what moments on the ground are counted about.
    """

    point: eqx.AbstractVar[Vector]


class Clamped(AbstractFoundation):
    """A frame that does not move."""

    point: Vector  # m


class OnSupports(AbstractFoundation):
    """A frame that moves in the plane on a left and a right support, with any rotation.

    Frame, fixed jaw and block are one rigid body with its mass centre G at `point`. Each support
    is a horizontal and a vertical spring and damper, fixed to the frame at (`left`, `base`) and
    (`right`, `base`) and unstrained where the frame stands as drawn. Stiffness and damping are of
    one support. Raises ValueError (concrete values only) for a mass, an inertia or a stiffness that
    is not positive, a damper below zero other than that of rocking, which takes part of the
    vertical ones back, and a left support that is not left of the right one.
    """

    mass: Scalar = eqx.field(converter=scalar)  # M, kg
    inertia: Scalar = eqx.field(converter=scalar)  # J about G, kg m2
    point: Vector  # G as drawn, m
    left: Scalar = eqx.field(converter=scalar)  # m
    right: Scalar = eqx.field(converter=scalar)  # m
    base: Scalar = eqx.field(converter=scalar)  # m
    horizontal_stiffness: Scalar = eqx.field(converter=scalar)  # N/m
    vertical_stiffness: Scalar = eqx.field(converter=scalar)  # N/m
    horizontal_damping: Scalar = eqx.field(converter=scalar)  # N s/m
    vertical_damping: Scalar = eqx.field(converter=scalar)  # N s/m
    # Of a damper of both supports that turns with the frame, N m s/rad; soil damps rocking less
    # than its vertical dampers would.
    rocking_damping: Scalar | None = eqx.field(converter=optional_scalar, default=None)

    def __check_init__(self):
        require_positive("foundation.mass", self.mass, "kg")
        require_positive("foundation.inertia", self.inertia, "kg m2")
        for name in ("horizontal_stiffness", "vertical_stiffness"):
            require_positive(f"foundation.{name}", getattr(self, name), "N/m")
        for name in ("horizontal_damping", "vertical_damping"):
            require_within(f"foundation.{name}", getattr(self, name), 0.0, np.inf)
        left, right = primal(self.left), primal(self.right)
        if left is not None and right is not None:
            good = bool((left < right).all())
            require(good, "foundation.left", f"be less than foundation.right {right} m", left)

    def arms(self) -> tuple[Vector, Vector]:
        """Return where the supports are, from G and as drawn, m."""
        height = self.base - self.point.y
        return Vector(self.left - self.point.x, height), Vector(self.right - self.point.x, height)

    def rotational_stiffness(self) -> Scalar:
        """Return the springs' moment about G by a small rotation, N m/rad."""
        left, right = self.arms()
        upright = self.horizontal_stiffness * (left.y**2 + right.y**2)
        return upright + self.vertical_stiffness * (left.x**2 + right.x**2)

    def stretches(self, frame: FrameMotion) -> tuple[tuple[Vector, Vector], ...]:
        """Return displacement (m) and velocity (m/s) of the frame at either support."""
        # By how much the axis has moved: 1 - cos as a square, since stiff springs feel 1e-16 m.
        turn = Vector(-2 * jnp.sin(frame.rotation / 2) ** 2, jnp.sin(frame.rotation))
        found = []
        for arm in self.arms():
            spun = frame.spin * arm.along(frame.axis).perp()
            found.append((frame.displacement + arm.along(turn), frame.velocity + spun))
        return tuple(found)

    def support_forces(self, frame: FrameMotion) -> tuple[Vector, Vector]:
        """Return the forces of the left and the right support on the ground, N."""
        left, right = (
            Vector(
                self.horizontal_stiffness * moved.x + self.horizontal_damping * rate.x,
                self.vertical_stiffness * moved.y + self.vertical_damping * rate.y,
            )
            for moved, rate in self.stretches(frame)
        )
        return left, right

    def elastic_energy(self, frame: FrameMotion) -> Scalar:
        """Return the energy in the springs, J."""
        (left, _), (right, _) = self.stretches(frame)
        stored = self.horizontal_stiffness * (left.x**2 + right.x**2)
        return 0.5 * (stored + self.vertical_stiffness * (left.y**2 + right.y**2))

    def loss(self, frame: FrameMotion) -> Scalar:
        """Return the power that the dampers take, W."""
        (_, left), (_, right) = self.stretches(frame)
        lost = self.horizontal_damping * (left.x**2 + right.x**2)
        lost = lost + self.vertical_damping * (left.y**2 + right.y**2)
        turned = self.rocking_damping
        return lost if turned is None else lost + turned * frame.spin**2

    def moving(self, frame: FrameMotion) -> MovingFrame:
        """Return the frame as one more body of the equations."""
        return MovingFrame(Body(self.mass, self.inertia, arm_to(self.point)), frame.spin)

    def wrench(self, frame: FrameMotion) -> Wrench:
        """Return what the supports do to the frame, in its axes."""
        pairs = list(zip(self.arms(), self.support_forces(frame), strict=True))
        one, other = (-arm.along(frame.axis).cross(on_ground) for arm, on_ground in pairs)
        (_, left), (_, right) = pairs
        moment, turned = one + other, self.rocking_damping
        moment = moment if turned is None else moment - turned * frame.spin
        return Wrench(FRAME, -(left + right).seen_from(frame.axis), moment)


# Greatest ratio of the speeds of waves under the block: that of wet soil would be infinite.
LARGEST_RATIO = 2.5


class Soil(NamedTuple):
    """Springs and dampers in the plane, about the middle of the base raised by `lever`."""

    horizontal_stiffness: Scalar  # N/m
    vertical_stiffness: Scalar  # N/m
    rocking_stiffness: Scalar  # N m/rad
    horizontal_damping: Scalar  # N s/m
    vertical_damping: Scalar  # N s/m
    rocking_damping: Scalar  # N m s/rad
    lever: Scalar  # m: sides carry a horizontal force above the base


def soil_under(
    shear_modulus: ArrayLike,
    density: ArrayLike,
    poisson: ArrayLike,
    length: ArrayLike,
    width: ArrayLike,
    embedment: ArrayLike,
    speed: ArrayLike,
) -> Soil:
    """Return springs and dampers of the soil under a block.

    **Arguments:**

    - `shear_modulus` (Pa), `density` (kg/m3), `poisson`: of the soil, whose shear waves travel
      with sqrt(G / rho).
    - `length`, `width`: sides of the base in the plane and across it, m.
    - `embedment`: depth of the base below the surface, m.
    - `speed`: the circular frequency at which springs and dampers hold, rad/s.
    """
    sides = jnp.asarray(length, float), jnp.asarray(width, float)
    along = sides[0] >= sides[1]  # the long side lies in the plane
    # A square has the slopes of one branch: `jnp.maximum` would mix those of both.
    half, other = (jnp.where(along, *pair) / 2 for pair in (sides[::-1], sides))  # B, L
    shape, deep = other / half, embedment / half  # L / B, D / B
    # Roots and powers of zero have infinite slopes, which must not meet those by the sides.
    longer = jnp.where(along, 1.0, shape - 1)
    sunk_by = jnp.asarray(embedment, float) ** 0.8 / half**0.8
    poisson, modulus = jnp.asarray(poisson, float), jnp.asarray(shear_modulus, float)
    ratio = jnp.sqrt(2 * (1 - poisson) / jnp.maximum(1 - 2 * poisson, 1e-3))
    ratio = jnp.minimum(ratio, LARGEST_RATIO)  # psi
    rate = jnp.asarray(speed, float) * half / jnp.sqrt(modulus / density)  # a0
    square = rate**2

    # Static stiffness over G B or G B^3, with the factor of embedment.
    short = 6.8 * shape**0.65 + jnp.where(along, 2.4, 0.8 * shape + 1.6)
    horizontal = short / (2 - poisson) * (1 + (0.33 + 1.34 / (1 + shape)) * sunk_by)
    vertical = (3.1 * shape**0.75 + 1.6) / (1 - poisson) * (1 + 0.25 * (1 + 1 / shape) * sunk_by)
    power = jnp.where(along, shape**4, shape)
    rocking = jnp.where(along, 3.73 * shape**2.4 + 0.27, 3.2 * shape + 0.8) / (1 - poisson)
    rocking = rocking * (1 + deep + 1.6 / (0.35 + power) * deep**2)

    # What the frequency makes of stiffness.
    slow = 10 / (1 + 3 * (shape - 1)) + square
    at_vertical = 1 - (0.4 + 0.2 / shape) * square / slow
    at_rocking = 1 - jnp.where(
        along,
        0.55 * square / (0.6 + 1.4 / shape**3 + square),
        (0.55 + 0.01 * jnp.sqrt(longer)) * square / (2.4 - 0.4 / shape**3 + square),
    )

    # Radiation: areas of base and sides, and their second moments.
    sides_along = jnp.where(along, ratio + shape, 1 + ratio * shape)
    across = 4 * (shape + deep * sides_along)
    upright = 4 * (ratio * shape + deep * (1 + shape))
    turning = jnp.where(
        along,
        shape**3 * deep + (ratio * shape + 1) * deep**3 + 3 * deep * shape**2 + ratio * shape**3,
        deep + (1 + ratio * shape) * deep**3 + 3 * deep * shape + ratio * shape,
    )
    corner = jnp.where(along, 1.8 / (1 + 1.75 * (shape - 1)), 2.2 - 0.4 / shape**3)
    sunk = jnp.where(along, shape + ratio, ratio * shape + 1) * deep**3
    turned = 4 / 3 * (turning * square / (corner + square) + sunk)

    # C = 2 beta K / omega, with beta = (area / static) a0 / (2 factor) and K = static factor.
    dashpot = modulus * half**2 / jnp.sqrt(modulus / density)
    lever = jnp.asarray(embedment / 3, float)
    sideways = modulus * half * horizontal
    return Soil(
        horizontal_stiffness=sideways,
        vertical_stiffness=modulus * half * vertical * at_vertical,
        rocking_stiffness=modulus * half**3 * rocking * at_rocking - sideways * lever**2,
        horizontal_damping=dashpot * across,
        vertical_damping=dashpot * upright,
        rocking_damping=dashpot * half**2 * turned,
        lever=lever,
    )

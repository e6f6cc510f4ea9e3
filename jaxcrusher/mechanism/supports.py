"""Foundations of the frame: the ground itself, or two supports with springs and dampers."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Scalar

from jaxcrusher.basics.checks import concrete, require, require_positive
from jaxcrusher.basics.plane import Vector, optional_scalar, scalar
from jaxcrusher.mechanism.arms import arm_to
from jaxcrusher.mechanism.equations import MovingFrame, Wrench
from jaxcrusher.mechanism.linkage import Body
from jaxcrusher.mechanism.snapshot import FrameMotion
from jaxcrusher.mechanism.topology import FRAME


class AbstractFoundation(eqx.Module):
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
    is not positive, and for a left support that is not left of the right one.
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
        left, right = concrete(self.left), concrete(self.right)
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
        squares = [(moved.x**2, moved.y**2) for moved, _ in self.stretches(frame)]
        (x, y), (also_x, also_y) = squares
        horizontal, vertical = self.horizontal_stiffness, self.vertical_stiffness
        return 0.5 * (horizontal * (x + also_x) + vertical * (y + also_y))

    def loss(self, frame: FrameMotion) -> Scalar:
        """Return the power that the dampers take, W."""
        squares = [(rate.x**2, rate.y**2) for _, rate in self.stretches(frame)]
        (x, y), (also_x, also_y) = squares
        lost = self.horizontal_damping * (x + also_x) + self.vertical_damping * (y + also_y)
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

"""Vectors of the plane of motion, kept as two scalars, and points of a body in its own axes.

Terms of a sum may be absent: None is zero, and costs nothing.
"""

import functools
from collections.abc import Iterable
from typing import TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Scalar

from jaxcrusher.basics.record import Record


def scalar(value) -> Scalar:
    """The value as a scalar array of the default floating-point type."""
    if isinstance(value, jax.Array) and value.dtype == float and not value.weak_type:
        return value  # JAX takes 30 us to come to that
    return jnp.asarray(value, dtype=float)


def optional_scalar(value) -> Scalar | None:
    """The value as `scalar` makes it, or None."""
    return None if value is None else scalar(value)


class Vector(Record):
    """A vector of the plane, x to the right and y up.

    Two scalars and not an array of shape (2,): XLA fuses scalar arithmetic into one
    kernel, but stops at every slice and concatenation.
    """

    x: Scalar = eqx.field(converter=scalar)
    y: Scalar = eqx.field(converter=scalar)

    def __add__(self, other: "Vector") -> "Vector":
        return Vector(self.x + other.x, self.y + other.y)

    def __sub__(self, other: "Vector") -> "Vector":
        return Vector(self.x - other.x, self.y - other.y)

    def __neg__(self) -> "Vector":
        return Vector(-self.x, -self.y)

    def __mul__(self, factor) -> "Vector":
        return Vector(self.x * factor, self.y * factor)

    __rmul__ = __mul__

    def __truediv__(self, divisor) -> "Vector":
        return Vector(self.x / divisor, self.y / divisor)

    def dot(self, other: "Vector") -> Scalar:
        """Scalar product."""
        return self.x * other.x + self.y * other.y

    def cross(self, other: "Vector") -> Scalar:
        """The z component of the vector product: the moment of `other` at arm `self`."""
        return self.x * other.y - self.y * other.x

    def perp(self) -> "Vector":
        """The vector turned by 90 degrees counterclockwise."""
        return Vector(-self.y, self.x)

    def along(self, axis: "Vector") -> "Vector":
        """Body coordinates `self` in the plane, for a body whose x axis is `axis` (unit)."""
        return Vector(self.x * axis.x - self.y * axis.y, self.x * axis.y + self.y * axis.x)

    def seen_from(self, axis: "Vector") -> "Vector":
        """Return the components along the axes of a body whose x axis is `axis` (unit)."""
        return Vector(self.dot(axis), axis.cross(self))

    def array(self) -> Float[Array, "2"]:
        """The components as one array of shape (2,)."""
        return jnp.stack([self.x, self.y])


def direction(angle) -> Vector:
    """The unit vector at `angle` (rad), counterclockwise from the x axis."""
    return Vector(jnp.cos(angle), jnp.sin(angle))


T = TypeVar("T", Vector, Scalar)


def plus(one: T | None, other: T | None) -> T | None:
    """Return the sum of two numbers or vectors; None stands for zero, and costs nothing."""
    return other if one is None else one if other is None else one + other


def minus(one: T | None, other: T | None) -> T | None:
    """Return the difference of two numbers or vectors, of which None is zero."""
    return one if other is None else -other if one is None else one - other


def or_zero(vector: Vector | None) -> Vector:
    """Return a vector; for None the zero vector."""
    return Vector(0.0, 0.0) if vector is None else vector


class Arm(Record):
    """A point of a body in the body's axes, from its origin; None is zero, and is never traced."""

    x: Scalar | None = eqx.field(converter=optional_scalar, default=None)  # m
    y: Scalar | None = eqx.field(converter=optional_scalar, default=None)  # m

    def __sub__(self, other: "Arm") -> "Arm":
        return Arm(minus(self.x, other.x), minus(self.y, other.y))

    def along(self, axis: Vector) -> Vector | None:
        """Return the arm in the plane, of a body whose x axis is `axis` (unit)."""
        ahead = None if self.x is None else self.x * axis
        return plus(ahead, None if self.y is None else self.y * axis.perp())

    def squared(self) -> Scalar | None:
        """Return the square of its length, m2."""
        parts = [None if part is None else part**2 for part in (self.x, self.y)]
        return plus(*parts)

    def vector(self) -> Vector:
        """Return the arm as a vector of the body's axes."""
        return Vector(*(jnp.zeros(()) if part is None else part for part in (self.x, self.y)))


def arm_to(point: Vector) -> Arm:
    """Return the arm to a point of the body's axes, m."""
    return Arm(point.x, point.y)


def total(parts: Iterable[T | None]) -> T | None:
    """Return the sum of several numbers or vectors, of which None is zero."""
    return functools.reduce(plus, parts, None)

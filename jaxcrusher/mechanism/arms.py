"""Points of a body in its own axes, and sums of vectors of which some are not there."""

import functools
from collections.abc import Iterable
from typing import TypeVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Scalar

from jaxcrusher.basics.plane import Vector, optional_scalar

T = TypeVar("T", Vector, Scalar)


def plus(one: T | None, other: T | None) -> T | None:
    """Return the sum of two numbers or vectors; None stands for zero, and costs nothing."""
    return other if one is None else one if other is None else one + other


def minus(one: T | None, other: T | None) -> T | None:
    """Return the difference of two numbers or vectors, of which None is zero."""
    return one if other is None else -other if one is None else one - other


def or_zero(vector: Vector | None) -> Vector:
    """Return a vector; None is the one without length."""
    return Vector(0.0, 0.0) if vector is None else vector


class Arm(eqx.Module):
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
        """Return it as a vector of the body's axes."""
        return Vector(*(jnp.zeros(()) if part is None else part for part in (self.x, self.y)))


def arm_to(point: Vector) -> Arm:
    """Return the arm to a point of the body's axes, m."""
    return Arm(point.x, point.y)


def total(parts: Iterable[T | None]) -> T | None:
    """Return the sum of several numbers or vectors, of which None is zero."""
    return functools.reduce(plus, parts, None)

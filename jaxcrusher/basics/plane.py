"""Vectors of the plane of motion, kept as two scalars."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Scalar


def scalar(value) -> Scalar:
    """The value as a scalar array of the default floating-point type."""
    if isinstance(value, jax.Array) and value.dtype == float and not value.weak_type:
        return value  # JAX takes 30 us to come to that
    return jnp.asarray(value, dtype=float)


def optional_scalar(value) -> Scalar | None:
    """The value as `scalar` makes it, or None."""
    return None if value is None else scalar(value)


class Vector(eqx.Module):
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
        """Return the components along the axes of a body whose x axis is `axis`, as of `along`."""
        return Vector(self.dot(axis), axis.cross(self))

    def array(self) -> Float[Array, "2"]:
        """The components as one array of shape (2,)."""
        return jnp.stack([self.x, self.y])


def direction(angle) -> Vector:
    """The unit vector at `angle` (rad), counterclockwise from the x axis."""
    return Vector(jnp.cos(angle), jnp.sin(angle))

"""Smoothed corners, each with a width that goes to zero to give the sharp function.

Every function has finite derivatives everywhere, and equals the sharp one exactly
outside its width (`norm`: up to width**2 / (2 |v|)). Entry by entry where `x` is an array.
"""

import jax.numpy as jnp
from jaxtyping import Array, Float, Scalar

from jaxcrusher.basics.plane import Vector

Values = Float[Array, "*shape"]
Number = float | Scalar


def positive_part(x: Values, width: Number) -> Values:
    """max(x, 0), its corner replaced by a parabola over [-width, width].

    Largest error width / 4, at x = 0.
    """
    blend = jnp.clip(x + width, 0, 2 * width)
    return blend**2 / (4 * width) + jnp.maximum(x - width, 0)


def positive_power(x: Values, width: Number, exponent: Number) -> Values:
    """`positive_part(x, width)**exponent`, with all its derivatives zero where x < -width."""
    base = positive_part(x, width)
    outside = base <= 0  # NaN is not, and remains
    return jnp.where(outside, 0, jnp.where(outside, 1, base) ** exponent)


def positive_power_integral(x: Values, width: Number, exponent: Number) -> Values:
    """The integral of `positive_power(x, width, exponent)` from minus infinity to x."""
    blend = jnp.clip(x + width, 0, 2 * width)
    order = 2 * exponent + 1
    corner = blend**order / (order * (4 * width) ** exponent)
    beyond = jnp.maximum(x, width) ** (exponent + 1) - width ** (exponent + 1)
    return corner + beyond / (exponent + 1)


def step(x: Values, width: Number) -> Values:
    """0 below -width, 1 above width, a cubic between."""
    fraction = jnp.clip((x + width) / (2 * width), 0, 1)
    return fraction**2 * (3 - 2 * fraction)


def norm(vector: Vector, width: Number) -> Scalar:
    """sqrt(|v|**2 + width**2): the length, with a derivative at zero too."""
    return jnp.sqrt(vector.dot(vector) + width**2)

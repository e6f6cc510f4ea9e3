"""Soil under a rectangular block, as springs and dampers at one frequency.

Pais and Kausel (1988), as NIST GCR 12-917-21 (2012), tables 2-2 and 2-3, gives them: a rigid block
on, or embedded in, an even half space, its sides in full contact with the soil. Stiffness and
damping are those of the frequency; the soil's own damping is left out.
"""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import ArrayLike, Scalar

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
    - `speed`: the circular frequency at which they are counted, rad/s.
    """
    sides = jnp.asarray(length, float), jnp.asarray(width, float)
    half = jnp.minimum(*sides) / 2  # B
    shape, deep = jnp.maximum(*sides) / jnp.minimum(*sides), embedment / half  # L / B, D / B
    along = sides[0] >= sides[1]  # the long side lies in the plane
    poisson, modulus = jnp.asarray(poisson, float), jnp.asarray(shear_modulus, float)
    ratio = jnp.sqrt(2 * (1 - poisson) / jnp.maximum(1 - 2 * poisson, 1e-3))
    ratio = jnp.minimum(ratio, LARGEST_RATIO)  # psi
    rate = jnp.asarray(speed, float) * half / jnp.sqrt(modulus / density)  # a0
    square = rate**2

    # Static stiffness over G B or G B^3, with the factor of embedment.
    short = 6.8 * shape**0.65 + jnp.where(along, 2.4, 0.8 * shape + 1.6)
    horizontal = short / (2 - poisson) * (1 + (0.33 + 1.34 / (1 + shape)) * deep**0.8)
    vertical = (3.1 * shape**0.75 + 1.6) / (1 - poisson) * (1 + 0.25 * (1 + 1 / shape) * deep**0.8)
    power = jnp.where(along, shape**4, shape)
    rocking = jnp.where(along, 3.73 * shape**2.4 + 0.27, 3.2 * shape + 0.8) / (1 - poisson)
    rocking = rocking * (1 + deep + 1.6 / (0.35 + power) * deep**2)

    # What the frequency makes of stiffness.
    slow = 10 / (1 + 3 * (shape - 1)) + square
    at_vertical = 1 - (0.4 + 0.2 / shape) * square / slow
    at_rocking = 1 - jnp.where(
        along,
        0.55 * square / (0.6 + 1.4 / shape**3 + square),
        (0.55 + 0.01 * jnp.sqrt(shape - 1)) * square / (2.4 - 0.4 / shape**3 + square),
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

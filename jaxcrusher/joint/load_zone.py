"""Integrals over the load zone of a bearing whose rollers are a continuum: Sjovall's.

A roller at the angle psi off the load is pressed by e cos psi - c, where that is positive. With the
penetration d = e - c and q = d / (2 e), the sine of a quarter of the zone's width is sqrt(q), and
sin(psi / 2) = x sqrt(q) maps the zone onto x from -1 to 1: e cos psi - c = d (1 - x^2). What is
left of the integrals is smooth in q from 0 to 1/2, so that a fixed Gauss rule is exact to rounding.
"""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Scalar
from scipy.special import roots_gegenbauer

# Palmgren's line contact: Q is as its penetration to this power.
EXPONENT = 10 / 9
# Even, so that half of the nodes serve both halves of the zone. The integrand's singularity at
# x = sqrt(2) or beyond leaves an error of (1 + sqrt(2))^-40 = 5e-16.
_NODES = 20


def _rule(exponent: float) -> list[tuple[float, float]]:
    """Return x^2 and weight of Gauss's rule for (1 - x^2)^exponent on [0, 1], of even functions."""
    nodes, weights = roots_gegenbauer(_NODES, exponent + 0.5)
    half = nodes > 0
    return list(zip((nodes[half] ** 2).tolist(), weights[half].tolist(), strict=True))


_FORCE, _ENERGY = _rule(EXPONENT), _rule(EXPONENT + 1)


def force_factor(q: Scalar) -> Scalar:
    """Return (1 / 2 pi) int (1 - x^2)^(10/9) cos psi dpsi over sqrt(q)."""
    total = sum(w * (1 - 2 * q * x) / jnp.sqrt(1 - q * x) for x, w in _FORCE)
    return 2 / np.pi * jnp.asarray(total)


def energy_factor(q: Scalar) -> Scalar:
    """Return (1 / 2 pi) int (1 - x^2)^(19/9) dpsi over sqrt(q)."""
    return 2 / np.pi * jnp.asarray(sum(w / jnp.sqrt(1 - q * x) for x, w in _ENERGY))


def damping_shares(root: Scalar) -> tuple[Scalar, Scalar]:
    """Return (2 / pi) int cos^2 and sin^2 psi dpsi over the zone, where `root` is sqrt(q).

    Along the load and across it; both are 1 where half of the bearing is loaded.
    """
    zone = 2 * jnp.arcsin(root)
    swell = 2 * root * jnp.sqrt(1 - root**2) * (1 - 2 * root**2)
    return 2 / np.pi * (zone + swell), 2 / np.pi * (zone - swell)

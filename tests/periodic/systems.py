"""Forced oscillators whose orbits are published."""

import jax.numpy as jnp


def duffing(time, x, rate, args):
    """Return x'' of x'' + c x' + x + k x^3 = f cos(w t), the phase of the forcing w t."""
    c, k, f, w = args
    return f * jnp.cos(w * time) - c * rate - x - k * x**3


def mathieu(time, x, rate, args):
    """Return x'' of x'' + (a + b cos t) x = 0."""
    a, b = args
    return -(a + b * jnp.cos(time)) * x

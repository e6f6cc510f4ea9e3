"""Trigonometric polynomials through values at equally spaced points of one period.

They are real, of degree N / 2 for an even number N of points. The highest harmonic is a cosine, as
the values at the points determine (Trefethen, Spectral Methods in MATLAB, 2000, chapter 3). Places
are counted in periods, derivatives are by the phase, which is 2 pi a period.
"""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Scalar

from jaxcrusher.basics.checks import require


def nodes(count: int) -> Float[np.ndarray, " count"]:
    """Return `count` equally spaced points of [0, 1)."""
    return np.arange(count) / count


def differentiation(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the matrices from values at the nodes to the first two derivatives there (chapter 3).

    Raises ValueError for an odd number of nodes, for which the matrices differ.
    """
    require(count > 0 and count % 2 == 0, "nodes", "be an even number > 0", count)
    place = np.arange(count, dtype=float)
    apart = place[:, None] - place[None]
    same = apart == 0
    half = np.where(same, 1.0, np.pi / count * apart)
    sign = 1 - 2 * (apart % 2)
    first = np.where(same, 0.0, sign / (2 * np.tan(half)))
    second = np.where(same, -(count**2 + 2) / 12, -sign / (2 * np.sin(half) ** 2))
    return first, second


def resample(
    x: Float[Array, "count ..."], points: int, shift: float = 0.0, order: int = 0
) -> Float[Array, "points ..."]:
    """Return a derivative (0: the value) at equal steps, the first `shift` of them after zero.

    Fewer points than nodes leave the harmonics above half of their number out.
    """
    count, kept = len(x), min(len(x), points) // 2 + 1
    harmonics = np.arange(kept)
    turned = (1j * harmonics) ** order * np.exp(2j * np.pi * shift / points * harmonics)
    # A spectrum of an even number of values has its highest harmonic once, the others twice.
    last = 2 * (kept - 1)
    turned[-1] *= (2 if last == points else 1) / (2 if last == count else 1)
    spectrum = jnp.fft.rfft(x, axis=0)[:kept] * (points / count)
    return jnp.fft.irfft(spectrum * turned.reshape(-1, *[1] * (x.ndim - 1)), points, axis=0)


def evaluate(x: Float[Array, "count ..."], place: Scalar, order: int = 0) -> Float[Array, "..."]:
    """Return a derivative (0: the value) at any one place."""
    count = len(x)
    harmonics = np.arange(count // 2 + 1)
    weights = np.where((harmonics == 0) | (harmonics == count // 2), 1.0, 2.0) / count
    slopes, phase = 1j * harmonics, 2 * np.pi * jnp.asarray(place, complex)
    turned = weights * slopes**order * jnp.exp(phase * slopes)
    return jnp.tensordot(turned, jnp.fft.rfft(x, axis=0), axes=1).real

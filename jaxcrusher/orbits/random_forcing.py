"""A periodic orbit under a small random force: covariances by harmonic transfer functions.

x'' = f(t, x, x') + b(t) w(t), b of the orbit's period. To w = exp(i nu t) the linear response is
exp(i nu t) p(t) with p periodic (Wereley, Analysis and Control of Linear Periodically Time Varying
Systems, MIT 1991): d/dt becomes d/dt + i nu in the orbit's own equations. The covariance is the
integral over the band of w, which has unit variance and a flat spectrum from 0 to `bandwidth`.
"""

import math

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.scipy.linalg import lu_factor, lu_solve
from jaxtyping import Array, Complex, Float, Scalar

from jaxcrusher.orbits.collocation import System
from jaxcrusher.orbits.trigonometric import nodes

# Of Gauss and Legendre on either side of each resonance: 1e-7 of the integral over a resonance
# whose width is 1e-5 of the period's frequency.
POINTS = 14


class Linear(eqx.Module):
    """The equations about an orbit: df/dx, df/dx' and b at its nodes, and the frequency 1 / T."""

    by_x: Float[Array, "nodes dims dims"]
    by_rate: Float[Array, "nodes dims dims"]
    force: Float[Array, "nodes dims"]
    system: System

    @property
    def pace(self) -> Scalar:
        """Return 2 pi / T."""
        return 2 * np.pi / self.system.period

    def responses(
        self, share: Scalar, harmonics: Float[np.ndarray, " forces"]
    ) -> Complex[Array, "nodes states forces"]:
        """Return (x, x', w) exp(-i pace share t) for the forces w = exp(i pace (share + k) t).

        k are the `harmonics`: forces whose frequencies are whole numbers apart have one matrix.
        """
        count, dims = self.force.shape
        first, _ = self.system.matrices(count)
        eye, shift = np.eye(dims), 1j * self.pace * share
        mixed = jnp.einsum("iab,ij->iajb", self.by_rate, np.eye(count))
        mixed -= 2 * jnp.einsum("ab,ij->iajb", eye, first)
        matrix = self.system.jacobian(self.by_x, self.by_rate) + shift * mixed
        matrix = matrix.reshape(count * dims, count * dims) - shift**2 * np.eye(count * dims)
        waves = jnp.exp(2j * np.pi * nodes(count)[:, None] * harmonics)
        right = -(self.force[:, :, None] * waves[:, None]).reshape(count * dims, -1)
        x = lu_solve(lu_factor(matrix), right)
        rate = (first @ x.reshape(count, -1)).reshape(x.shape) + shift * x
        parts = [part.reshape(count, dims, -1) for part in (x, rate)]
        return jnp.concatenate([*parts, waves[:, None]], axis=1)


class Band(eqx.Module):
    """Frequencies that represent a band, in 1 / T: any share between 0 and 1 / 2, plus whole ones.

    The negative ones that are missing are conjugates of these.
    """

    shares: Float[Array, " n"]
    weights: Float[Array, "n forces"]  # of the square of each response; zero outside of the band
    harmonics: Float[np.ndarray, " forces"]


def band(bandwidth: Scalar, widest: float, multipliers: Complex[Array, " states"]) -> Band:
    """Return the band up to `bandwidth`, in 1 / T, of an orbit with these multipliers.

    `widest` is a number that the bandwidth does not exceed. On either side of a resonance, which
    a multiplier exp(2 pi (i f - g)) makes at the share f with the width g, the shares are
    f + g sinh u with Gauss' points u, and so the integrand is smooth. For slopes of what they sum,
    the multipliers must have theirs: points that stayed where a sharp resonance moves tell nothing.
    """
    harmonics = np.arange(-math.ceil(widest + 0.5), math.ceil(widest) + 1.0)
    # Multipliers come in conjugate pairs, and so do their sorted angles; the sharper one of a pair
    # of real ones counts.
    logs = jnp.log(multipliers) / (2 * np.pi)
    order = jnp.argsort(jnp.abs(logs.imag))
    peaks, breadths = (part[order].reshape(-1, 2) for part in (jnp.abs(logs.imag), -logs.real))
    sharper = jnp.argmin(breadths, axis=1, keepdims=True)
    peaks, breadths = (
        jnp.take_along_axis(part, sharper, axis=1)[:, 0] for part in (peaks, breadths)
    )
    beyond = bandwidth - jnp.floor(bandwidth + 0.5)
    edge = jnp.where(beyond >= 0, beyond, -beyond)  # with the slope of a bandwidth that grows
    of_band = jnp.stack([jnp.zeros_like(edge), edge, jnp.full_like(edge, 0.5)])
    ends = jnp.sort(jnp.concatenate([of_band, peaks]))
    # An end of the band may lie beside a resonance.
    breadths = jnp.min(breadths + jnp.abs(ends[:, None] - peaks), axis=1)
    half = (ends[1:] - ends[:-1]) / 2
    points, gauss = np.polynomial.legendre.leggauss(POINTS)
    points, gauss = (points + 1) / 2, gauss / 2

    def side(end: Array, breadth: Array, sign: int) -> tuple[Array, Array]:
        reach = jnp.arcsinh(half / breadth)[:, None]
        u, breadth = reach * points, breadth[:, None]
        weights = reach * breadth * jnp.cosh(u) * gauss
        return (end[:, None] + sign * breadth * jnp.sinh(u)).ravel(), weights.ravel()

    sides = side(ends[:-1], breadths[:-1], 1), side(ends[1:], breadths[1:], -1)
    shares, weights = (jnp.concatenate(part) for part in zip(*sides, strict=True))
    inside = jnp.abs(shares[:, None] + harmonics) <= bandwidth
    return Band(shares, weights[:, None] * inside / bandwidth, harmonics)


def covariance(
    linear: Linear, over: Band, weighted: Float[Array, "nodes states"]
) -> tuple[Float[Array, "nodes states states"], Scalar]:
    """Return the covariance of (x, x', w) at the nodes, and the variance of a mean.

    That is the mean over one period of the product of (x, x', w) and what `weighted` holds.
    """
    count = len(weighted)
    orders = np.fft.fftfreq(count, 1 / count)

    def at(one: tuple[Array, Array]) -> tuple[Array, Array]:
        share, weights = one
        seen = linear.responses(share, over.harmonics)
        both = jnp.einsum("ias,ibs->iab", seen * weights, jnp.conj(seen)).real
        product = jnp.einsum("ia,ias->is", weighted, seen)
        # The mean of exp(2 pi i (share + k) t / T) over a period, but for a phase.
        means = jnp.sinc(share + orders) * np.cos(np.pi * orders)
        mean = means @ jnp.fft.fft(product, axis=0) / count
        return both, jnp.sum(weights * jnp.abs(mean) ** 2)

    # In reverse each frequency is solved for again: kept, the factors of all need gigabytes.
    found = jax.lax.map(jax.checkpoint(at, prevent_cse=False), (over.shares, over.weights))
    return jnp.sum(found[0], axis=0), jnp.sum(found[1])

"""A periodic orbit under a small random force: covariances by Floquet's modes.

x'' = f(t, x, x') + b(t) w(t), b of the orbit's period T. With the phase 2 pi t / T small motions
(x, x') are sums of modes v_j a_j with v_j periodic and a_j' = e_j a_j + g_j w. To w =
exp(i nu phase) each harmonic k of g_j responds by g_jk / (i (nu + k) - e_j); their sum is the
harmonic transfer function (Wereley, Analysis and Control of Linear Periodically Time Varying
Systems, MIT 1991). The random w has unit variance and a flat spectrum from 0 to a bandwidth B.
"""

import math

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float, Scalar

from jaxcrusher.periodic.multipliers import fundamental
from jaxcrusher.periodic.trigonometric import nodes, resample

# Of Gauss and Legendre on either side of each resonance: 1e-7 of the integral over a resonance
# whose width is 1e-5 of the period's frequency.
POINTS = 14
# The least multiplier whose mode is known, to 1e-7.
LEAST = 1e-9


class Modes(eqx.Module):
    """Floquet's modes of an orbit, and what the force excites of each, at equal steps."""

    exponents: Complex[Array, " modes"]  # e
    shapes: Complex[Array, "steps states modes"]  # v: x and x'
    excited: Complex[Array, "steps modes"]  # g

    @property
    def orders(self) -> np.ndarray:
        """Return the harmonics in the order of FFTs."""
        count = len(self.excited)
        return np.fft.fftfreq(count, 1 / count)

    def responses(
        self, share: Scalar, harmonics: Float[np.ndarray, " forces"]
    ) -> Complex[Array, "steps states forces"]:
        """Return (x, x', w) exp(-i share phase) for w = exp(i (share + k) phase).

        k are the `harmonics`.
        """
        orders = (self.orders[:, None] + harmonics[None])[:, None] + share
        poles = 1j * orders.astype(complex) - self.exponents[None, :, None]
        sizes = jnp.fft.ifft(jnp.fft.fft(self.excited, axis=0)[:, :, None] / poles, axis=0)
        waves = jnp.exp(2j * np.pi * nodes(len(sizes))[:, None] * harmonics)
        motion = jnp.einsum("iaj,ijh,ih->iah", self.shapes, sizes, waves)
        return jnp.concatenate([motion, waves[:, None]], axis=1)

    def covariance(self, bandwidth: Scalar) -> Float[Array, "steps states states"]:
        """Return the covariance of (x, x', w) for a `bandwidth` in 1 / T.

        The mean of a_j w is an integral of g_jk / (i (nu + k) - e_j) over the band. The mean of
        a_j conj(a_l) follows from its own equation, which the former means force.
        """
        poles = 1j * self.orders[:, None] - self.exponents[None]
        edge = jax.lax.complex(0.0, bandwidth)
        band = (jnp.log(poles + edge) - jnp.log(poles - edge)) / (2 * edge)
        beside = jnp.fft.ifft(jnp.fft.fft(self.excited, axis=0) * band, axis=0)
        forcing = beside[:, :, None] * jnp.conj(self.excited)[:, None]
        forcing += jnp.conj(jnp.swapaxes(forcing, 1, 2))
        decay = self.exponents[:, None] + jnp.conj(self.exponents)[None]
        poles = 1j * self.orders[:, None, None] - decay[None]
        both = jnp.fft.ifft(jnp.fft.fft(forcing, axis=0) / poles, axis=0)
        motion = jnp.einsum("iaj,ijl,ibl->iab", self.shapes, both, jnp.conj(self.shapes)).real
        with_force = jnp.einsum("iaj,ij->ia", self.shapes, beside).real
        above = jnp.concatenate([motion, with_force[:, :, None]], axis=2)
        below = jnp.concatenate([with_force, jnp.ones((len(beside), 1))], axis=1)
        return jnp.concatenate([above, below[:, None]], axis=1)


def modes(
    slopes: tuple[Float[Array, "nodes dims dims"], ...],
    force: Float[Array, "nodes dims"],
    period: Scalar,
    multipliers: Complex[Array, " modes"],
) -> Modes:
    """Return the modes of an orbit from df/dx, df/dx' and b at its nodes.

    Its `multipliers` differ from each other, and none is smaller than `LEAST`: rounding would hide
    its mode behind the others.
    """
    along, once = fundamental(slopes, period)
    count, size = len(along), len(once)
    # Any row and column that are not orthogonal to a mode make the singular matrix regular.
    edge = np.random.default_rng(0).normal(size=size).astype(complex)
    unit = np.append(np.zeros(size), 1.0).astype(complex)

    def one(multiplier: Array) -> Array:
        matrix = once.astype(complex) - multiplier * np.eye(size, dtype=complex)
        bordered = jnp.block([[matrix, edge[:, None]], [edge[None], np.zeros((1, 1), complex)]])
        return jnp.linalg.solve(bordered, unit)[:-1]

    exponents = jnp.log(multipliers) / (2 * np.pi)
    back = jnp.exp(-2 * np.pi * nodes(count).astype(complex)[:, None] * exponents[None])
    shapes = along.astype(complex) @ jax.vmap(one, out_axes=1)(multipliers) * back[:, None]
    pushed = resample(force, count) * period / (2 * np.pi)
    pushed = jnp.concatenate([jnp.zeros_like(pushed), pushed], axis=1).astype(complex)
    return Modes(exponents, shapes, jnp.linalg.solve(shapes, pushed[:, :, None])[:, :, 0])


class Band(eqx.Module):
    """Frequencies that represent a band, in 1 / T: any share between 0 and 1 / 2, plus whole ones.

    The missing negative ones are conjugates of these.
    """

    shares: Float[Array, " n"]
    weights: Float[Array, "n forces"]  # of the square of each response; zero outside of the band
    harmonics: Float[np.ndarray, " forces"]


def band(bandwidth: Scalar, widest: float, multipliers: Complex[Array, " states"]) -> Band:
    """Return the band up to `bandwidth`, in 1 / T, of an orbit with these multipliers.

    `widest` is a number that the bandwidth does not exceed. On either side of a resonance, which a
    multiplier exp(2 pi (i f - g)) makes at the share f with the width g, the shares are
    f + g sinh u with Gauss' points u, and so the integrand is smooth. For slopes of sums over the
    band the multipliers need slopes too: points that do not move with a sharp resonance tell
    nothing.
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
    breadths = jnp.min(breadths[None] + jnp.abs(ends[:, None] - peaks[None]), axis=1)
    half = (ends[1:] - ends[:-1]) / 2
    points, gauss = np.polynomial.legendre.leggauss(POINTS)
    points, gauss = (points[None] + 1) / 2, gauss[None] / 2

    def side(end: Array, breadth: Array, sign: int) -> tuple[Array, Array]:
        reach = jnp.arcsinh(half / breadth)[:, None]
        u, breadth = reach * points, breadth[:, None]
        weights = reach * breadth * jnp.cosh(u) * gauss
        return (end[:, None] + sign * breadth * jnp.sinh(u)).ravel(), weights.ravel()

    sides = side(ends[:-1], breadths[:-1], 1), side(ends[1:], breadths[1:], -1)
    shares, weights = (jnp.concatenate(part) for part in zip(*sides, strict=True))
    inside = jnp.abs(shares[:, None] + harmonics[None]) <= bandwidth
    return Band(shares, weights[:, None] * inside.astype(float) / bandwidth, harmonics)


def mean_variance(of: Modes, over: Band, weighted: Float[Array, "steps states"]) -> Scalar:
    """Return the variance of the mean over one period of (x, x', w) times `weighted`."""

    def at(one: tuple[Array, Array]) -> Array:
        share, weights = one
        product = jnp.einsum(
            "ia,ias->is", weighted.astype(complex), of.responses(share, over.harmonics)
        )
        # The mean of exp(i (share + k) phase) over a period, but for a phase.
        means = jnp.sinc(share + of.orders) * np.cos(np.pi * of.orders)
        mean = means.astype(complex) @ jnp.fft.fft(product, axis=0) / len(weighted)
        return jnp.sum(weights * jnp.abs(mean) ** 2)

    each = jax.checkpoint(at, prevent_cse=False)
    return jnp.sum(jax.lax.map(each, (over.shares, over.weights)))

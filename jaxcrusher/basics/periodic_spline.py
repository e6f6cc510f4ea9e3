"""The periodic cubic spline through points over an angle, as a sum of increments.

Its value is the value at the first point plus the increment of each interval up to the angle: zero
before the interval, the whole behind it. So no traced number selects an interval, and nothing
cancels.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Scalar

from jaxcrusher.basics.plane import scalar
from jaxcrusher.basics.record import Record

TURN = 2 * np.pi


class PeriodicSpline(Record):
    """A twice differentiable function of period 2 pi, with slopes by all of its points."""

    origin: Scalar = eqx.field(converter=scalar)  # the first angle, rad
    first: Scalar = eqx.field(converter=scalar)  # the value there
    start: Float[Array, " n"]  # of each interval, from the first angle on, rad
    end: Float[Array, " n"]  # the last one lies beyond the turn, whatever is rounded
    slope: Float[Array, " n"]  # at the start of each interval
    half_curvature: Float[Array, " n"]  # half of the second derivative there
    twist: Float[Array, " n"]  # a sixth of the third derivative

    def __call__(self, angle: Scalar) -> Scalar:
        """Return the value at any angle (rad)."""
        past = angle - self.origin
        past = past - TURN * jnp.floor(past / TURN)
        inside = (self.start <= past) & (past < self.end)
        width = jnp.where(past < self.start, 0.0, self.end - self.start)
        u = jnp.where(inside, past - self.start, width)
        return self.first + jnp.sum(u * (self.slope + u * (self.half_curvature + u * self.twist)))


def spline_through(angles: Float[Array, " n"], values: Float[Array, " n"]) -> PeriodicSpline:
    """Return the spline through n > 2 values at different angles in [0, 2 pi), in any order.

    Its second derivatives solve the periodic tridiagonal system (de Boor, A Practical Guide to
    Splines, chapter IV). Both arguments may be traced.
    """
    order = jnp.argsort(angles)
    at, y = angles[order], values[order]
    width = jnp.append(at[1:], at[0] + TURN) - at
    secant = (jnp.roll(y, -1) - y) / width
    before = jnp.roll(width, 1)
    count = at.size
    row = jnp.arange(count)
    matrix = jnp.zeros((count, count)).at[row, row].set(2 * (before + width))
    matrix = matrix.at[row, row - 1].add(before).at[row, (row + 1) % count].add(width)
    second = jnp.linalg.solve(matrix, 6 * (secant - jnp.roll(secant, 1)))
    after = jnp.roll(second, -1)
    start = at - at[0]
    return PeriodicSpline(
        at[0],
        y[0],
        start,
        jnp.append(start[1:], 2 * TURN),
        secant - width * (2 * second + after) / 6,
        second / 2,
        (after - second) / (6 * width),
    )


class PeriodicSeries(Record):
    """A Fourier series of period 2 pi."""

    cosines: Float[Array, " orders"]  # from order 0
    sines: Float[Array, " orders"]

    def __call__(self, angle: Scalar) -> Scalar:
        """Return the value at any angle (rad), by the recurrences of Clenshaw (1955)."""
        cosine, sine = jnp.cos(angle), jnp.sin(angle)
        zero, twice = jnp.zeros_like(cosine), 2 * cosine
        even, before, odd, behind = zero, zero, zero, zero
        for order in range(len(self.cosines) - 1, 0, -1):
            even, before = self.cosines[order] + twice * even - before, even
            odd, behind = self.sines[order] + twice * odd - behind, odd
        return self.cosines[0] + cosine * even - before + sine * odd


def series_of(spline: PeriodicSpline, orders: int) -> PeriodicSeries:
    """Return the first orders of a spline's Fourier series, from its values at many angles."""
    count = max(8 * len(spline.start), 8 * orders)
    return series_through(jax.vmap(spline)(jnp.arange(count, dtype=float) * TURN / count), orders)


def series_through(values: Float[Array, " n"], orders: int) -> PeriodicSeries:
    """Return the first orders of the Fourier series of values at n evenly spaced angles from 0."""
    both = 2 * jnp.fft.rfft(values)[:orders] / len(values)
    return PeriodicSeries(both.real.at[0].divide(2.0), -both.imag)

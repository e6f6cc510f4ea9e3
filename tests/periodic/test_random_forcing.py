"""Covariances under a random force, against closed forms of a linear oscillator."""

import itertools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import quad

from jaxcrusher.periodic.random_forcing import band, mean_variance, modes
from tests.differences import differences
from tests.pairs import crossed

COUNT = 64


def seen(stiffness, damping, bandwidth, widest=None, turns=1):
    """Of x'' = w - stiffness x - damping x', looked at as if it had a period of so many turns."""
    period = jnp.asarray(2 * np.pi * turns)
    ones = jnp.ones((COUNT, 1, 1))
    root = jnp.sqrt(jnp.asarray(damping**2 / 4 - stiffness, complex))
    multipliers = jnp.exp(period * jnp.array([-damping / 2 + root, -damping / 2 - root]))
    widest = bandwidth if widest is None else widest
    over = band(jnp.asarray(turns * bandwidth), turns * widest, multipliers)
    free = modes((-stiffness * ones, -damping * ones), ones[:, 0], period, multipliers)
    # The mean of x over a period.
    weighted = jnp.zeros((len(free.excited), 3)).at[:, 0].set(1.0)
    return free.covariance(jnp.asarray(turns * bandwidth)), mean_variance(free, over, weighted)


def expected(stiffness, damping, bandwidth, of):
    def density(order):
        square = abs(stiffness - order**2 + 1j * damping * order) ** -2
        return of(order) * square / bandwidth

    centre, width = np.sqrt(stiffness), damping / 2
    near = [centre + sign * k * width for sign in (-1, 1) for k in (0, 3, 30, 300)]
    ends = sorted({0.0, bandwidth, *(one for one in near if 0 < one < bandwidth)})
    pieces = itertools.pairwise(ends)
    return sum(quad(density, *piece, epsrel=1e-10, limit=200)[0] for piece in pieces)


@pytest.mark.parametrize(
    ("bandwidth", "damping", "turns"), crossed((2.0, 5.0, 7.7), (0.3, 1e-4), (1, 2))
)
def test_an_oscillator(bandwidth, damping, turns):
    """Its resonance at order 3.3 is below two of the bands, and as sharp as a crusher's."""
    stiffness = 3.3**2
    found, mean = seen(stiffness, damping, bandwidth, turns=turns)
    # Rounding of a multiplier, over the width of its resonance.
    exact = {"rtol": 1e-9}
    for entry, of in ((0, lambda _: 1.0), (1, lambda order: order**2)):
        wanted = expected(stiffness, damping, bandwidth, of)
        np.testing.assert_allclose(found[:, entry, entry], wanted, **exact)
    np.testing.assert_allclose(found[:, 2, 2], 1.0, rtol=1e-12)
    # In a stationary motion x and x' are not correlated.
    scale = float(jnp.sqrt(found[0, 0, 0] * found[0, 1, 1]))
    np.testing.assert_allclose(found[:, 0, 1], 0.0, atol=1e-9 * scale)
    wanted = expected(stiffness, damping, bandwidth, lambda order: np.sinc(turns * order) ** 2)
    # Of Gauss' points over a resonance.
    np.testing.assert_allclose(mean, wanted, rtol=3e-6)


@pytest.mark.slow
@pytest.mark.parametrize("damping", [0.02, 1e-4])
@pytest.mark.parametrize("bandwidth", [4.0, 4.5, 4.8])
def test_slopes(bandwidth, damping):
    """By the bandwidth, also where it is whole and half whole, and by stiffness and damping."""

    def variance(stiffness, damping, bandwidth):
        return seen(stiffness, damping, bandwidth, widest=6.0)[0][0, 0, 0]

    at = (3.3**2, damping, bandwidth)
    found = jax.grad(variance, (0, 1, 2))(*map(jnp.asarray, at))
    whole = expected(*at, lambda _: 1.0)
    edge = abs(at[0] - bandwidth**2 + 1j * at[1] * bandwidth) ** -2
    # d/db of the integral over b.
    assert float(found[2]) == pytest.approx((edge - whole) / bandwidth, rel=1e-5)
    by_both = differences(
        lambda both: expected(*both.tolist(), bandwidth, lambda _: 1.0),
        at[:2],
        1e-4 * np.array(at[:2]),
    )
    # Central differences over 1e-4: a hundredth of the resonance's width, squared.
    np.testing.assert_allclose(found[:2], by_both, rtol=1e-3)

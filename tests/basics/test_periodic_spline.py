"""The periodic spline against SciPy's, and its slopes."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.test_util import check_grads
from scipy.interpolate import CubicSpline

from jaxcrusher.basics.periodic_spline import TURN, series_of, spline_through

# Unevenly spaced and in disorder; the first angle is not zero.
ANGLES = np.array([0.4, 5.9, 1.1, 1.3, 2.9, 4.4, 3.0])
VALUES = np.array([1.0, -0.3, 2.0, 2.5, -1.0, 0.2, 0.9])
ANYWHERE = np.concatenate([np.linspace(-10, 10, 201), ANGLES, ANGLES - TURN, [0.0, TURN]])


def by_scipy():
    order = np.argsort(ANGLES)
    at, values = ANGLES[order], VALUES[order]
    closed = np.append(at, at[0] + TURN), np.append(values, values[0])
    return CubicSpline(*closed, bc_type="periodic")


@pytest.mark.parametrize("order", [0, 1, 2])
def test_value_and_derivatives_are_scipy_s(order):
    """At the points themselves and at the turn's end too, where intervals meet."""
    spline = found = spline_through(jnp.asarray(ANGLES), jnp.asarray(VALUES))
    for _ in range(order):
        found = jax.grad(found)
    # Rounding of the system's solution: second derivatives are of the order of 100.
    np.testing.assert_allclose(
        jax.vmap(found)(jnp.asarray(ANYWHERE)), by_scipy()(ANYWHERE, order), rtol=0, atol=1e-11
    )
    assert spline.start.shape == (len(ANGLES),)


def test_slopes_by_the_points():
    """By values and by angles, against central differences."""

    def at(angles, values):
        return spline_through(jnp.asarray(angles), jnp.asarray(values))(jnp.asarray(2.0))

    given = jnp.asarray(ANGLES), jnp.asarray(VALUES)
    # Differences over 1e-5 of a curve with third derivatives of 1e5 are right to 1e-5.
    check_grads(at, given, 1, atol=1e-5, rtol=1e-5)


def test_a_sine_is_met_to_fourth_order():
    """De Boor's bound for a complete spline: 5/384 h^4 of the fourth derivative."""
    for count in (12, 24):
        angles = jnp.arange(float(count)) * TURN / count
        spline = spline_through(angles, jnp.sin(angles))
        apart = jax.vmap(spline)(jnp.asarray(ANYWHERE)) - np.sin(ANYWHERE)
        assert 0 < np.abs(apart).max() < 5 / 384 * (TURN / count) ** 4 * 1.01


def test_the_series_of_a_spline():
    """Orders that the points resolve are met; slopes by the points are those of the spline."""
    angles = jnp.arange(360.0) * TURN / 360

    def wave(at):
        return 3 + 2 * np.cos(at - 0.5) + np.sin(3 * at) + 0.5 * np.cos(11 * at)

    spline = spline_through(angles, jnp.asarray(wave(np.asarray(angles))))
    series = series_of(spline, 48)
    # De Boor's bound of the spline itself, of the order 11; aliases of it, 349 and more, are left.
    bound = 5 / 384 * (TURN / 360) ** 4 * (2 + 3**4 + 0.5 * 11**4)
    apart = jax.vmap(series)(jnp.asarray(ANYWHERE)) - wave(ANYWHERE)
    assert 0 < np.abs(apart).max() < bound
    # The mean and the sine of order 1 of a kernel of one point are exactly those of its values.
    slope = jax.jacobian(lambda y: series_of(spline_through(angles, y), 2).sines)(jnp.ones(360))
    np.testing.assert_allclose(slope[1], np.sin(angles) / 180, rtol=0, atol=1e-9)

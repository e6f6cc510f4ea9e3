"""Smoothed corners: exact outside their width, smooth inside, sharp in the limit."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxcrusher.basics import smooth
from jaxcrusher.basics.plane import Vector

WIDTH = 1e-3
OUTSIDE = np.array([-2.0, -0.01, -1.001e-3, 1.001e-3, 0.01, 2.0])


def test_positive_part_is_exact_outside_and_right_inside():
    value = smooth.positive_part(jnp.asarray(OUTSIDE), WIDTH)
    # Rounding of x - width + width.
    np.testing.assert_allclose(value, np.maximum(OUTSIDE, 0), rtol=1e-14, atol=1e-18)
    assert float(smooth.positive_part(jnp.array(0.0), WIDTH)) == pytest.approx(WIDTH / 4, rel=1e-14)
    inside = jnp.linspace(-WIDTH, WIDTH, 1001)
    error = smooth.positive_part(inside, WIDTH) - jnp.maximum(inside, 0)
    assert 0 <= float(error.min()) and float(error.max()) <= WIDTH / 4 * (1 + 1e-12)


def test_step_runs_from_zero_to_one():
    value = np.asarray(smooth.step(jnp.linspace(-2 * WIDTH, 2 * WIDTH, 101), WIDTH))
    assert value[0] == 0 and value[-1] == 1 and value[50] == pytest.approx(0.5, abs=1e-15)
    assert (np.diff(value) >= 0).all()


@pytest.mark.parametrize("x", [-2e-3, -5e-4, 0.0, 3e-4, 2e-3, 0.1])
def test_integral_is_the_antiderivative(x):
    slope = jax.grad(smooth.positive_power_integral)(jnp.array(x), WIDTH, 1.5)
    value = smooth.positive_power(jnp.array(x), WIDTH, 1.5)
    # Closed forms on both sides: rounding only.
    assert float(slope) == pytest.approx(float(value), rel=1e-12, abs=1e-18)


@pytest.mark.parametrize("function", [smooth.positive_part, smooth.step])
@pytest.mark.parametrize("x", [-1e-3, 0.0, 1e-3])
def test_derivatives_are_finite(function, x):
    assert jnp.isfinite(jax.grad(function)(x, WIDTH))
    assert jnp.isfinite(jax.grad(jax.grad(smooth.positive_power))(x, WIDTH, 1.5))


def test_norm_at_zero():
    zero = Vector(0.0, 0.0)
    value, slope = jax.value_and_grad(smooth.norm)(zero, 1e-9)
    assert float(value) == 1e-9 and float(slope.x) == 0 and float(slope.y) == 0
    # width^2 / (2 |v|) = 1e-16 of 5
    assert float(smooth.norm(Vector(3.0, -4.0), 1e-9)) == pytest.approx(5, rel=1e-15)


def test_what_is_not_a_number_remains_so():
    """A force of zero would stand for a penetration or a width outside of its limits."""
    for function in (smooth.positive_power, smooth.positive_power_integral):
        for x, width, exponent in ((np.nan, 0.1, 1.5), (0.3, np.nan, 1.5), (0.3, 0.1, np.nan)):
            assert np.isnan(function(jnp.asarray(x), jnp.asarray(width), exponent))

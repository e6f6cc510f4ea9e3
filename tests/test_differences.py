"""What `assert_slopes` accepts and what it refuses."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tests.differences import assert_slopes, differences

AT = np.array([0.3, -0.7])


def bent(x):
    return jnp.stack([jnp.sin(x[0]) * x[1], jnp.exp(x[1]), x[0] ** 3])


@pytest.mark.parametrize("order", [2, 4])
def test_differences_have_their_order(order):
    """Half of the steps leaves a fourth or a sixteenth of the error."""
    steps, exact = np.array([0.1, 0.2]), np.asarray(jax.jacfwd(bent)(AT))
    errors = [np.abs(differences(bent, AT, k * steps, order) - exact).max() for k in (1, 0.5)]
    # The next order of the error is some hundredths of it.
    assert errors[0] / errors[1] == pytest.approx(2**order, rel=0.05)


def sloped(factor):
    """The sine, whose derivative is wrong by a factor."""
    sine = jax.custom_jvp(jnp.sin)
    sine.defjvp(lambda x, way: (jnp.sin(x[0]), factor * jnp.cos(x[0]) * way[0]))
    return sine


@pytest.mark.parametrize("by", [jax.jacfwd, jax.jacrev])
def test_slopes_that_are_wrong_fail(by):
    # Of the square of a step of 1e-4, and rounding over it.
    how = dict(step=1e-4, rtol=1e-6, by=by)
    assert assert_slopes(bent, AT, atol=1e-9, **how).shape == (3, 2)
    assert assert_slopes(sloped(1.0), 0.3, **how) == pytest.approx(np.cos(0.3), rel=1e-15)
    for wrong in (
        *map(sloped, (1 + 2e-6, -1.0, np.nan)),
        lambda x: np.nan * x,
        lambda x: 0.0 * x,  # nothing moves it
        lambda x: jnp.stack([jnp.sin(x), sloped(1.001)(x)]),
    ):
        with pytest.raises(AssertionError):
            assert_slopes(wrong, 0.3, **how)

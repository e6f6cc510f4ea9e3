"""What `assert_slopes` accepts and what it refuses."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tests.differences import assert_slopes, differences

AT = [0.3, -0.7]


def bent(x):
    return jnp.stack([jnp.sin(x[0]) * x[1], jnp.exp(x[1]), x[0] ** 3])


@pytest.mark.parametrize("order", [2, 4])
def test_differences_have_their_order(order):
    """Half the step leaves a fourth or a sixteenth of the error; a row's step may be each one's."""
    exact = np.asarray(jax.jacfwd(bent)(jnp.array(AT)))
    first, second = (
        np.abs(differences(bent, AT, size * np.array([0.1, 0.2]), order) - exact).max()
        for size in (1, 0.5)
    )
    # The next order of the error is some hundredths of it.
    assert first / second == pytest.approx(2**order, rel=0.05)


@pytest.mark.parametrize("by", [jax.jacfwd, jax.jacrev])
def test_slopes_that_are_right_pass(by):
    # A third of the step's square, and rounding over the step.
    assert assert_slopes(bent, AT, 1e-4, rtol=1e-7, atol=1e-8, by=by).shape == (3, 2)
    assert assert_slopes(jnp.sin, 0.3, 1e-4, rtol=1e-8) == pytest.approx(np.cos(0.3), rel=1e-15)


def sloped(factor):
    """The sine, whose derivative is wrong by a factor."""
    sine = jax.custom_jvp(jnp.sin)
    sine.defjvp(lambda x, way: (jnp.sin(x[0]), factor * jnp.cos(x[0]) * way[0]))
    return sine


@pytest.mark.parametrize(
    "function",
    [
        sloped(1 + 2e-6),
        sloped(-1.0),
        sloped(jnp.nan),
        lambda x: jnp.nan * x,
        lambda x: 0.0 * x,
        lambda x: sloped(1.001)(x) * jnp.array([1.0, 0.0]),
    ],
)
def test_slopes_that_are_wrong_fail(function):
    with pytest.raises(AssertionError):
        assert_slopes(function, 0.3, 1e-4, rtol=1e-6)


def test_one_wrong_number_of_many_fails():
    def function(x):
        return jnp.stack([sloped(1.0)(x[0]), x[0] * sloped(0.999)(x[1])])

    with pytest.raises(AssertionError, match="Mismatched elements: 1 / 4"):
        assert_slopes(function, AT, 1e-4, rtol=1e-6)

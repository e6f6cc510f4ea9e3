"""Newton's method: one damping, driven by JAX and from the host."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxcrusher.periodic.newton import newton, newton_on_host


def bent(point):
    """Plain Newton leaps past the zero (1, 2) from a distance of more than 1.39."""
    apart = point - jnp.array([1.0, 2.0])
    return jnp.arctan(apart + 0.3 * apart[::-1])


def by_jax(residual, guess, tolerance=1e-10, steps=60):
    return newton(lambda x: (residual(x), jax.jacfwd(residual)(x)), guess, tolerance, steps)


def from_host(residual, guess, tolerance=1e-10, steps=60, **more):
    def evaluated(x):
        seen.append(x)
        return np.asarray(residual(x)), np.asarray(jax.jacfwd(residual)(x)), len(seen)

    seen = []
    return newton_on_host(evaluated, np.asarray(guess), tolerance, steps, **more)


@pytest.mark.parametrize("guess", [[1.1, 2.1], [3.0, 0.0], [-3.0, 5.0]])
def test_both_drivers_come_to_the_zero(guess):
    """Were any step accepted, the last two would take 14 and 12 from the host."""
    one, other = by_jax(bent, jnp.array(guess)), from_host(bent, guess)
    assert one.success and other is not None
    # Both end with a step of less than 1e-10, taken.
    np.testing.assert_allclose(one.point, [1.0, 2.0], atol=1e-12)
    np.testing.assert_allclose(other.point, [1.0, 2.0], atol=1e-12)
    assert other.steps < 10
    # What was kept is of the last evaluation.
    assert other.seen == other.steps


def test_both_drivers_give_up():
    """Where there is no zero, where the field is not finite, and within few steps."""
    nowhere = lambda x: 1 + x**2  # noqa: E731
    undefined = lambda x: jnp.sqrt(x)  # noqa: E731
    for residual, guess, steps in ((nowhere, 1.0, 60), (undefined, -1.0, 60), (bent, 6.0, 2)):
        at = jnp.full(2, guess)
        assert not by_jax(residual, at, steps=steps).success
        assert from_host(residual, at, steps=steps) is None


def test_noise_of_the_residual_ends_it():
    """Where the residual is known to 1e-9 and its slope is 1e-4, a step is never shorter than 1e-6.

    The place is known to noise / slope; told what the noise is, the method stops there.
    """
    draws = np.random.default_rng(0)

    def noisy(x):
        return np.arctan(1e-4 * (x - 2)) + 1e-9 * draws.uniform(0.2, 1, x.shape)

    def evaluated(x):
        return noisy(x), 1e-4 * np.eye(len(x)), None

    guess, tolerance, steps = np.zeros(2), 1e-7, 20
    assert newton_on_host(evaluated, guess, tolerance, steps) is None
    found = newton_on_host(evaluated, guess, tolerance, steps, 1e-9)
    assert found is not None
    np.testing.assert_allclose(found.point, [2.0, 2.0], atol=2 * 1e-9 / 1e-4)

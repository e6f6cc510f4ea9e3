"""Newton's method: one iteration, driven by JAX and between programs."""

from types import SimpleNamespace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxcrusher.periodic.newton import RESULTS, advanced, first_iterate, newton
from jaxcrusher.periodic.problem import MOST_CORRECTIONS
from jaxcrusher.periodic.shooting_problem import LEAST_SHARE, NOISE
from tests.periodic.maps import of_map


def bent(point):
    """Plain Newton leaps past the zero (1, 2) from a distance of more than 1.39."""
    apart = point - jnp.array([1.0, 2.0])
    return jnp.arctan(apart + 0.3 * apart[::-1])


def both(residual):
    """Return the equations, with their Jacobian."""
    return lambda x: (residual(x), jax.jacfwd(residual)(x))


def by_jax(residual, guess, tolerance=1e-10, steps=60):
    return newton(both(residual), jnp.asarray(guess), tolerance, steps)


def by_problem(linearised, guess):
    """Return what a problem that calls several programs makes of equations, and each look."""

    def looked(x):
        looks.append(x)
        return *linearised(x), len(looks)

    looks = []
    equations = SimpleNamespace(guess=jnp.asarray(guess), residual_and_jacobian=looked)
    return of_map(None).find_zero(equations), looks


@pytest.mark.parametrize("guess", [[1.1, 2.1], [3.0, 0.0], [-3.0, 5.0]])
def test_it_comes_to_the_zero(guess):
    """Were any step accepted, the last two would take 14 and 12."""
    found = by_jax(bent, guess)
    assert found.success and found.steps < 10
    # It ends with a step of less than 1e-10, taken.
    np.testing.assert_allclose(found.point, [1.0, 2.0], atol=1e-12)


@pytest.mark.parametrize("guess", [[1.1, 2.1], [2.4, 0.9]])
@pytest.mark.usefixtures("unchecked")  # equations of no branch
def test_a_problem_comes_to_the_same_zero(guess):
    found, looks = by_problem(both(bent), guess)
    # It ends with a step of less than 1e-7, taken, which squares what is left.
    np.testing.assert_allclose(found.unknowns, [1.0, 2.0], atol=1e-12)
    # What was kept is of the last look.
    assert found.seen == len(looks)
    np.testing.assert_array_equal(found.jacobian, jax.jacfwd(bent)(looks[-1]))


@pytest.mark.usefixtures("unchecked")
def test_it_gives_up():
    """Where there is no zero, where the field is not finite, and within few steps."""
    nowhere = lambda x: 1 + x**2  # noqa: E731
    undefined = lambda x: jnp.sqrt(x)  # noqa: E731
    cases = (
        (nowhere, 1.0, 60, RESULTS.no_descent),
        (undefined, -1.0, 60, RESULTS.not_finite),
        (bent, 6.0, 2, RESULTS.too_many_steps),
    )
    for residual, guess, steps, why in cases:
        at = jnp.full(2, guess)
        assert by_jax(residual, at, steps=steps).result == why
        found, looks = by_problem(both(residual), at)
        assert found is None and len(looks) <= MOST_CORRECTIONS


@pytest.mark.usefixtures("unchecked")
def test_a_problem_tries_no_step_below_a_tenth():
    """From 3 off the zero of arctan 10 x a step leads 138 far, of which a fiftieth helps."""
    steep = lambda x: jnp.arctan(10 * x)  # noqa: E731
    assert by_jax(steep, [3.0, 3.0]).success
    found, looks = by_problem(both(steep), [3.0, 3.0])
    assert found is None
    # The whole step, and at most three halves of it.
    assert len(looks) <= 1 + 1 + 3


def test_the_last_step_is_taken():
    """From 0.1 off, Newton's step leaves 1e-3, and a further one with its Jacobian 2e-2 of that."""
    found = by_jax(bent, [1.1, 2.1], tolerance=2e-3)
    assert found.success and found.steps == 1
    np.testing.assert_allclose(found.point, [1.0, 2.0], atol=4e-5)


def test_a_guess_that_is_a_zero_is_looked_at_once():
    """Its own step is at most the tolerance, and no second look is needed."""
    guess = jnp.array([1.0, 2.0 + 1e-9])
    now = advanced(first_iterate(guess), *both(bent)(guess), 1e-7, 60)
    assert now.done and now.success and now.steps == 1
    # A step squares what is left.
    np.testing.assert_allclose(now.point, [1.0, 2.0], atol=1e-15)


def test_a_quiet_residual_ends_it_with_a_whole_step():
    """Where neither the step has become shorter nor its Jacobian told the next one."""
    slopes, looks = 1e-4 * np.eye(2), ((1.1e-9, 1.0), (0.95e-9, 0.1))
    now = first_iterate(jnp.zeros(2))
    for left, share in looks:
        assert not now.done
        now = advanced(now, np.full(2, left), share * slopes, 1e-7, 20, 1e-9, LEAST_SHARE)
    assert now.done and now.success
    np.testing.assert_allclose(now.point, -1.1e-5 - 9.5e-5, rtol=1e-12)  # rounding


@pytest.mark.usefixtures("unchecked")
def test_noise_of_the_residual_ends_it():
    """Where the residual is known to 1e-9 and its slope is 1e-4, a step is never shorter than 1e-6.

    The place is known to noise / slope; told what the noise is, the method stops there.
    """
    draws = np.random.default_rng(0)

    def noisy(x):
        left = np.arctan(1e-4 * (np.asarray(x) - 2)) + NOISE * draws.uniform(0.2, 0.9, np.shape(x))
        return left, 1e-4 * np.eye(2)

    quiet, _ = by_problem(noisy, np.zeros(2))
    np.testing.assert_allclose(quiet.unknowns, [2.0, 2.0], atol=2 * NOISE / 1e-4)
    # Summarised of no noise, it looks on until its steps are used up or seem to lead nowhere.
    now = first_iterate(jnp.zeros(2))
    while not now.done:
        now = advanced(now, *noisy(now.point), 1e-7, 20, 0.0, LEAST_SHARE)
    assert not now.success

"""Shadowing where it is right, where it is precise and wrong, and that a fit catches it."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxcrusher.dynamics.fits import fit_slopes
from jaxcrusher.dynamics.judgement import judge
from jaxcrusher.dynamics.shadowing import shadowing_slopes, shadowing_tangent
from tests.dynamics.systems import henon

PEAK = 0.3


def derivatives(step, observe, start, parameter, count, settle=100):
    """Of `count` steps of a map x -> step(x, p): points, J, f, dm/dx and dm/dp."""

    def one(x, _):
        jacobian, forcing = jax.jacfwd(step, argnums=(0, 1))(x, parameter)
        by_state, by_parameter = jax.grad(observe, argnums=(0, 1))(x, parameter)
        return step(x, parameter), (x, jacobian, forcing[:, None], by_state, by_parameter[None])

    x, _ = jax.lax.scan(one, jnp.asarray(start), length=settle)
    return [np.asarray(part) for part in jax.lax.scan(one, x, length=count)[1]]


def scaled_henon(x, size):
    return size * henon(x / size)


def tent(x, peak):
    """The skew tent map: for every peak it leaves the uniform density on [0, 1] as it is."""
    return jnp.where(x < peak, x / peak, (1 - x) / (1 - peak))


@pytest.mark.parametrize("unstable", [1, 2])
def test_scaled_henon_map(unstable):
    """All points grow with `size`: the tangent is x / size, and the mean of x grows with it."""
    points, *parts = derivatives(scaled_henon, lambda x, size: x[0], [0.2, 0.2], 2.0, 3000)
    tangent = shadowing_tangent(*parts[:2], unstable)[..., 0]
    # Least squares bend the ends, over the 20 steps or so that a growth of 1.5 a step needs.
    np.testing.assert_allclose(tangent[200:-200], points[200:-200] / 2, atol=1e-6)
    slope, error = shadowing_slopes(*parts, unstable=unstable)
    assert slope[0] == pytest.approx(points[300:-300, 0].mean() / 2, rel=1e-6)
    assert 0 < error[0] < 0.01


def tent_shadowing():
    parts = derivatives(tent, lambda x, peak: x[0] * peak, [0.2345], PEAK, 20_000)[1:]
    return shadowing_slopes(*parts)


def tent_fit():
    """Fits to means over 2000 steps at two radii: of c x, whose mean is c / 2."""

    @jax.jit
    def mean(case):
        peak = case["point"][0]
        start = 0.2345 + case["shift"][0]
        step = lambda x, _: (tent(x, peak), x)  # noqa: E731
        points = jax.lax.scan(step, start, length=2000)[1]
        return peak * jnp.stack([jnp.mean(points), jnp.mean(points[:1000])])

    return [
        fit_slopes(mean, np.array([PEAK]), np.array([r]), 64, 0, shift=0.1) for r in (0.1, 0.05)
    ]


def test_shadowing_of_the_skew_tent_map_is_precise_and_wrong():
    """V = <v> from v(T x) = T' v(x) + dT/dc: V = (2 c - 1) V + 1 / 2, so V = 1 / (4 (1 - c))."""
    (slope,), (error,) = tent_shadowing()
    exact = 1 / 2 + PEAK / (4 * (1 - PEAK))
    assert abs(slope - exact) < 4 * error
    assert error < 0.02 * slope and abs(slope - 1 / 2) > 10 * error


def test_shadowing_that_is_precise_and_wrong_is_caught():
    fit, half = tent_fit()
    estimates = {
        "fit": (fit.slopes[0], fit.errors[0]),
        "fit at half the radius": (half.slopes[0], half.errors[0]),
        "shadowing": tuple(part[0] for part in tent_shadowing()),
    }
    found = judge("peak", estimates, chaotic=True, radius=0.1, growth=100.0)
    assert found.estimator == "fit" and abs(found.value - 1 / 2) < 4 * found.standard_error
    assert found.verdict == "doubtful" and "shadowing" in found.reasons[0], found

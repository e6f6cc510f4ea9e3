"""Orbits and multipliers of systems with published numbers, through the general interface."""

import re

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from jaxcrusher.periodic.collocation import collocate
from jaxcrusher.periodic.multipliers import STEPS, matrix_error, multipliers
from jaxcrusher.periodic.newton import RESULTS
from jaxcrusher.periodic.system import System
from jaxcrusher.periodic.trigonometric import differentiation, evaluate, nodes, resample
from tests.differences import differences
from tests.periodic.systems import duffing


def duffing_system(numbers, speed):
    args = tuple(jnp.asarray(number) for number in (*numbers, speed))
    return System(duffing, 2 * jnp.pi / args[3], args)


def harmonic(amplitude, phase, count=32):
    return amplitude * np.cos(2 * np.pi * nodes(count) - phase)[:, None]


def mathieu(time, x, rate, args):
    a, b, c = args
    return -c * rate - (a + b * jnp.cos(time)) * x


@pytest.mark.parametrize(
    ("numbers", "expected"),
    [
        # Nayfeh and Mook's notation x'' + c x' + (a + b cos t) x = 0.
        ((4.0, 0.2, 0.005), (0.98441258069 + 0.002072989j, 0.98441258069 - 0.002072989j)),
        ((1.0, 0.4, 0.0), (1.097993507268, 0.910752197878)),
    ],
)
def test_multipliers_of_mathieus_equation(numbers, expected):
    system = System(mathieu, jnp.asarray(2 * np.pi), jnp.array(numbers))
    found = multipliers(system, jnp.zeros((8, 1)), steps=64)
    order = np.argsort(np.asarray(found.values))[::-1]
    # As many digits as are known of them; a root near a double one loses half of its own.
    np.testing.assert_allclose(np.asarray(found.values)[order], expected, atol=2e-9)
    # Liouville: the determinant is that of the damping alone.
    damped = np.exp(-2 * np.pi * numbers[2])
    np.testing.assert_allclose(np.linalg.det(found.monodromy), damped, rtol=1e-10)
    assert found.error < 1e-9


@pytest.mark.parametrize(("rate", "left"), [(20.0, 2.6e-55), (300.0, 0.0)])
def test_what_dies_before_a_period_ends_has_known_multipliers(rate, left):
    """A critical damping leaves exp(-2 pi rate) of a disturbance: of no digit, but surely little.

    Its double root, of which rounding moves half of the digits, is known to a factor.
    """
    system = System(mathieu, jnp.asarray(2 * np.pi), jnp.array([rate**2, 0.0, 2 * rate]))
    found = multipliers(system, jnp.zeros((8, 1)))
    assert found.largest == pytest.approx(left, rel=0.5, abs=1e-300)
    assert found.error < 1e-50


def test_a_damping_of_many_times_a_step_has_known_multipliers():
    """As a thin film has: x'' = -k x' - x, of which the slow root is -1 / k and nearly alone."""
    damping = 3e5
    system = System(mathieu, jnp.asarray(2 * np.pi), jnp.array([1.0, 0.0, damping]))
    found = multipliers(system, jnp.zeros((8, 1)), steps=64 * STEPS)
    slow = 2 / (damping + np.sqrt(damping**2 - 4))
    # 65 536 products, of which each moves the last digit.
    assert float(1 - found.largest) == pytest.approx(2 * np.pi * slow, abs=1e-9)
    assert found.error < 1e-9


@pytest.mark.parametrize(
    ("square", "left", "error"),
    [
        # A complex pair's modulus is the root of the determinant, which `left` changes by itself.
        (-1e-6, 1e-9, 0.5e-9),
        # A pair that may be real within the error: it parts by the root of 1e-9, one way alone.
        (-1e-9, 2e-9, 1e-9**0.5),
        (-1e-9, -2e-9, 1e-9**0.5),
        (1e-6, 1e-9, 0.5e-6),  # a real one: sqrt(1e-6 + 1e-9) - 1e-3
    ],
)
def test_the_error_of_multipliers_is_that_of_their_moduli(square, left, error):
    """Of 0.9 +- sqrt(square), by a companion matrix whose lower corner has an error `left`."""
    matrix = jnp.array([[0.9, 1.0], [square, 0.9]])
    found = matrix_error(matrix, jnp.array([[0.0, 0.0], [left, 0.0]]))
    # To first order in left / (2 * 0.9), and at least that of the matrix.
    assert float(found) == pytest.approx(max(abs(left), error), rel=0.2)


def test_nothing_is_known_of_a_matrix_that_overflows():
    assert np.isinf(matrix_error(jnp.eye(2), jnp.full((2, 2), jnp.nan)))


def test_magnus_is_of_sixth_order():
    """Twice the steps leave a 64th of the error."""
    system = System(mathieu, jnp.asarray(2 * np.pi), jnp.array([4.0, 2.0, 0.1]))
    exact = multipliers(system, jnp.zeros((8, 1)), steps=512).monodromy
    errors = [
        float(jnp.max(jnp.abs(multipliers(system, jnp.zeros((8, 1)), n).monodromy - exact)))
        for n in (16, 32, 64)
    ]
    orders = np.log2(errors[:-1]) - np.log2(errors[1:])
    # Between 5 and 7 is sixth order before its limit.
    assert ((orders > 5.5) & (orders < 6.8)).all(), orders


def test_peak_of_duffings_equation():
    """The largest first harmonic over speeds: .35813144 at 1.04678198; x'' less f is its slope."""

    def first(speed):
        system = duffing_system((0.04, 1.0, 0.015), speed)
        x, _ = collocate(system, harmonic(0.358, np.pi / 2))
        basis = np.exp(-2j * np.pi * nodes(len(x))) * 2 / len(x)
        return jnp.abs(basis @ x[:, 0].astype(complex))

    value, slope = jax.jit(jax.value_and_grad(first))(1.04678198)
    np.testing.assert_allclose(value, 0.35813144, atol=1e-8)
    # The speed of the peak has nine digits, and the peak bends by some 500 a unit of speed.
    assert abs(slope) < 1e-5
    assert abs(jax.jit(jax.grad(first))(1.0465)) > 0.01


def hertz(time, q, rate, args):
    static, speed = args
    depth = jnp.maximum(1 + 2 * q / 3, 0)
    return 1 + static * jnp.cos(speed * time) - depth**1.5 * (1 + 0.04 * rate)


def test_hertz_oscillator_in_contact():
    """State, force and multipliers of q'' = 1 + .2 cos .8 t - F, F = d^1.5 (1 + .04 q')."""
    system = System(hertz, jnp.asarray(2 * np.pi / 0.8), (jnp.asarray(0.2), jnp.asarray(0.8)))
    x, root = collocate(system, harmonic(0.55, 0.0, 64))
    assert root.success
    rate = 0.8 * evaluate(x, jnp.array(0.0), 1)
    # The published digits.
    np.testing.assert_allclose([x[0, 0], rate[0]], [0.5586701924, 0.0407731785], atol=2e-10)
    _, q, p = system.at(x, 256)
    force = (1 + 2 * q / 3) ** 1.5 * (1 + 0.04 * p)
    np.testing.assert_allclose(jnp.sqrt(jnp.mean(force**2)), 1.077273253163, atol=2e-12)
    found = multipliers(system, x)
    upper = found.values[np.argmax(found.values.imag)]
    np.testing.assert_allclose(upper, 0.0850594 + 0.8503926j, atol=1e-7)


def test_hertz_oscillator_that_loses_contact():
    """Kinks make the nodes converge slowly: 512 of them leave 1e-6, and 1e-4 of multipliers."""
    speed, count = 0.95, 512
    period = 2 * np.pi / speed
    system = System(hertz, jnp.asarray(period), (jnp.asarray(0.1), jnp.asarray(speed)))

    published = [-1.5344323726, 0.7323671728]
    run = solve_ivp(
        lambda t, y: [y[1], hertz_by_hand(t, *y, 0.1, speed)],
        (0, period),
        published,
        rtol=1e-9,
        atol=1e-9,
        t_eval=period * nodes(count),
    )
    x, root = collocate(system, jnp.asarray(0.99 * run.y[:1].T))
    assert root.success
    rate = speed * evaluate(x, jnp.array(0.0), 1)
    np.testing.assert_allclose([x[0, 0], rate[0]], published, atol=2e-6)
    _, q, p = system.at(x, 4096)
    force = jnp.maximum(1 + 2 * q / 3, 0) ** 1.5 * (1 + 0.04 * p)
    assert jnp.mean(force == 0) > 0.1
    np.testing.assert_allclose(jnp.sqrt(jnp.mean(force**2)), 1.414677350780, atol=1e-7)
    found = multipliers(system, x)
    upper = found.values[np.argmax(found.values.imag)]
    np.testing.assert_allclose(upper, 0.7437809 + 0.4629657j, atol=1e-4)


def hertz_by_hand(time, q, rate, static, speed):
    return 1 + static * np.cos(speed * time) - max(1 + 2 * q / 3, 0) ** 1.5 * (1 + 0.04 * rate)


def test_slopes_forward_reverse_and_by_differences():
    """The implicit slope of an orbit, and the slope of that."""

    def size(numbers):
        system = duffing_system(numbers[:3], numbers[3])
        x, _ = collocate(system, harmonic(0.1, 0.0, 16))
        return jnp.mean(x**2)

    at = jnp.array([0.1, 0.5, 0.3, 0.6])
    reverse, forward = jax.jit(jax.grad(size))(at), jax.jit(jax.jacfwd(size))(at)
    np.testing.assert_allclose(reverse, forward, rtol=1e-11)
    # A central difference errs by step^2 third derivatives, and rounding over step.
    expected = differences(jax.jit(size), at, 1e-5)
    np.testing.assert_allclose(reverse, expected, rtol=1e-7, atol=1e-9)
    second = jax.jit(jax.hessian(size))(at)
    np.testing.assert_allclose(second, second.T, rtol=1e-9, atol=1e-12)
    moved = differences(jax.jit(jax.grad(size)), at, 1e-5)
    np.testing.assert_allclose(second, moved, rtol=1e-6, atol=1e-7)


def test_side_by_side():
    """A row of speeds under vmap: the same as one by one."""

    def steps(speed):
        x, root = collocate(duffing_system((0.1, 0.5, 0.3), speed), harmonic(0.1, 0.0, 16))
        return x, root.steps

    speeds = jnp.array([0.3, 0.5, 0.7])
    x, count = jax.jit(jax.vmap(steps))(speeds)
    for i, speed in enumerate(speeds):
        alone, steps_alone = jax.jit(steps)(speed)
        # Rounding of another order of sums.
        np.testing.assert_allclose(x[i], alone, atol=1e-12)
        assert count[i] == steps_alone


def test_failures_have_reasons():
    """No orbit at all, a field that is not finite, too few steps: never a number."""
    period = jnp.asarray(2 * np.pi)
    # x'' = 1 + x^2 + cos t: the mean of the right-hand side is positive for every x.
    nowhere = System(lambda t, x, v, a: 1 + x**2 + jnp.cos(t), period, None)
    x, root = collocate(nowhere, jnp.zeros((16, 1)))
    assert root.result in (RESULTS.no_descent, RESULTS.too_many_steps)
    assert np.isnan(x).all()
    undefined = System(lambda t, x, v, a: jnp.sqrt(x), period, None)
    none = collocate(undefined, -jnp.ones((16, 1)))[1]
    assert none.result == RESULTS.not_finite
    assert none.failure == "The equations are not finite at the guess." and not root.success
    system = duffing_system((0.1, 0.5, 0.3), 0.6)
    short = collocate(system, harmonic(5.0, 0.0, 16), max_steps=2)[1]
    assert short.result == RESULTS.too_many_steps


@pytest.mark.parametrize(
    ("shape", "words"),
    [
        ((33, 1), "`nodes` must be an even number > 0, but is 33."),
        ((32,), "`guess` must have shape (nodes, dims), but is (32,)."),
    ],
)
def test_a_guess_that_nothing_is_known_of_is_refused(shape, words):
    """An odd number of nodes has other matrices: by these its orbit would be another one."""
    system = duffing_system((0.04, 1.0, 0.3), 1.0)
    with pytest.raises(ValueError, match=re.escape(words)):
        collocate(system, np.zeros(shape))


def test_the_jacobian_is_that_of_the_residual():
    """Block by block, against differentiating the whole residual; Newton then needs few steps."""
    system = System(hertz, jnp.asarray(2 * np.pi / 0.8), (jnp.asarray(0.2), jnp.asarray(0.8)))
    x = jnp.asarray(harmonic(0.55, 0.3, 8))
    left, jacobian = system.residual_and_jacobian(x)
    np.testing.assert_allclose(left, system.residual(x), atol=1e-12)
    np.testing.assert_allclose(jacobian, jax.jacfwd(system.residual)(x), atol=1e-12)
    assert collocate(system, harmonic(0.55, 0.0))[1].steps <= 4


def test_trigonometric_polynomials():
    """Derivatives and resampling of a polynomial known in full."""
    places = nodes(16)

    def wave(place, order=0):
        phase = 2 * np.pi * place
        return np.cos(phase + order * np.pi / 2) + 2 * 3**order * np.sin(
            3 * phase + order * np.pi / 2
        )

    for order, matrix in enumerate((np.eye(16), *differentiation(16))):
        np.testing.assert_allclose(matrix @ wave(places), wave(places, order), atol=1e-12)
        finer = resample(jnp.asarray(wave(places)), 50, 0.3, order)
        np.testing.assert_allclose(finer, wave((np.arange(50) + 0.3) / 50, order), atol=1e-12)
        one = evaluate(jnp.asarray(wave(places)), jnp.asarray(0.123), order)
        np.testing.assert_allclose(one, wave(0.123, order), atol=1e-12)
        # Six points have the third harmonic too, and of an odd number of points none stands alone.
        for fewer in (6, 7):
            there = resample(jnp.asarray(wave(places)), fewer, 0.3, order)
            expected = wave((np.arange(fewer) + 0.3) / fewer, order)
            np.testing.assert_allclose(there, expected, atol=1e-12)

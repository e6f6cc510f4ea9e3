"""Indicators against systems whose numbers are known, and the crusher's own section."""

import equinox as eqx
import numpy as np
import pytest

import jaxcrusher as jc
from jaxcrusher.basics.plane import scalar
from jaxcrusher.motion.flow import initial_state
from jaxcrusher.motion.indicators import (
    Lyapunov,
    detect_period,
    lyapunov_spectrum,
    spread_trend,
    verdict,
    zero_one_test,
)
from jaxcrusher.motion.section import poincare_section
from tests.differences import differences
from tests.dynamics.systems import flow, henon, iterate, logistic, lorenz


def test_linear_map():
    matrix = np.array([[0.5, 3.0, 0.1], [0.0, 1.3, -2.0], [0.0, 0.0, 0.9]])
    found = lyapunov_spectrum(np.broadcast_to(matrix, (2000, 3, 3)))
    # The frame aligns like (0.9 / 1.3)^n.
    np.testing.assert_allclose(found.exponents, np.log([1.3, 0.9, 0.5]), atol=1e-3)


@pytest.mark.parametrize(("exponent", "positive"), [(2.9, False), (3.1, True)])
def test_three_standard_errors_make_an_exponent_positive(exponent, positive):
    found = Lyapunov(np.array([exponent, -9.0]), np.array([1.0, 0.1]))
    assert found.positive is positive


def test_the_error_of_an_exponent_counts_the_periods_that_fill_no_batch():
    """Of 40 turns 36 are looked at, of which 20 are batches; their growth scatters by 1."""
    growth = np.random.default_rng(4).normal(size=(300, 40, 1, 1))
    found = [lyapunov_spectrum(np.exp(one)) for one in growth]
    error = np.sqrt(np.mean([one.errors[0] ** 2 for one in found]))
    assert error == pytest.approx(1 / 6, rel=0.05)
    assert np.std([one.exponents[0] for one in found]) == pytest.approx(1 / 6, rel=0.12)


def test_what_drifts_slowly_has_no_period():
    """A swing that turns by 0.01 rad a turn, and one that dies in a thousand turns."""
    angle = 0.01 * np.arange(1000)
    swing = 0.01 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    dying = 0.1 * np.exp(-np.arange(200) / 1000)[:, None]
    # What bifurcation allows.
    assert detect_period(swing, noise=2e-4) is None and detect_period(dying, noise=2e-4) is None
    jitter = np.random.default_rng(5).uniform(-1e-4, 1e-4, (1000, 2))
    both = [0.1, 0.2] * 500 + jitter.T
    assert detect_period(both.T, noise=2e-4) == 2


def test_henon():
    _, jacobians = iterate(henon, [0.1, 0.1], 20_000)
    found = lyapunov_spectrum(jacobians)
    assert found.exponents[0] == pytest.approx(0.419, rel=0.02)
    # The determinant is -0.3 everywhere: the sum is exact.
    assert found.exponents.sum() == pytest.approx(np.log(0.3), rel=1e-9)
    assert abs(found.exponents[0] - 0.4192) < 4 * found.errors[0] and found.positive


def test_logistic():
    points, slopes = iterate(logistic(4.0), [0.3], 20_000)
    found = lyapunov_spectrum(slopes)
    assert found.exponents[0] == pytest.approx(np.log(2), rel=0.02)
    assert zero_one_test(points[:2000, 0]) > 0.9
    assert detect_period(points, noise=1e-12) is None
    # r = 3.5 has period 4, r = 3.83 period 3; below 3 a fixed point.
    for r, period in ((2.9, 1), (3.5, 4), (3.83, 3)):
        points, slopes = iterate(logistic(r), [0.3], 1000, settle=2000)
        # A fixed point may flip between neighbouring floats.
        assert detect_period(points, noise=1e-12) == period
        assert zero_one_test(points[:, 0]) < 0.1
        assert not lyapunov_spectrum(slopes).positive


def test_lorenz():
    _, jacobians = iterate(flow(lorenz, 0.5, 28.0), [1.0, 1.0, 20.0], 2000, 50)
    found = lyapunov_spectrum(jacobians, slices=2)
    # 5 %, what ChaosTools.jl asks of chaotic flows; zero within its own error.
    assert found.exponents[0] == pytest.approx(0.9056, rel=0.05)
    assert abs(found.exponents[1]) < 0.02
    assert found.exponents[2] == pytest.approx(-14.57, rel=0.05)
    # The divergence is constant: -13.6667.
    assert found.exponents.sum() == pytest.approx(-41 / 3, rel=1e-5)


def test_zero_one_of_a_rotation():
    angle = 2 * np.pi * (np.sqrt(5) - 1) / 2 * np.arange(1500)
    assert zero_one_test(np.cos(angle)) < 0.1


@pytest.mark.slow
def test_section_of_the_quiet_motion():
    scene = jc.paper_scene(30.0, 0.06e-3, start="contact")
    start = initial_state(scene)
    sliced = poincare_section(scene, 0, 3, slices=4, state=start, rtol=1e-11)

    def turn(state, rtol):
        return np.asarray(poincare_section(scene, 0, 1, state=state, rtol=rtol).states[0])

    # The motion does not care where its turns are cut: 1e-11 a step, over some 5000 steps.
    state = start
    for cut in sliced.states:
        state = turn(state, 1e-11)
        np.testing.assert_allclose(cut, state, rtol=0, atol=1e-7)
    assert sliced.jacobians.shape == (12, 4, 4) and sliced.slices == 4
    one_turn = np.linalg.multi_dot(np.asarray(sliced.jacobians[:4])[::-1])
    expected = differences(lambda state: turn(state, 1e-12), start, 1e-6)
    # Differences of 2e-6 of numbers known to 1e-10.
    np.testing.assert_allclose(one_turn, expected, atol=2e-3)
    # Two swings that hardly damp. Without friction the map contracts volumes by damping alone.
    found = lyapunov_spectrum(sliced.jacobians, slices=4, discard=0, batches=3)
    assert found.exponents.sum() < 0


def test_section_of_a_failed_motion():
    scene = jc.paper_scene(30.0, 0.06e-3, start="contact")
    broken = eqx.tree_at(lambda s: s.linkage.gravity, scene, scalar(np.nan))
    # Counts that are compiled already.
    section = poincare_section(broken, 0, 3, slices=4, state=initial_state(scene))
    assert not section.outcome.success and np.isnan(section.states).all()
    assert detect_period(section.states) is None


def lyapunov(largest, error):
    return Lyapunov(np.array([largest, -1.0]), np.array([error, 0.1]))


@pytest.mark.parametrize(
    "exponents, zero_one, period, trending, name",
    [
        (lyapunov(2.0, 0.1), 0.99, None, False, "chaotic"),
        (lyapunov(2.0, 0.1), 0.1, None, False, "undecided"),
        (lyapunov(2.0, 0.1), 0.99, 3, False, "undecided"),
        (lyapunov(-0.5, 0.1), 0.0, 3, False, "periodic"),
        (lyapunov(0.001, 0.01), 0.0, None, False, "quasi-periodic"),
        (lyapunov(0.001, 0.01), 0.0, None, True, "not settled"),
        (lyapunov(0.001, 0.01), 0.9, None, False, "undecided"),
        (lyapunov(0.1, 0.5), 0.0, None, False, "undecided"),
    ],
)
def test_indicators_must_agree(exponents, zero_one, period, trending, name):
    agreed = dict(trending=trending, neutral=exponents.neutral)
    assert verdict(period, exponents.positive, zero_one, **agreed) == name


def test_trend_of_a_decaying_swing():
    rng = np.random.default_rng(0)
    steady = rng.normal(size=(1000, 2))
    assert not spread_trend(steady)[1]
    share, significant = spread_trend(steady * np.exp(-np.arange(1000) / 1000)[:, None])
    # The batches span nine tenths of the window; 1000 random points know it to a few percent.
    assert significant and share == pytest.approx(np.exp(-1) - 1, abs=0.1)
    assert spread_trend(np.ones((100, 2))) == (0.0, False)
    # Four coordinates that hold nothing but what the integration leaves change nothing.
    decaying, noise = steady * np.exp(-np.arange(1000) / 1000)[:, None], rng.uniform(size=(1000, 4))
    both = np.hstack([decaying, 1e-9 * noise])
    assert spread_trend(both, noise=2e-5) == spread_trend(decaying)

"""The decay of oscillations that are known by hand."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.stats import linregress

import jaxcrusher as jc
from jaxcrusher.orbits.transient import section_points
from optimize.answer import Decay, Orbit
from optimize.search import decay
from optimize.search.decay import PARTS, PHASE, TURNS, measured, unmeasurable
from optimize.tell import checks as verdicts

ANGLE = 1.04  # of the crusher's swing in a turn


def swinging(rate: float, angle: float = ANGLE) -> np.ndarray:
    """Points of an ellipse, 0.05 clearances long, whose size falls by `rate` a turn."""
    turn = np.arange(TURNS)
    size = 0.05 * (1 - rate) ** turn
    return size[:, None] * np.stack([np.cos(angle * turn), 0.3 * np.sin(angle * turn)], axis=1)


@pytest.mark.parametrize("rate", [2e-4, 4e-3])
def test_decay_of_a_swing(rate):
    """The phase leaves a part's average 1 / (60 turns x 2 sin(angle)) = 1 % off at most."""
    found = measured(swinging(rate), 0.0)
    assert abs(found.rate - rate) < 3 * found.error
    assert found.error < 0.01 / TURNS * 3
    assert found.first == pytest.approx(0.05 * np.sqrt(1.09 / 2 / 2) * np.exp(-30 * rate), rel=0.02)
    assert found.last < found.first


def test_the_multiplier_of_two_turns_is_told_by_the_turn():
    orbit = SimpleNamespace(solution=SimpleNamespace(largest_multiplier=0.81, period=2))
    assert decay.rate(cast(Orbit, orbit)) == pytest.approx(0.1)


def test_the_rate_is_the_share_that_decays():
    """The logarithm falls by 1.207 % a turn where 1.2 % decays: three standard errors apart."""
    found = measured(swinging(0.012), 0.0)
    assert abs(found.rate - 0.012) < found.error < 3e-5


def test_the_error_of_a_rate_is_that_of_least_squares():
    """By SciPy, of parts whose sizes scatter; what the phase leaves comes besides."""
    length = TURNS // PARTS
    sizes = np.exp(np.random.default_rng(3).normal(0.0, 0.3, PARTS))
    fit = linregress(length * np.arange(PARTS), np.log(sizes))
    found = measured(np.repeat(sizes, length)[:, None] * np.ones(2), 0.0)
    spread = length * np.std(np.arange(PARTS)) * np.sqrt(PARTS)
    assert found.rate == pytest.approx(-np.expm1(fit.slope), rel=1e-12)
    error = np.exp(fit.slope) * np.hypot(fit.stderr, PHASE / spread)
    assert found.error == pytest.approx(error, rel=1e-12)


def test_a_swing_that_does_not_die_is_told():
    found = measured(swinging(0.0), 0.0)
    assert abs(found.rate) < 3 * found.error < 1e-4


def test_the_tolerance_resolves_a_decay():
    """The method's own damping is a fiftieth of the joint's; at 1e-8 it is an eighth."""
    scene = jc.paper_scene(25.0, 0.03e-3)
    section = jc.periodic_orbit(scene).section
    beside, run = section + jnp.array([1e-3, 0.0, 0.0, 0.0]), eqx.filter_jit(section_points)
    rates = []
    for rtol in (decay.RTOL, 1e-11):
        points, success = run((beside, scene), turns=TURNS, rtol=rtol)
        assert success
        rates.append(measured(np.asarray(points - section[None])[:, :2], 0.0).rate)
    assert 1e-4 < rates[1] and rates[0] == pytest.approx(rates[1], rel=0.03)


# By a hundredth a turn, says the multiplier.
SAYS = 0.01
# As long as it was, give or take 0.2 % a turn: what an integration keeps alive looks like this.
NOISE = Decay(first=1e-4, last=1e-4, rate=-0.00035, error=0.001, floor=9e-5)


@pytest.mark.parametrize(
    ("swing", "good", "detail"),
    [
        (NOISE, True, "not measurable (a swing of 0.0001 clearances, of which 0.0009 are needed)"),
        # The same on a machine whose integration leaves less, in the scatter of its own parts.
        (replace(NOISE, floor=1e-6, error=0.004), True, "not measurable (a rate of -0.00035"),
        (replace(NOISE, last=5e-5, floor=1e-6), True, "of which 0.0001 are needed"),
        # A swing far above the integration's error that stays is evidence against the multiplier.
        (Decay(0.05, 0.05, 0.0, 1e-5, 1e-6), False, "contact start 0 ± 1e-05"),
        (Decay(0.05, 0.001, 0.0098, 1e-4, 1e-6), True, "contact start 0.0098"),
        # So is one that grew a hundredfold, though by no steady rate.
        (Decay(0.001, 0.1, -0.015, 0.004, 1e-6), False, "contact start -0.015 ± 0.004"),
    ],
)
def test_a_swing_that_cannot_be_measured_fails_no_check(swing, good, detail):
    best: Any = SimpleNamespace(transient={"contact": SimpleNamespace(decay=swing)})
    orbit: Any = SimpleNamespace(solution=SimpleNamespace(largest_multiplier=1 - SAYS, period=1))
    (check,) = verdicts._decaying(best, orbit)
    assert check.passed == good and detail in check.detail
    assert bool(unmeasurable(swing, SAYS)) == ("not measurable" in check.detail)

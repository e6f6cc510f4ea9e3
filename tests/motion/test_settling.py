"""Errors of turns that have not settled, against the orbits that they settle on."""

from types import SimpleNamespace

import jax.numpy as jnp
import numpy as np
import pytest

import jaxcrusher as jc
from jaxcrusher.crusher.statistics_table import STATISTIC
from jaxcrusher.motion.settling import (
    STILL,
    error,
    has_trend,
    is_settled,
    standard_error,
    swing_of,
)
from jaxcrusher.motion.statistics import Statistics

RMS, PEAK = STATISTIC["foundation_rms"], STATISTIC["foundation_peak"]


def test_the_standard_error_of_a_mean_is_that_of_batches_of_turns():
    """Of 20 turns ten batches of two, and of 19 too, of which one turn fills none."""
    by_turn = jnp.asarray(np.random.default_rng(2).uniform(1.0, 2.0, 20))
    batches = np.sqrt(np.mean(by_turn.reshape(10, 2) ** 2, axis=1))
    expected = batches.std(ddof=1) / np.sqrt(10)
    assert float(standard_error(RMS, by_turn)) == pytest.approx(expected, rel=1e-12)
    draws = jnp.asarray(100 + np.random.default_rng(3).normal(size=(1000, 19)))
    errors = np.array([float(standard_error(RMS, draw)) for draw in draws[:200]])
    # 200 draws of nine degrees of freedom know it to 2 %.
    assert np.sqrt(np.mean(errors**2)) == pytest.approx(1 / np.sqrt(19), rel=0.08)


def test_the_error_of_a_peak_is_the_scatter_of_the_batches_peaks():
    by_turn = jnp.asarray(np.random.default_rng(4).uniform(1.0, 2.0, 40))
    expected = by_turn.reshape(10, 4).max(axis=1).std(ddof=1)
    assert float(standard_error(PEAK, by_turn)) == pytest.approx(float(expected), rel=1e-12)


def test_one_turn_tells_no_error_and_a_failure_has_none():
    assert float(standard_error(RMS, jnp.array([2.0]))) == np.inf
    assert np.isnan(standard_error(RMS, jnp.array([np.nan])))


def test_a_drift_counts_as_far_as_it_is_seen():
    """Without chance: a peak that falls by 1 in each of four quarters."""
    by_turn = jnp.repeat(jnp.arange(4.0, 0.0, -1.0), 10)
    still, swung = (float(error(PEAK, by_turn, jnp.asarray(s))) for s in (0.0, 0.5))
    scatter = float(standard_error(PEAK, by_turn))
    assert still == pytest.approx(np.hypot(scatter, 3.0), rel=1e-12)
    # Half of the largest by the swing, and of a mean its square.
    assert swung == pytest.approx(np.sqrt(scatter**2 + 9 + 4), rel=1e-12)
    mean = float(error(RMS, jnp.full(40, 8.0), jnp.asarray(0.5)))
    assert mean == pytest.approx(8 * 0.25, rel=1e-12)


def test_chance_is_seldom_a_trend():
    """One of 2000 sets of ten ranks; and a fall of 2 % is one, also under some scatter."""
    random = np.random.default_rng(5)
    draws = jnp.asarray(100 + random.normal(size=(400, 40)))
    assert sum(bool(has_trend(RMS, draw)) for draw in draws) <= 2
    falling = np.linspace(100, 98, 40) + 0.02 * random.normal(size=40)
    assert bool(has_trend(RMS, jnp.asarray(falling)))
    # As a share of it nothing, and too few turns to tell.
    assert not bool(has_trend(RMS, jnp.linspace(100, 99.95, 40)))
    assert not bool(has_trend(RMS, jnp.linspace(100, 50, 9)))


def circle(width, turns=60, pace=3**0.5, distance=1.05):
    """Section points that swing about a place in contact, in a state of one joint."""
    phase = 2 * np.pi * pace * np.arange(turns)
    e = [distance + width * np.cos(phase), width * np.sin(phase)]
    return jnp.asarray(np.stack([*e, 0 * phase, 0 * phase], axis=1))


def test_the_swing_of_a_pin():
    scene = jc.build_scene({"clearance": 6e-5})
    # The radius of a circle, to the mean of 60 of its points.
    assert float(swing_of(circle(0.03), scene)) == pytest.approx(0.03, rel=0.02)
    # In step with every second turn it repeats; off the bore it is none.
    assert float(swing_of(circle(0.03, pace=0.5), scene)) < 1e-12
    assert float(swing_of(circle(0.06), scene)) == 0
    assert float(swing_of(circle(0.03, turns=1), scene)) == np.inf
    assert float(swing_of(circle(0.03), scene.ideal())) == 0


@pytest.mark.usefixtures("unchecked")  # statistics without an outcome of their own
def test_a_swing_or_a_trend_has_not_settled():
    flat, falling = jnp.full(40, 100.0), jnp.linspace(100, 90, 40)
    entries = (("foundation_rms", RMS),)
    for by_turn, swing, settled in (
        (flat, 0.0, True),
        (flat, 2 * STILL, False),
        (falling, 0.0, False),
    ):
        values = {"foundation_rms": by_turn}
        assert bool(is_settled(entries, values, jnp.asarray(swing))) == settled
        ended = SimpleNamespace(success=jnp.asarray(True))
        found = Statistics(40, ended, {}, values, None, known=entries, swing=swing)
        assert bool(found.settled) == settled


AXES = {"speed": [25.0, 30.0, 39.0], "clearance": [0.03e-3, 0.06e-3, 0.1e-3]}
NAMES = ("foundation_rms", "foundation_mean", "foundation_peak", "penetration_ratio")


@pytest.fixture(scope="module")
def orbits():
    return jc.orbit_map(jc.paper_machine(), AXES)


@pytest.mark.parametrize("start", ["centred", "contact"])
def test_errors_cover_how_far_a_sweep_is_from_the_orbits(orbits, start):
    """The paper's crusher over 40 turns after 40: by chance alone it is 19 to 206 errors off."""
    found = jc.sweep(jc.paper_machine(start=start), AXES, 40, 40)
    for name in NAMES:
        off = np.abs(found[name] - orbits[name]).values
        # An order of magnitude: where a force turns by an angle a, a^2 stands for all that it does.
        # Of the contact start, which is as good as settled, parabolas are 1e-5 of a peak off.
        allowed = 3 * found[f"{name}_error"].values + 1e-4 * np.abs(orbits[name].values)
        assert np.all(off <= allowed), name
    if start == "centred":
        assert not found.settled.any() and "9 of 9 designs have not settled" in found.remark
        assert np.all(
            found.foundation_rms_error > 0.2 * np.abs(found.foundation_rms - orbits.foundation_rms)
        )
    else:
        assert found.settled.sum() >= 7


def test_a_frame_that_rings_has_not_settled():
    """A block on springs of little damping, whose largest motion is that of the first turns."""
    of_block = ("frame_displacement_peak", "transmitted_peak", "transmitted_rms", "foundation_rms")
    dampers = {f"foundation.{way}_damping": 3e3 for way in ("horizontal", "vertical")}
    springs = {
        "foundation.mass": 6e3,
        "foundation.inertia": 2500.0,
        "foundation.horizontal_stiffness": 10e6,
        "foundation.vertical_stiffness": 15e6,
    }
    scene = jc.build_scene({"start": "contact", **springs, **dampers})
    found, orbit = jc.statistics(scene, 20, 40, outputs=of_block), jc.periodic_orbit(scene)
    assert not bool(found.settled)
    for name in of_block:
        # 33, 34, 1.2 and 0.01 % off.
        assert abs(float(found[name] - orbit[name])) < 2 * float(found.error(name)), name
    assert float(found.frame_displacement_peak / orbit.frame_displacement_peak) > 1.2

"""The joint in another mechanism: a slider-crank against EXUDYN, SciPy and closed forms."""

from dataclasses import replace

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

import benchmarks.slider_crank.mechanism as sc
from benchmarks.peers.exudyn_slider_crank import Numbers, Result, by_exudyn, by_scipy
from jaxcrusher.joint.friction import AmbrosioFriction, SurfaceSlip
from jaxcrusher.joint.normal import ConstantImpactVelocity, TrackedImpactVelocity

MICROSECONDS = 1e-6 * np.arange(2001)
# Faster than any impact, so that it is the impact velocity of all of them everywhere.
FAST = 20.0
SURFACE = AmbrosioFriction(SurfaceSlip(), 0.1, 0.0, 0.5, width=1e-5)


def motion(impact_velocity, times=MICROSECONDS, friction=None):
    mechanism = sc.flores(impact_velocity=impact_velocity, friction=friction)
    made = sc.simulate(mechanism, times, rtol=1e-12)
    assert bool(made.outcome.success), made.failure
    return made


def seen(made):
    """What all programs report, as rows: force, acceleration, moment, orbit."""
    if isinstance(made, Result):
        rows = (made.contact_force, made.slider_acceleration, made.crank_moment)
        return np.stack([*rows, *made.eccentricity.T])
    now = made.instants
    rows = (sc.joint_load(made), now.slider_acceleration, now.crank_moment)
    return np.stack([*rows, now.eccentricity.x, now.eccentricity.y])


def distance(one, other, samples=None):
    """The largest difference of anything seen, relative to its largest value."""
    one, other = seen(one)[:, :samples], seen(other)[:, :samples]
    return (np.abs(one - other).max(axis=1) / np.abs(other).max(axis=1)).max()


def exudyn(numbers, times):
    """In steps of 0.1 us; every tenth is reported."""
    made = by_exudyn(numbers, times[-1], 1e-7)
    columns = (made.contact_force, made.slider_acceleration, made.crank_moment, made.eccentricity)
    return Result(times, *(column[::10] for column in columns))


def test_first_impacts_by_three_programs():
    """Seven impacts, pointwise: forces, accelerations, the crank's moment and the orbit."""
    numbers, own = Numbers(least_impact_velocity=FAST), motion(ConstantImpactVelocity(FAST))
    # Tolerances of 1e-12 grow a hundredfold over the impacts.
    assert distance(own, by_scipy(numbers, MICROSECONDS)) < 1e-7
    # Steps of 0.1 us in impacts of 60 us: (2 pi / 600)^2 / 12 = 1e-5 each, and growth.
    assert distance(exudyn(numbers, MICROSECONDS), own) < 2e-4


def test_friction_by_three_programs():
    """Three impacts under friction at the surfaces."""
    own, times = motion(ConstantImpactVelocity(FAST), friction=SURFACE), MICROSECONDS[:1001]
    numbers = Numbers(least_impact_velocity=FAST, friction=0.1, full_sliding_speed=0.5)
    # The sharp corners of the ramp, which SciPy steps across, cost more than the tolerances.
    assert distance(own, by_scipy(numbers, times), 1001) < 1e-5
    # EXUDYN's friction acts half a penetration further out (0.4 % of the radius, and growth),
    # and nothing else is different.
    other = exudyn(numbers, times)
    assert distance(other, by_scipy(replace(numbers, contact_point=0.5), times)) < 2e-4
    assert distance(other, own, 1001) > 4e-3


def test_each_impact_by_its_own_velocity():
    """The tracked velocity lags by its relaxation time: an error of first order in it."""
    sharp = by_scipy(Numbers(), MICROSECONDS[:1001])
    # The last is the crusher's: no good at 19 400 m/s2.
    half, whole, long = (
        distance(motion(TrackedImpactVelocity(relaxation_time=lag)), sharp, 1001)
        for lag in (2e-7, 4e-7, 1e-4)
    )
    # Three impacts; of second order is the lag of 4e-7 s * 2e4 m/s2 in 4 m/s, 0.2 %, and growth.
    assert whole / half == pytest.approx(2, rel=0.03)
    assert half < 2e-3 and long > 0.1


@pytest.mark.parametrize("friction", [None, SURFACE], ids=["none", "surface"])
def test_energy_over_two_turns(friction):
    made = motion(None, 12 * MICROSECONDS, friction)
    change = made.energy - made.energy[0] - sum(made.work.values())
    # A tolerance of 1e-12, thirty impacts.
    assert np.abs(change).max() < 1e-9 * np.abs(made.work["drive"]).max()
    assert float(made.work["contact"][-1]) < -0.5
    assert friction is None or float(made.work["friction"][-1]) < -0.1


def test_ideal_joint():
    """Known accelerations at the dead centres, and the moment does the work."""
    mechanism = sc.flores(None)
    turn, speed = 2 * np.pi / float(mechanism.drive.speed), float(mechanism.drive.speed)
    made = sc.simulate(mechanism, turn * np.linspace(0, 1, 4001))
    now, r, length = made.instants, 0.05, 0.12
    dead = r * speed**2
    found = np.asarray(now.slider_acceleration)[[0, 2000]]
    np.testing.assert_allclose(
        found, [-dead * (1 + r / length), dead * (1 - r / length)], rtol=1e-9
    )
    np.testing.assert_allclose(now.slider_position[0] - now.slider_position[2000], 0.1, rtol=1e-12)
    # The trapezoidal rule over a whole turn of 4000 samples: 1e-6 of the swing in a part of it.
    power = np.asarray(now.crank_moment) * speed
    work = np.concatenate([[0], np.cumsum((power[1:] + power[:-1]) / 2 * turn / 4000)])
    np.testing.assert_allclose(made.energy - made.energy[0], work, atol=1e-5 * np.ptp(work))


def test_a_failed_motion_is_reported():
    broken = eqx.tree_at(
        lambda m: m.bearings["wrist"].normal.stiffness,
        sc.flores(),
        replace_fn=lambda k: jnp.nan * k,
    )
    made = sc.simulate(broken, MICROSECONDS)
    assert not made.outcome.success and made.failure.startswith("stopped at")
    assert np.isnan(made.energy[-1]) and np.isnan(made.instants.slider_acceleration[-1])

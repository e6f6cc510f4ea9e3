"""An orbit under a rough feed: against collocation, against integration, and its limits."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxcrusher as jc
from jaxcrusher.mechanism.acting import RoughFeed
from jaxcrusher.mechanism.drives import UnevenSpeed
from jaxcrusher.orbits import forced
from jaxcrusher.periodic.collocation import collocate
from jaxcrusher.periodic.trigonometric import resample
from jaxcrusher.sheets import feed_response
from jaxcrusher.sheets.feed_response import RESPONSE_NODES, FeedResponse, _Crossing
from tests.differences import assert_slopes, differences

ROUGH = {"start": "contact", "load_scatter": 0.1, "load_bandwidth": 5.3}


@pytest.fixture(scope="module")
def orbit():
    return jc.periodic_orbit(jc.build_scene(ROUGH))


@pytest.fixture(scope="module")
def response(orbit):
    return jc.feed_response(orbit)


@pytest.fixture(scope="module")
def linear(orbit):
    """The modes of the orbit, and the slope of the force by (x, x', w)."""
    about = feed_response.linearised_about(orbit)
    return about.modes, about.force.slope


@pytest.mark.parametrize(
    ("losses", "chance"), [(0.0, 0.0), (1e-9, 1e-9), (0.1, 1 - np.exp(-0.1)), (30.0, 1.0)]
)
def test_the_chance_of_losses_that_come_independently(losses, chance):
    """That of none is exp(-losses), by Poisson's distribution."""
    none, nodes = jnp.zeros(()), jnp.zeros(0)
    seen = FeedResponse(nodes, jnp.zeros((0, 2)), nodes, none, none, jnp.asarray(losses), none)
    assert float(seen.chance) == pytest.approx(chance, rel=1e-8)


def with_feed(scene, scatter, orders, phases):
    """The scene under some cosines."""
    made = RoughFeed(scene.pushes[0].load, scatter, 1.0, jnp.asarray(orders), jnp.asarray(phases))
    return dataclasses.replace(scene, pushes=(made,))


def waved(modes, order):
    """(x, x', w) exp(-i order theta) at the nodes."""
    found = modes.responses(jnp.asarray(order), np.zeros(1))[:, :, 0]
    return np.asarray(
        jax.lax.complex(*(resample(part, RESPONSE_NODES) for part in (found.real, found.imag)))
    )


def test_a_cosine_of_whole_order_makes_a_periodic_orbit(orbit, linear):
    """Collocation itself solves for it; the response is its slope by the scatter."""
    order, phase = 3, 0.7
    angle = 2 * np.pi * np.arange(RESPONSE_NODES) / RESPONSE_NODES
    # w of one cosine is sqrt(2) cos.
    turn = np.sqrt(2) * np.exp(1j * (order * angle + phase))
    expected = (turn[:, None] * waved(linear[0], float(order))[:, :2]).real
    start = resample(orbit.eccentricity, RESPONSE_NODES)

    def orbit_under(scatter):
        scene = with_feed(orbit.scene, scatter, [float(order)], [phase])
        x, root = collocate(forced.system(scene, 1), start)
        assert bool(root.success)
        return x

    # A central difference leaves the square of the scatter, times curvature of order ten.
    found = differences(orbit_under, 0.0, 1e-4)
    np.testing.assert_allclose(found, expected, atol=1e-6 * np.abs(expected).max())


@pytest.mark.slow
def test_a_motion_that_starts_on_its_response_stays_there(orbit, linear):
    """Cosines of any order, integrated over three turns, against the sum of their responses."""
    modes, by_state = linear
    orders, phases, scatter = np.array([0.31, 2.72, 16.4]), np.array([0.3, 2.0, 4.0]), 1e-5
    seen = np.stack([waved(modes, order) for order in orders])
    sizes = np.sqrt(2 / 3) * np.exp(1j * phases)
    start = scatter * np.einsum("k,kia->ia", sizes, seen).real[0]
    clearance, speed = float(orbit.scene.joints.at("main").clearance), 30.0
    units = np.array([1.0, 1.0, clearance * speed, clearance * speed])
    angle = 2 * np.pi * np.arange(RESPONSE_NODES) / RESPONSE_NODES
    late = angle + 4 * np.pi
    motion = jc.simulate(
        with_feed(orbit.scene, scatter, orders, phases),
        late / speed,
        outputs=("foundation_force",),
        state=orbit.section + units * start[:4],
    )
    still = orbit.motion(angle, ("foundation_force",))["foundation_force"]
    turned = np.exp(1j * np.outer(orders, late))
    expected = np.einsum("k,ki,kia,ia->i", sizes, turned, seen, by_state).real
    found = np.asarray(motion.foundation_force - still) / scatter
    # Second order in the scatter, and the integrator's 1e-11 of some MN over 1e-5.
    np.testing.assert_allclose(found, expected, atol=2e-3 * np.abs(expected).max())


@pytest.mark.slow
def test_little_scatter_and_where_contact_is_lost(orbit, response):
    """Deviations are linear in the scatter, the mean RMS is quadratic; then contact is lost."""
    scene = jc.build_scene(ROUGH | {"load_scatter": 1e-3})
    small = jc.feed_response(dataclasses.replace(orbit, scene=scene))
    for name in ("eccentricity", "force", "rms"):
        np.testing.assert_allclose(100 * getattr(small, name), getattr(response, name), rtol=1e-9)
    shifts = [float(one.expected_rms - orbit.foundation_rms) for one in (small, response)]
    # The root of a sum of squares, to the shift's own size over the RMS; rounding of 19 kN.
    assert shifts[1] == pytest.approx(1e4 * shifts[0], rel=1e-2)
    assert float(small.losses) == 0.0 and 0 < float(response.losses) < 1e-3
    assert float(small.losing_scatter) == pytest.approx(float(response.losing_scatter), rel=1e-9)
    scatter = float(response.losing_scatter)
    there = jc.build_scene(ROUGH | {"load_scatter": scatter})
    lost = jc.feed_response(dataclasses.replace(orbit, scene=there))
    assert float(lost.losses) == pytest.approx(1e-3, rel=1e-9)
    assert float(lost.chance) == pytest.approx(1 - np.exp(-1e-3), rel=1e-9)


def test_crossings_of_a_stationary_process():
    """Rice 1945: a turn has 2 pi times exp(-m^2 / 2 s^2) r / (2 pi s) crossings downwards."""
    mean, deviation, rate = 3.0, 0.8, 5.0
    ones = jnp.ones((8, 1))
    steady = _Crossing(mean * ones, 0 * ones, deviation**2 * ones, 0 * ones, rate**2 * ones)
    for scatter in (0.5, 2.0):
        expected = rate / deviation * np.exp(-((mean / (scatter * deviation)) ** 2) / 2)
        found = float(jnp.exp(steady.log_losses(jnp.log(jnp.asarray(scatter)))))
        assert found == pytest.approx(expected, rel=1e-12)
    # A mean that rises very fast at some angles, where a density underflows, takes their share.
    rising = dataclasses.replace(steady, mean_rate=jnp.zeros((8, 1)).at[:6].set(38.5 * rate))
    found, slope = jax.value_and_grad(rising.log_losses)(jnp.asarray(0.0))
    share = rate / deviation * np.exp(-((mean / deviation) ** 2) / 2) / 4
    assert float(jnp.exp(found)) == pytest.approx(share, rel=1e-12)
    # d/d log s of exp(-m^2 / (2 s^2)).
    assert float(slope) == pytest.approx((mean / deviation) ** 2, rel=1e-12)


@pytest.mark.slow
def test_slopes(monkeypatch):
    """By a clearance, a mass, a bandwidth and a scatter at once, against differences."""
    # As many as the band needs: a quarter of the time.
    monkeypatch.setattr(feed_response, "RESPONSE_NODES", 128)
    names = ("clearance", "jaw.mass", "load_bandwidth", "load_scatter")
    at, along = np.array([6e-5, 524.0, 2.3, 0.1]), np.array([6e-5, 524.0, 1.15, 0.02])

    def told(step):
        values = ROUGH | dict(zip(names, at + step * along, strict=True))
        found = jc.feed_response(jc.periodic_orbit(jc.build_scene(values), nodes=128))
        return jnp.stack([found.rms, found.expected_rms, found.losing_scatter, found.losses])

    # Differences over 1e-4 leave its square, times the curvature of a resonance at 0.3 of an order,
    # and of losses that are the 20th power of the scatter.
    assert_slopes(told, 0.0, 1e-4, rtol=1e-3, by=jax.jacfwd)


def test_an_orbit_that_loses_contact_has_no_response(orbit):
    """Of one by shooting an expected RMS of 16 907 N stood beside NaN, below that of no feed."""
    lost = dataclasses.replace(orbit, least_penetration=jnp.asarray(-0.002))
    assert all(np.isnan(one).all() for one in jax.tree.leaves(jc.feed_response(lost)))


def test_refusals(orbit):
    plain = dataclasses.replace(orbit, scene=jc.build_scene({"start": "contact"}))
    with pytest.raises(ValueError, match="must be of a scene with a load_scatter"):
        jc.feed_response(plain)
    with pytest.raises(ValueError, match="must be of a scene with a clearance joint"):
        jc.feed_response(jc.periodic_orbit(jc.build_scene({"joint": "ideal", "load_scatter": 0.1})))
    # At order 8 a fluctuation of 2 % makes the response to one cosine wrong by 13 %.
    uneven = dataclasses.replace(orbit.scene, drive=UnevenSpeed(30.0, 0.02))
    with pytest.raises(ValueError, match="must be of a shaft at constant speed, but is of an unev"):
        jc.feed_response(dataclasses.replace(orbit, scene=uneven))
    feed = dataclasses.replace(orbit.scene.pushes[0], bandwidth=jnp.asarray(41.0))
    wide = dataclasses.replace(orbit.scene, pushes=(feed,))
    with pytest.raises(ValueError, match="must be of a load_bandwidth of 40 at most, but is 41"):
        jc.feed_response(dataclasses.replace(orbit, scene=wide))
    unstable = dataclasses.replace(orbit, multipliers=1.1 + 0 * orbit.multipliers)
    assert np.isnan(float(jc.feed_response(unstable).rms))

"""A rough feed: its wave, what it multiplies, and who refuses it."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxcrusher as jc
from jaxcrusher.batch.engines import in_lanes, in_turn, stack
from jaxcrusher.crusher.loads import AlongJaw
from jaxcrusher.mechanism.acting import RoughFeed, rough_feed
from jaxcrusher.mechanism.drives import GivenTorque
from jaxcrusher.mechanism.scene import later
from jaxcrusher.motion.statistics import statistics
from tests.differences import assert_slopes
from tests.pairs import slow

ROUGH = {"load_scatter": 0.2, "load_bandwidth": 7.3, "load_seed": 5, "start": "contact"}
ANGLES = np.linspace(0.0, 40.0, 41)  # more than six turns
CURVE = np.stack([np.arange(6.0), 9e3 + 1e3 * np.arange(6.0)], 1)


def test_the_wave_has_unit_variance_and_a_flat_band():
    """Its correlation is the transform of a flat band of orders up to b: sin(b tau) / (b tau)."""
    bandwidth, lags, seeds = 7.3, np.linspace(0.0, 2.0, 11), 40000

    @jax.jit
    @jax.vmap
    def waves(seed):
        feed = rough_feed(AlongJaw(1.0), 0.2, bandwidth, seed)
        return jax.vmap(feed.wave)(jnp.asarray(100.0 + lags))

    seen = np.asarray(waves(jnp.arange(seeds)))
    product = seen[:, :1] * seen
    # Five standard errors of a mean of products of normal numbers, which is 2 / seeds at most.
    allowed = 5 * np.sqrt(2 / seeds)
    np.testing.assert_allclose(product.mean(0), np.sinc(bandwidth * lags / np.pi), atol=allowed)
    assert abs(seen.mean()) < allowed


def test_each_cosine_has_its_own_share_of_the_band():
    feed = rough_feed(AlongJaw(1.0), 0.2, 7.3, 3)
    share = np.asarray(feed.places) * len(feed.places)
    np.testing.assert_array_equal(np.floor(share), np.arange(len(share)))


@pytest.mark.parametrize(
    "load",
    [
        {"load_law": "normal_to_jaw", "load_point": 0.4},
        {"load_law": "chamber"},
        *slow({}, {"load_law": "closing_stroke"}, {"load_law": "by_angle", "load_curve": CURVE}),
    ],
    ids=["normal", "bed", "along", "closing", "curve"],
)
def test_any_law_is_multiplied_by_the_same_wave(load):
    """The wave counts the angle since time zero: it goes on where a turn ends."""
    rough = jc.build_scene({"joint": "ideal"} | ROUGH | load)
    plain = jc.build_scene({"joint": "ideal"} | load)
    at = ANGLES / 30.0
    forces, mean = (
        jc.simulate(s, at, outputs=("crushing_load",)).crushing_load for s in (rough, plain)
    )
    wave = jax.vmap(rough.pushes[0].wave)(jnp.asarray(ANGLES))
    # Rounding of angles of 40 rad.
    np.testing.assert_allclose(forces, (1 + 0.2 * wave)[:, None] * mean, rtol=1e-11, atol=1e-9)
    assert np.ptp(wave) > 1


@pytest.mark.slow
def test_a_run_that_is_split_goes_on_with_its_feed():
    scene = jc.build_scene(ROUGH)
    names = ("foundation_rms",)
    whole = jc.statistics(scene, 2, 1, outputs=names)
    first = jc.statistics(scene, 0, 2, outputs=names)
    then, again = (
        jc.statistics(one, 0, 1, outputs=names, state=first.state)
        for one in (later(scene, 4 * np.pi), scene)
    )
    # Steps of 1e-8 that begin elsewhere; the feed's beginning is another feed.
    assert float(then.foundation_rms) == pytest.approx(float(whole.foundation_rms), rel=1e-6)
    assert float(again.foundation_rms) != pytest.approx(float(whole.foundation_rms), rel=1e-3)
    plain = jc.build_scene({})
    assert later(plain, 4 * np.pi) is plain


def test_by_multipliers_and_on_a_free_shaft_the_angle_is_that_of_the_state():
    scene, angle = jc.build_scene(ROUGH | {"formulation": "multiplier"}), jnp.asarray(9.0)
    free = eqx.tree_at(lambda s: s.drive, jc.build_scene(ROUGH), GivenTorque(300.0, 30.0))
    for one, of in (
        (scene, lambda state: state.position["shaft"].angle),
        (free, lambda state: state.crank.angle),
    ):
        state = eqx.tree_at(of, one.formulation.initial(one), angle)
        load = one.formulation.snapshot(jnp.asarray(0.0), state, one).applied.pushes[0][1]
        wave = float(one.pushes[0].wave(angle))
        assert float(jnp.hypot(load.x, load.y)) == pytest.approx(8800 * (1 + 0.2 * wave), rel=1e-12)


def test_without_scatter_nothing_of_it_is_there():
    assert jax.tree.structure(jc.build_scene({})) == jax.tree.structure(
        jc.build_scene({"load_scatter": 0.0})
    )
    with pytest.raises(ValueError, match="`load_scatter` must not come with `load_law=none`"):
        jc.build_scene({"load_scatter": 0.1, "load_law": "none"})
    with pytest.raises(ValueError, match="`load_point` must not come with `load_law=none`"):
        jc.build_scene({"load_point": 0.1, "load_law": "none"})
    with pytest.raises(ValueError, match="`load_bandwidth` must come with `load_scatter`"):
        jc.build_scene({"load_bandwidth": 3.0})


@pytest.mark.slow
def test_seeds_run_in_lanes_and_scatter_has_slopes():
    def rms(scene):
        return statistics(scene, 0, 1, outputs=("foundation_rms",)).foundation_rms

    scenes = stack([jc.build_scene(ROUGH | {"load_seed": seed}) for seed in (1, 2)])
    lanes, loop = np.asarray(in_lanes(rms, scenes)), np.asarray(in_turn(rms, scenes))
    # Two compilations of one integration at a tolerance of 1e-9.
    np.testing.assert_allclose(lanes, loop, rtol=1e-7)
    assert abs(lanes[0] - lanes[1]) > 10

    def of(scatter):
        return rms(jc.build_scene(ROUGH | {"load_scatter": scatter, "joint": "ideal"}))

    # The turn's RMS is nearly linear in the scatter: differences over 1 % of it are right to 1e-4.
    assert_slopes(of, 0.2, 0.002, rtol=1e-3, by=jax.jacfwd)


def test_what_repeats_each_turn_takes_the_mean_load_or_refuses():
    rough, plain = (jc.build_scene({"joint": "ideal", **feed}) for feed in (ROUGH, {}))
    assert isinstance(rough.pushes[0], RoughFeed)
    one, other = jc.periodic_orbit(rough), jc.periodic_orbit(plain)
    assert float(one.foundation_rms) == float(other.foundation_rms)
    at = np.linspace(0.0, 9.0, 5)
    seen = [orbit.motion(at, ("crushing_load",))["crushing_load"] for orbit in (one, other)]
    np.testing.assert_array_equal(*seen)
    rough = jc.build_scene(ROUGH)
    for refused in (lambda: jc.poincare_section(rough, 0, 1), lambda: jc.coexisting_orbits(rough)):
        with pytest.raises(ValueError, match="must have a load that repeats each turn"):
            refused()


def test_a_seed_is_a_whole_number():
    """A fraction was once cut off, so that a sweep had the same feed several times."""
    with pytest.raises(ValueError, match=r"`load_seed` must be a whole number, but is 1\.5\.$"):
        jc.build_scene(ROUGH | {"load_seed": 1.5})
    base = {name: value for name, value in ROUGH.items() if name != "load_seed"}
    for name in ("load_seed", "fluctuation_order"):
        uneven = {"speed_fluctuation": 0.02} if name == "fluctuation_order" else {}
        machine = jc.paper_machine(**base, **uneven)
        with pytest.raises(ValueError, match=rf"`{name}` must be a whole number, but is \[1"):
            jc.sweep(machine, {name: [1.0, 1.5, 2.0]}, 0, 1)
    traced = jax.jit(lambda seed: jc.build_scene(ROUGH | {"load_seed": seed}).pushes[0].phases)
    assert np.isnan(traced(1.5)).all() and np.isfinite(traced(2.0)).all()

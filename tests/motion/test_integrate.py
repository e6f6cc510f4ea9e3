"""Failures are reported as such, and diffrax's own parts pass straight through."""

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxcrusher as jc
from jaxcrusher.basics.plane import scalar


def test_values_are_checked_only_where_concrete():
    """A traced clearance passes the checks, and a wild one fails in the numbers."""

    @jax.jit
    def run(clearance):
        scene = jc.paper_scene(30.0, clearance)
        result = jc.statistics(scene, 0, 1, outputs=("foundation_rms",))
        return result.foundation_rms, result.success

    rms, success = run(-6e-5)
    assert not success and np.isnan(rms)


@pytest.mark.slow
@pytest.mark.parametrize("of", [jc.periodic_orbit, lambda scene: jc.statistics(scene, 0, 1)])
def test_slopes_of_numbers_out_of_limits_are_nan_backwards_too(of):
    """In their lanes alone."""

    def rms(speed):
        found = of(jc.ideal_scene(speed))
        return found.foundation_rms, found.success

    at = jnp.array([25.0, np.nan, 30.0, -3.0])
    (value, success), slope = jax.vmap(jax.value_and_grad(rms, has_aux=True))(at)
    assert success.tolist() == [True, False, True, False]
    forward, _ = jax.vmap(jax.jacfwd(rms, has_aux=True))(at)
    for numbers in (value, slope, forward):
        assert np.isfinite(numbers).tolist() == success.tolist()


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({"method": diffrax.Dopri8()}, r"`method` must be .* but is a Dopri8"),
        ({"method": jc.Method}, r"`method` must be .* but is the class Method: call it"),
        ({"outputs": ("normal_forces",)}, "`outputs` must be a known name, but is 'normal_forces'"),
        ({"outputs": "normal_force"}, "`outputs` must be names in a tuple, such as"),
        ({"rtol": 1.0}, "`rtol` must be one number < 1, but is 1.0"),
    ],
)
def test_bad_arguments_are_refused_in_one_line(given, told):
    with pytest.raises(ValueError, match=f"^Argument {told}") as error:
        jc.simulate(jc.paper_scene(30.0, 6e-5), [0.0, 0.1], **given)
    assert "\n" not in str(error.value)


def test_a_failed_run_is_reported_and_never_a_number():
    scene = jc.paper_scene(30.0, 0.06e-3)
    times = np.linspace(0, 0.01, 101)
    motion = jc.simulate(scene, times, outputs=("normal_force",), method=jc.Method(max_steps=30))
    assert not motion.success
    assert "jc.Method(max_steps=" in motion.failure
    reached = float(motion.outcome.reached)
    assert 0 < reached < 0.01 and f"{reached:.6g} s" in motion.failure
    late = times > reached
    assert np.isnan(motion.normal_force[late]).all()
    assert np.isfinite(motion.normal_force[~late]).all()

    broken = eqx.tree_at(lambda s: s.joints.at("main").normal.stiffness, scene, scalar(jnp.nan))
    result = jc.statistics(broken, 0, 3)
    assert not result.success and result.failure.startswith("stopped at")
    for name in jc.STATISTICS:
        assert np.isnan(getattr(result, name)), name


@pytest.mark.slow
def test_a_failed_lane_leaves_the_others_alone():
    scenes = [jc.paper_scene(30.0, c, start="contact") for c in (5e-5, 6e-5)]
    stacked = jax.tree.map(lambda *leaves: jnp.stack(leaves), *scenes)
    stacked = eqx.tree_at(
        lambda s: s.joints.at("main").normal.stiffness,
        stacked,
        stacked.joints.at("main").normal.stiffness.at[0].set(jnp.nan),
    )
    run = eqx.filter_jit(
        eqx.filter_vmap(lambda s: jc.statistics(s, 0, 1, outputs=("foundation_rms",)))
    )
    result = run(stacked)
    assert result.success.tolist() == [False, True]
    assert np.isnan(result.foundation_rms[0])
    alone = jc.statistics(scenes[1], 0, 1, outputs=("foundation_rms",)).foundation_rms
    # The same steps up to rounding; 1e-9 of tolerance.
    assert float(result.foundation_rms[1]) == pytest.approx(float(alone), rel=1e-8)


@pytest.mark.parametrize("start", ["centred", "contact"])
def test_nothing_finite_ends_at_once(start):
    """Also where the first state is not finite, and beside a lane that is."""
    scene = jc.paper_scene(30.0, 0.06e-3, start=start)
    broken = eqx.tree_at(lambda s: s.linkage.gravity, scene, scalar(jnp.nan))
    result = jc.statistics(
        broken, 0, 2, outputs=("foundation_rms",), method=jc.Method(max_steps=1000)
    )
    assert not result.success and "max_steps" not in result.failure
    assert float(result.outcome.reached) == 0 and np.isnan(result.foundation_rms)


def peak(motion):
    assert bool(motion.success), motion.failure
    return float(motion.normal_force.max())


@pytest.mark.slow
def test_other_solvers_and_controllers():
    scene = jc.paper_scene(30.0, 0.06e-3, slip="surface")
    times, outputs = np.linspace(0, 5e-3, 1001), ("normal_force",)
    reference = peak(jc.simulate(scene, times, outputs=outputs))
    for solver in (diffrax.Dopri5(), diffrax.Dopri8(), diffrax.Kvaerno5()):
        other = jc.simulate(scene, times, outputs=outputs, rtol=1e-10, method=jc.Method(solver))
        # One impact at a tolerance of 1e-10.
        assert peak(other) == pytest.approx(reference, rel=1e-6)
    fixed = [jc.Method(diffrax.Dopri5(), diffrax.ConstantStepSize(), dt0=dt) for dt in (1e-5, 5e-6)]
    coarse, fine = (
        peak(jc.simulate(scene, times, outputs=outputs, method=method)) for method in fixed
    )
    # An impact of 0.5 ms in steps of 10 and 5 us; its corner lowers the order, to two at least.
    assert abs(coarse / reference - 1) < 1e-4
    assert abs(fine / reference - 1) < abs(coarse / reference - 1) / 4


def test_an_explosion_in_fixed_steps_is_a_failure():
    scene = jc.paper_scene(30.0, 0.06e-3, start="contact")
    method = jc.Method(stepsize_controller=diffrax.ConstantStepSize(), dt0=2e-3)
    motion = jc.simulate(scene, [0.1, 2.0], outputs=("normal_force",), method=method)
    assert not motion.success and "not finite" in motion.failure
    assert np.isnan(motion.normal_force).any()

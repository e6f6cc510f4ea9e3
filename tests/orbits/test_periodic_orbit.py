"""The crusher's periodic orbit: numbers known from 30 000 turns, multipliers, slopes, refusals."""

import dataclasses
import functools
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.stats import linregress

import jaxcrusher as jc
from jaxcrusher.crusher.template import STATISTIC
from jaxcrusher.mechanism.drives import GivenTorque
from jaxcrusher.mechanism.reductions import AbstractMean
from jaxcrusher.motion.flow import flat
from jaxcrusher.motion.section import poincare_section
from jaxcrusher.orbits.result import WAYS
from jaxcrusher.orbits.transient import section_points
from jaxcrusher.periodic.multipliers import UNSURE
from jaxcrusher.scenes.parameters import PARAMETERS, numbers_of
from tests.differences import differences

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.fixture(scope="module")
def orbit():
    return jc.periodic_orbit(jc.paper_scene(30.0, 0.06e-3))


# Compiled with XLA's optimisations, as users have it: README promises these numbers.
@pytest.mark.slow
@pytest.mark.optimised
@pytest.mark.parametrize(
    ("speed", "clearance", "rms", "digits", "turns"),
    [
        # RMS of another program's 10 000 and 30 000 turns, which the swing leaves 1e-7 off, and
        # of collocation by a third; turns in which the swing falls to 1/e.
        (25.0, 0.03e-3, 18243.4112, 5e-5, 4700),
        (30.0, 0.06e-3, 19102.316, 1e-3, 14300),
        (39.0, 0.03e-3, 21796.415, 3e-3, 6930),
    ],
)
def test_orbit_rms(speed, clearance, rms, digits, turns):
    found = jc.periodic_orbit(jc.paper_scene(speed, clearance))
    assert found.success and found.stable and found.failure == ""
    np.testing.assert_allclose(found.foundation_rms, rms, atol=digits)
    np.testing.assert_allclose(found.settling_turns, turns, rtol=0.01)
    assert found.error < 1e-8 and found.least_penetration > 0


@pytest.mark.parametrize(
    ("speed", "clearance", "rms"),
    [
        (27.0, 0.05e-3, 15256.015326),
        pytest.param(30.0, 0.06e-3, 15835.128865, marks=pytest.mark.slow),
    ],
)
def test_load_normal_to_the_jaw(speed, clearance, rms):
    scene = jc.paper_scene(speed, clearance, load_law="normal_to_jaw")
    # As many digits as are known.
    np.testing.assert_allclose(jc.periodic_orbit(scene).foundation_rms, rms, atol=1e-6)


def test_one_program_serves_the_pins_at_rest_and_a_guess(orbit, caplog):
    begun = jc.periodic_orbit(orbit.scene, nodes=96)
    with jax.log_compiles():
        jc.periodic_orbit(orbit.scene, nodes=96, guess=begun)
    assert not any(
        "orbit_nodes" in line for line in caplog.messages if line.startswith("Compiling")
    )


def test_more_nodes_compile_newtons_method_alone(orbit, caplog):
    """Statistics are one program for all numbers of nodes, and no more steps are prepared for."""
    few = jc.periodic_orbit(orbit.scene, nodes=96)
    with jax.log_compiles():
        more = jc.periodic_orbit(orbit.scene, nodes=110)
    compiled = [line for line in caplog.messages if line.startswith("Compiling")]
    assert any("_orbit_nodes" in line for line in compiled)
    assert not any("_with_statistics" in line or "_seen_finely" in line for line in compiled)
    assert len(few.eccentricity) == 96 and len(more.eccentricity) == 110
    # Rounding, and what 96 nodes leave.
    np.testing.assert_allclose(more.foundation_rms, few.foundation_rms, rtol=1e-8)


@pytest.mark.slow
def test_a_slope_beside_an_orbit_compiles_no_second_search(caplog):
    def rms(clearance):
        return jc.periodic_orbit(jc.paper_scene(27.0, clearance), nodes=96).foundation_rms

    rms(0.05e-3)
    with jax.log_compiles():
        slope = jax.grad(rms)(0.05e-3)
    compiled = [line for line in caplog.messages if line.startswith("Compiling")]
    assert any("_with_statistics" in line for line in compiled)
    assert not any("orbit_nodes" in line for line in compiled)
    # Differences of orbits give 30 125.936 over 0.1 um, 30 125.935 over 0.03 um.
    assert float(slope) == pytest.approx(30125.935, rel=1e-6)


def test_multipliers_against_the_section(orbit):
    """The Jacobian of the once-per-turn map, by tangents under the integrator's error control."""
    state = flat(orbit.state())
    section = poincare_section(orbit.scene, 0, 1, slices=8, state=state, rtol=1e-11)
    product = np.linalg.multi_dot([np.asarray(m) for m in section.jacobians[::-1]])
    expected = np.sort_complex(np.linalg.eigvals(product))
    found = np.sort_complex(np.asarray(orbit.multipliers))
    # Both err by some 1e-8; a matrix far from normal doubles digits lost.
    np.testing.assert_allclose(found, expected, atol=1e-6)
    assert orbit.multipliers_error < 1e-7
    # A memory of thousands of turns is known as the distance from 1: 7e-5.
    lost = 1 - np.max(np.abs(expected))
    np.testing.assert_allclose(1 - orbit.largest_multiplier, lost, rtol=1e-3)


def test_an_oscillation_decays_as_the_largest_multiplier_says():
    """Integrated over 480 turns from a hundredth of a clearance beside the orbit.

    Logarithms of the sizes of eight parts lie on a line. A part that holds no whole number of
    oscillations is off by at most 1 / (60 turns x 2 sin(1.04)) = 1 %, and by 0.7 % RMS. The damping
    of the method itself is a fiftieth of the joint's.
    """
    orbit = jc.periodic_orbit(jc.paper_scene(25.0, 0.03e-3, restitution=0.2))
    beside = orbit.section + jnp.array([0.01, 0.0, 0.0, 0.0])
    run = eqx.filter_jit(section_points)
    points, _, outcome = run((beside, orbit.scene), turns=480, rtol=1e-10)
    apart = np.asarray(points - orbit.section[None])[:, :2].reshape(8, 60, 2)
    turns, sizes = 60 * np.arange(8), np.sqrt(np.mean(apart**2, axis=(1, 2)))
    line = linregress(turns, np.log(sizes))
    error = np.hypot(line.stderr, 0.007 / np.sqrt(np.sum((turns - turns.mean()) ** 2)))
    assert outcome.success and abs(line.slope - np.log(orbit.largest_multiplier)) < 3 * error


def test_a_multiplier_of_one_within_its_error_is_not_stable(orbit):
    """The swing keeps 0.99993 of itself a turn: it takes an error of 7e-5 to doubt that."""
    for error, stable in ((6e-5, True), (8e-5, False), (np.inf, False), (np.nan, False)):
        doubted = dataclasses.replace(orbit, multipliers_error=jnp.asarray(error))
        assert bool(doubted.stable) is stable
        assert bool(doubted.undecided) is not stable


def test_a_contact_that_takes_many_steps_has_one_verdict_eagerly_and_traced():
    """Balanced and slow, this pump's pin dies within a step of the usual length.

    The swing's multipliers are 0.988566 +- 0.0042i, all but a double one.
    """
    balanced = {"bodies.crank.mass_centre.x": -53.8e-3, "speed": 20 * np.pi}
    scene = jc.read_machine(EXAMPLES / "pump.toml").scene(**balanced)
    eager = jc.periodic_orbit(scene, nodes=96)
    traced = jax.jit(lambda scene: jc.periodic_orbit(scene, nodes=96))(scene)
    assert eager.stable and traced.stable
    # Of 65536 steps, which leave 1e-11; the error of these is 6e-7 of the matrix.
    for orbit in (eager, traced):
        np.testing.assert_allclose(orbit.largest_multiplier, 0.98857493143, rtol=1e-9)
        assert orbit.multipliers_error < UNSURE
    # A difference of two matrices, which rounding moves by 1e-13: that is 1e-7 of it.
    np.testing.assert_allclose(traced.multipliers_error, eager.multipliers_error, rtol=1e-5)


def test_a_neighbour_begins_at_an_orbit_unless_rest_leads_there(orbit):
    """From rest the same program finds it; shooting and other ways need a guess."""
    for name, asked in (
        ("sum", {"period", "nodes"}),
        ("rest", {"period", "nodes"}),
        ("damping", {"period", "nodes"}),
        ("waiting", {"period", "nodes", "guess"}),
        ("branch", {"period", "nodes", "guess"}),
        ("shooting", {"period", "method", "guess"}),
    ):
        alike = dataclasses.replace(orbit, way=getattr(WAYS, name)).alike
        assert alike.keys() == asked, name
        assert alike.get("nodes", 96) == 96 and alike.get("guess", orbit).way is not None


def test_statistics_of_the_motion(orbit):
    """Those of `statistics` over the turn from the orbit's own state, and of 30 000 turns."""
    np.testing.assert_allclose(orbit.foundation_rms, 19102.316, atol=1e-3)
    np.testing.assert_allclose(orbit.settling_turns, 14300, rtol=0.01)
    state = flat(orbit.state())
    names = tuple(orbit.scene.statistics)
    section = poincare_section(orbit.scene, 0, 1, state=state, outputs=names, rtol=1e-11)
    for name in names:
        # Samples stand 1 / 1024 of a turn apart, and a parabola is drawn through three of them.
        allowed = 1e-9 if isinstance(STATISTIC[name].reduction, AbstractMean) else 2e-4
        # What cancels, the winding, is rounding of 1e-12.
        expected = section.values[name][0]
        np.testing.assert_allclose(orbit[name], expected, rtol=allowed, atol=1e-11)
    angles = 2 * np.pi * np.arange(500) / 500
    seen = orbit.motion(angles, ("foundation_force", "eccentricity", "penetration_ratio"))
    rms = jnp.sqrt(jnp.mean(seen["foundation_force"] ** 2))
    # 500 instants see what 1024 do, to some 1e-12.
    np.testing.assert_allclose(rms, orbit.foundation_rms, rtol=1e-10)
    assert seen["eccentricity"].shape == (500, 2)
    assert seen["penetration_ratio"].min() >= orbit.least_penetration
    assert orbit.validity.inside


NAMES = tuple(numbers_of(jc.PE250X400))
# With friction that slides, and a counterweight, so that all numbers matter but one.
BASE = {"speed": 27.0, "clearance": 0.05e-3, "slip": "surface", "counterweight.mass": 50.0}


def rms(numbers, nodes=96):
    scene = jc.build_scene({**BASE, **dict(zip(NAMES, numbers, strict=True))})
    return jc.periodic_orbit(scene, nodes=nodes).foundation_rms


@pytest.mark.slow
def test_slopes_by_all_numbers():
    """Forward, reverse and central differences of orbits, of fourth order."""
    at = jnp.array([BASE.get(name, PARAMETERS[name].default) for name in NAMES])
    both = jax.jit(jax.value_and_grad(rms))
    # Without so many asked for, 96 nodes settle it.
    forward = jax.jit(jax.jacfwd(functools.partial(rms, nodes=None)))(at)
    middle, reverse = both(at)
    # Shares of the RMS for a number that grows by all of itself, of 1e-4 to 0.5; of the contact's
    # damping they are 1e-10, which is rounding, and the shaft's inertia does nothing.
    shares, backwards = (np.asarray(slope * at / middle) for slope in (forward, reverse))
    assert (np.abs(shares) > 1e-7).sum() == 25 and shares[NAMES.index("shaft.inertia")] == 0
    np.testing.assert_allclose(backwards, shares, rtol=1e-9, atol=1e-13)
    expected = differences(lambda by: both(by * at)[0] / middle, np.ones(len(at)), 1e-3, order=4)
    # Rounding of 1e-13 over the step, and its fourth power.
    np.testing.assert_allclose(shares, expected, rtol=1e-6, atol=2e-10, err_msg=str(NAMES))


def test_an_ideal_joint_is_a_sum():
    scene = jc.ideal_scene(30.0)
    found = jc.periodic_orbit(scene)
    assert found.success and found.stable and found.eccentricity is None
    section = poincare_section(scene, 0, 1, outputs=("foundation_rms", "foundation_peak"))
    np.testing.assert_allclose(found.foundation_rms, section.values["foundation_rms"][0], rtol=1e-8)
    # The parabola through three samples.
    np.testing.assert_allclose(
        found.foundation_peak, section.values["foundation_peak"][0], rtol=1e-6
    )
    forces = found.motion(np.linspace(0, 6, 7), ("foundation_force",))["foundation_force"]
    assert forces.max() < found.foundation_peak
    with pytest.raises(ValueError, match="`scene` must have a clearance joint, but is an ideal"):
        found.state()
    with jax.debug_nans(True):  # its restitution is none, and not a number that is not known
        assert jax.grad(lambda speed: jc.periodic_orbit(jc.ideal_scene(speed)).foundation_rms)(30.0)


@pytest.mark.slow
@pytest.mark.parametrize("load_law", ["closing_stroke", "none"])
def test_no_orbit_that_keeps_contact(load_law):
    """The load leaves the jaw within the turn: contact is lost, and nothing is returned."""
    found = jc.periodic_orbit(jc.paper_scene(30.0, 0.06e-3, load_law=load_law), nodes=96)
    assert not found.success and not found.stable and found.failure
    for number in (found.foundation_rms, found.foundation_peak, found.error, found.multipliers):
        assert np.isnan(number).all()


def test_refusals():
    """What collocation in the eccentricity cannot do, each in a line."""
    scene = jc.paper_scene(30.0, 0.06e-3)
    free = eqx.tree_at(lambda s: s.drive, scene, GivenTorque(100.0, 30.0))
    for bad, words in (
        (jc.paper_scene(30.0, 0.06e-3, formulation="multiplier"), "by eccentricity"),
        (free, "given speed"),
    ):
        with pytest.raises(ValueError, match=words):
            jc.periodic_orbit(bad)
    with pytest.raises(ValueError, match="nodes"):
        jc.periodic_orbit(scene, nodes=31)
    with pytest.raises(ValueError, match="period"):
        jc.periodic_orbit(scene, period=0)

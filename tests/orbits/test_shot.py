"""Orbits by the integrator have slopes and multipliers, whether they lose contact or not."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxcrusher as jc
from jaxcrusher.motion.section import Slices
from jaxcrusher.orbits import section_map, shot
from jaxcrusher.orbits.scene_problems import SceneFlow
from jaxcrusher.orbits.section_map import outputs_along, passed
from jaxcrusher.orbits.shot import closed
from jaxcrusher.periodic.shooting_problem import ShootingProblem
from tests.differences import differences

# rad/s, m: its jaw opens without load, and for a moment the pin leaves its bore.
CLOSING = jnp.array([34.23, 0.0645e-3])


def closing(point):
    return jc.paper_scene(point[0], point[1], load_law="closing_stroke")


def rms(point, **how):
    orbit = jc.periodic_orbit(closing(point), method="shooting", **how)
    return orbit.foundation_rms, orbit


@pytest.fixture(scope="module")
def waited():
    """An orbit and its slopes, traced: from the mean of turns that are waited for."""
    return eqx.filter_jit(jax.value_and_grad(rms, has_aux=True))


@pytest.mark.usefixtures("unchecked")  # a number in place of a scene
def test_what_is_seen_along_an_orbit_has_second_derivatives(monkeypatch):
    """Of x = p cos x, a turn of which leads to p cos x and shows p x^2."""

    def step(x, p):
        return p * jnp.cos(x), p * jnp.sum(x**2)

    def turned(p, x, rtol, outputs):
        end, value = step(x, p)
        return end, {"m": value[None]}

    def sloped_turn(build, point, x, rtol, outputs):
        def turn(x, point):
            return step(x, build(point))

        (jacobian, forcing), (by_state, by_parameter) = jax.jacfwd(turn, (0, 1))(x, point)
        end, value = turn(x, point)
        seen = [{"m": one[None]} for one in (value, by_state, by_parameter)]
        return end, Slices(jacobian[None], forcing[None], *seen), None

    def seen(p):
        x = jnp.asarray([0.7])
        for _ in range(50):  # a contraction by 0.5
            x = p * jnp.cos(x)
        return outputs_along(p, x, 1, 1e-9, ("m",))[1]["m"][0]

    def expected(p):
        x = 0.7
        for _ in range(200):
            x = p * jnp.cos(x)
        return p * x**2

    monkeypatch.setattr(section_map, "sloped_turn", sloped_turn)
    monkeypatch.setattr(section_map, "passed", turned)
    for of in (lambda function: function, jax.grad, jax.hessian):
        # Rounding, and what the contraction leaves.
        np.testing.assert_allclose(of(seen)(0.8), of(expected)(0.8), rtol=1e-12)


def test_the_error_of_multipliers_that_all_but_meet(monkeypatch):
    """A matrix that tolerances move by themselves: its double multiplier moves by their roots."""

    def sloped_turn(build, point, x, rtol, *_):
        one = jnp.stack([jnp.array([0.5, 1.0]), jnp.stack([rtol, jnp.asarray(0.5)])])
        none = jnp.zeros((1, 2, 0))
        return one @ x, Slices(one[None], none, {}, {}, {}), None

    monkeypatch.setattr(shot, "sloped_turn", sloped_turn)
    values, error = shot.integrated_multipliers(closing(CLOSING), jnp.zeros(2), 1)
    missed = np.max(np.abs(np.asarray(values) - 0.5))
    np.testing.assert_allclose(missed, np.sqrt(shot.ORBIT_RTOL), rtol=1e-6)
    assert missed < error < 20 * missed


@pytest.mark.slow
@pytest.mark.optimised
def test_an_orbit_that_loses_contact_has_slopes_in_a_traced_call(waited):
    """Beside differences of runs that have settled, which know nothing of orbits."""
    (value, orbit), slopes = waited(CLOSING)
    assert orbit.stable and orbit.least_penetration < 0 and orbit.found == "by shooting"

    @jax.jit
    def run(point):
        # From 0.01 clearances beside the orbit: the largest multiplier, 0.64, leaves 1e-8 of that,
        # and of where a neighbour begins a millionth.
        begun = orbit.section + jnp.array([0.01, 0.0, 0.0, 0.0])
        how = {"outputs": ("foundation_rms",), "rtol": 1e-12}
        return jc.poincare_section(closing(point), 30, 1, state=begun, **how)["foundation_rms"][0]

    assert float(value) == pytest.approx(float(run(CLOSING)), rel=1e-8)

    # Over steps of half the length runs that impact may differ too little: by 1e-9 of the RMS from
    # one version of XLA to the next. So differences are of fourth order.
    expected = differences(run, CLOSING, [5e-4, 2.5e-9], order=4)
    # Measured: 1e-4 and 2e-5; those of second order are off by 7e-4 and 6e-5.
    np.testing.assert_allclose(slopes, expected, rtol=3e-4)


@pytest.mark.slow
@pytest.mark.optimised
def test_a_failure_has_no_slopes(waited):
    """Where the motion is chaotic the mean of its turns leads to no orbit."""
    (value, orbit), slopes = waited(jnp.array([30.0, 0.06e-3]))
    assert not orbit.success and np.isnan(value) and np.isnan(slopes).all()
    assert np.isnan(orbit.multipliers).all()


@pytest.mark.slow
@pytest.mark.optimised
def test_an_eager_call_is_a_traced_one_and_its_multipliers_are_of_the_map(waited):
    (_, traced), _ = waited(CLOSING)
    _, orbit = rms(CLOSING, guess=traced)
    # The integrations of either leave what the orbit's error says.
    apart = 2 * float(orbit.error)
    np.testing.assert_allclose(orbit.foundation_rms, traced.foundation_rms, rtol=apart)
    pairs = (np.sort_complex(one.multipliers) for one in (orbit, traced))
    np.testing.assert_allclose(*pairs, atol=3 * float(orbit.multipliers_error))

    again = jc.periodic_orbit(orbit.scene, **orbit.alike)
    np.testing.assert_allclose(again.foundation_rms, orbit.foundation_rms, rtol=apart)

    def mapped(state):
        return np.asarray(jc.poincare_section(orbit.scene, 0, 1, state=state, rtol=1e-12).state)

    matrix = closed(orbit.scene, orbit.section, 1).matrix
    expected = differences(mapped, orbit.section, 1e-5)
    # Measured: 8e-6 with this step, 4e-5 with a tenth and 1e-3 with ten times of it.
    np.testing.assert_allclose(expected, matrix, atol=1e-4 * np.abs(matrix).max())
    found = np.linalg.eigvals(matrix)
    np.testing.assert_allclose(
        np.sort_complex(found), np.sort_complex(orbit.multipliers), atol=1e-5
    )


@pytest.mark.slow
@pytest.mark.optimised
def test_slopes_over_two_turns_are_those_over_one(waited):
    """Those of one turn are tested by differences."""
    (value, orbit), slopes = waited(CLOSING)
    of = {"guess": orbit.section, "period": 2}
    (again, twice), others = jax.value_and_grad(rms, has_aux=True)(CLOSING, **of)
    assert twice.period == 2
    # Shooting closes to 1e-7 clearances.
    np.testing.assert_allclose(again, value, rtol=1e-7)
    np.testing.assert_allclose(others, slopes, rtol=1e-4)
    # What either integration leaves of its matrix.
    assert float(twice.largest_multiplier) == pytest.approx(
        float(orbit.largest_multiplier) ** 2, rel=1e-6
    )


def test_what_shooting_needs_is_said_in_one_line():
    scene = closing(CLOSING)
    for how, line in (
        ({"nodes": 96}, 'Argument `nodes` must be None with method="shooting", but is 96.'),
        (
            {"guess": np.zeros(3)},
            "Argument `guess` must be a PeriodicOrbit, or a section point of shape (4,), "
            "but is of shape (3,).",
        ),
    ):
        with pytest.raises(ValueError) as refused:
            jc.periodic_orbit(scene, method="shooting", **how)
        assert str(refused.value) == line


@pytest.mark.slow
def test_slices_of_a_turn_from_states_of_their_own():
    """Joined, they are the turn: the last ends where that ends, and their matrices multiply."""
    section = np.array([0.6, 0.8, -0.003, 0.002])
    shooting = ShootingProblem(flow=SceneFlow(eqx.Partial(closing)))
    at = shooting.linearised(shooting.unknowns_from(section, CLOSING), CLOSING)
    turned = lambda state: np.asarray(passed(closing(CLOSING), jnp.asarray(state), 1e-11)[0])  # noqa: E731
    left = at.residual.reshape(8, 4)
    np.testing.assert_allclose(left[:-1], 0.0, atol=1e-12)
    # A turn makes some hundreds of the tolerances, 1e-10 and 1e-11.
    np.testing.assert_allclose(left[-1], turned(section) - section, atol=1e-7)
    shift = 2e-4 * np.array([1.0, -1.0, 0.02, 0.03])
    grown = (turned(section + shift) - turned(section - shift)) / 2
    expected = at.seen.matrix @ shift
    # Runs of a tolerance of 1e-11 leave up to 6e-9 by any shift from 2e-6 on, of 5e-5 here.
    np.testing.assert_allclose(grown, expected, atol=2e-8)

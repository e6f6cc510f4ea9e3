"""Every design gets an answer: an orbit by some way, or what the motion does instead."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxcrusher as jc
from jaxcrusher.orbits import tries
from jaxcrusher.orbits.result import RESULTS, WAYS
from jaxcrusher.orbits.transient import Round, Wait
from jaxcrusher.orbits.tries import Search, Try, searched

# Near a harmonic of the drive Newton's method fails from rest. RMS of 20 turns after 3000 from the
# start in contact, at a tolerance of 1e-9, by the integrator.
TONGUES = [(33.457, 0.10988e-3, 19563.158876), (36.882, 0.08524e-3, 20609.260234)]


def rms(speed, clearance):
    return jc.periodic_orbit(jc.paper_scene(speed, clearance, slip="surface")).foundation_rms


@pytest.mark.parametrize(("speed", "clearance", "waited"), TONGUES)
def test_a_damping_is_lowered_where_rest_is_too_far(speed, clearance, waited):
    orbit = jc.periodic_orbit(jc.paper_scene(speed, clearance, slip="surface"))
    assert orbit.stable and orbit.found == "from the pins at rest, by a damping lowered to none"
    # The runs' tolerance leaves 1e-10.
    assert float(orbit.foundation_rms) == pytest.approx(waited, rel=1e-9)
    again = jc.periodic_orbit(jc.paper_scene(speed, clearance, slip="surface"))
    for one, other in zip(jax.tree.leaves(orbit), jax.tree.leaves(again), strict=True):
        np.testing.assert_array_equal(one, other)


def test_where_motions_coexist_the_answer_is_what_the_machine_comes_to():
    """A damping leads to a quieter motion, of 20 931.5 N, to which no start near rest comes."""
    scene = jc.paper_scene(37.8047, 0.094538e-3, slip="surface")
    orbit = jc.periodic_orbit(scene)
    assert orbit.stable and orbit.found == "from the mean of turns that were waited for"
    # RMS of 20 turns after 3000 by the integrator, within what the nodes know of it.
    assert orbit.error < 1e-6
    assert float(orbit.foundation_rms) == pytest.approx(21113.789507, rel=float(orbit.error))
    quiet = jc.periodic_orbit(scene, nodes=384)
    assert quiet.stable and float(quiet.foundation_rms) == pytest.approx(20931.5, abs=0.1)


def test_slopes_of_an_orbit_that_took_the_long_way():
    """By the equations themselves, eagerly and under `jax.jit`, which lowers the same damping."""
    speed, clearance, waited = TONGUES[0]
    slope = jax.grad(rms, argnums=1)(speed, clearance)
    value, traced = jax.jit(jax.value_and_grad(rms, argnums=1))(speed, clearance)
    assert float(value) == pytest.approx(waited, rel=1e-9)
    assert float(traced) == pytest.approx(float(slope), rel=1e-6)
    # Central differences over 1 nm: 19 563.1588742 N is known to 1e-11, which leaves 2e-5 of it.
    assert float(slope) == pytest.approx(-201103.0, rel=5e-5)


def test_a_guess_is_not_left_for_the_pins_at_rest_under_jit():
    """The fixed tries of a traced call: its guess, or rest and the damping."""
    speed, clearance, _ = TONGUES[0]
    scene, far = jc.paper_scene(speed, clearance, slip="surface"), jnp.full((96, 2), 0.1)

    @jax.jit
    def found(scene, guess):
        return jc.periodic_orbit(scene, nodes=96, guess=guess)

    failed, orbit = found(scene, far), found(scene, jnp.full((96, 2), jnp.nan))
    assert not failed.success and np.isnan(failed.foundation_rms)
    assert orbit.success and orbit.found.endswith("by a damping lowered to none")


def test_the_first_stable_orbit_is_the_answer(monkeypatch):
    """An unstable orbit that is found first is kept for the case that no try finds another."""
    scene = jc.paper_scene(27.0, 0.05e-3)
    stable = jc.periodic_orbit(scene, nodes=96)
    unstable = dataclasses.replace(stable, multipliers=2 * stable.multipliers, way=WAYS.guess)
    none = dataclasses.replace(stable, result=RESULTS.not_closed)
    made = {"stable": stable, "unstable": unstable, "none": none}

    def answer(*names):
        tried = [Try(made[name], made[name]) for name in names]
        monkeypatch.setattr(tries, "_tries", lambda *_: iter(tried))
        return searched(Search(scene, scene, None, None, None), None)

    assert answer("none", "unstable", "stable", "none").way == WAYS.rest
    assert answer("none", "unstable", "none").way == WAYS.guess
    assert not answer("none", "none").success


def test_means_are_taken_over_the_turns_that_a_motion_repeats_after():
    turns, swing = np.arange(120), 1e-3 * np.sin(0.7 * np.arange(120))
    quiet, doubled = (
        swing[:, None] * np.ones(4),
        (swing + 0.1 * (-1.0) ** turns)[:, None] * np.ones(4),
    )
    assert [turns for turns, _ in Round(quiet).means(None)] == [1]
    found = dict(Round(doubled).means(None))
    # The swing leaves a hundredth of itself in the mean of sixty turns.
    assert list(found) == [1, 2] and np.allclose(found[2], -0.1, atol=1e-4)
    assert list(dict(Round(doubled).means(3))) == [3]


@pytest.mark.slow
def test_what_has_no_orbit_is_named():
    """The jaw that its load leaves goes from impact to impact."""
    orbit = jc.periodic_orbit(jc.paper_scene(30.0, 0.06e-3, load_law="closing_stroke"))
    assert not orbit.success and np.isnan(orbit.foundation_rms)
    assert orbit.failure == "The motion from rest is chaotic: disturbances of it grow."


def test_a_motion_that_repeats_is_told_from_chaos(monkeypatch):
    wait = Wait(jc.paper_scene(27.0, 0.05e-3))
    monkeypatch.setattr(wait, "_whirls", lambda: False)
    assert wait.regime(RESULTS.not_closed) == RESULTS.not_closed
    wait._last = Round(np.tile([[0.1] * 4, [0.2] * 4], (120, 1)))
    assert wait.regime(RESULTS.not_closed) == RESULTS.repeats
    wait._last = Round(np.random.default_rng(0).uniform(size=(240, 4)))
    assert wait.regime(RESULTS.not_closed) == RESULTS.aperiodic
    wait._chaotic = True
    assert wait.regime(RESULTS.not_closed) == RESULTS.chaotic
    monkeypatch.setattr(wait, "_whirls", lambda: True)
    assert wait.regime(RESULTS.not_closed) == RESULTS.whirl

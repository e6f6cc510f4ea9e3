"""Branches of a crusher's orbits."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

import jaxcrusher as jc
from jaxcrusher.orbits import orbit_branch
from jaxcrusher.orbits.result import RESULTS, missing


def scene(speed):
    return jc.build_scene({"speed": speed, "clearance": 0.1e-3})


@pytest.mark.slow
def test_a_fold_of_the_crusher():
    """At 0.1 mm the quiet motion ends at 37.3155 rad/s; below, another stable one is as quiet."""
    bounds = (37.1, 37.6)
    found = jc.orbit_branch(scene, "speed", 37.25, bounds, scale=1.0, points=60)
    (fold,) = found.events
    assert fold.kind == "fold"
    # 96 nodes a turn say 37.31547; from 192 to 384 it moves by 2e-8.
    np.testing.assert_allclose(fold.parameter, 37.31552, atol=2e-5)
    assert fold.error < 1e-7
    parameter, stable = found.table.parameter.values, found.table.stable.values
    turned = int(np.argmax(parameter))
    assert stable[: turned - 1].all() and not stable[turned + 1 :].any()
    other = jc.orbit_branch(scene, "speed", 37.5, bounds, upwards=False, scale=1.0, points=60)
    # Both are stable at one speed, and differ by more than their errors.
    both = []
    for branch, until in ((found, turned), (other, None)):
        near = int(np.argmin(np.abs(branch.table.parameter.values[:until] - 37.25)))
        assert bool(branch.table.stable[near])
        both.append(float(branch.table.foundation_rms[near]))
    assert 80 < both[1] - both[0] < 140
    assert "resolve" in other.ended or "bounds" in other.ended


CLEARANCE = 0.1e-3


def worn(speed):
    return jc.build_scene({"speed": speed, "clearance": CLEARANCE})


@pytest.mark.slow
def test_a_global_that_changes_is_seen(monkeypatch):
    """By each call anew: another program for another scene, and the same for the same."""
    seen, traces = [], []

    @eqx.filter_jit
    def clearance(family, value):
        traces.append(CLEARANCE)
        return family(value).args.joints.at("main").clearance

    def follow(problem, x, start, **_):
        seen.append(float(clearance(problem.family, jnp.asarray(start))))
        raise StopIteration

    monkeypatch.setattr(orbit_branch, "follow", follow)
    expected = [0.1e-3, 0.06e-3, 0.1e-3]
    for value in expected:
        monkeypatch.setitem(globals(), "CLEARANCE", value)
        with pytest.raises(StopIteration):
            jc.orbit_branch(worn, "speed", 30.0, (29.0, 31.0), nodes=96)
    assert seen == expected and traces == expected[:2]


def test_a_branch_is_made_of_orbits():
    """It begins at a known orbit, and its last point lies on the bound."""

    def scene(speed):
        return jc.paper_scene(speed, 6e-5)

    found = jc.orbit_branch(scene, "speed", 30.0, (30.0, 30.05), scale=1.0, points=9, nodes=96)
    assert found.found == "by collocation with 96 nodes a turn"
    table = found.table
    assert np.all(np.diff(table.parameter) > 0)
    np.testing.assert_allclose(table.parameter[-1], 30.05, rtol=1e-15)  # rounding
    # As in `test_periodic_orbit`.
    np.testing.assert_allclose(table.foundation_rms[0], 19102.316, atol=1e-3)
    # Inertia grows with the square of the speed, and what the clearance adds not twice as fast.
    grown = table.foundation_rms[-1] / table.foundation_rms[0]
    assert 1 < grown < (table.parameter[-1] / 30) ** 4
    assert bool(table.stable.all())


@pytest.mark.slow
def test_nodes_that_do_not_serve_are_told():
    """96 nodes resolve the motion, and tell what 48 leave to shooting: warned of, and as exact."""
    with pytest.warns(UserWarning, match="followed by shooting, .* 48 nodes a turn do not serve"):
        found = jc.orbit_branch(
            scene, "speed", 37.3, (37.29, 37.302), scale=1.0, points=9, nodes=48
        )
    assert found.found == "by shooting from 8 states a turn"
    table = found.table.isel(point=-1)
    np.testing.assert_allclose(table.parameter, 37.302, rtol=1e-15)  # rounding
    nodal = jc.periodic_orbit(scene(37.302), nodes=192, guess=found.orbits[-1].eccentricity)
    errors = table.multipliers_error + nodal.multipliers_error
    assert 0 < table.multipliers_error < 1e-5 and table.stable and not table.undecided
    moduli = [np.sort(np.abs(one.multipliers)) for one in (found.orbits[-1], nodal)]
    assert np.max(np.abs(moduli[0] - moduli[1])) < errors


def test_a_start_that_is_no_number_is_refused(unchecked):
    with pytest.raises(ValueError, match="`start` must be a number, but is 'x'"):
        jc.orbit_branch(scene, "speed", "x", (31.0, 32.0))  # pyright: ignore[reportArgumentType]


def test_refusals():
    with pytest.raises(ValueError, match=r"`start` must lie in \[31, 32\], but is 30.0"):
        jc.orbit_branch(scene, "speed", 30.0, (31.0, 32.0))
    with pytest.raises(ValueError, match="`points` must be a whole number"):
        jc.orbit_branch(scene, "speed", 30.0, (29.0, 32.0), points=0)
    with pytest.raises(ValueError, match="`machine` must have a constant impact velocity, but tr"):
        jc.orbit_branch(jc.paper_machine(impact_law="tracked"), "speed", 30.0, (29.0, 32.0))
    lost = missing(jc.paper_scene(30.0, 0.1e-3), 2, RESULTS.not_closed)
    with pytest.raises(ValueError, match="`period` must be the guess's 2, but is 1"):
        jc.orbit_branch(scene, "speed", 30.0, (29.0, 32.0), period=1, guess=lost)

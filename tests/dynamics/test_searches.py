"""Searches side by side: each has the answer that it has alone, and all end together."""

import numpy as np
import pytest

import jaxcrusher as jc
from jaxcrusher.basics.record import words
from jaxcrusher.dynamics import searches
from jaxcrusher.dynamics.searches import together
from jaxcrusher.orbits.effort import Budget
from jaxcrusher.orbits.result import RESULTS, WAYS
from jaxcrusher.orbits.transient import Transient, resting_start


def waited(case, runs):
    """Wait for a crusher of some clearance (m) as the effort `quick` does."""
    ((clearance,),) = case
    wait = Transient(jc.paper_scene(30.0, float(clearance)), Budget("quick"), runs)
    rounds = list(wait.rounds())
    return {"mean": rounds[-1].states.mean(axis=0), "turns": np.asarray(wait.budget.turns)}


def test_turns_of_searches_are_those_of_each_alone():
    """Whichever other searches there are; what fills a chunk is zero."""
    clearances = np.array([0.06e-3, 0.05e-3, np.nan])
    both = together(waited, ((clearances,),))
    assert both["turns"].tolist() == [480, 480, 0] and not both["mean"][2].any()
    one = together(waited, ((clearances[1:],),))
    np.testing.assert_array_equal(one["mean"], both["mean"][1:])


def test_what_two_searches_ask_for_is_integrated_at_once(monkeypatch):
    """A kernel takes hardly longer for both. Here none is left behind for being slow."""
    monkeypatch.setattr(searches, "QUIET", 60.0)
    integrations = []
    for clearances in ([0.06e-3], [0.06e-3, 0.05e-3]):
        told = []
        together(waited, ((np.array(clearances),),), tell=lambda told=told: told.append(1))
        integrations.append(len(told))
    assert integrations[0] == integrations[1] > 20


def test_searches_end_where_that_is_asked():
    """A long wait shows that it goes on, and Ctrl-C ends it, and all others with it."""
    told = []

    def tell():
        told.append(len(told))
        if len(told) == 3:
            raise InterruptedError

    with pytest.raises(InterruptedError):
        together(waited, ((np.array([0.06e-3, 0.05e-3]),),), tell=tell)
    assert told == [0, 1, 2]


def test_an_error_of_a_search_is_raised():
    def fails(case, runs):
        ((clearance,),) = case
        if clearance > 0.055e-3:
            raise ArithmeticError
        return waited(case, runs)

    with pytest.raises(ArithmeticError):
        together(fails, ((np.array([0.06e-3, 0.05e-3]),),))


def test_turns_for_slopes_are_those_of_a_lone_search():
    """By another program: to the tolerance of the integration, 1e-8, and what it grows by."""
    start, scene = resting_start(jc.paper_scene(30.0, 0.06e-3))
    points = np.asarray(start) + 1e-3 * np.eye(4)

    def turned(case, runs):
        ends, steps = runs.turn(points, scene)
        return {"ends": ends, "steps": np.asarray(steps)}

    alone, many = (
        turned(None, Transient(scene, Budget("quick"))._runs),
        together(turned, ((np.zeros(1),),)),
    )
    np.testing.assert_allclose(many["ends"][0], alone["ends"], atol=1e-6)
    assert many["steps"][0] == pytest.approx(alone["steps"], rel=0.02) and alone["steps"] > 1000


@pytest.mark.slow
def test_a_cell_of_a_map_is_a_lone_answer():
    """An orbit from rest, one that has doubled, chaos, and a pair that has left the unit circle."""
    paper, hit = jc.paper_machine(), jc.paper_machine(load_law="closing_stroke")
    for made, speeds, clearances in (
        (paper, [27.0, 40.0], [0.05e-3, 0.0975e-3]),
        (hit, [34.51], [0.05e-3, 0.12e-3]),
    ):
        found = jc.orbit_map(made, {"speed": speeds, "clearance": clearances})
        for i, k in np.ndindex(len(speeds), len(clearances)):
            cell = found.isel(speed=i, clearance=k)
            machine = made.replace(speed=speeds[i], clearance=clearances[k])
            orbit = jc.periodic_orbit(machine.scene())
            named = "" if orbit.from_rest is None else words(RESULTS, orbit.from_rest)
            assert str(cell.motion.values) == named
            if str(cell.found.values) == words(WAYS, WAYS.neighbour):
                assert not orbit.success
                continue
            assert bool(cell.success) == bool(orbit.success)
            assert bool(cell.stable) == bool(orbit.stable)
            if orbit.success:
                # Newton's method ends with a step of 1e-12 of a clearance, or of an integration.
                np.testing.assert_allclose(cell.foundation_rms, orbit.foundation_rms, rtol=1e-9)
                assert int(cell.period) == orbit.period


@pytest.mark.slow
def test_a_map_names_a_motion_round_an_unstable_orbit():
    """A pair of multipliers has left the unit circle: the motion turns round the orbit."""
    axes = {"speed": [40.0], "clearance": [0.075e-3, 0.0975e-3]}
    found = jc.orbit_map(jc.paper_machine(), axes, effort="thorough").isel(speed=0)
    assert found.success.values.all() and found.stable.values.tolist() == [True, False]
    name = words(RESULTS, RESULTS.quasi_periodic)
    assert found.motion.values.tolist() == ["", name]
    # As a lone call finds them.
    np.testing.assert_allclose(found.foundation_rms, [22320.44114, 22509.25530], atol=1e-3)
    assert np.isnan(found.run_rms[0]) and found.run_rms_error[1] < 0.1
    assert found.largest_multiplier[1] == pytest.approx(1.0019934, abs=1e-6)
    # By `statistics` at a hundredth of the tolerance, over turns 5000 to 6000 from contact.
    rms, error = 22507.0542, 0.4125
    assert abs(rms - found.run_rms[1]) < 4 * (found.run_rms_error[1] + error)

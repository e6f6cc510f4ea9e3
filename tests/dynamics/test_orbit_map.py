"""Settled motions over a grid: each cell as if it were alone, failures with their reasons."""

import numpy as np
import pytest

import jaxcrusher as jc
from jaxcrusher.batch.engines import in_turn
from jaxcrusher.dynamics import orbit_map as module
from jaxcrusher.dynamics.orbit_map import orbit_map

SLOPES = ("speed", "clearance")


def test_cells_against_known_orbits():
    """As published for 10 000 turns and for single orbits; slopes as those of `periodic_orbit`."""
    axes = {"speed": [25.0, 27.0, 30.0], "clearance": [0.03e-3, 0.05e-3, 0.06e-3]}
    finished = []
    found = orbit_map(axes, slopes=SLOPES, progress=lambda *counts: finished.append(counts))
    assert found.success.all() and found.stable.all() and (found.failure == "").all()
    diagonal = np.diag(found.foundation_rms)
    np.testing.assert_allclose(diagonal, [18243.41119, 18524.1596, 19102.31571], atol=1e-4)
    turns = [float(found.settling_turns[i, i]) for i in (0, 2)]
    np.testing.assert_allclose(turns, [4726, 14321], rtol=1e-3)
    assert found.slope.dims == ("speed", "clearance", "parameter")
    # Central differences of single orbits, to the digits given.
    np.testing.assert_allclose(found.slope[1, 1], [163.53380, 30125.956], rtol=1e-6)
    moduli = np.hypot(found.multiplier_real, found.multiplier_imag)
    np.testing.assert_allclose(moduli.max("multiplier"), found.largest_multiplier, rtol=1e-12)
    assert finished[0] == (0, 9) and finished[-1] == (9, 9)
    assert found.attrs["period"] == 1 and "30.0" not in found.attrs["parameters"]


def test_failures_do_not_stop_the_others():
    """At 45 rad/s Newton's method finds nothing: a reason, and no number."""
    axes = {"speed": [27.0, 45.0], "joint": ["clearance", "ideal"]}
    found = orbit_map(axes, base={"clearance": 0.05e-3}, slopes=SLOPES, nodes=96)
    assert found.success.values.tolist() == [[True, True], [False, True]]
    lost = found.isel(speed=1, joint=0)
    assert str(lost.failure.values) != "" and not lost.stable
    for name in ("foundation_rms", "slope", "largest_multiplier", "settling_turns", "error"):
        assert np.isnan(lost[name]).all(), name
    np.testing.assert_allclose(found.foundation_rms[0, 0], 18524.1596, atol=1e-4)


def test_a_failed_cell_is_tried_from_its_neighbours():
    """Each neighbour once, along numbers only, those that failed not at all."""
    grid = module._Grid((2, 3, 2), (True, True, False), {"speed": np.arange(12.0)})
    tried = []

    def solve(_, wanted, engine):
        for number, guess in wanted:
            tried.append((number, guess[0, 0]))
            # The last cell wants its neighbour 8, the others anything; 6 wants what there is not.
            good = number not in (6, 10) or (number == 10 and guess[0, 0] == 8.0)
            orbit = np.full((4, 2), float(number))
            yield number, {"success": good, "eccentricity": orbit, "error": 0.0}

    grid._solve = solve
    grid.fill(solve, [0, 2, 4, 6, 8, 10], 4, in_turn, lambda *counts: None)
    assert [number for number, guess in tried if np.isnan(guess)] == [0, 2, 4, 6, 8, 10]
    again = [pair for pair in tried if not np.isnan(pair[1])]
    assert sorted(again) == [(6, 0.0), (6, 8.0), (6, 10.0), (10, 4.0), (10, 8.0)]
    assert grid.rows[10]["success"] and not grid.rows[6]["success"]
    # With more nodes: only what failed, or is not known well, that from itself.
    tried.clear()
    grid.rows[4]["error"] = 1e-6
    grid.fill(solve, [0, 2, 4, 6, 8, 10], 8, in_turn, lambda *counts: None)
    assert tried[0] == (4, 4.0) and tried[1][0] == 6 and np.isnan(tried[1][1])
    assert {number for number, _ in tried} == {4, 6}


def test_neighbours_further_away_are_tried_too():
    """The nearest first; of guesses that fill a chunk the first that leads somewhere counts."""
    grid = module._Grid((9,), (True,), {"speed": np.arange(9.0)})
    tried = []

    def solve(_, wanted, engine):
        for number, guess in wanted:
            tried.append((number, guess[0, 0]))
            good = number != 3 or guess[0, 0] in (5, 6)
            yield number, {"success": good, "eccentricity": guess, "error": guess[0, 0]}

    grid._solve = solve
    grid._own = lambda number, points: np.full((4, 2), float(number))
    grid.fill(solve, list(range(9)), 4, in_turn, lambda *counts: None)
    near = [guess for number, guess in tried if number == 3]
    # Itself, and as far as there are cells, and four steps at most.
    assert near == [3, 2, 4, 1, 5, 0, 6, 7]
    assert grid.rows[3]["error"] == 5


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"slopes": ("velocity",)}, "`slopes` must be a known name, but is 'velocity'"),
        ({"metric": "noise"}, "`metric` must be one of"),
        ({"nodes": 95}, "`nodes` must be even"),
        ({"base": {"impact_law": "tracked"}}, "`scene` must have a constant impact velocity"),
        ({"axes": {"speed": [-1.0]}}, "`speed` must be finite"),
    ],
)
def test_refusals(arguments, message):
    with pytest.raises(ValueError, match=rf"^Argument {message}"):
        orbit_map(**{"axes": {"speed": [30.0]}, **arguments})


def test_public_name():
    assert jc.orbit_map is orbit_map

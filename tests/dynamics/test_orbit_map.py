"""Periodic orbits over a grid: each cell as if it were alone, failures with their reasons."""

import numpy as np
import pytest

import jaxcrusher as jc
from jaxcrusher.batch.cluster import local_workers
from jaxcrusher.batch.engines import in_turn
from jaxcrusher.dynamics import many_orbits as orbits
from jaxcrusher.dynamics.orbit_map import orbit_map

pytestmark = pytest.mark.usefixtures("compiled_once")
SLOPES, PAPER = ("speed", "clearance"), jc.paper_machine()


@pytest.mark.slow  # 27 s of a slow processor
def test_cells_against_known_orbits():
    """As published for 10 000 turns and for single orbits; slopes as those of `periodic_orbit`."""
    axes = {"speed": [25.0, 27.0, 30.0], "clearance": [0.03e-3, 0.05e-3, 0.06e-3]}
    finished = []
    found = orbit_map(
        PAPER, axes, slopes=SLOPES, nodes=96, progress=lambda *counts: finished.append(counts)
    )
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
    assert (found.period == 1).all() and "30.0" not in found.attrs["parameters"]


@pytest.mark.slow
def test_failures_do_not_stop_the_others():
    """At 45 rad/s Newton's method finds nothing: a reason, and no number."""
    axes = {"speed": [27.0, 45.0], "joint": ["clearance", "ideal"]}
    found = orbit_map(PAPER.replace(clearance=0.05e-3), axes, slopes=SLOPES, nodes=96)
    assert found.success.values.tolist() == [[True, True], [False, True]]
    lost = found.isel(speed=1, joint=0)
    assert str(lost.failure.values) != "" and not lost.stable
    for name in ("foundation_rms", "slope", "largest_multiplier", "settling_turns", "error"):
        assert np.isnan(lost[name]).all(), name
    np.testing.assert_allclose(found.foundation_rms[0, 0], 18524.1596, atol=1e-4)


def test_a_failed_cell_is_tried_from_its_neighbours():
    """From each that is stable once, along numbers only, and from those that it leads to."""
    near = orbits.beside((2, 3, 2), (True, True, False))
    assert [near(cell) for cell in (0, 2, 11)] == [[6, 2], [8, 0, 4], [5, 9]]
    asked, number = [], np.arange(12.0)

    def solve(which, guesses):
        asked.extend(zip(which.tolist(), guesses.tolist(), strict=True))
        good = np.isin(which, (8, 10))  # 10 from 8 alone, which has to be found first
        found = {"success": good, "stable": good, "period": np.ones(len(which), int)}
        return found | {"eccentricity": which.astype(float), "motion": np.full(len(which), "no")}

    rows = {
        "success": ~np.isin(number, (6, 8, 10)),
        "stable": ~np.isin(number, (0, 6, 8, 10)),  # nothing is tried from 0
        "period": np.where(number == 4, 2, 1),  # and from 4, of another period
        "eccentricity": number.copy(),
        "motion": np.full(12, "chaos"),
        "way": np.zeros(12, int),
    }
    orbits.from_neighbours(rows, near, solve, 16, 1)
    assert sorted(asked) == [(6, 8.0), (8, 2.0), (10, 8.0)]
    assert rows["success"].tolist() == (number != 6).tolist() and (rows["motion"] == "chaos").all()


def test_killed_and_called_again_ends_with_the_same_bits(tmp_path):
    """A map that stops after its first chunk goes on with what the journal holds."""
    axes = {"speed": [27.0, 33.0], "clearance": list(np.linspace(4e-5, 6e-5, 9))}
    # The program of the map above; nodes that are given leave out what waits and shoots.
    asked = {"machine": PAPER, "axes": axes, "slopes": SLOPES, "nodes": 96}
    whole, solved = orbit_map(**asked), []

    class Killed(Exception):
        pass

    def engine(function, cases):
        solved.append(1)
        if len(solved) == 2:
            raise Killed
        return in_turn(function, cases)

    engine.__qualname__ = "counting"
    with pytest.raises(Killed):
        orbit_map(**asked, store=tmp_path / "map", engine=engine)
    first = len(list(tmp_path.glob("map/.sweep/journal/*.chunk")))
    found = orbit_map(**asked, store=tmp_path / "map", engine=engine)
    assert first == 1 and not (tmp_path / "map/.sweep/journal").exists()
    for name, values in whole.items():
        again, other = found[name].values, values.values
        # Words are objects, whose bytes are places in memory.
        words = other.dtype.kind == "O"
        assert (again == other).all() if words else again.tobytes() == other.tobytes(), name
    # A finished store is only read.
    count = len(solved)
    orbit_map(**asked, store=tmp_path / "map", engine=engine)
    assert len(solved) == count
    with pytest.raises(ValueError, match=r"of period none \(now 2\)"):
        orbit_map(**asked, store=tmp_path / "map", engine=engine, period=2)


@pytest.mark.slow
def test_maps_on_two_workers_have_the_same_bits():
    pytest.importorskip("distributed")
    axes = {"speed": np.linspace(27.0, 40.0, 9), "clearance": [0.05e-3, 0.12e-3]}
    few = {"speed": [27.0, 30.0]}, {"starts": 4, "turns": 100, "spread": 0.02}
    differ = []
    with local_workers("2") as client:
        for make, over, how in ((orbit_map, axes, {"slopes": SLOPES}), (jc.basin_map, *few)):
            here, there = (make(PAPER, over, **how, scheduler=one) for one in (None, client))
            for name in here:
                one, other = here[name].values, there[name].values
                words = one.dtype.kind == "O"
                if not ((one == other).all() if words else one.tobytes() == other.tobytes()):
                    differ.append(name)
    assert differ == []


def _with_law(gap):
    return jc.paper_scene(27.0, gap * 1e-3)


@pytest.mark.slow
def test_a_scene_function_of_ones_own():
    found = orbit_map(_with_law, {"gap": [0.05, 0.06]}, slopes=("gap",))
    machine = jc.paper_machine(speed=27.0)
    same = orbit_map(machine, {"clearance": [5e-5, 6e-5]}, slopes=("clearance",))
    np.testing.assert_allclose(found.foundation_rms, same.foundation_rms, rtol=1e-12)
    # Per mm instead of per m.
    np.testing.assert_allclose(found.slope[:, 0], same.slope[:, 0] * 1e-3, rtol=1e-9)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"slopes": ("velocity",)}, "`slopes` must be a known name, but is 'velocity'"),
        ({"metric": "noise"}, "`metric` must be one of"),
        ({"nodes": 95}, "`nodes` must be even"),
        ({"period": 0}, "`period` must be a whole number >= 1"),
        (
            {"machine": jc.paper_machine(impact_law="tracked")},
            "`scene` must have a constant impact velocity",
        ),
        ({"axes": {"speed": [-1.0]}}, "`speed` must be finite"),
    ],
)
def test_refusals(arguments, message):
    with pytest.raises(ValueError, match=rf"^Argument {message}"):
        orbit_map(**{"machine": PAPER, "axes": {"speed": [30.0]}, **arguments})


def test_public_name():
    assert jc.orbit_map is orbit_map


@pytest.mark.slow
def test_a_store_keeps_other_programs_of_the_same_numbers_apart(tmp_path):
    """Choices are in the program of a cell and not among its numbers."""
    axes, settings = {"slip": ["centre", "surface"], "speed": [27.0]}, {"nodes": 96}
    machine = jc.paper_machine(clearance=5e-5)
    whole = orbit_map(machine, axes, **settings)
    kept = orbit_map(machine, axes, **settings, store=tmp_path / "map")
    centre, surface = whole.foundation_rms.values[:, 0]
    # Friction between the surfaces takes some 400 N off.
    assert centre - surface > 100
    np.testing.assert_array_equal(kept.foundation_rms, whole.foundation_rms)

"""The motions that starts come to over a grid."""

import dataclasses
from pathlib import Path

import equinox as eqx
import numpy as np
import pytest
import xarray as xr

import jaxcrusher as jc
from jaxcrusher.dynamics.coexisting_orbits import CoexistingOrbits, coexisting_orbits
from jaxcrusher.motion.flow import initial_state


@pytest.mark.slow
def test_two_designs_side_by_side(monkeypatch):
    """A quiet one beside one of several motions: each as `coexisting_orbits` finds it alone."""
    told, asked, whole = [], [], coexisting_orbits

    def looks(scene, **given):
        asked.append((scene, given, whole(scene, **given)))
        return asked[-1][2]

    monkeypatch.setattr("jaxcrusher.dynamics.coexisting_orbits.coexisting_orbits", looks)
    found = jc.basin_map(
        {"speed": [30.0, 40.0], "clearance": [0.12e-3]},
        starts=8,
        turns=400,
        progress=lambda done, of: told.append((done, of)),
    )
    assert told == [(0, 2), (1, 2), (2, 2)]
    assert found.worst_rms.dims == ("speed", "clearance")
    _, (scene, given, alone) = asked
    assert eqx.tree_equal(scene, jc.paper_scene(40.0, 0.12e-3))
    assert given == {"starts": 8, "turns": 400, "spread": 0.5, "seed": 0}
    here = found.isel(speed=1, clearance=0)
    count = len(alone.orbits)
    assert count > 1 and found.sizes["orbit"] == count
    np.testing.assert_array_equal(here.label, alone.labels)
    np.testing.assert_array_equal(here.start_state, alone.starts)
    np.testing.assert_array_equal(here.share, alone.shares)
    np.testing.assert_array_equal(here.share_error, alone.share_errors)
    assert here.orbit_period.values.tolist() == [orbit.period for orbit in alone.orbits]
    reached = [float(one.foundation_rms) for one in alone.orbits]
    reached = [rms for rms, share in zip(reached, alone.shares, strict=True) if share > 0]
    assert float(here.worst_rms) == max(reached) > float(here.likeliest_rms) - 1e-9
    assert float(here.likeliest_rms) == reached[0]
    assert float(here.unsettled) == np.mean(alone.labels < 0)
    quiet = found.isel(speed=0, clearance=0)
    # Most swing about the one quiet motion after 400 turns; further columns are empty.
    assert quiet.share.values[0] > 0.5 and np.isnan(quiet.orbit_rms.values[count - 1])
    assert quiet.orbit_period.values[count - 1] == 0


@pytest.mark.parametrize("kind", ["tracked", "linkage"])
def test_states_with_a_memory_and_a_linkage_that_is_no_crusher(kind, monkeypatch):
    """Each has its own number of coordinates, and its own leading statistic."""
    path = Path(__file__).parents[2] / "examples" / "slider_crank.toml"
    crusher = jc.paper_scene(30.0, 0.06e-3, impact_law="tracked")
    scene = crusher if kind == "tracked" else jc.read_scene(path)
    starts, orbit = np.tile(initial_state(scene), (2, 1)), jc.periodic_orbit(scene.ideal())
    found = CoexistingOrbits((orbit,), starts, np.zeros(2, int), {})
    monkeypatch.setattr(
        "jaxcrusher.dynamics.coexisting_orbits.coexisting_orbits", lambda *_, **__: found
    )
    mapped = jc.basin_map({"of": [1.0]}, scene=lambda of: scene, starts=2)
    np.testing.assert_array_equal(mapped.start_state[0], starts)
    assert float(mapped.worst_rms[0]) == float(orbit[scene.leading])


def test_a_stored_map_that_was_stopped_goes_on(tmp_path, monkeypatch):
    """What is finished is not looked at again, and the table is that of a map in memory."""
    # So close to the quiet orbit that no other has to be searched for, which takes a minute.
    how = {"starts": 4, "turns": 100, "spread": 0.02}
    how["base"] = {"clearance": 0.06e-3, "start": "contact"}
    whole, looked = coexisting_orbits, []

    def looks(scene, **given):
        if len(looked) == 1:
            looked.append(None)
            raise KeyboardInterrupt
        looked.append(scene)
        found = whole(scene, **given)
        # One start counts as unsettled, so that labels of either kind are stored.
        return dataclasses.replace(found, labels=np.append(found.labels[:-1], -1))

    monkeypatch.setattr("jaxcrusher.dynamics.coexisting_orbits.coexisting_orbits", looks)
    with pytest.raises(KeyboardInterrupt):
        jc.basin_map({"speed": [27.0, 30.0]}, store=tmp_path / "map", **how)
    stored = jc.basin_map({"speed": [27.0, 30.0]}, store=tmp_path / "map", **how).load()
    assert len(looked) == 3  # one, the interruption, and the other one
    in_memory = jc.basin_map({"speed": [27.0, 30.0]}, **how)
    assert np.unique(stored.label).tolist() == [-1, 0]
    xr.testing.assert_equal(stored, in_memory)
    with pytest.raises(ValueError, match="seed"):
        jc.basin_map({"speed": [27.0, 30.0]}, store=tmp_path / "map", seed=1, **how)

"""The motions that starts come to over a grid."""

import dataclasses
from pathlib import Path

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
import xarray as xr

import jaxcrusher as jc
from jaxcrusher.dynamics.coexisting_orbits import CoexistingOrbits, coexisting_orbits
from jaxcrusher.motion.flow import initial_state


def test_two_designs_side_by_side(monkeypatch):
    """A design of one motion beside one of three, to one of which no start comes."""
    told, asked = [], []
    orbit = jc.periodic_orbit(jc.paper_scene(27.0, 0.05e-3), nodes=96)
    starts = np.random.default_rng(0).uniform(size=(8, 4))

    def of(rms, period):
        return dataclasses.replace(orbit, values={"foundation_rms": jnp.array(rms)}, period=period)

    made = [
        CoexistingOrbits((of(1.0, 1),), starts, np.array([0, 0, 0, 0, 0, 0, 0, -1]), {"": 0.125}),
        CoexistingOrbits(
            (of(2.0, 2), of(4.0, 1), of(8.0, 3)), -starts, np.array([1, 0, 0, -1, 0, -1, 1, 0]), {}
        ),
    ]

    def looks(scene, **given):
        asked.append((scene, given))
        return made[len(asked) - 1]

    monkeypatch.setattr("jaxcrusher.dynamics.coexisting_orbits.coexisting_orbits", looks)
    found = jc.basin_map(
        jc.paper_machine(),
        {"speed": [30.0, 40.0], "clearance": [0.12e-3]},
        starts=8,
        turns=400,
        progress=lambda done, of: told.append((done, of)),
    )
    assert told == [(0, 2), (1, 2), (2, 2)]
    assert found.worst_rms.dims == ("speed", "clearance")
    for speed, (scene, given) in zip((30.0, 40.0), asked, strict=True):
        assert eqx.tree_equal(scene, jc.paper_scene(speed, 0.12e-3))
        assert given == {"starts": 8, "turns": 400, "spread": 0.5, "seed": 0}
    one, many = (found.isel(speed=i, clearance=0) for i in (0, 1))
    for here, there in ((one, made[0]), (many, made[1])):
        count = len(there.orbits)
        np.testing.assert_array_equal(here.label, there.labels)
        np.testing.assert_array_equal(here.start_state, there.starts)
        np.testing.assert_array_equal(here.share[:count], there.shares)
        np.testing.assert_array_equal(here.share_error[:count], there.share_errors)
    assert many.orbit_rms.values.tolist() == [2.0, 4.0, 8.0]
    assert many.orbit_period.values.tolist() == [2, 1, 3]
    # No start comes to the loudest.
    assert float(many.worst_rms) == 4.0 and float(many.likeliest_rms) == 2.0
    assert float(one.unsettled) == 0.125 and float(many.unsettled) == 0.25
    # Further columns are empty.
    assert one.orbit_period.values.tolist() == [1, 0, 0]
    for name in ("share", "share_error", "orbit_rms"):
        assert np.isnan(one[name][1:]).all()


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
    mapped = jc.basin_map(lambda of: scene, {"of": [1.0]}, starts=2)
    np.testing.assert_array_equal(mapped.start_state[0], starts)
    assert float(mapped.worst_rms[0]) == float(orbit[scene.headline])


def test_a_stored_map_that_was_stopped_goes_on(tmp_path, monkeypatch):
    """What is finished is not looked at again, and the table is that of a map in memory."""
    # So close to the quiet orbit that no other has to be searched for, which takes a minute.
    how = {"starts": 4, "turns": 100, "spread": 0.02}
    asked = jc.paper_machine(clearance=0.06e-3, start="contact"), {"speed": [27.0, 30.0]}
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
        jc.basin_map(*asked, store=tmp_path / "map", **how)
    stored = jc.basin_map(*asked, store=tmp_path / "map", **how).load()
    assert len(looked) == 3  # one, the interruption, and the other one
    in_memory = jc.basin_map(*asked, **how)
    assert np.unique(stored.label).tolist() == [-1, 0]
    xr.testing.assert_equal(stored, in_memory)
    with pytest.raises(ValueError, match="seed"):
        jc.basin_map(*asked, store=tmp_path / "map", seed=1, **how)


@pytest.mark.parametrize("asked", [{"starts": -3}, {"spread": 0.0}, {"turns": 95}, {"seed": -1}])
def test_what_is_out_of_range_is_refused_before_a_store_is_made(asked, tmp_path):
    (name,) = asked
    with pytest.raises(ValueError, match=f"^Argument `{name}` must be "):
        jc.basin_map(jc.paper_machine(), {"speed": [27.0]}, store=tmp_path / "map", **asked)
    assert not (tmp_path / "map").exists()


def test_an_axis_is_named_like_no_dimension_of_the_results():
    """The starts of the axis would be taken for the random ones, where these are two as well."""
    with pytest.raises(ValueError, match=r"`axes` must name none of the results' own .* is start"):
        jc.basin_map(jc.paper_machine(), {"start": ["contact", "centred"]}, starts=2)

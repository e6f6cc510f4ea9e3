"""The batch engine and the sweep."""

import json
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from distributed.protocol.pickle import dumps, loads

import jaxcrusher as jc
from jaxcrusher.batch.engines import in_turn, map_all, map_chunks, side_by_side
from jaxcrusher.batch.points import make_grid
from jaxcrusher.batch.sweep import plan
from jaxcrusher.crusher.statistics_table import STATISTIC
from jaxcrusher.scenes.machine import machine_of


def _double(x):
    return {"twice": 2 * x}


FACTOR = 2.0


def _scaled(x):
    return FACTOR * x


@pytest.mark.parametrize("engine", [None, in_turn, side_by_side])
def test_a_global_that_changes_is_seen(engine, monkeypatch):
    """By each call anew, also where only a number of the trace differs."""
    values = jnp.arange(1.0, 5.0)
    for factor in (2.0, 3.0, 2.0):
        monkeypatch.setitem(globals(), "FACTOR", factor)
        np.testing.assert_array_equal(map_all(_scaled, values, engine=engine), factor * values)
        chunks = map_chunks(_scaled, values, 2, engine)
        joined = np.concatenate([part for _, part in chunks])
        np.testing.assert_array_equal(joined, factor * values)


@pytest.mark.parametrize("count, chunk", [(1, 4), (7, 3), (8, 8), (5, 64)])
def test_chunks_keep_order_and_length(count, chunk):
    values = jnp.arange(float(count))
    parts = list(map_chunks(eqx.Partial(_double), values, chunk))
    joined = np.concatenate([part["twice"] for _, part in parts])
    np.testing.assert_array_equal(joined, 2 * np.arange(count))
    assert [rows.start for rows, _ in parts] == [*range(0, count, parts[0][0].stop)]
    seen = []
    whole = map_all(eqx.Partial(_double), values, chunk, progress=lambda *p: seen.append(p))
    np.testing.assert_array_equal(whole["twice"], joined)
    assert seen == [(rows.stop, count) for rows, _ in parts]


def test_an_engine_of_another_name_is_refused_before_anything_is_computed(unchecked, tmp_path):
    with pytest.raises(ValueError, match=r"Argument `engine` must be one of 'lanes', 'loop'"):
        map_all(_double, jnp.arange(3.0), engine="vmapped")
    with pytest.raises(ValueError, match="Argument `engine` must"):
        jc.sweep(
            jc.paper_machine(), {"speed": [30.0]}, 0, 1, store=tmp_path / "grid", engine="vmapped"
        )
    assert not (tmp_path / "grid").exists()


def test_the_engine_asked_for_is_used():
    values = jnp.arange(6.0)
    for engine in (None, in_turn, side_by_side, "lanes", "loop", "vmap"):
        result = map_all(eqx.Partial(_double), values, engine=engine)
        np.testing.assert_array_equal(result["twice"], 2 * values)

    def mine(function, scenes):
        return {"twice": -function(scenes)["twice"]}

    result = map_all(eqx.Partial(_double), values, engine=mine)
    np.testing.assert_array_equal(result["twice"], -2 * values)


def test_sweep_equals_single_runs():
    axes, seen = {"speed": [28.0, 33.0], "load": [4e3, 7e3, 1e4]}, []
    ideal = jc.paper_machine(joint="ideal")
    grid = jc.sweep(ideal, axes, 0, 2, chunk=4, progress=lambda *p: seen.append(p))
    assert grid.foundation_rms.dims == ("speed", "load")
    assert grid.foundation_rms.attrs["units"] == "N" and grid["load"].attrs["units"] == "N"
    assert bool(grid.success.all()) and seen == [(0, 6), (3, 6), (6, 6)]
    one = jc.statistics(jc.ideal_scene(33.0, load=1e4), 0, 2)
    # The same program on another batch differs by rounding only.
    same = grid.sel(speed=33.0, load=1e4)
    assert float(same.foundation_rms) == pytest.approx(float(one.foundation_rms), rel=1e-9)
    assert float(same.foundation_peak) == pytest.approx(float(one.foundation_peak), rel=1e-7)


def _half(function, numbers):
    return jax.tree.map(lambda leaf: leaf.astype(float) / 2, in_turn(function, numbers))


def test_the_engine_of_a_sweep_is_used_and_told_apart(tmp_path):
    asked = jc.paper_machine(joint="ideal"), {"speed": [28.0, 33.0]}, 0, 1
    whole = jc.sweep(*asked, rtol=1e-6, engine=in_turn)
    half = jc.sweep(*asked, rtol=1e-6, engine=_half, store=tmp_path / "half")
    np.testing.assert_array_equal(half.foundation_rms, whole.foundation_rms / 2)
    assert (whole.engine, half.engine) == ("loop", "_half")
    with pytest.raises(ValueError, match=r"`engine` must be '_half' for .* but is 'lanes' here"):
        jc.sweep(*asked, rtol=1e-6, store=tmp_path / "half")


@pytest.mark.slow
def test_loose_elbow_and_pivot_through_lanes():
    """The same statistics, limits included, as one motion by diffrax; names say whose they are."""
    given = {"load_law": "normal_to_jaw", "start": "contact", "pivot.clearance": 8e-5}
    machine = jc.paper_machine(**given)
    grid = jc.sweep(machine, {"elbow.clearance": [5e-5, 1e-4]}, 0, 1, rtol=1e-10)
    scene = machine.scene(**{"elbow.clearance": 1e-4})
    one, at = jc.statistics(scene, 0, 1, rtol=1e-10), grid.isel({"elbow.clearance": 1})
    for name in one.values:
        # A quiet motion, both at 1e-10 a step.
        assert float(at[name]) == pytest.approx(float(one[name]), rel=1e-6, abs=1e-8), name
    assert float(at.pivot_half_width_ratio) == pytest.approx(
        float(one.validity.others["pivot"].half_width_ratio), rel=1e-6
    )
    assert bool(at.inside_model) and set(one.validity.others) == {"elbow", "pivot"}
    assert {"elbow_contact_fraction", "pivot_impact_speed_ratio"} < set(grid)


@pytest.mark.slow
def test_a_curve_may_be_an_array():
    """It is a choice of every design, as a file is, and another curve is another motion."""
    angle = np.radians(np.arange(0.0, 360.0, 30.0))
    curve = np.stack([angle, 3e3 + 6e3 * np.cos(angle - 2.0) ** 2], 1)
    machine = jc.paper_machine(load_law="by_angle", load_curve=curve, start="contact")
    found = jc.sweep(machine, {"speed": [25.0, 30.0]}, 0, 1, rtol=1e-6)
    for speed, rms in zip((25.0, 30.0), found.foundation_rms.values, strict=True):
        alone = jc.statistics(machine.scene(speed=speed), 0, 1, rtol=1e-6)
        # Lanes round differently, and one impact magnifies that: a load 1 % larger differs by 1e-2.
        assert rms == pytest.approx(float(alone.foundation_rms), rel=1e-3)
    for bad in (np.zeros(3), [[1.0, 2.0], [3.0]]):
        with pytest.raises(ValueError, match=r"^Argument `load_curve` must be rows of"):
            jc.sweep(machine.replace(load_curve=bad), {"speed": [25.0]}, 0, 1)


def test_a_file_may_be_a_path():
    file = Path("examples/double_toggle_load.csv")
    machine = jc.paper_machine(load_law="by_angle", load_curve=file)
    one = make_grid(machine, {"speed": [25.0]})
    other = make_grid(machine, {"speed": [25.0], "load_curve": [file]})
    assert one.base["load_curve"] == str(file) and other.axes["load_curve"] == (str(file),)


def test_choices_come_in_any_order():
    """Numbers of the first choice were once handed to the others, which refused them."""
    loads = ["chamber", "along_jaw"]
    machine = jc.paper_machine(start="contact")
    first = jc.sweep(machine, {"load_law": loads}, 0, 1, rtol=1e-6)
    second = jc.sweep(machine, {"load_law": loads[::-1]}, 0, 1, rtol=1e-6)
    np.testing.assert_array_equal(first.foundation_rms, second.foundation_rms[::-1])


@pytest.mark.parametrize("laws", [["lankarani_nikravesh", "rollers"], ["rollers"]])
def test_a_design_is_judged_by_all_that_it_has(laws):
    """Rollers beside pins were once outside of the model, for their pressure was not computed."""
    machine = jc.paper_machine(start="contact")
    found = jc.sweep(machine, {"contact_law": laws}, 0, 1, rtol=1e-6)
    assert found.inside_model.all() and float(found.roller_pressure[-1]) > 1e8  # Pa
    assert bool(np.isnan(found.roller_pressure[0])) == (len(laws) > 1)


def test_designs_of_a_scene_of_ones_own_have_the_joints_that_they_have():
    def seats(speed, worn, gap=5e-5):
        clearance = {"elbow.clearance": gap} if worn == "worn" else {}
        described = {"speed": speed, "start": "contact", "load_law": "normal_to_jaw"}
        return jc.build_scene(described | clearance)

    machine = machine_of(seats).replace(speed=30.0, gap=5e-5)
    found = jc.sweep(machine, {"worn": ["new", "worn"]}, 0, 1, rtol=1e-6)
    assert found.success.all() and np.isnan(found.elbow_half_width_ratio[0])
    assert found.elbow_half_width_ratio[1] > 0
    # Nobody has told the unit of the gap: it is not 1.
    assert json.loads(found.attrs["parameters"]) == {"speed": [30.0, "rad/s"], "gap": [5e-5, None]}
    with pytest.raises(ValueError, match="`axes` must hold a number, such as the speed, where the"):
        jc.sweep(lambda worn: seats(30.0, worn), {"worn": ["new"]}, 0, 1)
    with pytest.raises(ValueError, match=r"`outputs` must name statistics that these designs have"):
        jc.sweep(machine, {"worn": ["new"]}, 0, 1, outputs=("bearing_life",))


def test_statistics_of_one_s_own_go_along_to_a_worker():
    def carried(speed):
        return jc.ideal_scene(speed).with_statistics({"carried": STATISTIC["foundation_mean"]})

    made = plan(
        make_grid(machine_of(carried), {"speed": [30.0]}), 0, 1, 1e-6, None, None, ["carried"]
    )
    _, values, _ = loads(dumps(made)).compute(0)
    assert values["carried"] == values["foundation_mean"]

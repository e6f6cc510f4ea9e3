"""The design search, end to end on a small box, and what it refuses."""

import inspect
import io
import json
import math
import re
from dataclasses import fields, replace
from pathlib import Path
from threading import Event
from types import SimpleNamespace
from typing import Literal, get_args, get_origin, get_type_hints

import jax.numpy as jnp
import numpy as np
import pytest
import xarray as xr
from rich.console import Console
from rich.progress import Progress as Bars

import jaxcrusher as jc
from jaxcrusher.batch.engines import Engine
from jaxcrusher.batch.sweep import columns_of_row
from jaxcrusher.commands.options import Sweep
from jaxcrusher.crusher.capacity import CrushingChamber
from jaxcrusher.crusher.template import STATISTIC
from jaxcrusher.files.journal import Journal, text_of
from jaxcrusher.files.text import number
from jaxcrusher.joint.validity import ELASTIC_IMPACT_SPEED, Validity
from optimize.answer import Answer, Bound, Check, Coexisting, Confirmed, Maps
from optimize.ask.constraints import of_orbits
from optimize.ask.limits import Limit
from optimize.ask.objectives import OBJECTIVES, OF_SUPPORTS, plain
from optimize.ask.options import Options
from optimize.ask.resolve import resolve
from optimize.design_search import _for_seconds, design_search
from optimize.run import search
from optimize.search import bound, confirm, landscape, stages
from optimize.search import descents as local
from optimize.search import orbits as periodic
from optimize.search.bound import Points, _at_most, _motion, optimality_bound, refined, unbounded
from optimize.search.cells import ROUGHER, Cells, beside
from optimize.search.evaluate import NOWHERE, Window, evaluate, judged
from optimize.search.front import nondominated
from optimize.search.motions import INSTANTS
from optimize.tell import checks as verdicts
from optimize.tell import words as formatting
from tests.optimize.by_hand import (
    maps_of,
    no_orbit,
    orbit_by_hand,
    printed,
    rows_of_three_runs,
    solution_by_hand,
)

pytestmark = pytest.mark.usefixtures("compiled_once")
SMALL = dict(cells=(7, 4), grid=(4, 2), settle=2, turns=2, steps=6, refine=1, runs=2)
EXAMPLE = Path(__file__).parents[2] / "examples" / "pe250x400.toml"
# The paper's crusher, compared with at 30 rad/s and 0.06 mm. In this box every point of the map has
# a stable orbit, and after three times as many turns no start impacts any more.
QUIET = SMALL | {"scene": EXAMPLE, "speed": ("25", "37.5rad/s"), "cells": (6, 4), "settle": 10}


@pytest.fixture(scope="module")
def resumed(tmp_path_factory):
    """A search without time, interrupted after its maps, then ended; what each run computed."""
    options = Options(out=tmp_path_factory.mktemp("results"), name="small", **QUIET)
    folder, computed, alarms = options.folder, [], []
    asked, place, keep = {}, Journal.place, Journal.keep

    def placed(journal, function, inputs):
        path = place(journal, function, inputs)
        asked[path] = function, path.name
        return path

    def counted(journal, path, arrays):
        computed.append(asked[path])
        keep(journal, path, arrays)
        for ring in alarms:
            ring()

    def timer(_, ring):
        """Ring when a chunk is kept: how many there are in a time differs by machine."""
        return SimpleNamespace(start=lambda: alarms.append(ring), cancel=alarms.clear)

    def interrupt(*_):
        raise KeyboardInterrupt

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Journal, "place", placed)
        patch.setattr(Journal, "keep", counted)
        with patch.context() as timed, pytest.raises(SystemExit) as ended:
            timed.setattr("optimize.design_search.Timer", timer)
            search(replace(options, seconds=0.01))
        hurried = SimpleNamespace(
            code=ended.value.code,
            result=(folder / "result.json").read_text(),
            report=(folder / "report.html").read_text(),
            computed=len(computed),
            chunks=[*(folder / "chunks").iterdir()],
        )
        with patch.context() as stopped:
            stopped.setattr(local, "descend_together", interrupt)
            with pytest.raises(KeyboardInterrupt):
                design_search(options, Console(quiet=True))
        maps, chunks = list(computed), list((folder / "chunks").iterdir())
        left = {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}
        computed.clear()
        answer = design_search(options, Console(quiet=True))
    return SimpleNamespace(
        folder=folder,
        answer=answer,
        maps=maps,
        chunks=chunks,
        left=left,
        rest=computed,
        hurried=hurried,
    )


@pytest.fixture(scope="module")
def finished(resumed):
    return resumed.folder, resumed.answer


def test_result_holds_the_evidence(finished):
    folder, returned = finished
    result = json.loads((folder / "result.json").read_text())
    assert result["status"] == "finished"
    optimum, other = result["optimum"], result["reference"]
    # The RMS rises with speed and clearance: the box's lower corner, to the last bit, and the
    # steady-state RMS solved for by another program (to its ten digits).
    assert optimum["values"] == {"speed": 25.0, "clearance": pytest.approx(0.03e-3, rel=1e-15)}
    assert optimum["foundation_rms"] == pytest.approx(18243.41119, rel=1e-9)
    assert other["foundation_rms"] == pytest.approx(19102.31571, rel=1e-9)
    assert optimum["objective"] == optimum["foundation_rms"]
    # Beside them what the ground feels: four digits of the ideal joint's, which clearance leaves.
    shaking = optimum["shaking_rms"], other["shaking_rms"]
    assert shaking == pytest.approx((3134.5, 4513.63), rel=1e-3)
    assert optimum["ideal_rms"] < optimum["foundation_rms"] * 1.003
    # What the transient's long runs say stands beside it, told apart.
    values = optimum["transient"][optimum["worse_start"]]["by_run"]["objective"]
    assert len(values) == 2 and abs(np.mean(values) - optimum["objective"]) > 1
    # Both limits are active constraints; the multiplier of each is the slope there.
    assert [(one["parameter"], one["limit"]) for one in result["active"]] == [
        ("speed", "lowest"),
        ("clearance", "lowest"),
    ]
    assert result["active"][0]["multiplier"] == optimum["orbit"]["slopes"]["speed"] > 100
    orbit = optimum["orbit"]["solution"]
    moduli = np.hypot(*np.transpose(orbit["multipliers"]))
    assert moduli.max() == pytest.approx(orbit["largest_multiplier"], rel=1e-12)
    # e / c where the state begins with it.
    assert orbit["section"] == pytest.approx(orbit["state"][:2], rel=1e-12)
    bound = result["bound"]
    assert 0 < bound["within"] < 100 and "more than" in bound["statement"]
    assert result["box"]["bounds"]["speed"] == [25.0, 37.5]
    assert all({"name", "passed", "detail"} == check.keys() for check in result["checks"])
    assert all(check["passed"] for check in result["checks"]), result["checks"]
    told_otherwise = {"problem", "maps", "ends"}
    assert {field.name for field in fields(returned)} - told_otherwise < result.keys()
    assert {"orbits", "landscape", "refinement", "confirmation"} <= result["seconds"].keys()
    page = (folder / "report.html").read_text()
    assert "Run it at 25 rad/s (239 rpm, the lowest allowed) with 0.0" in page
    assert "RMS shaking force 3.135 kN against 4.516 kN." in page
    # Both fronts are the optimum.
    assert "pareto.svg is not drawn: nothing has to be traded" in page
    assert not (folder / "pareto.svg").exists()
    assert "http://" not in page.replace("http://www.w3.org", "")
    assert 0 < optimum["transient"]["contact"]["validity"]["half_width_ratio"] < 0.5


def test_answer_to_another_question_is_kept(finished):
    folder, _ = finished
    with pytest.raises(ValueError, match=r"`name` must .* of .*objective \"rms\" \(now \"peak\"\)"):
        asked = Options(out=folder.parent, name="small", objective="peak", **QUIET)
        design_search(asked, Console(quiet=True))
    assert (folder / "result.json").exists() and (folder / "landscape.svg").exists()


def test_the_closing_screen(finished):
    _, answer = finished
    runs = answer.optimum.transient["centred"]
    wide = replace(runs, validity=replace(runs.validity, half_width_ratio=jnp.array(1.8)))
    transient = answer.optimum.transient | {"centred": wide}
    optimum = replace(answer.optimum, transient=transient)
    text = printed(replace(answer, optimum=optimum), 200)
    assert text.startswith("Outside the contact model: the best is 25 rad/s")
    reason = "because of centred start, contact of half-width 1.80 radii: not Hertzian"
    assert reason in " ".join(text.split())
    # 80 columns and 40 lines hold it, with every digit.
    text = printed(answer)
    assert "18243.41" in text and "19102.32" in text and "…" not in text
    shaking = answer.reference.forces["shaking_rms"]
    assert re.search(rf"RMS of the shaking force +N +3135 +{number(shaking)} +-30\.6 % *\n", text)
    assert text.count("\n") < 39 and "10 of 10 checks passed." in text
    wrong = Check("inside the box", False, "speed 24.9 in 25 to 40 rad/s")
    checks, remark = (wrong, *answer.checks[1:]), "Two of the points are new."
    failed = "9 of 10 checks passed.\nfailed inside the box: speed 24.9 in 25 to 40 rad/s\n"
    text = printed(replace(answer, checks=checks, remark=remark))
    assert failed in text and text.endswith(f"{remark}\n")
    # With long names as well, and every design keeps its own.
    values = {"counterweight.mass": 20.2047, "jaw.mass_centre_distance": 0.30125}
    free = zip(values, ("0", "250"), ("60 kg", "350 mm"), strict=True)
    answer = replace(
        answer,
        problem=resolve(Options(scene=EXAMPLE, design=tuple(free))),
        optimum=replace(answer.optimum, values=values),
        reference=replace(answer.reference, values=values),
    )
    text = printed(answer)
    assert re.search(r"unit +optimum +scene file's choice +change *\n", text)
    assert re.search(r"counterweight mass +kg +20\.2047 +20\.2047 *\n", text)
    assert re.search(r"jaw mass centre distance +mm +301\.25 +301\.25 *\n", text)
    assert re.search(r"RMS of \|R_O\| \+ \|R_C\| +N +18243\.41 +19102\.32 +-4\.5 % *\n", text)
    assert max(map(len, text.splitlines())) <= 80 and "…" not in text


def test_map_of_orbits_is_labelled(finished):
    folder, _ = finished
    with xr.open_dataset(folder / "orbits.nc") as orbits:
        turn = {"instant": INSTANTS, "axis": 2}
        assert dict(orbits.sizes) == {"speed": 6, "clearance": 4, "parameter": 2} | turn
        assert orbits.slope.dims == ("speed", "clearance", "parameter")
        assert json.loads(orbits.attrs["bounds"])["speed"] == [25.0, 37.5]
        cell = orbits.isel(speed=0, clearance=0)
        assert float(cell.objective) == pytest.approx(18243.41119, rel=1e-9)
        # The multiplier that orbits.md of the docs gives: 1/e in some 4700 turns.
        assert float(cell.settling_turns) == pytest.approx(4726, rel=1e-3)
        assert cell.failure == "" and bool(cell.counts)
    for name in ("curve", "orbits", "settling", "landscape", "capacity", "motion"):
        assert (folder / f"{name}.svg").stat().st_size > 10_000


CENTRE = np.array([0.3, 0.6])


def bowl(problem, units, neighbours=None, **how):
    """Rows of points whose objective is a bowl, as a map has them: all are stable, and count."""
    rows = {name: np.ones(len(units), bool) for name in ("success", "stable", "counts")}
    return rows | {
        "undecided": ~rows["stable"],
        "objective": 2e4 + 1e3 * ((units - CENTRE) ** 2).sum(axis=1),
        "slope": 2e3 * (units - CENTRE) / periodic.widths(problem),
        "failure": np.full(len(units), "It is chaotic."),
    }


@pytest.fixture
def bounded(monkeypatch):
    """A function that bounds the bowl on 7 by 4 points, of which some columns may be changed.

    It returns the bound, the points, and how often points were run, solved for and waited for. Runs
    come to so much `above` the optimum.
    """
    problem = resolve(Options(**SMALL))
    units = landscape.points(problem.design, (7, 4), 0, 0)
    best = SimpleNamespace(objective=2e4, values=problem.design.numbers(CENTRE))
    repeats = confirm.Repeats(2, Window(1, 1, 1e-6), 0)

    def bounded(within, function=bowl, above=0.0, **changed):
        ran, solved, waited = [], [], []

        def runs(problem, units, repeats, tracking):
            ran.append(len(units))
            return [{"objective": np.full((2, 2), best.objective + above)}] * len(units)

        def solve(problem, units, effort=None, **how):
            (solved if effort is None else waited).append(len(units))
            rows = function(problem, units)
            return rows if effort is None else rows | {n: c[27:] for n, c in changed.items()}

        monkeypatch.setattr(bound, "long_runs", runs)
        monkeypatch.setattr(bound, "solve", solve)
        points = Points(problem, units, function(problem, units) | changed, repeats)
        found = refined(points, Cells.of_grid((7, 4)), best, within)
        return optimality_bound(found, best), ran, solved, waited

    return bounded


def test_runs_speak_for_points_without_a_stable_orbit(bounded):
    known, ran, _, _ = bounded(100.0)
    assert not ran and known.by_runs == () and known.open_points == 0
    stable = np.arange(28) != 27
    lost = {"stable": stable, "counts": stable}
    said, ran, solved, waited = bounded(100.0, above=4000.0, **lost)
    # Short runs are far above the optimum, and nothing is waited for: the bound is the orbits'.
    assert ran == [1] and not waited and said.within == known.within
    assert "no stable orbit of one turn is known: runs there come to 24000 N" in said.statement
    assert "4 kN above the optimum" in said.statement
    assert f"global within the box to {_at_most(said.within, 'N')}" in said.statement
    (point,) = said.by_runs
    assert point.values["speed"] == 40.0 and point.motion == "It is chaotic." and point.place == 27
    # Half a cell away they may be lower, by twice the largest fall about the points beside: then
    # the point is waited for.
    near, ran, more, waited = bounded(100.0, above=10.0, **lost)
    assert waited == [1] and ran == [1]
    assert sum(more) > sum(solved) and near.within <= 100.0
    # Runs that scatter tell nothing, and say so; smaller cells would not help.
    low, _, solved, _ = bounded(100.0, above=-4000.0, **lost)
    assert "4 kN below the optimum: they scatter too much" in low.statement
    assert low.within > 4000.0 and sum(solved) < 100
    assert not re.search(r"[ (]-\d", low.statement)


def map_of_the_bowl(problem) -> Maps:
    """Return 7 by 4 points of the bowl, all of which count; two cells of the landscape end well."""
    units = landscape.points(problem.design, (7, 4), 0, 0)
    dims = ("speed", "clearance")
    orbits = xr.Dataset(
        {
            name: ((*dims, "parameter")[: 1 + column.ndim], column.reshape(7, 4, *column.shape[1:]))
            for name, column in bowl(problem, units).items()
        }
    )
    success, cells = np.ones((2, 2), bool), ("start", "cell")
    begun = xr.Dataset({"success": (cells, success), "whirl": (cells, ~success)})
    return Maps(np.array([[0.0, 0.0], [1.0, 1.0]]), begun, units, orbits)


def test_the_bound_is_of_the_optimum_that_is_reported(monkeypatch, tmp_path):
    """Of one that random starts bring to an orbit of 700 N more than its own."""
    problem = resolve(Options(**SMALL))
    rows = rows_of_three_runs() | {"objective": np.full((2, 3), 2e4)}
    best = confirm.confirmed(problem, CENTRE, rows, orbit_by_hand(objective=2e4))
    maps = map_of_the_bowl(problem)
    loud = Coexisting(0.5, solution_by_hand(), 20700.0)
    monkeypatch.setattr(bound, "solve", bowl)
    monkeypatch.setattr(periodic, "coexisting", lambda *_: (loud,))
    work = stages.Work(tmp_path, Bars(disable=True), Journal(tmp_path))
    begun = Answer(problem, "", {}, maps=maps, optimum=best, reference=best)
    found = stages.bound(begun, work)
    assert found.optimum.objective == 20700.0 and found.bound.gain == pytest.approx(-700, abs=0.1)
    assert 700 <= found.bound.within < 701
    assert "global within the box to 710 N" in found.bound.statement


def test_an_optimum_that_does_not_settle_is_held_against_the_map():
    """Its mean lies 500 N above the bowl's least, which is 6 N below that of the map."""
    problem = resolve(Options(**SMALL))
    best = SimpleNamespace(settles=False, objective=20500.0, half_width=1.0)
    maps = map_of_the_bowl(problem)
    found = unbounded(problem, maps, best)
    lowest = float(maps.counting_orbits.objective.min())
    assert found.within is None and found.gain == lowest - 20500 < -400
    assert "could be mapped" not in found.statement
    # A cell where a start whirls holds no design that could have been chosen.
    maps.landscape.whirl[:] = True
    assert unbounded(problem, maps, best).gain == 0.0


def test_a_bound_is_rounded_up():
    """To the nearest two digits 0.514 would be 0.51, and 1049 would be 1000."""
    bounds = {0.0: "0 N", 0.5: "0.5 N", 0.514: "0.52 N", 1049.0: "1.1 kN", 2.3e-13: "2.3e-13 N"}
    assert {value: _at_most(value, "N") for value in bounds} == bounds


def test_nothing_is_said_of_what_breaks_a_constraint(bounded, monkeypatch):
    stable = np.arange(28) != 27
    unsaid, ran, _, _ = bounded(100.0, counts=stable)
    assert unsaid.open_points == 1 and not ran and "Nothing is said of 1 of" in unsaid.statement
    assert "global" not in unsaid.statement
    # Nor of more motions without an orbit than are run.
    monkeypatch.setattr(bound, "MOST_OPEN", 0)
    many, ran, _, _ = bounded(100.0, counts=stable, stable=stable)
    assert many.by_runs == () and not ran and many.open_points == 1


def test_cells_are_halved_until_the_bound_is_as_asked(bounded, monkeypatch):
    """The least of the bowl is inside a cell, which may hold less than any point."""
    coarse, _, solved, _ = bounded(1000.0)
    # Only they are halved, once, and second derivatives are those that were measured before.
    assert 0 < sum(solved) <= 9 * 5 and 0 < coarse.within < 1000.0
    assert "they are 1 times" in coarse.statement and coarse.curvature <= coarse.within

    def raised(problem, units):
        rows = bowl(problem, units)
        return rows | {"objective": rows["objective"] + 20.0}

    # Of a cell above the optimum second derivatives hide more than it may hold below it.
    above, *_ = bounded(1000.0, raised)
    assert 0 < above.curvature == above.within
    fine, _, solved, _ = bounded(0.5)
    assert 0 < fine.within <= 0.5 and 50 < sum(solved) < 300
    assert f"global within the box to {_at_most(fine.within, 'N')}" in fine.statement

    def rough(problem, units):
        """A bowl with a ripple that the first points do not see."""
        rows = bowl(problem, units)
        between = np.abs(6 * units[:, 0] % 1 - 0.5) < 0.1
        ripple = np.where(between, 1000.0, 0.0)[:, None]
        return rows | {"slope": rows["slope"] + ripple / periodic.widths(problem)}

    # The level that confirms finds it, and a further one is asked for, which sees no more of it.
    found, _, solved, _ = bounded(1000.0, rough)
    assert len(solved) > 1 and found.within > coarse.within
    # Nor are more orbits solved for than are allowed.
    monkeypatch.setattr(bound, "MOST", 30)
    poor, _, solved, _ = bounded(1e-9)
    assert sum(solved) <= 30 + 5 and poor.within > 1e-9 and "half as large" not in poor.statement


def test_two_runs_that_scatter_bound_no_force_below_zero():
    """Student's quantile of one degree of freedom is 12.706: 2e4 less 6353 N, and less 2.5e5 N."""
    quiet, wide = [2e4 + 500, 2e4 - 500], [4e4, 0.0]
    assert bound._least(np.array([quiet, quiet]), 0.0) == pytest.approx(2e4 - 6353, abs=1)
    assert bound._least(np.array([quiet, wide]), 0.0) == 0.0
    assert bound._least(np.array([quiet, wide]), -np.inf) < -2e5
    assert plain("foundation_rms").lowest == 0.0 and plain("winding").lowest == -np.inf
    for rows in ([quiet, [np.nan, 1.0]], [[np.nan, 1.0], quiet]):
        assert np.isnan(bound._least(np.array(rows), 0.0))


def test_landscape_is_labelled(finished):
    folder, _ = finished
    with xr.open_dataset(folder / "landscape.nc") as landscape:
        assert set(landscape.foundation_rms.dims) == {"speed", "start", "clearance"}
        assert landscape.speed.attrs["units"] == "rad/s"
        # Where it comes from, and what the searched crusher is besides.
        assert landscape.attrs["source"].startswith("jaxcrusher ")
        assert json.loads(landscape.attrs["scene"])["jaw.mass"] == 524.0
        assert json.loads(landscape.attrs["bounds"])["speed"] == [25.0, 37.5]
        assert landscape.sizes["speed"] == 4
        assert np.isfinite(landscape.foundation_rms).all()
        np.testing.assert_array_equal(landscape.objective, landscape.foundation_rms)
        # The state to go on from is that cell's own: a quiet motion is right to 1e-3 clearances
        # and m/s at this tolerance (rounding decides on the solver's steps), and neighbours differ
        # by more.
        cell = landscape.isel(start=1, speed=2, clearance=1)
        chosen = {name: float(cell[name]) for name in ("speed", "clearance")}
        scene = jc.build_scene({**chosen, "start": "contact"})
        state = jc.statistics(scene, 2, 2, outputs=("foundation_rms",), rtol=1e-6).state
        np.testing.assert_allclose(cell.state, state, atol=1e-3)
        others = np.abs(landscape.state - cell.state).max("coordinate").to_numpy()
        assert np.sort(others.ravel())[1] > 2e-3


def test_what_does_not_count_ranks_as_nothing():
    values = np.array([[2.0, 1.0, 3.0], [2.0, 1.0, 3.0]])
    counts = np.ones((2, 3), dtype=bool)
    units = np.array([[0.1, 0.0], [0.2, 0.0], [0.3, 0.0]])
    counts[0, 1] = False  # whirls from one start
    rows = {"objective": values, "counts": counts}
    assert landscape.best_points(judged(rows), units, 1).tolist() == [[0.1, 0.0]]
    counts[1, 0] = False
    assert landscape.best_points(judged(rows), units, 3).tolist() == [[0.3, 0.0]]


def test_fits_find_the_minimum_of_a_noisy_bowl():
    """Where no derivative can be had: down to what the noise lets one see, and not below it."""

    def bowl(units, numbers):
        noise = np.array([np.random.default_rng(n).normal() for n in numbers])
        return 100 * ((units - 0.3) ** 2).sum(axis=1) + 0.5 * noise

    # No whole number of first steps away.
    starts = np.array([[0.83, 0.1], [0.1, 0.9], [0.5, 0.5]])
    found = local.descend_by_fits(bowl, starts, rounds=20)
    for start, one in zip(starts, found, strict=True):
        # The last radius, a hundredth of the box, is left in each coordinate; five of them.
        assert np.abs(one.path[-1] - 0.3).max() < 5 * local.LAST_RADIUS
        assert one.first - one.last > 0.9 * 100 * ((start - 0.3) ** 2).sum()
        # In lock-step each goes as it goes alone.
        (alone,) = local.descend_by_fits(bowl, start[None], rounds=20)
        np.testing.assert_array_equal(alone.path[-1], one.path[-1])
        assert alone.evaluations == one.evaluations

    def flat(units, numbers):
        return np.array([np.random.default_rng(n).normal() for n in numbers]) + units[:, 0] * 0

    # Noise alone is no descent: the centre does not wander.
    (still,) = local.descend_by_fits(flat, np.array([[0.5, 0.5]]))
    assert (still.path == 0.5).all() and still.first == still.last


def test_an_objective_that_fails_is_not_followed():
    """One of two starts fails; the other goes on."""

    def fails(units, numbers):
        return np.where(units[:, 0] > 0.4, np.nan, units.sum(axis=1))

    lost, found = local.descend_by_fits(fails, np.array([[0.5, 0.5], [0.1, 0.5]]))
    assert (lost.path == 0.5).all() and np.isnan(lost.last) and lost.evaluations == 12
    assert (found.path[-1] == 0.0).all() and found.last == 0.0


def test_nondominated_points():
    costs = np.array([[1.0, 4.0], [2.0, 2.0], [3.0, 3.0], [4.0, 1.0], [0.5, np.nan], [2.0, 2.0]])
    assert nondominated(costs).tolist() == [True, True, False, True, False, True]


def test_interval_is_students():
    """Of 1, 2, 3: mean 2, standard error 1/sqrt(3), quantile 4.303 at two degrees of freedom."""
    mean, half_width = confirm.interval(np.array([1.0, 2.0, 3.0]))
    assert mean == 2.0 and half_width == pytest.approx(4.302653 / np.sqrt(3), rel=1e-6)


def test_a_design_is_judged_by_what_its_worse_start_comes_to():
    problem, rows, orbit = resolve(Options()), rows_of_three_runs(), orbit_by_hand()
    one = confirm.confirmed(problem, np.zeros(2), rows, orbit)
    assert one.settles and one.objective == 7.0
    assert one.forces == {"foundation_rms": 8.0, "shaking_rms": 5.0}
    assert one.half_width == pytest.approx(8e-9)  # that of the RMS, of which the objective is made
    # A start that leaves contact in a single run is judged by its time average, here the better.
    rows["contact_fraction"][0, 1] = 0.999
    one = confirm.confirmed(problem, np.zeros(2), rows, orbit)
    assert not one.transient["centred"].settles and one.transient["contact"].settles
    assert one.objective == 7.0 and one.worse_start == "contact"
    rows["objective"][0] = 9.0
    assert confirm.confirmed(problem, np.zeros(2), rows, orbit).objective == 9.0
    # Nor does an orbit count that disturbances grow from, or none.
    for changed in (orbit_by_hand(1.0001), no_orbit()):
        one = confirm.confirmed(problem, np.zeros(2), rows_of_three_runs(), changed)
        assert one.worse_start == "centred" and one.objective == 2.0
        assert one.forces["shaking_rms"] == 1.0
        assert one.half_width == one.transient["centred"].objective_half_width > 1
    # A single run that does not count leaves no number to choose by, unless all of its start come
    # to the orbit: on the way there a peak is higher than any later one.
    rows["counts"][1, 2] = False
    assert confirm.confirmed(problem, np.zeros(2), rows, orbit).counts
    assert not confirm.confirmed(problem, np.zeros(2), rows, no_orbit()).counts
    rows["whirl"][1, 2] = True
    assert not confirm.confirmed(problem, np.zeros(2), rows, orbit).counts


def test_an_orbit_outside_the_model_does_not_count_if_asked():
    """It is asked for its own verdict; rows of runs have a column."""
    problem = replace(resolve(Options()), inside_model=True)
    for ratio, counts in ((0.9, True), (1.1, False)):  # of an elastic impact
        validity, orbit = Validity(*jnp.array([0.1, ratio, 0.9, 0.9, 1e-3])), orbit_by_hand()
        orbit = replace(orbit, solution=replace(orbit.solution, validity=validity))
        one = confirm.confirmed(problem, np.zeros(2), rows_of_three_runs(), orbit)
        assert one.settles and one.counts == counts
        beside = replace(one, coexisting=(Coexisting(0.5, orbit.solution, 7.0),))
        (check,) = verdicts._limits(beside, problem)
        assert check.passed == counts and check.detail == f"{int(counts)} of 1"
        # Nor where the other start, which does not settle, is the worse one.
        rows = rows_of_three_runs()
        rows["contact_fraction"][0, 1], rows["objective"][0] = 0.999, 9.0
        one = confirm.confirmed(problem, np.zeros(2), rows, orbit)
        assert one.worse_start == "centred" and not one.transient["centred"].settles
        assert one.counts == counts


def test_slopes_of_another_motion_than_the_one_from_rest_are_not_told(monkeypatch):
    """At 38.24 rad/s, with the slip of the surfaces, their sign was the wrong one."""
    problem, solution = resolve(Options()), solution_by_hand(foundation_rms=8.0)
    monkeypatch.setattr(periodic.jc, "periodic_orbit", lambda *_, **__: solution)
    for objective, known in ((8.0, True), (7.95, False), (np.nan, False)):
        rows = {"objective": np.full(5, objective), "slope": np.ones((5, 2))}
        monkeypatch.setattr(periodic, "solve", lambda *_, rows=rows, **__: rows)
        found = periodic.orbit_of(problem, np.array([0.5, 0.5]))
        assert found.objective == 8.0
        for slopes in (found.slopes, found.slopes_apart):
            assert np.isfinite(list(slopes.values())).tolist() == [known, known]


def test_the_worst_orbit_brings_its_own_error_and_one_without_a_number_hides_none():
    """Runs of 2 ± 2.5 N, and random starts that come to an orbit of 9 N, known to 9e-9 N."""
    problem, rows = resolve(Options()), rows_of_three_runs()
    one = confirm.confirmed(problem, np.zeros(2), rows, no_orbit())
    loud, nothing = (Coexisting(0.5, solution_by_hand(), value) for value in (9.0, float("nan")))
    for found in ((nothing, loud), (loud, nothing)):
        judged_by = stages.by_worst_orbit(problem, one, found)
        assert judged_by.objective == 9.0 and judged_by.half_width == pytest.approx(9e-9)
    assert stages.by_worst_orbit(problem, one, (nothing,)).half_width == one.half_width > 1


def test_motions_of_random_starts_that_have_no_number_or_break_a_limit_fail_a_check():
    problem = replace(resolve(Options()), limits=(Limit("foundation_peak", 8.0, "N"),))
    loose, quiet = solution_by_hand(), solution_by_hand(foundation_peak=7.0)
    best = confirm.confirmed(problem, np.zeros(2), rows_of_three_runs(), orbit_by_hand())
    answer = Answer(problem, "", {}, free_slopes={"speed": float("nan")})

    def of_starts(*found):
        *_, one, _ = verdicts._motion(answer, replace(best, coexisting=found))
        return one

    # Under a rough feed, an orbit that loses contact has no number.
    assert of_starts(Coexisting(1.0, quiet, 7.0)).passed
    lost = of_starts(Coexisting(0.5, quiet, 7.0), Coexisting(0.25, quiet, float("nan")))
    assert not lost.passed and lost.detail.endswith(", 25% to no motion that repeats")
    # Runs that do not settle have 1 N, and half of the random starts come to 9 N.
    best = confirm.confirmed(problem, np.zeros(2), rows_of_three_runs(), no_orbit())
    assert verdicts._limits(best, problem)[0].passed
    (one,) = verdicts._limits(replace(best, coexisting=(Coexisting(0.5, loose, 2.0),)), problem)
    assert not one.passed and one.detail == "9 <= 8 N"


def test_what_is_said_of_the_force_is_true_of_it():
    """An orbit is below the ideal joint where runs are above; a speed is the highest there is."""
    problem = resolve(Options())
    runs = SimpleNamespace(by_run={"foundation_rms": np.array([18250.0])})
    best = SimpleNamespace(
        transient={"centred": runs},
        forces={"foundation_rms": 18000.0},
        ideal_rms=18240.0,
        values={"speed": 40.0, "clearance": 3e-5},
    )
    (one,) = verdicts._ideal(best, problem)
    assert not one.passed and one.detail.startswith("RMS 18000 N >= 18240 N")
    answer = Answer(problem, "", {}, optimum=best)
    assert verdicts.remark(answer) == "The least RMS lies above the lowest speed allowed."


@pytest.mark.parametrize("low, high", [(-14.0, 14.0), (-14.0, -2.0), (2.0, 14.0)])
def test_an_end_of_the_box_is_inside_it(low, high):
    name = "counterweight.moment_along"
    problem = SimpleNamespace(design=SimpleNamespace(bounds={name: (low, high)}))
    for value, inside in ((low, True), (high, True), (low - 1e-6, False), (high + 1e-6, False)):
        best = SimpleNamespace(values={name: value})
        assert verdicts._inside(best, problem) == inside


@pytest.mark.parametrize("stable", [None, 0])
def test_an_optimum_is_not_compared_with_a_map_that_has_no_orbit(stable):
    maps = SimpleNamespace(stable_orbits=stable)
    nothing = Bound(None, None, 0, 0.0, "")
    answer = Answer(resolve(Options()), "", {}, maps=maps, bound=nothing)
    assert "no stable orbit to compare" in verdicts._beside_map(answer, "N")


def test_a_difference_of_forces_is_as_uncertain_as_the_force():
    """An excess of 0.5 N of an RMS of 8 N, which is known to 1e-9 of itself."""
    problem = resolve(Options(objective="excess"))
    rows, orbit = rows_of_three_runs(), orbit_by_hand(objective=0.5)
    rows["objective"][:] = 0.1
    assert confirm.confirmed(problem, np.zeros(2), rows, orbit).half_width == pytest.approx(8e-9)


def test_the_limits_of_every_loose_joint_are_kept():
    """A pivot that approaches at twice the elastic limit is named, beside a main joint inside."""
    free = (("speed", "25", "40rad/s"), ("pivot.clearance", "0.02", "0.1mm"))
    problem = resolve(Options(design=free))
    usual = jc.build_scene({"pivot.clearance": 5e-5}).usual_statistics
    columns = columns_of_row(
        {"main": "", "pivot": "pivot_"}, tuple((name, STATISTIC[name]) for name in usual)
    )
    rows = {name: np.zeros((2, 3)) for name in columns} | {
        "state": np.zeros((2, 3, 8)),
        "objective": np.ones((2, 3)),
        "success": np.ones((2, 3), dtype=bool),
        "counts": np.ones((2, 3), dtype=bool),
        "pivot_impact_speed": np.full((2, 3), 2 * ELASTIC_IMPACT_SPEED),
    }
    one = confirm.confirmed(problem, np.zeros(2), rows, None)
    assert (
        formatting.outside(one)[0]
        == "centred start, pivot: approaches at 2.0 times the elastic limit"
    )
    assert formatting.limits(one).startswith("OUTSIDE the contact model: ")


def test_checks_fail_where_their_rules_are_broken(finished):
    """The settled answer with one fact at a time made wrong."""
    _, answer = finished
    best = answer.optimum

    def failed(**changes):
        checks = verdicts.checks(replace(answer, **changes))
        return [check.name for check in checks if not check.passed]

    assert failed() == []
    outside = replace(best, values=best.values | {"speed": 24.9})
    assert failed(optimum=outside) == ["inside the box"]
    assert failed(optimum=replace(best, crushing=replace(best.crushing, capacity=5.0))) == [
        "capacity at least the floor"
    ]
    lost = best.transient | {"centred": replace(best.transient["centred"], settles=False)}
    left = replace(best, transient=lost)
    assert "both starts come to the periodic orbit" in failed(optimum=left)
    # A slope that no constraint balances.
    assert failed(free_slopes={"speed": answer.active[0].multiplier})[0].startswith("a minimum")
    assert failed(reference=replace(answer.reference, objective=1.0)) == [
        "better than the scene file's choice"
    ]
    assert failed(bound=replace(answer.bound, gain=-1.0)) == ["not worse than any point of the map"]
    for gain, where in ((-1.0, "above"), (1.0, "below")):
        beside = replace(answer, bound=replace(answer.bound, gain=gain))
        told = [check.detail for check in verdicts.checks(beside)]
        assert any(line.startswith(f"the optimum lies 1 N {where} the map's") for line in told)
    off = {"speed": 0.03 * best.orbit.slopes["speed"], "clearance": 0.0}
    wrong = replace(best, orbit=replace(best.orbit, slopes_apart=off))
    assert failed(optimum=wrong) == ["the slopes at the optimum may be believed"]
    # Friction of sliding surfaces, 0.03 at a bore of 0.13 m over a jaw of 0.695 m: 1.1 % more.
    low = replace(best, forces=best.forces | {"foundation_rms": 0.99 * best.ideal_rms})
    assert failed(optimum=low) == ["not below the ideal joint"]
    slips = resolve(Options(slip="surface", friction=0.03, **QUIET))
    assert failed(optimum=low, problem=slips) == []
    # Without an orbit time averages are compared, and nothing is said of a minimum.
    unsettled = {start: replace(runs, settles=False) for start, runs in lost.items()}
    changed = replace(answer, optimum=replace(best, orbit=None, transient=unsettled))
    none = [check.name for check in verdicts.checks(changed)]
    assert "both starts agree" in none and not any(name.startswith("a minimum") for name in none)


def test_a_design_is_judged_by_the_worst_that_random_starts_come_to(finished):
    _, answer = finished
    best = answer.optimum
    # All random starts of the optimum come to its orbit, the same to rounding.
    assert [one.share for one in best.coexisting] == [1.0]
    assert best.coexisting[0].objective == pytest.approx(best.objective, rel=1e-9)
    twice = solution_by_hand(period=2, foundation_rms=1.9e4, shaking_rms=9e3)
    loud, problem = Coexisting(0.2, twice, 1.9e4), answer.problem
    judged_by = stages.by_worst_orbit(problem, best, (*best.coexisting, loud))
    assert judged_by.objective == 1.9e4
    assert judged_by.forces == {"foundation_rms": 1.9e4, "shaking_rms": 9e3}
    checks = verdicts.checks(replace(answer, optimum=judged_by))
    (failed,) = [check for check in checks if not check.passed]
    assert failed.name == "no random start comes to a worse motion"
    assert failed.detail == (
        "100% of random starts come to 18243, 20% of random starts come to 19000 over 2 turns"
    )
    # What does not count is not made to count.
    uncounted = replace(best, objective=float("nan"))
    assert not stages.by_worst_orbit(problem, uncounted, (loud,)).counts


def test_a_map_of_a_machine_without_orbits_has_none_that_count():
    alone = maps_of(np.zeros((0, 2)), None)
    assert alone.counting_orbits is None and alone.stable_orbits is None


def test_the_answer_says_first_what_shakes_the_ground_more(finished):
    """A design of less RMS that shakes more, and a point of the map that shakes less."""
    _, answer = finished

    def shaking(times: float) -> Confirmed:
        loud = {"shaking_rms": times * answer.reference.forces["shaking_rms"]}
        return replace(answer.optimum, forces=answer.optimum.forces | loud)

    shaken = shaking(1.5)
    text = formatting.answer(replace(answer, optimum=shaken))
    assert text.startswith(
        "Against the scene file's choice the RMS force on the foundation falls by 4.5 %, but the "
        "RMS shaking force, which the ground feels, rises by 50 %, from 4.516 kN to 6.774 kN. "
        "Run it at"
    )
    # Nor does a force of 0.01 % more rise, nor one go another way than a design without a number.
    same = replace(answer, optimum=shaking(1.0001))
    assert formatting.answer(same).startswith("Run it at")
    none = replace(answer.reference, objective=float("nan"))
    assert formatting.answer(replace(answer, optimum=shaken, reference=none)).startswith(
        "Run it at"
    )
    points = np.array([[0.0, 0.0], [0.5, 1.0], [1.0, 1.0]])
    columns = {"shaking_rms": [3135.0, 1555.0, 100.0], "foundation_rms": [18e3, 19e3, 20e3]}
    orbits = xr.Dataset({name: ("cell", column) for name, column in columns.items()})
    orbits["counts"] = "cell", [True, True, False]
    answer = replace(answer, problem=resolve(Options()), maps=maps_of(points, orbits))
    text = verdicts.quieter(answer)
    assert "at speed 32.5 rad/s (310.4 rpm), clearance 0.12 mm the RMS shaking force" in text
    assert "is 1.555 kN instead of 3.135 kN, and the RMS force on the foundation is 19 kN" in text
    one = maps_of(points[:1], orbits.isel(cell=[0]))
    assert verdicts.quieter(replace(answer, maps=one)) == ""


def test_descents_end_where_karush_kuhn_and_tucker_say():
    """A bowl whose least is inside in one coordinate, outside in the next, cut off in a third."""
    centre = np.array([0.3, -0.5, 0.9])

    def bowl(point):
        return 5 + ((point - centre) ** 2).sum(), 2 * (point - centre)

    found = local.descend(bowl, np.full(3, 0.5), np.array([1.0, 1.0, 0.7]), 50)
    # A quadratic is found to rounding of its value, the square root of it in place.
    np.testing.assert_allclose(found.path[-1], [0.3, 0.0, 0.7], atol=1e-7)
    np.testing.assert_allclose(found.gradient, [0.0, 1.0, -0.4], atol=1e-7)
    assert found.last == pytest.approx(5 + 0.25 + 0.04) and found.evaluations < 20
    # Walls without a value are come back from; a start without one stays.
    walled = local.descend(
        lambda p: bowl(p) if p[1] > 0.1 else (np.nan, np.full(3, np.nan)),
        np.full(3, 0.5),
        np.ones(3),
        50,
    )
    assert 5 < walled.last < bowl(np.full(3, 0.5))[0] and walled.path[-1][1] > 0.1
    lost = local.descend(lambda p: (np.nan, np.full(3, np.nan)), np.full(3, 0.5), np.ones(3), 50)
    assert np.isnan(lost.last) and lost.evaluations == 1 and (lost.path == 0.5).all()


def test_descents_in_lock_step_end_where_karush_kuhn_and_tucker_say():
    """A tilted bowl from many starts at once, one of which is behind a wall.

    Ends are polished after; what is left here is the square root of what a descent ends at, 1e-9.
    """
    centre, upper = np.array([0.3, -0.5, 0.9]), np.array([1.0, 1.0, 0.7])
    weights, asked = np.array([1.0, 3.0, 20.0]), []

    def bowl(points):
        asked.append(points)
        value = 5 + (weights * (points - centre) ** 2).sum(axis=-1)
        walled = np.where(points[..., 0] > 0.95, np.nan, value)
        return walled, 2 * weights * (points - centre)

    starts = np.random.default_rng(0).uniform(0, 0.9, size=(12, 3))
    starts[0, 0] = 0.97
    lost, *found = all_of_them = local.descend_together(bowl, starts, upper, 50)
    assert np.isnan(lost.last) and lost.evaluations == 1 and len(lost.path) == 1
    for one in found:
        np.testing.assert_allclose(one.path[-1], [0.3, 0.0, 0.7], atol=3e-5)
        np.testing.assert_allclose(one.gradient, [0.0, 3.0, -8.0], atol=1e-3)
        # But for rounding no step rises.
        assert np.diff([bowl(point)[0] for point in one.path]).max() < 1e-14
    # Few batches, inside the box, of those alone that have not ended.
    assert all((points >= 0).all() and (points <= upper).all() for points in asked)
    assert max(map(len, asked)) == 12 and sum(one.evaluations for one in found) < 12 * 20
    assert local.apart(all_of_them) == [min(found, key=lambda one: one.last)]


def test_numbers_of_a_design_are_of_one_orbit(monkeypatch):
    """Objective, rival, limit and capacity ask for one orbit, of one point as of many."""
    problem, asked = resolve(Options(limit=(("shaking_rms", "3 kN"),), **SMALL)), []

    def solve(problem, units):
        asked.append(len(units))
        rows = dict.fromkeys(("stable", "undecided", "inside_model"), np.ones(len(units), bool))
        numbers = np.arange(4.0) + np.zeros((len(units), 1))
        return rows | {"numbers": numbers, "slopes": np.ones((len(units), 4, 2))}

    monkeypatch.setattr(periodic, "solve", solve)
    numbers = periodic.numbers(problem)
    assert [*numbers] == ["objective", "foundation_peak", "shaking_rms", "capacity"]
    (spare,) = periodic.spares(problem, numbers)
    for units in (np.full(2, 0.5), np.full((1, 2), 0.5), np.full((3, 2), 0.5)):
        for i, one in enumerate(numbers.values()):
            value, slope = one(units)
            assert value.shape == units.shape[:-1] and slope.shape == units.shape
            assert (value == i).all()
        assert spare(units)[0] == pytest.approx((3e3 - 2) / 3e3, rel=1e-15)
    assert asked == [1, 1, 3]


def test_the_best_points_stay_where_descents_find_no_orbit(monkeypatch):
    """Neighbours on the map lead to orbits that the pin at rest, where descents begin, does not."""
    nothing = np.full((4, 3), np.nan), np.full((4, 3, 2), np.nan)

    def solve(problem, units):
        rows = dict.fromkeys(("stable", "undecided", "inside_model"), np.zeros(len(units), bool))
        return rows | {
            name: one[: len(units)]
            for name, one in zip(("numbers", "slopes"), nothing, strict=True)
        }

    monkeypatch.setattr(periodic, "solve", solve)
    starts = np.random.default_rng(0).uniform(size=(4, 2))
    found, ends = stages._by_gradients(resolve(Options(**SMALL)), starts, NOWHERE)
    assert (ends == starts[:1]).all() and all(np.isnan(one.last) for one in found)


def test_bounds_of_cells_hold_what_a_function_hides():
    """A paraboloid between the points of a coarse grid: below every point, and above the bound."""
    sizes = np.array([0.2, 0.25])
    x, y = np.meshgrid(np.linspace(0, 1, 6), np.linspace(0, 1, 5), indexing="ij")

    def height(x, y):
        return 3 + (x - 0.51) ** 2 + 2 * (y - 0.37) ** 2 + (x - 0.5) * (y - 0.4)

    slopes = np.stack([2 * (x - 0.51) + y - 0.4, 4 * (y - 0.37) + x - 0.5], axis=-1)
    cells = Cells.of_grid(x.shape)
    place = np.rint(cells.corners / sizes).astype(int)
    at = np.ravel_multi_index(np.moveaxis(place, -1, 0), x.shape)
    values, slopes = height(x, y).ravel(), slopes.reshape(-1, 2)
    lowest, hidden = cells.lowest(at, values, slopes)
    fine = height(*np.meshgrid(np.linspace(0, 1, 401), np.linspace(0, 1, 401)))
    assert lowest.min() <= fine.min() < values.min()
    # With the exact second derivatives (2, 4, 1, 1) twice over, by hand.
    expected = ROUGHER * (2 * 0.1**2 + 4 * 0.125**2 + 2 * 0.1 * 0.125) / 2
    np.testing.assert_allclose(hidden, expected, rtol=1e-12)
    # A point without a number leaves its neighbours the differences beside them.
    slopes[0] = values[0] = np.nan
    lowest, hidden = cells.lowest(at, values, slopes)
    assert np.isnan(lowest).sum() == 1 and np.isnan(lowest[0, 0])
    np.testing.assert_allclose(hidden, expected, rtol=1e-12)
    # An increasing function has its least at the corner, where nothing falls inwards.
    flat, none = cells.lowest(at, (x + y).ravel(), np.ones((x.size, 2)))
    assert flat.min() == 0 and not none.any()
    # A cell that is halved leaves four, which share corners with it; one parameter leaves two.
    halved = cells.halved(np.arange(20) == 7)
    assert len(halved.low) == 23 and halved.sizes[-4:].tolist() == [[0.1, 0.125]] * 4
    np.testing.assert_allclose(halved.corners[-4, 0], cells.corners[7, 0], atol=1e-15)
    np.testing.assert_allclose(halved.corners[-1, -1], cells.corners[7, -1], atol=1e-15)
    one = Cells.of_grid((4,))
    assert one.halved(np.array([True, False, False])).low.ravel() == pytest.approx(
        [1 / 3, 2 / 3, 0, 1 / 6]
    )
    by_one, pairs = np.array([np.nan, 0.0, 1.0, 4.0]), np.array([[0, 1], [1, 2], [2, 3]])
    lowest, hidden = one.lowest(pairs, by_one, by_one[:, None])
    assert (
        np.isnan(lowest).sum() == 1 and 3 * hidden[0] == pytest.approx(hidden[1]) and hidden[0] > 0
    )
    assert one.hold(np.array([0.5])).tolist() == [False, True, False]
    # The largest of a cell and of those that share a corner with it.
    numbers = np.array([np.nan, 1.0, 3.0])
    assert beside(numbers, pairs, 4).tolist() == [1.0, 3.0, 3.0]


def test_what_is_not_the_paper_s_choice_is_told():
    """Its 39 rad/s and 0.03 mm are compared with only where they are free, or given."""
    free = (("counterweight.mass", "0", "100 kg"),)
    choice = (("speed", "39 rad/s"), ("clearance", "0.03 mm"))
    for given, others in (
        ((), " with speed 30 rad/s (286.5 rpm) and clearance 0.06 mm"),
        (choice[:1], " with clearance 0.06 mm"),
        (choice, ""),
    ):
        problem = resolve(Options(design=free, overrides=given))
        assert problem.compared_with == f"paper's choice{others}"


def test_capacity_is_the_scene_s(tmp_path):
    """Floor and capacities of a chamber twice as wide; the paper's to the last bit; free links."""
    problem, chamber = resolve(Options()), CrushingChamber()
    assert problem.reference == {"speed": 39.0, "clearance": 3e-5}
    assert problem.compared_with == "paper's choice"
    paper = problem
    assert paper.capacity_floor == float(chamber.capacity(25.0)) / 1.67
    faster = resolve(Options(speed=("42", "50rad/s")))
    assert faster.capacity_floor == float(chamber.capacity(42.0)) / 1.67
    ends = np.array([[0.0, 0.0], [1.0, 1.0]])
    assert paper.capacity(ends).tolist() == [float(chamber.capacity(v)) for v in (25.0, 40.0)]
    file = tmp_path / "wide.toml"
    file.write_text('[chamber]\nwidth = "0.8 m"\n[shaft]\neccentricity = "11 mm"')
    own = resolve(Options(scene=file, speed=("20", "35rad/s")))
    width = 2 * 0.0340246 - 1.1 * 7.449e-3
    # The stroke is nearly proportional to the eccentricity, and a ninth of the width.
    expected = 2 * float(chamber.capacity(20.0)) * width / 0.0606
    assert float(own.capacity(ends[0])) == pytest.approx(expected, rel=1e-3)
    # The factor of affluence between the lowest and the highest speed.
    assert own.capacity_floor == pytest.approx(float(own.capacity(ends[0])) / 1.67, rel=1e-12)
    assert own.upper.tolist() == [pytest.approx((20 * 1.67 - 20) / 15), 1.0]
    free = (("shaft.eccentricity", "10", "11 mm"), ("speed", "20", "35 rad/s"))
    links = resolve(Options(scene=file, design=free))
    assert links.capacity(np.array([[1.0, 0.0]]))[0] == pytest.approx(
        float(own.capacity(ends[0])), rel=1e-9
    )
    assert links.upper.tolist() == [1.0, 1.0]
    assert links.capacity(np.array([0.0, 0.0])) > links.capacity(np.array([1.0, 0.0]))


def test_a_key_of_the_scene_file_may_be_set(tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text('[jaw]\nmass = "500 kg"\ninertia = "100 kg m2"')
    problem = resolve(Options(scene=file, overrides=(("jaw.mass", "0.48 tonne"),)))
    assert problem.design.fixed == {"jaw.mass": 480.0, "jaw.inertia": 100.0}
    assert problem.units["jaw.mass"] == "tonne"


def test_points_near_a_bad_start_do_not_count():
    problem = resolve(Options())
    units = landscape.points(problem.design, (2, 2), 2, 0)
    good = np.array([[[True, True], [True, True]], [[True, False], [True, True]]])
    dims, lost = ("start", "speed", "clearance"), np.zeros(good.shape, bool)
    data = xr.Dataset({"success": (dims, good), "whirl": (dims, lost), "counts": (dims, lost)})
    points = np.array([[0.1, 0.2], [0.4, 0.6], [0.6, 0.6]])
    assert landscape.counting(data, units, points).tolist() == [True, False, True]
    data = xr.Dataset({"success": (dims, ~lost), "whirl": (dims, ~good)})
    assert landscape.counting(data, units, points).tolist() == [True, False, True]


def test_objectives_follow_from_their_statistics():
    """Formulas on the paper's crusher, 30 rad/s and 0.06 mm, against sampled motions."""
    chamber = CrushingChamber()
    scene = jc.paper_scene(30.0, 0.06e-3, start="contact")
    outputs = ("foundation_force", "shaking_force", "joint_force", "drive_power", "normal_force")
    outputs = (*outputs, "ground_moment")
    # The last point is the first of the next turn.
    motion = jc.simulate(scene, np.linspace(0, 4 * np.pi / 30, 20001), outputs=outputs)
    force = np.asarray(motion.foundation_force)[:-1]
    shaking = np.linalg.norm(np.asarray(motion.shaking_force)[:-1], axis=1)
    slip = 30.0 * 0.13
    expected = {
        "rms": np.sqrt((force**2).mean()),
        "mean": force.mean(),
        "peak": force.max(),
        "shaking_rms": np.sqrt((shaking**2).mean()),
        "shaking_peak": shaking.max(),
        "shaking_moment_rms": np.std(np.asarray(motion.ground_moment)[:-1]),
        "smooth_peak": (force**16).mean() ** (1 / 16),
        "joint_peak": np.linalg.norm(np.asarray(motion.joint_force), axis=1).max(),
        "wear": 3600 * np.asarray(motion.normal_force)[:-1].mean() * slip / 7.843,
        "energy": 3600 * np.asarray(motion.drive_power)[:-1].mean() / 7.843,
    }
    values = {}
    window = Window(0, 2, 1e-9)
    # Those of a frame on supports are statistics as they are, and this frame is clamped.
    clamped = {name: one for name, one in OBJECTIVES.items() if name not in OF_SUPPORTS}
    outputs = tuple({name for o in clamped.values() for name in o.outputs})
    result = jc.statistics(scene, window.settle, window.turns, outputs=outputs, rtol=window.rtol)
    for name, objective in clamped.items():
        values[name] = float(objective.formula(result, scene, chamber))
    # Sampling of a smooth periodic function; capacity to its four digits.
    shaken = ("shaking_rms", "shaking_peak", "shaking_moment_rms")
    plain = ("rms", "mean", "peak", "smooth_peak", "joint_peak", *shaken)
    for name in plain:
        assert values[name] == pytest.approx(expected[name], rel=1e-5), name
    # The jaw's own turning adds up to 1 % to the slip of the surfaces.
    assert values["wear"] == pytest.approx(expected["wear"], rel=0.01)
    assert values["energy"] == pytest.approx(expected["energy"], rel=2e-3)
    ideal = jc.statistics(jc.ideal_scene(30.0), 0, 1, outputs=("foundation_rms",)).foundation_rms
    # 12 N in 2e4: the ideal joint's statistics are right to 1e-9 in either way.
    assert values["excess"] == pytest.approx(values["rms"] - float(ideal), rel=1e-4)


@pytest.mark.slow
def test_free_parameters_by_name():
    """Three free parameters: a Sobol sequence instead of a grid, and constraints that hold."""
    options = Options(
        design=(
            ("speed", "25", "40 rad/s"),
            ("clearance", "30 um", "0.12 mm"),
            ("counterweight.mass", "0", "50 kg"),
        ),
        capacity_floor=8.0,
        friction=0.05,
    )
    problem = resolve(options)
    assert problem.design.names == ("speed", "clearance", "counterweight.mass")
    assert problem.design.fixed["friction"] == 0.05
    units = landscape.points(problem.design, options.grid, 8, 0)
    assert units.shape == (8, 3)
    rows = evaluate(problem, units, Window(0, 2, 1e-6))
    data = landscape.dataset(problem, units, options.grid, rows)
    assert data.objective.dims == ("start", "sample")
    # Capacity is 9.41 m3/h at 25 rad/s and falls as 1 / speed: 8 at 29.4 rad/s.
    np.testing.assert_array_equal(data.counts.all("start"), data.speed < 29.41)
    scene = problem.design.scene(np.array([0.0, 0.0, 1.0]))
    assert float(scene.linkage.bodies.at("shaft").mass) == pytest.approx(145.0)


def test_wear_is_searched_where_friction_may_vanish():
    """A bound of zero is no machine without friction."""
    free = (("friction", "0", "0.2"),)
    problem = resolve(Options(objective="wear", slip="surface", design=free))
    assert problem.design.bounds == {"friction": (0.0, 0.2)}


@pytest.mark.slow
def test_the_rms_expected_under_a_rough_feed():
    """Of an orbit that bears the feed; not of one that does not, nor of an integrated motion."""
    rough = (("load_scatter", "0.2"), ("load_bandwidth", "3"))
    problem = resolve(Options(objective="expected_rms", overrides=rough))
    orbit = jc.periodic_orbit(problem.design.scene(np.zeros(2)))
    # Of the table in rough_feed.md, to its digits; ensembles of feeds have 123.0 ± 2.8.
    above = float(problem.objective.formula(orbit, orbit.scene, problem.chamber)) - 18243.41
    assert above == pytest.approx(125.9, abs=0.1)
    # The orbit of a random start is found under the mean load alone.
    still = replace(orbit, scene=orbit.scene.steady())
    assert float(problem.objective.formula(still, orbit.scene, problem.chamber)) == above + 18243.41
    wild = jc.build_scene({**problem.design.fixed, "load_scatter": 0.5, "start": "contact"})
    assert np.isnan(problem.objective.formula(orbit, wild, problem.chamber))
    rows = evaluate(problem, np.zeros((1, 2)), Window(0, 1, 1e-6))
    assert np.isnan(rows["objective"]).all() and rows["counts"].all()
    # A motion under the mean load: in its second start it is the orbit, but for its swing.
    assert rows["foundation_rms"][1, 0] == pytest.approx(18243, rel=1e-3)


@pytest.mark.slow
def test_a_law_of_ones_own_is_searched(tmp_path):
    """Its numbers are fixed by a file, or free."""
    (tmp_path / "law_of_a_search.py").write_text(PUSH)
    (tmp_path / "scene.toml").write_text('load_law = "law_of_a_search:Push"')
    free = (("crushing.size", "8", "9kN"), ("speed", "25", "26rad/s"))
    problem = resolve(Options(scene=tmp_path / "scene.toml", design=free, capacity_floor=1.0))
    assert re.fullmatch("law_of_a_search:Push [0-9a-f]{16}", problem.settings["scene"]["load_law"])
    rows = periodic.solve(problem, np.array([[0.0, 0.0], [1.0, 0.0]]))
    plain = [
        jc.periodic_orbit(jc.build_scene({"load_law": "normal_to_jaw", "load": load, "speed": 25}))
        for load in (8e3, 9e3)
    ]
    # The same equations with 96 nodes, which leave 5e-9.
    expected = [float(one.foundation_rms) for one in plain]
    np.testing.assert_allclose(rows["objective"], expected, rtol=1e-7)
    assert rows["counts"].all() and (rows["slope"][:, 0] != 0).all()
    # And by an option, which is known to no list either.
    named = Options(load_law="law_of_a_search:Push", design=free, capacity_floor=1.0)
    assert resolve(named).design.machine.given["load_law"] == "law_of_a_search:Push"


def named_by(options):
    """Option -> the names that may be chosen, of each that lists them."""
    return {
        option: set(get_args(one))
        for option, hint in get_type_hints(options).items()
        for one in (hint, *get_args(hint))
        if get_origin(one) is Literal
    }


def docs_of(options) -> dict[str, str]:
    """Option -> its help, the text that stands below it."""
    source = inspect.getsource(options)
    return dict(re.findall(r'^    (\w+):[^"]*?\n    """(.*?)"""', source, re.S | re.M))


def test_names_that_options_list_are_those_of_their_tables():
    """Options import no JAX, so that they have lists of their own where --help needs them."""
    of_others = {"B_force_peak", "load_scatter"}  # of a linkage, and a number of a scene
    told = set(re.findall(r"\b[a-zA-Z]+(?:_[a-z]+)*\b", docs_of(Options)["objective"]))
    assert set(OBJECTIVES) | of_others <= told
    assert {name for name in told if "_" in name} <= set(OBJECTIVES) | of_others
    engines = {name for of in get_args(Engine) for name in get_args(of) if isinstance(name, str)}
    assert named_by(Sweep) == {"engine": engines} and "lanes" in engines


PUSH = """
import equinox as eqx
import jax

from jaxcrusher.basics.plane import scalar
from jaxcrusher.crusher.loads import AbstractLoad, JawForce


class Push(AbstractLoad):
    size: jax.Array = eqx.field(converter=scalar, metadata={"unit": "N"})

    def force(self, jaw):
        return JawForce(self.size * jaw.away, None)
"""


THREE = tuple((name, "1", "2 kg") for name in ("shaft.mass", "jaw.mass", "toggle.mass"))


@pytest.mark.parametrize(
    "change, name",
    [
        ({"speed": ("40 rad/s", "25 rad/s")}, "speed"),
        ({"speed": ("25", "40")}, "speed"),
        ({"clearance": ("0.1", "0.1mm")}, "clearance"),
        ({"clearance": ("0.03", "200 mm")}, "clearance"),
        ({"speed": ("0", "1 rad/s")}, "speed"),
        # What another option makes idle.
        ({"speed": ("20", "40rad/s"), "design": (("load", "0", "9 kN"),)}, "speed"),
        ({"cells": (9, 9), "design": THREE}, "cells"),
        ({"samples": 64}, "samples"),
        ({"friction": 0.05, "design": (("friction", "0", "0.1"),)}, "friction"),
        ({"slip": "surface", "friction": 0.0}, "slip"),
        ({"slip": "surface", "overrides": (("friction", "0"),)}, "slip"),
        (
            {
                "design": (("impact_velocity", "0.1", "1 m/s"),),
                "overrides": (("impact_law", "tracked"),),
            },
            "impact_velocity",
        ),
        ({"impact_velocity": "1m/s", "overrides": (("impact_law", "tracked"),)}, "set"),
        ({"overrides": (("counterweight.moment_along", "5 kg m"),)}, "set"),
        ({"samples": 300, "design": THREE}, "samples"),
        (
            {"capacity_floor": math.inf, "design": (("toggle.length", "0.29", "0.31 m"),)},
            "capacity_floor",
        ),
        ({"friction": 0.1, "overrides": (("contact_law", "rollers"),)}, "friction"),
        ({"load_law": "none", "design": (("load", "1", "9 kN"),)}, "load"),
        ({"overrides": (("speed", "30rad/s"),)}, "set"),
        ({"overrides": (("diametral_clearance", "0.1mm"),)}, "set"),
        ({"friction": 0.0, "overrides": (("friction", "0.3"),)}, "set"),
        ({"impact_velocity": "0.5m/s", "overrides": (("impact_velocity", "1m/s"),)}, "set"),
        ({"overrides": (("jaw.mass", "480"),)}, "jaw.mass"),
        ({"name": "../evil"}, "name"),
        ({"name": "a\\b"}, "name"),
        ({"grid": (1, 5)}, "grid"),
        ({"cells": (2, 5)}, "cells"),
        ({"capacity_floor": 20.0}, "capacity_floor"),
        ({"objective": "wear", "friction": 0.0}, "objective"),
        ({"friction": -0.1}, "friction"),
        ({"load_law": "closing"}, "load_law"),
        ({"slip": "bore"}, "slip"),
        ({"impact_velocity": "0 m/s"}, "impact_velocity"),
        ({"capacity_floor": -1.0}, "capacity_floor"),
        ({"design": (("speed", "30", "25 rad/s"),)}, "speed"),
        ({"runs": 1}, "runs"),
        ({"starts": 1}, "starts"),
        ({"seconds": math.inf}, "seconds"),
        ({"design": (("sped", "30", "25 rad/s"),)}, "sped"),
        ({"design": (("fluctuation_order", "1", "3"),)}, "design"),
        ({"design": (("chamber.discharge", "30", "40 mm"),)}, "design"),
        ({"objective": "beauty"}, "objective"),
        ({"objective": "expected_rms"}, "objective"),
        ({"overrides": (("load_scatter", "0.1"),)}, "load_scatter"),
        ({"clearance": ("0.03", "100 mm")}, "clearance"),
    ],
)
def test_bad_options(change, name, tmp_path, monkeypatch):
    def begun(*_):
        raise AssertionError("a search began")  # which takes minutes

    monkeypatch.setattr(stages, "Work", begun)
    with pytest.raises(ValueError, match=f"^Argument `{name}` must") as error:
        design_search(Options(out=tmp_path, **change), Console(quiet=True))
    assert "\n" not in str(error.value) and len(str(error.value)) < 300


def test_a_scene_file_that_makes_no_crusher(tmp_path):
    (tmp_path / "long.toml").write_text('[jaw]\nlength = "3 m"')
    with pytest.raises(ValueError, match=r"long\.toml: `jaw\.length`, .* must let the links close"):
        design_search(Options(out=tmp_path, scene=tmp_path / "long.toml"), Console(quiet=True))


@pytest.mark.parametrize("outside_counts", [True, False])
def test_a_descent_keeps_inside_the_model_if_asked(monkeypatch, outside_counts):
    rows = {"stable": [True], "undecided": [False], "inside_model": [False]}
    rows |= {"numbers": np.full((1, 3), 2.0), "slopes": np.ones((1, 3, 2))}
    monkeypatch.setattr(periodic, "solve", lambda problem, units: rows)
    problem = replace(resolve(Options(**SMALL)), inside_model=not outside_counts)
    value, _ = periodic.numbers(problem)["objective"](np.full(2, 0.5))
    assert value == 2.0 if outside_counts else np.isnan(value)


@pytest.mark.parametrize(
    ("seats", "found", "contact", "asked"),
    [
        ({}, True, False, ["some", "all"]),  # an orbit is enough
        ({}, False, True, ["some", "all"]),  # of what keeps contact all ways are tried
        ({}, False, False, ["some"]),
        ({"elbow.clearance": "0.05 mm"}, True, False, []),  # nodes of two joints take minutes
        ({"elbow.clearance": "0.05 mm"}, True, True, ["some", "all"]),
    ],
)
def test_orbits_are_mapped_where_there_may_be_some(monkeypatch, seats, found, contact, asked):
    """A design that keeps contact, or whose nodes have an orbit, is looked for among few ones."""
    problem, calls = resolve(Options(overrides=tuple(seats.items()), **SMALL)), []
    units = np.random.default_rng(0).uniform(size=(100, 2))

    def solve(problem, points, *_, **__):
        calls.append("all" if len(points) == 100 else "some")
        rows = np.full(len(points), found)
        return {"success": rows, "counts": np.ones(len(points), bool)}

    monkeypatch.setattr(periodic, "solve", solve)
    monkeypatch.setattr(periodic.drawn, "turns", lambda *_: {})
    monkeypatch.setattr(periodic, "labelled", lambda *_: xr.Dataset())
    mapped = periodic.solve_map(problem, units, (10, 10), lambda: contact)
    assert calls == asked and (mapped is not None) == (asked[-1:] == ["all"])


def test_some_points_lie_evenly_among_many():
    points = np.arange(589.0)[:, None]
    few = landscape.spread(points, 16)[:, 0]
    assert len(few) == 16 and few[0] == 0 and few[-1] == 588
    assert np.ptp(np.diff(few)) <= 1
    assert len(landscape.spread(points[:5], 16)) == 5


@pytest.mark.slow
def test_a_box_without_contact_is_searched_by_runs_and_says_so(tmp_path):
    """Its seats rattle: no orbit is searched for, and the answer is the mean of runs."""
    seats = (("elbow.clearance", "0.2 mm"), ("pivot.clearance", "0.2 mm"), ("start", "centred"))
    console = Console(file=io.StringIO(), width=200)
    answer = design_search(
        Options(out=tmp_path, name="seats", overrides=seats[:2], **QUIET), console
    )
    assert answer.finished and answer.optimum is not None and answer.optimum.averaged
    assert answer.maps.stable_orbits is None and answer.optimum.orbit is None
    assert "no design that was looked at keeps contact" in answer.bound.statement
    assert not any("slopes" in check.name for check in answer.checks)


@pytest.mark.parametrize("undecided", [True, False])
def test_what_is_not_known_to_be_stable_is_not_unstable(monkeypatch, undecided):
    """A descent goes on there, a map chooses it and counts it, and words say what is known."""
    rows = {"stable": [False], "undecided": [undecided], "inside_model": [True]}
    rows |= {"objective": [2.0], "numbers": np.full((1, 3), 2.0), "slopes": np.ones((1, 3, 2))}
    monkeypatch.setattr(periodic, "solve", lambda problem, units: rows)
    problem = resolve(Options(**SMALL))
    value, _ = periodic.numbers(problem)["objective"](np.full(2, 0.5))
    assert np.isfinite(value) == undecided
    assert of_orbits(problem, rows, problem.capacity(np.full((1, 2), 0.5))).tolist() == [undecided]
    known = {name: ("design", rows[name]) for name in ("stable", "undecided")}
    mapped = maps_of(np.zeros((1, 2)), xr.Dataset(known))
    assert mapped.stable_orbits == undecided
    known = dict(found=True, objective=2.0, stable=False, undecided=undecided)
    one = SimpleNamespace(orbit=SimpleNamespace(**known))
    assert formatting.turns(one) == ("unknown" if undecided else "never")
    said = {"undecided": [undecided], "failure": [""]}
    said |= {"largest_multiplier": [1.0], "multipliers_error": [0.1]}
    for words in (formatting.orbit(one), _motion(said, 0)):
        assert ("not known to be stable" in words) == undecided
        assert ("unstable" in words) == (not undecided)


def test_folder_that_cannot_be_written(tmp_path, capfd):
    """Before that is said, unusual numbers are told."""
    (tmp_path / "file").write_text("")
    options = Options(out=tmp_path / "file", overrides=(("young", "20.7 GPa"),))
    with pytest.raises(ValueError, match=r"^Argument `out` must be a folder that can be written"):
        design_search(options, Console())
    assert "unusual: " in capfd.readouterr().err


def test_a_search_without_time_says_what_is_missing(resumed):
    """Its program fails; the same command without --seconds goes on from its chunks."""
    with _for_seconds(0.01, stop := Event()):
        assert stop.wait(10)
    hurried, result = resumed.hurried, json.loads(resumed.hurried.result)
    missing = "maps, descents, long runs, bound, active constraints, fronts, checks are missing"
    assert result["status"] == f"stopped after 0.01 s: {missing}" and hurried.code == 1
    assert result["optimum"] is None and result["checks"] == []
    assert "stopped after 0.01 s" in hurried.report
    assert hurried.computed and hurried.chunks
    assert len({*resumed.maps}) == len(resumed.maps)


def test_an_interrupted_search_goes_on_with_the_same_bits(resumed, tmp_path):
    """Its status is told, maps are read, and the confirmation, which had not begun, is computed."""
    missing = "descents, long runs, bound, active constraints, fronts, checks are missing"
    assert json.loads(resumed.left["result.json"])["status"] == f"interrupted: {missing}"
    for part in ("<function _scene>", "lanes ([<function _row>"):  # of the orbits, of both starts
        assert any(part in function for function, *_ in resumed.maps)
    assert resumed.chunks and not (resumed.folder / "chunks").exists()
    assert resumed.rest and not {*resumed.rest} & {*resumed.maps}
    for name in ("orbits.nc", "landscape.nc"):
        (tmp_path / name).write_bytes(resumed.left[name])
        with xr.open_dataset(tmp_path / name) as one, xr.open_dataset(resumed.folder / name) as two:
            xr.testing.assert_equal(one, two)


def test_keys_of_a_journal_hold_values():
    """Problems that differ by a chamber's number alone, and the same problem made twice."""
    problem, again = (resolve(Options()) for _ in range(2))
    wide = replace(problem, chamber=replace(problem.chamber, height=jnp.asarray(0.7)))
    assert text_of(problem) == text_of(again) != text_of(wide)


@pytest.mark.slow
def test_a_search_on_two_workers_finds_the_same(tmp_path):
    """Map, landscape and motions are of several chunks."""
    pytest.importorskip("distributed")
    asked = QUIET | {"cells": (9, 5), "grid": (9, 8), "out": tmp_path}
    here, there = (
        design_search(Options(name=str(one), scheduler=one, **asked), Console(quiet=True))
        for one in (None, "2")
    )
    assert there.optimum.values == here.optimum.values
    assert there.optimum.objective == pytest.approx(here.optimum.objective, rel=1e-9)
    for name in ("orbits.nc", "landscape.nc"):
        with (
            xr.open_dataset(tmp_path / "None" / name) as one,
            xr.open_dataset(tmp_path / "2" / name) as two,
        ):
            xr.testing.assert_allclose(one[["objective"]], two[["objective"]], rtol=1e-9)

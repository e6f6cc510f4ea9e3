"""The design study: its gradient, its searches, going on after an interruption, and errors."""

import json
import sys
from dataclasses import fields

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from rich.console import Console

import jaxcrusher as jc
from jaxcrusher.files.program import program
from jaxcrusher.joint.validity import Validity
from optimize.balance import compare, objective, problem, report
from optimize.balance import study as balance
from optimize.balance.__main__ import study
from optimize.balance.compare import Answer, Search, Smooth, best_so_far, search, spent_until
from optimize.balance.designs import designs, headline, long_runs
from optimize.balance.methods import comparison, verdict
from optimize.balance.options import Options
from optimize.balance.problem import reference
from optimize.design import Design
from optimize.forces import FORCES

CENTRE = np.array([0.3, 1.2, 0.6])  # the second is outside the box


def _bowl() -> Smooth:
    """Least at CENTRE, projected on the box; a gradient counts as two values."""

    def value(point):
        return Answer(1 + float(np.sum((point - CENTRE) ** 2)), 3)

    def gradient(point):
        return Answer(*value(point)[:2], 2 * (point - CENTRE))

    return Smooth(value, gradient, 1.0, 2.0)


@pytest.mark.parametrize("method", compare.METHODS)
def test_every_method_finds_the_bottom_of_a_bowl(method):
    for module in ("cma", "pybobyqa"):
        pytest.importorskip(module)
    found = search(method, _bowl(), np.array([0.9, 0.1, 0.1]), 600, 1)
    # The bowl is 1.04 at its least in the box; the evolution's spread shrinks slowest.
    assert found.best[-1] == pytest.approx(1.04, abs=1e-4)
    np.testing.assert_allclose(found.point, [0.3, 1.0, 0.6], atol=1e-2)
    assert all(np.diff(found.best) < 0) and all(np.diff(found.work) > 0)
    work = 2 if method in ("L-BFGS-B", "Adam") else 1
    assert found.total_work == work * found.evaluations <= 600
    assert found.steps == 3 * found.evaluations
    again = search(method, _bowl(), np.array([0.9, 0.1, 0.1]), 600, 1)
    assert again.point == found.point and again.evaluations == found.evaluations


def test_a_search_stops_at_its_budget():
    found = search("L-BFGS-B", _bowl(), np.array([0.9, 0.1, 0.1]), 3.9)
    assert found.evaluations == 1 and found.total_work == 2.0


def test_the_best_so_far_is_that_of_the_work_done():
    found = Search("Adam", 0, work=[1.0, 4.0], best=[3.0, 2.0])
    at = np.array([0.5, 1.0, 3.9, 4.0, 9.0])
    np.testing.assert_array_equal(best_so_far(found, found.work, at), [np.nan, 3, 3, 2, 2])


def test_no_number_is_never_the_best():
    nowhere = Smooth(*2 * (lambda point: Answer(float("nan"), 0, np.full(3, np.nan)),), 1.0, 1.0)
    found = search("L-BFGS-B", nowhere, np.full(3, 0.5), 20)
    assert found.best == [] and found.failures == found.evaluations > 0


def test_gradient_against_differences():
    """All nine parameters of the study, with the joint's clearance."""
    options = Options()
    design, conditions = problem.design(options), problem.conditions(options)
    function = jax.jit(lambda unit: objective.orbit_slope(unit, conditions, design))

    def rms(point):
        return float(function(point)[0][0])

    def shaking(point):
        return float(function(point)[0][1].shaking_rms)

    # Printed for the ideal joint by two independent programs as 19 099 N; clearance adds 0.02 %.
    assert rms(design.unit(reference(Options()))) == pytest.approx(19_099, rel=5e-4)
    assert shaking(design.unit(reference(Options()))) == pytest.approx(4513.63, rel=1e-3)
    point, step = np.array([0.3, 0.6, 0.7, 0.4, 0.3, 0.6, 0.5, 0.4, 0.6]), 0.01
    (_, beside), slope = function(point)
    assert slope.shape == (9,) and 0 < beside.steps < 30
    differences = [(rms(point + e) - rms(point - e)) / (2 * step) for e in step * np.eye(9)]
    # The third derivative over a hundredth of the box leaves 1e-4 of the largest slope.
    np.testing.assert_allclose(slope, differences, rtol=0, atol=2e-4 * np.abs(slope).max())
    # So that no parameter's slope hides in that: each is above it.
    assert (np.abs(slope) > 5e-3 * np.abs(slope).max()).all()


@pytest.mark.slow
def test_a_search_without_gradients_is_given_none():
    options = Options()
    design, conditions = problem.design(options), problem.conditions(options)
    smooth, scale = objective.orbit_objective(design, conditions, design.unit(reference(options)))
    point = np.full(len(design.bounds), 0.4)
    value, sloped = smooth.value(point), smooth.gradient(point)
    assert value.slope is None and sloped.slope.shape == point.shape
    assert scale > 1e4 and value.value == pytest.approx(sloped.value, rel=1e-12)


def test_what_is_free_is_no_condition():
    """Twelve numbers more; the load is then chosen, and has no tolerance."""
    few, many = Options(), Options(machine=10.0)
    assert len(problem.design(few).bounds) == 9 and len(problem.design(many).bounds) == 21
    assert set(problem.conditions(few)) - set(problem.conditions(many)) == {"load"}
    design = problem.design(many)
    point = design.unit(reference(Options()))
    assert ((point > 0) & (point < 1)).all()
    heavy = design.description(np.where(np.array(design.names) == "load", 1.0, point))
    assert float(heavy["load"]) == pytest.approx(1.1 * 8800)


def test_searches_start_from_machines_that_move():
    def value(point):
        return Answer(float("nan") if point[0] < 0.7 else 1.0, 0)

    some = Smooth(value, value, 1.0, 1.0)
    starts = balance._starts(some, Options(starts=3), 2)
    assert len(starts) == 3 and all(start[0] >= 0.7 for start in starts)
    never = Smooth(*2 * (lambda _: Answer(float("nan"), 0),), 1.0, 1.0)
    with pytest.raises(RuntimeError, match="only 0 of 60 random machines"):
        balance._starts(never, Options(starts=3), 2)


def test_counterweight_of_a_shaft_alone():
    """With a jaw of no mass R_O is the shaft's: weight W and rotating unbalance U.

    (m1 + m)^2 g^2 + omega^4 (m1 l11 - m r)^2, opposite to S1, is least at
    m = (omega^4 r m1 l11 - m1 g^2) / (g^2 + omega^4 r^2).
    """
    fixed = {
        "joint": "ideal",
        "load_law": "none",
        "jaw.mass": 1e-9,
        "jaw.inertia": 1e-9,
        "toggle.mass": 1e-9,
        "toggle.inertia": 1e-9,
        "counterweight.radius": 0.2,
    }
    design = Design({"counterweight.mass": (0.5, 6.0), "counterweight.angle": (2.5, 5.0)}, fixed)

    @jax.jit
    def rms(unit):
        result = jc.statistics(design.scene(unit), 0, 1, outputs=("foundation_rms",))
        return result.foundation_rms / 1e3

    both = jax.jit(jax.value_and_grad(rms))

    def gradient(point):
        value, slope = both(jnp.asarray(point))
        return Answer(float(value), 0, np.asarray(slope))

    found = search("L-BFGS-B", Smooth(gradient, gradient, 1.0, 1.0), np.array([0.9, 0.1]), 100)
    fast, arm = 30.0**4, 0.2
    best = (fast * arm * 95 * 0.006 - 95 * 9.81**2) / (9.81**2 + fast * arm**2)
    values = design.values(np.array(found.point))
    # The search ends where the RMS changes by 1e-8; a parabola is 1e-4 wide there.
    assert float(values["counterweight.mass"]) == pytest.approx(best, rel=3e-3)
    assert float(values["counterweight.angle"]) == pytest.approx(np.radians(210), abs=3e-3)
    unbalance = fast * (95 * 0.006 - best * arm) ** 2
    least = np.sqrt((95 + best) ** 2 * 9.81**2 + unbalance) / 1e3
    assert found.best[-1] == pytest.approx(least, rel=1e-7)


def test_mean_and_spread_has_the_right_slope():
    matrix = np.random.default_rng(0).normal(size=(6, 2))

    def values(x):
        return (matrix @ x) ** 2

    x = np.array([0.4, 0.9])
    slopes = 2 * (matrix @ x)[:, None] * matrix
    value, slope = objective.mean_and_spread(values(x), slopes, 3.0)
    assert value == values(x).mean() + 3 * values(x).std()
    expected = jax.grad(lambda x: jnp.mean((matrix @ x) ** 2) + 3 * jnp.std((matrix @ x) ** 2))
    np.testing.assert_allclose(slope, expected(jnp.asarray(x)), rtol=1e-12)


def test_tolerances_are_the_same_for_everyone():
    middle, widths = {"load": 8800.0, "friction": 0.1}, {"load": 0.2, "friction": 0.5}
    first, second = (objective.tolerances(middle, widths, 20, 3) for _ in range(2))
    np.testing.assert_array_equal(first["load"], second["load"])
    for name, column in first.items():
        assert column.shape == (20,) and (np.abs(column / middle[name] - 1) <= widths[name]).all()
        assert np.ptp(column) > widths[name] * middle[name]


def test_table_of_methods_counts_what_never_arrived():
    rows = [
        {
            "method": "L-BFGS-B",
            "start": 0,
            "best": [0.9, 0.8],
            "work": [2.0, 4.0],
            "seconds": [0.1, 0.2],
            "evaluations": 2,
        },
        {
            "method": "CMA-ES",
            "start": 0,
            "best": [0.95],
            "work": [1.0],
            "seconds": [0.1],
            "evaluations": 9,
        },
        # One that found no number at all.
        {"method": "CMA-ES", "start": 1},
    ]
    assert spent_until(Search(**rows[0]), rows[0]["work"], 0.85) == 4.0
    headings, table = comparison({"cost": {"scale": 1000.0}, "searches": rows})
    columns = dict(zip(headings, zip(*table, strict=True), strict=True))
    gradient, evolution = columns["L-BFGS-B"], columns["CMA-ES"]
    assert gradient[:4] == ("800.00", "800.00 to 800.00", "1 of 1", "4 (4 to 4)")
    assert evolution[2:4] == ("0 of 2", "never (never to never)")
    assert columns["Py-BOBYQA"][0] == "none"
    cost = {"scale": 1000.0, "gradient_seconds": 4.0, "value_seconds": 2.0}
    said = verdict({"cost": cost, "searches": rows})
    assert said.startswith("Ranked by median work until arrival, in values: L-BFGS-B 4, CMA-ES n")
    # Four values, of which a gradient costs two.
    assert "The gradient search arrives after 2 gradients;" in said


def test_the_answer_stands_above_its_tables(monkeypatch, capsys):
    tables = ("comparison", "designs", "forces", "long_runs", "origins", "robust")
    for name in tables:
        monkeypatch.setattr(report, name, lambda _, name=name: ([f"of {name}"], [["1\\*"]]))
    monkeypatch.setattr(report, "headline", lambda _: "The answer.")
    report.print_tables(Console(width=80), {})
    said = [line.strip() for line in capsys.readouterr().out.splitlines() if line.strip(" ─")]
    assert said == ["The answer.", *(line for name in tables for line in (f"of {name}", "1*"))]


def test_table_of_designs_has_a_row_for_each_parameter():
    """With what of its optimum the design loses by it, and a star at a bound."""
    bounds = {"counterweight.moment_along": (0.0, 8.0), "bearing.inclination": (0.0, np.pi / 2)}
    given = {"eccentricity": 0.01, "counterweight_mass": 20.0, "capacity": 9.0}

    def design(along, inclination):
        values = dict(zip(bounds, (along, inclination), strict=True))
        return {"point": [along / 8, inclination / (np.pi / 2)], "values": values, **given}

    lost = {force: dict.fromkeys(bounds, 100.0 + i) for i, force in enumerate(FORCES)}
    chosen = {"before": design(4.0, np.pi / 6), "optimised": design(8.0, np.pi / 4)}
    chosen["optimised"]["one_by_one"] = lost
    headings, rows = designs({"designs": {"chosen": chosen, "bounds": bounds}})
    assert headings[:4] == ["parameter (* at a bound)", "bounds", "before", "optimised"]
    assert rows[:2] == [
        ["counterweight.moment_along, kg m", "0 to 8", "4", "8 *", "100", "101"],
        ["bearing.inclination, deg", "0 to 90", "30", "45", "100", "101"],
    ]
    assert [row[2] for row in rows[2:]] == ["0.01", "20", "9"]


@pytest.fixture
def bowl_study(monkeypatch):
    for module in ("cma", "pybobyqa"):
        pytest.importorskip(module)
    nine = Smooth(
        lambda p: Answer(1 + float(np.sum((p - 0.4) ** 2)), 1),
        lambda p: Answer(1 + float(np.sum((p - 0.4) ** 2)), 1, 2 * (p - 0.4)),
        1.0,
        10.0,
    )
    monkeypatch.setattr(objective, "orbit_objective", lambda *_: (nine, 20_000.0))


def test_an_interrupted_study_goes_on(bowl_study, tmp_path, monkeypatch):
    options = Options(out=tmp_path, starts=2, budget=50)
    called = []

    def interrupted(method, *arguments):
        called.append(method)
        if len(called) == 5:
            raise KeyboardInterrupt
        return search(method, *arguments)

    monkeypatch.setattr(balance, "search", interrupted)
    with pytest.raises(KeyboardInterrupt):
        balance.run(options, Console(quiet=True))
    path = tmp_path / "balance" / "result.json"
    kept = json.loads(path.read_text())
    assert kept["status"] == "interrupted" and len(kept["searches"]) == 4

    def end(*_):
        raise RuntimeError("end of the searches")

    monkeypatch.setattr(balance, "_robust", end)
    with pytest.raises(RuntimeError, match="end of the searches"):
        balance.run(options, Console(quiet=True))
    went_on = json.loads(path.read_text())["searches"]
    # The four that were missing, and nothing twice.
    assert len(called) == 9 and went_on[:4] == kept["searches"] and len(went_on) == 8
    with pytest.raises(ValueError, match=r"`name` .* of starts 2 \(now 3\)\."):
        balance.run(Options(out=tmp_path, starts=3, budget=50), Console(quiet=True))
    path.write_text("{")
    with pytest.raises(ValueError, match=r"^Argument `name` must be that of a run that can be"):
        balance.run(options, Console(quiet=True))


@pytest.mark.parametrize(
    ("change", "name"),
    [
        ({"overrides": (("speed", "0"),)}, "speed"),
        ({"overrides": (("clearance", "200 mm"),)}, "clearance"),
        ({"overrides": (("clearance", "0.06"),)}, "clearance"),
        ({"overrides": (("joint", "ideal"),)}, "scene"),
        ({"links": 6.0}, "links"),
        ({"machine": 11.0}, "machine"),
        ({"starts": 0}, "starts"),
        ({"budget": 0}, "budget"),
        ({"samples": 1}, "samples"),
        ({"tolerance": (0.5, 1.0, 0.1)}, "tolerance"),
        ({"sigmas": -1.0}, "sigmas"),
        ({"seed": -1}, "seed"),
    ],
)
def test_bad_options(change, name, tmp_path):
    with pytest.raises(ValueError, match=f"^Argument `{name}` must") as error:
        balance.run(Options(out=tmp_path, **change), Console(quiet=True))
    assert "\n" not in str(error.value)


def test_a_study_begins_with_the_machine_of_a_scene_file(tmp_path):
    """Its numbers, its counterweight by the moment, and its stroke."""
    path = tmp_path / "mine.toml"
    path.write_text(
        'speed = "200 rpm"\n[shaft]\neccentricity = "15 mm"\n'
        '[jaw]\nmass_centre_distance = "350 mm"\n'
        '[counterweight]\nmass = "10 kg"\nradius = "0.2 m"\nangle = "180 deg"\n'
    )
    options = Options(scene=path, overrides=(("clearance", "0.08 mm"),))
    made, first = problem.design(options), problem.reference(options)
    described = made.description(made.unit(first))
    assert problem.title(options) == "mine" and made.fixed["clearance"] == 0.08e-3
    assert made.bounds["jaw.mass_centre_distance"] == pytest.approx((0.315, 0.385), rel=1e-12)
    # Newton's method on the stroke ends at rounding of a length of 1 m, 1e-14 of 15 mm.
    assert float(described["shaft.eccentricity"]) == pytest.approx(0.015, rel=1e-12)
    assert float(described["counterweight.mass"]) == pytest.approx(10.0, rel=1e-12)
    assert abs(float(described["counterweight.angle"])) == pytest.approx(np.pi, rel=1e-12)
    assert float(described["speed"]) == pytest.approx(200 * np.pi / 30, rel=1e-12)
    assert problem.settings(options)["scene"]["shaft.eccentricity"] == 0.015


def test_a_long_run_outside_the_contact_model_says_so():
    names = [one.name for one in fields(Validity) if one.name not in ("others", "missing")]
    limits = dict(zip(names, map(jnp.array, (0.2, 0.1, 0.9, 0.9, 0.001)), strict=True))
    run = {
        "success": True,
        "whirl": False,
        "foundation_rms": 1.0,
        "foundation_rms_error": 0.1,
        "shaking_rms": 2.0,
        "validity": limits,
    }
    bad = run | {"whirl": True, "validity": limits | {"half_width_ratio": jnp.array(1.8)}}
    found = {
        "paper": {"centred": run, "contact": bad},
        "optimised": {"centred": run | {"success": False}, "contact": run},
    }
    _, rows = long_runs({"long_runs": found, "settings": {"settle": 5}})
    assert rows[0][1:] == ["1 ± 0.1 (2)", "failed"]
    assert rows[1][1].startswith("1 ± 0.1 (2), friction whirl, contact 1.80 bore radii wide")


def test_a_design_that_shakes_the_ground_more_says_so_first():
    """Its RMS of |R_O| + |R_C| is less all the same."""

    def told(**forces):
        figures = {"paper": {"foundation_rms": 19e3, "shaking_rms": 4e3}, "optimised": forces}
        return headline({"figures": figures})

    worse = told(foundation_rms=15.2e3, shaking_rms=5e3)
    assert worse.startswith(
        "Against the paper's machine the RMS force on the foundation falls by 20 %, but the RMS "
        "shaking force, which the ground feels, rises by 25 %, from 4 kN to 5 kN. RMS force on"
    )
    assert worse.endswith("RMS shaking force: 4 kN before, 5 kN after.")
    assert told(foundation_rms=15.2e3, shaking_rms=1e3).startswith("RMS force on the")


def test_missing_packages_are_named(monkeypatch, tmp_path):
    monkeypatch.setattr(compare, "_PACKAGES", {"no_such_module": "cma"})
    with pytest.raises(ValueError, match=r"^The comparison needs cma: pip install 'jaxcrusher\["):
        balance.run(Options(out=tmp_path), Console(quiet=True))


def test_command_line_error_is_one_line(monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["balance", "--links", "6"])
    with pytest.raises(SystemExit) as stopped:
        program(study)
    printed = capsys.readouterr().err.strip()
    assert stopped.value.code == 2
    assert "\n" not in printed and "`links` must lie in (0, 5] percent" in printed

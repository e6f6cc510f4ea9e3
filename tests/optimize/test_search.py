"""The design search, end to end on a small box, and what it refuses."""

import io
import json
import subprocess
import sys
from dataclasses import asdict, replace

import jax.numpy as jnp
import numpy as np
import pytest
import xarray as xr
from rich.console import Console

import jaxcrusher as jc
from jaxcrusher.batch.rows import VARIABLES
from jaxcrusher.dynamics.judgement import Slope
from optimize import confirm, landscape, local, problem
from optimize.evaluate import Window, judged, started
from optimize.objectives import OBJECTIVES
from optimize.options import Options
from optimize.pareto import nondominated
from optimize.report import print_table
from optimize.search import run

SMALL = dict(grid=(4, 2), settle=2, turns=2, steps=6, refine=1, runs=2)


# What the search asks of `jaxcrusher.regime` and `gradient_report`, which have tests of their own
# and take a minute of compilation.
QUIET = jc.Regime("periodic", ("largest exponent -0.1 a turn",), period=1)


def report_by_hand(scene, metric, parameters, *, settle_turns, turns):
    """Slopes for the names asked, one of them in doubt."""
    assert isinstance(scene(**parameters), jc.Scene)
    verdicts = dict(zip(parameters, ("ok", "doubtful"), strict=True))
    slopes = {
        name: Slope(name, "implicit", 2.0, 0.1, 0.0, verdict, (), {"implicit": (2.0, 0.1)})
        for name, verdict in verdicts.items()
    }
    return jc.GradientReport(metric, QUIET, settle_turns + turns, (0.0, 0.1), slopes)


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    out = tmp_path_factory.mktemp("results")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(jc, "gradient_report", report_by_hand)
        patch.setattr(jc, "regime", lambda scene, *_, **__: QUIET)
        # After two turns every start still impacts; the fits have a test of their own.
        patch.setattr(landscape, "CHAOTIC", np.inf)
        result = run(Options(out=out, name="small", **SMALL), Console(quiet=True))
    return out / "small", result


def test_result_holds_the_evidence(finished):
    folder, returned = finished
    result = json.loads((folder / "result.json").read_text())
    assert result["status"] == "finished"
    optimum = result["optimum"]
    assert 25 <= optimum["speed"] <= 40 and 0.03e-3 <= optimum["clearance"] <= 0.12e-3
    # The RMS rises with the speed, so the search must end at the box's lower edge.
    assert optimum["speed"] == pytest.approx(25.0, abs=0.5)
    assert optimum["foundation_rms"] < result["seed_choice"]["foundation_rms"]
    assert optimum["ideal_rms"] <= optimum["foundation_rms"] * 1.003
    assert optimum["regime"]["contact"]["name"] == "periodic"
    assert {"speed", "clearance"} == result["gradient_report"]["slopes"].keys()
    slopes = next(c for c in result["checks"] if "slopes" in c["name"])
    assert not slopes["passed"] and "by clearance: doubtful" in slopes["detail"]
    # Student's quantile of two runs is 12.7: an interval of so few runs is wide, and not 0.
    assert optimum["half_width"] > 0
    assert result["claim"]["bound"] > 0 and "Global within the box to" in result["claim"]["words"]
    stages_ = ("landscape", "regimes", "refinement", "confirmation")
    assert all(result["steps"][name] > 1000 for name in stages_)
    assert result["box"]["bounds"]["speed"] == [25.0, 40.0]
    assert all({"name", "passed", "detail"} == check.keys() for check in result["checks"])
    assert returned.optimum.objective == optimum["objective"]
    # All that the answer holds is in the file, and what a run is judged by follows from it.
    assert result.keys() == asdict(returned).keys()
    values = optimum["runs"][optimum["worse_start"]]["by_run"]["objective"]
    assert len(values) == 2 and optimum["objective"] == pytest.approx(np.mean(values), rel=1e-15)
    page = (folder / "report.html").read_text()
    assert "optimum" in page and "http://" not in page.replace("http://www.w3.org", "")
    assert 0 < optimum["runs"]["contact"]["validity"]["half_width_ratio"] < 0.5


def test_closing_table_names_what_is_outside_the_model(finished):
    _, answer = finished
    console = Console(record=True, quiet=False, file=io.StringIO(), width=200)
    runs = answer.optimum.runs["centred"]
    wide = replace(runs, validity=replace(runs.validity, half_width_ratio=jnp.array(1.8)))
    optimum = replace(answer.optimum, runs=answer.optimum.runs | {"centred": wide})
    print_table(console, replace(answer, optimum=optimum))
    text = console.export_text()
    assert "optimum: OUTSIDE the contact model: centred start, contact 1.80 bore radii" in text
    assert "paper's choice: inside the contact model" in text


def test_landscape_is_labelled(finished):
    folder, _ = finished
    with xr.open_dataset(folder / "landscape.nc") as landscape:
        assert set(landscape.foundation_rms.dims) == {"speed", "start", "clearance"}
        assert landscape.speed.attrs["units"] == "rad/s"
        # Where it comes from, and what the searched crusher is besides.
        assert landscape.attrs["source"].startswith("jaxcrusher ")
        assert json.loads(landscape.attrs["scene"])["jaw.mass"] == 524.0
        assert json.loads(landscape.attrs["box"])["bounds"]["speed"] == [25.0, 40.0]
        assert landscape.sizes["speed"] == 4
        assert np.isfinite(landscape.foundation_rms).all()
        assert np.isfinite(landscape.exponent).all()
        np.testing.assert_array_equal(landscape.objective, landscape.foundation_rms)
        # The state to go on from is that cell's own: a quiet motion is right to 1e-3 clearances
        # and m/s at this tolerance (rounding decides on the solver's steps), and neighbours differ
        # by more.
        cell = landscape.isel(start=1, speed=2, clearance=1)
        scene = started({name: float(cell[name]) for name in ("speed", "clearance")}, "contact")
        state = jc.statistics(scene, 2, 2, outputs=("foundation_rms",), rtol=1e-6).state
        np.testing.assert_allclose(cell.state, state, atol=1e-3)
        others = np.abs(landscape.state - cell.state).max("coordinate").to_numpy()
        assert np.sort(others.ravel())[1] > 2e-3
    for name in ("landscape", "capacity", "motion", "pareto"):
        assert (folder / f"{name}.png").stat().st_size > 10_000


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

    path, means, errors = local.descend_by_fits(bowl, np.array([0.9, 0.05]), rounds=20)
    # The last radius, a hundredth of the box, is left in each coordinate; five of them.
    assert np.abs(path[-1] - 0.3).max() < 5 * local.LAST_RADIUS
    assert means[-1] < means[0] - 30
    # Noise alone is no descent: the mean never rises, the centre does not wander.
    assert (np.diff(means) <= 0).all() and (errors > 0).all()

    def flat(units, numbers):
        return np.array([np.random.default_rng(n).normal() for n in numbers]) + units[:, 0] * 0

    still, _, _ = local.descend_by_fits(flat, np.array([0.5, 0.5]))
    assert (still == 0.5).all()


def test_an_objective_that_fails_is_not_followed():
    def fails(units, numbers):
        return np.full(len(units), np.nan)

    path, means, _ = local.descend_by_fits(fails, np.array([0.5, 0.5]))
    assert (path == 0.5).all() and np.isnan(means).all()


def test_nondominated_points():
    costs = np.array([[1.0, 4.0], [2.0, 2.0], [3.0, 3.0], [4.0, 1.0], [0.5, np.nan], [2.0, 2.0]])
    assert nondominated(costs).tolist() == [True, True, False, True, False, True]


def test_interval_is_students():
    """Of 1, 2, 3: mean 2, standard error 1/sqrt(3), quantile 4.303 at two degrees of freedom."""
    mean, half_width = confirm.interval(np.array([1.0, 2.0, 3.0]))
    assert mean == 2.0 and half_width == pytest.approx(4.302653 / np.sqrt(3), rel=1e-6)


def test_a_design_is_judged_by_its_worse_start():
    case = problem.case(Options())
    rows = {name: np.ones((2, 3)) for name in VARIABLES}
    rows |= {
        "state": np.zeros((2, 3, 4)),
        "objective": np.array([[1.0, 2.0, 3.0], [1.0, 1.0, 1.0]]),
        "counts": np.ones((2, 3), dtype=bool),
    }
    one = confirm.confirmed(case, np.zeros(2), rows)
    assert one.worse_start == "centred" and one.objective == 2.0
    assert one.half_width == one.runs["centred"].objective_half_width > 1
    # A single run that does not count, of either start, leaves no number to choose by.
    rows["counts"][1, 2] = False
    assert np.isnan(confirm.confirmed(case, np.zeros(2), rows).objective)


def test_objectives_follow_from_their_statistics():
    """Formulas on the paper's crusher, 30 rad/s and 0.06 mm, against sampled motions."""
    chamber = jc.CrushingChamber()
    scene = jc.paper_scene(30.0, 0.06e-3, start="contact")
    outputs = ("foundation_force", "joint_force", "drive_power", "normal_force")
    # The last point is the first of the next turn.
    motion = jc.simulate(scene, np.linspace(0, 4 * np.pi / 30, 20001), outputs=outputs)
    force = np.asarray(motion.foundation_force)[:-1]
    slip = 30.0 * 0.13
    expected = {
        "rms": np.sqrt((force**2).mean()),
        "mean": force.mean(),
        "peak": force.max(),
        "smooth_peak": (force**16).mean() ** (1 / 16),
        "joint_peak": np.linalg.norm(np.asarray(motion.joint_force), axis=1).max(),
        "wear": 3600 * np.asarray(motion.normal_force)[:-1].mean() * slip / 7.843,
        "energy": 3600 * np.asarray(motion.drive_power)[:-1].mean() / 7.843,
    }
    values = {}
    window = Window(0, 2, 1e-9)
    outputs = tuple({name for o in OBJECTIVES.values() for name in o.outputs})
    result = jc.statistics(scene, window.settle, window.turns, outputs=outputs, rtol=window.rtol)
    for name, objective in OBJECTIVES.items():
        values[name] = float(objective.formula(result, scene, chamber))
    # Sampling of a smooth periodic function; capacity to its four digits.
    for name in ("rms", "mean", "peak", "smooth_peak", "joint_peak"):
        assert values[name] == pytest.approx(expected[name], rel=1e-5), name
    # The jaw's own turning adds up to 1 % to the slip of the surfaces.
    assert values["wear"] == pytest.approx(expected["wear"], rel=0.01)
    assert values["energy"] == pytest.approx(expected["energy"], rel=2e-3)
    ideal = jc.statistics(jc.ideal_scene(30.0), 0, 1, outputs=("foundation_rms",)).foundation_rms
    assert values["excess"] == pytest.approx(values["rms"] - float(ideal), rel=1e-12)


def test_free_parameters_by_name():
    """Three free parameters: a Sobol sequence instead of a grid, and constraints that hold."""
    options = Options(
        design=(
            ("speed", "25", "40"),
            ("clearance", "30 um", "0.12 mm"),
            ("counterweight.mass", "0", "50"),
        ),
        capacity_floor=8.0,
        friction=0.05,
    )
    case = problem.case(options)
    assert case.design.names == ("speed", "clearance", "counterweight.mass")
    assert case.design.fixed["friction"] == 0.05
    units = landscape.points(case.design, options.grid, 8, 0)
    assert units.shape == (8, 3)
    *_, (_, data) = landscape.mapped(case, units, options.grid, Window(0, 2, 1e-6))
    assert data.objective.dims == ("start", "sample")
    # Capacity is 9.41 m3/h at 25 rad/s and falls as 1 / speed: 8 at 29.4 rad/s.
    np.testing.assert_array_equal(data.counts.all("start"), data.speed < 29.41)
    scene = case.design.scene(np.array([0.0, 0.0, 1.0]))
    assert float(scene.machine.shaft.mass) == pytest.approx(145.0)


@pytest.mark.parametrize(
    "change, name",
    [
        ({"speed": (40.0, 25.0)}, "speed"),
        ({"clearance": (0.1, 0.1)}, "clearance"),
        ({"clearance": (0.03, 200.0)}, "clearance"),
        ({"speed": (0.0, 1.0)}, "speed"),
        ({"grid": (1, 5)}, "grid"),
        ({"friction": -0.1}, "friction"),
        ({"impact_velocity": 0.0}, "impact_velocity"),
        ({"capacity_floor": -1.0}, "capacity_floor"),
        ({"design": (("speed", "30", "25"),)}, "bounds of speed"),
        ({"runs": 1}, "runs"),
        ({"design": (("sped", "30", "25"),)}, "sped"),
        ({"objective": "beauty"}, "objective"),
    ],
)
def test_bad_options(change, name, tmp_path):
    with pytest.raises(ValueError, match=f"^Argument `{name}` must") as error:
        run(Options(out=tmp_path, **change), Console(quiet=True))
    assert "\n" not in str(error.value)


def test_a_scene_file_that_makes_no_crusher(tmp_path):
    (tmp_path / "long.toml").write_text('[jaw]\nlength = "3 m"')
    with pytest.raises(ValueError, match=r"^Argument `machine` must close without a dead point"):
        run(Options(out=tmp_path, scene=tmp_path / "long.toml"), Console(quiet=True))


def test_folder_that_cannot_be_written(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(ValueError, match=r"^Argument `out` must be a folder that can be written"):
        run(Options(out=tmp_path / "file"), Console(quiet=True))


def test_interruption_leaves_what_was_finished(tmp_path, monkeypatch):
    def interrupt(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(landscape, "exponents", interrupt)
    with pytest.raises(KeyboardInterrupt):
        run(Options(out=tmp_path, name="cut", **SMALL), Console(quiet=True))
    assert json.loads((tmp_path / "cut" / "result.json").read_text())["status"] == "interrupted"
    assert (tmp_path / "cut" / "landscape.nc").exists()


def test_command_line_error_is_one_line():
    done = subprocess.run(
        [sys.executable, "-m", "optimize.run", "--speed", "40", "25"],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1 and "`speed`" in done.stderr

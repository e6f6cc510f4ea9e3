"""The commands of `python -m jaxcrusher`: what they write, keep, print and refuse."""

import importlib.util
import json
import math
import re
import runpy
import shlex
import sys
from pathlib import Path
from types import SimpleNamespace

import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
import pytest
import xarray as xr
from PIL import Image
from scipy.integrate import cumulative_trapezoid
from scipy.io import loadmat

import jaxcrusher as jc
from jaxcrusher import __main__
from jaxcrusher.batch.sweep import Ensemble
from jaxcrusher.commands import film, gradient, orbit, regimes, simulate, sweep
from jaxcrusher.commands.options import Crusher, Simulate
from jaxcrusher.dynamics.judgement import Slope
from jaxcrusher.dynamics.regime import Regime
from jaxcrusher.dynamics.slopes import GradientReport
from jaxcrusher.files.program import parse
from jaxcrusher.files.resume import begin
from jaxcrusher.files.text import number
from jaxcrusher.motion.indicators import Lyapunov
from jaxcrusher.motion.section import fine
from jaxcrusher.motion.simulation import Trajectory
from jaxcrusher.orbits.result import RESULTS, missing
from jaxcrusher.scenes.parameters import complete
from jaxcrusher.scenes.reader import read_machine
from jaxcrusher.scenes.units import said
from tests.commands import run

LACKS = "`by` must name numbers that the machine has, such as speed, but is"
PUMP = Path(__file__).parents[2] / "examples" / "pump.toml"
SHORT = shlex.split("--turns 2 --settle 1 --samples 401 --set start contact --set speed '300 rpm'")


@pytest.fixture(scope="module")
def simulated(tmp_path_factory):
    out = tmp_path_factory.mktemp("results")
    scene = out / "mine.toml"
    scene.write_text('clearance = "0.05 mm"\nspeed = "20 rad/s"\n')
    status, text = run("simulate", "--scene", scene, "--out", out, "--rtol", 1e-8, *SHORT)
    return out, status, text


def test_simulate_writes_a_labelled_motion(simulated):
    out, status, _ = simulated
    assert status == 0
    assert (out / "simulate" / "motion.png").stat().st_size > 10_000
    with xr.open_dataset(out / "simulate" / "motion.nc") as motion:
        motion.load()
    assert all(
        "units" in values.attrs and "long_name" in values.attrs for values in motion.values()
    )
    values = json.loads(motion.attrs["scene"])
    # The command line counts, then the file, then the paper.
    assert values["speed"] == pytest.approx(10 * np.pi)
    assert values["clearance"] == 0.05e-3 and values["jaw.mass"] == 524.0
    assert motion.attrs["failure"] == "none"
    assert motion.time.dtype == float and float(motion.time[-1]) == pytest.approx(0.4)
    # That crusher was simulated: its speed, and a pin that rests in the bore of its clearance
    # but for a penetration, which stays under a quarter of it.
    np.testing.assert_allclose(motion.shaft_speed, values["speed"], rtol=1e-12)
    np.testing.assert_array_equal(motion.angle, values["speed"] * motion.time.to_numpy())
    out_of_centre = np.hypot(*motion.eccentricity.transpose().to_numpy()) / 0.05e-3
    assert ((out_of_centre > 0.99) & (out_of_centre < 1.25)).all()


def test_the_angle_of_an_uneven_shaft_is_the_integral_of_its_speed():
    values = complete({"joint": "ideal", "speed_fluctuation": 0.2})
    scene, times = jc.build_scene(values), np.linspace(0, 0.2, 2001)
    motion = jc.simulate(scene, times, outputs=("shaft_speed", "energy"))
    angle = simulate.dataset(motion, scene, values).angle
    # By trapezoids, an error of 0.2 w^2 h^2 / 12 a turn of w h = 3e-3.
    turned = cumulative_trapezoid(motion["shaft_speed"], times, initial=0.0)
    np.testing.assert_allclose(angle, turned, atol=1e-6)


def test_the_picture_of_a_motion_names_clearances_and_what_is_drawn():
    machine = jc.paper_machine(clearance=0.05e-3, **{"elbow.clearance": 0.1e-3})
    scene = machine.scene()
    outputs = ("foundation_force", "eccentricity", "elbow_eccentricity")
    motion = jc.simulate(scene, np.linspace(0, 0.01, 5), outputs=outputs)
    figure = simulate.draw(motion, scene, np.arange(5))
    titles = ["radial clearance 0.05 mm", "elbow: radial clearance 0.1 mm"]
    assert [ax.get_title() for ax in figure.axes][:2] == titles
    # The axis of time ends where the samples do.
    assert figure.axes[2].get_xlim() == (0, 0.01)
    plt.close(figure)
    told = f"{said('speed', 30.0, {})}, turns 8 to 10, start centred"
    assert simulate.title(machine, 8.0, 10.0, motion, None) == told
    for settled, words in ((True, "settled"), (False, "still settling")):
        summary = SimpleNamespace(turns=2, settled=settled)
        assert simulate.title(machine, 8.0, 10.0, motion, summary) == f"{told}, {words}"


def test_simulate_says_what_the_motion_is(simulated):
    out, _, text = simulated
    with xr.open_dataset(out / "simulate" / "motion.nc") as motion:
        last = motion.foundation_force[200:-1].to_numpy()
        shaking = np.linalg.norm(motion.shaking_force[200:-1].to_numpy(), axis=1)
    found = re.search(
        r"foundation ([\d.]+) N, peak ([\d.]+) N, RMS shaking force ([\d.]+) N, "
        r"contact share ([\d.]+), no whirl, inside the contact model \(turns 2 to 2\)",
        text,
    )
    assert found, text
    # 200 samples of a turn, quiet in the bore, and rounding to 1 N.
    assert float(found[1]) == pytest.approx(np.sqrt(np.mean(last**2)), abs=1 + 1e-3 * last[0])
    # A top lies at most half a sample off: a quarter of a thousandth of what it stands above.
    assert float(found[2]) == pytest.approx(np.max(last), abs=1 + 1e-3 * last[0])
    assert float(found[3]) == pytest.approx(np.sqrt(np.mean(shaking**2)), abs=1 + 1e-3 * last[0])
    assert float(found[4]) == 1.0


@pytest.mark.parametrize(
    ("loose", "told"),
    [
        ({"joint": "ideal"}, ""),
        ({"joint": "ideal", "elbow.clearance": 3e-5}, ", elbow contact share 0.250"),
        ({"elbow.clearance": 3e-5}, ", contact share 0.750, elbow contact share 0.250"),
    ],
)
def test_a_span_without_a_whole_turn_tells_the_contact_of_each_loose_joint(loose, told):
    depths = {"penetration_ratio": [1.0, 1, 1, -1], "elbow_penetration_ratio": [-1.0, -1, 0, 1]}
    values = {name: jnp.array(of) for name, of in depths.items()}
    values |= {"foundation_force": jnp.full(4, 5e3), "shaking_force": jnp.full((4, 2), 1e3)}
    motion = Trajectory(jnp.arange(4.0), fine(), values)
    line = simulate.closing(motion, None, 0, jc.build_scene(loose))
    known = "RMS force on the foundation 5000 N, RMS shaking force 1414 N"
    assert line.startswith(f"{known}{told}, over the samples")


@pytest.mark.parametrize(
    ("seconds", "turns", "half"), [(3.0, 15, 7), (2.8, 14, 7), (2.7999, 13, 6)]
)
def test_seconds_of_whole_turns_lose_none_by_rounding(seconds, turns, half):
    options = Simulate(seconds=seconds)
    span = simulate._span(options, 300 * np.pi / 30)
    assert (int(span), simulate._settle(options, span)) == (turns, half)


def test_an_average_that_scatters_says_what_to_do():
    class Summary(dict):
        @property
        def values(self):
            return self

    def summary(error, whirl=False, settled=True):
        found = Summary(foundation_rms=36548.0)
        found.whirl, found.settled, found.error = whirl, settled, lambda name: error
        return found

    assert simulate.scattered(summary(5100.0), "foundation_rms").startswith(
        "The average still scatters by 14%: "
    )
    assert "python -m jaxcrusher orbit" in simulate.scattered(summary(5100.0), "foundation_rms")
    # Nothing of what is known, of a turn that tells no scatter, and of a whirl, which has no orbit.
    unsettled = simulate.scattered(summary(30.0, settled=False), "foundation_rms")
    assert unsettled.startswith("The motion has not settled")
    quiet = (summary(30.0), summary(np.inf, settled=False), summary(5100.0, whirl=True))
    assert [simulate.scattered(one, "foundation_rms") for one in quiet] == ["", "", ""]


def test_failed_run_is_kept_and_named(simulated):
    """A tolerance that no step meets."""
    out, _, _ = simulated
    status, text = run("simulate", "--out", out, "--name", "bad", "--rtol", 1e-40, *SHORT)
    assert status == 1 and "FAILED: stopped at" in text
    with xr.open_dataset(out / "bad" / "motion.nc") as motion:
        assert "stopped at" in motion.attrs["failure"]
        assert not np.isfinite(motion.foundation_force[1:]).any()


SWEEP = shlex.split(
    "sweep --over clearance '0.04 mm' '0.08 mm' 2 --over speed '240 rpm' '30 rad/s' 2 "
    "--settle 0 --turns 1 --chunk 2 --rtol 1e-5 --netcdf --csv --mat "
    "--set start contact --set speed '99 rad/s'"
)


def test_interrupted_sweep_keeps_what_is_finished_and_goes_on(tmp_path, monkeypatch, capsys):
    computed = []
    whole = Ensemble.compute

    def interrupted(ensemble, number):
        if number == 1:
            raise KeyboardInterrupt
        return whole(ensemble, number)

    def counted(ensemble, number):
        computed.append(number)
        return whole(ensemble, number)

    line = [str(word) for word in (*SWEEP, "--out", tmp_path)]
    monkeypatch.setattr(Ensemble, "compute", interrupted)
    monkeypatch.setattr(sys, "argv", ["jaxcrusher", *line])
    with pytest.raises(SystemExit) as stop:
        __main__.main()
    assert stop.value.code == 130
    assert (
        f"interrupted: what was finished is in {tmp_path}/sweep/: sweep.zarr"
        in capsys.readouterr().err
    )
    monkeypatch.setattr(Ensemble, "compute", counted)
    status, text = run(*line)
    assert status == 0 and computed == [1]
    with xr.open_zarr(tmp_path / "sweep" / "sweep.zarr") as grid:
        grid.load()
    assert grid.foundation_rms.dims == ("clearance", "speed")
    np.testing.assert_allclose(grid.speed, [8 * np.pi, 30.0])
    assert json.loads(grid.attrs["choices"])["start"] == "contact"
    with xr.open_dataset(tmp_path / "sweep" / "sweep.nc") as copy:
        assert copy.foundation_rms.equals(grid.foundation_rms)
        assert copy.foundation_rms.attrs["units"] == "N" and (copy.success == 1).all()
    table = np.genfromtxt(tmp_path / "sweep" / "sweep.csv", delimiter=",", names=True)
    np.testing.assert_array_equal(table["foundation_rms_N"], grid.foundation_rms.values.ravel())
    assert len(set(zip(table["clearance_m"], table["speed_rads"], strict=True))) == 4
    read = loadmat(tmp_path / "sweep" / "sweep.mat", simplify_cells=True)
    np.testing.assert_array_equal(read["foundation_rms"], grid.foundation_rms.values)
    assert (tmp_path / "sweep" / "sweep.png").stat().st_size > 10_000
    least = grid.foundation_rms.to_numpy().min()
    fared = "4 designs: 0 failed, 0 whirl, 0 more outside the contact model"
    assert f"{fared}; least RMS force on the foundation {least:.0f} N at clearance" in text
    line.remove("--netcdf")
    again = run(*line)[1]  # a finished sweep, opened and not computed
    assert computed == [1] and f"{fared}; least RMS force on the foundation {least:.0f} N" in again
    assert "sweep.zarr" in again and "sweep.nc" not in again
    with pytest.raises(ValueError, match=r"`name` must be new .* of base\.load 8800 \(now 9000\)"):
        run(*line, "--set", "load", "9 kN")


def test_a_sweep_presses_the_rock_of_its_scene_file(tmp_path):
    """It once took the paper's chamber, and refused what is for the load sheet."""
    described = ("joint", "ideal", "load_law", "chamber", "chamber.discharge", "60 mm")
    described += ("motor_power", "20 kW", "foundation.mass", "6 t")
    described += ("foundation.points.corner", "1 m, 0 m")
    scene = {"joint": "ideal", "load_law": "chamber", "chamber.discharge": 0.06}
    line = "sweep --over speed 29 30rad/s 2 --settle 0 --turns 1".split()
    for name, value in zip(described[::2], described[1::2], strict=True):
        line += ["--set", name, value]
    assert run(*line, "--out", tmp_path)[0] == 0
    with xr.open_zarr(tmp_path / "sweep" / "sweep.zarr") as grid:
        kept = json.loads(grid.attrs["parameters"])
        found = float(grid.foundation_rms[1])
    assert kept["chamber.discharge"] == [0.06, "m"] and "motor_power" not in kept
    machine = jc.paper_machine(**scene, **{"foundation.mass": 6000.0})
    right = jc.sweep(machine, {"speed": [30.0]}, 0, 1)
    # The paper's chamber is 40 % off.
    assert found == pytest.approx(float(right.foundation_rms[0]), rel=1e-6)


def test_a_small_force_keeps_its_digits():
    """A pump shakes by some newtons, of which whole ones once were told."""
    told = {"shaking_rms": [9.3124, 12.6], "success": [True, True]}
    told |= {"whirl": [False, False], "inside_model": [True, True]}
    of = {name: ("speed", column) for name, column in told.items()}
    said = sweep.closing(xr.Dataset(of, {"speed": [20.0, 30.0]}), "shaking_rms", {})
    assert "least RMS shaking force 9.312 N at speed 20 rad/s" in said


def test_a_sweep_with_a_failed_design_is_written_and_ends_with_1(tmp_path, monkeypatch):
    coordinates = {"start": ["centred", "contact"]}
    columns = {"foundation_rms": [math.nan, 2e4], "success": [False, True]}
    columns |= {"whirl": [False, False], "inside_model": [False, True]}
    of = {name: ("start", values) for name, values in columns.items()}
    monkeypatch.setattr(sweep, "sweep", lambda *_, **__: xr.Dataset(of, coordinates))
    line = ("sweep", "--over", "start", "centred", "contact", "--csv", "--out", tmp_path)
    status, text = run(*line)
    assert status == 1 and "2 designs: 1 failed, 0 whirl" in text
    assert (tmp_path / "sweep" / "sweep.csv").read_text().count("\n") == 3
    of["success"] = "start", [True, True]
    assert run(*line)[0] == 0


def test_a_scene_file_may_go_while_a_sweep_computes(tmp_path, monkeypatch):
    """It is read once: what took hours is told in the units that the file had."""
    file = tmp_path / "mine.toml"
    file.write_text('speed = "250 rpm"\nload_law = "normal_to_jaw"\n')
    told = {"foundation_rms": [1e4, 2e4], "success": [True, True]}
    told |= {"whirl": [False, False], "inside_model": [True, True]}
    speeds = {"speed": [25.0, 30.0]}

    def computed(*_, **__):
        file.unlink()
        return xr.Dataset({name: ("speed", values) for name, values in told.items()}, speeds)

    monkeypatch.setattr(sweep, "sweep", computed)
    monkeypatch.setattr(sweep, "plot_sweep", lambda *_, **__: None)
    line = ("sweep", "--over", "speed", "25", "30rad/s", 2, "--scene", file, "--out", tmp_path)
    status, text = run(*line)
    assert status == 0 and "least RMS force on the foundation 10000 N" in text


@pytest.fixture
def verdicts(monkeypatch):
    """In place of `jaxcrusher.regime`, whose work is tested elsewhere: the speeds it is asked."""
    asked = []

    def regime(scene, settle_turns, turns, *, tangent_turns, rtol):
        asked.append(float(scene.drive.speed))
        if len(asked) == 3:
            raise KeyboardInterrupt
        exponents = Lyapunov(np.array([0.5, -1.0]), np.array([0.1, 0.1]))
        return Regime("chaotic", ("evidence",), None, exponents, 0.99, 0.01)

    monkeypatch.setattr(regimes.jc, "regime", regime)
    return asked


def test_regimes_are_kept_one_by_one(tmp_path, verdicts):
    line = ("regimes", "--out", tmp_path, "--over", "speed", 25, "40rad/s", 4)
    with pytest.raises(KeyboardInterrupt):
        run(*line)
    assert verdicts == [25.0, 30.0, 35.0]
    with xr.open_dataset(tmp_path / "regimes" / "regimes.nc") as two:
        assert two.regime.values.tolist() == ["chaotic", "chaotic"]
        assert two.speed.values.tolist() == [25.0, 30.0] and two.speed.attrs["units"] == "rad/s"
        assert two.largest_exponent.values.tolist() == [0.5, 0.5] and two.period.isnull().all()
    status, text = run(*line)
    assert status == 0 and verdicts == [25.0, 30.0, 35.0, 35.0, 40.0]
    assert "speed 30 rad/s (286.5 rpm): chaotic: evidence (done before)" in text
    assert "speed 40 rad/s (382 rpm): chaotic: evidence\n" in text
    as_given = ("--set", "speed", "25rad/s", "--design", "clearance=60 um")
    assert "clearance 60 um: chaotic" in run("regimes", "--out", tmp_path / "um", *as_given)[1]
    verdicts.pop()
    # A list of designs on the same settings adds to what is there.
    run("regimes", "--out", tmp_path, "--design", "speed=30rad/s", "--design", "speed=45 rad/s")
    assert verdicts[5:] == [45.0]
    rows = json.loads((tmp_path / "regimes" / "regimes.json").read_text())["rows"]
    assert [row["design"]["speed"] for row in rows] == [25.0, 30.0, 35.0, 40.0, 45.0]
    # Of another machine they are classified anew, and the earlier rows are kept.
    run(*line, "--set", "friction", 0.2)
    kept = tmp_path / "regimes" / "earlier" / "1" / "regimes.json"
    assert [row["design"]["speed"] for row in json.loads(kept.read_text())["rows"]][-1] == 45.0
    rows = json.loads((tmp_path / "regimes" / "regimes.json").read_text())["rows"]
    assert len(rows) == len(verdicts) - 6 > 0


def test_regimes_of_two_ranges_are_drawn_where_they_belong(tmp_path, verdicts, monkeypatch):
    drawn = []
    monkeypatch.setattr(
        regimes, "plot_regimes", lambda kinds, *_, **how: drawn.append((kinds, how))
    )
    line = ("regimes", "--out", tmp_path, "--over", "speed", 25, "40rad/s", 2)
    assert "regimes.png" not in run(*line, "--name", "one")[1]
    verdicts += [0.0, 0.0]  # beyond the interruption
    status, text = run(*line, "--over", "clearance", 0.03, "0.12mm", 2)
    assert status == 0 and text.rstrip().endswith(str(tmp_path / "regimes" / "regimes.png"))
    (kinds, how), *more = drawn
    assert not more and kinds.dims == ("speed", "clearance") and (kinds == "chaotic").all()
    assert how["units"]["clearance"] == "mm" and kinds.speed.values.tolist() == [25.0, 40.0]


def test_regimes_of_a_file_that_changed_are_found_anew(tmp_path, verdicts):
    curve = tmp_path / "load.csv"
    line = ("regimes", "--out", tmp_path, "--set", "load_law", "by_angle")
    line = (*line, "--set", "load_curve", curve, "--design", f"load_curve={curve}")
    for most in (4, 5):
        curve.write_text(f"angle_deg, force_kN\n0, 2\n120, {most}\n240, 3\n")
        assert "done before" not in run(*line)[1]
    assert len(verdicts) == 2 and "done before" in run(*line)[1]
    rows = json.loads((tmp_path / "regimes" / "regimes.json").read_text())["rows"]
    assert [row["design"] for row in rows] == [{"load_curve": str(curve)}]


def test_gradient_asks_for_the_crusher_of_the_command_line(tmp_path, monkeypatch):
    """`jaxcrusher.gradient_report` is tested elsewhere: here, what goes in and what is written."""
    asked, count = {}, []

    def report(machine, metric, names, **options):
        count.append(metric)
        options["progress"]("a stage")
        parameters = {name: machine.number(name) for name in names}
        asked.update(parameters, metric=metric, turns=options["turns"])
        built = machine.scene(**{name: 2 * value for name, value in parameters.items()})
        assert (
            float(built.linkage.bodies.at("jaw").mass) == 1000.0
            and float(built.drive.speed) == 25.0
        )
        slopes = {
            name: Slope(
                name, "fit", np.float64(1.5), np.nan, 0.1, "doubtful", ("why",), {"fit": (1.5, 0.1)}
            )
            for name in parameters
        }
        kind = Regime("chaotic", ("evidence",))
        return GradientReport(metric, kind, 10, (0.5, 0.1), slopes)

    monkeypatch.setattr(gradient.jc, "gradient_report", report)
    options = "--by jaw.mass counterweight.mass --set jaw.mass '0.5 tonne' --set speed '25 rad/s'"
    line = shlex.split(f"gradient contact_fraction {options} --turns 7 --out '{tmp_path}'")
    status, text = run(*line)
    # The same question is answered again at once, and another one is not.
    again, kept = run(*line)
    assert again == status == 0 and len(count) == 1
    done = f"{tmp_path / 'gradient' / 'gradient.json'} (done before)"
    assert kept == text.replace(str(tmp_path / "gradient" / "gradient.json"), done)
    run(*line, "--turns", 8)
    assert len(count) == 2 and (tmp_path / "gradient" / "earlier" / "1" / "gradient.json").exists()
    # Nor is one that an interrupted run, or other versions, left no answer to.
    path = tmp_path / "gradient" / "gradient.json"
    path.write_text(path.read_text().replace('"environment": "', '"environment": "other '))
    assert run(*line) == (status, text) and len(count) == 3
    path.unlink()
    assert run(*line) == (status, text) and len(count) == 4
    # A value of 0 is as good as another.
    numbers = {"jaw.mass": 500.0, "counterweight.mass": 0.0}
    assert asked == {**numbers, "metric": "contact_fraction", "turns": 7}
    # Printed by the unit given, kept in SI units.
    assert status == 0 and "by jaw.mass: 1500, fit, doubtful (why)" in text
    assert "units: by jaw.mass 1/tonne, by counterweight.mass 1/kg" in text
    slope = json.loads((tmp_path / "gradient" / "gradient.json").read_text())["slopes"]["jaw.mass"]
    assert slope["units"] == "(1)/(kg)" and slope["value"] == 1.5
    assert slope["standard_error"] is None and slope["verdict"] == "doubtful"


@pytest.mark.parametrize(
    ("machine", "names"),
    [
        ("", ["speed", "clearance"]),
        ("--set elbow.clearance 0.1mm", ["speed", "clearance", "elbow.clearance"]),
        (f"--scene {PUMP}", ["speed", "joints.B.clearance"]),
    ],
)
def test_a_gradient_is_by_the_speed_and_all_clearances(machine, names, tmp_path, monkeypatch):
    asked = []

    def report(machine, metric, names, **options):
        asked.extend(names)
        return GradientReport(metric, Regime("chaotic", ()), 10, (0.5, 0.1), {})

    monkeypatch.setattr(gradient.jc, "gradient_report", report)
    assert run(*shlex.split(f"gradient {machine} --out '{tmp_path}'"))[0] == 0
    assert asked == names


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("simulate --set sped 3", "`sped` must be a known key"),
        ("simulate --set clearance 0.5m", "`clearance` must be smaller than the bore radius"),
        ("simulate --scene {long}", "long.toml: `jaw.length`, `toggle.length` and `bearing.d"),
        ("simulate --set jaw.length 3m", "`bearing.distance` must let the links close in every tu"),
        ("simulate --set speed 30", "`speed` must have a unit"),
        ("simulate --turns 3 --seconds 1", "`turns` must not be given with seconds"),
        ("simulate --name ../evil", "`name` must be the name of one folder"),
        ("sweep --over speed 25 40 3", "`speed` must have a unit"),
        ("sweep --over speed 25 40rad/s 2 --scene {long}", "`bearing.distance` must let"),
        ("regimes --scene {long}", "`bearing.distance` must let"),
        ("gradient --scene {long}", "`bearing.distance` must let"),
        ("simulate --turns -1", "`turns` must be finite and > 0"),
        ("simulate --turns 2 --settle 5", "`settle` must be under the time span, 2 turns"),
        ("simulate --samples 1", "`samples` must be a whole number >= 2"),
        ("simulate --rtol 2", "`rtol` must be one number < 1"),
        ("regimes --turns 19", "`turns` must be a whole number >= 20, but is 19"),
        ("regimes --rtol 2", "`rtol` must be one number < 1"),
        ("gradient --rtol 2", "`rtol` must be one number < 1"),
        ("orbit --period 0", "`period` must be a whole number >= 1"),
        ("film --period 0", "`period` must be a whole number >= 1"),
        ("film --motion run --turns 0", "`turns` must be a whole number >= 1, but is 0"),
        ("film --settle -1", "`settle` must be a whole number >= 0, but is -1"),
        ("film --frames 1", "`frames` must be a whole number >= 2, but is 1"),
        ("film --frames 151", "`frames` must be at most 150, so that the page stays under 10 MB"),
        ("sweep", "`over` must be given at least once"),
        ("sweep --over --over speed 25 40rad/s 2", "`over` must be NAME LOW HIGH COUNT, or"),
        ("sweep --over speed 25 40", "`over` must be speed LOW HIGH COUNT, but is speed 25 40"),
        ("sweep --over speed 40 25rad/s 4", "`over` must have LOW < HIGH for speed"),
        ("sweep --over speed 25 40rad/s 1", "`over` must have a whole COUNT >= 2 for speed"),
        ("sweep --over speed 25 '40 Hz' 4", "Write rpm or rad/s"),
        ("sweep --over start middle", "`start` must be one of"),
        ("sweep --over speed 25 40rad/s 2 --over speed 25 40 2", "given twice for speed"),
        ("sweep --over speed 25 40rad/s 2 --settle -1", "`settle` must be a whole number >= 0"),
        ("regimes --design speed", "`design` must be KEY=VALUE"),
        ("regimes --design 'speed=30rad/s clearance=3mm'", "have a comma after each VALUE"),
        ("regimes --design speed=30rad/s,clearance=0,03mm", "decimal points, not commas"),
        ("regimes --design speed=3rad/s,speed=4rad/s", "`design` must name a key once"),
        ("regimes --design speed=30rad/s --design clearance=3e-5m", "`design` must name speed"),
        ("regimes --set joint ideal", "`joint` must have clearance"),
        ("identify --free jaw.mass", "`measured` must name a file"),
        ("identify --measured m.csv", "`free` must name numbers to be found"),
        ("gradient speed", "`metric` must be one of 'foundation_rms'"),
        ("gradient --by start", "`start` must be a number's key"),
        ("gradient --by load_seed", "`by` must name a number that may vary continuously"),
        ("simulate --set clearance 0", "> 0 m (an ideal joint has `joint=ideal`), but is 0.0."),
        ("simulate --set elbow.clearance 0mm", "m (an ideal joint has none: leave it out), but is"),
        ("simulate --set clearance 100mm", "`clearance` must be possible"),
        ("simulate --set jaw.mass 0.524kg", "`jaw.mass` must be possible"),
        ("simulate --set bore_radius 130m", "`bore_radius` must be possible"),
        # The paper has 2b - s = 60.6 mm with b = 34.0246 mm.
        ("simulate --set chamber.discharge 5mm", "stroke at its lower end, 7.4492 mm, but is 5 mm"),
        ("simulate --scene {long}", "The file leaves toggle.length and bearing.distance to the PE"),
        (
            "orbit --set diametral_clearance 0,1mm",
            "`diametral_clearance` must be a quoted quantity",
        ),
        ("gradient --by load_edge", f"{LACKS} load_edge."),
        ("gradient --by foundation.mass", f"{LACKS} foundation.mass."),
        (f"gradient --scene {PUMP} --by jaw.mass", "`jaw.mass` must be a known key"),
        (f"gradient --scene {PUMP} --by bodies.rod.mass_centre.y", LACKS),
        ("gradient --by bore_diameter", "`by` must name the radius, bore_radius, but is bore_dia"),
        (
            "sweep --over clearance 0.03 0.1mm 3 --over diametral_clearance 0.1 0.2mm 3",
            "given twice for clearance",
        ),
        ("sweep --over clearance 0.03 100mm 3", "`clearance` must be possible"),
        ("regimes --design clearance=100mm", "`clearance` must be possible"),
        ("sweep --over chamber.width 0.4 0.6m 3", "`over` must name numbers of the motion"),
        ("gradient --by chamber.width", "`by` must name numbers of the motion"),
        ("bearing --over stroke 7 8mm 2", "`over` must name numbers of the motion"),
        ("regimes --design stroke=8mm", "`design` must name numbers of the motion"),
        ("regimes --over joint clearance ideal", "`design` must have clearance to move in"),
        ("gradient transmitted_rms", "`metric` must be one of 'foundation_rms'"),
        ("bearing --turns 0", "`turns` must be a whole number >= 1, but is 0"),
        ("foundation --speeds 0 500rpm", "`speeds` must be finite and > 0 rad/s, but is 0.0."),
        ("foundation --settle -1", "`settle` must be a whole number >= 0, but is -1"),
        ("foundation --dynamic-factor inf", "`dynamic_factor` must be >= 1 and finite"),
    ],
)
def test_mistakes_are_named_before_anything_is_computed(line, words, tmp_path):
    (tmp_path / "long.toml").write_text('[jaw]\nlength = "3 m"')
    with pytest.raises(ValueError) as error:
        run(*shlex.split(line.format(long=tmp_path / "long.toml")), "--out", tmp_path / "out")
    assert words in str(error.value) and "\n" not in str(error.value)
    # Nothing is left but where the sweep itself looks at its numbers.
    assert not (tmp_path / "out").exists() or line.endswith("2 --settle -1")


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("simulate --sed 3", "Unrecognized options: --sed, 3. Is it --set or --seconds? "),
        ("regimes --seetle 3", "Unrecognized options: --seetle, 3. Is it --settle or --set? "),
        ("gradient --xyzzy 3", "Unrecognized options: --xyzzy, 3. "),
        ("simulate --seed 3", "options: --seed 3. Is it --scene or --set? "),
        ("simulate x", "Unrecognized options: x. "),
        ("simulate --samples x", "--samples must be INT, but is 'x'. "),
        ("simulate --turns x", "--turns must be FLOAT, but is 'x'. "),
        ("foundation --speeds", "--speeds must be STR STR, but is nothing. "),
        ("foundation --speeds 100", "--speeds must be STR STR, but is '100'. "),
        ("simulate --set speed", "Expected 2 values. "),
        (
            "sweep --engine abacus",
            "invalid choice 'abacus' for argument '--engine'. Expected one of",
        ),
    ],
)
def test_options_of_a_command_are_its_own(line, words):
    with pytest.raises(ValueError, match=re.escape(words)) as error:
        parse(__main__.run, line.split())
    told = str(error.value)
    assert told.endswith(f" {line.split()[0]} --help tells all.") and "\n" not in told
    # No option of another command, and nothing that the help tells.
    assert "--seed" not in told.partition(". ")[2]
    assert not re.search("Got errors|applied|Argument helptext|For full", told)


def test_word_that_is_no_command():
    with pytest.raises(ValueError, match=r"simulat\. .*: simulate, sweep, .* Is it simulate\? "):
        parse(__main__.run, ["simulat"])
    with pytest.raises(
        ValueError, match=r"Expected one of \{simulate, sweep, .* --help tells all\."
    ):
        parse(__main__.run, [])


@pytest.mark.slow
def test_results_of_another_command_line_are_kept(simulated):
    """They are moved beside those of the new command, which computes at once."""
    out, _, _ = simulated
    motion, picture = out / "simulate" / "motion.nc", out / "simulate" / "motion.png"
    before = motion.read_bytes()
    aside = out / "simulate" / "earlier" / "1"
    status, _ = run("simulate", "--out", out, "--turns", 3)
    assert status == 0 and (aside / "motion.nc").read_bytes() == before != motion.read_bytes()
    assert (aside / "motion.png").exists() and picture.exists()
    then, now = (json.loads((of / "settings.json").read_text()) for of in (aside, aside.parents[1]))
    assert then["settings"]["turns"] != now["settings"]["turns"] == 3
    before = motion.read_bytes()
    settings = json.loads((out / "simulate" / "settings.json").read_text())["settings"]
    begin(out / "simulate", settings, "motion.nc", "motion.png")
    assert not motion.exists() and not picture.exists()
    motion.write_bytes(before)
    (out / "simulate" / "settings.json").unlink()
    with pytest.raises(ValueError, match=r"`name` must be new, but .* holds motion.nc of an unkno"):
        run("simulate", "--out", out)


def test_folder_that_cannot_be_written(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(ValueError, match="`out` must be a folder that can be written"):
        run("simulate", "--out", tmp_path / "file")


def commands_shown() -> dict[str, list[tuple[str, str]]]:
    """Page -> the modules and options that its blocks, its sentences or its comments show."""
    root = Path(__file__).parents[2]
    pages = [root / "README.md", root / "CONTRIBUTING.md", *sorted((root / "docs").rglob("*.md"))]
    found: dict[str, list[tuple[str, str]]] = {}
    for path in (*pages, *sorted((root / "examples").glob("*.toml"))):
        text = path.read_text()
        blocks = "".join(re.findall(r"```sh\n(.*?)```", text, re.DOTALL))
        if path.suffix == ".toml":
            blocks = re.sub(r"(?m)^#", "", text)
        prose = re.sub(r"```.*?```", "", text, flags=re.DOTALL)
        lines = [part for line in blocks.splitlines() for part in line.split("&&")]
        lines += [" ".join(one.split()) for one in re.findall(r"`(python -m [^`]+)`", prose)]
        shown = [
            re.match(r"\s*python -m ((?:jaxcrusher|optimize|benchmarks)[\w.]*)(.*)", one)
            for one in lines
        ]
        if any(shown):
            found[path.relative_to(root).as_posix()] = [(m[1], m[2]) for m in shown if m]
    return found


SHOWN = commands_shown()


def test_commands_are_found_in_blocks_sentences_and_comments():
    assert sum(map(len, SHOWN.values())) > 40
    for page, one in (
        ("README.md", ("optimize.run", " --scene my_crusher.toml --speed 200 350rpm")),
        ("docs/work_precision.md", ("benchmarks.work_precision", " --out docs")),
        ("examples/template.toml", ("jaxcrusher", " simulate --scene my_crusher.toml")),
    ):
        assert one in SHOWN[page]


@pytest.mark.parametrize("page", SHOWN)
def test_documented_commands_are_understood(page, monkeypatch):
    """Each command line that a page shows: its module is begun, and its options are parsed."""
    mains = []
    for where in ("jaxcrusher.files.program", "benchmarks.start"):
        monkeypatch.setattr(f"{where}.program", lambda main, *_, **__: mains.append(main))
    monkeypatch.delitem(sys.modules, "jaxcrusher.__main__")  # it would be begun twice
    for module, options in SHOWN[page]:
        words = [word for word in shlex.split(options, comments=True) if word != "..."]
        # "simulate|sweep" shows two commands, and "CASE" stands for one of several.
        alternatives = words[0].split("|") if words and "|" in words[0] else words[:1]
        words = [word for word in words[1:] if word != "CASE"]
        runpy.run_module(
            f"{module}.__main__" if is_package(module) else module, run_name="__main__"
        )
        for first in alternatives or [None]:
            line = [*([first] if first not in (None, "CASE") else []), *words]
            try:
                assert callable(parse(mains[-1], line))
            except SystemExit as stop:  # of --help
                assert stop.code == 0 and "--help" in line, line
    assert len(mains) == len(SHOWN[page])


def is_package(module: str) -> bool:
    found = importlib.util.find_spec(module)
    return found is not None and found.submodule_search_locations is not None


@pytest.mark.parametrize(
    "command",
    [
        "simulate",
        "sweep",
        "regimes",
        "gradient",
        "film",
        "foundation",
        "balance",
        "bearing",
        "identify",
    ],
)
def test_help_explains_every_option(command, capsys):
    with pytest.raises(SystemExit) as stop:
        parse(__main__.run, [command, "--help"])
    assert stop.value.code == 0
    # From one option to the next: its name, what it takes, and what it is.
    parts = re.split(r"\n[│ ]{1,3}(?=--\w)", capsys.readouterr().out)[1:]
    options = {part.split()[0]: len(re.findall(r"[a-z]{2,}", part)) for part in parts}
    assert {"--scene", "--set", "--name", "--out"} < set(options)
    assert min(options.values()) > 4, options


def scene_file(folder: Path) -> Path:
    """Return a scene file that leaves most numbers out."""
    path = folder / "mine.toml"
    path.write_text('speed = "25 rad/s"\n[toggle]\nmass = "25 kg"\n')
    return path


def test_a_picture_of_ideal_joints_has_no_empty_place(monkeypatch, tmp_path):
    kept = []
    monkeypatch.setattr(orbit, "write_figure", lambda path, figure, **_: kept.append(figure))
    orbit.draw(jc.periodic_orbit(jc.ideal_scene(30.0)), {}, tmp_path / "orbit.png")
    (ax,) = kept[0].axes
    assert ax.get_ylabel() == "$|R_O| + |R_C|$ (kN)" and ax.get_xlim() == (0, 360)
    title = kept[0].get_suptitle()
    assert re.fullmatch(r"30 rad/s .* periodic orbit, RMS 19.1 kN, nothing oscillates", title)


SOLVED = ("orbit", "--set", "speed", "27rad/s", "--set", "clearance", "5e-5 m")


def test_slopes_of_a_statistic_are_its_own():
    """Each statistic is pulled back alone, from one orbit."""

    def solve(numbers):
        return {"foundation_rms": 3 * numbers["a"] + numbers["b"], "shaking_rms": 5 * numbers["b"]}

    found = orbit.slopes_of(solve, {"a": 1.0, "b": 2.0}, ("foundation_rms", "shaking_rms"))
    assert found["foundation_rms"] == {"a": 3.0, "b": 1.0}
    assert found["shaking_rms"] == {"a": 0.0, "b": 5.0}


def orbit_solved(out: Path) -> tuple[str, dict]:
    """What the command prints and keeps."""
    status, text = run(*SOLVED, "--out", out)
    assert status == 0 and "settles in" in text and "inside the contact model" in text
    kept = json.loads((out / "orbit" / "orbit.json").read_text())
    assert kept["stable"] and kept["foundation_rms"] == pytest.approx(18524.15958, rel=1e-9)
    return text, kept


def test_orbit_writes_what_it_found(tmp_path, monkeypatch):
    """Its slopes by every number are looked at in the next test."""

    def ones(solve, numbers, metrics):
        return {metric: dict.fromkeys(numbers, 1.0) for metric in metrics}

    monkeypatch.setattr(orbit, "slopes_of", ones)
    text, kept = orbit_solved(tmp_path)
    assert kept["slopes_of_foundation_rms"]["speed"] == 1.0
    names = ("orbit.json", "orbit.csv", "orbit.png")
    assert {file.name for file in (tmp_path / "orbit").iterdir()} >= {*names}
    assert text.split()[-3:] == ", ".join(str(tmp_path / "orbit" / name) for name in names).split()
    # By phase, which is not the angle of an uneven shaft.
    assert orbit.history(jc.periodic_orbit(jc.ideal_scene(30.0))).angle.long_name.endswith("speed")


@pytest.mark.slow
def test_orbit_solves_for_the_periodic_orbit(tmp_path):
    """RMS, multipliers, and a slope by every number."""
    text, kept = orbit_solved(tmp_path)
    # 27 rad/s leave (27 / 30)^2 of the 4513.63 N at 30 rad/s: both are kinematics, but for the pin.
    assert kept["shaking_rms"] == pytest.approx(0.81 * 4513.63, rel=1e-3)
    assert f"shaking force: RMS {kept['shaking_rms']:.5f}"[:-2] in text
    by_speed = kept["slopes_of_shaking_rms"]["speed"]
    assert by_speed == pytest.approx(2 / 27 * kept["shaking_rms"], rel=2e-3)
    assert re.search(rf"speed\s.* {re.escape(number(by_speed))} .* 163\.5", text)
    slopes = kept["slopes_of_foundation_rms"]
    assert set(slopes) == set(jc.PARAMETERS) & set(jc.PE250X400)
    assert slopes["speed"] == pytest.approx(163.534, rel=1e-5)
    # In the units given, and in those of drawings where none were.
    assert re.search(r"speed\s.*27 rad/s.* N/\(rad/s\) .* 163\.5", text)
    assert re.search(r"clearance\s.*5e-05 m .*N/m ", text) and "695 mm" in text
    assert "jaw.mass_centre_distance" in text and " -0 " not in text
    # A step of the counterweight, which is 0, does more than one of the clearance.
    assert text.index("counterweight.mass") < text.index("clearance ")
    assert "1 deg of an angle, 1 kg of counterweight.mass." in text and "*" not in text
    assert (tmp_path / "orbit" / "orbit.png").stat().st_size > 10_000
    history = np.genfromtxt(tmp_path / "orbit" / "orbit.csv", delimiter=",", names=True)
    assert history["angle_deg"][[0, -1]].tolist() == [0, 360]
    # The mean square of 360 equal steps is the orbit's to the force's bend where R_O is least.
    rms = np.sqrt(np.mean(history["foundation_force_N"][:-1] ** 2))
    assert rms == pytest.approx(kept["foundation_rms"], rel=1e-5)
    assert {"shaking_force_x_N", "eccentricity_y_m"} < set(history.dtype.names)


def test_slopes_of_an_orbit_are_shown_where_a_force_feels_them(tmp_path):
    # Numbers that a scene file leaves out are marked.
    crusher = Crusher(scene_file(tmp_path), (("load", "9 kN"),))
    marked = orbit.borrowed_by(crusher, read_machine(crusher.scene, crusher.overrides))
    assert "jaw.mass" in marked and not {"load", "toggle.mass", "speed"} & set(marked)
    found = {"foundation_rms": 1e4, "shaking_rms": 1e4}
    machine = jc.paper_machine()
    numbers = [name for name in jc.PE250X400 if name in jc.PARAMETERS]
    slopes = {metric: dict.fromkeys(numbers, 1.0) for metric in ("shaking_rms", "foundation_rms")}
    shown = orbit.table(orbit.changes(found, slopes, machine), slopes, machine, marked)
    cells = dict(zip(*(list(shown.columns[i].cells) for i in (0, 1)), strict=True))
    assert cells["jaw.mass"] == "524 kg *" and cells["load"] == "8800 N"
    # What changes neither force has no row, but a line: rounding is no slope, and NaN is no zero.
    for name, slope in (("young", 0.0), ("poisson", -1e-7), ("load", math.nan)):
        slopes = {metric: of | {name: slope} for metric, of in slopes.items()}
    slopes["shaking_rms"]["friction"] = 0.0
    slopes["shaking_rms"]["jaw.mass"] = 1e6
    shares = orbit.changes(found, slopes, machine)
    names = list(orbit.table(shares, slopes, machine, marked).columns[0].cells)
    assert {"load", "friction"} < set(names) and not {"young", "poisson"} & set(names)
    # As they change the shaking force.
    assert names[0] == "jaw.mass" and names[-2:] == ["friction", "load"]
    told = orbit.notes(machine, marked, names)
    # 1 N/m of a clearance, and of a radius of 6 mm, is too little as well.
    small = "clearance, young, poisson, shaft.mass_centre_radius"
    assert f"No force changes by 1e-06 % with a step of {small}." in told and len(told) == 3


@pytest.mark.parametrize("scatter", [0.0, 0.2])
def test_an_orbit_of_a_rough_feed_is_told_to_be_under_the_mean_load(scatter):
    found = jc.periodic_orbit(jc.build_scene({"joint": "ideal", "load_scatter": scatter}))
    assert (orbit.ROUGH in orbit.summary(found)) == (scatter > 0)


FILMED = ("film", "--set", "joint", "ideal", "--frames", "3")


def test_film_writes_a_film_of_the_orbit(tmp_path, monkeypatch):
    monkeypatch.setattr(film.FFMpegWriter, "isAvailable", lambda: False)
    status, text = run(*FILMED, "--out", tmp_path)
    assert status == 0 and text.count(film.NO_FFMPEG) == 1
    folder = tmp_path / "film"
    names = {"film.html", "film.gif", "film.png"}
    assert {path.name for path in folder.iterdir()} == {*names, "settings.json"}
    page = (folder / "film.html").read_text()
    assert "<title>PE250x400, 30 rad/s (286.5 rpm): periodic orbit</title>" in page
    with Image.open(folder / "film.gif") as written:
        assert written.n_frames == 3 and written.info["duration"] == 50


def test_a_film_of_a_run_does_not_pass_for_one_of_an_orbit(tmp_path, monkeypatch):
    """Where there is no orbit the command says so, and the title names the turns of the run."""

    def none(scene, **_):
        return missing(scene, 1, RESULTS.chaotic)

    monkeypatch.setattr(film.jc, "periodic_orbit", none)
    status, text = run(*FILMED, "--settle", 1, "--turns", 2, "--out", tmp_path)
    told = "no periodic orbit, so the film is of a run: The motion from rest is chaotic"
    assert status == 0 and text.count(told) == 1
    page = (tmp_path / "film" / "film.html").read_text()
    assert ": run, turns 1 to 3</title>" in page and "orbit" not in page


def test_pictures_of_a_film_are_instants_evenly_over_its_turns():
    scene = jc.ideal_scene(30.0)
    times = film.times_of(scene, 20, 2, 7)
    steps = 30 * times / (2 * np.pi)
    assert (len(times) - 1) % 7 == 0 and len(times) > 2 * film.INSTANTS
    np.testing.assert_allclose(steps[[0, -1]], [20, 22], rtol=1e-14)
    # Rounding of sums of twenty turns, over steps of 1/4000.
    np.testing.assert_allclose(np.diff(steps), 2 / (len(times) - 1), rtol=1e-9)


def test_a_film_shows_what_supports_carry():
    assert film.shown_force(jc.build_scene({"joint": "ideal"})) == "foundation_force"
    values = {"joint": "ideal", "foundation.mass": 6e3}
    assert film.shown_force(jc.build_scene(values)) == "transmitted_force"


@pytest.mark.slow
def test_no_orbit_leaves_no_file(tmp_path):
    bad = ("orbit", "--out", tmp_path, "--name", "none", "--set", "load_law", "none")
    status, text = run(*bad, "--effort", "quick")
    assert status == 1 and "no periodic orbit" in text and "Try a value a thousandth off" in text
    assert not (tmp_path / "none" / "orbit.json").exists()

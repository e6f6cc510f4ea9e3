"""The search over a linkage that is no crusher, by its file."""

import io
import json
import re
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from optimize.ask.options import Options
from optimize.ask.resolve import resolve
from optimize.design_search import design_search
from optimize.search import orbits

EXAMPLES = Path(__file__).parents[2] / "examples"
PUMP = Options(
    scene=EXAMPLES / "pump.toml",
    design=(("joints.B.clearance", "0.02", "0.1mm"), ("speed", "600", "900rpm")),
)


def shaking(speed: float, centre: float = 0.025) -> float:
    """RMS of |sum of m a| of the ideal pump, by Fourier series of where its mass centres are, N.

    `centre` is how far that of the crank is from its axis, towards the rod (m).
    """
    angle = 2 * np.pi * np.arange(4096) / 4096
    crank, rod = 0.05 * np.exp(1j * angle), np.sqrt(0.12**2 - (0.05 * np.sin(angle)) ** 2)
    slider = crank.real + rod
    moment = 0.30 * crank * centre / 0.05 + 0.21 * (crank + slider) / 2 + 0.14 * slider
    orders = np.fft.fftfreq(4096, 1 / 4096)
    force = np.fft.ifft(-((speed * orders) ** 2) * np.fft.fft(moment))
    return float(np.sqrt(np.mean(np.abs(force) ** 2)))


def test_what_is_free_is_named_by_the_file():
    problem = resolve(PUMP)
    assert problem.objective.name == "shaking_rms"
    assert problem.compared_with == "scene file's choice"
    assert problem.reference == pytest.approx({"joints.B.clearance": 5e-5, "speed": 30 * np.pi})
    assert problem.units == {"joints.B.clearance": "mm", "speed": "rpm"} | problem.units
    assert problem.chamber is None and problem.forces == ("shaking_rms",)
    assert problem.rival.outputs == ("B_force_peak",)
    assert np.isnan(problem.capacity(np.zeros((2, 2)))).all()
    assert problem.reaches(problem.capacity(np.zeros((2, 2)))).all()
    assert resolve(replace(PUMP, objective="B_force_peak")).rival.outputs == ("shaking_rms",)


def test_the_gap_of_a_guide_is_free_too():
    """It has no bore that would limit it."""
    free = (("slides.guide.clearance", "0.1", "0.5mm"),)
    problem = resolve(Options(scene=EXAMPLES / "loose_guide.toml", design=free))
    assert problem.reference == pytest.approx({"slides.guide.clearance": 5e-4})
    assert problem.rival.outputs == ("guide_force_peak",)


@pytest.mark.parametrize(
    "given, why",
    [
        ({"design": ()}, "`design` must free a number of a linkage, as in --design joints.B.cle"),
        ({"design": (("balanced",),)}, "`design` must be one of 'balance', 'machine', but is"),
        ({"design": (("jaw.mass", "1", "2kg"),)}, "`jaw.mass` must be a known key, but is not; t"),
        (
            {"design": (("joints.B.clearance", "1", "20mm"),)},
            "`joints.B.clearance` must be smaller",
        ),
        ({"objective": "rms"}, "`objective` must be one of .*shaking_rms"),
        ({"objective": "nowhere:MINE"}, "`objective` must name a module, but nowhere:MINE: No mod"),
        (
            {"objective": "optimize.ask.objectives:plain"},
            "`objective` must name an optimize.ask.objectives",
        ),
        ({"capacity_floor": 3.0}, "`capacity_floor` must not be given with a linkage"),
        ({"slip": "surface"}, "`slip` must not be given with a linkage"),
        ({"limit": (("foundation_rms", "1 kN"),)}, "foundation_rms"),
        ({"overrides": (("bodies.rod.mas", "1 kg"),)}, "bodies.rod.mas"),
    ],
)
def test_refusals_are_one_line(given, why):
    with pytest.raises(ValueError, match=why) as refused:
        resolve(replace(PUMP, **given))
    assert "\n" not in str(refused.value)


OWN = """
from optimize.ask.objectives import Objective

SQUARE = Objective(
    "N2",
    "square of the shaking force's RMS",
    ("shaking_rms",),
    lambda found, scene, chamber: found.shaking_rms**2,
)
"""


def test_a_set_frees_what_balances_a_linkage():
    """Mass centres of bodies with two joints; joints stay where they are, and so the motion."""
    balance = resolve(replace(PUMP, design=(("balance",),)))
    bounds = balance.design.bounds
    assert [*bounds] == [
        f"bodies.{body}.mass_centre.{axis}" for body in ("crank", "rod") for axis in "xy"
    ]
    # The crank may bear counterweights, the rod moves by a tenth of its length.
    assert bounds["bodies.crank.mass_centre.x"] == pytest.approx((-0.025, 0.075))
    assert bounds["bodies.rod.mass_centre.y"] == pytest.approx((-0.012, 0.012))
    assert balance.reference["bodies.rod.mass_centre.y"] == 0.0
    machine = resolve(replace(PUMP, design=(("machine",),)))
    more = {*machine.design.names} - {*bounds}
    assert {"bodies.plunger.mass", "bodies.rod.inertia", "joints.B.restitution"} < more
    assert machine.design.bounds["joints.B.restitution"] == pytest.approx((0.81, 0.99))


@pytest.mark.slow
def test_a_crank_is_balanced_by_an_objective_of_one_s_own(tmp_path, monkeypatch):
    """Against Fourier series of rigid links; the mass centre of the crank alone moves the force."""
    (tmp_path / "own_objective.py").write_text(OWN)
    monkeypatch.syspath_prepend(tmp_path)
    design = (("balance",), ("speed", "600", "900rpm"))
    problem = resolve(replace(PUMP, design=design, objective="own_objective:SQUARE"))
    assert problem.objective.name == "own_objective:SQUARE" and problem.objective.unit == "N2"
    assert re.fullmatch("own_objective:SQUARE [0-9a-f]{16}", problem.settings["objective"])
    made, name = problem.design, "bodies.crank.mass_centre.x"
    start = dict(problem.reference) | {"speed": 20 * np.pi}
    units = np.array([made.unit(start | {name: x}) for x in (0.025, -0.01)])
    rows = orbits.solve(problem, units)
    assert rows["counts"].all()
    for at, x in enumerate((0.025, -0.01)):
        # A quiet pin of 0.05 mm in a throw of 50 mm changes the force by less than a thousandth.
        assert rows["objective"][at] == pytest.approx(shaking(20 * np.pi, x) ** 2, rel=4e-3)
        slope = (shaking(20 * np.pi, x + 1e-6) ** 2 - shaking(20 * np.pi, x - 1e-6) ** 2) / 2e-6
        assert rows["slope"][at, made.names.index(name)] == pytest.approx(slope, rel=1e-2)


@pytest.mark.slow
def test_a_pump_is_searched_with_map_certificate_and_report(tmp_path, monkeypatch):
    # What random starts come to takes a minute, and has tests of its own.
    monkeypatch.setattr(orbits, "coexisting", lambda *_: ())
    monkeypatch.setattr(sys, "argv", ["optimize.run"])  # which the report quotes
    effort = {"cells": (3, 3), "grid": (2, 2), "settle": 4, "turns": 4, "refine": 1, "runs": 2}
    written = io.StringIO()
    options = replace(PUMP, out=tmp_path, name="pump", within=40.0, **effort)
    design_search(options, Console(file=written, width=200))
    result = json.loads((tmp_path / "pump" / "result.json").read_text())
    assert result["status"] == "finished"
    best, other = result["optimum"], result["reference"]
    # What shakes rises with the speed's square.
    assert best["values"]["speed"] == pytest.approx(20 * np.pi, rel=1e-12)
    # The force of rigid links without play is known; a quiet pin that moves by less than 0.1 mm in
    # 50 changes it by less than a thousandth.
    for one, speed in ((best, 20 * np.pi), (other, 30 * np.pi)):
        assert one["ideal_rms"] == pytest.approx(shaking(speed), rel=1e-9)
        assert one["shaking_rms"] == pytest.approx(shaking(speed), rel=1e-3)
        assert one["orbit"]["solution"]["largest_multiplier"] < 1
    slopes = best["orbit"]["slopes"]
    assert slopes["speed"] == pytest.approx(2 * best["objective"] / (20 * np.pi), rel=1e-2)
    assert result["bound"]["within"] < 40 and result["load_sheets"]
    (front,) = result["fronts"]
    assert front["of"] == "B_force_peak"
    text, page = written.getvalue(), (tmp_path / "pump" / "report.html").read_text()
    assert "Run it at 62.83 rad/s (600 rpm, the lowest allowed) with joints B clearance" in text
    for word in ("capacity", "jaw ", "r_o", "crushing", "discharge"):
        assert word not in text.lower() and word not in page.split("<script")[0].lower(), word
    assert (tmp_path / "pump" / "landscape.svg").exists()

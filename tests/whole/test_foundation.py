"""The load sheet of a foundation, from the command line to its files."""

import csv
import logging
import re

import numpy as np
import pytest
from rich.console import Console

import jaxcrusher as jc
from jaxcrusher.commands import foundation
from jaxcrusher.commands.options import Crusher, Foundation, Results
from jaxcrusher.orbits.load_sheet import Row, sheet
from jaxcrusher.orbits.result import RESULTS, missing

BLOCK = (("foundation.mass", "6 t"), ("foundation.x", "0.3 m"), ("joint", "ideal"))


def test_files_of_a_sheet(tmp_path):
    console = Console(record=True, width=100)
    options = Foundation(
        Crusher(overrides=BLOCK),
        orders=2,
        speeds=("200", "400 rpm"),
        points=3,
        results=Results("block", tmp_path),
    )
    assert foundation.run(options, console) == 0
    folder = tmp_path / "block"
    with (folder / "sheet.csv").open() as file:
        rows = list(csv.DictReader(file))
    scene = jc.build_scene({"joint": "ideal", "foundation.mass": 6e3, "foundation.x": 0.3})
    orbit = jc.periodic_orbit(scene)
    found = jc.harmonics(orbit, 2, outputs=("left_force",))
    (row,) = [r for r in rows if (r["name"], r["order"]) == ("left force, vertically", "2.0")]
    expected = found.sel(quantity="left_force_y", order=2)
    assert float(row["value"]) == pytest.approx(float(expected.amplitude), rel=1e-9)
    assert float(row["phase"]) == pytest.approx(float(expected.phase), rel=1e-9)
    weights = [float(r["value"]) for r in rows if r["part"] == "static loads"]
    # Left and right, horizontally and vertically, and a moment: all weight is carried.
    assert weights[1] + weights[3] == pytest.approx(-9.81 * 6641, rel=1e-9)
    (velocity,) = [float(r["value"]) for r in rows if "velocity of G, vert" in r["name"]]
    seen = orbit.motion(2 * np.pi * np.arange(512) / 512, ("frame_velocity",))["frame_velocity"]
    rms = 1e3 * np.sqrt(np.mean(np.asarray(seen)[:, 1] ** 2))
    assert velocity == pytest.approx(rms, rel=1e-6)
    text, html = console.export_text(), (folder / "sheet.html").read_text()
    joints = "Load sheet of a jaw crusher&#39;s foundation: main bearing A is ideal, elbow B is"
    assert joints in html and joints.replace("&#39;", "'") in text.replace("\n", " ")
    for said in ("ISO 10816-3:2009", "left force, vertically", "natural modes"):
        assert said in text and said in html
    # An ideal joint has no clearance.
    assert "clearance" not in html and "undamped natural frequency in red" in html
    assert re.search(r"foundation\.mass 6000 kg|foundation\.mass 6 t", html)
    assert (folder / "run_up.png").stat().st_size > 10_000


def test_a_clamped_page_has_no_critical_speeds():
    orbit = jc.periodic_orbit(jc.ideal_scene(30.0))
    page = foundation.page(orbit, sheet(orbit, 1), [("speed", "30 rad/s")], "")
    assert "all joints ideal" in page and "natural frequency" not in page and "red" not in page
    assert page.count("of shaft, jaw and toggle alone") == 3


def test_no_negative_zero_is_shown():
    row = Row("harmonics", "left force", 1.0, -0.0, "N", -1e-5)
    assert foundation.cells(row) == ("left force", "1", "0", "N", "0.0")


def test_speeds_whose_harmonics_meet_a_natural_frequency_are_marked(monkeypatch, tmp_path):
    kept = []
    monkeypatch.setattr(foundation, "write_figure", lambda path, figure, **_: kept.append(figure))
    scene = jc.build_scene({"joint": "ideal", "foundation.mass": 6e3})
    orbit = jc.periodic_orbit(scene)
    natural = 60 * jc.natural_modes(scene).frequency.values
    # Some meet a natural frequency inside of the run up, and some outside of it at either end.
    speeds = np.linspace(0.75 * natural.min(), 0.75 * natural.max(), 3)
    curves = dict.fromkeys(foundation.CURVES, np.ones(3))
    foundation.draw(orbit, np.pi / 30 * speeds, curves, tmp_path / "run_up.png")
    (ax,) = kept[0].axes
    upright = [line.get_xdata() for line in ax.lines if line.get_transform() != ax.transData]
    critical = [one / order for one in natural for order in (1, 2)]
    expected = [one for one in critical if speeds[0] <= one <= speeds[-1]]
    assert speeds[1] < max(expected) and min(critical) < speeds[0] and speeds[-1] < max(critical)
    found = sorted(float(x[0]) for x in upright)
    assert found == pytest.approx(sorted([*expected, 60 * 30 / (2 * np.pi)]))


def test_a_machine_without_an_orbit_is_shown_the_way_out(tmp_path, monkeypatch):
    """Its steps are told meanwhile, and nothing is written."""
    scene = jc.paper_scene(30.0, 0.06e-3)
    failed = missing(scene, 1, RESULTS.chaotic)

    def search(scene):
        logging.getLogger("jaxcrusher").info("waiting: turns 1 to 240 from rest")
        return failed

    monkeypatch.setattr(jc, "periodic_orbit", search)
    console = Console(record=True, width=100)
    assert foundation.run(Foundation(results=Results("none", tmp_path)), console) == 1
    text = " ".join(console.export_text().split())
    assert "waiting: turns 1 to 240" in text and "is chaotic" in text
    assert "`--set joint ideal` gives the sheet" in text
    assert not (tmp_path / "none" / "sheet.csv").exists()

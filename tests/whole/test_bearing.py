"""What the bearings stand, from the command line to its file."""

import csv
import re
from dataclasses import replace

import numpy as np
import pytest
from rich.console import Console

from jaxcrusher.commands import bearing
from jaxcrusher.commands.options import Bearing, Crusher, Results
from jaxcrusher.files.text import with_error
from jaxcrusher.motion.turns import Turns

KNOCK = (("contact_law", "rollers"), ("load_law", "closing_stroke"), ("load", "300 kN"))


def test_two_clearances_side_by_side(tmp_path):
    console = Console(record=True, width=160)
    options = Bearing(
        Crusher(overrides=(*KNOCK, ("load_edge", "20 deg"))),
        over=(("clearance", "0.06", "0.35 mm", "2"),),
        settle=5,
        turns=10,
        results=Results("knock", tmp_path),
    )
    assert bearing.run(options, console) == 0
    with (tmp_path / "knock" / "bearing.csv").open() as file:
        rows = {(r["design"], r["bearing"]): r for r in csv.DictReader(file)}
    tight, wide = rows["clearance 0.06 mm", "main"], rows["clearance 0.35 mm", "main"]
    assert float(wide["impact_speed [m/s]"]) > float(tight["impact_speed [m/s]"]) > 0
    assert rows["clearance 0.35 mm", "shaft_bearing"]["impacts"] == ""
    lines = console.export_text().splitlines()
    for said, name, unit, factor in (
        ("peak load, kN", "peak_load", "N", 1e-3),
        ("fastest impact, m/s", "impact_speed", "m/s", 1.0),
    ):
        row = next(line for line in lines if line.strip().startswith(said))
        pairs = [(of[f"{name} [{unit}]"], of[f"{name}_scatter [{unit}]"]) for of in (tight, wide)]
        kept = [with_error(*(factor * float(one) for one in pair)) for pair in pairs]
        assert re.findall(r"\S+ ± \S+", row) == kept
    text = " ".join(" ".join(lines).split())
    for said in (
        *("life L10 of one bearing by ISO 281, h", "bearing O", "RMS of the shaking force"),
        *("a play of 120 um in a bore of 120 mm is normal", "a play of 700 um"),
        *("Bearing A, clearance 0.35 mm:", "it loses contact", "Turns: 10 after 5, 10 after 5"),
        *("impacts rest on what is assumed", "load_edge 10 deg", "rollers.damping 20000 N s/m"),
    ):
        assert said in text, said


def test_quiet_bearings_rest_on_nothing_assumed(tmp_path):
    console = Console(record=True, width=160)
    quiet = Crusher(overrides=(("contact_law", "rollers"), ("start", "contact")))
    options = Bearing(quiet, settle=5, turns=10, results=Results("quiet", tmp_path))
    assert bearing.run(options, console) == 0
    text = console.export_text()
    assert "Bearing A: no limit." in text and "assumed" not in text
    with pytest.raises(ValueError, match="`seconds` must be"):
        bearing.run(Bearing(quiet, seconds=0.0), console)


@pytest.fixture
def said(tmp_path, monkeypatch):
    """Return what the command says of crushers whose runs are made up, with contact lost."""

    def made_up(scene, outputs, **_):
        values = {name: np.ones(2) for name, _ in outputs}
        return Turns(scene, 1, values | {"main contact": np.full(2, 0.5)})

    def run(*overrides, over=(), status=0):
        console = Console(record=True, width=200)
        results = Results("made_up", tmp_path)
        options = Bearing(Crusher(overrides=(KNOCK[1], *overrides)), over=over, results=results)
        assert bearing.run(options, console) == status
        return " ".join(console.export_text().split())

    monkeypatch.setattr(bearing, "run_turns", made_up)
    return run


def test_variants_are_half_and_twice_of_the_first_design(said):
    """Not of the scene's number, of which the first design may be the half."""
    text = said(("load_edge", "20 deg"), over=(("load_edge", "10", "20 deg", "2"),))
    # Of steel an impact loses half and twice of 0.1.
    assert "load_edge 10 deg load_edge 5 deg load_edge 20 deg restitution 0.95" in text
    assert "restitution 0.95 restitution 0.8 peak" in text
    text = said(("load_edge", "20 deg"), ("restitution", "0.4"))
    assert "Without restitution -0.2: Argument `restitution` must lie in" in text
    # Nothing is half of no damping, and rollers have no restitution.
    text = said(*KNOCK, ("load_edge", "20 deg"), ("rollers.damping", "0 N s/m"))
    assert "load_edge 10 deg load_edge 40 deg peak" in text and "bearing.csv" in text


def test_a_variant_that_fails_is_told(said, monkeypatch):
    first, runs = bearing.run_turns, []

    def failing(*asked, **how):
        runs.append(first(*asked, **how))
        return replace(runs[-1], failure="it stopped" if len(runs) > 1 else "")

    monkeypatch.setattr(bearing, "run_turns", failing)
    text = said(("load_edge", "20 deg"), status=1)
    assert "FAILED, load_edge 10 deg: it stopped" in text and text.endswith("bearing.csv")


def test_a_design_that_fails_is_told_and_the_others_are_kept(said, monkeypatch, tmp_path):
    first, runs = bearing.run_turns, []

    def failing(*asked, **how):
        runs.append(first(*asked, **how))
        return runs[-1] if len(runs) > 1 else Turns(runs[-1].scene, 1, {}, failure="it stopped")

    monkeypatch.setattr(bearing, "run_turns", failing)
    text = said(over=(("load_edge", "10", "20 deg", "2"),), status=1)
    assert "FAILED, load_edge 10 deg: it stopped" in text and text.endswith("bearing.csv")
    # What rests on assumptions is of the first that is left.
    assert "bearing A, load_edge 20 deg: impacts rest on" in text and "load_edge 40 deg" in text
    (table,) = tmp_path.rglob("bearing.csv")
    assert "load_edge 20 deg" in table.read_text() and "10 deg" not in table.read_text()


def test_what_cannot_be_is_left_out(said):
    text = said(("load_edge", "60 deg"))
    assert "Without load_edge 120 deg: Argument `load_edge` must lie in [0.001, 1.5]" in text
    assert "load_edge 30 deg restitution 0.95" in text and "bearing.csv" in text


def test_designs_are_refused_before_any_runs(monkeypatch, tmp_path):
    monkeypatch.setattr(bearing, "run_turns", lambda *_, **__: pytest.fail("it runs"))
    axis = ("rollers.diameter", "34", "300 mm", "2")
    options = Bearing(Crusher(overrides=KNOCK), over=(axis,), results=Results("none", tmp_path))
    with pytest.raises(ValueError, match=r"`rollers\.diameter` must be smaller"):
        bearing.run(options, Console())


@pytest.mark.parametrize("bore", ["24 mm", "600 mm"])
def test_a_bore_without_classes_has_the_rest_of_the_sheet(said, bore):
    text = said(*KNOCK, ("clearance", "0.1 mm"), ("rollers.bore", bore))
    assert f"a play of 200 um in a bore of {bore} has no class for this bore" in text
    assert "impacts rest on what is assumed" in text and "bearing.csv" in text


@pytest.mark.slow
def test_a_seat_that_wears_is_run_again_with_the_clearance_that_it_has_by_then(tmp_path):
    console, elbow = Console(record=True, width=160), "elbow.clearance"
    seats = Crusher(overrides=(("joint", "ideal"), (elbow, "0.1 mm"), ("elbow.slip", "surface")))
    options = Bearing(
        seats,
        settle=5,
        turns=10,
        joint="elbow",
        wear=("1e-14 m2/N", "400 mm"),
        hours=(1000.0, 4000.0, 1e9),
        results=Results("worn", tmp_path),
    )
    # In the last column a clearance is wider than its bore: what was before is kept.
    assert bearing.run(options, console) == 1
    with (tmp_path / "worn" / "bearing.csv").open() as file:
        rows = [row for row in csv.DictReader(file) if row["bearing"] == "elbow"]
    assert [row["design"] for row in rows] == ["", "1000 h", "4000 h"]
    grown = [float(row["wear [m/h]"]) for row in rows]
    text = " ".join(console.export_text().split())
    assert "growth of the clearance by wear, mm in 1000 h" in text
    # Two digits of the hours after which the clearance has doubled.
    hours = float(re.search(r"0\.1 mm at B doubles in (\S+) h", text)[1])
    assert hours == pytest.approx(1e-4 / grown[0], rel=0.06)
    assert "measure a clearance twice" in text and "FAILED, 1e+09 h: Argument" in text


@pytest.mark.parametrize(
    ("how", "words"),
    [
        ({"hours": (10.0,)}, "`hours` must come with --wear"),
        ({"wear": ("1e-14", "400 mm")}, "`wear` must be"),
        ({"wear": ("1e-14 m2/N", "400 mm"), "hours": (10.0, 5.0)}, "`hours` must increase from 0"),
    ],
)
def test_bad_wear_is_refused(how, words, tmp_path):
    with pytest.raises(ValueError, match=words):
        bearing.run(Bearing(Crusher(), results=Results("none", tmp_path), **how), Console())

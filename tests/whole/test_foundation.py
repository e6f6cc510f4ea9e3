"""The load sheet of a foundation, from the command line to its files."""

import csv
import json
import re

import equinox as eqx
import numpy as np
import pytest
from rich.console import Console

import jaxcrusher as jc
from jaxcrusher.commands import foundation, load_page
from jaxcrusher.commands.machines import read_machine
from jaxcrusher.commands.options import Crusher, Foundation, Results
from jaxcrusher.files.text import number
from jaxcrusher.motion.turns import Turns
from jaxcrusher.sheets.load_sheet import Row, Site, beside, sheet
from tests.identification import by_hand

BLOCK = (("foundation.mass", "6 t"), ("foundation.x", "0.3 m"), ("joint", "ideal"))
CORNER = ("foundation.points.the corner", "1.2 m, -500 mm")


@pytest.mark.slow  # the page and its two soils have cheaper tests
def test_files_of_a_sheet(tmp_path):
    console = Console(record=True, width=100)
    options = Foundation(
        Crusher(overrides=(*BLOCK, CORNER, ("motor_power", "15 kW"))),
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
    orbit = jc.periodic_orbit(foundation.quiet(scene))
    found = jc.harmonics(orbit, 2, outputs=("left_force",))

    def row(name, order, part):
        key = name, order, part
        (found,) = [r for r in rows if (r["name"], r["order"], r["part"]) == key]
        return found

    second = row("force of left support, vertically", "2.0", "harmonics")
    expected = found.sel(quantity="left_force_y", order=2)
    # N and kN.
    assert float(second["value"]) == pytest.approx(1e-3 * float(expected.amplitude), rel=1e-9)
    assert float(second["phase_rad"]) == pytest.approx(float(expected.phase), rel=1e-9)
    weight = row("force of both supports, vertically", "static", "static loads")
    assert float(weight["value"]) == pytest.approx(-9.81e-3 * 6641, rel=1e-9)
    velocity = float(row("velocity of G, vertically", "RMS", "motion")["value"])
    seen = orbit.motion(2 * np.pi * np.arange(512) / 512, ("frame_velocity",))["frame_velocity"]
    assert velocity == pytest.approx(1e3 * np.sqrt(np.mean(np.asarray(seen)[:, 1] ** 2)), rel=1e-6)
    assert row("displacement of the corner, vertically", "1.0", "harmonics of motion")
    text, html = console.export_text(), (folder / "sheet.html").read_text()
    for said in (
        *("Load sheet of a machine's foundation", "main bearing A is ideal, elbow B is ideal"),
        *("overall zone", "supports that pull", "anchor force", "RMS above order 2"),
        *(
            "ISO 10816-3:2009",
            "force of left support, vertically",
            "natural modes",
            "zone A, rigid",
        ),
    ):
        assert said in text.replace("\n", " ") and said in html.replace("&#39;", "'"), said
    # Ideal joints have one column, and inputs are told in words, those left to defaults apart.
    assert "loose" not in html and "natural frequency of a mode" in html
    assert "Its marks are" not in html and "A mode is in resonance with an order" in html
    given, left = html.split("left to defaults")
    assert "<b>6 t</b> foundation mass" in given and "<b>-600 mm</b> foundation base" in left
    assert "from memory" not in html + text and "nobody could look up" in html
    assert "DIN 4024-1" in html and "NIST GCR" not in html  # no soil
    assert all(word in html for word in ("Signature", "Checked by", "counter(pages)"))
    # What excites the block is what a clamped machine exerts, and goes with the speed's square.
    pushed = by_hand.crusher({}, 30.0)["ground_force_y"][1]
    excited = row("exciting force, vertically", "1.0", "harmonics")
    assert float(excited["value"]) == pytest.approx(1e-3 * abs(pushed), rel=1e-9)
    low, middle, high = json.loads((folder / "sheet.json").read_text())["exciting_rms"]
    assert (middle, high) == pytest.approx((2.25 * low, 4 * low), rel=1e-9)
    assert (folder / "run_up.png").stat().st_size > 10_000


def test_a_loose_machine_has_two_columns_and_bounded_time(tmp_path, monkeypatch):
    """Where it has no periodic orbit too: closing loads throw the pin about."""
    console = Console(record=True, width=100)
    drawn = []
    monkeypatch.setattr(foundation, "write_figure", lambda path, figure, **_: drawn.append(figure))
    monkeypatch.setattr(foundation.Path, "read_bytes", lambda _: b"")
    html = tmp_path / "loose" / "sheet.html"
    options = Foundation(
        Crusher(overrides=(("load_law", "closing_stroke"), ("load_edge", "20 deg"))),
        orders=1,
        points=2,
        settle=5,
        turns=10,
        results=Results("loose", tmp_path),
    )
    assert foundation.run(options, console) == 0
    text = " ".join(console.export_text().split())
    # Progress, and what the columns are.
    assert "turn 1 to 5, settling" in text and "10 turns after 5; loose ± standard" in text
    with (tmp_path / "loose" / "sheet.csv").open() as file:
        rows = {(r["name"], r["order"]): r for r in csv.DictReader(file)}
    peak = rows["exciting force, vertically", "greatest"]
    assert float(peak["value"]) > float(peak["ideal"]) and float(peak["scatter"]) > 0
    fast = rows["exciting force, vertically", "power above order 1"]
    assert float(fast["value"]) > 20 > float(fast["ideal"]) and fast["unit"] == "%"
    # Half and twice of the edge, and of what an impact loses.
    over = "load_edge 10 deg, load_edge 40 deg, restitution 0.95, restitution 0.8"
    assert f"in brackets is the range over {over}" in text
    assert "no number of either" in foundation.ranges([])
    assert "knocks: the frame is clamped" in text
    up = rows["force, vertically", "equivalent, + 3 times what moves"]
    low, high = float(up["lowest"]), float(up["highest"])
    assert low <= float(up["value"]) <= high and high - low > 1e-3 * high
    assert f"({number(low)} to {number(high)})" in html.read_text()
    assert "Its marks are" in html.read_text()
    # The loose joints stand in the picture at the running speed, with the scatter of their turns.
    about = json.loads((tmp_path / "loose" / "sheet.json").read_text())
    turns = 1e-3 * np.array(about["loose_exciting_rms"])
    (bars,) = [one for one in drawn[0].axes[0].containers if "loose" in one.get_label()]
    ((x, y),) = bars.lines[0].get_xydata()
    assert (x, y) == pytest.approx((30 * 30 / np.pi, turns.mean()))
    (ends,) = bars.lines[2][0].get_segments()
    assert np.ptp(ends[:, 1]) == pytest.approx(2 * turns.std(ddof=1)) and len(turns) == 10


def test_a_run_that_fails_leaves_ideal_joints(tmp_path, monkeypatch):
    failed = Turns(jc.paper_scene(30.0, 0.06e-3), 1, {}, failure="stopped at 3 rad of phase")
    monkeypatch.setattr(foundation, "run_turns", lambda *_, **__: failed)
    console = Console(record=True, width=100)
    options = Foundation(orders=1, points=2, results=Results("none", tmp_path))
    assert foundation.run(options, console) == 1
    assert "the run failed: stopped at 3 rad" in " ".join(console.export_text().split())
    assert "exciting force" in (tmp_path / "none" / "sheet.csv").read_text()


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"resonance": (1.3, 0.7)}, "`resonance` must be two numbers, 0 < LOW < HIGH"),
        ({"dynamic_factor": 0.5}, "`dynamic_factor` must be >= 1"),
        ({"run_up": "10 m"}, "`run_up` must have a unit of the kind s"),
        ({"orders": 512}, "`orders` must be less than 512, but is 512"),
        ({"seconds": 0.0}, "`seconds` must be"),
    ],
)
def test_bad_options(tmp_path, given, words):
    with pytest.raises(ValueError, match=re.escape(words)):
        foundation.run(Foundation(results=Results("bad", tmp_path), **given), Console())


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ((), "load_law along_jaw, load 8800 N"),
        ((("load_law", "none"),), "load_law none"),
        (
            (("load_law", "by_angle"), ("load_curve", "examples/double_toggle_load.csv")),
            "load_law by_angle, load_curve examples/double_toggle_load.csv, load_factor 1",
        ),
    ],
)
def test_the_heading_has_the_load_that_there_is(given, told):
    crusher = Crusher(overrides=(("joint", "ideal"), *given))
    assert foundation.heading(read_machine(crusher), crusher, None)["loads"] == told


def test_a_clamped_page_has_no_critical_speeds():
    machine = read_machine(Crusher(overrides=(("joint", "ideal"),)))
    rows = sheet(jc.periodic_orbit(machine.scene()), 1, Site(frame_mass=1500.0))
    page = load_page.page(machine, rows, {"machine": 'a "machine"'}, {"sketch": "", "run_up": ""})
    assert "all joints ideal" in page and "natural frequency" not in page and "in red" not in page
    assert page.count("with the frame of 1500 kg") == 2 and page.count("without the frame") == 2
    # A name cannot end the style sheet's text.
    assert "a \\22 machine\\22 " in page


def test_numbers_of_a_page():
    """No negative zero, ideal joints apart from loose ones, and a scatter that can be seen."""

    def shown(value, **given):
        return tuple(load_page.amount(Row("part", "force", 1.0, value, "kN", **given), abs(value)))

    assert shown(-0.0, phase_rad=-1e-5) == ("", "0", "")
    assert shown(1.0, phase_rad=np.pi / 2, ideal=1.00001) == ("1", "1", "90°")
    assert shown(1.0, ideal=2.0, scatter=0.0123) == ("2", "1.000 ± 0.012", "")
    assert shown(1.0, scatter=1e-6) == ("", "1", "")
    assert shown(3.0, lowest=1.5, highest=4.25, ideal=1.0) == ("1", "3\n(1.5 to 4.25)", "")


def test_a_table_has_its_quantities_in_lines_and_a_spectrum_its_orders():
    """Ideal and loose are columns; of a share nothing is seen below a twentieth of a percent."""
    rows = [
        Row("part", name, order, value, unit, scatter=0.02 * value, ideal=value / 2)
        for name, share in (("much", 88.125), ("little", 0.04))
        for order, value, unit in (("RMS", 2.0, "kN"), ("fast", share, "%"))
    ]
    grid = load_page.by_name("title", rows, remarks=False)
    assert grid.spans == [("", 2), ("RMS", 2), ("fast, %", 2)]
    assert grid.headings == ["", "unit", "ideal", "loose", "ideal", "loose"]
    assert [line[1:] for line in grid.lines] == [
        ("kN", "1", "2.000 ± 0.040", "44.06", "88.1 ± 1.8"),
        ("kN", "1", "2.000 ± 0.040", "0", "0"),
    ]
    orders = (1.0, 2.0, "RMS above order 2")
    rows = [Row("harmonics", n, order, 3.0, "kN", 0.0, ideal=2.0) for n in "ab" for order in orders]
    (grid,) = load_page.spectra("title", rows, lambda name: True)
    assert grid.spans == [("", 1), ("a, kN", 3), ("b, kN", 3)]
    assert grid.headings == ["", *("ideal", "loose", "phase") * 2]
    assert [line[0] for line in grid.lines] == ["order 1", "order 2", "RMS above order 2"]
    assert grid.lines[0] == ("order 1", "2", "3", "0°", "2", "3", "0°")


def test_a_small_machine_has_numbers_too():
    """A damper of 400 N s/m, and beside a large force one of 0.3 N, which says nothing there."""
    rows = [
        Row("part", name, "", value, unit)
        for name, value, unit in (
            *(("damper", 4e-4, "MN s/m"), ("large", 20.0, "kN"), ("small", 3e-4, "kN")),
            ("rounding", 1e-16, "kN m"),
        )
    ]
    (grid,) = load_page.listed(rows)
    lines = {line[0]: line[3] for line in grid.lines}
    assert lines == {"damper": "0.0004", "large": "20", "small": "0", "rounding": "0"}


@pytest.mark.parametrize("key", ["shear_modulus", "shear_wave_speed"])
def test_other_soil_has_other_springs(key):
    """Half the modulus is that of a wave speed lower by the root of two."""
    value, power = {"shear_modulus": ("60 MPa", 1.0), "shear_wave_speed": ("180 m/s", 0.5)}[key]
    name = f"foundation.soil.{key}"
    machine = read_machine(Crusher(overrides=(*BLOCK, (name, value))))
    soft = foundation.soil_times(machine, 0.5)
    expected = machine.scene(**{name: machine.values[name] * 0.5**power})
    assert eqx.tree_equal(soft, expected)
    assert machine.scene().supports.vertical_stiffness > 1.9 * soft.supports.vertical_stiffness
    assert load_page.has_soil(machine.values) and not load_page.has_soil({"speed": 30.0})


def test_other_soil_stands_in_columns():
    def rows(size):
        return [
            Row("verdicts", "overall zone", "", size, "um", remark=f"zone {size:g}, rigid; more"),
            Row("verdicts", "resonances", "", size, "1"),
            Row("natural modes", "undamped frequency of mode 1", "", size, "Hz"),
            Row("uplift", "left support", "anchor force", 10 * size, "kN"),
        ]

    grid = load_page.soils({"own": rows(2.0), "half": rows(1.0)})
    assert grid is not None and grid.headings == ["", "unit", "own", "half"]
    assert grid.lines == [
        ("undamped frequency of mode 1", "Hz", "2", "1"),
        ("left support, anchor force", "kN", "20", "10"),
        ("overall zone", "", "zone 2", "zone 1"),
        ("resonances", "", "2", "1"),
    ]
    (row,) = beside(rows(2.0)[3:], ideal=rows(2.0), softer=rows(1.0))
    assert (row.ideal, row.softer, row.stiffer) == (20.0, 10.0, "")


@pytest.mark.parametrize("damping", [2e4, 2e6])
def test_speeds_whose_harmonics_meet_a_natural_frequency_are_marked(damping, monkeypatch, tmp_path):
    """Of modes that amplify what they meet, which dampers of a ratio of 0.95 and more do not."""
    kept = []
    monkeypatch.setattr(foundation, "write_figure", lambda path, figure, **_: kept.append(figure))
    dampers = {f"foundation.{axis}_damping": damping for axis in ("horizontal", "vertical")}
    scene = jc.build_scene({"joint": "ideal", "foundation.mass": 6e3} | dampers)
    modes = jc.natural_modes(scene)
    assert (modes.damping_ratio < 1 / 3).all() == (damping == 2e4)
    natural = 60 * modes.frequency.values
    # Some meet a natural frequency inside of the run up, and some outside of it at either end.
    speeds = np.linspace(0.75 * natural.min(), 0.75 * natural.max(), 3)
    curves = dict.fromkeys(foundation.CURVES, np.ones(3))
    foundation.draw(scene, np.pi / 30 * speeds, curves, {}, tmp_path / "run_up.png")
    (ax,) = kept[0].axes
    upright = [line.get_xdata() for line in ax.lines if line.get_transform() != ax.transData]
    critical = [one / order for one in natural for order in (1, 2)]
    expected = [one for one in critical if speeds[0] <= one <= speeds[-1]]
    assert speeds[1] < max(expected) and min(critical) < speeds[0] and speeds[-1] < max(critical)
    found = sorted(float(x[0]) for x in upright)
    expected = expected if damping == 2e4 else []
    assert found == pytest.approx(sorted([*expected, 60 * 30 / (2 * np.pi)]))

"""The report's page: self-contained, escaped, honest about gaps, and alive in a browser."""

import base64
import json
import re
import shutil
from dataclasses import replace
from itertools import product
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import jax.numpy as jnp
import numpy as np
import pytest
import xarray as xr

import jaxcrusher as jc
from jaxcrusher.basics.plane import Vector
from jaxcrusher.crusher.capacity import CrushingChamber
from jaxcrusher.joint.validity import Validity
from jaxcrusher.mechanism.starts import shifted_start
from jaxcrusher.sheets.load_sheet import Row
from optimize.answer import (
    Active,
    Answer,
    Bound,
    Box,
    Check,
    Coexisting,
    Confirmed,
    Crushing,
    Decay,
    Front,
    Refinement,
    Runs,
    Sought,
)
from optimize.ask.design import Design
from optimize.ask.objectives import OBJECTIVES
from optimize.ask.problem import Problem
from optimize.search import stages
from optimize.search.evaluate import STARTS, Tracking
from optimize.search.motions import cell_motions
from optimize.tell import figures, tables
from optimize.tell import words as formatting
from optimize.tell.page import data as page_data
from optimize.tell.page.document import write_page
from optimize.tell.result_file import content
from tests.optimize.by_hand import orbit_by_hand, printed, solution_by_hand

SPEEDS, CLEARANCES = [25.0, 30.0, 35.0], [3e-5, 6e-5]
EVIL = '</script><img src="http://example.org/x.png">&'

LONG = "standard error of the RMS, from the scatter of ten batches of turns of the shaft"


def hand_made_landscape() -> xr.Dataset:
    """Cell (1, 0) whirls from the centred start, cell (2, 1) failed from it."""
    dims, shape = ("start", "speed", "clearance"), (2, 3, 2)
    rms = 18000.0 + 100 * np.arange(12).reshape(shape)
    whirl, success = np.zeros(shape, bool), np.ones(shape, bool)
    whirl[0, 1, 0], rms[0, 1, 0] = True, 5.6e6
    success[0, 2, 1], rms[0, 2, 1] = False, np.nan
    variables = {
        "foundation_rms": (rms, "N", "RMS of |R_O| + |R_C|"),
        "shaking_rms": (rms / 4, "N", "RMS of the shaking force"),
        "foundation_rms_error": (np.where(success, 12.3, np.nan), "N", LONG),
        "whirl": (whirl, "1", "friction whirl"),
        "success": (success, "1", "integrated to the end"),
        "inside_model": (~whirl & success, "1", EVIL),
        "objective": (rms, "N", "RMS of |R_O| + |R_C|"),
        "counts": (~whirl & success, "1", "may be chosen"),
    }
    return xr.Dataset(
        {
            name: (dims, values, {"units": unit, "long_name": meaning})
            for name, (values, unit, meaning) in variables.items()
        },
        {
            "start": ["centred", "contact"],
            "speed": ("speed", SPEEDS, {"long_name": "driving speed"}),
            "clearance": ("clearance", CLEARANCES, {"long_name": "clearance"}),
        },
    )


def hand_made_motions(cells=(3, 2), samples=64) -> xr.Dataset:
    """Circles: of half a clearance from the centred start, of a whole one from contact."""
    turn = np.arange(2 * samples + 1) / samples
    angle, shape = 2 * np.pi * turn, (2, *cells, turn.size)
    radius = np.array([0.5, 1.0]).reshape(2, 1, 1, 1)
    dims = ("start", "speed", "clearance", "instant")
    force = np.broadcast_to(2e4 + 1e3 * np.sin(angle), shape).copy()
    if cells == (3, 2):
        force[0, 2, 1] = np.nan
    return xr.Dataset(
        {
            "eccentricity_x": (dims, np.broadcast_to(radius * np.cos(angle), shape)),
            "eccentricity_y": (dims, np.broadcast_to(radius * np.sin(angle), shape)),
            "force": (dims, force),
            "ideal_force": (dims[1:], np.full((*cells, turn.size), 2e4)),
        },
        {
            "start": ["centred", "contact"],
            "speed": np.linspace(25, 35, cells[0]),
            "clearance": np.linspace(3e-5, 6e-5, cells[1]),
            "turn": ("instant", turn),
        },
    )


BEGUN = Answer(
    command=f"python -m optimize.run --name '{EVIL}'",
    versions={"jax": "0.10.2"},
    objective=Sought("rms", "N", "RMS of |R_O| + |R_C|"),
    box=Box({"speed": (25.0, 35.0), "clearance": (3e-5, 6e-5)}, 5.6, (14.4, 41.7)),
    fixed={"friction": 0.05},
    columns={
        "objective": ("N", "RMS of |R_O| + |R_C|"),
        "foundation_rms": ("N", "RMS of |R_O| + |R_C|"),
        "whirl": ("1", "friction whirl"),
        "success": ("1", "solved, or integrated to the end"),
    },
    seed=0,
)


def hand_made_runs(mean: float, success: bool = True) -> Runs:
    """Six that do not settle, the first 7 N above the mean, too wide for Hertz; one may fail."""
    objective = mean + np.array([7.0, -7.0, 1.0, -1.0, 2.0, np.nan])
    objective[5] = mean - 2.0 if success else np.nan
    validity = Validity(*map(jnp.asarray, (1.8, 0.1, 0.9, 0.9, 0.001)))
    return Runs(
        mean,
        7.2,
        validity,
        np.zeros(4),
        {
            "objective": objective,
            "foundation_rms": objective,
            "whirl": np.zeros(6, bool),
            "success": np.isfinite(objective),
        },
        False,
    )


def hand_made_answer(free: tuple[str, ...] = ("speed", "clearance")) -> Answer:
    """Of a speed, clearance and friction, as far as they are `free`."""

    def chosen(speed, clearance):
        values = {"speed": speed, "clearance": clearance, "friction": 0.05}
        return {name: values[name] for name in free}

    optimum = Confirmed(
        chosen(25.0, 6e-5),
        *(18250.1, 7.2, "centred"),
        *(25.0, {"foundation_rms": 18243.2, "shaking_rms": 3135.0}, 18240.0),
        Crushing(6e-5, 9.41, 0.0201, 1.2),
        None,
        {"centred": hand_made_runs(18250.1), "contact": hand_made_runs(9250.1)},
    )
    other = Confirmed(
        chosen(39.0, 3e-5),
        *(np.nan, np.nan, "contact"),
        *(39.0, {"foundation_rms": np.nan, "shaking_rms": np.nan}, 21790.0),
        Crushing(3e-5, 6.03, 0.0201, 1.2),
        None,
        {"centred": hand_made_runs(21832.0), "contact": hand_made_runs(21799.0, success=False)},
    )
    bounds = {"speed": (25.0, 35.0), "clearance": (3e-5, 6e-5), "friction": (0.0, 0.1)}
    ends = {"speed": [30.0, 25.0], "clearance": [3e-5, 6e-5], "friction": [0.0, 0.1]}
    path = {name: np.array(ends[name]) for name in free}
    return replace(
        BEGUN,
        box=replace(BEGUN.box, bounds={name: bounds[name] for name in free}),
        status="finished",
        seconds={"landscape": 12.5},
        steps={"landscape": 15400000},
        refinement=(Refinement("fits", path, 19000.0, 18250.0, 24, {}),),
        candidates=(optimum, replace(other, objective=np.nan)),
        optimum=optimum,
        reference=other,
        bound=Bound(None, None, 0, 0.0, "Nothing is said of what lies between."),
        checks=(Check("inside the box", True, EVIL), Check("both starts agree", False, "")),
        remark="Wear is not counted.",
    )


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    folder = tmp_path_factory.mktemp("page")
    (folder / "landscape.png").write_bytes(b"not looked at")
    found, figures = hand_made_answer(), ["landscape.png"]
    return write_page(folder, found, hand_made_landscape(), hand_made_motions(), figures)


def test_stages_have_one_order_whichever_ended_first():
    ended = {"motions": 3.0, "orbits": 7.0, "landscape": 2.0, "fronts": 0.5}
    rows = tables.stages(replace(BEGUN, seconds=ended, steps={"motions": 9})).rows
    assert rows == [
        ("map of periodic orbits", "7.0", ""),
        ("both starts over the box", "2.0", ""),
        ("motions of the cells", "3.0", 9),
        ("fronts", "0.5", ""),
    ]
    # Every stage of the search has its place.
    source = Path(stages.__file__).read_text()
    assert set(re.findall(r'work\.stage\("([^"]+)"', source)) == set(tables.STAGES)


def data_of(text: str) -> dict:
    """The page's data, as strict JSON."""
    (found,) = re.findall(r'<script type="application/json" id="data">(.*?)</script>', text, re.S)

    def refuse(name):
        raise ValueError(f"{name} is not JSON")

    return json.loads(found, parse_constant=refuse)["landscape"]


def unpacked(packed: dict, length: int) -> np.ndarray:
    """16-bit whole numbers times the scale of their row."""
    whole = np.frombuffer(base64.b64decode(packed["values"]), "<i2").reshape(-1, length)
    scale = np.frombuffer(base64.b64decode(packed["scale"]), "<f4")
    return np.where(whole == -32768, np.nan, whole * scale[:, None].astype(float))


def test_page_fetches_nothing(page):
    text = page.read_text()
    outside = re.sub(r"<script.*?</script>", "", text, flags=re.S)
    fetched = re.findall(r"<[^>]*?\s(?:src|href|action|data|poster)\s*=\s*\"([^\"]*)", outside)
    assert fetched and all(address.startswith("data:image/png;base64,") for address in fetched)
    assert "url(" not in outside.split("</style>")[0] and "@import" not in text
    assert not re.search(r"fetch\(|XMLHttpRequest|WebSocket|import\(|<link|<iframe", text)
    assert "default-src &#39;none&#39;" in text


def test_every_text_is_escaped(page):
    text = page.read_text()
    assert EVIL not in text
    # One element of data and one of code: no text opened or closed another.
    assert text.count("<script") == text.count("</script>") == 2
    assert text.count("&lt;/script&gt;&lt;img src=&#34;http:") == 3
    (inside,) = (v for v in data_of(text)["variables"] if v["name"] == "inside_model")
    assert inside["label"] == EVIL


def test_page_shows_what_it_knows_and_what_it_does_not(page):
    text = page.read_text()
    assert "18250 ± 7.2" in text and "9250 ± 7.2" in text and "1 of 2 failed." in text
    assert "half a 95 % interval, from 6 independent runs" in text
    # One of six runs failed: there is no number to show, and no design to choose.
    assert ">1 of 6 failed</td>" in text and ' class="number">no value</td>' in text
    assert "21806, 21792, 21800, 21798, 21801, no value" in text
    assert cells(text, "optimum, centred start")[0].startswith("no orbit; ")
    assert cells(text, "optimum, contact start")[0].startswith("no orbit; ")
    assert "contact of half-width 1.80 radii: not Hertzian" in text
    # Units that differ from those of result.json.
    assert cells(text, "clearance, mm") == ["0.03", "0.06"]
    # Words in place of keys: of variables, stages, ways of descent.
    for key in ("foundation_rms", "success", "whirl", "fits", "landscape"):
        assert f">{key}<" not in text, key
    assert "fits to noisy runs" in text and "both starts over the box" in text
    # The answer begins with its sentence, then the picture, then the table.
    found = text.split("<h2>The answer</h2>")[1]
    order = [found.index(part) for part in ("Not confirmed", "<img", "<table")]
    assert order == sorted(order)


def test_capacity_in_tonnes_stands_beside_that_in_cubic_metres(tmp_path):
    """9.41 m3/h of 1.6 t/m3 are 15.06 t/h, on the page, on the screen and in result.json."""
    found = replace(hand_made_answer(), bulk_density=1600.0)
    text = write_page(tmp_path, found, None, None, ()).read_text()
    assert 'data-label="capacity, t/h" class="number">15.06</td>' in text
    assert re.search(r"capacity, t/h +15\.06 +9\.65 *\n", printed(found, 120))
    tonnes = {"optimum": pytest.approx(15.056), "paper's choice": pytest.approx(9.648)}
    assert content(found)["throughput"] == tonnes
    plain = replace(found, bulk_density=None)
    assert "t/h" not in write_page(tmp_path, plain, None, None, ()).read_text()
    assert content(plain)["throughput"] == {}


def test_strokes_stand_beside_the_capacity_with_a_caution(tmp_path):
    """20.1 mm in all, 1.2 mm up for each across."""
    found = hand_made_answer()
    text = write_page(tmp_path, found, None, None, ()).read_text()
    assert 'data-label="stroke at the discharge, mm" class="number">20.1</td>' in text
    assert text.count("slower is always more there") == 1
    said = printed(found, 120)
    assert re.search(r"stroke, vertical over horizontal +1\.2 +1\.2 *\n", said)
    assert "slower is always more there" in said


def test_numbers_that_follow_stand_beside_the_free_ones():
    """On the page a row is a design, on the screen a column."""
    found, follows = hand_made_answer(), {"shaft.eccentricity": 6.7e-3, "counterweight.mass": 11.0}
    other = replace(found.reference, follows=follows | {"counterweight.mass": 0.0})
    found = replace(found, optimum=replace(found.optimum, follows=follows), reference=other)
    table = tables.answer(found)
    assert table.headings[2:5] == (
        "clearance, mm",
        "shaft eccentricity that follows, mm",
        "counterweight mass that follows, kg",
    )
    assert table.rows[0][2:5] == ("0.06", "6.7", "11") and table.rows[1][4] == "0"
    turned = table.turned
    assert turned.headings == ("", "optimum", "paper's choice")
    assert turned.rows[3] == ("counterweight mass that follows, kg", "11", "0")
    # None of them is one that nobody gave.
    assert "shaft eccentricity" not in dict(row[:2] for row in tables.fixed(found).rows)


def test_the_two_bearings_are_drawn_once(tmp_path, monkeypatch):
    """Below the answer's table: O and C where the machine has them, with the frame's forces."""
    drawn, write = [], figures.write_figure

    def kept(path, fig):
        (ax,) = fig.axes
        drawn.append({text.get_text(): text for text in ax.texts})
        write(path, fig)

    monkeypatch.setattr(figures, "write_figure", kept)
    found = hand_made_answer()
    # A load across the jaw presses on both, so that both forces are long enough for a name.
    design = Design(found.box.bounds, jc.paper_machine(load_law="normal_to_jaw"))
    case: Any = SimpleNamespace(design=design)
    figures.draw_bearings(tmp_path, case, found.optimum)
    (names,) = drawn
    bearing = jc.build_scene({}).linkage.joints.at("shaft_bearing").bore.arm.vector()
    np.testing.assert_allclose(names["O"].xy, [float(bearing.x), float(bearing.y)], rtol=1e-12)
    np.testing.assert_array_equal(names["C"].xy, [0.0, 0.0])
    assert names["$R_O$"].get_visible() and names["$R_C$"].get_visible()
    text = write_page(tmp_path, found, None, None, ["bearings.png"]).read_text()
    assert text.count("<img") == 1 and "The two bearings of |R_O| + |R_C|" in text
    after = text.split("<h2>The answer</h2>")[1]
    # What comes before it is one sheet of A4.
    assert after.index("What the search leaves out") < after.index("<img") < after.index("<section")


def test_an_objective_of_orbits_only_has_no_value_in_runs():
    """The RMS expected under a rough feed is no time average."""
    runs = replace(hand_made_runs(1.0), objective_mean=np.nan, objective_half_width=np.nan)
    assert formatting.interval(runs) == "no value"


def cells(text: str, row: str) -> list[str]:
    """Of the row of a table that is named `row`."""
    (found,) = re.findall(rf'scope="row">{re.escape(row)}</th>(.*?)</tr>', text)
    return re.findall(r"<td[^>]*>([^<]*)</td>", found)


def test_page_of_a_periodic_orbit(tmp_path):
    """The answer in a sentence, slopes and multipliers in the reader's units."""
    validity = Validity(*map(jnp.asarray, (0.3, 0.1, 0.9, 0.9, 0.001)))
    slopes = {"speed": 220.0, "clearance": 51000.0}, {"speed": 0.1, "clearance": 40.0}
    # A disturbance falls to 1/e in 5000 turns.
    orbit = orbit_by_hand(np.exp(-1 / 5000), 18243.4112, *slopes, foundation_rms=18243.4112)
    found = hand_made_answer()
    runs = {
        name: replace(one, settles=True, validity=validity)
        for name, one in found.optimum.transient.items()
    }
    optimum = replace(found.optimum, orbit=orbit, transient=runs)
    active = (Active("clearance", "lowest", 51000.0),)
    other = replace(found.reference, objective=21796.4)
    found = replace(found, optimum=optimum, reference=other, active=active)
    values = {"speed": np.array([25.0, 25.0]), "clearance": np.array([0.03e-3, 0.05e-3])}
    ends, forces = np.array([18243.4, 18300.0]), {"shaking_rms": np.array([3135.0, np.nan])}
    front = Front("capacity", "m3/h", "capacity", ends, np.array([7.5, 7.9]), values, forces)
    single = Front(
        "foundation_peak",
        "N",
        "peak of |R_O| + |R_C|",
        np.array([18243.4]),
        np.array([24e3]),
        values,
        forces,
    )
    found = replace(found, fronts=(front, single), checks=found.checks[:1])
    text = write_page(tmp_path, found, None, None, ()).read_text()
    # Numbers that no file gave are marked.
    assert cells(text, "jaw mass") == ["524 kg *"]
    # A single point trades nothing.
    assert "against capacity" in text and "against foundation peak" not in text
    assert cells(text, "7.5") == ["18243", "3135", "25", "0.03"]
    assert cells(text, "7.9") == ["18300", "no value", "25", "0.05"]
    assert (
        "Run it at 25 rad/s (239 rpm, the lowest allowed) with 0.06 mm of radial clearance "
        "(the lowest allowed), if wear and rock that waits for the jaw, which are not counted, "
        "allow it: RMS" in text
    )
    assert "16.3 % less than 21.8 kN at the paper&#39;s choice" in text
    assert "18243.41</td>" in text
    assert "clearance is at its lowest value, multiplier 51 N per mm" in text
    assert cells(text, "clearance, N per mm") == ["51", "0.04"]
    # In the units that they were given in.
    given = replace(found, box=replace(found.box, units={"speed": "rpm", "clearance": "um"}))
    rpm = write_page(tmp_path, given, None, None, ()).read_text()
    assert "is at its lowest value, multiplier 0.051 N per um" in rpm
    assert cells(rpm, "clearance, N per um") == ["0.051", "4e-05"]
    assert cells(rpm, "speed, N per rpm")[0] == "23.04"
    assert cells(rpm, "speed, rpm") == ["238.732", "334.225"] and "60</td>" in rpm
    assert cells(text, "optimum, centred start")[0] == "towards the orbit, in contact"
    assert ">5000</td>" in text


def test_page_of_a_decaying_oscillation(tmp_path):
    """A start on its way to the orbit, by 0.02 % a turn, and one that is there."""
    found, orbit = hand_made_answer(), orbit_by_hand(1 - 2e-4, 18243.4)
    decays = {"centred": Decay(0.1, 0.05, 3e-4, 1e-5, 1e-6), "contact": Decay(*[1e-5] * 5)}
    runs = {
        name: replace(one, settles=True, decay=decays[name])
        for name, one in found.optimum.transient.items()
    }
    loud = Coexisting(0.2, solution_by_hand(period=2), 2e4)
    optimum = replace(found.optimum, orbit=orbit, transient=runs, coexisting=(loud,))
    text = write_page(tmp_path, replace(found, optimum=optimum), None, None, ()).read_text()
    # ln(0.05 / 0.001) over 2e-4, the fall of the logarithm in a turn, turns.
    row = ["towards the orbit, in contact", "0.05", "0.03", "0.002", "0.02", "20000"]
    assert cells(text, "optimum, centred start") == row
    row = ["on the orbit, in contact", "below 0.0001", "", "", "0.02", "0"]
    assert cells(text, "optimum, contact start") == row
    (row,) = re.findall(r">20%</td>(.*?)</tr>", text)
    assert re.findall(r">([^<]+)</td>", row) == ["2", "20000"]


def test_turns_until_an_oscillation_is_gone():
    """ln 50 / ln 2 turns where half is left each; nothing where it cannot be seen that small."""
    found, orbit = hand_made_answer(), orbit_by_hand(0.5, 18243.4)
    decays = {"centred": Decay(0.1, 0.05, 0.5, 1e-5, 1e-6), "contact": Decay(*[5e-3] * 4, 1e-3)}
    runs = {
        name: replace(one, settles=True, decay=decays[name])
        for name, one in found.optimum.transient.items()
    }
    optimum = replace(found.optimum, orbit=orbit, transient=runs)
    one, two, *_ = tables.motions(replace(found, optimum=optimum)).rows
    assert one[-1] == "6" and two[2:] == ("below 0.01", "", "", "50", "")


def test_the_limits_told_are_those_of_the_tightest_joint():
    """Of a linkage that has no main joint, and of a pivot beside one."""
    found = hand_made_answer()
    none = Validity(*map(jnp.asarray, (0.0, 0.0)), clearance_ratio=jnp.asarray(0.0))
    pivot = Validity(*map(jnp.asarray, (0.3, 0.1, 0.9, 0.9, 0.001)))
    both = replace(none, others={"pivot": pivot})
    runs = {n: replace(one, validity=both) for n, one in found.optimum.transient.items()}
    text = formatting.limits(replace(found.optimum, transient=runs))
    assert "half-width 0.30 radii, approach 0.10 of the elastic limit" in text


def test_only_a_mean_is_called_the_mean_of_long_runs():
    """The objective may be of the worse start's orbit, or of one that random starts come to."""
    found = hand_made_answer()
    runs = found.optimum.transient
    settled = runs | {"centred": replace(runs["centred"], settles=True)}
    loud = Coexisting(0.2, solution_by_hand(), 18250.1)
    for changed in ({"transient": settled}, {"coexisting": (loud,)}):
        text = formatting.answer(replace(found, optimum=replace(found.optimum, **changed)))
        assert "18.25 kN" in text and "mean of long runs" not in text
    other = replace(loud, objective=18000.0)
    text = formatting.answer(replace(found, optimum=replace(found.optimum, coexisting=(other,))))
    assert "18.25 kN as the mean of long runs" in text


def test_the_first_sentence_recommends_only_what_nothing_speaks_against():
    found = hand_made_answer()
    failed = "Not confirmed; outside the contact model: the best is 25 rad/s (239 rpm, the lowest"
    text = formatting.answer(found)
    assert text.startswith(failed) and "18.25 kN as the mean of long runs" in text
    assert "because the check failed: “both starts agree”" in text
    assert "because of centred start, contact of half-width 1.80 radii: not Hertzian" in text
    passed = replace(found, checks=found.checks[:1])
    assert formatting.answer(passed).startswith("Outside the contact model: the best is 25 rad/s")
    validity = Validity(*map(jnp.asarray, (0.3, 0.1, 0.9, 0.9, 0.001)))
    runs = {n: replace(one, validity=validity) for n, one in found.optimum.transient.items()}
    inside = replace(passed, optimum=replace(found.optimum, transient=runs))
    assert formatting.answer(inside).startswith(
        "Run it at 25 rad/s (239 rpm, the lowest allowed) with"
    )
    # Of a box without an orbit, and of a search that did not come to its checks.
    assert formatting.answer(replace(inside, stable_orbits=0)).startswith(
        "The map of the box found no stable orbit of one turn: the best is 25 rad/s"
    )
    assert formatting.answer(replace(inside, stable_orbits=3)).startswith("Run it at")
    unchecked = formatting.answer(replace(inside, checks=()))
    assert unchecked.startswith("Not confirmed: ") and "ended before its checks" in unchecked


def test_landscape_of_numbers_of_ones_own(tmp_path):
    """Of any two numbers there are maps, with the designs where they are."""
    bounds = {"speed": (25.0, 35.0), "friction": (0.0, 0.1)}
    found = hand_made_answer(("speed", "friction"))
    found = replace(found, box=replace(found.box, bounds=bounds, units={"speed": "rpm"}))
    axes = {"speed": np.linspace(25, 35, 3), "friction": np.linspace(0, 0.1, 4)}
    ones = (("speed", "friction"), np.ones((3, 4)))
    orbits = xr.Dataset(
        {"objective": ones, "settling_turns": ones, "stable": (ones[0], np.ones((3, 4), bool))},
        axes,
    )
    drawn = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(figures, "write_figure", lambda path, fig: drawn.append((path.name, fig)))
        figures.draw_orbits(tmp_path, found, orbits)
        figures.draw_settling(tmp_path, found, orbits)
    assert [name for name, _ in drawn] == ["landscape.png", "settling.png"]
    for _, fig in drawn:
        ax = fig.axes[0]
        assert (ax.get_xlabel(), ax.get_ylabel()) == ("driving speed (rpm)", "friction")
        star = next(line for line in ax.lines if line.get_marker() == figures.OPTIMUM["marker"])
        speed, friction = found.optimum.values["speed"], found.optimum.values["friction"]
        np.testing.assert_allclose(star.get_xydata(), [[speed * 30 / np.pi, friction]])


def test_motions_survive_packing(page):
    motions, data = hand_made_motions(), data_of(page.read_text())
    length = motions.sizes["instant"]
    for short, name in (("x", "eccentricity_x"), ("force", "force")):
        values = unpacked(data["motions"][short], length)
        given = motions[name].to_numpy().reshape(-1, length)
        # Half a unit of 16 bits of the largest, and a 24-bit scale.
        np.testing.assert_allclose(values, given, rtol=1e-7, atol=0.51 / 32767 * np.nanmax(given))
    ideal = unpacked(data["motions"]["ideal"], length)
    np.testing.assert_allclose(ideal, 2e4, rtol=1e-7)
    assert data["first"] == 1  # the optimum's cell: first speed, second clearance


def test_interrupted_run_says_what_is_missing(tmp_path):
    (tmp_path / "landscape.png").write_bytes(b"of an earlier run")
    text = write_page(tmp_path, BEGUN, None, None, ()).read_text()
    assert "This run is not finished (status: interrupted)" in text
    gaps = ("answer", "landscape", "checks", "candidates", "refinement", "slopes", "figures")
    for what in (*gaps, "stages"):
        assert f"No {what}: the run ended before it came to that." in text
    assert "<img" not in text and "<script" not in text
    # Confirmed, and interrupted before its evidence.
    found = hand_made_answer()
    half = replace(BEGUN, optimum=found.optimum, candidates=found.candidates, bound=found.bound)
    text = write_page(tmp_path, half, hand_made_landscape(), None, ()).read_text()
    assert "No motions to draw" in text and data_of(text)["motions"] is None
    assert "18250 ± 7.2" in text and "No slopes" in text and "No remark" in text


def test_page_stays_small(tmp_path):
    for cells, drawn in (((50, 40), True), ((250, 160), False)):
        landscape = hand_made_landscape().interp(
            speed=np.linspace(25, 35, cells[0]),
            clearance=np.linspace(3e-5, 6e-5, cells[1]),
            method="nearest",
        )[["foundation_rms"]]
        motions = hand_made_motions(cells, 256 if drawn else 16)
        packed = page_data.pack(landscape, motions, BEGUN)["motions"]
        assert (packed is not None) == drawn
        assert len(json.dumps(packed)) < 4e6


def test_colours_run_over_the_whole_map():
    """From dark blue to yellow, as cividis begins and ends, and no two alike."""
    found = page_data.pack(hand_made_landscape(), None, BEGUN)["colours"]
    assert len(set(found)) == page_data.COLOURS
    assert (found[0], found[-1]) == ("#00224e", "#fee838")


@pytest.mark.slow
def test_motions_go_on_from_the_landscape():
    # So fast that two turns of impacts end before trajectories diverge (like exp(200 t)).
    bounds = {"speed": (25.0, 250.0), "clearance": (3e-5, 6e-5)}
    design = Design(bounds, jc.paper_machine(friction=0.05))
    case = Problem(design, OBJECTIVES["rms"], CrushingChamber())
    cells = {"start": list(STARTS), "speed": [25.0, 250.0], "clearance": [3e-5, 6e-5]}
    after = [jc.statistics(scene(*cell), 0, 1, **AFTER).state for cell in product(*cells.values())]
    states = np.stack(after).reshape(2, 2, 2, -1)
    landscape = xr.Dataset({"state": ((*cells, "coordinate"), states)}, cells)
    units = np.stack(np.meshgrid([0.0, 1.0], [0.0, 1.0], indexing="ij"), axis=-1).reshape(-1, 2)
    reported, turn = [], np.arange(65) / 64
    motions, steps = cell_motions(
        case, units, landscape, 1e-9, Tracking(lambda *done: reported.append(done)), turn
    )
    assert reported[-1] == (8, 8) and steps > 8 * 64
    # A transposed grid, swapped starts, a forgotten state would all show.
    compare(motions, "centred", 250.0, 3e-5)
    compare(motions, "contact", 25.0, 6e-5)


AFTER = {"outputs": ("foundation_rms",), "rtol": 1e-9}


def scene(start: str, speed: float, clearance: float) -> jc.Scene:
    """One program for both starts."""
    made = jc.paper_scene(speed, clearance, start=start, friction=0.05)
    return shifted_start(made, Vector(0.0, 0.0))


def compare(motions, start, speed, clearance) -> None:
    """A cell against `jaxcrusher.simulate` without a break."""
    motion = motions.sel(start=start, speed=speed, clearance=clearance)
    times = (1 + motion.turn.to_numpy()) * 2 * np.pi / speed
    outputs = ("eccentricity", "foundation_force")
    expected = jc.simulate(scene(start, speed, clearance), times, outputs=outputs, rtol=1e-9)
    orbit = np.stack([motion.eccentricity_x, motion.eccentricity_y], axis=-1)
    assert np.ptp(orbit[:, 0]) > 0.3
    # A break in the integration changes its steps: errors of 1e-9 a step, grown some thousandfold
    # in two turns of impacts (4e-6 clearances seen, and 1e-5 of the force).
    np.testing.assert_allclose(orbit, expected.eccentricity / clearance, atol=2e-5)
    np.testing.assert_allclose(motion.force, expected.foundation_force, rtol=5e-5)
    ideal = jc.simulate(jc.ideal_scene(speed), times, outputs=("foundation_force",))
    # 32-bit floats.
    np.testing.assert_allclose(motion.ideal_force, ideal.foundation_force, rtol=2e-7)


@pytest.fixture(scope="module")
def browser():
    """Headless Chromium with its own driver; nothing is downloaded."""
    program = shutil.which("chromium") or shutil.which("chromium-browser")
    driver = shutil.which("chromedriver")
    if program is None or driver is None:
        pytest.skip("no Chromium with its driver (Debian: chromium, chromium-driver)")
    from selenium import webdriver

    options = webdriver.ChromeOptions()
    options.binary_location = program
    # The sandbox refuses to run as root; containers have little shared memory.
    for argument in (
        "--headless=new",
        "--no-sandbox",
        "--disable-dev-shm-usage",
        "--window-size=1280,900",
    ):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    service = webdriver.ChromeService(driver)
    chromium = webdriver.Chrome(options=options, service=service)
    yield chromium
    chromium.quit()


@pytest.fixture
def opened(browser, page):
    browser.get(page.as_uri())
    yield browser
    assert browser.get_log("browser") == []  # neither errors nor refused fetches


def hover(browser, cell: int) -> str:
    """Put the mouse on a cell; returns the tooltip's text."""
    from selenium.webdriver.common.action_chains import ActionChains

    rectangle = browser.find_element("css selector", f'[data-cell="{cell}"]')
    browser.execute_script("arguments[0].scrollIntoView({block: 'center'})", rectangle)
    ActionChains(browser).move_to_element(rectangle).perform()
    return browser.find_element("id", "tip").text


def radius(browser, start: int) -> float:
    """Half the width of the orbit drawn, in radii of the bore drawn."""
    return browser.execute_script(
        """const svg = document.getElementById(`orbit-${arguments[0]}`);
        return svg.querySelector(".orbit").getBBox().width /
               svg.querySelector(".bore").getBBox().width""",
        start,
    )


@pytest.mark.slow
def test_hover_shows_a_cell(opened):
    text = hover(opened, 4)
    assert text.splitlines()[0] == "speed 35 rad/s, clearance 0.03 mm"
    assert "centred start: RMS 18\u202f400 ± 12 N, shaking RMS 4600 N" in text
    assert "contact start: RMS 19\u202f000 ± 12 N" in text
    # The path's coordinates have one decimal: 0.05 of some 80 units.
    assert radius(opened, 0) == pytest.approx(0.5, abs=2e-3)
    assert radius(opened, 1) == pytest.approx(1.0, abs=2e-3)
    force = opened.find_element("css selector", "#force-0 .force").get_attribute("d")
    assert len(re.findall("[ML]", force)) == 129
    assert "kN" in opened.find_element("id", "force-0").text


@pytest.mark.slow
def test_cells_without_numbers_say_why(opened):
    text = hover(opened, 5)
    assert "centred start: failed" in text and "contact start: RMS 19\u202f100" in text
    assert opened.find_elements("css selector", "#orbit-0 .orbit") == []
    assert opened.find_elements("css selector", "#orbit-1 .orbit") != []
    assert "friction whirl, out of the contact model" in hover(opened, 2)
    fills = [cell.get_attribute("fill") for cell in opened.find_elements("class name", "cell")]
    assert [fill.startswith("url") for fill in fills] == [False, False, True, False, False, True]


@pytest.mark.slow
def test_click_keeps_a_cell_and_the_mouse_leaves_it(opened):
    hover(opened, 3)
    opened.find_element("css selector", '[data-cell="3"]').click()
    hover(opened, 4)
    assert opened.find_element("id", "place").text == "speed 35 rad/s, clearance 0.03 mm"
    from selenium.webdriver.common.action_chains import ActionChains

    ActionChains(opened).move_to_element(opened.find_element("tag name", "h2")).perform()
    assert not opened.find_element("id", "tip").is_displayed()
    assert opened.find_element("id", "place").text == "speed 30 rad/s, clearance 0.06 mm"


@pytest.mark.slow
def test_no_row_twice(opened):
    hover(opened, 3)
    rows = [row.text for row in opened.find_elements("css selector", "#numbers td:first-child")]
    assert len(rows) == len(set(rows)) == 7


@pytest.mark.slow
def test_keyboard_and_choices(opened):
    place = opened.find_element("id", "place")
    assert place.text == "speed 25 rad/s, clearance 0.06 mm"  # the optimum's cell
    land = opened.find_element("id", "map")
    land.send_keys("\ue014")  # right arrow
    assert place.text == "speed 30 rad/s, clearance 0.06 mm"
    land.send_keys("\ue015")  # down arrow
    assert place.text == "speed 30 rad/s, clearance 0.03 mm"
    spoken = opened.find_element("id", "spoken").get_attribute("textContent")
    assert spoken.startswith(
        "speed 30 rad/s, clearance 0.03 mm; centred start: RMS 5\u202f600\u202f000"
    )
    whirl = '[data-cell="2"]'
    before = opened.find_element("css selector", whirl).get_attribute("fill")
    opened.find_element("css selector", '#choose-start option[value="1"]').click()
    # The whirl was the other start's: from contact the cell has a colour.
    assert before.startswith("url")
    assert opened.find_element("css selector", whirl).get_attribute("fill").startswith("#")
    opened.find_element("css selector", '#choose-variable option[value="whirl"]').click()
    assert "whirl" in opened.find_element("id", "bar-label").text


@pytest.mark.slow
def test_one_parameter_and_many(browser, tmp_path):
    """A strip of cells, and points of a sequence with their numbers."""
    landscape, motions = hand_made_landscape(), hand_made_motions()
    one = landscape.isel(clearance=0, drop=True), motions.isel(clearance=0, drop=True)
    flat = [
        data.stack(sample=("speed", "clearance")).reset_index("sample")
        for data in (landscape, motions)
    ]
    friction = ("sample", np.linspace(0, 0.1, 6), {"long_name": "friction"})
    many = [data.assign_coords(friction=friction) for data in flat]
    for (cells, moving), free, place in (
        (one, ("speed",), "speed 25 rad/s"),
        (many, ("speed", "clearance", "friction"), "speed 25 rad/s, clearance 0.03 mm, friction 0"),
    ):
        browser.get(write_page(tmp_path, hand_made_answer(free), cells, moving, ()).as_uri())
        assert hover(browser, 0).splitlines()[0] == place
        assert radius(browser, 0) == pytest.approx(0.5, abs=2e-3)
        browser.find_element("id", "map").send_keys("\ue014")
        assert browser.find_element("id", "place").text != place
        assert browser.get_log("browser") == []


@pytest.fixture
def phone(opened):
    size = {"width": 390, "height": 800, "deviceScaleFactor": 1, "mobile": False}
    opened.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    yield opened
    opened.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
    opened.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})


def emulate(browser, media: dict[str, Any], query: str) -> None:
    """Returns when the page is drawn as ``media`` asks: a busy browser takes some frames for it."""
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", media)
    drawn = """const [query, done] = arguments;
        const look = (left) => requestAnimationFrame(() =>
            left === 0 ? done() : look(matchMedia(query).matches ? left - 1 : left));
        look(2);"""
    browser.execute_async_script(drawn, query)


@pytest.mark.slow
def test_narrow_window_needs_no_sideways_scrolling(phone):
    """Neither the page nor any table of it: rows are cards."""
    phone.execute_script(
        "document.querySelectorAll('details').forEach((one) => { one.open = true })"
    )
    assert phone.execute_script("return document.documentElement.scrollWidth") <= 390
    wide = phone.execute_script(
        """return [...document.querySelectorAll(".wide")].filter((one) =>
        one.scrollWidth > one.clientWidth).map((one) => one.textContent.slice(0, 60))"""
    )
    assert wide == []
    captions = "return [...document.querySelectorAll('caption')].map((one) => one.offsetWidth)"
    assert min(phone.execute_script(captions)) > 200
    # Every number stands beside its heading.
    labels = phone.execute_script(
        """return [...document.querySelectorAll(".cards td")].filter((one) =>
        one.textContent && getComputedStyle(one, "::before").content === "none").length"""
    )
    assert labels == 0
    # What is drawn can be read: letters of pictures have 9 px at least.
    sizes = phone.execute_script(
        """return [...document.querySelectorAll("svg text")].filter((one) =>
        !one.matches(".mark, [transform]") && one.getBoundingClientRect().width > 0)
        .map((one) => parseFloat(getComputedStyle(one).fontSize) * one.getScreenCTM().d)"""
    )
    assert len(sizes) > 20 and min(sizes) >= 9, min(sizes)


@pytest.mark.slow
def test_nothing_is_folded_on_paper(phone):
    shown = """return [...document.querySelectorAll("details > :not(summary)")].map((one) =>
        one.checkVisibility({contentVisibilityAuto: true}) && one.offsetHeight > 0)"""
    assert not any(phone.execute_script(shown))
    emulate(phone, {"media": "print"}, "print")
    on_paper = phone.execute_script(shown)
    phone.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": ""})
    assert len(on_paper) > 1 and all(on_paper)


@pytest.mark.slow
def test_dark_and_light(phone):
    """Text stands off its ground in both, as far as WCAG asks (7 for small letters)."""
    contrasts = []
    for scheme in ("light", "dark"):
        feature = {"name": "prefers-color-scheme", "value": scheme}
        emulate(phone, {"features": [feature]}, f"(prefers-color-scheme: {scheme})")
        style = "const s = getComputedStyle(document.body); return [s.color, s.backgroundColor]"
        ink, paper = (luminance(colour) for colour in phone.execute_script(style))
        contrasts.append((max(ink, paper) + 0.05) / (min(ink, paper) + 0.05))
        assert (ink > paper) == (scheme == "dark")
    assert min(contrasts) > 7


def luminance(colour: str) -> float:
    """Of "rgb(r, g, b)", relative, as WCAG 2 defines it."""
    parts = [int(part) / 255 for part in re.findall(r"\d+", colour)[:3]]
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in parts]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def test_a_load_sheet_knows_motor_and_points():
    """The group of a machine in ISO 10816-3 follows from its power."""
    block = {"foundation.mass": 6e3, "joint": "ideal"}
    solution = jc.periodic_orbit(jc.build_scene(block))
    design: Any = SimpleNamespace(settles=True, orbit=SimpleNamespace(solution=solution))
    given = block | {"motor_power": 4e5, "foundation.points.corner": "1 m, 0.5 m"}
    (sheet,) = stages.load_sheets(given, {"optimum": design}).values()
    assert "motor_power is not given" not in sheet[0].remark
    assert any("corner" in row.name for row in sheet)


def test_load_sheets_stand_side_by_side():
    def sheet(value: float, *more: Row) -> list[Row]:
        return [
            *more,
            Row("harmonics", "left force, vertically", 2.0, value, "N", np.pi / 2),
            Row("motion", "velocity of G", "RMS", value, "mm/s", remark="zone A, rigid support"),
        ]

    # A design may have a free motion more, and a phase that rounds to zero.
    free = Row("harmonics", "left force, vertically", 1.0, -0.0, "N", -1e-3)
    sheets = {"optimum": sheet(12.0), "scene file": sheet(34.0, free)}
    solution = SimpleNamespace(scene=jc.ideal_scene(30.0))
    design = SimpleNamespace(orbit=SimpleNamespace(solution=solution))
    found: Any = SimpleNamespace(load_sheets=sheets, designs=dict.fromkeys(sheets, design))
    table = tables.load_sheet(found)
    assert table is not None and table.headings == ("", "optimum", "scene file")
    assert table.rows == [
        ("left force, vertically, order 2, N", "12 at 90°", "34 at 90°"),
        ("left force, vertically, order 1, N", "", "0 at 0°"),
        ("velocity of G, RMS, mm/s", "12 (zone A, rigid support)", "34 (zone A, rigid support)"),
    ]
    assert "ISO 10816-3:2009" in table.about
    assert "Of the optimum the main bearing A is ideal, elbow B is ideal" in table.about
    assert tables.load_sheet(cast(Any, SimpleNamespace(load_sheets={}))) is None

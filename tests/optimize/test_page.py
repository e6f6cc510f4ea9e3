"""The report's page: self-contained, escaped, honest about gaps, and alive in a browser."""

import base64
import json
import re
import shutil
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
import pytest
import xarray as xr

import jaxcrusher as jc
from jaxcrusher.crusher.capacity import CrushingChamber
from jaxcrusher.joint.validity import Validity
from jaxcrusher.sheets.load_sheet import Row
from optimize.answer import (
    Active,
    Answer,
    Bound,
    Check,
    Coexisting,
    Confirmed,
    Crushing,
    Front,
    Refinement,
    Runs,
)
from optimize.ask.design import Design
from optimize.ask.objectives import OBJECTIVES
from optimize.ask.problem import DesignProblem
from optimize.search import stages
from optimize.search.motions import INSTANTS, turns
from optimize.tell import figures, tables
from optimize.tell import words as formatting
from optimize.tell.page.document import COLOURS, pack, write_page
from optimize.tell.result import content
from tests.optimize.by_hand import maps_of, no_orbit, orbit_by_hand, printed, solution_by_hand

SPEEDS, CLEARANCES = [25.0, 30.0, 35.0], [3e-5, 6e-5]
EVIL = '</script><img src="http://example.org/x.png">&'


def hand_made_orbits() -> xr.Dataset:
    """A circle of half a clearance in every cell; (1, 0) is unstable, and (2, 1) has no orbit."""
    dims, shape, instants = ("speed", "clearance"), (3, 2), INSTANTS
    rms = 18000.0 + 100 * np.arange(6).reshape(shape)
    success, stable = np.ones(shape, bool), np.ones(shape, bool)
    success[2, 1] = stable[2, 1] = stable[1, 0] = False
    failure = np.full(shape, "", object)
    failure[2, 1] = EVIL
    angle = 2 * np.pi * np.arange(instants) / instants
    path = 0.5 * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    variables = {
        "objective": (np.where(success, rms, np.nan), "N", "RMS of |R_O| + |R_C|"),
        "foundation_rms": (np.where(success, rms, np.nan), "N", "RMS of |R_O| + |R_C|"),
        "shaking_rms": (rms / 4, "N", EVIL),
        "largest_multiplier": (np.where(stable, 0.9, 1.5), "1", "largest modulus"),
        "settling_turns": (np.where(stable, 9.0, np.inf), "1", "turns to 1/e"),
        "ideal_objective": (np.full(shape, 17900.0), "1", "with ideal joints"),
        **{name: (stable, "1", name) for name in ("stable", "counts")},
        "success": (success, "1", "solved"),
        "undecided": (np.zeros(shape, bool), "1", "not known"),
        "inside_model": (success, "1", "inside"),
        "failure": (failure, "1", "why"),
    }
    force = np.where(success[..., None], 2e4 + 1e3 * np.sin(angle), np.nan)
    drawn = {
        "path": ((*dims, "instant", "axis"), np.where(success[..., None, None], path, np.nan)),
        "force": ((*dims, "instant"), force),
        "ideal_force": ((*dims, "instant"), np.full((*shape, instants), 2e4)),
    }
    return xr.Dataset(
        {
            name: (dims, values, {"units": unit, "long_name": meaning})
            for name, (values, unit, meaning) in variables.items()
        }
        | drawn,
        {"speed": ("speed", SPEEDS), "clearance": ("clearance", CLEARANCES)},
    )


BOUNDS = {"speed": (25.0, 35.0), "clearance": (3e-5, 6e-5), "friction": (0.0, 0.1)}


def hand_made_problem(*free: str, **given: Any) -> DesignProblem:
    """Of the paper's crusher with a friction of 0.05 and these numbers, as far as none is free."""
    machine = jc.paper_machine(**{"friction": 0.05, **given})
    design = Design({name: BOUNDS[name] for name in free}, machine)
    chamber = CrushingChamber()
    return DesignProblem(
        design, replace(OBJECTIVES["rms"], name="rms"), chamber, capacity_floor=5.6
    )


BEGUN = Answer(
    hand_made_problem("speed", "clearance"),
    command=f"python -m optimize.run --name '{EVIL}'",
    versions={"jax": "0.10.2"},
)


def over_a_map(found: Answer, orbits: xr.Dataset) -> Answer:
    """Return an answer with this map of orbits."""
    return replace(found, maps=maps_of(np.zeros((orbits.objective.size, 2)), orbits))


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
    ends = {"speed": [30.0, 25.0], "clearance": [3e-5, 6e-5], "friction": [0.0, 0.1]}
    path = {name: np.array(ends[name]) for name in free}
    return replace(
        BEGUN,
        problem=hand_made_problem(*free),
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
    orbits = hand_made_orbits()
    found = over_a_map(hand_made_answer(), orbits)
    with plt.rc_context(figures.STYLE):
        figures.draw_curve(folder, found, found.optimum, orbits)
        figures.draw_orbits(folder, found, orbits)
    return write_page(folder, found, ["curve.svg", "orbits.svg"])


def test_stages_have_one_order_whichever_ended_first():
    ended = {"orbits": 7.0, "landscape": 2.0, "fronts": 0.5}
    rows = tables.stages(replace(BEGUN, seconds=ended, steps={"landscape": 9})).rows
    assert rows == [
        ("map of periodic orbits", "7.0", ""),
        ("both starts over the box", "2.0", 9),
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

    return json.loads(found, parse_constant=refuse)


def unpacked(packed: dict, length: int) -> np.ndarray:
    """16-bit whole numbers times the scale of their row."""
    whole = np.frombuffer(base64.b64decode(packed["values"]), "<i2").reshape(-1, length)
    scale = np.frombuffer(base64.b64decode(packed["scale"]), "<f4")
    return np.where(whole == -32768, np.nan, whole * scale[:, None].astype(float))


def test_page_fetches_nothing(page):
    text = page.read_text()
    outside = re.sub(r"<script.*?</script>", "", text, flags=re.S)
    names = r"<[^>]*?\s(?:src|(?:xlink:)?href|action|data|poster)\s*=\s*\"([^\"]*)"
    fetched = re.findall(names, outside)
    # Markers of a picture, and its map in pixels.
    assert fetched and all(one.startswith(("#", "data:image/png;base64,")) for one in fetched)
    assert all(one.startswith("#") for one in re.findall(r"url\(([^)]*)", outside))
    assert not re.search(r"fetch\(|XMLHttpRequest|WebSocket|import\(|<link|<iframe|@import", text)
    assert "default-src &#39;none&#39;" in text


def test_every_text_is_escaped(page):
    text = page.read_text()
    assert EVIL not in text
    # One element of data and one of code: no text opened or closed another.
    assert text.count("<script") == text.count("</script>") == 2
    assert text.count("&lt;/script&gt;&lt;img src=&#34;http:") == 3
    data = data_of(text)
    (shaking,) = (one for one in data["variables"] if one["name"] == "shaking_rms")
    assert shaking["label"] == EVIL
    assert data["states"][5] == f"No orbit of one turn: {EVIL}"


def test_page_shows_what_it_knows_and_what_it_does_not(page):
    text = page.read_text()
    assert "18250.1 ± 7.2" in text and "9250.1 ± 7.2" in text and "1 of 2 checks failed." in text
    assert "half a 95 % interval, from 6 independent runs" in text
    # One of six runs failed: there is no number to show, and no design to choose.
    assert ">1 of 6 failed</td>" in text and ">no value</td>" in text
    for start, mean in (("centred", "18250.1 ± 7.2"), ("contact", "9250.1 ± 7.2")):
        motion, turns, told = cells(text, f"optimum, {start} start")
        assert motion.startswith("not known to settle; ") and (turns, told) == ("unknown", mean)
    assert "contact of half-width 1.80 radii: not Hertzian" in text
    # Words in place of keys: of variables, stages, ways of descent.
    for key in ("foundation_rms", "success", "whirl", "fits", "landscape"):
        assert f">{key}<" not in text, key
    assert "fits to noisy runs" in text and "both starts over the box" in text


def test_the_first_screen_begins_with_what_matters(page):
    """A sentence, three numbers, and five columns; proofs and the way there come last."""
    found = replace(hand_made_answer(), active=(Active("speed", "lowest", 115.6),))
    other = replace(found.reference, forces={"foundation_rms": 22e3, "shaking_rms": 6270.0})
    found = replace(found, reference=other)
    assert tables.headline(found) == [
        (
            "speed",
            "25 rad/s",
            "238.7 rpm, the lowest allowed; with clearance 0.06 mm, the highest allowed",
        ),
        ("RMS shaking force", "3.135 kN", "50 % less than 6.27 kN at the paper's choice"),
        ("capacity", "9.41 m³/h", "56.1 % more than 6.03 m³/h at the paper's choice"),
    ]
    table = tables.answer(found)
    assert table.headings == ("", "unit", "optimum", "paper's choice", "change")
    assert table.rows[0] == ("speed", "rad/s", "25", "39", "-35.9 %")
    assert table.rows[3] == ("RMS of the shaking force", "N", "3135", "6270", "-50.0 %")
    # What is the same has not changed.
    assert table.rows[-1] == ("stroke, up over across", "", "1.2", "1.2", "")
    text = page.read_text().split("<main>")[1]
    order = ["Not confirmed", 'class="headline"', 'class="answer"', "The objective over the free"]
    order += [
        "Periodic orbits over the box",
        "What has to be traded",
        ">Checks<",
        "How it was found",
    ]
    places = [text.index(part) for part in order]
    assert places == sorted(places)


def test_a_linkage_is_told_by_what_is_free_and_by_its_objective():
    """It crushes nothing; of many free numbers the first are told."""
    found = hand_made_answer(("speed", "clearance", "friction"))
    plain = {"crushing": None, "forces": {"shaking_rms": 1e3}}
    one = replace(found.optimum, objective=2e3, **plain)
    two = replace(found.reference, objective=4e3, **plain)
    of = replace(OBJECTIVES["peak"], name="peak", meaning="peak in B")
    problem = replace(found.problem, objective=of)
    told = tables.headline(replace(found, problem=problem, optimum=one, reference=two))
    assert [value for _, value, _ in told] == ["25 rad/s", "1 kN", "2 kN"]
    left = "clearance 0.06 mm, the highest allowed; friction 0.05"
    assert told[0][2] == f"238.7 rpm, the lowest allowed; with {left}"
    assert told[1][2] == "" and told[2][2] == "50 % less than 4 kN at the paper's choice"


def test_capacity_in_tonnes_stands_beside_that_in_cubic_metres(tmp_path):
    """9.41 m3/h of 1.6 t/m3 are 15.06 t/h, on the page, on the screen and in result.json."""
    plain = hand_made_answer()
    found = replace(plain, problem=replace(plain.problem, bulk_density=1600.0))
    assert ("capacity", "t/h", "15.06", "9.65", "+56.1 %") in tables.answer(found).rows
    assert re.search(r"capacity +t/h +15\.06 +9\.65 +\+56\.1 % *\n", printed(found, 120))
    tonnes = {"optimum": pytest.approx(15.056), "paper's choice": pytest.approx(9.648)}
    assert content(found)["throughput"] == tonnes
    assert "t/h" not in write_page(tmp_path, plain, ()).read_text()
    assert content(plain)["throughput"] == {}


def test_strokes_stand_beside_the_capacity_with_a_caution(tmp_path):
    """20.1 mm in all, 1.2 mm up for each across."""
    found = hand_made_answer()
    text = write_page(tmp_path, found, ()).read_text()
    assert cells(text, "stroke at the discharge") == ["mm", "20.1", "20.1", ""]
    assert text.count("slower is always more there") == 1
    assert "slower is always more there" in printed(found, 120)


def test_numbers_that_follow_stand_beside_the_free_ones():
    found, follows = hand_made_answer(), {"shaft.eccentricity": 6.7e-3, "counterweight.mass": 11.0}
    other = replace(found.reference, follows=follows | {"counterweight.mass": 0.0})
    found = replace(found, optimum=replace(found.optimum, follows=follows), reference=other)
    assert tables.answer(found).rows[1:4] == [
        ("clearance", "mm", "0.06", "0.03", "+100.0 %"),
        ("shaft eccentricity that follows", "mm", "6.7", "6.7", ""),
        ("counterweight mass that follows", "kg", "11", "0", ""),
    ]
    # None of them is one that nobody gave.
    assert "shaft eccentricity" not in dict(row[:2] for row in tables.fixed(found).rows)


def test_the_two_bearings_are_drawn(tmp_path, monkeypatch):
    """O and C where the machine has them, with the frame's forces."""
    drawn, write = [], figures.write_figure

    def kept(path, fig):
        (ax,) = fig.axes
        drawn.append({text.get_text(): text for text in ax.texts})
        write(path, fig)

    monkeypatch.setattr(figures, "write_figure", kept)
    found = hand_made_answer()
    # A load across the jaw presses on both, so that both forces are long enough for a name.
    problem = hand_made_problem("speed", "clearance", load_law="normal_to_jaw")
    figures.draw_bearings(tmp_path, problem, found.optimum)
    (names,) = drawn
    bearing = jc.build_scene({}).linkage.joints.at("shaft_bearing").bore.arm.vector()
    np.testing.assert_allclose(names["O"].xy, [float(bearing.x), float(bearing.y)], rtol=1e-12)
    np.testing.assert_array_equal(names["C"].xy, [0.0, 0.0])
    assert names["$R_O$"].get_visible() and names["$R_C$"].get_visible()


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
    value = orbit.objective
    optimum = replace(found.optimum, objective=value, orbit=orbit, transient=runs)
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
    text = write_page(tmp_path, found, ()).read_text()
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
    units = {"speed": "rpm", "clearance": "um"}
    given = replace(found, problem=replace(found.problem, units=units))
    rpm = write_page(tmp_path, given, ()).read_text()
    assert "is at its lowest value, multiplier 0.051 N per um" in rpm
    assert cells(rpm, "clearance, N per um") == ["0.051", "4e-05"]
    assert cells(rpm, "speed, N per rpm")[0] == "23.04"
    assert cells(rpm, "speed, rpm") == ["238.732", "334.225"] and "60</td>" in rpm
    motion, turns, _ = cells(text, "optimum, centred start")
    assert motion == "towards the periodic orbit, in contact" and turns == "5000"
    loud = Coexisting(0.2, solution_by_hand(period=2), 2e4)
    table = tables.coexisting(replace(found, optimum=replace(optimum, coexisting=(loud,))))
    assert table is not None and table.rows == [("optimum", "20%", 2, 2e4)]


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
    orbits = hand_made_orbits()
    none = over_a_map(inside, orbits.assign(stable=orbits.stable & False))
    assert formatting.answer(none).startswith(
        "The map of the box found no stable orbit of one turn: the best is 25 rad/s"
    )
    assert formatting.answer(over_a_map(inside, orbits)).startswith("Run it at")
    unchecked = formatting.answer(replace(inside, checks=()))
    assert unchecked.startswith("Not confirmed: ") and "ended before its checks" in unchecked


def test_landscape_of_numbers_of_ones_own(tmp_path):
    """Of any two numbers there are maps, with the designs where they are."""
    found = hand_made_answer(("speed", "friction"))
    found = replace(found, problem=replace(found.problem, units={"speed": "rpm"}))
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
    assert [name for name, _ in drawn] == ["orbits.svg", "settling.svg"]
    for _, fig in drawn:
        ax = fig.axes[0]
        assert (ax.get_xlabel(), ax.get_ylabel()) == ("driving speed (rpm)", "friction")
        star = next(line for line in ax.lines if line.get_marker() == figures.OPTIMUM["marker"])
        speed, friction = found.optimum.values["speed"], found.optimum.values["friction"]
        np.testing.assert_allclose(star.get_xydata(), [[speed * 30 / np.pi, friction]])


def test_the_map_survives_packing(page):
    orbits, data = hand_made_orbits(), data_of(page.read_text())
    for name, given in (
        ("path", orbits.path.transpose(..., "axis", "instant")),
        ("force", orbits.force),
        ("ideal_force", orbits.ideal_force),
    ):
        flat = given.to_numpy().reshape(6, -1)
        values = unpacked(data["motions"][name], flat.shape[1])
        # Half a unit of 16 bits of the largest, and a 24-bit scale.
        np.testing.assert_allclose(values, flat, rtol=1e-7, atol=0.51 / 32767 * np.nanmax(flat))
    assert data["first"] == 1  # the optimum's cell: first speed, second clearance
    assert data["hatched"] == [0, 0, 1, 0, 0, 1]
    assert data["states"][0] == "Stable"
    assert data["states"][2] == "Unstable: a disturbance grows 1.5 times in a turn"
    # What is no number of a cell is none to choose.
    assert [one["name"] for one in data["variables"]] == [*orbits][:5]


def test_a_cell_without_an_orbit_has_the_command_that_names_its_motion():
    orbits = hand_made_orbits()
    command = "python -m optimize.run --scene 'my jaw.toml' --set jaw.mass '500 kg' --cells 3 2"
    problem = hand_made_problem("speed", "clearance", **{"jaw.mass": 5e2})
    found = replace(hand_made_answer(), command=command, problem=problem)
    assert pack(orbits, found)["more"] == (
        "python -m jaxcrusher regimes --scene 'my jaw.toml' --set jaw.mass '500 kg' "
        "--set friction 0.05"
    )
    # Where numbers follow from the free ones, these do not describe the machine.
    follows = replace(found.optimum, follows={"shaft.eccentricity": 6e-3})
    assert pack(orbits, replace(found, optimum=follows))["more"] == ""


def test_the_map_has_every_orbits_path_and_force():
    """Against the integrated motion from the orbit's own state, and the ideal joints' motion."""
    design = Design({"speed": (25.0, 35.0), "clearance": (3e-5, 6e-5)})
    problem = DesignProblem(design, OBJECTIVES["rms"], CrushingChamber())
    units = np.array([[0.5, 1.0], [0.0, 0.0]])
    scene = design.build(design.completed(design.numbers(units[0])))
    orbit = jc.periodic_orbit(scene)
    nodes = np.stack([np.asarray(orbit.eccentricity)] * 2)
    rows = {"success": np.array([True, False]), "eccentricity": nodes}
    found = turns(problem, units, rows)
    times = np.arange(INSTANTS) / INSTANTS * 2 * np.pi / 30.0
    outputs = ("eccentricity", "foundation_force")
    expected = jc.simulate(scene, times, outputs=outputs, state=orbit.section, rtol=1e-9)
    # Nodes resolve a path to some millionths of a clearance, and the force to as much of itself.
    path = np.asarray(expected.eccentricity) / 6e-5
    np.testing.assert_allclose(found["path"][0], path, atol=1e-5)
    np.testing.assert_allclose(found["force"][0], expected.foundation_force, rtol=1e-4)
    assert np.isnan(found["path"][1]).all() and np.isnan(found["force"][1]).all()
    for cell, speed in enumerate((30.0, 25.0)):
        at = times * 30.0 / speed
        ideal = jc.simulate(jc.ideal_scene(speed), at, outputs=("foundation_force",))
        # 32-bit floats.
        np.testing.assert_allclose(found["ideal_force"][cell], ideal.foundation_force, rtol=2e-7)
        rms = np.sqrt(np.mean(np.square(ideal.foundation_force)))
        np.testing.assert_allclose(found["ideal_objective"][cell], rms, rtol=2e-7)
    other = replace(problem, objective=OBJECTIVES["excess"])
    assert np.isnan(turns(other, units, rows)["ideal_objective"]).all()


def test_the_curve_is_the_line_of_the_map_that_changes_the_objective_most(tmp_path, monkeypatch):
    """Through the optimum at 25 rad/s and 0.06 mm: 200 N a cell by the speed, in both rows."""
    drawn = []
    monkeypatch.setattr(figures, "write_figure", lambda path, fig: drawn.append(fig))
    found, orbits = hand_made_answer(), hand_made_orbits()
    figures.draw_curve(tmp_path, found, found.optimum, orbits)
    (ax,) = drawn[0].axes
    lines = {line.get_label(): line.get_xydata() for line in ax.lines}
    # The last cell of this row has no orbit, and ideal joints all the same.
    np.testing.assert_allclose(lines["with clearance"][:2], [[25, 18.1], [30, 18.3]])
    assert np.isnan(lines["with clearance"][2, 1])
    np.testing.assert_allclose(lines["ideal joints"][:, 1], 17.9)
    np.testing.assert_allclose(lines["optimum"], [[25.0, 18.2501]])
    assert ax.get_title() == "at clearance 0.06 mm\nthe contact adds 200 N at the star"
    plt.close(drawn[0])


def test_pictures_take_the_colours_of_the_page_and_share_no_names(tmp_path):
    found, orbits = hand_made_answer(), hand_made_orbits()
    with plt.rc_context(figures.STYLE):
        figures.draw_orbits(tmp_path, found, orbits)
        first = (tmp_path / "settling.svg").read_bytes()
        figures.draw_orbits(tmp_path, found, orbits)
    assert (tmp_path / "settling.svg").read_bytes() == first
    texts = [(tmp_path / name).read_text() for name in ("settling.svg", "orbits.svg")]
    for text in texts:
        assert figures.INK not in text and "<style" not in text and "<image" in text
        assert re.search(r"fill: currentColor[^>]*>driving speed", text)
    one, two = ({*re.findall(r' id="([^"]+)"', text)} for text in texts)
    assert one and two and not one & two


def test_interrupted_run_says_what_is_missing(tmp_path):
    (tmp_path / "curve.svg").write_bytes(b"of an earlier run")
    text = write_page(tmp_path, BEGUN, ()).read_text()
    assert "This run is not finished (status: interrupted)" in text
    gaps = ("answer", "map", "fronts", "checks", "candidates", "refinement", "slopes", "stages")
    for what in gaps:
        assert f"No {what}: the run ended before it came to that." in text, what
    assert "<img" not in text and "<script" not in text and "<figure" not in text
    # Confirmed, and interrupted before its evidence.
    found = hand_made_answer()
    half = replace(BEGUN, optimum=found.optimum, candidates=found.candidates, bound=found.bound)
    text = write_page(tmp_path, over_a_map(half, hand_made_orbits()), ()).read_text()
    assert data_of(text)["motions"] is not None
    assert "18250.1 ± 7.2" in text and "No slopes" in text and "No remark" in text


def test_a_box_without_a_map_shows_the_first_turns_and_says_why(tmp_path):
    (tmp_path / "landscape.svg").write_text('<svg width="1"></svg>')
    omitted = {"pareto.svg": "no point of the maps may be chosen", "map": "it is rough"}
    text = write_page(tmp_path, hand_made_answer(), ["landscape.svg"], omitted).read_text()
    assert "There is no map of orbits: it is rough. In its place" in text
    assert text.count("<figure") == 1 and "oscillations have not decayed" in " ".join(text.split())
    assert "pareto.svg is not drawn: no point of the maps may be chosen" in text
    assert "<script" not in text


def test_page_stays_small():
    for (across, up), drawn in (((50, 40), True), ((100, 60), False)):
        at = {"speed": np.linspace(25, 35, across), "clearance": np.linspace(3e-5, 6e-5, up)}
        packed = pack(hand_made_orbits().reindex(at, method="nearest"), BEGUN)
        assert (packed["motions"] is not None) == drawn
        assert len(json.dumps(packed)) < 3e6


def test_colours_run_over_the_whole_map():
    """From dark blue to yellow, as cividis begins and ends, and no two alike."""
    found = pack(hand_made_orbits(), BEGUN)["colours"]
    assert len(set(found)) == COLOURS
    assert (found[0], found[-1]) == ("#00224e", "#fee838")


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


@pytest.mark.slow
def test_hover_shows_a_cell(opened):
    lines = hover(opened, 4).splitlines()
    assert lines[0] == "speed 35 rad/s, clearance 0.03 mm"
    assert lines[1:] == ["RMS of |R_O| + |R_C| 18400 N", "Stable"]
    width = "return document.querySelector(arguments[0]).getBBox().width"
    orbit, bore = (opened.execute_script(width, f"#orbit .{one}") for one in ("orbit", "ideal"))
    # The path's coordinates have one decimal: 0.05 of some 80 units.
    assert orbit / bore == pytest.approx(0.5, abs=2e-3)
    force = opened.find_element("css selector", "#force .force").get_attribute("d")
    assert len(re.findall("[ML]", force)) == INSTANTS + 1
    assert "kN" in opened.find_element("id", "force").text
    rows = [row.text for row in opened.find_elements("css selector", "#numbers th")]
    assert len(rows) == len(set(rows)) == 4  # the objective is one of the statistics


@pytest.mark.slow
def test_cells_without_an_orbit_say_why_and_what_tells_more(opened):
    assert hover(opened, 5).splitlines()[1].startswith("No orbit of one turn: ")
    assert opened.find_elements("css selector", "#orbit .orbit") == []
    assert opened.find_elements("css selector", "#force .ideal") != []
    code = opened.find_element("css selector", "#state code").text
    assert code.endswith('--set speed "35 rad/s" --set clearance "0.06 mm"')
    fills = [cell.get_attribute("fill") for cell in opened.find_elements("class name", "cell")]
    assert [fill.startswith("url") for fill in fills] == [False, False, True, False, False, True]


@pytest.mark.slow
def test_a_cell_is_kept_said_and_let_go(opened):
    place = opened.find_element("id", "place")
    first = "speed 25 rad/s, clearance 0.06 mm"  # the optimum's cell
    assert place.text == first
    land = opened.find_element("id", "map")
    land.send_keys("\ue014")  # right arrow
    assert place.text == "speed 30 rad/s, clearance 0.06 mm"
    land.send_keys("\ue015")  # down arrow
    spoken = opened.find_element("id", "spoken")
    said = "speed 30 rad/s, clearance 0.03 mm; RMS of |R_O| + |R_C| 18200 N; Unstable: "
    assert spoken.get_attribute("textContent").startswith(said)
    assert land.get_attribute("aria-describedby") == "spoken"
    hover(opened, 3)
    opened.find_element("css selector", '[data-cell="3"]').click()
    hover(opened, 4)
    assert place.text == "speed 35 rad/s, clearance 0.03 mm"
    land.send_keys("\ue00c")  # escape
    assert not opened.find_element("id", "tip").is_displayed() and place.text == first
    assert spoken.get_attribute("textContent").startswith(first)
    opened.find_element("css selector", "#choose option:nth-child(4)").click()
    assert "largest modulus" in opened.find_element("id", "map").text


@pytest.mark.slow
def test_one_parameter_and_many(browser, tmp_path):
    """A strip of cells, and points of a sequence with their numbers."""
    orbits = hand_made_orbits()
    one = orbits.isel(clearance=0, drop=True)
    flat = orbits.stack(sample=("speed", "clearance")).reset_index("sample")
    many = flat.transpose("sample", ...).assign_coords(friction=("sample", np.linspace(0, 0.1, 6)))
    first, second = ("speed 25 rad/s", "speed 30 rad/s")
    more = ", clearance 0.03 mm, friction "
    for cells, free, place, beside in (
        (one, ("speed",), first, second),
        (many, ("speed", "clearance", "friction"), f"{first}{more}0", f"{second}{more}0.04"),
    ):
        browser.get(write_page(tmp_path, over_a_map(hand_made_answer(free), cells), ()).as_uri())
        assert hover(browser, 0).splitlines()[0] == place
        assert browser.find_elements("css selector", "#orbit .orbit") != []
        browser.find_element("id", "map").send_keys("\ue014")
        # Beside the cell of the optimum, which is the second one of the sequence.
        assert browser.find_element("id", "place").text == beside
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
    # Every number stands beside its heading.
    labels = phone.execute_script(
        """return [...document.querySelectorAll(".cards td")].filter((one) =>
        one.textContent && getComputedStyle(one, "::before").content === "none").length"""
    )
    assert labels == 0
    # What is drawn can be read: letters of pictures have 9 px at least.
    sizes = phone.execute_script(
        """return [...document.querySelectorAll("svg text")].filter((one) =>
        one.getBoundingClientRect().width > 0).map((one) => {
            const { a, b } = one.getScreenCTM();
            return parseFloat(getComputedStyle(one).fontSize) * Math.hypot(a, b); })"""
    )
    assert len(sizes) > 20 and min(sizes) >= 9, min(sizes)


@pytest.mark.slow
def test_the_load_sheet_is_not_folded_on_paper(phone, tmp_path):
    sheet = {"optimum": [Row("harmonics", "left force", 2.0, 12.0, "N", 1.0)]}
    found = hand_made_answer()
    found = replace(found, load_sheets=sheet, optimum=replace(found.optimum, orbit=no_orbit()))
    phone.get(write_page(tmp_path, found, ()).as_uri())
    shown = """return [...document.querySelectorAll("details > :not(summary)")].map((one) =>
        one.checkVisibility({contentVisibilityAuto: true}) && one.offsetHeight > 0)"""
    assert not any(phone.execute_script(shown))
    emulate(phone, {"media": "print"}, "print")
    on_paper = phone.execute_script(shown)
    phone.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": ""})
    # How the optimum was found prints only where it was unfolded.
    assert len(on_paper) > 1 and on_paper == [True] + [False] * (len(on_paper) - 1)


@pytest.mark.slow
def test_dark_and_light(phone):
    """Text stands off its ground in both, as far as WCAG asks (7 for small letters)."""
    contrasts = []
    for scheme in ("light", "dark"):
        feature = {"name": "prefers-color-scheme", "value": scheme}
        emulate(phone, {"features": [feature]}, f"(prefers-color-scheme: {scheme})")
        style = "const s = getComputedStyle(document.body); return [s.color, s.backgroundColor]"
        ink, paper = (luminance(colour) for colour in phone.execute_script(style))
        drawn = 'return getComputedStyle(document.querySelector("svg.picture text")).fill'
        assert luminance(phone.execute_script(drawn)) == ink
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
    design = SimpleNamespace(settles=True, orbit=SimpleNamespace(solution=solution))
    given = block | {"motor_power": 4e5, "foundation.points.corner": "1 m, 0.5 m"}
    problem = hand_made_problem("speed", **given)
    answer = SimpleNamespace(problem=problem, designs={"optimum": design})
    (sheet,) = stages._load_sheets(answer).values()
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
    found = SimpleNamespace(load_sheets=sheets, designs=dict.fromkeys(sheets, design))
    table = tables.load_sheet(found)
    assert table is not None and table.headings == ("", "optimum", "scene file")
    assert table.rows == [
        ("left force, vertically, order 2, N", "12 at 90°", "34 at 90°"),
        ("left force, vertically, order 1, N", "", "0 at 0°"),
        ("velocity of G, RMS, mm/s", "12 (zone A, rigid support)", "34 (zone A, rigid support)"),
    ]
    assert "ISO 10816-3:2009" in table.about
    assert "Of the optimum the main bearing A is ideal, elbow B is ideal" in table.about
    assert tables.load_sheet(SimpleNamespace(load_sheets={})) is None

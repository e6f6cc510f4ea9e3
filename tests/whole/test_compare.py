"""`python -m jaxcrusher compare`: crushers of scene files side by side."""

import csv
import io
import math
from dataclasses import replace
from pathlib import Path

import pytest
from rich.console import Console

import jaxcrusher as jc
from jaxcrusher.commands.compare import (
    DRAWN,
    QUANTITIES,
    Compared,
    compared,
    draw,
    run,
    table_rows,
)
from jaxcrusher.commands.options import Compare, Results
from jaxcrusher.crusher.capacity import PER_VOLUME, CrushingChamber
from jaxcrusher.crusher.template import CALLED
from jaxcrusher.orbits.result import RESULTS, missing


@pytest.fixture(scope="module")
def both(tmp_path_factory):
    """A quiet machine, and one whose load comes and goes; the screen, the csv, the folder."""
    folder = tmp_path_factory.mktemp("compared")
    (folder / "quiet.toml").write_text('speed = "27 rad/s"\nclearance = "0.05 mm"\n')
    (folder / "loud.toml").write_text('load_law = "closing_stroke"\n')
    written = io.StringIO()
    console = Console(file=written, width=120)
    solve = jc.periodic_orbit

    def orbit(scene, effort):
        """Return that of the quiet machine; to find that the loud one has none takes long."""
        quiet = float(scene.drive.speed) == 27.0
        return solve(scene, effort=effort) if quiet else missing(scene, 1, RESULTS.chaotic)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(jc, "periodic_orbit", orbit)
        files, results = (folder / "quiet.toml", folder / "loud.toml"), Results("here", folder)
        assert run(Compare(files, 2, 3, "1.6 t/m3", results), console) == 0
    folder /= "here"
    rows = list(csv.DictReader((folder / "compare.csv").read_text().splitlines()))
    return written.getvalue(), rows, folder


def test_numbers_are_those_of_the_orbit(both):
    _, (quiet, _), _ = both
    orbit = jc.periodic_orbit(jc.paper_scene(27.0, 0.05e-3))
    assert quiet["machine"] == "quiet"
    assert quiet["numbers of"] == "periodic orbit" and quiet["contact model"] == "inside"
    for name in CALLED:
        # The same program.
        assert float(quiet[f"{name}, N"]) == pytest.approx(float(orbit[name]), rel=1e-9)
    for name, power in (("wear", orbit.sliding_power), ("energy", orbit.drive_power)):
        # J in an hour, over the m3 in an hour; the chamber's width has four digits.
        value = 3600 * float(power) / float(CrushingChamber().capacity(27.0))
        assert float(quiet[f"{name}, J/m3"]) == pytest.approx(value, rel=1e-4)


def test_a_motion_without_an_orbit_has_means_and_the_scatter_of_its_peaks(both):
    screen, (_, loud), folder = both
    assert loud["numbers of"] == "mean of turns 3 to 5"
    scene = jc.paper_scene(30.0, 0.06e-3, load_law="closing_stroke")
    result = jc.statistics(scene, 2, 3, outputs=("foundation_peak",))
    # Both take the same steps: what else is computed does not choose them.
    assert float(loud["foundation_peak, N"]) == pytest.approx(
        float(result.foundation_peak), rel=1e-9
    )
    assert screen.count("median over turns") == 3
    # Speed and clearance are no numbers of the machine, of which the PE250x400 has 22.
    assert loud["numbers left to the PE250x400"] == "22" and "numbers left" in screen
    assert (folder / "compare.png").stat().st_size > 10_000


def test_a_number_that_no_machine_has_is_not_drawn():
    numbers = dict.fromkeys(QUANTITIES, 1.0)
    smooth = Compared("a", numbers | {"wear": math.nan}, {}, "x", "inside")
    titles = [ax.get_title() for ax in draw([smooth]).axes]
    assert len(titles) == len(DRAWN) - 1 and not any("wear" in title for title in titles)
    rubs = replace(smooth, numbers=numbers)
    assert len(draw([smooth, rubs]).axes) == len(DRAWN)


@pytest.mark.parametrize("without", [{"joint": "ideal"}, {"friction": 0.0}])
def test_a_machine_without_friction_is_compared_and_does_not_wear(without):
    found = compared("smooth", jc.paper_machine(**without, speed=27.0), 2, 3)
    assert found.motion == "periodic orbit"
    assert math.isnan(found.numbers["clearance"]) == ("joint" in without)
    assert [name for name in (*CALLED, *PER_VOLUME) if math.isnan(found.numbers[name])] == ["wear"]


def test_the_orbit_of_a_rough_feed_is_that_of_its_mean_load():
    found = compared("rough", jc.paper_machine(joint="ideal", load_scatter=0.1), 0, 2)
    assert found.motion == "periodic orbit under the mean load"


def test_capacity_in_tonnes():
    numbers = dict.fromkeys(QUANTITIES, 1.0) | {"clearance": math.nan, "capacity": 7.5}
    one = Compared("a", numbers, {}, "x", "inside")
    assert table_rows([one], None)[4] == ("  vertical over horizontal", "1")
    rows = dict((row[0] + row[1][-3:], row[1]) for row in table_rows([one], 1600.0))
    assert rows["capacityt/h"] == "12 t/h" and rows["radial clearancelue"] == "no value"


PUMP = Path(__file__).parents[2] / "examples" / "pump.toml"


@pytest.mark.parametrize(
    ("names", "density", "told"),
    [
        ((), None, "`scenes` must name at least one file"),
        (("a/x.toml", "b/x.toml"), None, "`scenes` must have names of their own"),
        (("a/x.toml",), "1.6", "`bulk_density` must be a quoted quantity"),
        (("a/x.toml",), "0 t/m3", "`bulk_density` must be > 0"),
        ((PUMP,), None, "`scenes` must be files of crushers, which alone are compared, but is"),
    ],
)
def test_bad_requests(tmp_path, names, density, told):
    with pytest.raises(ValueError, match=told):
        files = tuple(tmp_path / name for name in names)
        run(Compare(files, bulk_density=density, results=Results("x", tmp_path)), Console())

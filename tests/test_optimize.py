"""The design search, end to end on a small box, and what it refuses."""

import copy
import io
import json
import subprocess
import sys

import numpy as np
import pytest
import xarray as xr
from rich.console import Console

from optimize import search
from optimize.options import Options
from optimize.report import print_table, write_json
from optimize.run import run

SMALL = dict(grid=(4, 2), settle=2, turns=2, steps=6, refine=1)


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    out = tmp_path_factory.mktemp("results")
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
    assert result["ideal"]["foundation_rms"] <= optimum["foundation_rms"] * 1.003
    assert result["box"]["speed"] == [25.0, 40.0]
    assert all(
        {"name", "verdict", "passed", "detail"} <= check.keys() for check in result["checks"]
    )
    assert result["refinement"]["gradient_at_best"]["speed"] > 0
    assert returned["optimum"] == optimum
    assert 0 < optimum["runs"]["contact"]["validity"]["half_width_ratio"] < 0.5


def test_closing_table_names_what_is_outside_the_model(finished):
    _, result = finished
    console = Console(record=True, quiet=False, file=io.StringIO(), width=200)
    outside = copy.deepcopy(result)
    outside["optimum"]["runs"]["centred"]["validity"]["half_width_ratio"] = 1.8
    print_table(console, outside)
    text = console.export_text()
    assert "optimum: OUTSIDE the contact model: centred start, contact 1.80 bore radii" in text
    assert "paper's choice: inside the contact model" in text


def test_landscape_is_labelled(finished):
    folder, _ = finished
    with xr.open_dataset(folder / "landscape.nc") as landscape:
        assert landscape.foundation_rms.dims == ("speed", "start", "clearance") or set(
            landscape.foundation_rms.dims
        ) == {"speed", "start", "clearance"}
        assert landscape.speed.attrs["units"] == "rad/s"
        assert landscape.sizes["speed"] == 4
        assert np.isfinite(landscape.foundation_rms).all()
    for name in ("landscape", "capacity", "motion"):
        assert (folder / f"{name}.png").stat().st_size > 10_000


def test_same_command_same_answer(finished, tmp_path):
    _, first = finished
    second = run(Options(out=tmp_path, name="again", **SMALL), Console(quiet=True))
    assert second["optimum"] == first["optimum"]
    assert second["refinement"] == first["refinement"]


def test_whirl_and_failure_rank_as_nothing():
    rms = xr.DataArray([[[2.0, 1.0, 3.0]], [[2.0, 1.0, 3.0]]], dims=("start", "speed", "clearance"),
                       coords={"speed": [30.0], "clearance": [1e-5, 2e-5, 3e-5]})  # fmt: skip
    false = xr.zeros_like(rms, dtype=bool)
    whirl, success = false.copy(), ~false
    whirl[0, 0, 1] = True
    landscape = xr.Dataset({"foundation_rms": rms, "whirl": whirl, "success": success})
    assert search.best_cells(search.worst(landscape), 1) == [(30.0, 1e-5)]
    landscape["success"][1, 0, 0] = False
    assert search.best_cells(search.worst(landscape), 3) == [(30.0, 3e-5)]


@pytest.mark.parametrize(
    "change, name",
    [({"speed": (40.0, 25.0)}, "speed"), ({"clearance": (0.1, 0.1)}, "clearance"),
     ({"clearance": (0.03, 200.0)}, "clearance"), ({"speed": (0.0, 1.0)}, "speed"),
     ({"grid": (1, 5)}, "grid"), ({"friction": -0.1}, "friction"),
     ({"impact_velocity": 0.0}, "impact_velocity")],
)  # fmt: skip
def test_bad_options(change, name, tmp_path):
    with pytest.raises(ValueError, match=f"^Argument `{name}` must") as error:
        run(Options(out=tmp_path, **change), Console(quiet=True))
    assert "\n" not in str(error.value)


def test_folder_that_cannot_be_written(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(ValueError, match=r"^Argument `out` must be a folder that can be written"):
        run(Options(out=tmp_path / "file"), Console(quiet=True))


def test_interruption_leaves_what_was_finished(tmp_path, monkeypatch):
    def interrupt(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(search, "refine", interrupt)
    with pytest.raises(KeyboardInterrupt):
        run(Options(out=tmp_path, name="cut", **SMALL), Console(quiet=True))
    assert json.loads((tmp_path / "cut" / "result.json").read_text())["status"] == "interrupted"
    assert (tmp_path / "cut" / "landscape.nc").exists()


def test_json_has_no_nan(tmp_path):
    write_json(tmp_path / "x.json", {"a": [float("nan"), 1.0], "b": {"c": float("inf")}})
    assert json.loads((tmp_path / "x.json").read_text()) == {"a": [None, 1.0], "b": {"c": None}}


def test_command_line_error_is_one_line():
    done = subprocess.run(
        [sys.executable, "-m", "optimize.run", "--speed", "40", "25"],
        capture_output=True, text=True, timeout=120, check=False,
    )  # fmt: skip
    assert done.returncode == 2
    assert done.stdout.strip().count("\n") == 0 and "`speed`" in done.stdout

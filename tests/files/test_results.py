"""Files are written whole or not at all."""

import json
import os
import resource
from dataclasses import asdict, dataclass

import matplotlib.pyplot as plt
import numpy as np
import pytest
import xarray as xr
from scipy.io import loadmat

from jaxcrusher.files import results
from jaxcrusher.files.durable import writing
from jaxcrusher.files.table import as_csv
from tests.tables import read_table


def test_writers_at_one_time_do_not_meet(tmp_path):
    """Of one file, and of two that differ in their suffix."""
    names = ("a.json", "a.nc", "a.json")
    with (
        writing(tmp_path / names[0]) as first,
        writing(tmp_path / names[1]) as second,
        writing(tmp_path / names[2]) as third,
    ):
        for path, text in zip((first, second, third), "123", strict=True):
            path.write_text(text)
    # The last to end was the first to begin.
    assert (tmp_path / "a.json").read_text() == "1" and (tmp_path / "a.nc").read_text() == "2"
    assert sorted(os.listdir(tmp_path)) == ["a.json", "a.nc"]


def test_a_failed_writer_leaves_what_was_there(tmp_path):
    path = tmp_path / "a.json"
    path.write_text("before")
    with pytest.raises(ZeroDivisionError), writing(path) as partial:
        partial.write_text("half")
        _ = 1 / 0
    assert path.read_text() == "before" and os.listdir(tmp_path) == ["a.json"]


def test_a_full_disk_is_told_with_the_file(tmp_path):
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (10, limits[1]))
    try:
        with pytest.raises(OSError, match=r"a\.txt: File too large"):
            results.write_text(tmp_path / "a.txt", 100 * "x")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize("suffix", ["txt", "json", "nc", "mat", "csv", "png"])
def test_every_file_is_on_the_disk_before_it_takes_its_place(tmp_path, monkeypatch, suffix):
    path = tmp_path / f"a.{suffix}"
    synced = []
    fsync = os.fsync
    monkeypatch.setattr(os, "fsync", lambda fd: (synced.append(os.fstat(fd)), fsync(fd)))
    write = {
        "txt": lambda: results.write_text(path, "±"),
        "json": lambda: results.write_json(path, {"a": 1}),
        "nc": lambda: results.write_netcdf(path, xr.Dataset({"a": ("x", [True, False])})),
        "mat": lambda: results.write_mat(path, xr.Dataset({"a": ("x", [True, False])})),
        "csv": lambda: results.write_table(path, [{"a": 1}]),
        "png": lambda: results.write_figure(path, plt.figure()),
    }
    write[suffix]()
    assert [(stat.st_ino, stat.st_size) for stat in synced] == [
        (path.stat().st_ino, path.stat().st_size)
    ]
    assert os.listdir(tmp_path) == [path.name]
    # As any file of this user, not one of his own only.
    (tmp_path / "plain").write_text("")
    assert path.stat().st_mode == (tmp_path / "plain").stat().st_mode


def test_matlab_reads_columns_words_and_units(tmp_path):
    force = ("angle", [1.0, 2.5], {"units": "N"})
    table = xr.Dataset({"force": force, "found": ("angle", np.array(["a", "bc"], object))})
    results.write_mat(tmp_path / "x.mat", table.assign_coords(angle=[0, 1]))
    read = loadmat(tmp_path / "x.mat", simplify_cells=True)
    np.testing.assert_array_equal(read["force"], [1.0, 2.5])
    np.testing.assert_array_equal(read["angle"], [0, 1])
    assert list(read["found"]) == ["a", "bc"]
    assert read["units"] == {"angle": "1", "force": "N", "found": "1"}


def test_matlab_knows_names_axes_and_origin(tmp_path):
    """MATLAB's names have no dots; of equally long axes the order must be told."""
    force = (("speed", "elbow.clearance"), np.eye(2), {"units": "N", "long_name": "a force"})
    table = xr.Dataset({"force": force}, attrs={"title": "a sweep", "turns": 3})
    play = ("elbow.clearance", [1e-5, 2e-5], {"units": "m"})
    table = table.assign_coords({"speed": [25.0, 30.0], "elbow.clearance": play})
    results.write_mat(tmp_path / "x.mat", table)
    read = loadmat(tmp_path / "x.mat", simplify_cells=True)
    assert list(read["elbow_clearance"]) == [1e-5, 2e-5]
    assert read["units"] == {"force": "N", "speed": "1", "elbow_clearance": "m"}
    assert read["dims"]["force"] == "speed, elbow_clearance"
    assert read["long_names"]["force"] == "a force"
    assert read["attributes"] == {"title": "a sweep", "turns": 3}


def test_json_has_no_nan_and_no_arrays(tmp_path):
    content = {"a": [np.nan, 1.0], "b": {"c": np.inf}, "d": np.arange(2), "e": np.float64(2)}
    results.write_json(tmp_path / "x.json", content)
    assert json.loads((tmp_path / "x.json").read_text()) == {
        "a": [None, 1.0],
        "b": {"c": None},
        "d": [0, 1],
        "e": 2.0,
    }


def test_rows_of_a_table_may_lack_columns(tmp_path):
    results.write_table(tmp_path / "x.csv", [{"a": 1, "b": "p, q"}, {"b": 2, "c": 3}], "why")
    assert (tmp_path / "x.csv").read_bytes() == b'# why\na,b,c\r\n1,"p, q",\r\n,2,3\r\n'


@dataclass
class Measured:
    name: str
    seconds: float
    steps: int | None = None


def test_table_is_read_as_it_was_written(tmp_path):
    rows = [Measured("a, b", 0.1 + 0.2, 3), Measured("", np.inf)]
    results.write_table(tmp_path / "x.csv", map(asdict, rows), "where")
    assert read_table(tmp_path / "x.csv", Measured) == rows


def test_a_table_as_csv_has_a_row_a_cell_and_units_in_its_headings():
    """The components of a vector are columns, and the row's number is none."""
    axes = {"speed": ("speed", [25.0, 30.0], {"units": "rad/s"}), "direction": ["x", "y"]}
    force = (("speed", "direction"), [[1.0, 2.0], [3.0, 4.0]], {"units": "N"})
    success = ("speed", [True, False], {"units": "1"})
    found = as_csv(xr.Dataset({"force": force, "success": success}, axes))
    assert found.splitlines() == [
        "speed [rad/s],force_x [N],force_y [N],success",
        "25.0,1.0,2.0,True",
        "30.0,3.0,4.0,False",
    ]


def test_only_files_that_exist_are_listed(tmp_path):
    (tmp_path / "b.csv").touch()
    assert results.listed(tmp_path, ("a.csv", "b.csv")) == str(tmp_path / "b.csv")

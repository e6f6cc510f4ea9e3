"""What runs that were killed are judged by: the files that they leave."""

import json

import pytest

from benchmarks.kills.run import Ended, differ, left


@pytest.fixture
def folders(tmp_path):
    """Two runs alike but for their time, their place and their lock."""
    for number, time in ((1, "2026-01-01T10:00:00"), (2, "2026-02-03T11:12:13")):
        folder = tmp_path / f"run-{number:04}"
        folder.mkdir()
        (folder / "lock").write_text(f"process {number}")
        (folder / "c.0").write_bytes(b"\0\1\2")
        content = {"seconds": number, "rows": [{"rms": 1.5, "seconds": number}], "made": time}
        (folder / "rows.json").write_text(json.dumps(content))
    return tmp_path / "run-0001", tmp_path / "run-0002"


def test_runs_differ_by_what_they_hold(folders):
    one, other = folders
    assert {*left(one)} == {"c.0", "rows.json"} and differ(left(one), left(other)) == []
    (other / "c.0").write_bytes(b"\0\1\3")
    rows = (other / "rows.json").read_text()
    (other / "rows.json").write_text(rows.replace("1.5", "1.5000000000000002"))
    (other / "half.partial").write_text("")
    assert differ(left(one), left(other)) == ["c.0", "rows.json", "half.partial"]
    assert differ(left(one), left(other), ("c.0",)) == ["rows.json", "half.partial"]


@pytest.mark.parametrize(
    ("status", "said", "clear"),
    [
        (0, "", True),
        (2, "error: No space left.\n", True),
        (2, "", False),
        (1, "Traceback (most recent call last):\n  ...\nOSError: full\n", False),
        (2, "error: one\nerror: two\n", False),
    ],
)
def test_a_run_that_ends_early_says_why_in_one_line(status, said, clear):
    assert Ended(status, said).clear == clear

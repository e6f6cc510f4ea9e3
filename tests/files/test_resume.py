"""Work goes on only with the same settings."""

import pytest

from jaxcrusher.files.results import write_json
from jaxcrusher.files.resume import begin_beside, earlier

SETTINGS = {"turns": 5, "scene": {"speed": 30.0, "start": "contact"}, "width": (1, 2)}
SETTINGS |= {"phase": float("nan")}  # of a measurement without one


def test_the_same_settings_find_what_is_there(tmp_path):
    path = tmp_path / "x.json"
    assert earlier(path, SETTINGS, "name") is None
    write_json(path, {"settings": SETTINGS, "rows": [1]})
    kept = earlier(path, SETTINGS, "name")
    assert kept is not None and kept["rows"] == [1]


def test_what_differs_is_named(tmp_path):
    path = tmp_path / "x.json"
    write_json(path, {"settings": SETTINGS})
    others = {**SETTINGS, "scene": {"speed": 31.0, "start": "contact"}, "rtol": 1e-9}
    with pytest.raises(ValueError) as error:
        earlier(path, others, "name")
    assert str(error.value) == (
        f"Argument `name` must be new for other settings, but {path} has results of "
        "scene.speed 30 (now 31), rtol none (now 1e-09). "
        "Choose another, or delete it."
    )


@pytest.mark.parametrize("text", ["{", "[]", "{}", '{"settings": 3}'])
def test_a_file_that_cannot_be_read_is_named(text, tmp_path):
    path = tmp_path / "x.json"
    path.write_text(text)
    with pytest.raises(ValueError, match=r"^Argument `name` must be that of a run that can be rea"):
        earlier(path, SETTINGS, "name")


def test_results_of_other_settings_are_kept_beside_and_told(tmp_path, capsys):
    """The folder and those above it are made, and a run of the same settings moves nothing."""
    folder = tmp_path / "of" / "mine"
    mat = False
    for turns, told in ((5, ""), (5, ""), (6, "1"), (7, "2")):
        begin_beside(folder, {"turns": turns}, "*.csv", spared=["motion.mat"])
        assert not list(folder.glob("*.csv"))
        # What this run does not write stays only if the settings are the same.
        assert (folder / "motion.mat").exists() == (turns == 5 and mat)
        (folder / "motion.mat").touch()
        mat = True
        (folder / "rows.csv").write_text(f"{turns}")
        words = f"{folder}: results of other settings are kept in {folder}/earlier/{told}.\n"
        assert capsys.readouterr().err == (words if told else "")
    assert (folder / "earlier" / "1" / "rows.csv").read_text() == "5"
    assert (folder / "earlier" / "2" / "rows.csv").read_text() == "6"

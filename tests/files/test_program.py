"""How a program ends."""

import pytest

from jaxcrusher.files.program import keeping, program


@pytest.mark.parametrize(
    ("raised", "status", "told"),
    [
        # Nothing in it is taken for a style of the console's.
        (
            ValueError("Argument `x` must be 1, but is '5 [hz]'."),
            2,
            "error: Argument `x` must be 1, but is '5 [hz]'.",
        ),
        (ModuleNotFoundError("", name="numba"), 2, "error: numba is missing; the extra `bench` "),
        (KeyboardInterrupt("kept in out/"), 130, "interrupted: kept in out/"),
        (None, 0, ""),
    ],
)
def test_an_error_is_one_line_and_a_status(raised, status, told, monkeypatch, capsys):
    monkeypatch.setattr("sys.argv", ["measure"])

    def main() -> int:
        """Measure."""
        if raised is not None:
            raise raised
        return 0

    with pytest.raises(SystemExit) as end:
        program(main, prepare=None)
    said = capsys.readouterr().err
    assert end.value.code == status and said.startswith(told) and said.count("\n") == bool(told)


def test_an_interrupted_program_names_what_is_finished(tmp_path):
    for name in ("sweep.csv", "settings.json", "motion.nc.partial"):
        (tmp_path / name).write_text("")
    with pytest.raises(KeyboardInterrupt, match=rf"is in {tmp_path}/: sweep.csv$"):
        with keeping(tmp_path):
            raise KeyboardInterrupt
    with pytest.raises(KeyboardInterrupt, match=r"^nothing was written$"):
        with keeping(tmp_path / "none"):
            raise KeyboardInterrupt


def test_an_error_that_nobody_foresaw_shows_where_it_is_from(monkeypatch):
    monkeypatch.setattr("sys.argv", ["measure"])

    def main() -> int:
        """Measure."""
        raise AssertionError("a fault of the program")

    with pytest.raises(AssertionError, match="a fault of the program"):
        program(main, prepare=None)

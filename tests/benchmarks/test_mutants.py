"""Faults that are put into sources: each is one, and stays in its place."""

import ast

import pytest

from benchmarks.mutants import run
from benchmarks.mutants.faults import faults
from benchmarks.mutants.run import KILLED, ROOT, SURVIVED, files_for, room, sample

SOURCE = b'''"""Text, whose numbers 1 + 2 stay."""
from math import pi


def found(x: "Float[Array, 3]", y: float = 0.5) -> float:
    if x < 1 and not y:
        y -= abs(x - 2.0)
    else:
        print(x, y)
    return max(x, y) if x is None else -x * f"{1 + 1}"
'''


def test_every_fault_is_another_program():
    """It parses, it differs, and what stands around it is as it was."""
    whole = ast.dump(ast.parse(SOURCE))
    found = list(faults("x.py", SOURCE))
    for fault in found:
        changed = fault.put_into(SOURCE)
        assert ast.dump(ast.parse(changed)) != whole, fault
        assert changed.startswith(SOURCE[: fault.begin])
        assert changed.endswith(SOURCE[fault.end :])
    names = {fault.name.partition(": ")[2] for fault in found}
    assert len(names) == len(found)
    assert {
        "constant: 0.5 -> (0.51)",
        "comparison: x < 1 -> (x <= 1)",
        "boolean: x < 1 and not y -> (x < 1 or not y)",
        "sign: not y -> (y)",
        "statement: y -= abs(x - 2.0) -> pass",
        "arguments: print(x, y) -> (print(y, x))",
        'branches: max(x, y) if x is None else -x * f"{1 + 1}" -> '
        "(-x * f'{1 + 1}' if x is None else max(x, y))",
    } <= names
    # Neither texts nor annotations nor what a text is put together of.
    assert not any("Array" in name or ": 1 + " in name for name in names)


@pytest.mark.parametrize(
    ("path", "first"),
    [
        ("jaxcrusher/joint/friction.py", "tests/joint/test_friction.py"),
        ("jaxcrusher/crusher/loads.py", "tests/crusher/test_loads.py"),
        ("jaxcrusher/commands/orbit.py", "tests/whole/test_commands.py"),
        ("optimize/balance/study.py", "tests/optimize/test_balance.py"),
    ],
)
def test_the_mirrored_tests_come_first(path, first):
    files = files_for(path, ROOT)
    assert files[0] == first and len(files) > 1 and len(set(files)) == len(files)


def test_a_sample_is_drawn_again_and_has_all_kinds():
    drawn = sample(3, 30, ("joint", "files"))
    assert drawn == sample(3, 30, ("joint", "files")) != sample(4, 30, ("joint", "files"))
    assert {room(fault.path) for fault in drawn} == {"joint", "files"}
    assert len({fault.kind for fault in drawn}) == 9 and len(set(drawn)) == 30


@pytest.mark.parametrize(("seen", "found"), [(True, KILLED), (False, SURVIVED)])
def test_a_test_that_fails_without_the_fault_too_kills_nothing(tmp_path, monkeypatch, seen, found):
    """And the one behind it has its say."""
    source = b"half = 3 / 2\n"
    (tmp_path / "joint").mkdir()
    (tmp_path / "joint/halves.py").write_bytes(source)
    fault = next(one for one in faults("joint/halves.py", source) if one.kind == "arithmetic")
    sick, sound = "tests/joint/test_halves.py::test[a b]", "tests/joint/test_halves.py::test_sound"

    def pytest_run(files, tree, seconds, left_out=()):
        fails = (
            [sick] if (tmp_path / fault.path).read_bytes() == source or not seen else [sick, sound]
        )
        fails = [one for one in fails if one not in left_out and files in (files_here, [one])]
        return (1, f"FAILED {fails[0]} - assert 1 == 2\n") if fails else (0, "2 passed")

    files_here = ["tests/joint/test_halves.py"]
    monkeypatch.setattr(run, "files_for", lambda path, tree: files_here)
    monkeypatch.setattr(run, "run_tests", pytest_run)
    passing: dict[str, bool] = {}
    row = run.verdict(fault, tmp_path, 60, passing)
    assert (row["verdict"], row["by"]) == (found, sound if seen else "")
    assert passing == ({sick: False, sound: True} if seen else {sick: False})
    assert (tmp_path / fault.path).read_bytes() == source

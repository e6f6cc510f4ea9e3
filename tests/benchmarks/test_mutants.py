"""Faults that are put into sources: each is one, and stays in its place."""

import ast
import contextlib

import pytest

from benchmarks.mutants import run
from benchmarks.mutants.faults import Fault, faults
from benchmarks.mutants.run import (
    KILLED,
    LATE,
    LATELY,
    ROOT,
    SURVIVED,
    Judge,
    ordered,
    room,
    sample,
)

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
        ("optimize/ask/sets.py", "tests/optimize/test_sets.py"),
    ],
)
def test_the_mirrored_tests_come_first(path, first):
    fault = Fault(path, 1, "", 0, 0, "", "")
    files = [test.partition("::")[0] for test in ordered(fault, ROOT, {})]
    assert files[0] == first and len(set(files)) > 1


SOURCE_OF_A_ROOM = b"""def _half(x):
    return x / 2


def quarter(x):
    return _half(x) / 2


def double(x):
    return 2 * x
"""
TESTS = """from joint.halves import double, quarter


def test_dear():
    assert quarter(8) == 2


def test_cheap():
    assert quarter(4) == 1


def test_other():
    assert double(2) == 4
"""
SLOW_TEST = """import pytest

from joint.halves import double


@pytest.mark.slow
def test_slow():
    assert double(3) == 6
"""


@pytest.fixture
def tree(tmp_path):
    """Return a room with a source and two files of tests."""
    for folder in ("joint", "tests/joint"):
        (tmp_path / folder).mkdir(parents=True)
    (tmp_path / "joint/halves.py").write_bytes(SOURCE_OF_A_ROOM)
    (tmp_path / "tests/joint/test_halves.py").write_text(TESTS)
    (tmp_path / "tests/joint/test_all.py").write_text("def test_quarter():\n    pass\n")
    return tmp_path


def test_those_that_name_a_place_come_first_and_of_them_the_cheapest(tree):
    """A name that begins with an underscore is known by what uses it."""
    own = "tests/joint/test_halves.py::test_"
    costs = {f"{own}dear": 9.0, f"{own}cheap": 2.0, f"{own}other": 0.1}
    found = ordered(Fault("joint/halves.py", 2, "", 0, 0, "", ""), tree, costs)
    other = "tests/joint/test_all.py::test_quarter"
    assert found == [f"{own}cheap", f"{own}dear", f"{own}other", other]
    found = ordered(Fault("joint/halves.py", 10, "", 0, 0, "", ""), tree, costs)
    assert found[0] == f"{own}other"


@pytest.mark.slow
def test_pytest_in_a_copy_of_a_process_tells_faults_apart(tree):
    """A fault is seen or not, tests that compute for ever are stopped, and costs are kept."""
    (tree / "benchmarks").symlink_to(ROOT / "benchmarks")
    every = [f for f in faults("joint/halves.py", SOURCE_OF_A_ROOM) if f.kind == "arithmetic"]
    half, quarter, double = sorted(every, key=lambda fault: fault.line)
    (tree / "tests/joint/test_halves.py").write_text(TESTS.replace("double(2) == 4", "True"))
    with contextlib.closing(Judge(tree, 60.0, {}, modules=())) as judge:
        assert judge.verdict(half)["verdict"] == KILLED
        row = judge.verdict(quarter)
        assert (row["verdict"], row["by"]) == (KILLED, "tests/joint/test_halves.py::test_cheap")
        assert judge.verdict(double)["verdict"] == SURVIVED
        (tree / "tests/joint/test_all.py").write_text(SLOW_TEST)
        row = judge.verdict(double)
        assert (row["verdict"], row["by"]) == (LATELY, "tests/joint/test_all.py::test_slow")
        judge.seconds = 1.0
        (tree / "tests/joint/test_all.py").write_text(
            "def test_all():\n    while True:\n        pass"
        )
        assert judge.verdict(double)["verdict"] == LATE
    assert (tree / "joint/halves.py").read_bytes() == SOURCE_OF_A_ROOM
    assert judge.process is not None and judge.process.wait(60) != 0


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
    room_s = ["tests/joint/test_halves.py::test", sound]

    def pytest_run(judge, tests, left_out=(), tier=""):
        whole = (tmp_path / fault.path).read_bytes() == source
        fails = [sick] if whole or not seen else [sick, sound]
        fails = [one for one in fails if one not in left_out and tests in (room_s, [one])]
        return (1, f"FAILED {fails[0]} - assert 1 == 2\n") if fails else (0, "2 passed")

    monkeypatch.setattr(run, "ordered", lambda fault, tree, costs: room_s)
    monkeypatch.setattr(Judge, "run", pytest_run)
    judge = Judge(tmp_path, 60, {})
    row = judge.verdict(fault)
    assert (row["verdict"], row["by"]) == (found, sound if seen else "")
    assert judge.passing == ({sick: False, sound: True} if seen else {sick: False})
    assert (tmp_path / fault.path).read_bytes() == source

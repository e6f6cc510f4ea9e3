"""Every program answers --help at once, refuses what it does not know, and ends in one line."""

import os
import resource
import subprocess
from pathlib import Path

import pytest

from tests.pairs import slow
from tests.processes import ended

ROOT = Path(__file__).parents[2]
PROGRAMS = sorted(
    path.relative_to(ROOT)
    for folder in ("jaxcrusher", "optimize", "benchmarks", "docs")
    for path in (ROOT / folder).rglob("*.py")
    if '\nif __name__ == "__main__":' in path.read_text()
)


def start(path: Path) -> list[str]:
    """How a program is called."""
    if path.parts[0] == "docs":
        return [str(ROOT / path)]
    return ["-m", ".".join(path.with_suffix("").parts).removesuffix(".__main__")]


@pytest.fixture
def run(tmp_path):
    """A process in a folder of its own, for which `import jax` does what `jax` says."""

    def run(*words: str, jax: str, **environment: str) -> subprocess.CompletedProcess[str]:
        (tmp_path / "jax.py").write_text(jax)
        paths = os.pathsep.join([str(tmp_path), str(ROOT)])
        inherited = os.environ | {"PYTHONPATH": paths}
        return ended(*words, cwd=tmp_path, env=inherited | environment)

    return run


NO_JAX = "raise AssertionError('JAX is imported')"


def test_programs_are_found():
    assert len(PROGRAMS) >= 10


@pytest.mark.parametrize(
    "path",
    [path if path.parts[0] != "benchmarks" else slow(path)[0] for path in PROGRAMS],
    ids=lambda path: " ".join(start(path)[-1:]),
)
def test_help_comes_at_once_and_what_is_unknown_is_refused(path, run):
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = run(*start(path), "--help", jax=NO_JAX)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("usage: python ") and done.stderr == ""
    assert "options options" not in done.stdout
    # Of the processor, so that a busy machine does not count; it takes about 0.4 s.
    assert after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime < 2
    done = run(*start(path), "--no-such-option", jax=NO_JAX)
    assert done.returncode == 2 and done.stdout == ""
    assert done.stderr.startswith("error: ") and done.stderr.count("\n") == 1
    assert "--help tells all" in done.stderr


@pytest.mark.parametrize(
    "words",
    [
        ("jaxcrusher", "simulate"),
        ("optimize.run",),
        ("jaxcrusher", "compare"),
        ("benchmarks.reproduction",),
    ],
    ids=" ".join,
)
def test_ctrl_c_during_the_imports_is_one_line(words, run):
    done = run("-m", *words, jax="raise KeyboardInterrupt")
    assert done.returncode == 130 and done.stdout == ""
    assert done.stderr == "interrupted\n"


def test_missing_package_is_one_line(run):
    done = run("-m", "benchmarks.reproduction", jax="import no_such_package")
    assert done.returncode == 2 and done.stdout == ""
    assert done.stderr == (
        "error: no_such_package is missing; the extra `bench` has all: pip install "
        "'jaxcrusher[bench]'.\n"
    )


def test_developers_see_where_an_error_is_from(run):
    done = run("-X", "dev", "-m", "benchmarks.reproduction", jax="raise ValueError('here')")
    assert done.returncode == 1 and done.stderr.endswith("ValueError: here\n")
    assert "Traceback" in done.stderr and "jax.py" in done.stderr


def test_console_of_another_encoding_loses_signs_only(run, tmp_path):
    (tmp_path / "program.py").write_text(
        "from rich.console import Console\n"
        "from jaxcrusher.files.program import program\n"
        "def main() -> None:\n"
        "    '''Print ±.'''\n"
        "    print('1 ± 2 m³')\n"
        "    Console().print('3 ± 4')\n"
        "    raise ValueError('Hénon')\n"
        "program(main, prepare=None)\n"
    )
    done = run("program.py", jax=NO_JAX, PYTHONIOENCODING="ascii")
    assert (done.stdout, done.stderr) == ("1 ? 2 m?\n3 ? 4\n", "error: H?non\n")
    assert done.returncode == 2
    assert run("program.py", "--help", jax=NO_JAX, PYTHONIOENCODING="ascii").returncode == 0

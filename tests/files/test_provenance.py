"""What is kept of where a result comes from."""

import json
import os
import re
import shlex
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from jaxcrusher.files.provenance import PACKAGES, environment, provenance

PRINT = "from jaxcrusher.files.provenance import command; print(command())"


@pytest.mark.parametrize("how", ["script.py", "-m script", "-W error script.py"])
def test_the_command_pasted_into_a_shell_is_the_same_command(how, tmp_path):
    (tmp_path / "script.py").write_text(PRINT)
    asked = f"python {how} --set clearance '0.06 mm' --design \"a=1, b=2\" '$HOME' '' it\\'s"

    def said(command: str) -> str:
        # The shell's `python` is the one of this test.
        path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
        done = subprocess.run(
            command,
            shell=True,
            cwd=tmp_path,
            env=os.environ | {"PATH": path},
            capture_output=True,
            text=True,
            check=True,
        )
        return done.stdout.rstrip("\n")

    first = said(asked)
    assert shlex.split(first) == shlex.split(asked)
    assert said(first) == first


def test_the_command_of_an_installed_program_is_its_name(tmp_path):
    """A script beside the interpreter is what the user calls by its name."""
    folder = tmp_path / "bin"
    folder.mkdir()
    (folder / "python").symlink_to(sys.executable)
    (folder / "crusher").write_text(PRINT)
    done = subprocess.run(
        [str(folder / "python"), str(folder / "crusher"), "a b"],
        env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout == "crusher 'a b'\n"


def test_attributes_of_a_result():
    found = provenance("A title", scene={"speed": 30.0}, turns=2)
    assert found["title"] == "A title" and found["turns"] == 2
    assert json.loads(found["scene"]) == {"speed": 30.0}
    assert json.loads(found["environment"]) == environment()
    assert found["source"].startswith("jaxcrusher ") and "devices" in found["machine"]
    # The environment of another process may have computed it.
    other = environment() | {"backend": "abacus"}
    assert json.loads(provenance("", other)["environment"])["backend"] == "abacus"


def test_a_plain_installation_has_what_results_name():
    text = (Path(__file__).parents[2] / "pyproject.toml").read_text()
    needed = tomllib.loads(text)["project"]["dependencies"]
    # jaxlib comes with jax.
    assert set(PACKAGES) <= {re.split("[<>=]", name)[0] for name in needed} | {
        "jaxcrusher",
        "jaxlib",
    }

"""What a type checker makes of the README's Python, and of the names of results."""

import ast
import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

from jaxcrusher.crusher.template import OBSERVABLES, STATISTIC
from tests.processes import ended

ROOT = Path(__file__).parents[2]


SETTINGS = {"extraPaths": [str(ROOT)], "typeCheckingMode": "standard"}


def checked(folder: Path, source: str) -> subprocess.CompletedProcess:
    """Run pyright with its own defaults, as in an editor."""
    (folder / "script.py").write_text(source)
    (folder / "pyrightconfig.json").write_text(json.dumps(SETTINGS))
    return ended("-m", "pyright", "--pythonpath", sys.executable, "--project", str(folder))


@pytest.mark.slow
def test_the_readmes_python_satisfies_pyright(tmp_path):
    blocks = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(), re.DOTALL)
    assert blocks
    done = checked(tmp_path, "\n".join(blocks))
    assert done.returncode == 0, done.stdout


MISSPELT = """
import jaxcrusher as jc

scene = jc.paper_scene(30.0, 6e-5)
jc.periodic_orbit(scene).foundation_rsm
jc.statistics(scene, 0, 1).foundation_rsm
jc.simulate(scene, [0.0, 1.0]).foundation_forc
jc.periodic_orbit(scene).foundation_rms, jc.simulate(scene, [0.0]).foundation_force
"""


@pytest.mark.slow
def test_a_misspelt_result_is_seen_by_pyright(tmp_path):
    done = checked(tmp_path, MISSPELT)
    assert re.findall(r"script.py:(\d+):.*Cannot access attribute", done.stdout) == ["5", "6", "7"]


def test_the_stub_of_results_lists_the_tables():
    tree = ast.parse((ROOT / "jaxcrusher" / "motion" / "names.pyi").read_text())
    listed = {
        one.name: [line.target.id for line in one.body]
        for one in tree.body
        if isinstance(one, ast.ClassDef)
    }
    assert listed == {"StatisticNames": list(STATISTIC), "ObservableNames": list(OBSERVABLES)}

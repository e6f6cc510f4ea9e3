"""A process set up before its first computation; one folder of compiled programs for this run."""

import atexit
import os
import shutil
import tempfile

import jaxtyping
import pytest

# Shapes and types of arguments and results are checked as the package is imported. Not yet in its
# other rooms.
ROOMS = ("basics", "joint", "crusher", "scenes", "motion", "pictures")
jaxtyping.install_import_hook(
    [f"jaxcrusher.{room}" for room in ROOMS],
    "beartype.beartype(conf=beartype.BeartypeConf(is_pep484_tower=True))",
)

import jaxcrusher as jc  # noqa: E402

# Workers, kernels of notebooks and subprocesses inherit it.
if "JAX_COMPILATION_CACHE_DIR" not in os.environ:
    os.environ["JAX_COMPILATION_CACHE_DIR"] = tempfile.mkdtemp(prefix="jaxcrusher-")
    atexit.register(shutil.rmtree, os.environ["JAX_COMPILATION_CACHE_DIR"], ignore_errors=True)
jc.set_up()


@pytest.fixture
def unchecked():
    """The package as its users have it: what it says itself of arguments of a wrong type."""
    jaxtyping.config.update("jaxtyping_disable", True)
    yield
    jaxtyping.config.update("jaxtyping_disable", False)

"""A process set up before its first computation; one folder of compiled programs for this run."""

import atexit
import gc
import itertools
import mmap
import os
import pathlib
import shutil
import tempfile

# Workers, kernels of notebooks and subprocesses inherit it; JAX reads it when it is imported.
if "JAX_COMPILATION_CACHE_DIR" not in os.environ:
    os.environ["JAX_COMPILATION_CACHE_DIR"] = tempfile.mkdtemp(prefix="jaxcrusher-")
    atexit.register(shutil.rmtree, os.environ["JAX_COMPILATION_CACHE_DIR"], ignore_errors=True)

import jax
import jaxtyping
import pytest

# Shapes and types of arguments and results are checked as the package is imported, but for what
# writes LLVM's text, and what only writes and asks.
ROOMS = "basics joint crusher scenes motion orbits batch dynamics pictures".split()
jaxtyping.install_import_hook(
    [f"jaxcrusher.{name}" for name in ROOMS],
    "beartype.beartype(conf=beartype.BeartypeConf(is_pep484_tower=True))",
)

import jaxcrusher as jc  # noqa: E402

# A test compiles longer than it computes, so it compiles without optimisation (a third of the time
# of all) unless it is marked `slow`. Four passes of XLA are left out, which took 40 % of what
# compilation is left. Two look at loops and take longest; with all optimisations programs run a
# fifth faster for them, so users have them. The third moves reshapes that another pass moves back,
# so that all passes ran 25 times over. The fourth checks XLA's own work. XLA reads the flag as JAX
# starts. Notebooks and subprocesses run as users have them.
jc.set_up()
FLAGS = os.environ["XLA_FLAGS"]
PASSES = (
    "while-loop-invariant-code-motion",
    "simplify-while-loops",
    "reshape-mover",
    "hlo-verifier",
)
os.environ["XLA_FLAGS"] = f"{FLAGS} --xla_disable_hlo_passes={','.join(PASSES)}"
jax.devices()
os.environ["XLA_FLAGS"] = FLAGS

# After it: this imports Equinox, which reads then what `set_up` tells it.
from jaxcrusher.scenes.parameters import NUMBERS, PARAMETERS  # noqa: E402


def pytest_collection_modifyitems(items):
    """Spread the notebooks over the run: side by side they compile the same programs twice."""
    files = [list(group) for _, group in itertools.groupby(items, key=lambda item: item.path)]
    notebooks = [file for file in files if file[0].path.suffix == ".ipynb"]
    order = [file for file in files if file[0].path.suffix != ".ipynb"]
    apart = len(order) // max(len(notebooks), 1)
    for i, notebook in reversed(list(enumerate(notebooks))):
        order.insert(i * apart, notebook)
    items[:] = itertools.chain.from_iterable(order)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item):
    """Its fixtures are compiled as the test is that comes first."""
    fast = item.get_closest_marker("slow") is None
    if not fast and jax.config.read("jax_disable_most_optimizations"):
        jax.clear_caches()  # JAX runs a program that it has, however that was compiled
    jax.config.update("jax_disable_most_optimizations", fast)
    return (yield)


# Compiled programs of all files together fill 24 GB of memory.
ENOUGH = 3e9


@pytest.fixture(autouse=True, scope="module")
def forget_programs():
    """Keep compiled programs for the files that follow, as long as there is memory for them."""
    yield
    memory = pathlib.Path("/proc/self/statm")
    if not memory.exists() or int(memory.read_text().split()[1]) * mmap.PAGESIZE > ENOUGH:
        jax.clear_caches()
        gc.collect()


@pytest.fixture(autouse=True)
def forget_laws():
    """Forget the numbers of a law of one's own after the test that named it."""
    tables = (PARAMETERS, NUMBERS)
    known = [dict(table) for table in tables]
    yield
    for table, before in zip(tables, known, strict=True):
        if table.keys() != before.keys():
            table.clear()
            table.update(before)


@pytest.fixture
def unchecked():
    """The package as its users have it: what it says itself of arguments of a wrong type."""
    jaxtyping.config.update("jaxtyping_disable", True)
    yield
    jaxtyping.config.update("jaxtyping_disable", False)

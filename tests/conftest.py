"""A process set up before its first computation; which tests run, and what they compile."""

import atexit
import ctypes
import gc
import itertools
import mmap
import os
import pathlib
import shutil
import tempfile
import time

import jaxtyping
import pytest

# Shapes and types of arguments and results are checked as the package is imported, but for what
# writes LLVM's text, and what only writes and asks. Rooms that the package itself calls most are
# left out, which takes a fifth off the quick tests' time: `tests/whole/test_signatures.py` asks for
# them, of the tests of these rooms alone.
ROOMS = "crusher scenes motion orbits batch dynamics identification pictures sheets".split()
CALLED_MOST, ALL_CHECKED = "basics joint mechanism".split(), "JAXCRUSHER_CHECKED" in os.environ
jaxtyping.install_import_hook(
    [f"jaxcrusher.{name}" for name in ROOMS + CALLED_MOST * ALL_CHECKED],
    "beartype.beartype(conf=beartype.BeartypeConf(is_pep484_tower=True))",
)

# Its checker of leaves is imported now: while a program is traced that import fails half-way.
isinstance(0.0, jaxtyping.PyTree[float])

import jaxcrusher as jc  # noqa: E402
from jaxcrusher.basics.setup import programs_folder  # noqa: E402

# Compiled programs are kept for the next run, and in CI for this one. JAX's keys hold the flags
# that a program is compiled with. Workers, kernels of notebooks and subprocesses inherit the
# folder; here the checks of types have imported JAX already.
if "JAX_COMPILATION_CACHE_DIR" not in os.environ:
    programs = programs_folder() / "tests"
    if "CI" in os.environ:
        programs = tempfile.mkdtemp(prefix="jaxcrusher-")
        atexit.register(shutil.rmtree, programs, ignore_errors=True)
    os.environ["JAX_COMPILATION_CACHE_DIR"] = str(programs)

import jax  # noqa: E402
import jax.numpy as jnp  # noqa: E402

jax.config.update("jax_compilation_cache_dir", os.environ["JAX_COMPILATION_CACHE_DIR"])
# A project that sets both can then call the package, as those of diffrax and optimistix can.
jax.config.update("jax_numpy_dtype_promotion", "strict")
jax.config.update("jax_numpy_rank_promotion", "raise")

# A test compiles longer than it computes, so it compiles without optimisation (a third of the time
# of all) unless it is marked `optimised`. Four passes of XLA are left out, which took 40 % of what
# compilation is left. Two look at loops and take longest; with all optimisations programs run a
# fifth faster for them, so users have them. The third moves reshapes that another pass moves back,
# so that all passes ran 25 times over. The fourth checks XLA's own work. XLA reads the flag as JAX
# starts. Subprocesses run as users have them.
jc.set_up()
atexit.register(gc.freeze)  # at the end nobody looks for garbage among all that was traced
FLAGS = os.environ["XLA_FLAGS"]
PASSES = (
    "while-loop-invariant-code-motion",
    "simplify-while-loops",
    "reshape-mover",
    "hlo-verifier",
)
FEWER_PASSES = f"{FLAGS} --xla_disable_hlo_passes={','.join(PASSES)}"
os.environ["XLA_FLAGS"] = FEWER_PASSES
jax.devices()
os.environ["XLA_FLAGS"] = FLAGS


def _slowness():
    """Return how many times as long as usual this machine takes now to trace a program.

    A busy machine takes longer, and one of many guests of a host by turns: it is asked for some
    time, and when it matters.
    """

    def many(x):
        for _ in range(300):
            x = jnp.sin(x) * x
        return x

    began = time.process_time()
    for _ in range(TRACES):
        jax.make_jaxpr(lambda x: many(x))(1.0)  # another function each time, which is traced anew
    return max(1, (time.process_time() - began) / (TRACES * USUAL))


# Seconds of the processor: 10 on an idle machine, and twice that on a busy one; on a slower machine
# as many times more as it takes for a trace that usually takes `USUAL` seconds.
TRACES, USUAL = 10, 0.015
QUICK = 20


TESTS = pathlib.Path(__file__).parent
# Files of tests of which each takes minutes.
LONGEST = (
    "notebooks/test_run.py",
    "optimize/test_search.py",
    "whole/test_docs.py",
    "scenes/test_linkages.py",
    "mechanism/test_any_linkage.py",
    "orbits/test_bifurcation_curve.py",
    "whole/test_signatures.py",
)


def pytest_addoption(parser):
    parser.addoption("--all", action="store_true", help="run slow tests too")


def pytest_collection_modifyitems(config, items):
    """Leave slow tests out unless they are named, and order the others.

    With all tests, the quick ones that `test_signatures.py` runs run there alone. Files that take
    longest come first, so that all workers end together, and `optimised` tests come last in their
    file.
    """
    named = [arg.split("::")[0] for arg in config.args if "::" in arg]
    named = {(config.invocation_params.dir / path).resolve() for path in named}
    runs_all = config.getoption("all")
    checked = any(item.path.name == "test_signatures.py" for item in items)
    elsewhere = {TESTS / room for room in CALLED_MOST} if checked else set()

    def left_out(item):
        is_slow = item.get_closest_marker("slow") is not None
        if runs_all:
            return not is_slow and item.path.parent in elsewhere
        return is_slow and item.path not in named

    config.hook.pytest_deselected(items=[item for item in items if left_out(item)])
    items[:] = [item for item in items if not left_out(item)]
    files = [
        sorted(group, key=lambda item: item.get_closest_marker("optimised") is not None)
        for _, group in itertools.groupby(items, key=lambda item: item.path)
    ]
    files.sort(key=lambda group: str(group[0].path.relative_to(TESTS)) not in LONGEST)
    items[:] = itertools.chain.from_iterable(files)


def pytest_runtest_logreport(report):
    """Say at once what failed, for a run that is stopped before its end."""
    if report.failed and "PYTEST_XDIST_WORKER" not in os.environ:
        print(f"\n{report.nodeid}\n{report.longreprtext[-1000:]}", flush=True)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item):
    """Its fixtures are compiled as the test is that comes first."""
    fast = item.get_closest_marker("optimised") is None
    if not fast and jax.config.read("jax_disable_most_optimizations"):
        jax.clear_caches()  # JAX runs a program that it has, however that was compiled
    jax.config.update("jax_disable_most_optimizations", fast)
    return (yield)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item):
    """Refuse a quick test that is slow; what it shares with others does not count."""
    before = sum(os.times()[:4])  # of this process and of those that it waited for
    result = yield
    spent = sum(os.times()[:4]) - before
    if spent > QUICK and item.get_closest_marker("slow") is None:
        if spent > (most := QUICK * _slowness()):
            reason = f"{spent:.0f} s of the processor, and a quick test takes {most:.0f} s at most"
            pytest.fail(f"{reason}: make it cheaper, or mark it `slow`.", pytrace=False)
    return result


# Compiled programs of all files together fill 24 GB of memory.
ENOUGH = 3e9


@pytest.fixture(autouse=True, scope="module")
def forget_programs():
    """Keep compiled programs for the files that follow, as long as there is memory for them."""
    yield
    memory = pathlib.Path("/proc/self/statm")
    known = memory.exists()
    if not known or int(memory.read_text().split()[1]) * mmap.PAGESIZE > ENOUGH:
        jax.clear_caches()
        gc.collect()
        if known:  # glibc keeps what is freed: memory would seem full after each file that follows
            getattr(ctypes.CDLL(None), "malloc_trim", lambda _: None)(0)


@pytest.fixture(scope="module")
def compiled_once():
    """Processes that a file's tests start compile as these do, so they read what these have.

    For a whole file: the key of a program holds the flags of the environment.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XLA_FLAGS", FEWER_PASSES)
        patch.setenv("JAX_DISABLE_MOST_OPTIMIZATIONS", "1")
        yield


@pytest.fixture
def called_most():
    """Rooms whose signatures only `tests/whole/test_signatures.py` checks, by their quick tests."""
    return CALLED_MOST


@pytest.fixture(scope="module")
def promoting():
    """JAX as its users have it, whose own functions may mix types and ranks."""
    with jax.numpy_dtype_promotion("standard"), jax.numpy_rank_promotion("allow"):
        yield


@pytest.fixture
def unchecked():
    """The package as its users have it: what it says itself of arguments of a wrong type."""
    jaxtyping.config.update("jaxtyping_disable", True)
    yield
    jaxtyping.config.update("jaxtyping_disable", False)

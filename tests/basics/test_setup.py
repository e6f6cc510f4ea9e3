"""The call that sets a process up: each case in a process of its own, which has not yet started."""

import os
import warnings

import jax
import numpy as np
import pytest

import jaxcrusher as jc
from jaxcrusher.basics import checks, devices, setup
from jaxcrusher.mechanism.observables import bearing_stiffness
from jaxcrusher.orbits.result import RESULTS, missing
from jaxcrusher.scenes.build import build_chamber
from tests.pairs import slow
from tests.processes import python

LOOP = "--xla_backend_extra_options=xla_cpu_small_while_loop_byte_threshold=262144"
FUSION = "--xla_backend_extra_options=xla_cpu_disable_new_fusion_emitters"
# From JAX 0.12 on XLA makes kernels of all loops, and there is nothing to warn of.
UNASKED = jax.__version_info__ >= (0, 12)

# Counts the programs that JAX compiles and does not find in its folder.
COUNTED = """
import warnings
import jaxcrusher as jc
jc.set_up()
import jax
missed = []
def listen(event, **_):
    if event.endswith("cache_misses"):
        missed.append(event)
jax.monitoring.register_event_listener(listen)
scene = jc.ideal_scene(30.0)
rms = jc.statistics(scene, 0, 1, outputs=("foundation_rms",), rtol=1e-6).foundation_rms
print(len(missed), float(rms).hex())
"""


def test_second_process_compiles_only_what_was_cut_off_and_finds_the_same_bits(tmp_path):
    """A killed process may leave half of a file: the next one writes it anew, and says nothing."""
    missed, bits = python(COUNTED, XDG_CACHE_HOME=str(tmp_path)).stdout.split()
    assert int(missed) > 1
    kept = max(tmp_path.rglob("*-cache"), key=lambda path: path.stat().st_size)
    whole = kept.stat().st_size
    os.truncate(kept, whole // 2)
    second = python(COUNTED, XDG_CACHE_HOME=str(tmp_path))
    assert (second.stdout.split(), second.stderr) == (["1", bits], "")
    assert abs(kept.stat().st_size - whole) < 0.01 * whole  # it holds the time that it took


# What the call leaves: flags, devices, a number's type, and how often garbage is looked for.
LEFT = """
import gc, os
import jaxcrusher as jc
BEFORE
jc.set_up()
import jax
from jaxcrusher.files.provenance import environment
print(os.environ["XLA_FLAGS"])
print(jax.device_count(), jax.numpy.ones(1).dtype, gc.get_threshold()[0])
print(environment()["versions"]["jaxcrusher"] == jc.__version__)
"""
MINE = "--xla_cpu_enable_fast_math=false"
OTHER = "--xla_backend_extra_options=xla_cpu_small_while_loop_byte_threshold=7"
THREE = "--xla_force_host_platform_device_count=3"
CORES = len(os.sched_getaffinity(0))
# A checkout that was never installed, and a bundle: no distribution of some names has metadata.
BARE = """
import importlib.metadata as metadata
found = metadata.Distribution.from_name.__func__
def but_some(kind, name):
    if name in ("jaxcrusher", "jaxlib", "llvmlite"):
        raise metadata.PackageNotFoundError(name)
    return found(kind, name)
metadata.Distribution.from_name = classmethod(but_some)
"""


@pytest.mark.parametrize(
    ("flags", "before", "expected"),
    [
        (MINE, BARE, (f"{MINE} {LOOP} {FUSION}", CORES, 50_000)),
        (f"{OTHER} {THREE}", "gc.set_threshold(90_000)", (f"{OTHER} {THREE} {FUSION}", 3, 90_000)),
        (
            MINE,
            "import jax; jax.config.update('jax_num_cpu_devices', 3); gc.set_threshold(0)",
            (f"{MINE} {LOOP} {FUSION}", 3, 0),
        ),
    ],
    ids=["not installed", "by flags", "by JAX's settings"],
)
def test_what_the_user_chose_stays(flags, before, expected, tmp_path):
    """Else a device a core, and garbage is looked for less; no error without a folder."""
    (tmp_path / "file").touch()
    program = LEFT.replace("BEFORE", before)
    done = python(program, XLA_FLAGS=flags, XDG_CACHE_HOME=str(tmp_path / "file"))
    told, left, version_is_known = done.stdout.splitlines()
    devices, kind, garbage = left.split()
    assert (told, int(devices), int(garbage)) == expected
    assert (kind, version_is_known, done.stderr) == ("float64", "True", "")


# A loop that moves some 2 kB a turn, as XLA has compiled it.
COMPILED = """
import jax, jax.numpy as jnp
IMPORT
loop = jax.jit(lambda x: jax.lax.fori_loop(0, 200, lambda _, x: jnp.sin(x) + x[::-1], x))
print("small_call" in loop.lower(jnp.ones(128)).compile().as_text())
"""


def test_loops_are_one_kernel_once_the_package_is_imported():
    """Without `set_up`, also where JAX is imported first. XLA marks such a loop as a small call."""
    said = [python(COMPILED.replace("IMPORT", line)).stdout for line in ("", "import jaxcrusher")]
    assert said == [f"{UNASKED}\n", "True\n"]


WITHOUT = """
import jax
jax.config.update("jax_enable_x64", True)
jax.numpy.ones(1)
import contextlib
import jaxcrusher as jc
for _ in range(2):
    with contextlib.suppress(ValueError):  # it looks at JAX before it looks at its arguments
        jc.simulate(None, [])
"""


def test_a_late_import_says_so_once():
    """And a late `set_up` says what to do, once too."""
    said = python(f"{WITHOUT}jc.set_up(); jc.set_up()").stderr
    flags = f"{LOOP} {FUSION} --xla_force_host_platform_device_count={CORES}"
    assert f"start Python with XLA_FLAGS='{flags}'" in said
    late = 0 if UNASKED else 1
    assert said.count("JAX had started before jaxcrusher") == late
    assert said.count("UserWarning") == 1 + late
    # The user's line, not one of the package.
    assert UNASKED or said.startswith("<string>:9: ")


@pytest.mark.slow
def test_nothing_is_said_of_loops_in_time_nor_to_who_knows_the_flag():
    assert python(WITHOUT.replace("jax.numpy.ones(1)", "")).stderr == ""
    assert python(WITHOUT, XLA_FLAGS=LOOP).stderr == ""
    # A late `set_up` has its own warning, and this one would only repeat it.
    late = WITHOUT.replace("for _", "jc.set_up()\nfor _")
    assert python(late).stderr.count("UserWarning") == 1


def test_floats_of_32_bits_are_refused():
    with jax.enable_x64(False):
        for refused in (setup.require_set_up, lambda: jc.paper_scene(30.0, 6e-5)):
            with pytest.raises(ValueError, match=r"^Argument `jax_enable_x64` must be True \(call"):
                refused()
    setup.require_set_up()


class Said(Exception):
    """A warning, before anything is compiled."""


def refuse(text: str, **_: object) -> None:
    raise Said(text)


SCENE = {"speed": 30.0, "clearance": 6e-5}


# Processes before JAX has computed, and after.
FORKED = """
import os, signal, sys, warnings
import jaxcrusher as jc
warnings.simplefilter("ignore")  # what JAX says of every fork
jc.set_up()

def fork():
    if (child := os.fork()) == 0:
        signal.alarm(120)  # in place of waiting for ever
        try:
            print(float(jc.build_scene({}).joints.at("main").clearance), flush=True)
        except ValueError as error:
            print(error, flush=True)
        os._exit(0)
    os.waitpid(child, 0)

fork()
jc.build_scene({})
fork()
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system has no fork")
def test_a_process_forked_after_jax_has_computed_is_refused():
    before, after = python(FORKED).stdout.splitlines()
    assert float(before) == 6e-5
    assert after.startswith("Argument `start_method` must be 'spawn', as of multiprocessing.get_")


COMPUTATIONS = {
    "statistics": lambda scene, _: jc.statistics(scene, 0, 1),
    "simulate": lambda scene, _: jc.simulate(scene, [0.0, 0.1]),
    "section": lambda scene, _: jc.poincare_section(scene, 0, 1),
    "orbit": lambda scene, _: jc.periodic_orbit(scene),
    "motion": lambda _, orbit: orbit.motion([0.0]),
    "state": lambda _, orbit: orbit.state(),
    "harmonics": lambda _, orbit: jc.harmonics(orbit),
    "feed": lambda _, orbit: jc.feed_response(orbit),
    "regime": lambda scene, _: jc.regime(scene),
    "modes": lambda scene, _: jc.natural_modes(scene),
    "coexisting": lambda scene, _: jc.coexisting_orbits(scene),
    "stiffness": lambda scene, _: bearing_stiffness(scene, 1e4),
    "chamber": lambda *_: build_chamber({"jaw.length": 0.7}),
    "sweep": lambda *_: jc.sweep(jc.paper_machine(), {"speed": [25.0, 30.0]}, 0, 1),
    "map": lambda scene, _: list(jc.map_chunks(abs, np.ones(3))),
    "orbit map": lambda *_: jc.orbit_map(jc.paper_machine(), {"speed": [25.0, 30.0]}),
    "basin map": lambda *_: jc.basin_map(jc.paper_machine(), {"speed": [25.0, 30.0]}),
    "branch": lambda *_: jc.orbit_branch(jc.ideal_scene, "speed", 30.0, (25.0, 35.0)),
    "bifurcation": lambda *_: jc.bifurcation(
        jc.ideal_scene, "speed", [25.0], settle_turns=0, turns=1
    ),
    "gradient": lambda *_: jc.gradient_report(jc.paper_scene, "foundation_rms", SCENE),
}
# Those that loop over time or over designs.
SLOW = ["statistics", "simulate", "section", "orbit", "regime", "coexisting", "sweep"]
SLOW += ["orbit map", "branch", "bifurcation", "gradient"]


@pytest.mark.skipif(UNASKED, reason="no loop is slow")
@pytest.mark.parametrize("name", SLOW)
def test_every_computation_tells_of_slow_loops(name, monkeypatch):
    scene = jc.paper_scene(**SCENE)
    monkeypatch.setattr(setup, "_told", set())
    monkeypatch.setenv("XLA_FLAGS", "")
    monkeypatch.setattr(warnings, "warn", refuse)
    with pytest.raises(Said, match=r"times as long\. Import it before"):
        COMPUTATIONS[name](scene, None)


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize("name", COMPUTATIONS)
def test_every_computation_refuses_such_a_process(name, monkeypatch):
    scene = jc.paper_scene(**SCENE)
    orbit = missing(scene, 1, RESULTS.not_closed)
    monkeypatch.setattr(checks, "jax_is_stuck", lambda: True)
    with pytest.raises(ValueError, match=r"^Argument `start_method` must be 'spawn'"):
        COMPUTATIONS[name](scene, orbit)


# A second platform of JAX's, which it prefers to the processor as it does a GPU; after the first
# look the user names it.
SECOND = """
from jax._src import xla_bridge
xla_bridge.register_backend_factory("second", xla_bridge.make_cpu_client, priority=1000)
import jax.numpy as jnp
from jaxcrusher.batch.engines import in_turn, side_by_side
processor = set(jax.devices("cpu"))

def look():
    ones = jnp.ones(4)
    found = ones, jax.jit(jnp.sin)(2.0), in_turn(abs, ones), side_by_side(abs, ones)
    print(*(array.devices() <= processor for array in found), len(jax.devices()))

look()
jax.config.update("jax_default_device", jax.devices()[0])
look()
"""


@pytest.mark.parametrize(
    ("first", "on_processor"),
    [
        ("jc.set_up()", True),
        *slow(
            # What the user names before the call stays too, and what JAX does by itself.
            ("jax.config.update('jax_platforms', 'second,cpu'); jc.set_up()", False),
            ("jax.config.update('jax_enable_x64', True)", False),
        ),
    ],
)
def test_computations_stay_on_the_processor(first, on_processor):
    program = f"import jax, jaxcrusher as jc, warnings\nwarnings.simplefilter('ignore')\n{first}\n"
    for said, there in zip(
        python(program + SECOND).stdout.splitlines(), (on_processor, False), strict=True
    ):
        *found, count = said.split()
        assert found == [str(there)] * 4 and int(count) >= 1


def test_platform_is_that_of_the_device_chosen():
    chosen = jax.devices("cpu")[-1]
    for device in ("cpu", chosen):
        with jax.default_device(device):
            assert devices.computes_on() == "cpu" and devices.devices() == jax.devices("cpu")


THREADS = """
import contextlib, ctypes, pathlib
import scipy.linalg, jax
import jaxcrusher as jc

jax.config.update("jax_enable_x64", True)
with contextlib.suppress(ValueError):  # of its arguments
    jc.simulate(None, [])
found = pathlib.Path(scipy.__path__[0]).parent.glob("scipy.libs/*openblas*")
print([ctypes.CDLL(str(file)).scipy_openblas_get_num_threads() for file in found])
list(jc.map_chunks(abs, jax.numpy.ones(3)))
"""


def test_without_set_up_linear_systems_take_one_thread_and_idle_cores_are_told(monkeypatch):
    """Also where SciPy, whose library JAX calls, was loaded before the package."""
    monkeypatch.delenv("OPENBLAS_NUM_THREADS", raising=False)
    done = python(THREADS)
    assert done.stdout.strip() == "[1]"
    assert done.stderr.count("cores computes: jaxcrusher.set_up()") == int(CORES > 1)

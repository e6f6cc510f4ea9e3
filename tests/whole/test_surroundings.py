"""Where a machine is computed: threads, other processes, debugging, odd folders, no home."""

import multiprocessing
import pickle
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import jax
import numpy as np
import pytest

import jaxcrusher as jc
from tests.processes import ended

FOUR_BAR = Path(__file__).parents[2] / "examples" / "four_bar.toml"
SEEN = ("B_eccentricity", "B_normal_force")
TIMES = np.linspace(0.0, 2e-3, 11)
# In the language of its user, and with the sign that parts words of a command.
FOLDER = "Größe 5 µm ß"


@pytest.fixture(scope="module")
def scene():
    return jc.read_scene(FOUR_BAR)


@pytest.fixture
def copied(tmp_path):
    folder = tmp_path / FOLDER
    folder.mkdir()
    return folder / "Gelenk.toml", (folder / "Gelenk.toml").write_text(FOUR_BAR.read_text())


def seen(scene):
    motion = jc.simulate(scene, TIMES, outputs=SEEN)
    assert bool(motion.success), motion.failure
    return [np.asarray(motion[name]) for name in SEEN]


def test_threads_find_the_same_bits():
    machine = jc.read_machine(FOUR_BAR)
    scenes = [machine.scene(speed=30.0 + i) for i in range(4)]
    alone = [seen(one) for one in scenes]
    with ThreadPoolExecutor(4) as pool:
        beside = list(pool.map(seen, scenes))
    np.testing.assert_equal(beside, alone)
    assert not np.array_equal(alone[0], alone[1])


def test_what_is_pickled_moves_alike(scene):
    copy = pickle.loads(pickle.dumps(scene))
    assert jax.tree.structure(copy) == jax.tree.structure(scene)
    np.testing.assert_equal(seen(copy), seen(scene))


def test_a_spawned_process_reads_the_same_machine_from_any_folder(scene, copied):
    spawn = multiprocessing.get_context("spawn")
    with spawn.Pool(1, jc.set_up) as pool:
        other = pool.apply(jc.read_scene, copied[:1])
    assert jax.tree.structure(other) == jax.tree.structure(scene)
    np.testing.assert_equal(*([np.asarray(x) for x in jax.tree.leaves(s)] for s in (other, scene)))


def test_a_motion_from_the_middle_of_a_bore_computes_no_nan():
    with jax.debug_nans(True):
        seen(jc.read_machine(FOUR_BAR).scene(start="centred"))


# Without assertions, and with a file where the home's folder of programs would be.
STRIPPED = """
import sys
import jaxcrusher as jc
jc.set_up()
assert False  # is stripped
scene = jc.read_scene(sys.argv[1])
print(scene.joints.names, float(scene.drive.speed))
try:
    jc.linkage(crank="crank", speed=1.0, bodies={"crank": {"mass": 1.0, "inertia": 1.0}})
except ValueError as error:
    print(error)
"""


def test_without_assertions_and_home_the_same_is_read_and_refused(copied, monkeypatch):
    path, _ = copied
    for name in ("HOME", "XDG_CACHE_HOME"):
        monkeypatch.setenv(name, str(path))
    monkeypatch.delenv("JAX_COMPILATION_CACHE_DIR", raising=False)
    done = ended("-O", "-W", "error", "-c", STRIPPED, str(path), cwd=path.parent)
    assert done.stdout.splitlines() == [
        "('B',) 31.41592653589793",
        "Argument `crank` must have a joint to the frame, but is 'crank' without one.",
    ], done.stderr

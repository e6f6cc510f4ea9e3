"""Large sweeps: what they hold, and what a kill, a full disk or a bad file does to them."""

import json
import os
import pickle
import resource
import signal
import subprocess
import sys
import time
import warnings
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import jaxcrusher as jc
from jaxcrusher.batch import engines
from jaxcrusher.batch.cluster import compute_on, worker_environment
from jaxcrusher.batch.points import Grid, make_grid
from jaxcrusher.batch.store import ChunkStore, Layout, Memory
from jaxcrusher.batch.sweep import columns_of_row, plan
from jaxcrusher.crusher.template import STATISTIC, STATISTICS
from jaxcrusher.files.table import Column
from jaxcrusher.scenes.build import Crusher
from tests.processes import ended

# The store alone is filled with made-up numbers: no JAX in it, so that it can be killed often.
AXES_OF_NUMBERS = {"speed": (28.0, 30.0, 33.0), "clearance": (4e-5, 6e-5)}
COLUMNS = columns_of_row({"main": ""}, tuple((name, STATISTIC[name]) for name in STATISTICS))
LAYOUT = Layout(Grid(AXES_OF_NUMBERS, {}, Crusher()), COLUMNS, (1, 2))
SETTINGS = {"turns": 1, "base": {"friction": 0.1}}
SIZES = (1, 900)  # bytes: inside a chunk's first file, inside its marker


def fill(path: Path, settings: dict = SETTINGS, layout: Layout = LAYOUT) -> list[int]:
    """Fill a store; returns the chunks that were missing."""
    with ChunkStore(path, layout, settings, {}) as store:
        return write_missing(store)


def write_missing(kept: ChunkStore | Memory) -> list[int]:
    """Write what is missing of three chunks."""
    written = sorted(set(range(3)) - kept.done)
    for number in written:
        random = np.random.default_rng(number)
        values = {name: random.random((1, 2)) for name in COLUMNS}
        logical = [name for name, column in COLUMNS.items() if column.kind is bool]
        kept.write(number, values | {name: values[name] > 0.5 for name in logical}, {})
    return written


def contents(path: Path) -> dict[str, bytes]:
    """Every file of a store but its lock."""
    files = {str(f.relative_to(path)): f.read_bytes() for f in path.rglob("*") if f.is_file()}
    return {name: data for name, data in files.items() if name != ".sweep/lock"}


def be_killed(folder: Path) -> None:
    """Fill stores in processes that are killed; prints how many died, and of which signal."""
    warnings.simplefilter("ignore")  # JAX is imported, but no process uses it.
    died = []
    while 0 not in died:
        # Killed later and later, until one is not.
        operation = 31 * (len(died) + 1)
        died.append(_fork(lambda at=operation: _kill_at(folder, at), folder / "often"))
    for size in SIZES:
        died.append(_fork(lambda size=size: _kill_past(size), folder / f"torn{size}"))
    print(died)


def _fork(arm: Callable[[], None], path: Path) -> int:
    """Fill a store in a process of its own; returns the signal that killed it, or 0."""
    child = os.fork()
    if child == 0:
        with ChunkStore(path, LAYOUT, SETTINGS, {}) if "torn" in path.name else nullcontext():
            pass
        arm()
        fill(path)
        os._exit(0)
    return os.WTERMSIG(os.waitpid(child, 0)[1])


def _kill_at(path: Path, operation: int) -> None:
    """Kill this process before an operation on the store's files: an open or a rename."""
    left = operation

    def hook(event: str, arguments: tuple) -> None:
        nonlocal left
        if event in ("open", "os.rename") and str(path) in str(arguments[0]):
            left -= 1
            if left == 0:
                os.kill(os.getpid(), signal.SIGKILL)

    sys.addaudithook(hook)


def _kill_past(size: int) -> None:
    """Have the kernel kill this process in a write past `size` bytes of a file."""
    signal.signal(signal.SIGXFSZ, signal.SIG_DFL)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))


@pytest.fixture(scope="module")
def killed(tmp_path_factory):
    """Stores of killed processes, the signals they died of, and the files of a whole store."""
    folder = tmp_path_factory.mktemp("killed")
    program = "from pathlib import Path; from tests.batch.test_store import be_killed; "
    done = ended("-c", f"{program}be_killed(Path('{folder}'))", cwd=Path(__file__).parents[2])
    assert done.returncode == 0, done.stderr
    fill(folder / "whole")
    return folder, json.loads(done.stdout), contents(folder / "whole")


def test_killed_before_any_file_operation(killed):
    folder, died, whole = killed
    # Making a store takes about 130 operations, a chunk about 50.
    assert died.index(0) >= 5 and set(died[: died.index(0)]) == {signal.SIGKILL}
    assert contents(folder / "often") == whole


@pytest.mark.parametrize("size", SIZES)
def test_killed_in_the_middle_of_a_write(killed, size):
    folder, died, whole = killed
    assert died[-2:] == [signal.SIGXFSZ] * 2
    torn = folder / f"torn{size}"
    assert [file.stat().st_size for file in torn.rglob("*.partial*")] == [size]
    assert fill(torn) == [0, 1, 2]
    assert contents(torn) == whole


def test_full_disk_names_the_chunk_and_loses_nothing(tmp_path):
    store, whole = tmp_path / "store", tmp_path / "whole"
    fill(whole)
    fill(store)
    (store / ".sweep/done/2.0.json").unlink()
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    # The kernel refuses the write as on a full disk, with another errno.
    resource.setrlimit(resource.RLIMIT_FSIZE, (900, before[1]))
    try:
        with pytest.raises(OSError, match=r"Chunk 2\.0 of .*store could not be written; the 2 fin"):
            fill(store)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert fill(store) == [2]
    assert contents(store) == contents(whole)


def test_two_runs_refuse_each_other(tmp_path):
    with ChunkStore(tmp_path / "store", LAYOUT, SETTINGS, {}):
        with pytest.raises(RuntimeError, match=rf"store is in use by process {os.getpid()} on "):
            fill(tmp_path / "store")
    assert fill(tmp_path / "store") == [0, 1, 2]


def test_other_settings_are_refused_and_named(tmp_path):
    fill(tmp_path / "store")
    with pytest.raises(ValueError, match=r"of turns 1 \(now 2\), base\.load none \(now "):
        fill(tmp_path / "store", {"turns": 2, "base": {"friction": 0.1, "load": 1.0}})
    assert fill(tmp_path / "store") == []


@pytest.mark.parametrize("name", ["foundation_rms/c.1.0", ".sweep/done/1.0.json"])
@pytest.mark.parametrize("harm", [lambda data: data[:20] + b"?" + data[21:], lambda data: None])
def test_corrupt_chunk_is_named_and_computed_again(tmp_path, name, harm):
    store = tmp_path / "store"
    fill(store)
    whole = contents(store)
    harmed = harm(whole[name])
    if harmed is None:
        (store / name).unlink()
    else:
        (store / name).write_bytes(harmed)
    if name.endswith(".json") and harmed is None:
        pass  # The message says to delete a bad marker.
    else:
        with pytest.raises(
            RuntimeError, match=r"^1 of 3 .* chunk 1\.0 \(.*; delete \S+1\.0\.json\)"
        ):
            fill(store)
        (store / ".sweep/done/1.0.json").unlink()
    assert fill(store) == [1]
    assert contents(store) == whole


@pytest.mark.parametrize("name", ["zarr.json", "speed/c/0", ".sweep/settings.json"])
def test_corrupt_metadata_are_named_and_written_again(tmp_path, name):
    store = tmp_path / "store"
    fill(store)
    whole = contents(store)
    (store / name).write_bytes(whole[name][:-9])
    with pytest.raises(RuntimeError, match=r"is corrupt \(.*Delete \S+settings\.json and start"):
        fill(store)
    (store / ".sweep/settings.json").unlink()
    assert fill(store) == []
    assert contents(store) == whole


@pytest.mark.filterwarnings("ignore:Consolidated", "ignore:Object at")
def test_a_variable_that_a_user_adds_is_named_and_is_no_corruption(tmp_path):
    store = tmp_path / "store"
    fill(store)
    whole = contents(store)
    added = xr.Dataset({"mine": xr.open_zarr(store).foundation_rms / 2})
    added.to_zarr(store, mode="a")
    added.to_zarr(store, group="others", mode="a")
    names = rf"{store / 'mine'}, {store / 'others'} was added"
    with pytest.raises(ValueError, match=rf"^Argument `store` must .*{names}.*Move .*delete \S+"):
        fill(store)
    # What it says to do.
    for name in ("mine", "others"):
        (store / name).rename(tmp_path / name)
    (store / ".sweep/settings.json").unlink()
    assert fill(store) == []
    assert contents(store) == whole


def test_memory_holds_what_the_store_holds(tmp_path):
    """Also of a choice, and where only the first chunk is there."""
    grid = Grid({"speed": (28.0, 30.0, 33.0), "start": ("centred", "contact")}, {}, Crusher())
    layout = replace(LAYOUT, grid=grid)
    memory = Memory(layout, {})
    memory.done |= {1, 2}
    write_missing(memory)
    with ChunkStore(tmp_path / "store", layout, SETTINGS, {}) as store:
        store.done |= {1, 2}
        write_missing(store)
    # From one file that describes all arrays, which a folder over a network needs.
    kept = xr.open_zarr(tmp_path / "store", consolidated=True).load()
    xr.testing.assert_identical(memory.dataset(), kept)
    assert bool(kept.foundation_rms[1:].isnull().all()) and not bool(kept.success[1:].any())


def test_values_of_a_design_have_as_many_entries_as_their_dims():
    layout = replace(LAYOUT, labels_of_dims={"turn": 3, "joint": np.array(["main", "elbow"])})
    column = Column("1", "a number of each turn and joint", dims=("turn", "joint"))
    assert layout.inner(column) == (3, 2) and layout.inner(Column("1", "a scalar")) == ()
    assert [*layout.coordinates()["joint"][1]] == ["main", "elbow"]
    assert "turn" not in layout.coordinates()


def test_foreign_folder_is_refused(tmp_path):
    (tmp_path / "letters.txt").write_text("Dear")
    with pytest.raises(
        ValueError, match=r"^Argument `store` must be new or one of an earlier call"
    ):
        fill(tmp_path)


# From here on with the crusher: its joint ideal, because that compiles fastest.
AXES = {"speed": [28.0, 33.0], "shaft.eccentricity": [0.009, 0.01, 0.012]}
MACHINE = jc.paper_machine(joint="ideal", load=5e3)
IDEAL = dict(settle_turns=0, turns=1, rtol=1e-6)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """An unbroken run, in chunks of two designs and of one."""
    path, seen = tmp_path_factory.mktemp("stores") / "whole.zarr", []
    jc.sweep(
        MACHINE, AXES, **IDEAL, store=path, chunk=2, progress=lambda *counts: seen.append(counts)
    )
    assert seen == [(0, 6), (2, 6), (3, 6), (5, 6), (6, 6)]
    return path


def test_store_opens_with_units_and_provenance(whole):
    grid = xr.open_zarr(whole)
    assert grid.foundation_rms.dims == tuple(AXES)
    assert grid.foundation_rms.attrs["units"] == "N" and grid.speed.attrs["units"] == "rad/s"
    assert bool(grid.success.all()) and grid.whirl.dtype == bool
    assert json.loads(grid.attrs["parameters"])["load"] == [5e3, "N"]
    assert json.loads(grid.attrs["environment"])["versions"]["jax"]
    scene = MACHINE.scene(**{"speed": 33.0, "shaft.eccentricity": 0.01})
    one = jc.statistics(scene, 0, 1, rtol=1e-6)
    # Another program of the same design rounds, and then steps, differently: to about rtol.
    there = grid.sel({"speed": 33.0, "shaft.eccentricity": 0.01})
    assert float(there.foundation_rms) == pytest.approx(float(one.foundation_rms), rel=1e-5)


def test_bits_do_not_depend_on_memory_neighbours_or_what_varies(whole):
    _assert_whole(jc.sweep(MACHINE, AXES, **IDEAL, chunk=4), whole)
    machine = MACHINE.replace(**{"shaft.eccentricity": 0.012})
    row = jc.sweep(machine, {"speed": [33.0, 29.0, 28.0]}, **IDEAL, chunk=2)
    column = xr.open_zarr(whole).sel({"shaft.eccentricity": 0.012})
    for name in COLUMNS:
        _assert_equal_bits(row.sel(speed=[28.0, 33.0])[name], column[name])


def sweep_slowly(path: Path) -> None:
    """The sweep of `whole`, with a pause after each chunk."""
    jc.set_up()
    jc.sweep(MACHINE, AXES, **IDEAL, store=path, chunk=2, progress=lambda *_: time.sleep(0.5))


def test_sigkill_then_resume_gives_the_same_bits(whole, tmp_path):
    path = tmp_path / "killed.zarr"
    # Other devices than here: the bits must not depend on their number.
    flags = f"{os.environ['XLA_FLAGS']} --xla_force_host_platform_device_count=1"
    program = (
        f"import jax; jax.config.update('jax_enable_x64', True); from pathlib import Path; "
        f"import test_store; test_store.sweep_slowly(Path('{path}'))"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", program],
        cwd=Path(__file__).parent,
        env={**os.environ, "XLA_FLAGS": flags},
    )
    try:
        while not list(path.glob(".sweep/done/*.json")):
            assert process.poll() is None
            time.sleep(0.05)
        with pytest.raises(RuntimeError, match=f"in use by process {process.pid} on"):
            jc.sweep(MACHINE, AXES, **IDEAL, store=path, chunk=2)
        time.sleep(np.random.default_rng().uniform(0, 1))
    finally:
        process.kill()
        process.wait()
    seen = []
    resumed = jc.sweep(
        MACHINE, AXES, **IDEAL, store=path, chunk=2, progress=lambda *c: seen.append(c)
    )
    assert seen[0][0] in (2, 3, 5) and seen[-1] == (6, 6)
    _assert_whole(resumed, whole)


def _assert_whole(grid: xr.Dataset, whole: Path) -> None:
    expected = xr.open_zarr(whole)
    assert grid.attrs.keys() == expected.attrs.keys()
    assert grid.attrs["environment"] == expected.attrs["environment"]
    for name in (*COLUMNS, *AXES):
        assert grid[name].attrs == expected[name].attrs
        _assert_equal_bits(grid[name], expected[name])


def _assert_equal_bits(one: xr.DataArray, other: xr.DataArray) -> None:
    assert one.dims == other.dims and one.dtype == other.dtype
    assert one.values.tobytes() == other.values.tobytes()


@pytest.mark.slow
def test_cluster_with_a_killed_worker_loses_nothing(whole, tmp_path):
    distributed = pytest.importorskip("distributed")
    killed = []

    def kill_one(finished: int, of: int) -> None:
        if finished == 0:
            # The chunks take milliseconds: a worker that is stopped first has some in progress.
            os.kill(pid, signal.SIGSTOP)
        elif not killed:
            assert client.processing()[address]
            os.kill(pid, signal.SIGKILL)
            killed.append(pid)

    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as here,
        distributed.Client(here) as client,
    ):
        address, pid = client.run(os.getpid).popitem()
        store = tmp_path / "store.zarr"
        grid = jc.sweep(
            MACHINE, AXES, **IDEAL, store=store, chunk=1, progress=kill_one, scheduler=client
        )
    assert killed
    _assert_whole(grid, whole)


def test_every_device_gets_two_designs(monkeypatch):
    seen = []

    def echo(function, numbers):
        seen.append(len(numbers["clearance"]))
        return dict.fromkeys(COLUMNS, numbers["clearance"])

    monkeypatch.setattr(engines, "devices", lambda: [None] * 8)
    ensemble = plan(make_grid(jc.paper_machine(), AXES_OF_NUMBERS), 0, 1, 1e-6, 2, echo)
    _, values, record = ensemble.compute(1)
    # XLA opens a loop over a single design and rounds it differently.
    assert seen == [16] and record["designs"] == 2
    np.testing.assert_array_equal(values["foundation_rms"], [AXES_OF_NUMBERS["clearance"]])


def test_an_ensemble_equals_its_copies():
    """Or a worker, which gets one with every chunk, would compile each of them anew."""
    ensemble = plan(
        make_grid(jc.paper_machine(**{"elbow.clearance": 1e-4}), AXES_OF_NUMBERS), 0, 1, 1e-6, 2
    )
    copy = pickle.loads(pickle.dumps(ensemble))
    assert copy == ensemble and hash(copy.window) == hash(ensemble.window)


def test_failing_worker_names_the_chunk():
    distributed = pytest.importorskip("distributed")
    with distributed.Client(processes=False, n_workers=1, dashboard_address=None) as client:
        settings = {**worker_environment(), "backend": "abacus"}
        with pytest.raises(RuntimeError, match=r"^Chunk 0\.0 was not computed: this worker has"):
            ensemble = plan(make_grid(jc.paper_machine(), AXES_OF_NUMBERS), 0, 1, 1e-6, 2)
            list(compute_on(client, ensemble.compute, ensemble.layout.name, settings, [0]))


@pytest.mark.parametrize("given", [2, 2.0, "2", "abc", "x://host:1"])
def test_a_scheduler_that_is_none_is_refused(given):
    pytest.importorskip("distributed")
    with pytest.raises(ValueError, match=rf"^Argument `scheduler` must be a .* is {given!r}\.$"):
        jc.sweep(MACHINE, AXES, **IDEAL, scheduler=given)


def test_missing_dask_is_one_clear_line(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(ImportError, match=r"needs Dask: pip install 'jaxcrusher\[cluster\]'\.$"):
        jc.sweep(MACHINE, AXES, **IDEAL, store=tmp_path / "s", scheduler="tcp://127.0.0.1:1")


@pytest.mark.parametrize(
    "axes, options, name",
    [
        ({}, {}, "axes"),
        ([30.0, 32.0], {}, "axes"),
        ({"sped": [1.0]}, {}, "sped"),
        ({"speed": 30.0}, {}, r"axes\['speed'\]"),
        ({"speed": [30.0, 30.0]}, {}, r"axes\['speed'\]"),
        ({"speed": ["x"]}, {}, "speed"),
        ({"speed": [30.0, "x"]}, {}, r"axes\['speed'\]"),
        ({3: [30.0, 31.0]}, {}, "axes"),
        ({"motor_power": [2e4, 3e4]}, {}, "axes"),
        ({"speed": [-1.0, 30.0]}, {}, "speed"),
        ({"start": ["left"]}, {}, "start"),
        ({"jaw.length": [0.695, 1.2]}, {}, "jaw.length`, `toggle.length"),
        ({"speed": [30.0]}, {"chunk": 0}, "chunk"),
    ],
)
@pytest.mark.usefixtures("unchecked")
def test_bad_arguments_make_no_store(tmp_path, axes, options, name):
    with pytest.raises(ValueError, match=f"^Argument `{name}") as error:
        jc.sweep(jc.paper_machine(), axes, 0, 1, store=tmp_path / "store", **options)
    assert "\n" not in str(error.value) and not (tmp_path / "store").exists()

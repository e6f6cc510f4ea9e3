"""The time and storage of a large sweep, and what its bits depend on."""

import hashlib
import tempfile
from collections.abc import Iterator
from pathlib import Path
from time import perf_counter

import numpy as np

import jaxcrusher as jc
from benchmarks.setting import run_apart
from benchmarks.timing import timed
from jaxcrusher.batch.layout import Layout
from jaxcrusher.batch.points import make_grid
from jaxcrusher.batch.store import ChunkStore
from jaxcrusher.batch.sweep import plan
from jaxcrusher.files.provenance import machine

BOX = {"speed": np.linspace(25, 40, 16), "clearance": np.linspace(0.03e-3, 0.12e-3, 8)}
DESIGNS = 128
# Impacts amplify a rounding by exp(200 t): 0.4 s of them show any difference in the last bit.
TRIAL = {"speed": [25.0, 31.0, 40.0], "clearance": [0.03e-3, 0.07e-3, 0.09e-3, 0.12e-3]}

# Devices, designs a chunk, and XLA's flags besides those of `set_up`.
VARIANTS = [
    (1, 12, ""),
    (1, 1, ""),
    (2, 12, ""),
    (3, 4, ""),
    (2, 2, ""),
    (2, 12, "--xla_cpu_max_isa=AVX2"),
    (2, 12, "--xla_cpu_max_isa=SSE4_2"),
]


def run() -> None:
    """Print all figures."""
    print(machine())
    print("time of a design on all cores, 5 + 10 turns:")
    for start in ("contact", "centred"):
        for rtol in (1e-6, 1e-9):
            first, again = time_designs(start, rtol)
            print(
                f"  {start}, rtol {rtol:g}: {1e3 * again / DESIGNS:.1f} ms, "
                f"and {first - again:.1f} s once for the compilation"
            )
    for designs in (256, 1024, 4096):
        time_store(designs)
    print("bits of 12 impacting designs, 2 turns (same letters: same bits):")
    for devices, chunk, flags in VARIANTS:
        print(
            f"  {devices} devices, {chunk} designs a chunk {flags}: {bits(devices, chunk, flags)}",
            flush=True,
        )


def time_designs(start: str, rtol: float) -> tuple[float, float]:
    """Return seconds of a chunk over the paper's box, with and without the compilation."""
    ensemble = plan(make_grid(BOX, {"start": start}, None), 5, 10, rtol, DESIGNS)
    first, again, (_, values, _) = timed(lambda: ensemble.compute(0), 1)
    assert values["success"].all()
    return first.wall, again.wall


def time_store(designs: int, count: int = 20) -> None:
    """Print the cost of keeping `count` chunks of random digits, which do not compress."""
    grid = make_grid({"load": range(count * designs)}, None, None)
    layout: Layout = plan(grid, 0, 1, 1e-9, designs).layout
    random = np.random.default_rng(0)
    values = {name: random.random(designs) for name in layout.columns}
    logical = [name for name, column in layout.columns.items() if column.kind is bool]
    values |= {name: values[name] > 0.5 for name in logical}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "store"
        with ChunkStore(path, layout, {}, {}) as store:
            began = perf_counter()
            for number in range(count):
                store.write(number, values, {})
            writing = perf_counter() - began
        began = perf_counter()
        with ChunkStore(path, layout, {}, {}):
            verifying = perf_counter() - began
        files = [file.stat() for file in path.rglob("*") if file.is_file()]
        size, disk = sum(f.st_size for f in files), sum(512 * f.st_blocks for f in files)
    print(
        f"chunks of {designs}: {size / count / designs:.0f} B a design "
        f"({disk / count / designs:.0f} B on the disk), write {1e3 * writing / count:.0f} ms, "
        f"verify {1e3 * verifying / count:.1f} ms, {len(files) / count:.0f} files"
    )


def bits(devices: int, chunk: int, flags: str) -> str:
    """Return the hash of the trial's results, from a process of its own."""
    flags = f"--xla_force_host_platform_device_count={devices} {flags}"
    job = "benchmarks.large_sweeps.run", "digest", str(chunk)
    (found,) = run_apart("benchmarks.worker", *job, flags=flags)
    return found["bits"]


def digest(chunk: str) -> Iterator[dict[str, str]]:
    """Yield a hash of the results of twelve impacting designs, so many a chunk."""
    grid = jc.sweep(TRIAL, 0, 2, chunk=int(chunk), rtol=1e-6)
    found = hashlib.sha256(b"".join(grid[name].values.tobytes() for name in grid.data_vars))
    yield {"bits": found.hexdigest()[:8]}

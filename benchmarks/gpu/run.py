"""Sweeps of more and more designs on a card, their kernels, and the same by the cores."""

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple
from unittest import mock

import numpy as np
import xarray as xr

import jaxcrusher as jc
from benchmarks.pages import publish, table
from benchmarks.setting import setting
from benchmarks.timing import timed
from jaxcrusher.basics.devices import finds_card
from jaxcrusher.basics.setup import cores
from jaxcrusher.batch import engines
from jaxcrusher.files.provenance import command
from jaxcrusher.lanes import card

# Designs along speed and clearance; and those by the cores, of which more cost as much each.
SIDES, ON_CORES = ((32, 32), (128, 128), (256, 256), (512, 512)), (64, 64)
SPEEDS, CLEARANCES = (25.0, 40.0), (0.03e-3, 0.12e-3)
SETTLE, TURNS, RTOL = 2, 4, 1e-8
REPEATS = 3


class Row(NamedTuple):
    """Sweeps of so many designs: seconds of the first and of a later one, and of its kernels."""

    designs: int
    first: float
    again: float
    kernels: float


def run(out: Path) -> None:
    """Measure and publish; RuntimeError where there is no card, and then nothing is written."""
    if not finds_card():
        raise RuntimeError(
            "CuPy finds no GPU of NVIDIA's here, so nothing was measured and no page is written."
        )
    import cupy  # pyright: ignore[reportMissingImports]

    rows = [_measured(cupy, sides) for sides in SIDES]
    spent = timed(lambda: _sweep(ON_CORES, "lanes"), REPEATS).again
    device = cupy.cuda.Device()
    name = cupy.cuda.runtime.getDeviceProperties(device.id)["name"].decode()
    where = f"{name}; {setting()}, CuPy {cupy.__version__}"
    made_by = table(("made by", "on"), [[f"`{command()}`", where]])
    designs = designs_table(rows, spent.wall / math.prod(ON_CORES), cores())
    publish(out, "gpu.md", {"run": made_by, "designs": designs})


def designs_table(rows: Sequence[Row], on_cores: float, cores: int) -> str:
    """Return the page's table; `on_cores` are the seconds of a design by lanes on so many cores."""
    headings = ("designs", "first, s", "again, us a design", "of which kernels")
    headings = (*headings, f"lanes on {cores} cores, us a design", "lanes / card")
    cells = []
    for designs, first, again, kernels in rows:
        each = (f"{1e6 * seconds / designs:.1f}" for seconds in (again, kernels))
        beside = f"{1e6 * on_cores:.0f}", f"{on_cores * designs / again:.1f}"
        cells.append([designs, f"{first:.2f}", *each, *beside])
    return table(headings, cells)


def _sweep(sides: tuple[int, int], engine: Any) -> xr.Dataset:
    speeds, clearances = (
        np.linspace(*span, count) for span, count in zip((SPEEDS, CLEARANCES), sides, strict=True)
    )
    axes = {"speed": speeds, "clearance": clearances}
    return jc.sweep(jc.paper_machine(), axes, SETTLE, TURNS, rtol=RTOL, engine=engine)


def _measured(cupy: Any, sides: tuple[int, int]) -> Row:
    """Time sweeps, and the kernels of one by the card's clock."""
    events, warps = [], card._warps

    def clocked(text: str, device: int) -> Callable[..., None]:
        kernel = warps(text, device)

        def launched(*operands: Any) -> None:
            began, ended = cupy.cuda.Event(), cupy.cuda.Event()
            began.record()
            kernel(*operands)
            ended.record()
            events.append((began, ended))

        return launched

    done = timed(lambda: _sweep(sides, "gpu"), REPEATS)
    # One after the other: kernels side by side would slow each other down.
    with mock.patch.object(card, "_warps", clocked), mock.patch.object(engines, "ON_CARD", 1):
        _sweep(sides, "gpu")
    kernels = sum(cupy.cuda.get_elapsed_time(*pair) for pair in events) / 1e3
    return Row(math.prod(sides), done.first.wall, done.again.wall, kernels)

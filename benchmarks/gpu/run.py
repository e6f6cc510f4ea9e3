"""Sweeps of more and more designs on a card, their kernels, and the same by the cores."""

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple
from unittest import mock

import numpy as np
import xarray as xr

import jaxcrusher as jc
from benchmarks.gpu.roofline import instructions, peak
from benchmarks.pages import publish, table
from benchmarks.setting import setting
from benchmarks.timing import timed
from jaxcrusher.basics.devices import finds_card
from jaxcrusher.basics.setup import cores
from jaxcrusher.batch import engines
from jaxcrusher.batch.engines import map_all, stack
from jaxcrusher.files.provenance import command
from jaxcrusher.lanes import card
from jaxcrusher.lanes.card import ptx

# Designs along speed and clearance; and those by the cores, of which more cost as much each.
SIDES, ON_CORES = ((32, 32), (128, 128), (256, 256), (512, 512)), (64, 64)
SPEEDS, CLEARANCES = (25.0, 40.0), (0.03e-3, 0.12e-3)
SETTLE, TURNS, RTOL = 2, 4, 1e-8
REPEATS = 3
# Designs whose steps are counted.
COUNTED = 64


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

    texts: list[str] = []
    rows = [_measured(cupy, sides, texts) for sides in SIDES]
    spent = timed(lambda: _sweep(ON_CORES, "lanes"), REPEATS).again
    device = cupy.cuda.Device()
    name = cupy.cuda.runtime.getDeviceProperties(device.id)["name"].decode()
    where = f"{name}; {setting()}, CuPy {cupy.__version__}"
    made = tables(
        rows,
        spent.wall / math.prod(ON_CORES),
        cores(),
        instructions(ptx(texts[0]).decode(), _steps(), SETTLE + TURNS),
        peak(str(device.compute_capability), device.attributes),
    )
    publish(out, "gpu.md", {"run": _run_table(where)} | made)


def tables(
    rows: Sequence[Row], on_cores: float, cores: int, instructions: float, peak: float
) -> dict[str, str]:
    """Return the page's tables.

    `on_cores` are the seconds of a design by lanes on so many cores, `instructions` those for FP64
    units that a design takes at least, and `peak` is how many of them the card issues in a second.
    """
    headings = ("designs", "first, s", "again, us a design", "of which kernels")
    headings = (*headings, f"lanes on {cores} cores, us a design", "lanes / card")
    times, units = [], []
    for designs, first, again, kernels in rows:
        each = [1e6 * seconds / designs for seconds in (again, kernels)]
        beside = f"{1e6 * on_cores:.0f}", f"{on_cores * designs / again:.1f}"
        times.append([designs, f"{first:.2f}", *(f"{one:.1f}" for one in each), *beside])
        least = instructions * designs / peak
        units.append([designs, f"{kernels:.3f}", f"{least:.3f}", f"{100 * least / kernels:.0f} %"])
    heads = ("designs", "kernels, s", "FP64 units alone, s", "share")
    return {"designs": table(headings, times), "roofline": table(heads, units)}


def _run_table(where: str) -> str:
    return table(("made by", "on"), [[f"`{command()}`", where]])


def _sweep(sides: tuple[int, int], engine: Any) -> xr.Dataset:
    speeds, clearances = (
        np.linspace(*span, count) for span, count in zip((SPEEDS, CLEARANCES), sides, strict=True)
    )
    axes = {"speed": speeds, "clearance": clearances}
    return jc.sweep(axes, SETTLE, TURNS, rtol=RTOL, engine=engine)


def _steps() -> float:
    """Return the mean number of steps of a design."""
    random = np.random.default_rng(0)
    speeds, clearances = random.uniform(*SPEEDS, COUNTED), random.uniform(*CLEARANCES, COUNTED)
    scenes = stack([jc.paper_scene(*pair) for pair in zip(speeds, clearances, strict=True)])

    def steps(scene: jc.Scene) -> Any:
        return jc.statistics(scene, SETTLE, TURNS, rtol=RTOL).outcome.steps

    return float(np.mean(map_all(steps, scenes)))


def _measured(cupy: Any, sides: tuple[int, int], texts: list[str]) -> Row:
    """Time sweeps, and the kernels of one by the card's clock; their texts come to `texts`."""
    events, warps = [], card._warps

    def clocked(text: str, capability: str) -> Callable[..., None]:
        kernel = warps(text, capability)
        texts.append(text)

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

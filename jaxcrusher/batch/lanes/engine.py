"""Integrations of many designs by lanes, on all cores."""

import ctypes
from collections.abc import Sequence
from concurrent.futures import FIRST_EXCEPTION, ThreadPoolExecutor, wait
from math import prod

import numpy as np

from jaxcrusher.basics.setup import cores
from jaxcrusher.batch.lanes.kernels import Kernels
from jaxcrusher.batch.lanes.layout import Arrays, Control, Designs, Ends, Page, new_lanes, table
from jaxcrusher.batch.lanes.module import Machine, load
from jaxcrusher.batch.lanes.vector import LANES


def run(
    kernels: Kernels,
    control: Control,
    designs: Designs,
    shapes: Sequence[tuple[int, ...]],
    threads: int | None = None,
) -> tuple[list[np.ndarray], Ends]:
    """Integrate the designs by the kernels, whose summaries of a segment have these shapes.

    Gives the summaries, each with axes of the designs and segments before its own, and how the
    designs ended; from a failure on numbers are NaN. The bits of a design depend on its own numbers
    only. Interrupted, all threads end within milliseconds.
    """
    machine, sizes, page = load(kernels.text), kernels.sizes, kernels.page
    count, segments = len(designs.starts), designs.floors.shape[1]
    ends = Ends(np.zeros(count, np.int64), np.zeros(count), np.zeros(count, np.int64))
    next_design, stop = np.zeros(1, np.int64), np.zeros(1, np.int64)
    found = np.empty((count, segments, sum(map(prod, shapes))))
    found[:] = _of_nothing(machine, page)[: found.shape[2]]
    limits = np.array([control.first, control.smallest, control.steps])
    shared = (*designs, limits, np.array([count, segments]), found, *ends, next_design, stop)

    def work() -> None:
        arrays = Arrays(*new_lanes(sizes, control, page), *shared)
        _advance(machine, table(arrays))

    threads = min(threads or cores(), -(-count // LANES))
    with ThreadPoolExecutor(threads) as pool:
        futures = [pool.submit(work) for _ in range(threads)]
        try:
            wait(futures, return_when=FIRST_EXCEPTION)
        finally:
            stop[0] = 1
    for future in futures:
        future.result()
    return list(_apart(found, shapes, kernels.over)), ends


def _advance(machine: Machine, table: np.ndarray) -> None:
    """The loop over steps, without Python's lock."""
    ctypes.CFUNCTYPE(None, ctypes.c_void_p)(machine["advance"])(table.ctypes.data)


def _of_nothing(machine: Machine, page: Page) -> np.ndarray:
    """The summary of a segment that was not reached."""
    numbers = np.full(page.end * LANES, np.nan)
    kind = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_int64, ctypes.c_int64)
    kind(machine["summarise"])(numbers.ctypes.data, 0, 0)
    return numbers[page.found * LANES :]


def _apart(found: np.ndarray, shapes: Sequence[tuple[int, ...]], over: Sequence[bool]):
    """Every summary by itself."""
    first = 0
    for shape, is_over in zip(shapes, over, strict=True):
        part = found[..., first : first + prod(shape)]
        first += prod(shape)
        if is_over:
            # Written with the instants last.
            part = part.reshape(*part.shape[:2], *shape[1:], shape[0])
            yield np.moveaxis(part, -1, 2)
        else:
            yield part.reshape(*part.shape[:2], *shape)

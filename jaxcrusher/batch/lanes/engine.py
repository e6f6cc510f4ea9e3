"""Integrations of many designs by lanes, on all cores."""

import ctypes
from collections.abc import Sequence
from concurrent.futures import FIRST_EXCEPTION, ThreadPoolExecutor, wait
from math import prod

import numpy as np

from jaxcrusher.basics.setup import cores
from jaxcrusher.batch.lanes.kernels import Kernels
from jaxcrusher.batch.lanes.layout import (
    Batch,
    Control,
    Designs,
    Ends,
    Functions,
    new_lanes,
    places,
)
from jaxcrusher.batch.lanes.module import load, loop
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
    functions = Functions(*(machine[name] for name in Functions._fields))
    count, segments = len(designs.starts), designs.floors.shape[1]
    ends = Ends(np.zeros(count, np.int64), np.zeros(count), np.zeros(count, np.int64))
    next_design, stop = np.zeros(1, np.int64), np.zeros(1, np.int64)
    found = np.empty((count, segments, sum(map(prod, shapes))))
    found[:] = _of_nothing(functions.summarise, kernels)[: found.shape[2]]
    batch = Batch(
        functions,
        places(sizes),
        page,
        sizes.motion,
        kernels.instants,
        control,
        designs,
        found,
        ends,
        next_design,
        stop,
    )
    threads = min(threads or cores(), -(-count // LANES))
    with ThreadPoolExecutor(threads) as pool:
        work = (new_lanes(sizes, control, page) for _ in range(threads))
        futures = [pool.submit(loop().advance, batch, lanes) for lanes in work]
        try:
            wait(futures, return_when=FIRST_EXCEPTION)
        finally:
            stop[0] = 1
    for future in futures:
        future.result()
    return list(_apart(found, shapes, kernels.over)), ends


def _of_nothing(summarise: int, kernels: Kernels) -> np.ndarray:
    """The summary of a segment that was not reached."""
    page = np.full(kernels.page.end * LANES, np.nan)
    ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_int64)(summarise)(page.ctypes.data, 0)
    return page[kernels.page.found * LANES :]


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

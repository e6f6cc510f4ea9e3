"""Integrations of many designs by lanes, wherever these are."""

import ctypes
from collections.abc import Callable, Sequence
from math import prod
from typing import NamedTuple

import numpy as np

from jaxcrusher.batch.lanes.kernels import Kernels
from jaxcrusher.batch.lanes.layout import Control, Designs, Ends, Shared
from jaxcrusher.batch.lanes.module import Machine, load
from jaxcrusher.batch.lanes.vector import Shape


class Device(NamedTuple):
    """Where lanes are: their shape, and what goes on until all results are written."""

    shape: Shape
    advance: Callable[[Kernels, Control, Shared], None]


def run(
    kernels: Kernels,
    control: Control,
    designs: Designs,
    shapes: Sequence[tuple[int, ...]],
    device: Device,
) -> tuple[list[np.ndarray], Ends]:
    """Integrate the designs by the kernels, whose summaries of a segment have these shapes.

    Gives the summaries, each with axes of the designs and segments before its own, and how the
    designs ended; from a failure on numbers are NaN. The bits of a design depend on its own numbers
    only.
    """
    count, segments = len(designs.starts), designs.floors.shape[1]
    ends = Ends(np.zeros(count, np.int64), np.zeros(count), np.zeros(count, np.int64))
    found = np.empty((count, segments, sum(map(prod, shapes))))
    found[:] = _of_nothing(load(kernels.text), kernels)[: found.shape[2]]
    limits = np.array([control.first, control.smallest, control.steps])
    next_design, stop = np.zeros(1, np.int64), np.zeros(1, np.int64)
    counts = np.array([count, segments])
    shared = Shared(*designs, limits, counts, found, *ends, next_design, stop)
    device.advance(kernels, control, shared)
    return list(_apart(found, shapes, kernels.over)), ends


def _of_nothing(machine: Machine, kernels: Kernels) -> np.ndarray:
    """The summary of a segment that was not reached."""
    page, lanes = kernels.page, kernels.shape.lanes
    numbers = np.full(page.end * lanes, np.nan)
    kind = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_int64, ctypes.c_int64)
    kind(machine["summarise"])(numbers.ctypes.data, 0, 0)
    return numbers[page.found * lanes :]


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

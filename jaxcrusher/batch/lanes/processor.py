"""Lanes on the cores of the processor, a thread each."""

import ctypes
from concurrent.futures import FIRST_EXCEPTION, ThreadPoolExecutor, wait

import numpy as np

from jaxcrusher.basics.setup import cores
from jaxcrusher.batch.lanes.engine import Device
from jaxcrusher.batch.lanes.kernels import Kernels
from jaxcrusher.batch.lanes.layout import Control, Shared, new_lanes, table
from jaxcrusher.batch.lanes.module import Machine, load
from jaxcrusher.batch.lanes.vector import CORES


def _on_cores(kernels: Kernels, control: Control, shared: Shared) -> None:
    """Interrupted, all threads end within milliseconds."""
    machine = load(kernels.text)

    def work() -> None:
        lanes = new_lanes(kernels.sizes, control, kernels.page, CORES.lanes)
        _advance(machine, table(lanes, shared))

    threads = min(cores(), -(-len(shared.starts) // CORES.lanes))
    with ThreadPoolExecutor(threads) as pool:
        futures = [pool.submit(work) for _ in range(threads)]
        try:
            wait(futures, return_when=FIRST_EXCEPTION)
        finally:
            shared.stop[0] = 1
    for future in futures:
        future.result()


def _advance(machine: Machine, table: np.ndarray) -> None:
    """The loop over steps, without Python's lock."""
    kind = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_int64)
    kind(machine["advance"])(table.ctypes.data, 0)


PROCESSOR = Device(CORES, _on_cores)

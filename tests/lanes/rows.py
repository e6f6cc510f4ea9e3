"""Functions of vectors, run over arrays of any length."""

import ctypes
from collections.abc import Callable

import numpy as np

from jaxcrusher.lanes.code import LANES, Code, Module
from jaxcrusher.lanes.expression import DOUBLE
from jaxcrusher.lanes.machine import load

# Rows behind the results.
SPARE = 100


def over_rows(write: Callable[[Code], list], *operands: np.ndarray) -> np.ndarray:
    """What `write` makes of the first rows, the operands of shape (n,): shape (results, n)."""
    module = Module()
    code = Code(module, "part")
    results = write(code)
    for i, result in enumerate(results, len(operands)):
        code.write(result, i)
    return run(module, [code], len(results), *operands)


def run(
    module: Module, parts: list[Code], results: int, *operands: np.ndarray, spare: int = SPARE
) -> np.ndarray:
    """The rows behind the operands, once functions ran one after the other."""
    for i, part in enumerate(parts):
        over_lanes = Code(module, f"function{i}", flags=())
        memory = over_lanes.array(0, DOUBLE)
        with over_lanes.each_vector() as first:
            over_lanes.run(part.end(), memory=memory, first=first)
        over_lanes.end(by_name=True)
    machine, kind = load(str(module)), ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_int64)
    functions = [kind(machine[f"function{i}"]) for i in range(len(parts))]
    # What is beyond the end is not looked at.
    count, rows = -(-len(operands[0]) // LANES), len(operands) + results
    memory = np.ones((count, rows + spare, LANES))
    for i, operand in enumerate(operands):
        row = np.ones(count * LANES)
        row[: operand.size] = operand
        memory[:, i] = row.reshape(count, LANES)
    for part in memory:
        for function in functions:
            function(np.array([part.ctypes.data]).ctypes.data, 0)
    found = np.moveaxis(memory[:, len(operands) : rows], 1, 0).reshape(results, -1)
    return found[:, : len(operands[0])]

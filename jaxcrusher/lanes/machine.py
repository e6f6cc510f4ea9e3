"""Machine code of LLVM's text: compiled, kept on disk, and run by the processor.

If the folder cannot be written, code is compiled again, without an error. A thread of the
processor advances as many lanes as stand in a row; a GPU's are those of `lanes.card`.
"""

import ctypes
import hashlib
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_EXCEPTION, ThreadPoolExecutor, wait
from functools import cache
from math import prod
from pathlib import Path
from typing import NamedTuple

import llvmlite.binding as llvm
import numpy as np
import platformdirs

from jaxcrusher.basics.setup import cores
from jaxcrusher.files.durable import read_checked, replace_checked
from jaxcrusher.lanes.code import CORES, Shape
from jaxcrusher.lanes.layout import WHOLE, Control, Designs, Lanes, Shared, lane_shapes, table
from jaxcrusher.lanes.stepper import Kernels
from jaxcrusher.version import version_of

# Bytes of a line of the processor's cache.
_LINE = 64
# A function that threads ask for at once is compiled by one of them.
_LOCK = threading.Lock()


class Machine:
    """Functions in machine code, by name -> address; they live as long as this."""

    def __init__(self, code: bytes) -> None:
        self._engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), _target())
        self._engine.add_object_file(llvm.ObjectFileRef.from_data(code))
        self._engine.finalize_object()
        self._addresses: dict[str, int] = {}

    def __getitem__(self, name: str) -> int:
        # LLVM takes a third of a millisecond to find one.
        if name not in self._addresses:
            self._addresses[name] = self._engine.get_function_address(name)
        return self._addresses[name]


def cache_folder() -> Path:
    """Return the user's folder in which machine code is kept."""
    return platformdirs.user_cache_path("jaxcrusher") / "lanes"


def load(text: str) -> Machine:
    """Load the functions of a text, compiled unless an earlier process on such a processor did."""
    with _LOCK:
        return _load(text)


@cache
def _load(text: str) -> Machine:
    def compiled() -> bytes:
        return _target().emit_object(optimised(text, _target()))

    return Machine(kept("code", compiled, text, *_processor(), version_of("llvmlite")))


def kept(kind: str, compiled: Callable[[], bytes], *key: str) -> bytes:
    """Return the machine code of a key, compiled unless an earlier process has kept it.

    `kind` ends the file's name. A folder that cannot be written is no error.
    """
    digest = hashlib.sha256("\0".join(key).encode()).hexdigest()[:32]
    file = cache_folder() / f"{digest}.{kind}"
    try:
        return read_checked(file)  # LLVM crashes on broken code.
    except (OSError, ValueError):  # There is none, or it is broken.
        code = compiled()
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        replace_checked(file, code)
    except OSError:
        pass
    return code


def _processor() -> tuple[str, str]:
    """Return the processor's name and what it knows."""
    return llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten()


def _target() -> llvm.TargetMachine:
    """Make this machine; a new one each time, for an engine takes it as its own."""
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    return llvm.Target.from_triple(llvm.get_process_triple()).create_target_machine(
        *_processor(), opt=3, jit=True
    )


def optimised(text: str, target: llvm.TargetMachine) -> llvm.ModuleRef:
    """Return the module after LLVM's passes."""
    module, tuning = llvm.parse_assembly(text), llvm.create_pipeline_tuning_options(3)
    builder = llvm.create_pass_builder(target, tuning)
    builder.getModulePassManager().run(module, builder)
    return module


class Target(NamedTuple):
    """Where lanes run: their shape, and the function that advances them.

    The function may return the results in arrays of its own.
    """

    shape: Shape
    advance: Callable[[Kernels, Shared], Shared]


def run(
    kernels: Kernels,
    control: Control,
    designs: Designs,
    shapes: Sequence[tuple[int, ...]],
    target: Target,
) -> list[np.ndarray]:
    """Integrate the designs by the kernels, whose summaries of a segment have these shapes.

    Returns the summaries, each with axes of the designs and segments before its own, and how each
    design ended: code, time and steps. From a failure on numbers are NaN. The bits of a design
    depend on its own numbers only.
    """
    count, segments = len(designs.starts), designs.floors.shape[1]
    ends = [np.empty(count, np.int64), np.empty(count), np.empty(count, np.int64)]
    found = np.empty((count, segments, kernels.at.found))
    next_design, stop = np.zeros(1, np.int64), np.zeros(1, np.int64)
    counts = np.array([count, segments])
    shared = Shared._make((*designs, np.array(control), counts, found, *ends, next_design, stop))
    done = target.advance(kernels, shared)
    found = _apart(done.found, shapes, kernels.over)
    return [*found, done.result, done.reached, done.steps]


def _apart(
    found: np.ndarray, shapes: Sequence[tuple[int, ...]], over: Sequence[bool]
) -> Iterator[np.ndarray]:
    """Take the summaries apart; those over the instants are written with the instants last."""
    first = 0
    for shape, is_over in zip(shapes, over, strict=True):
        part = found[..., first : first + prod(shape)]
        first += prod(shape)
        written = (*shape[1:], shape[0]) if is_over else shape
        part = part.reshape(*part.shape[:2], *written)
        yield np.moveaxis(part, -1, 2) if is_over else part


def _aligned(shape: tuple[int, ...], kind: type) -> np.ndarray:
    """Make an array of eight bytes a number that begins with a line of the processor's cache.

    A vector that stands in two lines takes twice as long to read.
    """
    size = 8 * prod(shape)
    memory = np.empty(size + _LINE, np.uint8)
    first = -memory.ctypes.data % _LINE
    return memory[first : first + size].view(kind).reshape(shape)


def _on_cores(kernels: Kernels, shared: Shared) -> Shared:
    """Advance on a thread a core; interrupted, all of them end within milliseconds."""
    machine = load(kernels.text)

    def work() -> None:
        sizes = lane_shapes(kernels.at)
        kinds = (np.int64 if name in WHOLE else np.float64 for name in sizes._fields)
        lanes = Lanes(*map(_aligned, sizes, kinds))  # as long as their addresses are used
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
    return shared


def _advance(machine: Machine, table: np.ndarray) -> None:
    """Run the loop over steps, without Python's lock."""
    kind = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_int64)
    kind(machine["advance"])(table.ctypes.data, 0)


PROCESSOR = Target(CORES, _on_cores)

"""A GPU of NVIDIA's as a target of lanes: a design in each of its threads, 32 threads to a warp.

LLVM compiles the same functions as for the processor to PTX, which is kept on disk. NVIDIA's driver
compiles the PTX to machine code and keeps that itself; CuPy, which is optional, starts it. However
many designs and segments there are, a batch is one copy to the card, one kernel and one copy back.
All three are asynchronous, in a stream of their own: another thread's batch may be prepared or
computed in the meantime.
"""

import contextlib
import threading
from collections.abc import Iterator, Mapping
from functools import cache
from math import prod
from typing import Any

import llvmlite.binding as llvm
import numpy as np

from jaxcrusher.lanes.code import WARPS
from jaxcrusher.lanes.layout import FIELDS, WRITTEN, Shared, lane_shapes
from jaxcrusher.lanes.machine import Target, kept, optimised
from jaxcrusher.lanes.stepper import Kernels
from jaxcrusher.version import version_of

# The oldest generation that CUDA 13 knows; drivers compile its PTX for later ones.
_GENERATION = "sm_75"
# Where a thread starts: each block is a warp with a table of its own.
_ENTRY = f"""
declare i32 @llvm.nvvm.read.ptx.sreg.tid.x()
declare i32 @llvm.nvvm.read.ptx.sreg.ctaid.x()
define ptx_kernel void @warps(ptr %tables) {{
  %thread = call i32 @llvm.nvvm.read.ptx.sreg.tid.x()
  %warp = call i32 @llvm.nvvm.read.ptx.sreg.ctaid.x()
  %table = getelementptr [{len(FIELDS)} x ptr], ptr %tables, i32 %warp
  %lane = zext i32 %thread to i64
  call void @advance(ptr %table, i64 %lane)
  ret void
}}
"""
# Warps of a multiprocessor. Sixteen leave a thread 128 registers, and took 1.16 times as long.
_WARPS_OF_EACH = 8
# Bytes from one array to the next are a multiple of this, which a warp reads at once.
_ALIGNED = 128

# Threads that run one program at once compile it once.
_LOCK = threading.Lock()
# Streams that no thread uses. CuPy keeps the memory of each for its next batch.
_STREAMS: list[Any] = []


def ptx(text: str) -> bytes:
    """Compile the functions of a text, and `warps`, for NVIDIA's driver."""
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    triple = "nvptx64-nvidia-cuda"
    target = llvm.Target.from_triple(triple).create_target_machine(cpu=_GENERATION, opt=3)
    own = text.replace('target triple = "unknown-unknown-unknown"', f'target triple = "{triple}"')
    return target.emit_assembly(optimised(own + _ENTRY, target)).encode()


def _cupy() -> Any:
    try:
        import cupy  # pyright: ignore[reportMissingImports]
    except ImportError:
        raise ImportError(
            "The engine `on_gpu` needs CuPy: pip install 'jaxcrusher[gpu]' (CUDA 12: cupy-cuda12x)."
        ) from None
    return cupy


@cache
def _warps(text: str, device: int) -> Any:
    """Return the kernel of a text on a device, compiled once.

    The driver takes the text as a whole. CuPy's linker compiles functions apart, and kernels took
    1.17 times as long.
    """
    module = _cupy().cuda.function.Module()
    module.load(kept("ptx", lambda: ptx(text), text, _ENTRY, _GENERATION, version_of("llvmlite")))
    return module.get_function("warps")


@contextlib.contextmanager
def _stream(cupy: Any) -> Iterator[Any]:
    """Lend a stream in which the caller's work is done, one thing after the other."""
    stream = _STREAMS.pop() if _STREAMS else cupy.cuda.Stream(non_blocking=True)
    try:
        with stream:
            yield stream
    finally:
        _STREAMS.append(stream)


class _Block:
    """Arrays one behind the other on the card, and in the host's memory that it copies by itself.

    `arrays` are the host's; those that it is made of give shapes and types.
    """

    def __init__(self, cupy: Any, like: Mapping[str, np.ndarray]) -> None:
        sizes = [-(-array.nbytes // _ALIGNED) * _ALIGNED for array in like.values()]
        self._size = sum(sizes)
        self._host = cupy.cuda.alloc_pinned_memory(self._size)
        self._card = cupy.cuda.alloc(self._size)
        memory = np.frombuffer(self._host, np.uint8, self._size)
        self.arrays, self.addresses, first = dict[str, np.ndarray](), dict[str, int](), 0
        for (name, array), size in zip(like.items(), sizes, strict=True):
            part = memory[first : first + array.nbytes]
            self.arrays[name] = part.view(array.dtype).reshape(array.shape)
            self.addresses[name] = self._card.ptr + first
            first += size

    def send(self, stream: Any) -> None:
        """Begin to copy to the card."""
        self._card.copy_from_host_async(self._host.ptr, self._size, stream)

    def fetch(self, stream: Any) -> None:
        """Begin to copy to the host."""
        self._card.copy_to_host_async(self._host.ptr, self._size, stream)


def _on_warps(kernels: Kernels, shared: Shared) -> Shared:
    """Advance on all warps in one go; it cannot be interrupted."""
    cupy = _cupy()
    device = cupy.cuda.Device()
    with _LOCK:
        warps = _warps(kernels.text, device.id)
    most = _WARPS_OF_EACH * device.attributes["MultiProcessorCount"]
    count = min(-(-len(shared.starts) // WARPS.lanes), most)
    with _stream(cupy) as stream:
        arrays = shared._asdict()
        written = _Block(cupy, {name: arrays.pop(name) for name in WRITTEN})
        tables = np.empty((count, len(FIELDS)), np.uintp)
        given = _Block(cupy, {"tables": tables, **arrays})
        for name, array in arrays.items():
            given.arrays[name][...] = array
        # Lanes make their own memory.
        sizes = [8 * prod(shape) for shape in lane_shapes(kernels.at)]
        lanes = cupy.cuda.alloc(count * sum(sizes))
        firsts = lanes.ptr + count * np.cumsum([0, *sizes[:-1]])
        own = firsts + np.arange(count)[:, None] * sizes
        there = given.addresses | written.addresses
        others = [[there[name] for name in Shared._fields]] * count
        given.arrays["tables"][...] = np.concatenate([own, others], axis=1)
        given.send(stream)
        warps((count,), (WARPS.lanes,), (given.addresses["tables"],))
        written.fetch(stream)
        stream.synchronize()
    return shared._replace(**written.arrays)


GPU = Target(WARPS, _on_warps)

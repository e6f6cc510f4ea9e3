"""Lanes on a GPU of NVIDIA's, a thread each: the functions of `kernels`, compiled to PTX by LLVM.

CuPy, which is optional, loads and starts them.
"""

import tempfile
from functools import cache
from pathlib import Path

import llvmlite.binding as llvm
import numpy as np

from jaxcrusher.batch.lanes.engine import Device
from jaxcrusher.batch.lanes.kernels import Kernels
from jaxcrusher.batch.lanes.layout import FIELDS, Control, Ends, Lanes, Shared, new_lanes
from jaxcrusher.batch.lanes.module import optimised
from jaxcrusher.batch.lanes.vector import WARPS

# The oldest that CUDA 13 knows; drivers compile its PTX for later ones.
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
# Of a multiprocessor: enough to hide that each waits for its numbers.
_WARPS_OF_EACH = 8


@cache
def ptx(text: str) -> bytes:
    """The functions of a text, and `warps`, for NVIDIA's driver."""
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    triple = "nvptx64-nvidia-cuda"
    target = llvm.Target.from_triple(triple).create_target_machine(cpu=_GENERATION, opt=3)
    own = text.replace('target triple = "unknown-unknown-unknown"', f'target triple = "{triple}"')
    return target.emit_assembly(optimised(own + _ENTRY, target)).encode()


def _on_warps(kernels: Kernels, control: Control, shared: Shared) -> None:
    """All in one go; it cannot be interrupted."""
    try:
        import cupy  # pyright: ignore[reportMissingImports]
    except ImportError:
        raise ImportError(
            "The engine `on_gpu` needs CuPy: pip install cupy-cuda13x, or cupy-cuda12x for CUDA 12."
        ) from None
    processors = cupy.cuda.Device().attributes["MultiProcessorCount"]
    count = min(-(-len(shared.starts) // WARPS.lanes), _WARPS_OF_EACH * processors)
    one = new_lanes(kernels.sizes, control, kernels.page, WARPS.lanes)
    lanes = Lanes(*(cupy.repeat(cupy.asarray(array[None]), count, axis=0) for array in one))
    there = Shared(*map(cupy.asarray, shared))
    addresses = [[part.data.ptr for part in (*own, *there)] for own in zip(*lanes, strict=True)]
    tables = cupy.asarray(np.array(addresses, np.uintp))
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "warps.ptx"
        file.write_bytes(ptx(kernels.text))
        warps = cupy.RawModule(path=str(file)).get_function("warps")
    warps((count,), (WARPS.lanes,), (tables,))
    for name in ("found", *Ends._fields):
        getattr(shared, name)[...] = getattr(there, name).get()


GPU = Device(WARPS, _on_warps)

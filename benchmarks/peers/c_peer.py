"""The crusher by hand in C (`crusher.c`), one design after the other or in lanes side by side.

Compiled when it is first asked for, by the compiler `cc` with the processor's own instructions; the
lanes' sines and powers are those of the vector library of glibc, where there is one.
"""

import ctypes
import shutil
import subprocess
import tempfile
from functools import cache
from pathlib import Path

import numpy as np

SOURCE = Path(__file__).with_name("crusher.c")
FLAGS = ("-std=gnu11", "-Ofast", "-march=native", "-fopenmp-simd", "-shared", "-fPIC")


def missing() -> str | None:
    """Return why there is no program in C, or None."""
    return None if shutil.which("cc") else "there is no C compiler `cc`"


@cache
def _folder() -> tempfile.TemporaryDirectory:
    """Return one folder until the end: a library in a deleted one's place would not load."""
    return tempfile.TemporaryDirectory(prefix="crusher")


@cache
def _compiled(lanes: int):
    """Return the function `integrate` of crusher.c for so many lanes."""
    library = Path(_folder().name) / f"crusher{lanes}.so"
    command = ["cc", *FLAGS, f"-DLANES={lanes}", "-o", str(library), str(SOURCE), "-lm"]
    subprocess.run(command, check=True)
    function = ctypes.CDLL(str(library)).integrate
    array = np.ctypeslib.ndpointer(float, flags="C_CONTIGUOUS")
    counts = np.ctypeslib.ndpointer(np.dtype(ctypes.c_long), flags="C_CONTIGUOUS")
    function.restype = None
    function.argtypes = [
        ctypes.c_int,
        array,
        array,
        ctypes.c_int,
        ctypes.c_int,
        ctypes.c_double,
        ctypes.c_double,
        array,
        counts,
    ]
    return function


def integrate(
    starts: np.ndarray,
    numbers: np.ndarray,
    settle: int,
    turns: int,
    rtol: float,
    h: float,
    lanes: int,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the mean of |R_O| + |R_C| squared and the steps of each design, as in `numba_peer`.

    `starts` of shape (designs, 5), `numbers` (designs, 24) by `numba_peer.numbers`; h in rad.
    """
    mean_square, steps = np.empty(len(starts)), np.empty(len(starts), ctypes.c_long)
    _compiled(lanes)(
        len(starts),
        np.ascontiguousarray(starts),
        np.ascontiguousarray(numbers),
        settle,
        turns,
        rtol,
        h,
        mean_square,
        steps,
    )
    return mean_square, steps

"""A GPU's lanes without a GPU: each of its threads as one of the processor's, side by side."""

import ctypes
import shutil
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from jaxcrusher.batch.engines import in_lanes, map_all, on_gpu
from jaxcrusher.lanes import machine
from jaxcrusher.lanes.layout import FIELDS
from jaxcrusher.lanes.machine import load
from tests.lanes.test_lanes import Swing, _run, _swings


class _There:
    """An array of CuPy, as far as it is used."""

    def __init__(self, array):
        self.array = np.ascontiguousarray(array).copy() if isinstance(array, np.ndarray) else array
        self.data = SimpleNamespace(ptr=self.array.ctypes.data)

    def __iter__(self):
        for part in self.array:
            view = _There.__new__(_There)
            view.array, view.data = part, SimpleNamespace(ptr=part.ctypes.data)
            yield view

    def get(self):
        return self.array


def _repeat(there, count, axis):
    return _There(np.repeat(there.array, count, axis))


class _Module:
    """Its kernel: every thread of every warp, eight at a time."""

    def __init__(self, path):
        self.machine = load(Path(path).read_text())

    def get_function(self, name):
        assert name == "warps"
        return self

    def __call__(self, warps, threads, operands):
        advance = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_int64)(self.machine["advance"])
        (tables,) = operands
        with ThreadPoolExecutor(8) as pool:
            for warp in range(*warps):
                place = tables.data.ptr + 8 * len(FIELDS) * warp
                list(pool.map(lambda lane, at=place: advance(at, lane), range(*threads)))


@pytest.fixture
def simulated(monkeypatch):
    """CuPy, whose device is the processor; it takes the text that PTX is made of, not PTX."""
    attributes = {"MultiProcessorCount": 1}
    device = SimpleNamespace(Device=lambda: SimpleNamespace(attributes=attributes))
    cupy = SimpleNamespace(asarray=_There, repeat=_repeat, RawModule=_Module, cuda=device)
    monkeypatch.setitem(sys.modules, "cupy", cupy)
    monkeypatch.setattr(machine, "ptx", str.encode)


def test_threads_agree_with_lanes(simulated):
    swings = _swings(80)
    stiffness = swings.stiffness.copy()
    stiffness[[3, 40]] = np.nan, 1e9
    swings = Swing(stiffness, swings.blow, swings.exponent)
    found, ends = map_all(_run, swings, engine=on_gpu)
    exact, expected = map_all(_run, swings, engine=in_lanes)
    np.testing.assert_array_equal(np.flatnonzero(~np.asarray(ends.success)), [3, 40])
    # The same instructions, but for the order of sums.
    assert np.abs(ends.steps - expected.steps).max() <= 1
    for name in exact:
        np.testing.assert_allclose(found[name], exact[name], rtol=0, atol=1e-11)


def test_the_text_is_taken_by_the_compiler_of_nvidia(simulated, monkeypatch, tmp_path):
    texts = []
    monkeypatch.setattr(machine, "ptx", lambda text: texts.append(text) or text.encode())
    map_all(_run, _swings(3), engine=on_gpu)
    monkeypatch.undo()
    code = machine.ptx(texts[0])
    assert b".visible .entry warps(" in code and b".extern" not in code
    if shutil.which("ptxas"):
        (tmp_path / "warps.ptx").write_bytes(code)
        subprocess.run(
            ["ptxas", "-arch=sm_90", "-o", "cubin", "warps.ptx"], cwd=tmp_path, check=True
        )

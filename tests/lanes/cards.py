"""CuPy without a card, whose threads are the processor's."""

import ctypes
import sys
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace

import numpy as np
import pytest

from jaxcrusher.lanes import card, machine
from jaxcrusher.lanes.layout import FIELDS


class Memory(np.ndarray):
    """Memory of the card or of the host, with an address; at first it holds no zeros."""

    @property
    def ptr(self):
        return self.ctypes.data


class Card:
    """CuPy, whose card is the processor, and how often it was used for what.

    It takes the text that PTX is made of, not PTX, and compiles that for the processor.
    """

    def __init__(self):
        self.used = Counter()
        device = SimpleNamespace(attributes={"MultiProcessorCount": 1}, id=0)
        self.cuda = SimpleNamespace(
            Device=lambda: device,
            Stream=lambda non_blocking: self.stream(),
            alloc=self.alloc,
            alloc_pinned_memory=self.pinned,
            function=SimpleNamespace(Module=self.module),
            runtime=SimpleNamespace(),
        )

    def pinned(self, size):
        return np.full(size, 0xA5, np.uint8).view(Memory)

    def alloc(self, size):
        memory = self.pinned(size)

        def copy(kind, target, source, size):
            self.used[kind] += 1
            ctypes.memmove(target, source, size)

        return SimpleNamespace(
            memory=memory,
            ptr=memory.ptr,
            copy_from_host_async=lambda host, n, stream: copy("up", memory.ptr, host, n),
            copy_to_host_async=lambda host, n, stream: copy("down", host, memory.ptr, n),
        )

    def stream(self):
        self.used["streams"] += 1
        return _Stream()

    def compile(self, text):
        self.used["compiled"] += 1
        return text.encode()

    def module(self):
        return _Module(self)


class _Stream:
    """A stream in which everything is done at once."""

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass

    def synchronize(self):
        pass


class _Module:
    """Its kernel: every thread of every warp, eight at a time."""

    def __init__(self, card):
        self._card = card

    def load(self, code):
        self._machine = machine.load(code.decode())

    def get_function(self, name):
        assert name == "warps"
        return self

    def __call__(self, warps, threads, operands):
        self._card.used["kernels"] += 1
        advance = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_int64)(self._machine["advance"])
        (tables,) = operands
        with ThreadPoolExecutor(8) as pool:
            for warp in range(*warps):
                place = tables + 8 * len(FIELDS) * warp
                list(pool.map(lambda lane, at=place: advance(at, lane), range(*threads)))


@pytest.fixture(name="simulated")
def simulated_card(monkeypatch, tmp_path):
    """The `Card`, with a folder of its own for machine code."""
    found = Card()
    monkeypatch.setitem(sys.modules, "cupy", found)
    monkeypatch.setattr(card, "ptx", found.compile)
    monkeypatch.setattr(card, "_STREAMS", [])
    monkeypatch.setattr(machine, "cache_folder", lambda: tmp_path)
    card._warps.cache_clear()
    yield found
    card._warps.cache_clear()

"""Machine code on disk: durable, whole, compiled once, and made anew where it is broken."""

import ctypes
import os
import threading
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from jaxcrusher.lanes import machine
from jaxcrusher.lanes.code import LANES, WIDTH, Code, Module


def _text(number):
    """A function that writes this number."""
    module = Module()
    code = Code(module, "part")
    code.write(np.float64(number), 0)
    code.end(by_name=True)
    return str(module)


def _written(loaded):
    """The number that it writes."""
    memory = np.zeros(LANES)
    kind = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_int64)
    kind(loaded["part"])(memory.ctypes.data, 0)
    assert (memory[:WIDTH] == memory[0]).all()
    return memory[0]


@pytest.fixture
def compiled(monkeypatch, tmp_path):
    """The texts that were compiled, with a folder of their own."""
    texts, optimised = [], machine.optimised
    monkeypatch.setattr(machine, "cache_folder", lambda: tmp_path)
    monkeypatch.setattr(machine, "optimised", lambda *of: texts.append(of[0]) or optimised(*of))
    machine._load.cache_clear()
    yield texts
    machine._load.cache_clear()


def _in_a_new_process(text):
    machine._load.cache_clear()
    return machine.load(text)


def test_the_next_process_finds_what_was_compiled(compiled, tmp_path):
    assert _written(machine.load(_text(2.5))) == 2.5
    assert _written(_in_a_new_process(_text(2.5))) == 2.5
    assert len(compiled) == 1
    assert _written(_in_a_new_process(_text(3.5))) == 3.5
    assert len(compiled) == 2 == len(list(tmp_path.iterdir()))


@pytest.mark.parametrize(
    "broken",
    [
        lambda content: b"",
        lambda content: content[:100],
        lambda content: content[: len(content) // 2],
        lambda content: content[:-1],
        lambda content: content[:200] + bytes([content[200] ^ 1]) + content[201:],
    ],
    ids=["empty", "start", "half", "end", "bit"],
)
def test_a_broken_file_is_made_anew(compiled, tmp_path, broken):
    machine.load(_text(2.5))
    (file,) = tmp_path.iterdir()
    content = file.read_bytes()
    file.write_bytes(broken(content))
    assert _written(_in_a_new_process(_text(2.5))) == 2.5
    assert len(compiled) == 2 and file.read_bytes() == content
    assert _written(_in_a_new_process(_text(2.5))) == 2.5
    assert len(compiled) == 2, "it would be made anew for ever"


def test_threads_compile_a_text_once(compiled, monkeypatch):
    slow = machine.optimised

    def optimised(*operands):
        time.sleep(0.05)
        return slow(*operands)

    monkeypatch.setattr(machine, "optimised", optimised)
    with ThreadPoolExecutor(4) as pool:
        found = list(pool.map(machine.load, [_text(2.5)] * 4))
    assert len(compiled) == 1 and all(one is found[0] for one in found)


def test_processes_that_compile_a_text_at_once_do_not_meet(compiled, monkeypatch, tmp_path):
    # The first one has written its file, which has no name yet, when the second one begins. A
    # thread that does not wait for the lock stands for a process.
    replaced, begun, go_on, replace = [], threading.Event(), threading.Event(), os.replace

    def slow(source, target):
        replaced.append(source)
        if len(replaced) == 1:
            begun.set()
            assert go_on.wait(60)
        replace(source, target)

    monkeypatch.setattr(os, "replace", slow)
    with ThreadPoolExecutor(1) as pool:
        first = pool.submit(machine._load.__wrapped__, _text(2.5))
        assert begun.wait(60)
        second = machine._load.__wrapped__(_text(2.5))
        go_on.set()
        assert _written(first.result()) == _written(second) == 2.5
    assert len(set(replaced)) == 2 == len(compiled) and len(list(tmp_path.iterdir())) == 1
    assert _written(_in_a_new_process(_text(2.5))) == 2.5
    assert len(compiled) == 2, "the file would not be whole"


def test_machine_code_is_on_the_disk_before_it_has_its_name(compiled, monkeypatch, tmp_path):
    synced = []
    monkeypatch.setattr(os, "fsync", lambda file: synced.append(list(tmp_path.iterdir())))
    machine.load(_text(2.5))
    ((partial,),), (file,) = synced, tmp_path.iterdir()
    assert partial != file and file.suffix == ".code"


def test_a_folder_that_cannot_be_written_is_no_error(compiled, monkeypatch, tmp_path):
    file = tmp_path / "file"
    file.write_text("no folder")
    monkeypatch.setattr(machine, "cache_folder", lambda: file)
    assert _written(machine.load(_text(2.5))) == 2.5

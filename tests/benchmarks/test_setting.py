"""Processes of their own: what they say arrives, and none is left behind."""

import os
import time

import pytest

from benchmarks.setting import run_apart


@pytest.fixture
def module(tmp_path, monkeypatch):
    """A program that says its process and cores, then waits or fails as asked."""
    (tmp_path / "speaker.py").write_text(
        "import json, os, sys, time\n"
        "cores = len(os.sched_getaffinity(0))\n"
        "print(json.dumps({'process': os.getpid(), 'cores': cores}), flush=True)\n"
        "time.sleep(float(sys.argv[1]))\n"
        "sys.exit(sys.argv[2])\n"
    )
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    return "speaker"


def test_failure_says_what_the_process_said(module):
    rows = run_apart(module, "0", "what is wrong", cores=1)
    assert next(rows)["cores"] == 1
    with pytest.raises(RuntimeError, match=r"^speaker 0 what is wrong failed: what is wrong$"):
        next(rows)


def test_who_stops_listening_ends_the_process(module):
    rows = run_apart(module, "3600", "", cores=1)
    process, began = next(rows)["process"], time.perf_counter()
    rows.close()
    with pytest.raises(ProcessLookupError):
        os.kill(process, 0)
    # Far below the hour that it would have slept, also on a busy machine.
    assert time.perf_counter() - began < 600

"""A process that imports the modules it is given, and runs pytest in copies of itself.

It reads a request a line, `{"words": [...], "seconds": ...}`, and answers with a line,
`{"status": ..., "said": ...}`.
"""

import contextlib
import importlib
import json
import os
import resource
import signal
import sys
import tempfile
import time
from collections.abc import Sequence
from typing import NoReturn


def run_pytest(words: Sequence[str], seconds: float) -> tuple[int | None, str]:
    """Return pytest's status, None if it takes longer, and what it says at the end.

    The seconds are the processor's, so that a busy machine judges as an idle one does. Tests that
    wait for ever, and compute nothing, are stopped after ten times as long.
    """
    limit = int(seconds) + 1
    with tempfile.TemporaryFile() as said:
        child = os.fork()
        if child == 0:
            _become_pytest(words, limit, said.fileno())
        end, found = time.monotonic() + 10 * seconds, (0, 0)
        try:
            while found[0] == 0 and time.monotonic() < end:
                time.sleep(0.05)
                found = os.waitpid(child, os.WNOHANG)
        finally:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(child, signal.SIGKILL)  # also what the tests have started
        if found[0] == 0:
            os.waitpid(child, 0)
        said.seek(0)
        status = os.waitstatus_to_exitcode(found[1])
        stopped = found[0] == 0 or status in (-signal.SIGXCPU, -signal.SIGKILL)
        return None if stopped else status, said.read().decode(errors="replace")


def _become_pytest(words: Sequence[str], limit: int, said: int) -> NoReturn:
    status = 70  # as of a fault of a program, where pytest itself fails
    try:
        os.setsid()
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        resource.setrlimit(resource.RLIMIT_CPU, (limit, limit + 1))
        for stream in (1, 2):
            os.dup2(said, stream)
        import pytest

        status = int(pytest.main(list(words)))
        sys.stdout.flush()
    finally:
        os._exit(status)  # never back into the loop of the process that it was copied from


def serve(modules: Sequence[str]) -> None:
    """Import modules, and answer requests until there are no more."""
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))  # so that the tests end with it
    for name in modules:
        importlib.import_module(name)
    for line in sys.stdin:
        status, said = run_pytest(**json.loads(line))
        print(json.dumps({"status": status, "said": said}), flush=True)

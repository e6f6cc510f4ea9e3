"""Progress in a file: lines where work begins, as it goes on, and where all of it is done."""

import io
import logging
import time

from rich.console import Console

import jaxcrusher.files.progress as module
from jaxcrusher.files.progress import progress, stages


def test_a_file_gets_two_lines_of_each_work_at_once():
    file = io.StringIO()
    with progress(Console(file=file)) as bars:
        bar = bars.add_task("orbits", total=3)
        assert file.getvalue() == "orbits: 3 to do\n"
        bars.update(bar, completed=2)
        assert file.getvalue().count("\n") == 1
        for _ in range(2):
            bars.update(bar, completed=3)
        assert file.getvalue() == "orbits: 3 to do\norbits: done after 0 s\n"


def test_a_terminal_gets_none():
    file = io.StringIO()
    with progress(Console(file=file, force_terminal=True)) as bars:
        bars.update(bars.add_task("orbits", total=3), completed=3)
    assert "to do" not in file.getvalue() and "done" not in file.getvalue()


def test_stages_are_lines_of_a_file():
    file, logger = io.StringIO(), logging.getLogger("jaxcrusher.orbits.search")
    with stages(Console(file=file), "solving"):
        logger.info("shooting for a period of %d", 2)
        logger.debug("not told")
    logger.info("not told either")
    assert file.getvalue() == "solving\nshooting for a period of 2\n"


def test_a_file_is_told_every_few_seconds_how_far_work_is(monkeypatch):
    """And nothing more of work that is done."""
    monkeypatch.setattr(module, "EVERY", 0.02)
    file = io.StringIO()
    with progress(Console(file=file)) as bars:
        done, bar = bars.add_task("scouts", total=1), bars.add_task("orbits", total=3)
        bars.update(done, completed=1)
        _wait_for(file, "orbits: 0 of 3, after 0 s\n")
        bars.update(bar, completed=2)
        _wait_for(file, "orbits: 2 of 3, after 0 s\n")
    assert file.getvalue().count("scouts") == 2
    # It ends with the bars.
    told = file.getvalue()
    time.sleep(0.1)
    assert file.getvalue().count("\n") <= told.count("\n") + 1


def _wait_for(file, line):
    began = time.monotonic()
    while line not in file.getvalue():
        assert time.monotonic() - began < 10, file.getvalue()
        time.sleep(0.01)

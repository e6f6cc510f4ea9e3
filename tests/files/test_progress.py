"""Progress in a file: a line where work begins, and one where all of it is done."""

import io
import logging

from rich.console import Console

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
    file, logger = io.StringIO(), logging.getLogger("jaxcrusher.orbits.tries")
    with stages(Console(file=file), "solving"):
        logger.info("shooting for a period of %d", 2)
        logger.debug("not told")
    logger.info("not told either")
    assert file.getvalue() == "solving\nshooting for a period of 2\n"

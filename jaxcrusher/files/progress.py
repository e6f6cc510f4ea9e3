"""Bars for long work, or lines where bars cannot move."""

import contextlib
import logging
import threading
from collections.abc import Iterator
from typing import Any

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from typing_extensions import override

# Seconds between two lines on work that goes on, where bars cannot move.
EVERY = 10.0


class Bars(Progress):
    """Bars that move in a terminal or a notebook; elsewhere, as in a file, lines for each.

    They are written at once: when its work begins, every ten seconds while it goes on, and when all
    of it is done.
    """

    @override
    def start(self) -> None:
        super().start()
        if self.disable:
            self._stopped = threading.Event()
            threading.Thread(target=self._tell, daemon=True).start()

    @override
    def stop(self) -> None:
        super().stop()
        if self.disable:
            self._stopped.set()

    def _tell(self) -> None:
        while not self._stopped.wait(EVERY):
            for task in self.tasks:
                if not task.finished:
                    done = f"{task.completed:g} of {task.total:g}"
                    line = f"{task.description}: {done}, after {task.elapsed or 0:.0f} s"
                    self.console.print(line, highlight=False, markup=False)

    @override
    def add_task(self, description: str, *args: Any, **settings: Any) -> TaskID:
        """Add a bar, with the settings of `rich.progress.Progress`."""
        if self.disable:
            total = settings.get("total")
            line = f"{description}: {total} to do" if total else description
            self.console.print(line, highlight=False, markup=False)
        return super().add_task(description, *args, **settings)

    @override
    def update(self, task_id: TaskID, **settings: Any) -> None:
        """Change a bar, as `rich.progress.Progress` does; say once that its work is done."""
        task = self._tasks[task_id]
        before = task.finished
        super().update(task_id, **settings)
        if self.disable and task.finished and not before:
            line = f"{task.description}: done after {task.elapsed or 0:.0f} s"
            self.console.print(line, highlight=False, markup=False)


def progress(console: Console | None = None, *, remaining: bool = True) -> Bars:
    """Bars with what is done and the time left, or the time spent where none can be foreseen."""
    console = Console() if console is None else console
    return Bars(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn() if remaining else TimeElapsedColumn(),
        console=console,
        disable=not (console.is_terminal or console.is_jupyter),
    )


@contextlib.contextmanager
def stages(console: Console, words: str) -> Iterator[None]:
    """Show what is done and what the package logs of it, in a file as lines."""
    still = not (console.is_terminal or console.is_jupyter)

    class Shown(logging.Handler):
        @override
        def emit(self, record: logging.LogRecord) -> None:
            if still:
                console.print(record.getMessage(), highlight=False, markup=False)
            else:
                status.update(f"{words}: {record.getMessage()}")

    logger, shown = logging.getLogger("jaxcrusher"), Shown()
    before = logger.level
    if still:
        console.print(words, highlight=False, markup=False)
    logger.addHandler(shown)
    logger.setLevel(logging.INFO)
    try:
        with console.status(words) as status:
            yield
    finally:
        logger.setLevel(before)
        logger.removeHandler(shown)

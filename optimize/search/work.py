"""The work of a search: its progress, its saved chunks, its cost, and its concurrent jobs."""

import time
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_EXCEPTION, ThreadPoolExecutor, wait
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from threading import Event
from typing import TYPE_CHECKING, Any

from rich.progress import Progress as Bars

from jaxcrusher.files.journal import Journal
from optimize.search.evaluate import Tracking

if TYPE_CHECKING:
    import distributed


class Stopped(Exception):
    """Raised in a stage after `Work.stop` is set: by a failure, by Ctrl-C, or after `seconds`."""


@dataclass(eq=False)
class Work:
    """The place where stages report progress, save results, and record their cost.

    Stages may run concurrently. After `stop` is set, a stage ends at its next report of progress.
    """

    folder: Path
    bars: Bars
    journal: Journal
    scheduler: "distributed.Client | None" = None
    stop: Event = field(default_factory=Event)
    seconds: dict[str, float] = field(default_factory=dict)
    steps: dict[str, int] = field(default_factory=dict)

    @contextmanager
    def stage(self, name: str, total: int) -> Iterator[Tracking]:
        """Show a progress bar for a stage, and record its seconds at its end."""
        bar = self.bars.add_task(name, total=total)
        began = time.perf_counter()

        def progress(done: int, _: int) -> None:
            self.bars.update(bar, completed=done)
            if self.stop.is_set():
                raise Stopped

        progress(0, total)
        yield Tracking(progress, self.journal, self.scheduler)
        self.bars.update(bar, completed=total)
        self.seconds[name] = time.perf_counter() - began

    def at_once(self, *jobs: Callable[[], Any]) -> list[Any]:
        """Run jobs concurrently, each in a thread; return their results in order.

        The first failure, or Ctrl-C, sets `stop`, which ends the other jobs. The failure is raised
        after all jobs have ended.
        """
        with ThreadPoolExecutor(len(jobs)) as pool:
            running = [pool.submit(job) for job in jobs]
            try:
                unfinished = wait(running, return_when=FIRST_EXCEPTION).not_done
            except KeyboardInterrupt:
                self.stop.set()
                raise
            if unfinished:
                self.stop.set()
        failures = [failure for job in running if (failure := job.exception())]
        for failure in sorted(failures, key=lambda one: isinstance(one, Stopped)):
            raise failure
        return [job.result() for job in running]

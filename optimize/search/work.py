"""The work of a search: what it tells, keeps and spends, and what of it runs at once."""

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
    """A piece of work raises this where another's failure or Ctrl-C has made it needless."""


@dataclass(eq=False)
class Work:
    """Where stages tell their progress, keep what they have computed, and book what they spend.

    Stages may run concurrently. Where `stop` is set they end when they next tell their progress.
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
        """Show a bar for a stage, and book its seconds when it ends."""
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
        """Run jobs on the cores that one of them leaves idle; return their results in order.

        At the first failure, and at Ctrl-C, `stop` is set, at which the other jobs end. The failure
        is raised when all have ended.
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

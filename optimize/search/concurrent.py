"""Independent pieces of work run concurrently, on the cores that one piece leaves idle."""

from collections.abc import Callable
from concurrent.futures import FIRST_EXCEPTION, ThreadPoolExecutor, wait
from threading import Event
from typing import Any


class Stopped(Exception):
    """A piece of work raises this where another's failure or Ctrl-C has made it needless."""


def run_concurrently(stop: Event, *jobs: Callable[[], Any]) -> list[Any]:
    """Run jobs concurrently, and return their results in the jobs' order.

    At the first failure, and at Ctrl-C, `stop` is set; the other jobs should look at it from time
    to time and raise `Stopped`. The failure is raised when all have ended.
    """
    with ThreadPoolExecutor(len(jobs)) as pool:
        running = [pool.submit(job) for job in jobs]
        try:
            unfinished = wait(running, return_when=FIRST_EXCEPTION).not_done
        except KeyboardInterrupt:
            stop.set()
            raise
        if unfinished:
            stop.set()
    failures = [failure for job in running if (failure := job.exception())]
    for failure in sorted(failures, key=lambda one: isinstance(one, Stopped)):
        raise failure
    return [job.result() for job in running]

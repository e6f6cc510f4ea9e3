"""Work that runs concurrently: its results, and how it ends early."""

import threading
import time

import pytest
from rich.progress import Progress

from jaxcrusher.files.journal import Journal
from optimize.search.work import Stopped, Work


@pytest.fixture
def work(tmp_path):
    return Work(tmp_path, Progress(), Journal(tmp_path))


def test_jobs_run_at_once_and_keep_their_order(work):
    meet = threading.Barrier(2)
    # One after the other they would wait for each other for good.
    found = work.at_once(lambda: (meet.wait(10), "a")[1], lambda: (meet.wait(10), "b")[1])
    assert found == ["a", "b"] and not work.stop.is_set()


def test_a_failure_stops_the_others_and_is_what_is_raised(work):
    ended = []

    def long():
        assert work.stop.wait(10)
        ended.append("long")
        raise Stopped

    def bad():
        raise ValueError("no such design")

    with pytest.raises(ValueError, match="no such design"):
        work.at_once(long, bad)
    assert ended == ["long"]


def test_an_interruption_waits_for_all(work, monkeypatch):
    ended = []

    def long():
        assert work.stop.wait(10)
        time.sleep(0.05)
        ended.append("long")
        raise Stopped

    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr("optimize.search.work.wait", interrupted)
    with pytest.raises(KeyboardInterrupt):
        work.at_once(long, long)
    assert ended == ["long", "long"]

"""Work that runs concurrently: its results, and how it ends early."""

import threading
import time

import pytest

from optimize.search.concurrent import Stopped, run_concurrently


def test_jobs_run_at_once_and_keep_their_order():
    stop, meet = threading.Event(), threading.Barrier(2)
    # One after the other they would wait for each other for good.
    assert run_concurrently(
        stop, lambda: (meet.wait(10), "a")[1], lambda: (meet.wait(10), "b")[1]
    ) == ["a", "b"]
    assert not stop.is_set()


def test_a_failure_stops_the_others_and_is_what_is_raised():
    stop, ended = threading.Event(), []

    def long():
        assert stop.wait(10)
        ended.append("long")
        raise Stopped

    def bad():
        raise ValueError("no such design")

    with pytest.raises(ValueError, match="no such design"):
        run_concurrently(stop, long, bad)
    assert ended == ["long"]


def test_an_interruption_waits_for_all(monkeypatch):
    stop, ended = threading.Event(), []

    def long():
        assert stop.wait(10)
        time.sleep(0.05)
        ended.append("long")
        raise Stopped

    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr("optimize.search.concurrent.wait", interrupted)
    with pytest.raises(KeyboardInterrupt):
        run_concurrently(stop, long, long)
    assert ended == ["long", "long"]

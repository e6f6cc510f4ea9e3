"""Every stiff and extreme case, judged beside the references that other processes make."""

import contextlib
import multiprocessing
import signal
import time
from collections.abc import Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from dataclasses import asdict
from pathlib import Path

from rich.console import Console

from benchmarks.stability import baumgarte, drift
from benchmarks.stability.cases import BASE, FORMULATIONS, Case, cases
from benchmarks.stability.figure import draw
from benchmarks.stability.inputs import inputs
from benchmarks.stability.judgement import DISAGREES, Judged, judge
from benchmarks.stability.page import page, summary
from benchmarks.stability.reference import Reference, reference
from jaxcrusher.files.progress import progress
from jaxcrusher.files.results import (
    read_table,
    results_folder,
    write_figure,
    write_table,
    write_text,
)

# Beside this process, which judges meanwhile.
WORKERS = 2
# Of one reference, s.
PATIENCE = 180.0


def judged(case: Case, known: Future[Reference]) -> list[Judged]:
    """Both formulations of a case; a case without a reference never passes."""
    try:
        found = known.result(PATIENCE)
    except (RuntimeError, TimeoutError, ZeroDivisionError, ValueError) as error:
        remark = f"no reference: {type(error).__name__} {error}"
        return [
            Judged(case.axis, case.value, case.start, kind, DISAGREES, "no", remark)
            for kind in FORMULATIONS
        ]
    return [judge(case, kind, found) for kind in FORMULATIONS]


@contextlib.contextmanager
def _pool() -> Iterator[ProcessPoolExecutor]:
    """Processes for the references. Ctrl-C is this process's to answer: it ends them."""
    pool = ProcessPoolExecutor(
        WORKERS,
        mp_context=multiprocessing.get_context("spawn"),
        initializer=signal.signal,
        initargs=(signal.SIGINT, signal.SIG_IGN),
    )
    try:
        yield pool
    finally:
        pool.shutdown(cancel_futures=True)


def run(out: Path) -> None:
    """Judge everything; write the page, the csv and the figure."""
    folder = results_folder(out)
    begin, console, rows = time.perf_counter(), Console(), []
    everything = list(cases())
    with _pool() as pool, progress(console) as bar:
        known = {}
        for case in everything:
            key = (case.crusher, *case.motion)
            if key not in known:
                known[key] = pool.submit(reference, *key)
        ended = {
            start: pool.submit(drift.reference, *Case("start", start, start, BASE).motion)
            for start in ("centred", "in contact")
        }
        for case in bar.track(everything, description="cases"):
            rows += judged(case, known[case.crusher, *case.motion])
        refused = list(bar.track(inputs(), 38, description="inputs"))
        long = list(
            bar.track(
                drift.measure({start: known.result() for start, known in ended.items()}),
                4,
                description="long runs",
            )
        )
        stabilised = list(bar.track(baumgarte.measure(), 52, description="Baumgarte"))
    write_table(folder / "stability.csv", map(asdict, rows + refused))
    write_figure(folder / "stability.png", draw(rows))
    minutes = (time.perf_counter() - begin) / 60
    write_text(folder / "stability.md", page(rows, refused, long, stabilised, minutes))
    console.print(summary(rows, refused))
    console.print(f"{folder / 'stability.md'}, .csv and .png")


def redraw(out: Path, table: Path) -> None:
    """The figure of an earlier run's rows, without a motion."""
    write_figure(results_folder(out) / "stability.png", draw(read_table(table, Judged)))

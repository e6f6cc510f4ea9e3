"""Every stiff and extreme case, judged beside the references that other processes make."""

import contextlib
import multiprocessing
import signal
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from dataclasses import asdict
from pathlib import Path

from rich.console import Console
from rich.progress import Progress

from benchmarks.stability import baumgarte, drift, seats
from benchmarks.stability.case import FORMULATIONS, AbstractCase, Formulation
from benchmarks.stability.cases import BASE, Case, cases
from benchmarks.stability.figure import draw, draw_seats
from benchmarks.stability.inputs import inputs
from benchmarks.stability.judgement import DISAGREES, Judged, judge
from benchmarks.stability.ours import Ours, motions
from benchmarks.stability.page import page, summary
from benchmarks.stability.peer import AbstractPeer, Pins
from benchmarks.stability.reference import Reference, reference
from benchmarks.stability.seats_page import seats_page
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


Motions = dict[Formulation, dict[AbstractCase, Ours | ValueError]]


def judged(case: AbstractCase, known: Future[Reference], ours: Motions) -> list[Judged]:
    """Both formulations of a case; a case without a reference never passes."""
    try:
        found = known.result(PATIENCE)
    except (RuntimeError, TimeoutError, ZeroDivisionError, ValueError) as error:
        remark = f"no reference: {type(error).__name__} {error}"
        return [
            Judged(case.axis, case.value, case.start, kind, DISAGREES, "no", remark)
            for kind in FORMULATIONS
        ]
    return [judge(case, kind, found, ours[kind][case]) for kind in FORMULATIONS]


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


Known = dict[tuple[AbstractPeer, Pins], Future[Reference]]


def _references(everything: Sequence[AbstractCase], pool: ProcessPoolExecutor) -> Known:
    """Those of every case, under way; cases alike share one."""
    known: Known = {}
    for case in everything:
        key = (case.peer, case.pins)
        if key not in known:
            known[key] = pool.submit(reference, *key)
    return known


def _all(everything: Sequence[AbstractCase], known: Known, bar: Progress) -> list[Judged]:
    """Every case: ours at once, then the verdicts, as references come."""
    kinds = bar.track(FORMULATIONS, description="motions")
    ours: Motions = {kind: motions(everything, kind) for kind in kinds}
    tracked = bar.track(everything, description="cases")
    return [row for case in tracked for row in judged(case, known[case.peer, case.pins], ours)]


def run(out: Path) -> None:
    """Judge everything of A; write the page, the csv and the figure."""
    folder = results_folder(out)
    begin, console = time.perf_counter(), Console()
    everything = list(cases())
    with _pool() as pool, progress(console) as bar:
        known = _references(everything, pool)
        ended = {
            start: pool.submit(drift.reference, Case("start", start, start, BASE).pins)
            for start in ("centred", "in contact")
        }
        rows = _all(everything, known, bar)
        refused = list(bar.track(inputs(), 38, description="inputs"))
        write_table(folder / "stability.csv", map(asdict, rows + refused))
        long = list(
            bar.track(
                drift.measure({start: known.result() for start, known in ended.items()}),
                4,
                description="long runs",
            )
        )
        stabilised = list(bar.track(baumgarte.measure(), 52, description="Baumgarte"))
    write_figure(folder / "stability.png", draw(rows))
    minutes = (time.perf_counter() - begin) / 60
    write_text(folder / "stability.md", page(rows, refused, long, stabilised, minutes))
    console.print(summary(rows, refused))
    console.print(f"{folder / 'stability.md'}, .csv and .png")


def run_seats(out: Path) -> None:
    """Judge everything of B and C; write their page, csv and figure."""
    folder = results_folder(out)
    begin, console = time.perf_counter(), Console()
    everything = list(seats.cases())
    with _pool() as pool, progress(console) as bar:
        rows = _all(everything, _references(everything, pool), bar)
    write_table(folder / "stability_seats.csv", map(asdict, rows))
    write_figure(folder / "stability_seats.png", draw_seats(rows))
    minutes = (time.perf_counter() - begin) / 60
    write_text(folder / "stability_seats.md", seats_page(rows, minutes))
    console.print(summary(rows, []))
    console.print(f"{folder / 'stability_seats.md'}, .csv and .png")


def redraw(out: Path, table: Path) -> None:
    """The figure of an earlier run's rows, without a motion."""
    rows = read_table(table, Judged)
    of_seats = any(row.axis == "loose" for row in rows)
    name, figure = ("stability_seats", draw_seats) if of_seats else ("stability", draw)
    write_figure(results_folder(out) / f"{name}.png", figure(rows))

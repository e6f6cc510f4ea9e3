"""Every stiff and extreme case, judged beside the references that other processes make."""

import contextlib
import multiprocessing
import signal
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from dataclasses import asdict
from pathlib import Path

from rich.progress import Progress

from benchmarks.pages import publish
from benchmarks.stability.case import FORMULATIONS, Case
from benchmarks.stability.cases import cases, seat_cases
from benchmarks.stability.figure import draw, draw_seats
from benchmarks.stability.inputs import inputs
from benchmarks.stability.judgement import DISAGREES, Judged, judge
from benchmarks.stability.ours import motions
from benchmarks.stability.reference import Reference, reference
from benchmarks.stability.tables import tables
from jaxcrusher.files.progress import progress
from jaxcrusher.files.results import results_folder

# Beside this process, which judges meanwhile.
WORKERS = 2
PATIENCE = 180.0  # s, for one reference
PAGES = {"bearing": "stability", "seats": "stability_seats"}
FIGURES = {"stability": draw, "stability_seats": draw_seats}


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


def _judged(everything: Sequence[Case], pool: ProcessPoolExecutor, bar: Progress) -> list[Judged]:
    """Run ours of all cases at once, and judge them as the references come; alike cases share one.

    A case without a reference never passes.
    """
    known = {}
    for case in everything:
        key = (case.peer, case.pins)
        known[key] = known.get(key) or pool.submit(reference, *key)
    kinds = bar.track(FORMULATIONS, description="motions")
    ours, rows = {kind: motions(everything, kind) for kind in kinds}, []
    for case in bar.track(everything, description="cases"):
        waited: Future[Reference] = known[case.peer, case.pins]
        try:
            found = waited.result(PATIENCE)
        except (RuntimeError, TimeoutError, ZeroDivisionError, ValueError) as error:
            remark = f"no reference: {type(error).__name__} {error}"
            labels = case.axis, case.value, case.start
            rows += [Judged(*labels, kind, DISAGREES, "no", remark) for kind in FORMULATIONS]
        else:
            rows += [judge(case, kind, found, ours[kind][case]) for kind in FORMULATIONS]
    return rows


def run(what: str, out: Path) -> None:
    """Judge the cases of the bearing or of the seats; write the page, the csv and the figure."""
    folder, begin, name = results_folder(out), time.perf_counter(), PAGES[what]
    with _pool() as pool, progress() as bar:
        rows = _judged(list(seat_cases() if what == "seats" else cases()), pool, bar)
        refused = [] if what == "seats" else list(bar.track(inputs(), 38, description="inputs"))
    publish(
        folder,
        f"{name}.md",
        tables(rows, refused, by_start=what == "bearing"),
        *("scikit-sundae", "numba"),
        rows=map(asdict, rows + refused),
        draw=lambda: FIGURES[name](rows),
        minutes=(time.perf_counter() - begin) / 60,
    )

"""`python -m benchmarks.stability`: every stiff and extreme case, judged; about eight minutes.

Writes docs/stability.md, docs/stability.csv and docs/stability.png.
"""

import multiprocessing
import time
from concurrent.futures import Future, ProcessPoolExecutor
from pathlib import Path

from rich.console import Console

import jaxcrusher as jc
from benchmarks.stability import baumgarte, drift
from benchmarks.stability.cases import BASE, FORMULATIONS, Case, cases
from benchmarks.stability.figure import draw
from benchmarks.stability.inputs import inputs
from benchmarks.stability.judgement import DISAGREES, Judged, judge
from benchmarks.stability.page import page, summary, write_csv
from benchmarks.stability.reference import Reference, reference
from jaxcrusher.files.results import progress

DOCS = Path(__file__).parents[2] / "docs"
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


def main() -> None:
    """Judge everything; write the page, the csv and the figure."""
    begin, console, rows = time.perf_counter(), Console(), []
    everything = list(cases())
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(WORKERS, mp_context=context) as pool, progress(console) as bar:
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
    write_csv(DOCS / "stability.csv", rows + refused)
    draw(DOCS / "stability.png", rows)
    minutes = (time.perf_counter() - begin) / 60
    text = page(rows, refused, long, stabilised, minutes)
    (DOCS / "stability.md").write_text(text)
    console.print(summary(rows, refused))
    console.print(f"Wrote {DOCS / 'stability.md'}, .csv and .png")


if __name__ == "__main__":
    jc.set_up()
    main()

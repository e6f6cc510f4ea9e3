"""Integrations of many designs by lanes, on all cores."""

import os
from collections.abc import Callable
from concurrent.futures import FIRST_EXCEPTION, ThreadPoolExecutor, wait
from pathlib import Path
from typing import Any, NamedTuple

import jax
import numpy as np
from jaxtyping import PyTree

from jaxcrusher.batch.lanes import stepper
from jaxcrusher.batch.lanes.layout import (
    DONE,
    FREE,
    LANES,
    Batch,
    Designs,
    Ends,
    Method,
    Sizes,
    new_lanes,
    new_rows,
)
from jaxcrusher.batch.lanes.module import load

# Of segments that wait to be summarised, in each thread.
ROWS_BYTES = 2_000_000


class Found(NamedTuple):
    """What a batch came to."""

    summaries: PyTree  # leaves of shape (designs, segments, ...)
    ends: Ends


def run(
    text: str,
    sizes: Sizes,
    designs: Designs,
    method: Method,
    summarise: Callable[[Any, Any], PyTree],
    threads: int | None = None,
) -> Found:
    """Integrate the designs with the equations of the module `text`.

    `summarise` takes of a number of segments what was seen at their instants, shape (segments,
    instants, observed), and the states at their ends, shape (segments, states); from a failure on
    they are NaN. The bits of a design depend on its own numbers only. Interrupted, all threads end
    within milliseconds.
    """
    equations: Any = load(text)
    advance = load(Path(stepper.__file__).read_text("utf-8")).advance
    count, (_, segments, instants) = len(designs.starts), designs.times.shape
    room = ROWS_BYTES // (8 * LANES * max(sizes.observed * instants, sizes.states))
    size = LANES * min(max(room, 2), 64)
    ends = Ends(np.zeros(count, np.int64), np.zeros(count), np.zeros(count, np.int64))
    next_design, stop = np.zeros(1, np.int64), np.zeros(1, np.int64)

    def fill(like: Any) -> np.ndarray:
        leaf = np.asarray(like)[0]
        return np.broadcast_to(leaf, (count, segments, *leaf.shape)).copy()

    blank = new_rows(size, sizes, instants)
    summaries = jax.tree.map(fill, summarise(blank.seen[:, :instants], blank.last))
    leaves = jax.tree.leaves(summaries)

    def work() -> None:
        rows, lanes = new_rows(size, sizes, instants), new_lanes(sizes)
        batch = Batch(sizes, designs, method, ends, next_design, stop, rows)
        functions = equations.prepare, equations.field, equations.observe
        more = True
        while more:
            more = advance(*functions, batch, lanes)
            done = np.flatnonzero(rows.state == DONE)
            if done.size:
                place = rows.design[done], rows.segment[done]
                found = jax.tree.leaves(summarise(rows.seen[:, :instants], rows.last))
                for whole, part in zip(leaves, found, strict=True):
                    whole[place] = np.asarray(part)[done]
                rows.state[done] = FREE

    threads = min(threads or cores(), -(-count // LANES))
    with ThreadPoolExecutor(threads) as pool:
        futures = [pool.submit(work) for _ in range(threads)]
        try:
            wait(futures, return_when=FIRST_EXCEPTION)
        finally:
            stop[0] = 1
    for future in futures:
        future.result()
    return Found(summaries, ends)


def cores() -> int:
    """The cores this process may use; not every system tells."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1

"""Searches for many orbits at once, each in a thread: the turns that they ask for are gathered.

A search is written as if it were alone (`jaxcrusher.orbits.search`). Lanes integrate the turns that
many of them ask for, all at once, in a fraction of the time.
"""

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from queue import Empty, SimpleQueue
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, PyTree
from typing_extensions import override

from jaxcrusher.basics.devices import devices
from jaxcrusher.batch.engines import Engine, run_all
from jaxcrusher.lanes.code import LANES
from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.orbits.transient import (
    FINE,
    PIECE,
    TRANSIENT_RTOL,
    Ends,
    Lone,
    NextTurns,
    SceneAt,
    section_points,
)

# Searches at once: their turns fill the lanes of some cores.
SEARCHES = 256
# Seconds without a new demand, after which what is asked for is integrated. A piece of one search
# takes 60 ms, and one of four hardly longer; most searches ask again within 3 ms.
QUIET = 0.01
# What searches ask for: turns, their tolerance and the most steps of each, from section points.
How = tuple[int, float, int | None]
_Asked = tuple[How, list[tuple[Any, Scene]], Future[NextTurns]]


class Gathered(Lone):
    """Turns of many searches, each in a thread of its own."""

    def __init__(self) -> None:
        self.events: SimpleQueue[_Asked | None] = SimpleQueue()  # None: a search has ended

    @override
    def piece(self, case: SceneAt, most: int | None) -> NextTurns:
        turns = self._asked((PIECE, TRANSIENT_RTOL, most), [case])
        return jax.tree.map(lambda leaf: leaf[0], turns)

    @override
    def turn(self, states: Float[np.ndarray, "n dims"], scene: Scene) -> Ends:
        ends, _, outcome = self._asked((1, FINE, None), [(state, scene) for state in states])
        return ends[:, 0], int(np.sum(outcome.steps))

    def _asked(self, how: How, cases: list[tuple[Any, Scene]]) -> NextTurns:
        future = Future[NextTurns]()
        self.events.put((how, cases, future))
        return future.result()


def together(
    search: Callable[..., PyTree],
    cases: PyTree,
    engine: Engine | None = None,
    tell: Callable[[], None] = lambda: None,
) -> PyTree:
    """Return the result of a search for each of stacked cases.

    Cases that only fill a chunk are skipped: their first part is NaN.

    Turns are integrated by an `engine` of `jaxcrusher.batch.engines`. `tell` is called after each
    integration, and may raise an error, which ends all searches.
    """
    first, runs = jax.tree.leaves(cases[0]), Gathered()
    known = np.flatnonzero(~np.any([np.isnan(x).reshape(len(x), -1).any(1) for x in first], axis=0))

    def one(case: int) -> PyTree:
        try:
            return search(jax.tree.map(lambda leaf: jnp.asarray(leaf[case]), cases), runs)
        finally:
            runs.events.put(None)

    waiting: list[_Asked] = []
    with ThreadPoolExecutor(len(known)) as pool:
        begun = [pool.submit(one, case) for case in known.tolist()]
        going = len(begun)
        try:
            while going:
                try:
                    event = runs.events.get(timeout=QUIET if waiting else None)
                except Empty:  # all others are about something else, such as Newton's method
                    ready = True
                else:
                    if event is None:
                        going -= 1
                    else:
                        waiting.append(event)
                    # No more than what fills the lanes is waited for.
                    ready = len(waiting) >= min(going, 2 * LANES * len(devices()))
                if waiting and ready:
                    for how in {how for how, *_ in waiting}:
                        _integrate(how, [one for one in waiting if one[0] == how], engine)
                    waiting.clear()
                    tell()
        finally:
            for *_, future in waiting:
                future.cancel()
            while going:
                if (event := runs.events.get()) is None:
                    going -= 1
                else:
                    event[2].cancel()
    rows = [future.result() for future in begun]
    found = jax.tree.map(lambda *of: np.stack(of), *rows)
    return jax.tree.map(lambda column: _spread(column, known, len(first[0])), found)


def _spread(column: np.ndarray, known: np.ndarray, count: int) -> np.ndarray:
    """Return a column with zeros where a case was skipped."""
    whole = np.zeros((count, *column.shape[1:]), column.dtype)
    whole[known] = column
    return whole


def _integrate(how: How, asked: list[_Asked], engine: Engine | None) -> None:
    """Integrate what was asked for in one way, and hand each search its own."""
    turns, rtol, most = how
    function = eqx.Partial(section_points, turns=turns, rtol=rtol, most=most)
    cases = [case for _, of_one, _ in asked for case in of_one]
    stacked = jax.tree.map(lambda *leaves: np.stack(leaves), *cases)
    seen, first = run_all(function, stacked, len(cases), engine, whole=LANES), 0
    for _, of_one, future in asked:
        part = slice(first, first := first + len(of_one))
        future.set_result(jax.tree.map(lambda leaf, part=part: leaf[part], seen))

"""Time measured as medians of several runs, taken in turn, the first one apart."""

import math
import time
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple, TypeVar

import jax
import numpy as np

Key = TypeVar("Key")


class Spent(NamedTuple):
    """Seconds by the clock, and of the processor on all cores: others' work does not count."""

    wall: float
    cpu: float


class Timed(NamedTuple):
    """The first run of a program, the median of its later runs, and the result of the last one."""

    first: Spent
    again: Spent
    found: Any


def spent(run: Callable[[], Any]) -> tuple[Spent, Any]:
    """Run once; return the time and the result."""
    began = time.perf_counter(), time.process_time()
    found = jax.block_until_ready(run())
    return Spent(time.perf_counter() - began[0], time.process_time() - began[1]), found


def timed_in_turn(
    programs: Mapping[Key, Callable[[], Any]],
    repeats: int = 5,
    least: float = 0.0,
    most: float = math.inf,
) -> dict[Key, Timed]:
    """Time programs in turn, so that a slow moment of the machine meets all of them.

    After the first round there are `repeats` rounds; more, until they took `least` seconds;
    fewer, but one, once they took `most`.
    """
    runs: dict[Key, list[tuple[Spent, Any]]] = {name: [] for name in programs}
    rounds, total = -1, 0.0
    while rounds < 1 or (total < most and (rounds < repeats or total < least)):
        for name, program in programs.items():
            runs[name].append(spent(program))
            total += runs[name][-1][0].wall if rounds >= 0 else 0.0
        rounds += 1
    return {
        name: Timed(done[0][0], Spent(*np.median([s for s, _ in done[1:]], axis=0)), done[-1][1])
        for name, done in runs.items()
    }


def timed(program: Callable[[], Any], *how: float) -> Timed:
    """Time one program as `timed_in_turn` does, whose arguments `how` are."""
    return timed_in_turn({"": program}, *how)[""]  # pyright: ignore[reportArgumentType]

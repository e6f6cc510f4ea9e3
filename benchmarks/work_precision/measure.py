"""Errors and times of every program on a case; each row as soon as it is known."""

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from benchmarks.work_precision import ours
from benchmarks.work_precision.cases import Answer, Case, Reference, differences
from benchmarks.work_precision.others import Peer

# A median needs no more runs, nor more seconds.
RUNS, ENOUGH = 7, 1.0
# The settings after one that took so long (s) are left out.
TOO_LONG = 10.0


@dataclass(frozen=True)
class Row:
    """One program at one setting; NaN where it has none or did not get there."""

    scene: str
    program: str
    setting: str
    rms_error: float = np.nan  # relative
    history_error: float = np.nan  # largest, over the largest force
    slope_error: float = np.nan  # relative
    compile_s: float = np.nan  # trace and compile; NaN where an earlier row's program served
    first_s: float = np.nan
    run_s: float = np.nan  # median of the next runs
    slope_compile_s: float = np.nan
    slope_run_s: float = np.nan  # of the value and its slope
    steps: int | None = None
    failure: str = ""


def _timed(function: Callable[[], Any]) -> tuple[Any, float, float]:
    """Result, seconds of the first run, and median seconds of the next."""
    seconds, began = [], time.perf_counter()
    found = function()
    first = time.perf_counter() - began
    while not seconds or (len(seconds) < RUNS and sum(seconds) + first < ENOUGH):
        began = time.perf_counter()
        function()
        seconds.append(time.perf_counter() - began)
    return found, first, float(np.median(seconds))


class Compiled:
    """Our programs, each compiled once for all cases and settings that share it."""

    def __init__(self):
        """None yet."""
        self.programs = {}

    def __call__(self, function: Callable, run: ours.Run, case: Case):
        """The program as a function of nothing, and seconds of its compilation (NaN: known)."""
        arguments = (run.scene, jnp.asarray(case.angles), run.method)
        if run.single:
            arguments = jax.tree.map(_in_32_bits, arguments)
        numbers, rest = eqx.partition(arguments, eqx.is_array)
        key, seconds = (function, jax.tree.structure(numbers), run.single), np.nan
        if key not in self.programs:

            def program(numbers):
                return eqx.filter(function(*eqx.combine(numbers, rest)), eqx.is_array)

            began = time.perf_counter()
            self.programs[key] = jax.jit(program).lower(numbers).compile()
            seconds = time.perf_counter() - began
        compiled = self.programs[key]
        return lambda: jax.block_until_ready(compiled(numbers)), seconds


def _in_32_bits(leaf):
    floating = eqx.is_array(leaf) and jnp.issubdtype(leaf.dtype, jnp.floating)
    return jnp.asarray(leaf, jnp.float32) if floating else leaf


def of_ours(
    case: Case, exact: Reference, compiled: Compiled, runs: list[ours.Run]
) -> Iterator[Row]:
    """Rows of this package; with slopes where the run wants them."""

    def measure(run: ours.Run) -> tuple[Row, float]:
        with jax.enable_x64(not run.single):
            return _our_row(case, exact, compiled, run)

    return _rows(case, runs, measure)


def of_peers(case: Case, exact: Reference, peers: list[Peer]) -> Iterator[Row]:
    """Rows of the other programs, which have no slopes."""

    def measure(peer: Peer) -> tuple[Row, float]:
        (answer, steps), first, run_s = _timed(peer.solve)
        row = Row(
            case.name,
            peer.program,
            peer.setting,
            *differences(answer, exact.answer),
            first_s=first,
            run_s=run_s,
            steps=steps,
        )
        return row, run_s

    return _rows(case, peers, measure)


def _rows(case: Case, runs: Sequence[Any], measure: Callable) -> Iterator[Row]:
    """`measure` gives the row of a run and its seconds; one that fails does not lose the others."""
    slow = set()
    for run in runs:
        if run.program in slow:
            yield Row(case.name, run.program, run.setting, failure="left out: too slow before")
            continue
        try:
            row, seconds = measure(run)
        except Exception as error:
            reason = " ".join(f"{type(error).__name__}: {error}".split())[:160]
            yield Row(case.name, run.program, run.setting, failure=reason)
            continue
        if seconds > TOO_LONG:
            slow.add(run.program)
        yield row


def _our_row(case: Case, exact: Reference, compiled: Compiled, run: ours.Run) -> tuple[Row, float]:
    program, compile_s = compiled(ours.solve, run, case)
    (rms, history, outcome), first, run_s = _timed(program)
    if not outcome.success:
        raise RuntimeError(f"stopped at {float(outcome.reached):.3g} rad")
    errors = differences(Answer(float(rms), np.asarray(history, float)), exact.answer)
    slope_error, slope_compile_s, slope_s = np.nan, np.nan, np.nan
    if run.with_slope:
        program, slope_compile_s = compiled(ours.slope, run, case)
        (_, slope), _, slope_s = _timed(program)
        slope_error = abs(float(slope) / exact.slope - 1)
    row = Row(
        case.name,
        run.program,
        run.setting,
        *errors,
        slope_error,
        compile_s,
        first,
        run_s,
        slope_compile_s,
        slope_s,
        int(outcome.steps),
    )
    return row, max(run_s, np.nan_to_num(slope_s))

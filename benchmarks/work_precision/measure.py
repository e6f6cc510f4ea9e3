"""Errors and times of every program on a case; each row as soon as it is known."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from benchmarks.timing import spent, timed
from benchmarks.work_precision import ours
from benchmarks.work_precision.cases import Answer, Case, Reference, differences
from benchmarks.work_precision.others import Peer

# Repeats of a run, and their least and most seconds.
HOW = (7, 0.0, 1.0)
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


class Compiled:
    """Our programs, each compiled once for all cases and settings that share it."""

    def __init__(self):
        """None yet."""
        self.programs = {}

    def __call__(self, function: Callable, run: ours.Run, case: Case):
        """Return the program without arguments, and seconds of its compilation (NaN if known)."""
        arguments = (run.scene, jnp.asarray(case.angles), run.method)
        if run.single:
            arguments = jax.tree.map(_in_32_bits, arguments)
        numbers, rest = eqx.partition(arguments, eqx.is_array)
        key, seconds = (function, jax.tree.structure(numbers), run.single), np.nan
        if key not in self.programs:

            def program(numbers):
                return eqx.filter(function(*eqx.combine(numbers, rest)), eqx.is_array)

            made, self.programs[key] = spent(lambda: jax.jit(program).lower(numbers).compile())
            seconds = made.wall
        compiled = self.programs[key]
        return lambda: compiled(numbers), seconds


def _in_32_bits(leaf):
    floating = eqx.is_array(leaf) and jnp.issubdtype(leaf.dtype, jnp.floating)
    return jnp.asarray(leaf, jnp.float32) if floating else leaf


def of_ours(
    case: Case, exact: Reference, compiled: Compiled, runs: list[ours.Run]
) -> Iterator[Row]:
    """Yield rows of this package; with slopes where the run wants them."""

    def measure(run: ours.Run) -> tuple[Row, float]:
        with jax.enable_x64(not run.single):
            return _our_row(case, exact, compiled, run)

    return _rows(case, runs, measure)


def of_peers(case: Case, exact: Reference, peers: list[Peer]) -> Iterator[Row]:
    """Yield rows of the other programs, which have no slopes."""

    def measure(peer: Peer) -> tuple[Row, float]:
        first, again, (answer, steps) = timed(peer.solve, *HOW)
        row = Row(
            case.name,
            peer.program,
            peer.setting,
            *differences(answer, exact.answer),
            first_s=first.wall,
            run_s=again.wall,
            steps=steps,
        )
        return row, again.wall

    return _rows(case, peers, measure)


def _rows(case: Case, runs: Sequence[Any], measure: Callable) -> Iterator[Row]:
    """Yield the row of every run by `measure`, which gives row and seconds, or of its failure."""
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
    first, again, (rms, history, outcome) = timed(program, *HOW)
    if not outcome.success:
        raise RuntimeError(f"stopped at {float(outcome.reached):.3g} rad")
    errors = differences(Answer(float(rms), np.asarray(history, float)), exact.answer)
    slope_error, slope_compile_s, slope_s = np.nan, np.nan, np.nan
    if run.with_slope:
        program, slope_compile_s = compiled(ours.slope, run, case)
        _, slope_again, (_, slope) = timed(program, *HOW)
        slope_s = slope_again.wall
        slope_error = abs(float(slope) / exact.slope - 1)
    row = Row(
        case.name,
        run.program,
        run.setting,
        *errors,
        slope_error,
        compile_s,
        first.wall,
        again.wall,
        slope_compile_s,
        slope_s,
        int(outcome.steps),
    )
    return row, max(again.wall, np.nan_to_num(slope_s))

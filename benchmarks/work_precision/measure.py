"""Errors and times of every program on a case; each row as soon as it is known."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace

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


def measured(
    case: Case, exact: Reference, compiled: Compiled, runs: Iterable[ours.Run | Peer]
) -> Iterator[Row]:
    """Yield the row of every run; one that fails does not lose the others."""
    slow = set()
    for run in runs:
        row = Row(case.name, run.program, run.setting)
        if run.program in slow:
            yield replace(row, failure="left out: too slow before")
            continue
        try:
            if isinstance(run, Peer):
                row = _of_peer(row, exact, run)
            else:
                with jax.enable_x64(not run.single):
                    row = _of_ours(row, case, exact, compiled, run)
        except Exception as error:
            reason = " ".join(f"{type(error).__name__}: {error}".split())[:160]
            row = replace(row, failure=reason)
        if max(row.run_s, np.nan_to_num(row.slope_run_s)) > TOO_LONG:
            slow.add(run.program)
        yield row


def _of_peer(row: Row, exact: Reference, peer: Peer) -> Row:
    """Measure another program, which has no slopes."""
    first, again, (answer, steps) = timed(peer.solve, *HOW)
    rms, history = differences(answer, exact.answer)
    seen = replace(row, rms_error=rms, history_error=history, steps=steps)
    return replace(seen, first_s=first.wall, run_s=again.wall)


def _of_ours(row: Row, case: Case, exact: Reference, compiled: Compiled, run: ours.Run) -> Row:
    """Measure this package, with slopes where the run wants them."""
    program, compile_s = compiled(ours.solve, run, case)
    first, again, (rms, history, outcome) = timed(program, *HOW)
    if not outcome.success:
        raise RuntimeError(f"stopped at {float(outcome.reached):.3g} rad")
    errors = differences(Answer(float(rms), np.asarray(history, float)), exact.answer)
    row = replace(
        row,
        rms_error=errors[0],
        history_error=errors[1],
        compile_s=compile_s,
        first_s=first.wall,
        run_s=again.wall,
        steps=int(outcome.steps),
    )
    if not run.with_slope:
        return row
    program, compile_s = compiled(ours.slope, run, case)
    _, again, (_, slope) = timed(program, *HOW)
    error = abs(float(slope) / exact.slope - 1)
    return replace(row, slope_error=error, slope_compile_s=compile_s, slope_run_s=again.wall)

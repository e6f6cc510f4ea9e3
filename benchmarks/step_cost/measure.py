"""The measurements of one process."""

from collections.abc import Iterator
from typing import Any

from benchmarks.peers import c_peer
from benchmarks.step_cost import fewer, profile, programs, registers, tables

# Start and whole turns. With the slip of the surfaces the centred start ends in the whirl.
MOTIONS: dict[str, tuple[programs.Start, int]] = {
    "quiet": ("contact", 2),
    "impacting": ("centred", 1),
}


def costs(motion: str, flag: str) -> Iterator[dict[str, Any]]:
    """Yield the cost of each program; `flag` is "loop flag" or "no flag" of XLA."""
    designs = programs.designs(*MOTIONS[motion])
    asked = {
        tables.OURS: programs.in_lanes(designs),
        tables.TURN: programs.in_turn(designs),
        tables.VMAP: programs.vmap(designs),
        tables.NUMBA: programs.numba(designs),
    }
    if flag == "loop flag":
        asked[tables.PLAIN] = programs.plain_map(designs)
        if c_peer.missing() is None:
            asked |= {name: programs.c(designs, lanes) for name, lanes in tables.C.items()}
    # Runs without the flag take long.
    found = programs.costs(asked, 5 if flag == "loop flag" else 3)
    numba = found[tables.NUMBA]
    for name, cost in found.items():
        yield {
            "motion": motion,
            "program": name,
            "XLA": flag,
            "wall_us": 1e6 * cost.wall,
            "cpu_us": 1e6 * cost.cpu,
            "in_numba": cost.cpu / numba.cpu,
            "first_s": cost.first,
            "steps": int(cost.found.steps.sum()),
            "difference": float(abs(cost.found.rms / numba.found.rms - 1).max()),
        }


def profiled() -> Iterator[dict[str, Any]]:
    """Yield operations, instructions and the time of an evaluation of the quiet motion."""
    designs = programs.designs(*MOTIONS["quiet"])
    yield {
        "operations": profile.counts(designs),
        "instructions": registers.counts(designs),
        "nanoseconds": {
            "lanes": registers.evaluation(designs),
            "XLA, one after the other": profile.evaluation(designs),
        },
    }


def steps() -> Iterator[dict[str, Any]]:
    """Yield every method on every motion, then how far apart two references are."""
    yield from fewer.measure()

"""What one process measures."""

from collections.abc import Callable
from typing import Any

from benchmarks.peers import c_peer
from benchmarks.step_cost import fewer, profile, programs, registers, report

# Start and whole turns. With the slip of the surfaces the centred start ends in the whirl.
MOTIONS: dict[str, tuple[programs.Start, int]] = {
    "quiet": ("contact", 2),
    "impacting": ("centred", 1),
}
# Of a run; fewer where a run takes long.
REPEATS = {"loop flag": 5, "no flag": 3}


def measure(what: str, motion: str, flag: str, advance: Callable[[int], None]) -> Any:
    """The answer of a job of `benchmarks.step_cost`; `advance` hears the number of its parts."""
    if what == "costs":
        return _costs(motion, flag, advance)
    if what == "profile":
        designs = programs.designs(*MOTIONS[motion])
        in_lanes = registers.counts(designs), registers.evaluation(designs)
        return profile.counts(designs), profile.evaluation(designs), *in_lanes
    total = len(fewer.methods())
    return fewer.measure(lambda: advance(total))


def _costs(motion: str, flag: str, advance: Callable[[int], None]) -> list[dict]:
    designs = programs.designs(*MOTIONS[motion])
    asked = {
        report.OURS: programs.in_lanes(designs),
        report.TURN: programs.in_turn(designs),
        report.VMAP: programs.vmap(designs),
        report.NUMBA: programs.numba(designs),
    }
    if flag == "loop flag":
        asked[report.PLAIN] = programs.plain_map(designs)
        if c_peer.missing() is None:
            asked |= {name: programs.c(designs, lanes) for name, lanes in report.C.items()}
    total = len(asked) * (REPEATS[flag] + 1)
    costs = programs.costs(asked, REPEATS[flag], lambda: advance(total))
    rms = costs[report.NUMBA].found.rms
    return [
        {
            "motion": motion,
            "program": name,
            "XLA": flag,
            "wall_us": 1e6 * cost.wall,
            "cpu_us": 1e6 * cost.cpu,
            "in_numba": cost.cpu / costs[report.NUMBA].cpu,
            "first_s": cost.first,
            "steps": int(cost.found.steps.sum()),
            "difference": float(abs(cost.found.rms / rms - 1).max()),
        }
        for name, cost in costs.items()
    ]

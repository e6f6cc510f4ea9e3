"""`python -m benchmarks.step_cost`: what a step costs beside other programs, and how many it takes.

Every measurement runs in a process of its own, on one core. Writes docs/step_cost.md,
docs/step_cost.csv and docs/step_cost_steps.csv.
"""

import json
import os
import subprocess
import sys
from collections.abc import Callable

import jax
from rich.console import Console

import jaxcrusher as jc
from benchmarks.peers import c_peer
from benchmarks.setting import NOTHING_KEPT
from benchmarks.step_cost import fewer, profile, programs, report
from jaxcrusher.files.results import progress

# Start and whole turns. With the slip of the surfaces the centred start ends in the whirl.
MOTIONS: dict[str, tuple[programs.Start, int]] = {
    "quiet": ("contact", 2),
    "impacting": ("centred", 1),
}
# Of a run; fewer where a run takes long.
REPEATS = {"loop flag": 5, "no flag": 3}


def main() -> None:
    """Run every measurement, one after the other, and write page and tables."""
    console = Console()
    if c_peer.missing():
        console.print(f"The programs in C are left out: {c_peer.missing()}.")
    if not hasattr(os, "sched_setaffinity"):
        console.print("This system does not pin a process to a core: times may be of several.")
    jobs = [("costs", motion, flag) for flag in ("loop flag", "no flag") for motion in MOTIONS]
    jobs += [("profile", "quiet", "loop flag"), ("fewer", "", "loop flag")]
    found = []
    with progress(console) as bars:
        for job in jobs:
            bar = bars.add_task(", ".join(part for part in job if part), total=None)
            found.append(
                _ask(
                    job, lambda done, total, bar=bar: bars.update(bar, completed=done, total=total)
                )
            )
    costs = [row for rows in found[: len(MOTIONS) * 2] for row in rows]
    console.print(report.write(costs, *found[-2], *found[-1]))


def _ask(job: tuple[str, ...], tell: Callable[[int, int], None]):
    """The answer of a process that measures `job`; `tell` hears how far it is."""
    process = subprocess.Popen(
        [sys.executable, "-m", "benchmarks.step_cost", *job],
        env=os.environ | NOTHING_KEPT,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    answer = None
    for line in process.stdout:
        said = json.loads(line)
        if "answer" in said:
            answer = said["answer"]
        else:
            tell(said["done"], said["total"])
    if process.wait() or answer is None:
        raise RuntimeError(f"The measurement {job} failed: its process said why above.")
    return answer


def _work(what: str, motion: str, flag: str) -> None:
    """Measure in this process, on one core, and say what was found."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    # Without the flag nothing else is set; one core means one device anyway.
    if flag == "loop flag":
        jc.set_up()
    jax.config.update("jax_enable_x64", True)
    if what == "costs":
        answer = _costs(motion, flag)
    elif what == "profile":
        designs = programs.designs(*MOTIONS[motion])
        answer = profile.counts(designs), profile.evaluation(designs)
    else:
        answer = fewer.measure(_counter(len(fewer.methods())))
    print(json.dumps({"answer": answer}), flush=True)


def _counter(total: int) -> Callable[[], None]:
    """Says after every call how many there were."""
    done = 0

    def advance() -> None:
        nonlocal done
        done += 1
        print(json.dumps({"done": done, "total": total}), flush=True)

    return advance


def _costs(motion: str, flag: str) -> list[dict]:
    designs = programs.designs(*MOTIONS[motion])
    asked = {
        report.OURS: programs.ours(designs),
        report.VMAP: programs.vmap(designs),
        report.NUMBA: programs.numba(designs),
    }
    if flag == "loop flag":
        asked[report.PLAIN] = programs.plain_map(designs)
        if c_peer.missing() is None:
            asked[report.C] = programs.c(designs, 1)
            asked[report.LANES] = programs.c(designs, 8)
    advance = _counter(len(asked) * (REPEATS[flag] + 1))
    costs = programs.costs(asked, REPEATS[flag], advance)
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


if __name__ == "__main__":
    if len(sys.argv) > 1:
        _work(*sys.argv[1:])
    else:
        main()

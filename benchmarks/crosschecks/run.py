"""All comparisons, on the screen and as a page."""

import time
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from benchmarks.comparison import Comparison, markdown_table, screen_table
from benchmarks.crosschecks import clearance, longrun, loose, pointwise, programs
from benchmarks.setting import setting
from jaxcrusher.files.progress import progress
from jaxcrusher.files.provenance import command
from jaxcrusher.files.results import results_folder, write_text

CASES = {
    "instants": pointwise.instants,
    "ideal": pointwise.ideal,
    "clearance": clearance.clearance,
    "smoothing": clearance.smoothing,
    "torque": pointwise.torque,
    "loose": loose.loose,
    "impacts": longrun.impacts,
    "swings": longrun.swings,
    "whirl": longrun.whirl,
}
PACKAGES = ("scipy", "numba", "scikit-sundae", "exudyn")

INTRODUCTION = """\
# Cross-checks

Made by `{command}` in {minutes:.0f} minutes; not edited by hand.
A case alone: `python -m benchmarks.crosschecks CASE`.

{summary}

Every program below gets the published laws without smoothing (Lankarani-Nikravesh with 0.5 m/s,
Ambrosio's ramp, slip of the surfaces), written in `benchmarks/peers/` without jaxcrusher:

- NumPy: closed forms, of an open chain in two angles and of nine coordinates with multipliers.
- SciPy's DOP853 on the angles, rtol 1e-11; a step ends wherever pin and bore touch or part.
- SUNDIALS' CVODE (Adams) on the angles, rtol 1e-12 (1e-9 and 1e-10 for statistics).
- SUNDIALS' IDA on the nine coordinates with seven multipliers, index 1 by differentiating the
  constraints twice, no stabilisation, rtol 1e-11.
- SciPy's DOP853 on free bodies, for clearance in A, B and C: jaw and toggle by Newton and Euler,
  rtol 1e-13.
- EXUDYN: rigid bodies, joints and a pin in a hollow sphere from its own library, generalised-alpha
  with spectral radius 0.9 and steps of 1 us (5 us for statistics, a 4000th of a turn for the ideal
  joint). It shares the start with the others, but no equation.

Ours runs at the default tolerances, in both formulations where it says so. Differences are the
largest at any time over the largest value of theirs; of numbers, relative to theirs. Where a column
shows a history, it shows its largest magnitude. SI units.
"""
CHAPTERS = {
    "instants": "Forces in one instant, at random states in contact",
    "ideal": "Ideal joint, one turn",
    "clearance": "Clearance 0.06 mm, 30 rad/s, centred start",
    "smoothing": "What smoothing the law's corners does (as above, the default widths)",
    "torque": "Shaft free under 300 N m, clearance 0.06 mm, centred start",
    "loose": "Clearance in A, B and C: 0.06, 0.1 and 0.08 mm, 30 rad/s, centred start, 10 ms",
    "impacts": "Statistics of impacting motions",
    "swings": "Statistics after settling",
    "whirl": "Friction whirl: friction 0.1, 30 rad/s, 0.06 mm, centred start, turns 5-12",
}


def summary(found: dict[str, list[Comparison]]) -> str:
    """How many comparisons agree, and which do not."""
    everything = [c for comparisons in found.values() for c in comparisons]
    apart = [c for c in everything if not c.agrees]
    line = f"{len(everything) - len(apart)} of {len(everything)} comparisons agree."
    return line + "".join(f"\n- Does not agree: {c.quantity}, with {c.program}." for c in apart)


def page(found: dict[str, list[Comparison]], minutes: float) -> str:
    """The page in Markdown."""
    lines = [INTRODUCTION.format(command=command(), minutes=minutes, summary=summary(found))]
    for name, comparisons in found.items():
        alone = f"`python -m benchmarks.crosschecks {name}`"
        lines += [f"## {CHAPTERS[name]}", "", alone, "", *markdown_table(comparisons), ""]
    lines += ["## Programs", "", "| program | all its runs above, s |", "|---|---|"]
    lines += [f"| {name} | {_rounded(spent)} |" for name, spent in programs.seconds.items()]
    lines += [
        "",
        "Rounded, compilation included; the programs did not do the same work, so this is no "
        "ranking.",
        "",
        f"On {setting(*PACKAGES)}.",
    ]
    return "\n".join(lines) + "\n"


def _rounded(spent: float) -> str:
    return f"{spent:.0f}" if spent < 10 else f"{round(spent, -1):.0f}"


def run(names: Sequence[str], out: Path) -> None:
    """Run the named cases, or all and write the page."""
    folder = None if names else results_folder(out)
    console, begin, found = Console(), time.perf_counter(), {}
    for name in names or CASES:
        with progress(console) as bars:
            found[name] = list(bars.track(CASES[name](), description=name))
        console.print(screen_table(CHAPTERS[name], found[name]))
    console.print(summary(found))
    if folder is not None:
        write_text(folder / "crosschecks.md", page(found, (time.perf_counter() - begin) / 60))
        console.print(f"{folder / 'crosschecks.md'}")

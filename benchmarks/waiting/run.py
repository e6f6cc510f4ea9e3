"""Errors and times of all ways to the settled RMS, as a page and a figure."""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

import jaxcrusher as jc
from benchmarks.setting import setting
from benchmarks.waiting.measure import CASES, WAYS, Row, of_ours, settled, waited
from jaxcrusher.files.provenance import command
from jaxcrusher.files.results import results_folder, write_figure, write_text
from jaxcrusher.pictures.page import COLOURS, STYLE, WIDTH, plain_powers

LINES = {"contact": "-", "centred": "--"}
HEADING = """# Waiting for the settled motion

Made by `{command}`; not edited by hand. {setting}.

![Error of the settled RMS against run time](waiting.png)

The RMS of |R_O| + |R_C| of the settled motion at 30 rad/s and 0.06 mm. `periodic_orbit` solves for
it: compiled, with 96 nodes a turn, its estimated error and its multipliers. The others integrate so
many turns, and then a third as many, or two at least, whose RMS is theirs; all share one right-hand
side by hand for numba, at rtol 1e-9. Times are of the processor, on one core and after a first run;
errors are against 384 nodes a turn.

Without friction a swing falls to 1/e in {slow} turns. The start in contact has none: two turns
are right to 3e-9, which only what is solved for can tell. With friction of sliding surfaces that
start is off the settled motion, and its swing falls so in {fast} turns; a centred start ends in a
whirl there, and is left out.
"""


def run(out: Path, seconds: float) -> None:
    """Measure, write, print."""
    jc.set_up()
    folder, rows = results_folder(out), []
    for name in CASES:
        rows += of_ours(name)
        for way in WAYS:
            rows += waited(name, way, seconds)
    text = page(rows)
    write_text(folder / "waiting.md", text)
    with plt.rc_context(STYLE):
        write_figure(folder / "waiting.png", draw(rows))
    print(text)


def page(rows: list[Row]) -> str:
    """A table for each case."""
    slow, fast = (f"{float(settled(name).settling_turns):.0f}" for name in CASES)
    where = setting("scipy", "numba", "scikit-sundae")
    lines = [HEADING.format(command=command(), setting=where, slow=slow, fast=fast)]
    for name in CASES:
        lines += [
            f"## {name.capitalize()}",
            "",
            "| program | start | turns waited | ms | times ours | error of the RMS |",
            "|---|---|---|---|---|---|",
        ]
        mine = [row for row in rows if row.case == name]
        ours = mine[0].seconds
        for row in mine:
            turns = "" if row.turns is None else f"{row.turns}"
            lines.append(
                f"| {row.program} | {row.start} | {turns} | {1e3 * row.seconds:.3g} "
                f"| {row.seconds / ours:.3g} | {row.error:.1e} |"
            )
        lines.append("")
    return "\n".join(lines)


def draw(rows: list[Row]) -> Figure:
    """A panel a case."""
    fig, axes = plt.subplots(1, len(CASES), figsize=(WIDTH, 4.2), sharey=True, layout="constrained")
    for ax, name in zip(np.ravel(axes), CASES, strict=True):
        mine = [row for row in rows if row.case == name]
        for way, colour in zip(WAYS, COLOURS, strict=False):
            for start, line in LINES.items():
                some = [row for row in mine if (row.program, row.start) == (way, start)]
                ax.loglog(
                    [1e3 * row.seconds for row in some],
                    [row.error for row in some],
                    line,
                    marker="o",
                    color=colour,
                    label=f"{way}, {start} start" if some else None,
                )
        solved = mine[0]
        label = "periodic_orbit"
        ax.loglog([1e3 * solved.seconds], [solved.error], "k*", markersize=15, label=label)
        ax.set(title=name, xlabel="processor time (ms)")
        plain_powers(ax)
        ax.grid(alpha=0.3)
    first = np.ravel(axes)[0]
    first.set(ylabel="error of the settled RMS")
    fig.legend(*first.get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return fig

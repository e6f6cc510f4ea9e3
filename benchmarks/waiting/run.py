"""Errors and times of all ways to the steady-state RMS, as a page and a figure."""

from dataclasses import asdict
from pathlib import Path

import matplotlib.pyplot as plt
from matplotlib.figure import Figure

import jaxcrusher as jc
from benchmarks.pages import publish, table
from benchmarks.waiting.measure import CASES, WAYS, Row, of_ours, waited
from jaxcrusher.files.results import results_folder
from jaxcrusher.pictures.page import COLOURS, WIDTH, plain_powers

LINES = {"contact": "-", "centred": "--"}
HEADINGS = ("program", "start", "turns waited", "ms", "times ours", "error of the RMS")


def run(out: Path, seconds: float) -> None:
    """Measure, write, print."""
    jc.set_up()
    folder, rows = results_folder(out), []
    for name in CASES:
        rows.append(of_ours(name))
        for way in WAYS:
            rows += waited(name, way, seconds)
    data, packages = map(asdict, rows), ("scipy", "numba", "scikit-sundae")
    publish(folder, "waiting.md", tables(rows), *packages, rows=data, draw=lambda: draw(rows))


def tables(rows: list[Row]) -> dict[str, str]:
    """Return a table for each case."""
    found = {}
    for name in CASES:
        mine = [row for row in rows if row.case == name]
        cells = [
            [
                *(row.program, row.start, "" if row.turns is None else row.turns),
                *(f"{1e3 * row.seconds:.3g}", f"{row.seconds / mine[0].seconds:.3g}"),
                f"{row.error:.1e}",
            ]
            for row in mine
        ]
        found[name] = table(HEADINGS, cells)
    return found


def draw(rows: list[Row]) -> Figure:
    """Draw a panel for each case."""
    fig, axes = plt.subplots(1, len(CASES), figsize=(WIDTH, 4.2), sharey=True, layout="constrained")
    for ax, name in zip(axes, CASES, strict=True):
        mine = [row for row in rows if row.case == name]
        for way, colour in zip(WAYS, COLOURS, strict=False):
            for start, line in LINES.items():
                some = [row for row in mine if (row.program, row.start) == (way, start)]
                times, errors = [1e3 * row.seconds for row in some], [row.error for row in some]
                label = f"{way}, {start} start" if some else None
                ax.loglog(times, errors, line, marker="o", color=colour, label=label)
        at = [1e3 * mine[0].seconds], [mine[0].error]
        ax.loglog(*at, "k*", markersize=15, label="periodic_orbit")
        ax.set(title=name, xlabel="processor time (ms)")
        plain_powers(ax)
        ax.grid(alpha=0.3)
    axes[0].set(ylabel="error of the steady-state RMS")
    fig.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return fig

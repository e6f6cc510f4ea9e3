"""The heat map: one panel an axis, one row a start and formulation, one colour a verdict."""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from benchmarks.stability.cases import AXES, FORMULATIONS, GIVEN, STARTS
from benchmarks.stability.judgement import VERDICTS, Judged

COLOURS = ("#a6dba0", "#9ecae1", "#fee391", "#d9d9d9", "#e34a33")


def draw(rows: list[Judged]) -> Figure:
    """The figure of all rows."""
    fig, axes = plt.subplots(4, 2, figsize=(15, 13), layout="constrained")
    for ax, (name, axis) in zip(axes.flat, AXES.items(), strict=False):
        values = [f"{value:g}" for value in axis.values]
        lines = [(start, kind) for start in STARTS for kind in FORMULATIONS]
        found = {(r.value, r.start, r.formulation): r for r in rows if r.axis == name}
        _panel(
            ax,
            [[found.get((v, *line)) for v in values] for line in lines],
            values,
            [f"{start}, {kind}" for start, kind in lines],
        )
        ax.set_title(f"{name} ({axis.unit})" if axis.unit != "1" else name)
    found = {(r.start, r.formulation): r for r in rows if r.axis == "start"}
    cells = [[found.get((start, kind)) for start in GIVEN] for kind in FORMULATIONS]
    _panel(
        axes.flat[-1],
        cells,
        [s.replace(", ", ",\n").replace(" m/s ", "\nm/s ") for s in GIVEN],
        list(FORMULATIONS),
    )
    axes.flat[-1].set_title("starts, base case")
    axes.flat[-1].tick_params(axis="x", labelsize=7)
    patches = [Patch(color=c, label=v) for v, c in zip(VERDICTS, COLOURS, strict=True)]
    fig.legend(
        handles=patches,
        loc="outside lower center",
        ncols=len(VERDICTS),
        title=("In a cell: steps a turn; error of the RMS; ≠ where the reference does not agree"),
    )
    return fig


def _panel(ax, cells: list[list[Judged | None]], columns: list[str], lines: list[str]) -> None:
    codes = [[-1 if c is None else VERDICTS.index(c.verdict) for c in row] for row in cells]
    shown = np.ma.masked_less(np.array(codes), 0)
    ax.imshow(shown, ListedColormap(COLOURS), vmin=-0.5, vmax=len(COLOURS) - 0.5, aspect="auto")
    for i, row in enumerate(cells):
        for j, cell in enumerate(row):
            if cell is not None:
                ax.text(j, i, _text(cell), ha="center", va="center", fontsize=7)
    ax.set_xticks(range(len(columns)), columns)
    ax.set_yticks(range(len(lines)), lines, fontsize=8)
    ax.set_xticks(np.arange(0.5, len(columns) - 1), minor=True)
    ax.set_yticks(np.arange(0.5, len(lines) - 1), minor=True)
    ax.grid(which="minor", color="white", linewidth=1.5)
    ax.tick_params(which="minor", length=0)


def _text(cell: Judged) -> str:
    if np.isnan(cell.steps_a_turn):
        return "-"
    apart = "" if cell.agreement == "yes" else " ≠"
    return f"{cell.steps_a_turn:.0f}{apart}\n{cell.rms_error:.0e}"

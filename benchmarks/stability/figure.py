"""The map of verdicts: one panel an axis, one row a start and formulation, one colour a verdict."""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from benchmarks.stability import cases
from benchmarks.stability.case import FORMULATIONS
from benchmarks.stability.judgement import AGREES, DISAGREES, OUTSIDE, REFUSED, WHIRL, Judged
from jaxcrusher.pictures.plots import STYLE, WIDTH

# From light to dark, so that they differ without colour too.
COLOURS = ("#e3f2dc", "#fdd049", "#7fb8de", "#b0b0b0", "#c0341d")
ORDER = (AGREES, OUTSIDE, WHIRL, REFUSED, DISAGREES)
# Units in which the values of an axis are short, and what a value is divided by.
SHORT = {"clearance": ("mm", 1e-3), "load": ("kN", 1e3), "stiffness": ("times the base case", 1.0)}
SHORT["masses"] = SHORT["stiffness"]


def draw(rows: list[Judged]) -> Figure:
    """Draw the rows of A; what is not in the cells is in the page's tables."""
    with plt.rc_context(STYLE):
        fig = plt.figure(figsize=(WIDTH, 8.2), layout="constrained")
        # Four rows of two axes each, the last place for the legend; below them the starts.
        grid = fig.add_gridspec(5, 2, height_ratios=(6, 6, 6, 6, 4))
        for i, (name, axis) in enumerate(cases.AXES.items()):
            ax = fig.add_subplot(grid[divmod(i, 2)])
            _along(ax, rows, name, name, axis, cases.STARTS, labelled=not i % 2)
        _legend(fig.add_subplot(grid[3, 1]))
        found = {(r.start, r.formulation): r for r in rows if r.axis == "start"}
        ax = fig.add_subplot(grid[4, :])
        _panel(
            ax,
            [[found.get((start, kind)) for start in cases.GIVEN] for kind in FORMULATIONS],
            [s.replace(", ", ",\n").replace(" m/s ", " m/s\n") for s in cases.GIVEN],
            list(FORMULATIONS),
        )
        ax.set_title("starts of the base case")
        fig.draw_without_rendering()
    return fig


def draw_seats(rows: list[Judged]) -> Figure:
    """Draw the rows of B and C: B on the left, C on the right."""
    with plt.rc_context(STYLE):
        fig = plt.figure(figsize=(WIDTH, 9.8), layout="constrained")
        grid = fig.add_gridspec(6, 2, height_ratios=(6, 6, 6, 6, 8, 6))
        for column, (joint, seat) in enumerate(cases.SEATS.items()):
            of = cases.seat_starts(joint)
            for row, (name, axis) in enumerate(cases.SEAT_AXES.items()):
                ax, label = fig.add_subplot(grid[row, column]), f"{seat} {name}"
                _along(ax, rows, label, name, axis, of, labelled=not column)
        ax, sets = fig.add_subplot(grid[4, :]), [", ".join(loose) for loose in cases.SETS]
        found = {(r.value, r.start, r.formulation): r for r in rows if r.axis == "loose"}
        lines = [(start, kind) for start in cases.seat_starts("BC") for kind in FORMULATIONS]
        cells = [[found.get((loose, *line)) for loose in sets] for line in lines]
        _panel(ax, cells, sets, [", ".join(line) for line in lines])
        ax.set_title("loose joints")
        ax = fig.add_subplot(grid[5, 0])
        _along(ax, rows, "load", "load", cases.LOADS, cases.seat_starts("B"), labelled=True)
        _legend(fig.add_subplot(grid[5, 1]))
        fig.draw_without_rendering()
    return fig


def _along(
    ax: Axes, rows, label: str, name: str, axis: cases.Axis, starts, *, labelled: bool
) -> None:
    """Draw an axis: its values from left to right, a line for each start and formulation."""
    lines = [(start, kind) for start in starts for kind in FORMULATIONS]
    found = {(r.value, r.start, r.formulation): r for r in rows if r.axis == label}
    short, size = SHORT.get(name, (axis.unit.removeprefix("1"), 1.0))
    cells = [[found.get((f"{value:g}", *line)) for value in axis.values] for line in lines]
    # The panel names the place of "violent at B".
    named = [f"{start.partition(' at ')[0]}, {kind}" for start, kind in lines]
    _panel(ax, cells, [f"{value / size:g}" for value in axis.values], named if labelled else [])
    ax.set_title(f"{label} ({short})" if short else label)


def _legend(ax: Axes) -> None:
    patches = [
        Patch(facecolor=c, edgecolor="0.5", label=v) for c, v in zip(COLOURS, ORDER, strict=True)
    ]
    ax.legend(
        handles=patches,
        loc="center",
        frameon=False,
        title="In a cell: steps a turn, in thousands;\n≠ where the reference does not agree",
    )
    ax.axis("off")


def _panel(
    ax: Axes, cells: list[list[Judged | None]], columns: list[str], lines: list[str]
) -> None:
    codes = [[-1 if c is None else ORDER.index(c.verdict) for c in row] for row in cells]
    shown = np.ma.masked_less(np.array(codes), 0)
    ax.imshow(shown, ListedColormap(COLOURS), vmin=-0.5, vmax=len(COLOURS) - 0.5, aspect="auto")
    for i, row in enumerate(cells):
        for j, cell in enumerate(row):
            if cell is not None:
                colour = "w" if cell.verdict == DISAGREES else "k"
                ax.text(j, i, _text(cell), ha="center", va="center", color=colour)
    ax.set_xticks(range(len(columns)), columns)
    ax.set_yticks(range(len(cells)), lines or [""] * len(cells))
    ax.set_xticks(np.arange(0.5, len(columns) - 1), minor=True)
    ax.set_yticks(np.arange(0.5, len(cells) - 1), minor=True)
    ax.grid(which="minor", color="white", linewidth=1.5)
    ax.tick_params(length=0, which="both")


def _text(cell: Judged) -> str:
    if np.isnan(cell.steps_a_turn):
        return "-"
    thousands = cell.steps_a_turn / 1e3
    digits = 1 if thousands < 9.95 else 0
    return f"{thousands:.{digits}f}" + ("" if cell.agreement == "yes" else " ≠")

"""RMS, impacts and the signs of the worn joint, over its clearance."""

import matplotlib as mpl
import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from benchmarks.joints.cases import ACROSS, ALONG, WORN
from benchmarks.joints.measure import BEFORE, Row
from jaxcrusher.pictures.page import COLOURS, STYLE, WIDTH

NAMES = {"A": "A, main bearing", "B": "B, jaw and toggle", "C": "C, toggle and frame"}
MARKERS = dict(zip(NAMES, "os^", strict=True))


def draw(rows: list[Row]) -> Figure:
    """Draw four panels; all joints are loose, and one of them is worn."""
    with mpl.rc_context(STYLE):
        fig, axes = plt.subplots(2, 2, figsize=(WIDTH, 5.6), layout="constrained", sharex=True)
        (rms, impact), (bursts, ratio) = axes
        for joint, colour in zip(NAMES, COLOURS, strict=False):
            along, across = (series(rows, joint, load) for load in (ALONG, ACROSS))
            _line(rms, along, "foundation_rms", joint, colour, 1e-3)
            _line(rms, across, "foundation_rms", joint, colour, 1e-3, dashed=True)
            _line(impact, along, f"{BEFORE[joint]}impact_speed", joint, colour)
            _line(bursts, along, "bursts", joint, colour)
            _line(ratio, along, "rms_ratio", joint, colour)
        impact.axhline(0.051, color="0.4", linestyle=":", linewidth=1)
        impact.text(0.5, 0.055, "above: not elastic", ha="right", color="0.3")
        rms.text(0.5, 14.2, "dashed: load across the jaw", ha="right", color="0.3")
        rms.set(title="shakes the foundation", ylabel="RMS of |R_O| + |R_C| (kN)", ylim=(13, None))
        impact.set(title="hits", ylabel="fastest impact in the worn joint (m/s)", ylim=(0, None))
        bursts.set(title="tells B from C", ylabel="bursts of R_C per turn", ylim=(0, None))
        ratio.set(title="tells B", ylabel="RMS of R_C / RMS of R_O")
        for ax in axes.flat:
            ax.set_xscale("log")
            ax.set_xticks([0.03, 0.06, 0.12, 0.2, 0.5], ["0.03", "0.06", "0.12", "0.2", "0.5"])
            ax.minorticks_off()
            ax.grid(alpha=0.3)
        for ax in axes[1]:
            ax.set_xlabel("clearance of the worn joint (mm)")
        fig.legend(*impact.get_legend_handles_labels(), loc="outside lower center", ncols=3)
        fig.draw_without_rendering()
    return fig


def series(rows: list[Row], joint: str, load: str) -> list[Row]:
    """Return the rows of all new, then this joint worn more and more, the others new."""
    mine = [
        row
        for row in rows
        if row.load == load and len(row.case.clearances) == len(WORN)
        if row.case.worn in ("none", joint)
    ]
    return sorted(mine, key=lambda row: row.case.clearances[joint])


def _line(
    ax: Axes,
    rows: list[Row],
    name: str,
    joint: str,
    colour: str,
    factor: float = 1.0,
    dashed: bool = False,
) -> None:
    """Draw a line with bars of two standard errors."""
    ax.errorbar(
        [1e3 * row.case.clearances[joint] for row in rows],
        [factor * row.values[name] for row in rows],
        [2 * factor * row.errors.get(name, 0.0) for row in rows],
        color=colour,
        marker=MARKERS[joint],
        markersize=4,
        linewidth=1.3,
        linestyle="--" if dashed else "-",
        capsize=2,
        label=None if dashed else NAMES[joint],
    )

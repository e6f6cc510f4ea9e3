"""Error against run time, drawn: a few programs for a first look, and all of them."""

from dataclasses import dataclass

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from benchmarks.work_precision.measure import Row
from jaxcrusher.pictures.plots import BLUE, GREEN, PURPLE, STYLE, WIDTH

# Okabe and Ito's without the yellow, which is lost on white, and a brown in its place.
VERMILION, ORANGE, SKY, BROWN = "#D55E00", "#E69F00", "#56B4E9", "#8C564B"


@dataclass(frozen=True)
class Style:
    """The look of a program, and its name in the legend."""

    name: str
    colour: str
    marker: str
    line: str = "-"
    filled: bool = True


# Ours at its defaults, whatever its formulation is called, is in every panel.
OURS = Style("jaxcrusher, Tsit5", "k", "o")
FIRST = {
    "Tsit5, eccentricity": OURS,
    "Tsit5, closed": OURS,
    "numba Dopri5": Style("by hand for numba, Dopri5", BLUE, "s"),
    "CVODE Adams": Style("CVODE, Adams", VERMILION, "^"),
    "EXUDYN": Style("EXUDYN", GREEN, "D"),
    "NumPy, closed form": Style("NumPy, closed form", PURPLE, "v"),
}
# In the scenes with clearance: without it the solvers lie within a factor of two.
REST = {
    "solvers and formulations": {
        "Tsit5, eccentricity": OURS,
        "Dopri5, eccentricity": Style("Dopri5", BLUE, "s"),
        "Dopri8, eccentricity": Style("Dopri8", VERMILION, "^"),
        "Kvaerno5, eccentricity": Style("Kvaerno5", GREEN, "D"),
        "Tsit5, multiplier": Style("Tsit5, multiplier", PURPLE, "o", "--", False),
        "Dopri5, multiplier": Style("Dopri5, multiplier", SKY, "s", "--", False),
        "Dopri8, multiplier": Style("Dopri8, multiplier", ORANGE, "^", "--", False),
        "Kvaerno5, multiplier": Style("Kvaerno5, multiplier", BROWN, "D", "--", False),
    },
    "Tsit5 otherwise": {
        "Tsit5, eccentricity": OURS,
        "Tsit5, fixed steps": Style("fixed steps", BLUE, "P"),
        "Tsit5, float32": Style("float32", VERMILION, "X"),
        "Tsit5, corner 1e-10 m": Style("corner 1e-10 m", GREEN, "<", ":"),
        "Tsit5, corner 1e-07 m": Style("corner 1e-7 m", PURPLE, ">", ":"),
        "Tsit5, corner 1e-06 m": Style("corner 1e-6 m", ORANGE, "v", ":"),
    },
    "other programs": {
        "Tsit5, eccentricity": OURS,
        "CVODE BDF": Style("CVODE, BDF", BLUE, "h"),
        "SciPy LSODA": Style("SciPy LSODA", VERMILION, "*"),
        "SciPy RK45": Style("SciPy RK45", GREEN, "p"),
        "SciPy DOP853": Style("SciPy DOP853", PURPLE, "d"),
        "SciPy Radau": Style("SciPy Radau", ORANGE, "8"),
        "SciPy DOP853, events": Style("DOP853, events", SKY, "d", "--", False),
    },
}


def draw_first(rows: list[Row]) -> Figure:
    """Draw a panel a scene: error of the RMS over run time, of the few programs of `FIRST`."""
    with plt.rc_context(STYLE):
        fig, axes = plt.subplots(2, 2, figsize=(WIDTH, 5.2), layout="constrained")
        for ax, scene in zip(axes.flat, _scenes(rows), strict=True):
            _panel(ax, scene, rows, FIRST, "rms_error")
            ax.set(title=scene)
        for ax in axes[:, 0]:
            ax.set(ylabel="relative error of the RMS")
        for ax in axes[-1]:
            ax.set(xlabel="run time (ms)")
        handles = _handles(axes.flat)
        fig.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=3)
        fig.draw_without_rendering()
    return fig


def draw_rest(rows: list[Row], error: str) -> Figure:
    """Draw a row of panels a scene with clearance: in each ours and a group of the rest.

    `error` is the column drawn: rms_error or history_error.
    """
    scenes = _scenes([row for row in rows if row.program in REST["other programs"]])
    with plt.rc_context(STYLE):
        fig, axes = plt.subplots(
            len(scenes),
            len(REST),
            figsize=(WIDTH, 1.7 * len(scenes) + 1.5),
            sharey="row",
            squeeze=False,
            layout="constrained",
        )
        for line, scene in zip(axes, scenes, strict=True):
            for ax, styles in zip(line, REST.values(), strict=True):
                _panel(ax, scene, rows, styles, error)
            line[0].set(ylabel=f"{scene}\nrelative error")
        for ax, (title, column) in zip(axes[0], zip(REST, axes.T, strict=True), strict=True):
            ax.set(title=title)
            column[-1].set(xlabel="run time (ms)")
            handles = _handles(column)
            column[-1].legend(
                handles.values(),
                handles.keys(),
                loc="upper center",
                bbox_to_anchor=(0.45, -0.35),
                frameon=False,
                handlelength=1.8,
            )
        fig.draw_without_rendering()
    return fig


def _scenes(rows: list[Row]) -> list[str]:
    return list(dict.fromkeys(row.scene for row in rows))


def _handles(axes) -> dict:
    """Return handles by their names in the legend, each once."""
    found = {}
    for ax in axes:
        found |= dict(zip(*reversed(ax.get_legend_handles_labels()), strict=True))
    return found


def _panel(ax, scene: str, rows: list[Row], styles: dict[str, Style], error: str) -> None:
    for program, style in styles.items():
        mine = [
            (1e3 * row.run_s, getattr(row, error))
            for row in rows
            if (row.scene, row.program, row.failure) == (scene, program, "")
        ]
        if not np.isfinite(mine).all(axis=-1).any():
            continue
        ax.loglog(
            *np.transpose(mine),
            color=style.colour,
            marker=style.marker,
            linestyle=style.line,
            markerfacecolor=style.colour if style.filled else "w",
            linewidth=1.6 if style is OURS else 1.0,
            markersize=4,
            zorder=3 if style is OURS else 2,
            label=style.name,
        )
    ax.grid(alpha=0.3, which="major")
    # The raised exponent of a power is small type.
    for axis in (ax.xaxis, ax.yaxis):
        axis.set_major_formatter("{x:g}")
        axis.set_minor_formatter("")

"""The design study in one figure."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from jaxcrusher.files.results import write_figure
from jaxcrusher.pictures.page import STYLE, WIDTH, plain_powers
from optimize.balance.compare import best_so_far
from optimize.balance.methods import by_method

COLOURS = {"L-BFGS-B": "C0", "Adam": "C3", "CMA-ES": "C1", "Py-BOBYQA": "C2"}
CONDITIONS = {
    "friction": ("friction coefficient of the condition", 1.0),
    "load": ("load of the condition, kN", 1e-3),
}
# Of the machine to begin with, the optimised and the robust one.
SHADES = ("0.5", "C0", "C3")


def draw(path: Path, result: dict, turn: Mapping[str, Mapping[str, Any]]) -> None:
    """Best so far over work and seconds, and forces and power of the designs over a turn."""
    with plt.rc_context(STYLE):
        write_figure(path, figure(result, turn))


def figure(result: dict, turn: Mapping[str, Mapping[str, Any]]) -> Figure:
    """Six panels in three rows."""
    fig, grid = plt.subplots(3, 2, figsize=(WIDTH, 8), layout="constrained")
    axes = grid.ravel()
    for ax, kind in ((axes[0], "work"), (axes[1], "seconds")):
        _draw_searches(ax, result, kind)
    angle = np.linspace(0, 360, len(next(iter(turn.values()))["foundation_force"]) + 1)[1:]
    curves = (
        (axes[2], "foundation_force", 1e-3, "|R_O| + |R_C|, kN"),
        (axes[3], "shaking_force", 1e-3, "shaking force, kN"),
        (axes[4], "drive_power", 1e-3, "drive power, kW"),
    )
    for ax, key, factor, label in curves:
        for name, colour in zip(turn, SHADES, strict=True):
            values = turn[name][key]
            values = np.hypot(*values.T) if values.ndim == 2 else values
            ax.plot(
                angle,
                factor * values,
                color=colour,
                label=name,
                linestyle="--" if name == "robust" else "-",
            )
        ax.set(xlabel="shaft angle, deg", ylabel=label, xlim=(0, 360), xticks=range(0, 361, 90))
        ax.grid(alpha=0.3)
    axes[2].set_ylim(bottom=0)
    # The last of them moves the force most.
    condition, met = list(result["robust"]["conditions"].items())[-1]
    label, factor = CONDITIONS[condition]
    for name, colour in zip(turn, SHADES, strict=True):
        rms = 1e-3 * np.array(result["robust"]["values"][name])
        filled = "none" if name == "robust" else "full"
        axes[5].plot(factor * np.array(met), rms, "o", color=colour, markersize=4, fillstyle=filled)
    axes[5].set(xlabel=label, ylabel="RMS of |R_O| + |R_C|, kN")
    axes[5].grid(alpha=0.3)
    methods, designs = (ax.get_legend_handles_labels() for ax in (axes[0], axes[2]))
    fig.legend(*methods, loc="outside upper center", ncols=5)
    fig.legend(*designs, loc="outside lower center", ncols=4)
    return fig


def _draw_searches(ax, result: dict, kind: str) -> None:
    """Median and range over the starts of what is still above the best, in N."""
    scale = result["cost"]["scale"]
    grouped = by_method(result)
    least = min(s.best[-1] for found in grouped.values() for s in found if s.best)
    for method, all_of_them in grouped.items():
        found = [s for s in all_of_them if s.best]
        if not found:
            continue
        totals = [getattr(s, f"total_{kind}") for s in found]
        first = min(getattr(s, kind)[0] for s in found)
        at = np.geomspace(max(first, 1e-3), max(totals), 300)
        above = np.array([best_so_far(s, getattr(s, kind), at) for s in found])
        # The best of all has nothing above it: it ends at a tenth of a newton.
        above = np.maximum(scale * (above - least), 0.1)
        every = np.isfinite(above).all(axis=0)
        colour = COLOURS[method]
        ax.fill_between(
            at[every], above.min(0)[every], above.max(0)[every], color=colour, alpha=0.2
        )
        ax.plot(at[every], np.median(above, axis=0)[every], color=colour, label=method)
    gain = scale * (1 - least)
    ax.axhline(max(gain, 0.1), color="0.5", linestyle=":", label="the machine to begin with")
    ax.set(
        xscale="log",
        yscale="log",
        ylabel="RMS above the best found, N",
        xlabel="work, values" if kind == "work" else "CPU seconds",
    )
    plain_powers(ax)
    ax.grid(alpha=0.3)

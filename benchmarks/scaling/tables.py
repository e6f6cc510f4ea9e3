"""The tables and the figure of the page scaling.md."""

from collections.abc import Sequence
from typing import Any

import matplotlib.pyplot as plt
from matplotlib.figure import Figure

from benchmarks.pages import table
from jaxcrusher.pictures.page import COLOURS, WIDTH, plain_powers

BLUE, ORANGE, GREEN = COLOURS[:3]
# The aims of the project, in values: forward by the number of parameters, and reverse.
FORWARD_AIM, REVERSE_AIM = 1.2, 6.0
Rows = Sequence[dict[str, Any]]
COSTS = ("ms a design", "CPU us a step", "first chunk, CPU s", "peak MiB")
SWEEPS = ("cores", "designs", "ms a design", "by hand / ours", "by CPU time", "first, CPU s")
RATIOS = ("cost / value", "steps / value's", "a step / value's")
GRADIENTS = ("method", "parameters", *RATIOS, "aim", "compile s", "value ms")


def tables(rows: Rows) -> dict[str, str]:
    """Return the tables of designs, turns, sweeps and gradients."""
    by = {w: [r for r in rows if r["what"] == w] for w in ("designs", "turns", "sweeps")}
    gradients = [r for r in rows if "parameters" in r]
    return {
        **{
            w: table(("cores", w, *COSTS), [_cost(r, w) for r in by[w]])
            for w in ("designs", "turns")
        },
        "sweeps": table(SWEEPS, map(_sweep, by["sweeps"])),
        "gradients": table(GRADIENTS, map(_gradient, gradients)),
    }


def _cost(r: dict[str, Any], what: str) -> list[object]:
    costs = f"{1e3 * r['seconds'] / r['designs']:.2f}", f"{1e6 * r['cpu_s'] / r['steps']:.2f}"
    return [r["cores"], r[what], *costs, f"{r['first_cpu_s']:.1f}", f"{r['peak_mib']:.0f}"]


def _sweep(r: dict[str, Any]) -> list[object]:
    ratios = r["by_hand_s"] / r["seconds"], r["by_hand_cpu_s"] / r["cpu_s"]
    cells = (f"{ratio:.2f}" for ratio in (1e3 * r["seconds"] / r["designs"], *ratios))
    return [r["cores"], r["designs"], *cells, f"{r['first_cpu_s']:.1f}"]


def _gradient(r: dict[str, Any]) -> list[object]:
    cost, steps, aim = r["cpu_s"] / r["value_cpu_s"], r["steps"] / r["value_steps"], aim_of(r)
    ratios = f"{cost:.1f}", f"{steps:.2f}", f"{cost / steps:.1f}"
    met = f"{aim:.1f}, {'met' if cost <= aim else '**missed**'}"
    compiled = f"{r['first_cpu_s'] - r['cpu_s']:.0f}"
    return [r["what"], r["parameters"], *ratios, met, compiled, f"{1e3 * r['value_cpu_s']:.1f}"]


def aim_of(row: dict[str, Any]) -> float:
    """Return the most that a value with its gradient should cost, in values."""
    return REVERSE_AIM if "reverse" in row["what"] else 1 + FORWARD_AIM * row["parameters"]


def figure(rows: Rows) -> Figure:
    """Draw the time of a design by designs and by turns, and below it gradients by parameters."""
    fig, at = plt.subplot_mosaic(
        [["designs", "turns"], ["gradients", "gradients"]],
        figsize=(WIDTH, 5.6),
        layout="constrained",
    )
    for what, other in (("designs", "turns"), ("turns", "designs")):
        mine, axes = [r for r in rows if r["what"] == what], at[what]
        for cores, colour, marker in ((1, BLUE, "o"), (2, ORANGE, "s")):
            kept = [r for r in mine if r["cores"] == cores]
            costs = [1e3 * r["cpu_s"] / r["designs"] / r["turns"] for r in kept]
            label = "one core" if cores == 1 else f"{cores} cores"
            look = {"color": colour, "marker": marker, "label": label}
            axes.semilogx([r[what] for r in kept], costs, **look)
        each = " each" if other == "turns" else ""
        axes.set(
            xlabel=f"{what}, {mine[0][other]} {other}{each}", ylabel="CPU ms a design and turn"
        )
        axes.legend(frameon=False)
    # A few designs leave lanes empty: far from the rest.
    at["designs"].set_yscale("log")
    at["designs"].set_ylim(bottom=0.03)
    at["turns"].set_ylim(bottom=0)
    gradients, right = [r for r in rows if "parameters" in r], at["gradients"]
    methods = dict.fromkeys(r["what"] for r in gradients)
    for method, colour, marker in zip(methods, (BLUE, GREEN, ORANGE), "osv", strict=True):
        kept = [r for r in gradients if r["what"] == method]
        numbers = [r["parameters"] for r in kept]
        costs = [r["cpu_s"] / r["value_cpu_s"] for r in kept]
        right.plot(numbers, costs, color=colour, marker=marker, label=method)
        if "equal" in method:
            label = f"aim, {method.partition(',')[0]}"
            right.plot(numbers, [aim_of(r) for r in kept], ":", color=colour, label=label)
    right.set(xlabel="parameters", ylabel="value and gradient / value")
    right.set_xticks(sorted({r["parameters"] for r in gradients}))
    right.set_ylim(bottom=0)
    right.legend(frameon=False)
    for axes in (at["designs"], at["turns"]):
        plain_powers(axes)
    return fig

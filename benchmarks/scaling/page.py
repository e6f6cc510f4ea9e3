"""The page and the figure of `benchmarks.scaling`."""

from typing import Any

import matplotlib.pyplot as plt
from matplotlib.figure import Figure

from jaxcrusher.files.provenance import command
from jaxcrusher.lanes.code import LANES
from jaxcrusher.pictures.page import WIDTH, plain_powers

BLUE, ORANGE, GREEN = "#0072b2", "#d55e00", "#009e73"
# The aims of the project, in values: forward by the number of parameters, and reverse.
FORWARD_AIM, REVERSE_AIM = 1.2, 6.0


def page(rows: list[dict[str, Any]], setting: str) -> str:
    """The report as Markdown."""
    designs = [r for r in rows if r["what"] == "designs"]
    turns = [r for r in rows if r["what"] == "turns"]
    gradients = [r for r in rows if "parameters" in r]
    lines = [
        "# How the cost grows",
        "",
        f"Made by `{command()}`; not edited by hand. {setting}.",
        "Quiet motions of the paper's box from starts in contact; medians, compilation apart",
        "(first chunk). CPU time is that of all cores: what others do meanwhile does not count.",
        "",
        "![Cost by designs, by turns, and by differentiated parameters](scaling.png)",
        "",
        "## Designs and turns",
        "",
        "Peak memory is the whole process's, with Python, JAX and the compiler: about what the",
        "smallest run takes, if chunks bound the rest.",
        "",
    ]
    for title, chosen, per in (
        (f"Designs, over {designs[0]['turns']} turns", designs, "designs"),
        (f"Turns, of {turns[0]['designs']} designs", turns, "turns"),
    ):
        lines += [
            f"{title}:",
            "",
            f"| cores | {per} | ms a design | CPU us a step | first chunk, CPU s | peak MiB |",
            "|---|---|---|---|---|---|",
        ]
        for r in chosen:
            lines.append(
                f"| {r['cores']} | {r[per]} | {1e3 * r['seconds'] / r['designs']:.2f} | "
                f"{1e6 * r['cpu_s'] / r['steps']:.2f} | {r['first_cpu_s']:.1f} | "
                f"{r['peak_mib']:.0f} |"
            )
        lines += ["", _flatness(chosen), ""]
    lines += _sweep_lines([r for r in rows if r["what"] == "sweeps"])
    lines += _gradient_lines(gradients)
    return "\n".join(lines) + "\n"


def _flatness(rows: list[dict[str, Any]]) -> str:
    """How much the cost a step varies over the rows that fill the lanes of every core."""
    said = []
    for cores in sorted({r["cores"] for r in rows}):
        kept = [r for r in rows if r["cores"] == cores and r["designs"] >= 4 * LANES * cores]
        costs = [1e6 * r["cpu_s"] / r["steps"] for r in kept]
        if costs:
            said.append(f"{min(costs):.2f} to {max(costs):.2f} us on {_cores(cores)}")
    full = f"A step takes {' and '.join(said)}, with {4 * LANES} designs a core or more."
    return full if said else f"With fewer than {LANES} designs lanes stand empty."


def _sweep_lines(rows: list[dict[str, Any]]) -> list[str]:
    lines = [
        "## Whole sweeps",
        "",
        f"`jaxcrusher.sweep` over {rows[0]['turns']} turns: crushers built, integrated, all",
        "statistics taken, and a dataset made. Beside it the crusher by hand for numba, scalar and",
        "on one core, which integrates the RMS alone and looks at no instants between its steps.",
        "By CPU time our cores count together: two idle ones would come to twice that.",
        "",
        "| cores | designs | ms a design | by hand / ours | by CPU time | first, CPU s |",
        "|---|---|---|---|---|---|",
    ]
    for r in rows:
        lines.append(
            f"| {r['cores']} | {r['designs']} | {1e3 * r['seconds'] / r['designs']:.2f} | "
            f"{r['by_hand_s'] / r['seconds']:.2f} | {r['by_hand_cpu_s'] / r['cpu_s']:.2f} | "
            f"{r['first_cpu_s']:.1f} |"
        )
    return [*lines, ""]


def _cores(count: int) -> str:
    return "one core" if count == 1 else f"{count} cores"


def _gradient_lines(rows: list[dict[str, Any]]) -> list[str]:
    lines = [
        "## Value and gradient",
        "",
        "In units of one value by the same method, CPU time. Error controlled, the tangents are",
        "under the control too and take more steps; a step's cost is then the quotient. Equal",
        f"steps show the derivative alone. The aims: forward 1 + {FORWARD_AIM:g} a parameter,",
        f"reverse with checkpoints {REVERSE_AIM:g} whatever their number.",
        "",
        "| method | parameters | cost / value | steps / value's | a step / value's | aim | "
        "compile s | value ms |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for r in rows:
        cost, steps = r["cpu_s"] / r["value_cpu_s"], r["steps"] / r["value_steps"]
        aim = aim_of(r)
        lines.append(
            f"| {r['what']} | {r['parameters']} | {cost:.1f} | {steps:.2f} | "
            f"{cost / steps:.1f} | {aim:.1f}, {'met' if cost <= aim else '**missed**'} | "
            f"{r['first_cpu_s'] - r['cpu_s']:.0f} | {1e3 * r['value_cpu_s']:.1f} |"
        )
    return lines


def aim_of(row: dict[str, Any]) -> float:
    """What a value with its gradient should cost at most, in values."""
    return REVERSE_AIM if "reverse" in row["what"] else 1 + FORWARD_AIM * row["parameters"]


def figure(rows: list[dict[str, Any]]) -> Figure:
    """Time a design by designs and by turns, and below it gradients by parameters."""
    panels, at = plt.subplot_mosaic(
        [["designs", "turns"], ["gradients", "gradients"]],
        figsize=(WIDTH, 5.6),
        layout="constrained",
    )
    left, middle, right = at["designs"], at["turns"], at["gradients"]
    for cores, colour, marker in ((1, BLUE, "o"), (2, ORANGE, "s")):
        for axes, what, unit in ((left, "designs", "designs"), (middle, "turns", "turns")):
            kept = [r for r in rows if r["what"] == what and r["cores"] == cores]
            axes.semilogx(
                [r[unit] for r in kept],
                [1e3 * r["cpu_s"] / r["designs"] / r["turns"] for r in kept],
                color=colour,
                marker=marker,
                label=_cores(cores),
            )
    turns, designs = (
        next(r[unit] for r in rows if r["what"] == what)
        for what, unit in (("designs", "turns"), ("turns", "designs"))
    )
    left.set_xlabel(f"designs, {turns} turns each")
    middle.set_xlabel(f"turns, {designs} designs")
    for axes in (left, middle):
        axes.set_ylabel("CPU ms a design and turn")
        axes.legend(frameon=False)
    # A few designs leave lanes empty: far from the rest.
    left.set_yscale("log")
    left.set_ylim(bottom=0.03)
    middle.set_ylim(bottom=0)
    gradients = [r for r in rows if "parameters" in r]
    for method, colour, marker in zip(
        dict.fromkeys(r["what"] for r in gradients), (BLUE, GREEN, ORANGE), "osv", strict=True
    ):
        kept = [r for r in gradients if r["what"] == method]
        numbers = [r["parameters"] for r in kept]
        right.plot(
            numbers,
            [r["cpu_s"] / r["value_cpu_s"] for r in kept],
            color=colour,
            marker=marker,
            label=method,
        )
        if method.startswith("reverse"):
            right.plot(numbers, [aim_of(r) for r in kept], ":", color=colour, label="aim, reverse")
        elif "equal" in method:
            right.plot(numbers, [aim_of(r) for r in kept], ":", color=colour, label="aim, forward")
    right.set(xlabel="parameters", ylabel="value and gradient / value")
    right.set_xticks(sorted({r["parameters"] for r in gradients}))
    right.set_ylim(bottom=0)
    right.legend(frameon=False)
    for axes in (left, middle):
        plain_powers(axes)
    return panels

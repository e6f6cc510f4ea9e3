"""One style of all figures: their sizes, colours that read on white and on black, and speeds.

Colours are Okabe and Ito's and maps are cividis, told apart by every kind of colour vision; what
colour says, line style, marker or hatching says too.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from cycler import cycler
from matplotlib.axes import Axes

from jaxcrusher.crusher.outline import BLUE as BLUE
from jaxcrusher.crusher.outline import GREEN as GREEN
from jaxcrusher.crusher.outline import ORANGE as ORANGE
from jaxcrusher.crusher.outline import PURPLE as PURPLE
from jaxcrusher.scenes.parameters import NUMBERS, in_words
from jaxcrusher.scenes.units import unit_of

# 170 mm in inches: A4 less its margins. About 700 pixels of a page on a screen.
WIDTH = 6.7
# The smallest type at that width, in points.
SMALLEST = 8.0
# For `matplotlib.rc_context` around all of a figure as wide as a page, `draw_without_rendering`
# included: ticks take their type when they are first drawn.
STYLE: dict[Any, Any] = {
    "font.size": SMALLEST,
    "axes.titlesize": SMALLEST + 1,
    "axes.labelsize": SMALLEST,
    "xtick.labelsize": SMALLEST,
    "ytick.labelsize": SMALLEST,
    "legend.fontsize": SMALLEST,
    "legend.title_fontsize": SMALLEST,
    "figure.titlesize": SMALLEST + 1,
}
# Each stands out from white and from `BLACK` by 3 to 1, as WCAG 2.1 asks of figures (1.4.11).
COLOURS = (BLUE, ORANGE, GREEN, PURPLE)
GREY = "0.5"
FORCE = "$|R_O| + |R_C|$"
BLACK, WHITE = "#1b1b1b", "#ececec"
_PAPER = ("figure.facecolor", "axes.facecolor", "savefig.facecolor", "legend.facecolor")
_INK = ("text.color", "axes.edgecolor", "axes.labelcolor", "xtick.color", "ytick.color")
_INK += ("legend.edgecolor",)
# What stands for a number of a machine in a label.
CALLED = {"speed": "driving speed", "clearance": "radial clearance"}


def style(*, dark: bool = False) -> dict[Any, Any]:
    """Return the style of a figure as wide as a page, on white or on a dark page.

    It is for `matplotlib.rc_context` around all that makes and writes the figure.
    """
    paper = dict.fromkeys(_PAPER, BLACK) | dict.fromkeys(_INK, WHITE) if dark else {}
    return STYLE | {"axes.prop_cycle": cycler(color=COLOURS)} | paper


def in_kilo(unit: str) -> tuple[float, str]:
    """Return how many of a unit make one drawn unit, and the drawn unit: kN for forces."""
    return (1e3, "kN") if unit == "N" else (1.0, unit)


def typeset(words: str) -> str:
    """Return words with the symbols of the force on the foundation typeset."""
    return words if "$" in words else words.replace(FORCE.strip("$"), FORCE)


def named(name: str, units: Mapping[str, str]) -> tuple[str, float]:
    """Return the label of a machine's number, with its unit, and the size of the unit in SI."""
    unit, size = unit_of(name, units)
    words = CALLED.get(name, in_words(name))
    return f"{words} ({unit})" if unit else words, size


def over(ax: Axes, name: str, units: Mapping[str, str] | None = None) -> float:
    """Label the horizontal axis by a number of the machine, and return the size of its unit in SI.

    A speed has a second axis above: rpm, or rad/s where rpm are below.
    """
    label, size = named(name, units or {})
    ax.set(xlabel=label)
    if name in NUMBERS and NUMBERS[name].unit == "rad/s":
        below, _ = unit_of(name, units or {})
        other, further = ("rad/s", 1.0) if below == "rpm" else ("rpm", np.pi / 30)
        second_axis(ax, other, size / further)
    return size


def second_axis(ax: Axes, label: str, factor: float) -> None:
    """Put an axis above that counts `factor` where the one below counts 1."""
    both = (lambda x: np.multiply(x, factor), lambda x: np.divide(x, factor))
    above = ax.secondary_xaxis("top", functions=both)
    above.set_xlabel(label)


def legend_beside(ax: Axes, **how: Any) -> None:
    """Put the legend to the right of the axes, where it covers nothing."""
    ax.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False, **how)

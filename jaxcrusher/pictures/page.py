"""The width of a page (`WIDTH`, inches), and type that can be read there (`STYLE`)."""

from typing import Any

from matplotlib.axes import Axes
from matplotlib.ticker import FuncFormatter, LogLocator

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
# Okabe and Ito's without the yellow, which is lost on white, and a brown in its place.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#8C564B")


def plain_powers(ax: Axes) -> None:
    """Ticks of logarithmic axes as 0.1, 10, 1e-6: the raised exponent of a power is small type.

    Called once all is drawn: an axis of little more than a decade has ticks between.
    """
    for axis in (ax.xaxis, ax.yaxis):
        if axis.get_scale() == "log":
            low, high = axis.get_view_interval()
            if high < 20 * low:
                axis.set_major_locator(LogLocator(subs=(1, 2, 5)))
            axis.set_major_formatter(FuncFormatter(lambda value, _: power(value)))
            axis.set_minor_formatter(FuncFormatter(lambda value, _: ""))


def power(value: float) -> str:
    """A power of ten in few letters: 0.01, 1000, 1e-3, 1e5."""
    if 0.01 <= value < 1e5:
        return f"{value:g}"
    mantissa, exponent = f"{value:e}".split("e")
    return f"{float(mantissa):g}e{int(exponent)}"

"""Figures of numbers that were fitted: how surely each is known, and how they depend."""

import textwrap
from collections.abc import Mapping

import matplotlib.pyplot as plt
import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure

from jaxcrusher.basics.checks import require
from jaxcrusher.pictures.style import BLUE, ORANGE, named

# Standard deviations to either side that are drawn.
REACH = 3.0


def plot_corner(
    values: Mapping[str, float],
    covariance: Float[np.ndarray, "n n"],
    figure: Figure | SubFigure | None = None,
    *,
    start: Mapping[str, float] | None = None,
    units: Mapping[str, str] | None = None,
) -> np.ndarray:
    """The corner plot of a fit: normal marginals on the diagonal, and ellipses of pairs below it.

    The ellipses are those of one and two standard deviations: their shadows on an axis are the
    intervals of the marginals there, and they hold 39 and 86 % of a pair. Axes reach three
    standard deviations to either side.

    **Arguments:**

    - `values`: names of a machine's numbers -> estimates, in SI units, as in `Identified.values`.
    - `covariance`: of the estimates in that order, finite and with variances above zero. One that
      is singular, of numbers that cannot be told apart, gives an ellipse of no width.
    - `figure`: where the n x n axes are made; None is a new figure.
    - `start`: names -> values that the fit began with. It is told in the title of a marginal, and
      drawn where it lies within the axes.
    - `units`: names -> units of the axes; without, those of `plot_landscape`.

    **Returns:** the axes, shape (n, n), of which those above the diagonal are removed.

    Raises ValueError for a covariance of another shape, or with a variance that is not positive.
    """
    names, n, start = list(values), len(values), dict(start or {})
    good = n > 0 and covariance.shape == (n, n) and bool((np.diag(covariance) > 0).all())
    good = good and bool(np.isfinite(covariance).all())
    must = f"be finite, of shape {(n, n)}, with variances above zero"
    require(good, "covariance", must, covariance)
    figure = plt.figure(layout="constrained") if figure is None else figure
    told = [_scaled(name, value, units or {}) for name, value in values.items()]
    labels, sizes = [label for label, _ in told], np.array([size for _, size in told])
    centre, spread = np.array([*values.values()]) / sizes, np.sqrt(np.diag(covariance)) / sizes
    covariance = covariance / np.outer(sizes, sizes)
    begin = np.array([start.get(name, np.nan) for name in names]) / sizes
    axes = figure.subplots(n, n, sharex="col", squeeze=False)
    for i, row in enumerate(axes):
        for j, ax in enumerate(row):
            if j > i:
                ax.remove()
                continue
            if i == j:
                title = f"{centre[i]:.5g} ± {spread[i]:.2g}"
                _marginal(ax, centre[i], spread[i], begin[i])
                ax.set_title(title + (f"\nstart {begin[i]:.5g}" if names[i] in start else ""))
            else:
                _ellipses(ax, centre[[j, i]], covariance[np.ix_((j, i), (j, i))], begin[[j, i]])
                ax.set_ylim(centre[i] - REACH * spread[i], centre[i] + REACH * spread[i])
                ax.set_ylabel(labels[i] if j == 0 else "")
                ax.tick_params(labelleft=j == 0)
            ax.set_xlim(centre[j] - REACH * spread[j], centre[j] + REACH * spread[j])
            ax.set_xlabel(labels[j] if i == n - 1 else "")
            ax.locator_params(nbins=4)
    return axes


def _scaled(name: str, value: float, units: Mapping[str, str]) -> tuple[str, float]:
    """Return a label in short lines, and what 1 on its axis is in SI: a unit, or thousands of it.

    A power of ten stands in the label, for at the end of an axis it would cover it.
    """
    label, size = named(name, units)
    power = 3 * int(np.log10(abs(value / size)) // 3) if value else 0
    if not -6 < power < 6:
        power_of = f"$10^{{{power}}}$"
        label = label.replace("(", f"({power_of} ") if "(" in label else f"{label} ({power_of})"
        size *= 10.0**power
    words, bracket, unit = label.partition(" (")
    return textwrap.fill(words, 18) + bracket.replace(" ", "\n") + unit, size


def _marginal(ax: Axes, centre: float, spread: float, begin: float) -> None:
    """Draw a normal density, with what is inside of one standard deviation filled."""
    along = np.linspace(-REACH, REACH, 181)
    density = np.exp(-(along**2) / 2)
    inside = np.abs(along) <= 1
    ax.plot(centre + spread * along, density, color=BLUE)
    ax.fill_between(centre + spread * along[inside], density[inside], color=BLUE, alpha=0.3, lw=0)
    ax.axvline(begin, color=ORANGE, linestyle="--", linewidth=1.2)
    ax.set(ylim=(0, 1.1), yticks=[])


def _ellipses(
    ax: Axes,
    centre: Float[np.ndarray, "2"],
    covariance: Float[np.ndarray, "2 2"],
    begin: Float[np.ndarray, "2"],
) -> None:
    """Draw the ellipses of one and two standard deviations about the estimate, and the start."""
    angle = np.linspace(0, 2 * np.pi, 181)
    along, vectors = np.linalg.eigh(covariance)
    # Of numbers that cannot be told apart rounding may leave a variance below zero.
    around = vectors * np.sqrt(np.maximum(along, 0.0)) @ np.stack([np.cos(angle), np.sin(angle)])
    for times, line in ((1, "-"), (2, "--")):
        ax.plot(*(centre[:, None] + times * around), line, color=BLUE, linewidth=1.2)
    ax.plot(*centre, "+", color=BLUE)
    ax.plot(*begin, "x", color=ORANGE)

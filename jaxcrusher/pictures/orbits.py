"""Figures of periodic orbits: orders, multipliers, branches, and what motions do beside them."""

from collections.abc import Iterable, Mapping, Sequence

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from jaxtyping import ArrayLike, Complex, Float
from matplotlib.axes import Axes

from jaxcrusher.basics.checks import require, require_choice
from jaxcrusher.orbits.orbit_branch import OrbitBranch
from jaxcrusher.pictures.style import (
    BLUE,
    COLOURS,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    in_kilo,
    legend_beside,
    over,
    second_axis,
    typeset,
)

# Kind of event -> marker and colour; of those that are not named here the last one.
EVENTS = {
    "fold": ("D", BLUE),
    "branch point": ("s", GREEN),
    "period doubling": ("^", ORANGE),
    "Neimark-Sacker": ("o", PURPLE),
    "cusp": ("*", PURPLE),
    "contact lost": ("X", ORANGE),
    "": ("P", GREY),
}
# How orbits are drawn that are stable, unstable and undecided.
STABILITY = (("stable", "-", BLUE), ("unstable", "--", ORANGE), ("undecided", ":", PURPLE))


def plot_orders(
    harmonics: xr.Dataset, ax: Axes | None = None, *, quantities: Sequence[str] | None = None
) -> Axes:
    """Bars of the amplitudes of orders, and above the orders their frequencies in Hz.

    The mean, of order 0, is left out. `harmonics` are those of `jaxcrusher.harmonics`, and
    `quantities` those of them that are drawn side by side; None is all forces. Forces are in kN.

    Raises ValueError for unknown quantities, and for several of different units.
    """
    ax = plt.subplots()[1] if ax is None else ax
    known, unit_of = list(map(str, harmonics.quantity.values)), harmonics.unit
    if quantities is None:
        quantities = [name for name in known if unit_of.sel(quantity=name) == "N"]
    require(len(quantities) > 0, "quantities", f"name some of {known}", quantities)
    for name in quantities:
        require_choice("quantities", name, tuple(known))
    units = {str(unit_of.sel(quantity=name).item()) for name in quantities}
    require(len(units) == 1, "quantities", "have one unit", sorted(units))
    factor, unit = in_kilo(units.pop())
    orders = harmonics.order.to_numpy()[1:]
    width = 0.8 * orders[0] / len(quantities)
    for i, name in enumerate(quantities):
        beside = (i - (len(quantities) - 1) / 2) * width
        size = harmonics.amplitude.sel(quantity=name).to_numpy()[1:] / factor
        colour, hatch = COLOURS[i % 4], ("", "//", "..", "xx")[i % 4]
        ax.bar(
            orders + beside, size, width, color=colour, hatch=hatch, label=name.replace("_", " ")
        )
    ax.set(xlabel="order of the turn", ylabel=f"amplitude ({unit})")
    ax.margins(x=0)
    second_axis(ax, "Hz", harmonics.attrs["speed"] / (2 * np.pi))
    ax.legend()
    return ax


def plot_campbell(
    spectra: Iterable[xr.Dataset],
    quantity: str,
    ax: Axes | None = None,
    *,
    natural: Float[ArrayLike, " modes"] | Sequence[float] = (),
) -> Axes:
    """A Campbell diagram: amplitudes over speed and frequency, orders, and natural frequencies.

    Each amplitude is a disc whose area and colour tell its size, on the line of its order. A force
    is in kN. Discs below a hundredth of the largest amplitude are left out.

    **Arguments:**

    - `spectra`: `jaxcrusher.harmonics` of orbits at two or more speeds, as of those of a branch
      over the speed or of a row of a map.
    - `quantity`: one of them, such as "ground_force_y".
    - `natural`: natural frequencies, Hz, as `jaxcrusher.natural_modes(scene).frequency`.

    Raises ValueError for an unknown quantity, and for fewer than two speeds.
    """
    ax = plt.subplots()[1] if ax is None else ax
    spectra = list(spectra)
    for one in spectra:
        require_choice("quantity", quantity, tuple(map(str, one.quantity.values)))
    speeds = np.array([one.attrs["speed"] for one in spectra])
    require(len(np.unique(speeds)) > 1, "spectra", "be of two or more speeds", speeds)
    factor, unit = in_kilo(str(spectra[0].unit.sel(quantity=quantity).item()))
    places, orders = [], set()
    for speed, one in zip(speeds, spectra, strict=True):
        order = one.order.to_numpy()[1:]
        size = one.amplitude.sel(quantity=quantity).to_numpy()[1:] / factor
        places.append([np.full(len(order), speed), order * speed / (2 * np.pi), size])
        orders |= set(order[order % 1 == 0])
    x, y, size = np.concatenate(places, axis=1)
    ends = np.array([speeds.min(), speeds.max()])
    for order in sorted(orders):
        label = None if ax.lines else "orders"
        ax.plot(ends, order * ends / (2 * np.pi), color=GREY, linewidth=0.7, label=label)
        at = (ends[1], order * ends[1] / (2 * np.pi))
        ax.annotate(f" {order:g}", at, va="center", annotation_clip=False)
    for i, frequency in enumerate(np.asarray(natural)):
        label = None if i else "natural frequencies"
        ax.axhline(frequency, color=ORANGE, linestyle="--", linewidth=1, label=label)
    seen = size >= 0.01 * size.max()
    x, y, size = x[seen], y[seen], size[seen]
    discs = ax.scatter(x, y, 80 * size / size.max(), size, cmap="cividis", zorder=3)
    discs.set(edgecolor=GREY, linewidth=0.4)
    ax.figure.colorbar(discs, ax=ax, label=f"{quantity.replace('_', ' ')} ({unit})", pad=0.06)
    over(ax, "speed")
    ax.set(xlim=ends, ylabel="frequency (Hz)")
    ax.legend(loc="upper left")
    return ax


def plot_multipliers(
    multipliers: Complex[ArrayLike, " n"], ax: Axes | None = None, *, error: float = 0.0
) -> Axes:
    """Floquet multipliers and the unit circle, outside of which disturbances grow.

    `multipliers` and the `error` of their moduli are those of a `PeriodicOrbit`. One that is on the
    circle within the error is neither known to be inside nor outside, and drawn as such.
    """
    ax = plt.subplots()[1] if ax is None else ax
    values, angle = np.asarray(multipliers, complex), np.linspace(0, 2 * np.pi, 361)
    ax.plot(np.cos(angle), np.sin(angle), color=GREY, linewidth=1)
    size = np.abs(values)
    on = np.abs(size - 1) <= error
    kinds = {
        "dies out": (~on & (size < 1), "o", BLUE),
        "grows": (~on & (size >= 1), "X", ORANGE),
        "undecided": (on, "s", PURPLE),
    }
    for label, (chosen, marker, colour) in kinds.items():
        if chosen.any():
            at = values[chosen]
            ax.plot(np.real(at), np.imag(at), marker, color=colour, markersize=5, label=label)
    ax.set(aspect="equal", xlabel=r"Re $\mu$", ylabel=r"Im $\mu$")
    legend_beside(ax)
    return ax


def plot_branch(
    branch: OrbitBranch,
    name: str,
    ax: Axes | None = None,
    *,
    statistic: str | None = None,
    units: Mapping[str, str] | None = None,
) -> Axes:
    """A branch of orbits over its parameter: stable ones solid, others dashed, events as markers.

    **Arguments:**

    - `branch`: as `jaxcrusher.orbit_branch` returns it.
    - `name`: of the parameter, such as "speed", whose axis has rpm above.
    - `statistic`: a column of its table; None is the RMS that it has. Forces are in kN.
    - `units`: names -> units of the parameter; without, those of `plot_landscape`.

    A dotted part is "undecided": its largest multiplier is 1 within its error. A solved event is
    drawn on the branch at its orbit; an event that is only seen has its name in the legend.

    Raises ValueError for a statistic that the table lacks.
    """
    ax = plt.subplots()[1] if ax is None else ax
    table = branch.table
    usual = "foundation_rms" if "foundation_rms" in table else "shaking_rms"
    statistic = usual if statistic is None else statistic
    require_choice("statistic", statistic, tuple(map(str, table.data_vars)))
    factor, unit = in_kilo(str(table[statistic].attrs.get("units", "1")))
    size = over(ax, name, units)
    _line(ax, branch, table.parameter.to_numpy() / size, table[statistic].to_numpy() / factor)
    seen = []
    for event in branch.events:
        marker, colour = _look(event.kind)
        label = event.kind if event.point else f"{event.kind}, only seen"
        at = [], []
        if event.point is not None:
            at = [event.parameter / size], [float(getattr(event.orbit(), statistic)) / factor]
        look = {"color": colour, "markeredgecolor": "k", "linestyle": "", "zorder": 4}
        look["clip_on"] = False
        ax.plot(*at, marker, label=None if label in seen else label, **look)
        seen.append(label)
    meaning = typeset(str(table[statistic].attrs.get("long_name", statistic)))
    ax.set(ylabel=f"{meaning} ({unit})".removesuffix(" (1)"))
    ax.margins(x=0)
    legend_beside(ax)
    return ax


def plot_bifurcation(
    diagram: xr.Dataset,
    ax: Axes | None = None,
    *,
    variable: str = "e_x",
    branches: Iterable[OrbitBranch] = (),
    units: Mapping[str, str] | None = None,
) -> Axes:
    """A bifurcation diagram: section points over a parameter, with the orbits of branches over it.

    **Arguments:**

    - `diagram`: as `jaxcrusher.bifurcation` returns it. Values that failed or whirl have no points.
    - `variable`: the side of the eccentricity, in clearances, of the first loose joint.
    - `branches`: of orbits over the same parameter. An orbit of several turns has a curve for each
      turn. Stable orbits are solid, those that are undecided dotted, and others dashed.
    - `units`: names -> units of the parameter; without, those of `plot_landscape`.

    Raises ValueError for another variable.
    """
    require_choice("variable", variable, ("e_x", "e_y"))
    ax = plt.subplots()[1] if ax is None else ax
    size = over(ax, str(diagram.value.attrs["long_name"]), units)
    values, points = diagram.value.to_numpy() / size, diagram[variable].to_numpy()
    x = np.repeat(values, points.shape[1])
    cloud = {"linestyle": "", "marker": ".", "markersize": 1.5, "color": GREY}
    ax.plot(x, points.ravel(), **cloud, label="once a turn")
    column = ("e_x", "e_y").index(variable)
    for branch in branches:
        nodes = [np.asarray(one.eccentricity)[:, column] for one in branch.orbits]
        # Where each turn begins: orbits and turns.
        at = [e[:: len(e) // one.period] for e, one in zip(nodes, branch.orbits, strict=True)]
        for turn in np.array(at).T:
            _line(ax, branch, branch.table.parameter.to_numpy() / size, turn)
    ax.set(xlim=(values.min(), values.max()), ylabel=f"${variable} / c$")
    ax.legend()
    return ax


def _line(ax: Axes, branch: OrbitBranch, x: np.ndarray, y: np.ndarray) -> None:
    """Draw a number along a branch, in parts that are stable, unstable or undecided."""
    stable, undecided = branch.table.stable.to_numpy(), branch.table.undecided.to_numpy()
    kind = np.where(stable, 0, np.where(undecided, 2, 1))
    begins = np.flatnonzero(np.append(True, kind[1:] != kind[:-1]))
    drawn = ax.get_legend_handles_labels()[1]
    for begin, end in zip(begins, [*begins[1:], len(x)], strict=True):
        label, line, colour = STABILITY[kind[begin]]
        # Up to the first point of the next part, so that the curve has no gaps.
        part = slice(begin, end + 1)
        ax.plot(x[part], y[part], line, color=colour, label=None if label in drawn else label)
        drawn.append(label)


def _look(kind: str) -> tuple[str, str]:
    """Return marker and colour of a kind of event, which may be "unresolved" or at some joint."""
    return next(look for known, look in EVENTS.items() if known in kind)

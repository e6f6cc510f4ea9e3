"""Figures over numbers of a machine: maps of a sweep, kinds of motion, and the capacity."""

from collections.abc import Hashable, Iterable, Mapping

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from jaxtyping import ArrayLike
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.patches import Patch

from jaxcrusher.basics.checks import require, require_choice
from jaxcrusher.crusher.capacity import CrushingChamber
from jaxcrusher.pictures.style import (
    BLUE,
    GREEN,
    ORANGE,
    PURPLE,
    in_kilo,
    legend_beside,
    named,
    over,
    typeset,
)
from jaxcrusher.scenes.units import unit_of

# Kind of motion -> colour and hatching; black hatching reads on each.
REGIMES = {
    "periodic": ("#56B4E9", ""),
    "quasi-periodic": (GREEN, "//"),
    "chaotic": (ORANGE, "xx"),
    "whirl": (PURPLE, "oo"),
    "not settled": ("#F0E442", ".."),
    "undecided": ("0.85", "++"),
    "failed": ("0.45", "\\\\"),
}
HATCHES = ("xx", "//", "..", "\\\\", "++", "oo")


def plot_landscape(
    landscape: xr.DataArray,
    ax: Axes | None = None,
    *,
    marks: Mapping[str, xr.DataArray] | None = None,
    units: Mapping[str, str] | None = None,
    norm: str = "linear",
) -> Axes:
    """A map over two numbers of the crusher, speed and clearance or others, of a sweep's variable.

    `units` maps names to those that the axes have; without, rad/s, mm, degrees, GPa or SI units.
    `marks` maps names to the cells (true, or not 0) that are hatched and named in a legend; a
    cell with several marks shows the first. Cells without a number are grey; a map of nothing else
    says so and has no colour bar. The values along an axis may come in any order. Colours follow
    the scale `norm`, "linear" or "log".

    Raises ValueError for an axis of choices or of a single value, and for more than six marks.
    """
    ax = plt.subplots()[1] if ax is None else ax
    factor, unit = in_kilo(landscape.attrs.get("units", ""))
    across, up = axes_of(landscape.dims)
    _require_numbers("landscape", landscape)
    # Cells are drawn between their neighbours.
    landscape = landscape.sortby([across, up])
    values = landscape.transpose(up, across).to_numpy() / factor
    x, y = (landscape[name].to_numpy() / unit_of(name, units or {})[1] for name in (across, up))
    mesh = ax.pcolormesh(x, y, values, cmap="cividis", norm=norm, shading="nearest")
    if np.isfinite(values).any():
        name = typeset(str(landscape.attrs.get("long_name", landscape.name)))
        label = f"{name} ({unit})".removesuffix(" (1)").removesuffix(" ()")
        ax.figure.colorbar(mesh, ax=ax, label=label)
    else:
        middle = {"x": 0.5, "y": 0.5, "ha": "center", "va": "center", "color": "k"}
        middle["bbox"] = {"facecolor": "w"}
        ax.text(s="no cell has a number", transform=ax.transAxes, **middle)
    label_axes(ax, across, up, units or {})
    marks = {} if marks is None else marks
    require(len(marks) <= len(HATCHES), "marks", f"be at most {len(HATCHES)}", len(marks))
    free = np.ones(values.shape, dtype=bool)
    handles = []
    for hatch, (name, cells) in zip(HATCHES, marks.items(), strict=False):
        chosen = free & (cells.sortby([across, up]).transpose(up, across).to_numpy() != 0)
        free &= ~chosen
        if not chosen.any():
            continue
        # White on black, so that it reads on every colour of the map.
        for colour, width in (("k", 2.4), ("w", 1.0)):
            style = {"facecolor": "none", "edgecolor": colour, "hatch": hatch, "linewidth": 0}
            shown = np.where(chosen, 1.0, np.nan)
            hatched = ax.pcolor(x, y, shown, shading="nearest", **style)
            hatched.set_hatch_linewidth(width)
        hatched.set_label(name)
        handles.append(Patch(facecolor="0.45", edgecolor="w", hatch=hatch, label=name))
    if handles:
        place = {"loc": "lower center", "bbox_to_anchor": (0.5, 1.0), "ncols": 3}
        ax.legend(handles=handles, handleheight=1.6, handlelength=3, **place)
    return ax


def plot_sweep(
    grid: xr.Dataset,
    variable: str = "foundation_rms",
    ax: Axes | None = None,
    *,
    units: Mapping[str, str] | None = None,
) -> Axes:
    """The map of one variable of a `jaxcrusher.sweep`, with what must be known to read it.

    Failed cells and whirls are hatched on grey: a whirl's numbers are outside of the contact
    theory, and so large that nothing else would show. Other cells outside of the theory keep
    their colour under the hatching. `units` are those of `plot_landscape`.
    """
    whirl, success = grid.whirl != 0, grid.success != 0
    marks = {
        "failed": ~success,
        "friction whirl": whirl,
        "outside the contact model": grid.inside_model == 0,
    }
    return plot_landscape(grid[variable].where(success & ~whirl), ax, marks=marks, units=units)


def plot_regimes(
    kinds: xr.DataArray, ax: Axes | None = None, *, units: Mapping[str, str] | None = None
) -> Axes:
    """A map of the kinds of motion over two numbers of a machine, told by colour and hatching.

    `kinds` has the names of `jaxcrusher.regime`, such as "periodic" or "chaotic", of the shape of
    its two dims, whose coordinates are in SI units. An empty name is a cell that is not known; it
    stays grey. A legend names the kinds that occur. `units` are those of `plot_landscape`. A
    horizontal axis of speed has rpm above.

    Raises ValueError for another name, for other than two dims, and for an axis of choices or of a
    single value.
    """
    ax = plt.subplots()[1] if ax is None else ax
    across, up = axes_of(kinds.dims)
    _require_numbers("kinds", kinds)
    kinds = kinds.sortby([across, up]).transpose(up, across)
    for name in np.unique(kinds):
        require_choice("kinds", name, ("", *REGIMES))
    label_axes(ax, across, up, units or {})
    y = kinds[up].to_numpy() / named(up, units or {})[1]
    x = kinds[across].to_numpy() / over(ax, across, units)
    handles = []
    for name, (colour, hatch) in REGIMES.items():
        cells = (kinds == name).to_numpy()
        if not cells.any():
            continue
        look = {"edgecolor": "k", "hatch": hatch, "linewidth": 0}
        shown, cmap = np.where(cells, 1.0, np.nan), ListedColormap([colour])
        ax.pcolor(x, y, shown, shading="nearest", cmap=cmap, label=name, **look)
        handles.append(Patch(facecolor=colour, label=name, **look))
    legend_beside(ax, handles=handles, handleheight=1.6, handlelength=3, title="motion")
    return ax


def plot_capacity(
    chamber: CrushingChamber,
    speeds: ArrayLike,
    floor: float,
    ax: Axes | None = None,
    *,
    units: Mapping[str, str] | None = None,
) -> Axes:
    """Capacity (m3/h) over speeds (rad/s), drawn in the unit of `units`, with its floor."""
    ax = plt.subplots()[1] if ax is None else ax
    label, size = named("speed", units or {})
    ax.plot(np.asarray(speeds) / size, chamber.capacity(speeds), color=BLUE, label="capacity")
    ax.axhline(floor, color=ORANGE, linestyle="--", label=f"floor {floor:.2f} m³/h")
    ax.set(xlabel=label, ylabel="capacity (m³/h)")
    ax.margins(x=0)
    ax.legend()
    return ax


def _require_numbers(argument: str, values: xr.DataArray) -> None:
    """Check that a map has several numbers along each dim, between which cells are drawn."""
    for name in values.dims:
        along = values[name].to_numpy()
        good = along.dtype.kind in "fiu" and len(along) > 1
        require(good, argument, "have two or more numbers along each dim", f"{name} {along}")


def axes_of(dims: Iterable[Hashable]) -> tuple[str, str]:
    """The numbers across and up a map: speed and clearance, or the two in their order."""
    names = tuple(map(str, dims))
    require(len(names) == 2, "landscape", "have two dims", names)
    return ("speed", "clearance") if set(names) == {"speed", "clearance"} else (names[0], names[1])


def label_axes(ax: Axes, across: str, up: str, units: Mapping[str, str]) -> None:
    """Label axes with a map's numbers and units; what is not drawn is grey."""
    (x, _), (y, _) = named(across, units), named(up, units)
    ax.set(xlabel=x, ylabel=y, facecolor="0.6")

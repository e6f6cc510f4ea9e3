"""Figures of motions and landscapes: they draw what they are given and compute no physics.

Every function takes `ax` (None: axes of a new figure) and returns it. Colours are Okabe and Ito's
and maps are cividis, told apart by every kind of colour vision; what colour says, line style,
marker or hatching says too.
"""

from collections.abc import Hashable, Iterable, Mapping
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from jaxtyping import ArrayLike, Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from jaxcrusher.basics.checks import require
from jaxcrusher.crusher.capacity import CrushingChamber
from jaxcrusher.crusher.outline import BLUE as BLUE
from jaxcrusher.crusher.outline import GREEN as GREEN
from jaxcrusher.crusher.outline import ORANGE as ORANGE
from jaxcrusher.crusher.outline import PURPLE as PURPLE
from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.motion.simulation import Trajectory
from jaxcrusher.scenes.parameters import in_words
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
# Okabe and Ito's.
HATCHES = ("xx", "//", "..", "\\\\", "++", "oo")
FORCE = "|R_O| + |R_C|"


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
    kilo = landscape.attrs.get("units") == "N"
    across, up = axes_of(landscape.dims)
    for name in (across, up):
        along = landscape[name].to_numpy()
        good = along.dtype.kind in "fiu" and len(along) > 1
        require(good, "landscape", "have two or more numbers along each dim", f"{name} {along}")
    # Cells are drawn between their neighbours.
    landscape = landscape.sortby([across, up])
    values = landscape.transpose(up, across).to_numpy() / (1e3 if kilo else 1)
    x, y = (landscape[name].to_numpy() / unit_of(name, units or {})[1] for name in (across, up))
    mesh = ax.pcolormesh(x, y, values, cmap="cividis", norm=norm, shading="nearest")
    unit = "kN" if kilo else landscape.attrs.get("units", "")
    if np.isfinite(values).any():
        label = f"{_name(landscape)} ({unit})".removesuffix(" (1)").removesuffix(" ()")
        ax.figure.colorbar(mesh, ax=ax, label=label)
    else:
        middle = {"x": 0.5, "y": 0.5, "ha": "center", "va": "center", "bbox": {"facecolor": "w"}}
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


def axes_of(dims: Iterable[Hashable]) -> tuple[str, str]:
    """The numbers across and up a map: speed and clearance, or the two in their order."""
    names = tuple(map(str, dims))
    require(len(names) == 2, "landscape", "have two dims", names)
    return ("speed", "clearance") if set(names) == {"speed", "clearance"} else (names[0], names[1])


def label_axes(ax: Axes, across: str, up: str, units: Mapping[str, str]) -> None:
    """Names and units of a map's numbers; what is not drawn is grey."""
    called = {"speed": "driving speed", "clearance": "radial clearance"}
    labels = []
    for name in (across, up):
        unit, _ = unit_of(name, units)
        words = called.get(name, in_words(name))
        labels.append(f"{words} ({unit})" if unit else words)
    ax.set(xlabel=labels[0], ylabel=labels[1], facecolor="0.6")


def _name(values: xr.DataArray) -> str:
    """Return the name of the values, with the symbols of the force typeset."""
    name = str(values.attrs.get("long_name", values.name))
    return name if "$" in name else name.replace(FORCE, f"${FORCE}$")


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
    unit, size = unit_of("speed", units or {})
    ax.plot(np.asarray(speeds) / size, chamber.capacity(speeds), color=BLUE, label="capacity")
    ax.axhline(floor, color=ORANGE, linestyle="--", label=f"floor {floor:.2f} m³/h")
    ax.set(xlabel=f"driving speed ({unit})", ylabel="capacity (m³/h)")
    ax.legend()
    return ax


def plot_orbit(
    trajectory: Mapping[str, ArrayLike] | Trajectory,
    clearance: float,
    ax: Axes | None = None,
    *,
    prefix: str = "",
) -> Axes:
    """The centre of a pin in its clearance circle (mm); `prefix` is that of its joint's results."""
    angle = np.linspace(0, 2 * np.pi, 361)
    ax = _path_in(trajectory, prefix, clearance * np.array([np.cos(angle), np.sin(angle)]), ax)
    ax.lines[-1].set_label("pin centre")
    ax.set(xlabel="$e_x$ (mm)", ylabel="$e_y$ (mm)")
    return ax


def plot_play(
    trajectory: Mapping[str, ArrayLike] | Trajectory,
    clearance: float,
    ax: Axes | None = None,
    *,
    prefix: str = "",
) -> Axes:
    """The play of a slider in its guide (mm): inside of the square none of its corners touches."""
    square = clearance * np.array([(1, 0, -1, 0, 1), (0, 1, 0, -1, 0)])
    ax = _path_in(trajectory, prefix, square, ax)
    ax.lines[-1].set_label("slider")
    ax.set(xlabel="off to the left (mm)", ylabel="tilt x half length (mm)")
    return ax


def _path_in(
    trajectory: Mapping[str, ArrayLike] | Trajectory,
    prefix: str,
    edge: np.ndarray,
    ax: Axes | None,
) -> Axes:
    """Draw the path of an eccentricity (m) in mm within the edge of its clearance (m)."""
    ax = plt.subplots()[1] if ax is None else ax
    path = 1e3 * np.asarray(trajectory[f"{prefix}eccentricity"])
    ax.plot(*(1e3 * edge), color="0.4", linestyle="--", linewidth=1, label="clearance")
    ax.plot(path[:, 0], path[:, 1], color=BLUE, linewidth=0.6)
    ax.set(aspect="equal")
    ax.locator_params(nbins=4)
    return ax


def pins_and_force(scene: Scene, seen: Mapping[str, ArrayLike] | Trajectory) -> tuple[Figure, Axes]:
    """Draw each pin in its bore, and each slider in its gap.

    Returns the figure, and the axes beside them for a force.
    """
    joints = dict(scene.joints.items())
    size, widths = (6 + 4 * max(len(joints), 1), 4), [1.0] * len(joints) + [1.6]
    fig, axes = plt.subplots(
        1, len(widths), figsize=size, width_ratios=widths, layout="constrained", squeeze=False
    )
    for ax, (name, joint) in zip(axes[0], joints.items(), strict=False):
        clearance, prefix = float(joint.clearance), scene.prefix(name)
        at = f"{name}: " if prefix else ""
        is_pin = name in scene.bearings
        (plot_orbit if is_pin else plot_play)(seen, clearance, ax, prefix=prefix)
        gap = "radial clearance" if is_pin else "gap on either side"
        ax.set_title(f"{at}{gap} {1e3 * clearance:.4g} mm")
    return fig, axes[0, -1]


def force_size(values: ArrayLike) -> np.ndarray:
    """Return a force in kN, of a vector its length."""
    known = np.asarray(values) / 1e3
    return known if known.ndim == 1 else np.hypot(known[:, 0], known[:, 1])


def plot_force(
    trajectory: Trajectory, ideal: Trajectory | None = None, ax: Axes | None = None
) -> Axes:
    """The foundation or the shaking force (kN) over time (s), with the ideal joint's if given."""
    ax = plt.subplots()[1] if ax is None else ax
    name = "foundation_force" if "foundation_force" in trajectory.values else "shaking_force"
    force = force_size(trajectory[name])
    ax.plot(trajectory.time, force, color=BLUE, linewidth=0.8, label="with clearance")
    if ideal is not None:
        style = {"color": ORANGE, "linestyle": "--", "linewidth": 1.4, "label": "ideal joint"}
        ax.plot(ideal.time, force_size(ideal[name]), **style)
    words = f"${FORCE}$" if name == "foundation_force" else "shaking force"
    ax.set(xlabel="time (s)", ylabel=f"{words} (kN)")
    ax.legend()
    return ax


def plot_spectrum(
    frequencies: Float[ArrayLike, " n"],
    density: Float[ArrayLike, " n"],
    unit: str,
    ax: Axes | None = None,
    *,
    turn_frequency: float | None = None,
) -> Axes:
    """A power density (`unit`^2/Hz) over frequency (Hz).

    `turn_frequency` marks the shaft's turns (Hz). Frequency zero is left out: the axis is
    logarithmic.
    """
    ax = plt.subplots()[1] if ax is None else ax
    ax.loglog(np.asarray(frequencies)[1:], np.asarray(density)[1:], color=BLUE, linewidth=0.8)
    if turn_frequency is not None:
        words = f"turns of the shaft, {turn_frequency:.3g} Hz"
        ax.axvline(turn_frequency, color=ORANGE, linestyle="--", linewidth=1, label=words)
        ax.legend()
    ax.set(xlabel="frequency (Hz)", ylabel=f"power density ({unit}²/Hz)")
    return ax

"""Figures of motions: pins in their bores, forces, spectra and phase portraits."""

from collections.abc import Mapping

import matplotlib.pyplot as plt
import numpy as np
from jaxtyping import ArrayLike, Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jaxcrusher.basics.checks import require, require_choice
from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.motion.simulation import Trajectory
from jaxcrusher.pictures.style import BLUE, FORCE, GREY, ORANGE, WIDTH


def plot_orbit(
    trajectory: Mapping[str, ArrayLike] | Trajectory,
    clearance: float,
    ax: Axes | None = None,
    *,
    prefix: str = "",
) -> Axes:
    """The centre of a pin in its clearance circle (mm); `prefix` is that of its joint's results."""
    angle = np.linspace(0, 2 * np.pi, 361)
    circle = clearance * np.array([np.cos(angle), np.sin(angle)])
    words = "pin centre", "$e_x$ (mm)", "$e_y$ (mm)"
    return _path_in(trajectory[f"{prefix}eccentricity"], circle, ax, *words)


def plot_play(
    trajectory: Mapping[str, ArrayLike] | Trajectory,
    clearance: float,
    ax: Axes | None = None,
    *,
    prefix: str = "",
) -> Axes:
    """The play of a slider in its guide (mm): inside of the square none of its corners touches."""
    square = clearance * np.array([(1, 0, -1, 0, 1), (0, 1, 0, -1, 0)])
    words = "slider", "off to the left (mm)", "tilt x half length (mm)"
    return _path_in(trajectory[f"{prefix}eccentricity"], square, ax, *words)


def _path_in(
    eccentricity: ArrayLike, edge: np.ndarray, ax: Axes | None, label: str, across: str, up: str
) -> Axes:
    """Draw the path of an eccentricity (m) in mm within the edge of its clearance (m)."""
    ax = plt.subplots()[1] if ax is None else ax
    path = 1e3 * np.asarray(eccentricity)
    ax.plot(*(1e3 * edge), color=GREY, linestyle="--", linewidth=1, label="clearance")
    ax.plot(path[:, 0], path[:, 1], color=BLUE, linewidth=0.6, label=label)
    ax.set(aspect="equal", xlabel=across, ylabel=up)
    ax.locator_params(nbins=4)
    return ax


def pins_and_force(scene: Scene, seen: Mapping[str, ArrayLike] | Trajectory) -> tuple[Figure, Axes]:
    """Draw each pin in its bore, and each slider in its gap.

    Returns the figure, as wide as a page for one joint, and the axes beside them for a force.
    """
    joints = dict(scene.joints.items())
    further = 2.4 * max(len(joints) - 1, 0)
    size, widths = (WIDTH + further, 3.0), [1.0] * len(joints) + [1.6]
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


def entitle(figure: Figure, title: str) -> None:
    """Put a title above a figure of `pins_and_force`, and settle its layout."""
    figure.suptitle(title)
    # Square axes have their size only when they are drawn, so a first layout is wrong.
    figure.draw_without_rendering()


def force_size(values: ArrayLike) -> np.ndarray:
    """Return a force in kN, of a vector its length."""
    known = np.asarray(values) / 1e3
    return known if known.ndim == 1 else np.hypot(known[:, 0], known[:, 1])


def plot_force(
    motion: Mapping[str, ArrayLike] | Trajectory,
    ideal: Mapping[str, ArrayLike] | Trajectory | None = None,
    ax: Axes | None = None,
    *,
    angles: Float[ArrayLike, " n"] | None = None,
    label: str = "with clearance",
) -> Axes:
    """The foundation or the shaking force (kN) over time (s), with the ideal joint's if given.

    `angles` (rad) of the shaft stand for the time, which `PeriodicOrbit.motion` does not hold; they
    are drawn in degrees. `label` names the motion in the legend. The axis across ends where the
    data do.

    Raises ValueError for a motion that has neither time nor `angles`.
    """
    ax = plt.subplots()[1] if ax is None else ax
    held = motion.values if isinstance(motion, Trajectory) else motion
    name = "foundation_force" if "foundation_force" in held else "shaking_force"
    if angles is None:
        require(isinstance(motion, Trajectory), "angles", "stand for a time that is missing", None)
        assert isinstance(motion, Trajectory)
        across, below = np.asarray(motion.time), "time (s)"
    else:
        across, below = np.degrees(angles), "shaft angle at mean speed (°)"
    ax.plot(across, force_size(motion[name]), color=BLUE, linewidth=0.8, label=label)
    if ideal is not None:
        look = {"color": ORANGE, "linestyle": "--", "linewidth": 1.4, "label": "ideal joint"}
        ax.plot(across, force_size(ideal[name]), **look)
    words = FORCE if name == "foundation_force" else "shaking force"
    ax.set(xlabel=below, ylabel=f"{words} (kN)")
    ax.margins(x=0)
    ax.legend()
    return ax


def coincide(curves: Axes) -> bool:
    """Tell whether the first two lines of axes lie everywhere within a line's width."""
    one, other = (np.asarray(line.get_ydata(), float) for line in curves.lines[:2])
    low, high = curves.get_ylim()
    height = curves.get_window_extent().height * 72 / curves.get_figure(root=True).dpi
    apart = np.abs(one - other).max() / (high - low) * height
    return bool(apart < max(line.get_linewidth() for line in curves.lines[:2]))


def plot_difference(curves: Axes, ax: Axes | None = None) -> Axes:
    """The first line of `curves` less the second one, forces in kN, as a line in N.

    `ax` None is a narrow panel beneath `curves`, which makes room for it and shares its horizontal
    axis. It shows a difference that `coincide` finds too small to see.

    Raises ValueError for fewer than two lines, and for lines over different abscissae.
    """
    lines = [np.asarray(line.get_xydata(), float) for line in curves.lines[:2]]
    alike = len(lines) == 2 and np.array_equal(lines[0][:, 0], lines[1][:, 0])
    require(alike, "curves", "have two lines over the same abscissae", len(curves.lines))
    if ax is None:
        place = curves.get_subplotspec()
        require(place is not None, "curves", "be a subplot, beneath which there is room", curves)
        assert place is not None
        above, below = place.subgridspec(2, 1, height_ratios=(3, 1), hspace=0.05)
        curves.set_subplotspec(above)
        ax = curves.figure.add_subplot(below, sharex=curves)
        ax.set(xlabel=curves.get_xlabel())
        curves.set(xlabel="")
        curves.tick_params(labelbottom=False)
    (across, one), (_, other) = (line.T for line in lines)
    ax.plot(across, 1e3 * (one - other), color=BLUE, linewidth=0.8)
    ax.axhline(0, color=GREY, linewidth=0.6)
    ax.set(ylabel="difference\n(N)")
    ax.margins(x=0)
    return ax


def plot_phase(
    motion: Trajectory,
    clearance: float,
    ax: Axes | None = None,
    *,
    prefix: str = "",
    side: str = "x",
    section: Float[ArrayLike, "turns 2"] | None = None,
) -> Axes:
    """The phase portrait of a pin: x or y of its eccentricity in clearances, and its rate in mm/s.

    **Arguments:**

    - `motion`: with the eccentricity of the joint whose results begin with `prefix`. The rate is
      that of its samples, by differences of second order, so that a turn should have hundreds.
    - `clearance`: of that joint, m.
    - `side`: of the eccentricity.
    - `section`: points once a turn, where the shaft is at angle zero: the eccentricity in
      clearances and its rate in m/s, as in `poincare_section(...).states[:, [0, 2]]` of x, and in
      the columns 1 and 3 of y.

    Raises ValueError for another side, and for fewer than three instants.
    """
    require_choice("side", side, ("x", "y"))
    require(len(motion.time) > 2, "motion", "have three or more instants", len(motion.time))
    ax = plt.subplots()[1] if ax is None else ax
    place = np.asarray(motion[f"{prefix}eccentricity"])[:, "xy".index(side)]
    rate = np.gradient(place, np.asarray(motion.time), edge_order=2)
    ax.plot(place / clearance, 1e3 * rate, color=BLUE, linewidth=0.6, label="motion")
    if section is not None:
        at = np.asarray(section)
        points = {"marker": "o", "markersize": 3.5, "linestyle": "", "color": ORANGE}
        ax.plot(at[:, 0], 1e3 * at[:, 1], **points, label="once a turn, at angle zero")
        ax.legend()
    ax.set(xlabel=f"$e_{side} / c$", ylabel=rf"$\dot{{e}}_{side}$ (mm/s)")
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

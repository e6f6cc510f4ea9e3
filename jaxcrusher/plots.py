"""Figures of motions and landscapes: they draw what they are given and compute no physics."""

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from jaxtyping import ArrayLike
from matplotlib.axes import Axes

from jaxcrusher.capacity import CrushingChamber
from jaxcrusher.simulate import Trajectory


def plot_landscape(landscape: xr.DataArray, ax: Axes | None = None) -> Axes:
    """A map over speed (rad/s) and clearance (shown in mm) of a variable of a sweep."""
    ax = plt.subplots()[1] if ax is None else ax
    kilo = landscape.attrs.get("units") == "N"
    values = landscape.transpose("clearance", "speed").to_numpy() / (1e3 if kilo else 1)
    mesh = ax.pcolormesh(
        landscape.speed, 1e3 * landscape.clearance, values, cmap="cividis", shading="nearest"
    )
    unit = "kN" if kilo else landscape.attrs.get("units", "")
    label = f"{landscape.attrs.get('long_name', landscape.name)} ({unit})"
    ax.figure.colorbar(mesh, ax=ax, label=label)
    ax.set(xlabel="driving speed (rad/s)", ylabel="radial clearance (mm)")
    return ax


def plot_capacity(
    chamber: CrushingChamber, speeds: ArrayLike, floor: float, ax: Axes | None = None
) -> Axes:
    """Capacity (m3/h) over speed (rad/s), with its floor."""
    ax = plt.subplots()[1] if ax is None else ax
    ax.plot(speeds, chamber.capacity(speeds), color="C0", label="capacity")
    ax.axhline(floor, color="C1", linestyle="--", label=f"floor {floor:.2f} m³/h")
    ax.set(xlabel="driving speed (rad/s)", ylabel="capacity (m³/h)")
    ax.legend()
    return ax


def plot_orbit(trajectory: Trajectory, clearance: float, ax: Axes | None = None) -> Axes:
    """The pin's centre in its clearance circle (mm)."""
    ax = plt.subplots()[1] if ax is None else ax
    assert trajectory.eccentricity is not None
    orbit = 1e3 * np.asarray(trajectory.eccentricity)
    angle = np.linspace(0, 2 * np.pi, 361)
    radius = 1e3 * clearance
    ax.plot(radius * np.cos(angle), radius * np.sin(angle), color="0.4", label="clearance")
    ax.plot(orbit[:, 0], orbit[:, 1], color="C0", linewidth=0.6, label="pin centre")
    ax.set(xlabel="$e_x$ (mm)", ylabel="$e_y$ (mm)", aspect="equal")
    return ax


def plot_force(
    trajectory: Trajectory, ideal: Trajectory | None = None, ax: Axes | None = None
) -> Axes:
    """The foundation force (kN) over time (s), with the ideal joint's if given."""
    ax = plt.subplots()[1] if ax is None else ax
    assert trajectory.foundation_force is not None
    force = np.asarray(trajectory.foundation_force) / 1e3
    ax.plot(trajectory.time, force, color="C0", linewidth=0.8, label="with clearance")
    if ideal is not None and ideal.foundation_force is not None:
        at_rest = np.asarray(ideal.foundation_force) / 1e3
        ax.plot(ideal.time, at_rest, color="k", linestyle="--", linewidth=1, label="ideal joint")
    ax.set(xlabel="time (s)", ylabel=r"$|R_O| + |R_C|$ (kN)")
    ax.legend()
    return ax

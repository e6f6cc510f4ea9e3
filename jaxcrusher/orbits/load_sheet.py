"""The load sheet of a foundation: its numbers in parts, and how severe the standard finds them."""

from dataclasses import dataclass

import numpy as np
import xarray as xr
from jaxtyping import Float

from jaxcrusher.orbits.harmonics import harmonics
from jaxcrusher.orbits.natural_modes import natural_modes
from jaxcrusher.orbits.result import PeriodicOrbit

# Zone boundaries of ISO 20816-3 for machines of 15 to 300 kW (group 2): RMS of the velocity, mm/s,
# and of the displacement, um; A is that of new machines, D may damage. A support is rigid where the
# machine's lowest natural frequency is a quarter above the running frequency.
SOURCE = "ISO 20816-3:2022, group 2 (15 to 300 kW), as ISO 10816-3:2009, table A.2"
ZONES = {
    "rigid": {"velocity": (1.4, 2.8, 4.5), "displacement": (22.0, 45.0, 71.0)},
    "flexible": {"velocity": (2.3, 4.5, 7.1), "displacement": (37.0, 71.0, 113.0)},
}
RIGID = 1.25
SAMPLES = 1024  # instants a turn
SIDES = {"x": "horizontally", "y": "vertically"}


@dataclass(frozen=True)
class Row:
    """A number of the sheet; `order` is that of a harmonic, empty for others, as is `phase`."""

    part: str
    name: str
    order: float | str
    value: float
    unit: str
    phase: float | str = ""  # rad
    remark: str = ""


def zone(kind: str, quantity: str, value: float) -> str:
    """Return the zone of an RMS (mm/s or um) on a rigid or flexible support."""
    return "ABCD"[int(np.searchsorted(ZONES[kind][quantity], value))]


def sheet(orbit: PeriodicOrbit, orders: int) -> list[Row]:
    """Return the rows of the sheet of an orbit, part by part."""
    loads = harmonics(orbit, orders, outputs=(*_carried(orbit), "ground_moment"))
    if orbit.scene.supports is None:
        return [*_static(loads), *_harmonics(loads), *_peaks(orbit)]
    modes = natural_modes(orbit.scene)
    return [
        *_modes(orbit, modes),
        *_static(loads),
        *_harmonics(loads),
        *_peaks(orbit),
        *_severity(orbit, modes),
    ]


def running_frequency(orbit: PeriodicOrbit) -> float:
    """Return the shaft's frequency, Hz."""
    return float(orbit.scene.drive.speed) / (2 * np.pi)


def _modes(orbit: PeriodicOrbit, modes: xr.Dataset) -> list[Row]:
    part, running, rows = "natural modes", running_frequency(orbit), []
    for i in range(modes.sizes["mode"]):
        one = modes.isel(mode=i)
        frequency, ratio = float(one.frequency), float(one.damping_ratio)
        moves = str(one.coordinate.values[int(np.argmax(one.share.values))])
        remark = f"{frequency / running:.3g} times the running frequency, most in {moves}"
        rows.append(Row(part, f"frequency of mode {i + 1}", "", frequency, "Hz", remark=remark))
        rows.append(Row(part, f"damping ratio of mode {i + 1}", "", ratio, "1"))
    return rows


def _carried(orbit: PeriodicOrbit) -> tuple[str, ...]:
    return ("ground_force",) if orbit.scene.supports is None else ("left_force", "right_force")


def _static(found: xr.Dataset) -> list[Row]:
    # What weight and reactions cancel is rounding, some 1e-12 of the largest load.
    rounding = 1e-9 * float(np.abs(found.amplitude).max())
    return [
        Row("static loads", _words(name), "", value, str(one.unit.values))
        for name in found["quantity"].values
        for one in [found.sel(quantity=name, order=0)]
        for value in [float(one.amplitude) if abs(one.amplitude) > rounding else 0.0]
    ]


def _harmonics(found: xr.Dataset) -> list[Row]:
    return [
        Row(
            "harmonics",
            _words(name),
            float(order),
            float(one.amplitude),
            str(one.unit.values),
            float(one.phase),
        )
        for name in found["quantity"].values
        for order in found["order"].values[1:]
        for one in [found.sel(quantity=name, order=order)]
    ]


def _words(quantity: str) -> str:
    """Return the name of a quantity, such as "left force, vertically"."""
    name, _, axis = quantity.rpartition("_")
    return (
        f"{name.replace('_', ' ')}, {SIDES[axis]}" if axis in SIDES else quantity.replace("_", " ")
    )


def _peaks(orbit: PeriodicOrbit) -> list[Row]:
    names = {
        "shaking_rms": ("RMS of the shaking force", "N"),
        "shaking_peak": ("peak of the shaking force", "N"),
        "shaking_moment_rms": ("RMS of what moves of the moment", "N m"),
        "transmitted_rms": ("RMS of what moves of the force on the ground", "N"),
        "transmitted_peak": ("peak of what moves of the force on the ground", "N"),
        "left_peak": ("largest force of the left support, weight included", "N"),
        "right_peak": ("largest force of the right support, weight included", "N"),
    }
    return [
        Row("peaks", words, "", float(orbit[name]), unit)
        for name, (words, unit) in names.items()
        if name in orbit.values
    ]


def support_kind(orbit: PeriodicOrbit, modes: xr.Dataset) -> str:
    """Say whether the standard calls the supports rigid or flexible."""
    lowest = float(modes.frequency.min())
    return "rigid" if lowest >= RIGID * running_frequency(orbit) else "flexible"


def _severity(orbit: PeriodicOrbit, modes: xr.Dataset) -> list[Row]:
    """Return RMS of displacement and velocity at G and at the main bearing, with their zones."""
    kind, rows = support_kind(orbit, modes), []
    peak = float(orbit.frame_displacement_peak) * 1e6
    rows.append(Row("motion", "how far G comes from its mean place", "", peak, "um"))
    for place, path in _paths(orbit).items():
        moving = path - path.mean(axis=0)
        # The shaft angle's derivative by the harmonics.
        turns = np.fft.rfftfreq(len(path), 1 / len(path)) / orbit.period
        spectrum = (
            1j * float(orbit.scene.drive.speed) * turns[:, None] * np.fft.rfft(moving, axis=0)
        )
        velocity = np.fft.irfft(spectrum, len(path), axis=0)
        for quantity, values, unit, one in (
            ("displacement", moving, "um", 1e6),
            ("velocity", velocity, "mm/s", 1e3),
        ):
            for axis, column in zip(SIDES, values.T, strict=True):
                rms = one * float(np.sqrt(np.mean(column**2)))
                remark = f"zone {zone(kind, quantity, rms)}, {kind} support"
                name = f"RMS {quantity} of {place}, {SIDES[axis]}"
                rows.append(Row("motion", name, "", rms, unit, remark=remark))
    return rows


def _paths(orbit: PeriodicOrbit) -> dict[str, Float[np.ndarray, "n 2"]]:
    """Return displacements of G and of the main bearing over the period, m."""
    angles = 2 * np.pi * np.arange(SAMPLES * orbit.period) / SAMPLES
    seen = orbit.motion(angles, ("frame_displacement", "frame_rotation"))
    moved, turned = (np.asarray(seen[name]) for name in ("frame_displacement", "frame_rotation"))
    foundation = orbit.scene.supports
    assert foundation is not None
    arm = orbit.scene.machine.bearing - foundation.point
    x, y = float(arm.x), float(arm.y)
    by_turning = np.stack(
        [
            (np.cos(turned) - 1) * x - np.sin(turned) * y,
            np.sin(turned) * x + (np.cos(turned) - 1) * y,
        ],
        axis=1,
    )
    return {"G": moved, "the main bearing": moved + by_turning}

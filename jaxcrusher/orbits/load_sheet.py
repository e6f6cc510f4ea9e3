"""The load sheet of a foundation: its numbers in parts, and how severe the standard finds them."""

import math
from dataclasses import dataclass

import numpy as np
import xarray as xr
from jaxtyping import Float

from jaxcrusher.basics.checks import require, require_choice
from jaxcrusher.crusher.joints import LETTERS
from jaxcrusher.crusher.scene import Scene
from jaxcrusher.joint.rollers import RollerBearing
from jaxcrusher.motion.statistics_table import SAMPLES
from jaxcrusher.orbits.harmonics import harmonics
from jaxcrusher.orbits.natural_modes import natural_modes
from jaxcrusher.orbits.result import PeriodicOrbit

# Zone boundaries for machines of 15 to 300 kW (group 2): RMS of the velocity, mm/s, and of the
# displacement, um; A is that of new machines, D may damage. A support is rigid in a direction of
# measurement where the lowest natural frequency there is a quarter above the running frequency.
SOURCE = "ISO 10816-3:2009, table A.2, group 2 (15 to 300 kW)"
ZONES = {
    "rigid": {"velocity": (1.4, 2.8, 4.5), "displacement": (22.0, 45.0, 71.0)},
    "flexible": {"velocity": (2.3, 4.5, 7.1), "displacement": (37.0, 71.0, 113.0)},
}
RIGID = 1.25
# A mode counts in a direction in which it has this share of the mobility of the place. The share is
# judged, since the standard has no number: smaller ones come from a weak coupling of directions.
COUNTS = 0.1
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
    """Return the zone of an RMS (mm/s or um) on a rigid or flexible support.

    Raises ValueError for an unknown kind or quantity, and for what is no RMS.
    """
    require_choice("kind", kind, tuple(ZONES))
    require_choice("quantity", quantity, tuple(ZONES[kind]))
    require(0 <= value < math.inf, "value", "be an RMS, finite and >= 0", value)
    return "ABCD"[int(np.searchsorted(ZONES[kind][quantity], value))]


def joint_states(scene: Scene) -> str:
    """Say of each joint whether it is ideal, or what clearance it has."""
    states = []
    for joint, letter in LETTERS.items():
        one, state = scene.joints[joint], "is ideal"
        if one is not None:
            rolls = "rollers and " if isinstance(one, RollerBearing) else ""
            state = f"has {rolls}a radial clearance of {1e3 * float(one.clearance):.4g} mm"
        name = "main bearing" if joint == "main" else joint.replace("_", " ")
        states.append(f"{name} {letter} {state}")
    return ", ".join(states)


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
        one, mode = modes.isel(mode=i), f"mode {i + 1}"
        frequency, ratio = float(one.frequency), float(one.damping_ratio)
        moves = str(one.coordinate.values[int(np.argmax(one.share.values))])
        remark = f"{frequency / running:.3g} times the running frequency, most in {moves}"
        rows.append(Row(part, f"undamped frequency of {mode}", "", frequency, "Hz", remark=remark))
        rows.append(Row(part, f"damping ratio of {mode}", "", ratio, "1"))
    # Dampers couple the modes: what moves freely is no single mode, and need not vibrate.
    for i, (decay, damped) in enumerate(zip(modes.decay, modes.damped_frequency, strict=True)):
        frequency, ratio = float(damped), float(decay / np.hypot(decay, 2 * np.pi * damped))
        remark = f"vibrates at {frequency:.4g} Hz, damping ratio {ratio:.4g}"
        remark = remark if frequency else "overdamped, does not vibrate"
        name = f"decay of free motion {i + 1}"
        rows.append(Row(part, name, "", float(decay), "1/s", remark=remark))
    return rows


def _carried(orbit: PeriodicOrbit) -> tuple[str, ...]:
    return ("ground_force",) if orbit.scene.supports is None else ("left_force", "right_force")


def _static(found: xr.Dataset) -> list[Row]:
    # What weight and reactions cancel is rounding, some 1e-12 of the largest load.
    rounding = 1e-9 * float(np.abs(found.amplitude).max())
    return [
        Row("static loads", _words(name), "", value, str(one.unit.values), remark=remark)
        for name in found["quantity"].values
        # What frame and block weigh stands in the forces of supports alone.
        for remark in ["of shaft, jaw and toggle alone" if name.startswith("ground") else ""]
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


def support_kind(modes: xr.Dataset, running: float, arm: np.ndarray, axis: str) -> str:
    """Say whether the standard calls the supports rigid or flexible in a direction.

    `arm` (m) is from G to where is measured, `axis` a key of `SIDES`, `running` in Hz.
    """
    x, y, turned = modes["shape"].values.T
    moved = {"x": x - arm[1] * turned, "y": y + arm[0] * turned}[axis] ** 2
    lowest = float(modes.frequency.values[moved >= COUNTS * moved.sum()].min())
    return "rigid" if lowest >= RIGID * running else "flexible"


def _severity(orbit: PeriodicOrbit, modes: xr.Dataset) -> list[Row]:
    """Return RMS of displacement and velocity at G and at the main bearing, with their zones."""
    running, rows = running_frequency(orbit), []
    peak = float(orbit.frame_displacement_peak) * 1e6
    rows.append(Row("motion", "how far G comes from its mean place", "", peak, "um"))
    for place, (arm, path) in _paths(orbit).items():
        moving = path - path.mean(axis=0)
        # The derivative by time, from the harmonics.
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
                kind = support_kind(modes, running, arm, axis)
                remark = f"zone {zone(kind, quantity, rms)}, {kind} support"
                name = f"RMS {quantity} of {place}, {SIDES[axis]}"
                rows.append(Row("motion", name, "", rms, unit, remark=remark))
    return rows


def _paths(orbit: PeriodicOrbit) -> dict[str, tuple[np.ndarray, Float[np.ndarray, "n 2"]]]:
    """Return G and the main bearing: the way there from G, and displacements over the period, m."""
    angles = 2 * np.pi * np.arange(SAMPLES * orbit.period) / SAMPLES
    seen = orbit.motion(angles, ("frame_displacement", "frame_rotation"))
    moved, turned = (np.asarray(seen[name]) for name in ("frame_displacement", "frame_rotation"))
    foundation = orbit.scene.supports
    assert foundation is not None
    arm = np.asarray((orbit.scene.machine.bearing - foundation.point).array())
    x, y = arm
    by_turning = np.stack(
        [
            (np.cos(turned) - 1) * x - np.sin(turned) * y,
            np.sin(turned) * x + (np.cos(turned) - 1) * y,
        ],
        axis=1,
    )
    return {"G": (np.zeros(2), moved), "the main bearing": (arm, moved + by_turning)}

"""How severe ISO finds the vibration of a machine: groups, supports, zones."""

import math

import numpy as np
import xarray as xr

from jaxcrusher.basics.checks import require, require_choice
from jaxcrusher.files.text import digits_apart

# Zone boundaries by group of machines: RMS of the velocity, mm/s, and of the displacement, um. A is
# that of new machines, D may damage. Nobody could look them up, nor those of what replaced them.
SOURCE, REPLACED = "ISO 10816-3:2009, tables A.1 and A.2", "ISO 20816-3:2022, which replaced it"
ZONES = {
    1: {
        "rigid": {"velocity": (2.3, 4.5, 7.1), "displacement": (29.0, 57.0, 90.0)},
        "flexible": {"velocity": (3.5, 7.1, 11.0), "displacement": (45.0, 90.0, 140.0)},
    },
    2: {
        "rigid": {"velocity": (1.4, 2.8, 4.5), "displacement": (22.0, 45.0, 71.0)},
        "flexible": {"velocity": (2.3, 4.5, 7.1), "displacement": (37.0, 71.0, 113.0)},
    },
}
GROUPS = {1: "group 1, above 300 kW", 2: "group 2, 15 to 300 kW"}
# Limits of the standard's scope, and of its groups: W and rpm.
LEAST_POWER, LARGE_POWER, LEAST_SPEED = 15e3, 300e3, 120.0
# A support is rigid in a direction of measurement where the lowest natural frequency there is a
# quarter above the running frequency.
RIGID = 1.25
# A mode counts in a direction in which it has this share of the mobility of the place. The share is
# judged, since the standard has no number: smaller ones come from a weak coupling of directions.
COUNTS = 0.1


def group(power: float | None) -> int:
    """Return the group of machines by the motor's power (W); None means group 2."""
    return 1 if power is not None and power > LARGE_POWER else 2


def outside_scope(running: float, power: float | None) -> str:
    """Say why the standard does not apply at a running frequency (Hz) and power (W), or nothing."""
    speed, kilowatts = 60 * running, math.inf if power is None else power / 1e3
    for value, least, unit in ((speed, LEAST_SPEED, "rpm"), (kilowatts, LEAST_POWER / 1e3, "kW")):
        if value < least:
            told = f"{value:.{digits_apart(value, least)}g} {unit}"
            return f"ISO 20816-3 does not apply: {told} is below its {least:g} {unit}"
    return ""


def zone(kind: str, quantity: str, value: float, machines: int = 2) -> str:
    """Return the zone of an RMS (mm/s or um) on a rigid or flexible support, by group.

    Raises ValueError for an unknown kind or quantity, and for a value that is no RMS.
    """
    kinds = ZONES[machines]
    require_choice("kind", kind, tuple(kinds))
    require_choice("quantity", quantity, tuple(kinds[kind]))
    require(0 <= value < math.inf, "value", "be an RMS, finite and >= 0", value)
    return "ABCD"[int(np.searchsorted(kinds[kind][quantity], value))]


def share(kind: str, quantity: str, value: float, machines: int = 2) -> float:
    """Return an RMS as a share of its zone's upper limit; of the lower one in zone D."""
    limits = ZONES[machines][kind][quantity]
    return value / limits[min(int(np.searchsorted(limits, value)), len(limits) - 1)]


def support_kind(modes: xr.Dataset, running: float, arm: np.ndarray, axis: str) -> str:
    """Say whether the standard calls the supports rigid or flexible in a direction, "x" or "y".

    `arm` (m) is from G to the measuring point, `running` in Hz.
    """
    x, y, turned = modes["shape"].values.T
    moved = {"x": x - arm[1] * turned, "y": y + arm[0] * turned}[axis] ** 2
    lowest = float(modes.frequency.values[moved >= COUNTS * moved.sum()].min())
    return "rigid" if lowest >= RIGID * running else "flexible"

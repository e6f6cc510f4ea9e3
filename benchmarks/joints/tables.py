"""The tables of the page which_joint.md."""

import math
from collections.abc import Iterable

from benchmarks.joints.cases import ACROSS, ALONG, NEW
from benchmarks.joints.measure import BEFORE, STARTS, Row
from benchmarks.pages import table

CLEARANCES, WORN = ("worn", "A", "B", "C"), ("worn", "clearance")


def tables(rows: Iterable[Row]) -> dict[str, str]:
    """Return the tables: all joints loose under either load, and one joint loose."""
    together = [row for row in rows if len(row.case.clearances) > 1]
    alone = [row for row in rows if len(row.case.clearances) == 1]
    along, across = ([r for r in together if r.load == load] for load in (ALONG, ACROSS))
    quiet = ("RMS, N", "peak, N", "by A", "by B", "by C", "above 3rd, R_O", "turns", "inside")
    told = ("above 3rd, R_O", "R_C", "RMS R_C / R_O", "peaks R_C / R_O", "bursts R_C")
    poor = ("bursts of a quarter of the samples", "R_C / R_O of what is slow")
    hits = ("m/s at A", "B", "C", "kN at A", "B", "C", "kW at A", "W at B", "W at C")
    only = ("load", "joint", "clearance", "RMS, N", "peak, kN", "m/s", "wear, W", "inside")
    return {
        "along": table((*CLEARANCES, "RMS, kN", "peak, kN", "inside", "whirls"), map(_rms, along)),
        "impacts": table((*WORN, *hits), map(_impacts, along)),
        "across": table((*CLEARANCES, *quiet), map(_slopes, across)),
        "load cells": table((*WORN, *told), map(_signature, along)),
        "poor load cells": table((*WORN, *poor), map(_poor, along)),
        "alone": table(only, map(_alone, alone)),
    }


def _mm(row: Row) -> list[str]:
    return [row.case.worn, *(f"{1e3 * clearance:g}" for clearance in row.case.clearances.values())]


def _worn(row: Row) -> list[str]:
    """Return the worn joint and how far it is worn."""
    worst = {"none": f"{1e3 * NEW:g}", "all": "most"}
    found = row.case.clearances.get(row.case.worn, 0.0)
    return [row.case.worn, worst.get(row.case.worn) or f"{1e3 * found:g}"]


def _number(row: Row, name: str, factor: float, digits: int) -> str:
    """Format a value, with its standard error if it is an average."""
    if math.isnan(row.values[name]):
        return "none"
    text = f"{factor * row.values[name]:.{digits}f}"
    error = row.errors.get(name)
    return text if error is None else f"{text} ± {factor * error:.{digits}f}"


def _inside(row: Row) -> str:
    return "yes" if row.inside else "no"


def _rms(row: Row) -> list[str]:
    forces = [_number(row, f"foundation_{name}", 1e-3, d) for name, d in (("rms", 2), ("peak", 0))]
    return [*_mm(row), *forces, _inside(row), f"{row.whirls} of {STARTS}"]


def _impacts(row: Row) -> list[str]:
    speeds = [f"{row.values[before + 'impact_speed']:.3g}" for before in BEFORE.values()]
    peaks = [f"{row.values[before + 'joint_peak'] / 1e3:.0f}" for before in BEFORE.values()]
    at_a, at_b, at_c = (row.values[before + "sliding_power"] for before in BEFORE.values())
    return [*_worn(row), *speeds, *peaks, f"{at_a / 1e3:.1f}", f"{at_b:.0f}", f"{at_c:.0f}"]


def _slopes(row: Row) -> list[str]:
    forces = [_number(row, f"foundation_{name}", 1.0, 1) for name in ("rms", "peak")]
    slopes = [_number(row, f"slope_{joint}", 1e-3, 1) for joint in "ABC"]
    rest = [f"{row.values['high_share_bearing']:.0e}", _number(row, "settling_turns", 1, 0)]
    return [*_mm(row), *forces, *slopes, *rest, _inside(row)]


def _signature(row: Row) -> list[str]:
    shares = [_number(row, f"high_share_{of}", 1.0, 3) for of in ("bearing", "pivot")]
    ratios = [_number(row, f"{of}_ratio", 1.0, d) for of, d in (("rms", 3), ("peak", 2))]
    return [*_worn(row), *shares, *ratios, _number(row, "bursts", 1.0, 0)]


def _poor(row: Row) -> list[str]:
    return [*_worn(row), _number(row, "bursts_coarse", 1.0, 0), _number(row, "low_ratio", 1.0, 3)]


def _alone(row: Row) -> list[str]:
    ((joint, clearance),) = row.case.clearances.items()
    load, before = "along" if row.load == ALONG else "across", BEFORE[joint]
    forces = [_number(row, "foundation_rms", 1.0, 0), _number(row, "foundation_peak", 1e-3, 1)]
    hits = [f"{row.values[before + name]:.3g}" for name in ("impact_speed", "sliding_power")]
    return [load, joint, f"{1e3 * clearance:g}", *forces, *hits, _inside(row)]

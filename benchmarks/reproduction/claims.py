"""The numbers that the paper claims in its Sections 4 to 6 (claims.csv), and their computation."""

import csv
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Literal

import jax.numpy as jnp
import numpy as np
import xarray as xr

import jaxcrusher as jc
from benchmarks.reproduction.readings import (
    CHOICE,
    POINTS,
    SPEED_POINTS,
    Measurements,
    Point,
    Reading,
)
from benchmarks.reproduction.verdict import Estimate, Printed, estimate, printed
from jaxcrusher.crusher.capacity import AFFLUENCE, CrushingChamber


@dataclass(frozen=True)
class Evidence:
    """The measurements that the claims are computed from."""

    measurements: Measurements
    # The decided reading over Figure 14's box and Figure 15's, as `jaxcrusher.sweep` gives it.
    box: xr.Dataset
    small_box: xr.Dataset


Compute = Callable[[Evidence, Reading], Estimate | None]
TABLE = Path(__file__).with_name("claims.csv")


@dataclass(frozen=True)
class Computation:
    """A function of the evidence under a reading, and what is known of its number."""

    compute: Compute
    # The interval that the paper's other printed numbers leave for this one.
    implied: tuple[float, float] | None = None
    # Whether the readings of the model make a difference to it.
    by_reading: bool = True


@dataclass(frozen=True)
class Claim:
    """A printed number, where it stands, and what computes it."""

    where: str
    text: str
    number: Printed
    unit: str
    by: Computation


def ends(values: list[float]) -> tuple[float, float]:
    """Return the interval that these values span."""
    return min(values), max(values)


def quotient(top: str, bottom: str, factor: float = 1.0) -> tuple[float, float]:
    """Return the interval of factor * top / bottom over what rounds to both."""
    intervals = printed(top).interval, printed(bottom).interval
    return ends([factor * t / b for t in intervals[0] for b in intervals[1]])


def reduction(before: str, after: str) -> tuple[float, float]:
    """Return the interval of 100 (1 - after / before)."""
    least, most = quotient(after, before, 100.0)
    return 100.0 - most, 100.0 - least


def exactly(value: float) -> Compute:
    """Compute a number that no reading changes."""
    return lambda evidence, reading: Estimate(float(value), float(value), float(value))


def unknown(evidence: Evidence, reading: Reading) -> None:
    """Compute nothing: the paper does not print the data."""
    return None


def force(statistic: str, point: Point) -> Compute:
    """Compute `mean`, `rms` or `peak` (N) of the foundation force; 0 mm is the ideal joint."""

    def compute(evidence: Evidence, reading: Reading) -> Estimate:
        return estimate(evidence.measurements[reading, point][f"{reading.force}_{statistic}"])

    return compute


def collision(point: Point) -> Compute:
    """Compute the peak normal force at A, N."""
    return lambda evidence, reading: estimate(
        evidence.measurements[reading, point]["collision_peak"]
    )


def ratio(top: Compute, bottom: Compute, shift: float, scale: float) -> Compute:
    """Compute scale * (top / bottom + shift); the range takes the worst ends."""

    def compute(evidence: Evidence, reading: Reading) -> Estimate | None:
        above, below = top(evidence, reading), bottom(evidence, reading)
        if above is None or below is None:
            return None
        pairs = ((above.value, below.value), (above.low, below.high), (above.high, below.low))
        value, *rest = (scale * (t / b + shift) for t, b in pairs)
        return Estimate(value, min(rest), max(rest))

    return compute


def loudest(points: list[Point]) -> Compute:
    """Compute the driving speed (rad/s) among these points whose peak is largest."""

    def compute(evidence: Evidence, reading: Reading) -> Estimate:
        peaks = [force("peak", point)(evidence, reading) for point in points]
        ends_of = ([getattr(peak, end) for peak in peaks] for end in Estimate._fields)
        return Estimate(*(points[int(np.argmax(values))][0] for values in ends_of))

    return compute


def extreme(pick: Callable, box: Literal["box", "small_box"], variable: str) -> Compute:
    """Compute the least or largest of a sweep; of the decided reading only."""
    return lambda evidence, reading: estimate(pick(getattr(evidence, box)[variable].to_numpy()))


def peak_phase(speed: float) -> float:
    """Return where in a turn the ideal joint's force peaks, in turns from theta1 = 0."""
    turns = np.linspace(0, 1, 20_001)
    motion = jc.simulate(
        jc.ideal_scene(speed), 2 * np.pi / speed * turns, outputs=("normal_force",)
    )
    return float(turns[jnp.argmax(motion.normal_force)])


def computations() -> dict[str, Computation]:
    """Return the computations of claims.csv by name.

    "peak 30 0.06" is that of 30 rad/s and 0.06 mm; without clearance, of the ideal joint.
    """
    point, wide, ideal = (30.0, 0.06), (30.0, 0.12), (30.0, 0.0)
    chambers = [CrushingChamber(height=height) for height in printed("0.6").interval]
    lowest = ends([float(chamber.lowest_speed()) for chamber in chambers])
    rms = extreme(np.max, "box", "foundation_rms")
    peaks = {pick: extreme(pick, "small_box", "foundation_peak") for pick in (np.min, np.max)}
    # These are the same for every reading.
    fixed = {
        "phase": (exactly(peak_phase(30.0)), None),
        "unknown": (unknown, None),
        "lowest speed": (exactly(float(CrushingChamber().lowest_speed())), lowest),
        "least capacity": (exactly(9.41 / AFFLUENCE), quotient("9.41", "1.67")),
        "highest speed": (exactly(25 * 9.41 / 5.63), quotient("9.41", "5.63", 25)),
        # The RMS cannot be below the mean of Section 5.2.
        "largest RMS": (rms, (printed("8e5").interval[0], float("inf"))),
        "least peak": (peaks[np.min], None),
        "largest peak": (peaks[np.max], None),
    }
    at = {
        f"{statistic} {p[0]:g} {p[1]:g}": force(statistic, p)
        for statistic in ("mean", "rms", "peak")
        for p in (*POINTS, ideal)
    }
    peak, mean = partial(force, "peak"), partial(force, "mean")
    ratios = {
        "loudest speed": (loudest(SPEED_POINTS), None),
        "rise of the peak": (ratio(peak(point), peak(ideal), -1, 100), None),
        "peak over collision": (ratio(peak(point), collision(point), 0, 1), None),
        "rise of the mean": (ratio(mean(wide), mean(ideal), 0, 1), quotient("8e5", "1.8e4")),
        "fall of the peak": (
            ratio(peak(CHOICE), peak(point), -1, -100),
            reduction("7.4e4", "3.8e4"),
        ),
    }
    return {
        "collision": Computation(collision(point)),
        **{name: Computation(*of, by_reading=False) for name, of in fixed.items()},
        **{name: Computation(compute) for name, compute in at.items()},
        **{name: Computation(*of) for name, of in ratios.items()},
    }


def claims() -> list[Claim]:
    """Return the paper's claims of claims.csv, in its order."""
    by_name = computations()
    with TABLE.open(encoding="utf-8") as lines:
        rows = [tuple(row.values()) for row in csv.DictReader(lines)]
    return [
        Claim(at, what, printed(paper), unit, by_name[by]) for at, what, paper, unit, by in rows
    ]

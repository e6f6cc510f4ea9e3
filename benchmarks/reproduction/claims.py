"""Every number that the paper claims in its Sections 4 to 6, and how to compute it."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Literal

import jax.numpy as jnp
import numpy as np
import xarray as xr

import jaxcrusher as jc
from benchmarks.reproduction.readings import CHOICE, SPEED_POINTS, Measurements, Point, Reading
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


@dataclass(frozen=True)
class Claim:
    """A printed number, where it stands, and what computes it."""

    where: str
    text: str
    written: str
    unit: str
    compute: Compute
    # The interval that the paper's other printed numbers leave for this one.
    implied: tuple[float, float] | None = None
    # Whether the readings of the model make a difference to it.
    by_reading: bool = True

    @property
    def number(self) -> Printed:
        """The number with its rounding."""
        return printed(self.written)


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


def peak(where: str, written: str, at: Point) -> Claim:
    """Return the claim of a peak force on the foundation."""
    text = f"peak force on the foundation, {at[0]:g} rad/s, {at[1]:g} mm"
    return Claim(where, text, written, "N", force("peak", at))


def claims() -> list[Claim]:
    """Return the paper's claims, in its order."""
    point, wide, ideal = (30.0, 0.06), (30.0, 0.12), (30.0, 0.0)
    at_a, phase = collision(point), exactly(peak_phase(30.0))
    at_point, at_ideal, at_choice = (force("peak", at) for at in (point, ideal, CHOICE))
    rise, fall = ratio(at_point, at_ideal, -1, 100), ratio(at_choice, at_point, -1, -100)
    mean_wide, mean_ideal = force("mean", wide), force("mean", ideal)
    chambers = [CrushingChamber(height=height) for height in printed("0.6").interval]
    lowest = ends([float(chamber.lowest_speed()) for chamber in chambers])
    least, greatest = (extreme(pick, "small_box", "foundation_peak") for pick in (np.min, np.max))
    # These are the same for every reading.
    fixed = partial(Claim, by_reading=False)
    return [
        Claim("4.1, Fig. 5", "peak collision force, MATLAB", "37578", "N", at_a),
        Claim("4.1, Fig. 5", "peak collision force, Adams", "37796", "N", at_a),
        # 12.106 s and 12.099 s at 30 rad/s; of the times themselves 5 % are three turns.
        fixed(
            "4.1, Fig. 5",
            "when in its turn, MATLAB, 12.106 s (ours: ideal joint)",
            "0.802",
            "turns",
            phase,
        ),
        fixed(
            "4.1, Fig. 5",
            "when in its turn, Adams, 12.099 s (ours: ideal joint)",
            "0.768",
            "turns",
            phase,
        ),
        fixed(
            "4.2, Fig. 7b",
            "greatest capacity, at 25 rad/s (b, s not given)",
            "9.41",
            "m³/h",
            unknown,
        ),
        fixed(
            "4.2",
            "least speed, by h < H = 0.6 m in (24), (25)",
            "25",
            "rad/s",
            exactly(CrushingChamber().lowest_speed()),
            lowest,
        ),
        fixed(
            "4.2",
            "least capacity, 9.41 / 1.67",
            "5.63",
            "m³/h",
            exactly(9.41 / AFFLUENCE),
            quotient("9.41", "1.67"),
        ),
        fixed(
            "4.2",
            "speed of the least capacity, by (21)-(25)",
            "41.45",
            "rad/s",
            exactly(25 * 9.41 / 5.63),
            quotient("9.41", "5.63", 25),
        ),
        peak("5.1, Fig. 9a", "2.3e4", (25.0, 0.06)),
        peak("5.1, Fig. 9b", "7.4e4", point),
        peak("5.1, Fig. 9c", "4.1e4", (35.0, 0.06)),
        peak("5.1, Fig. 9d", "4e4", (40.0, 0.06)),
        Claim(
            "5.1",
            "driving speed of the largest of these four",
            "30",
            "rad/s",
            loudest(SPEED_POINTS),
        ),
        Claim("5.1", "rise of the peak by the clearance, 30 rad/s, 0.06 mm", "180", "%", rise),
        Claim(
            "5.1",
            "peak of the ideal joint that 180 % implies (7.4e4 / 2.8)",
            "2.64e4",
            "N",
            at_ideal,
        ),
        Claim(
            "4.1, 5.1",
            "peak on the foundation over peak at A (the quotient is ours)",
            "1.97",
            "1",
            ratio(at_point, at_a, 0, 1),
        ),
        peak("5.2, Fig. 12a", "6e4", (30.0, 0.03)),
        peak("5.2, Fig. 12c", "1.1e6", (30.0, 0.09)),
        peak("5.2, Fig. 12d", "1.7e6", wide),
        Claim("5.2", "mean force on the foundation, 30 rad/s, 0.12 mm", "8e5", "N", mean_wide),
        Claim(
            "5.2", "mean force on the foundation, ideal joint, 30 rad/s", "1.8e4", "N", mean_ideal
        ),
        Claim(
            "5.2",
            "the former over the latter",
            "45",
            "1",
            ratio(mean_wide, mean_ideal, 0, 1),
            quotient("8e5", "1.8e4"),
        ),
        fixed(
            "5.3, Fig. 14b",
            "largest contour of the RMS (cannot be below the mean of 5.2)",
            "9e4",
            "N",
            extreme(np.max, "box", "foundation_rms"),
            (printed("8e5").interval[0], float("inf")),
        ),
        fixed("5.3, Fig. 15b", "smallest contour of the peak, up to 0.06 mm", "2e4", "N", least),
        fixed("5.3, Fig. 15b", "largest contour of the peak, up to 0.06 mm", "2e5", "N", greatest),
        Claim(
            "5.3",
            "mean force on the foundation, 39 rad/s, 0.03 mm",
            "2.19e4",
            "N",
            force("mean", CHOICE),
        ),
        Claim("5.3", "the same number taken as an RMS", "2.19e4", "N", force("rms", CHOICE)),
        peak("5.3, Fig. 16b", "3.8e4", CHOICE),
        Claim(
            "5.3, 6",
            "fall of the peak from 30 rad/s, 0.06 mm to 39 rad/s, 0.03 mm",
            "48.6",
            "%",
            fall,
            reduction("7.4e4", "3.8e4"),
        ),
    ]

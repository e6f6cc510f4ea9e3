"""The curve of a crushing load over the shaft's angle, from a file or an array.

```text
angle_deg, force_kN
0, 2.1
10, 4.8
```

Angles lie in [0, 360], in any order and at any spacing, and the curve closes by itself.
"""

import functools
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxcrusher.basics.checks import number_in, primal, require
from jaxcrusher.basics.periodic_spline import (
    TURN,
    PeriodicSeries,
    PeriodicSpline,
    series_of,
    spline_through,
)
from jaxcrusher.files.table import read_cells

HEADER = ["angle_deg", "force_kN"]
# Of two points a periodic cubic spline knows only their difference.
FEWEST = 3
# A turn that was written in degrees or radians of a few digits, rad.
SAME_ANGLE = 1e-6
# A spline through more points than these is replaced by so many orders of its Fourier series, which
# take a seventh of the time in lanes, where they miss no point by more than this share of the
# largest force.
MOST, ORDERS, MISSED = 64, 48, 1e-6


def load_curve(given: Any) -> PeriodicSpline | PeriodicSeries:
    """Return the spline through a curve: a CSV file, or an array (n, 2) of rad and N.

    A smooth curve through more than `MOST` known points is replaced by `ORDERS` orders of its
    Fourier series, if the series meets them. The array may be traced. Raises ValueError for a file
    that cannot be read, and for too few points, numbers that are not finite, angles outside a turn
    or repeated, and two different forces at 0 and 360 degrees.
    """
    points = read_curve(given)
    shape = points.shape
    good = len(shape) == 2 and shape[1] == 2
    require(good, "load_curve", "have shape (n, 2), of angle and force", f"of shape {shape}")
    known, smooth = primal(points), False
    if known is not None:
        kept = _through(known)
        points, known = points[kept], known[kept]
        smooth = len(points) > MOST and _is_smooth(known.tobytes())
    points = jnp.asarray(points)
    spline = spline_through(points[:, 0], points[:, 1])
    return series_of(spline, ORDERS) if smooth else spline


@functools.lru_cache(maxsize=64)  # scenes of one curve are built many times
def _is_smooth(content: bytes) -> bool:
    """Whether a series meets the points."""
    angle, force = np.frombuffer(content).reshape(-1, 2).T
    with jax.ensure_compile_time_eval():
        series = series_of(spline_through(jnp.asarray(angle), jnp.asarray(force)), ORDERS)
        off = np.abs(np.asarray(jax.vmap(series)(jnp.asarray(angle))) - force)
    return bool(off.max() <= MISSED * np.abs(force).max())


def read_curve(given: Any) -> Array | np.ndarray:
    """Return the points of a CSV file or an array, in rad and N; ValueError as `load_curve`."""
    if not isinstance(given, str | Path):
        try:
            return jnp.asarray(given, dtype=float)
        except (TypeError, ValueError):
            raise ValueError("Argument `load_curve` must be pairs [rad, N], but is not.") from None
    path = str(given)

    def fail(why: str) -> ValueError:
        return ValueError(
            f"Argument `load_curve` must be a CSV file of a load, but {path!r} {why}."
        )

    try:
        rows = [(i, cells) for i, cells in enumerate(read_cells(path), 1) if any(cells)]
    except ValueError as error:
        raise fail(str(error)) from None
    if not rows or rows[0][1] != HEADER:
        raise fail(f"does not begin with the line {', '.join(HEADER)}")
    points = []
    for i, cells in rows[1:]:
        try:
            angle, force = map(number_in, cells)
        except ValueError:
            raise fail(f"has no angle and force in line {i}: they have decimal points") from None
        points.append((np.radians(angle), 1e3 * force))
    return np.array(points).reshape(-1, 2)


def _through(points: np.ndarray) -> np.ndarray:
    """Return which points the spline goes through: of the two ends of a turn the first."""

    def check(good: bool | np.bool, must: str, but: str) -> None:
        require(good, "load_curve", must, but)

    check(np.isfinite(points).all(), "be finite", "not finite")
    angle, force = points.T
    outside = (angle < 0) | (angle > TURN + SAME_ANGLE)
    listed = ", ".join(f"{a:g}" for a in np.degrees(angle[outside][:3]))
    check(not outside.any(), "have angles from 0 to 360 deg", f"at {listed} deg")
    first, last = angle < SAME_ANGLE, angle > TURN - SAME_ANGLE
    closed = first.any() and last.any()
    if closed:
        one, other = force[first][0], force[last][0]
        same = abs(one - other) <= 1e-6 * np.abs(force).max()
        check(same, "close at 360 deg", f"{one:g} N at 0 and {other:g} N at 360 deg")
    kept = ~last if closed else np.ones(angle.size, bool)
    inside = np.sort(angle[kept])
    again = np.degrees(inside[1:][np.diff(inside) < SAME_ANGLE])
    check(again.size == 0, "have every angle once", f"twice at {again[:1]} deg")
    check(inside.size >= FEWEST, f"have {FEWEST} points or more", f"of {inside.size}")
    return kept

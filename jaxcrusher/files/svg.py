"""Small pictures as text, for tables in notebooks: in the colour of the text round them."""

import html
from collections.abc import Iterable

import numpy as np
from jaxtyping import ArrayLike

# Height of a picture, and its margin; a curve is twice as wide.
SIDE, MARGIN = 120.0, 6.0
# A line has so many points at most.
MOST_POINTS = 512


def path_in_circles(
    paths: Iterable[ArrayLike], title: str, circles: Iterable[tuple[float, float, float]] = ()
) -> str:
    """Return lines through points, shape (n, 2), and circles (x, y, radius), in one scale.

    y is up. Points that are not finite are left out.
    """
    lines, rings = [_finite(path) for path in paths], np.reshape([*circles], (-1, 3))
    corners = [rings[:, :2] - rings[:, 2:], rings[:, :2] + rings[:, 2:]]
    low, size = _box(np.concatenate([*lines, *corners]))
    scale = (SIDE - 2 * MARGIN) / (max(size) or 1.0)
    width = scale * size[0] + 2 * MARGIN
    height = scale * size[1] + 2 * MARGIN

    def placed(points: np.ndarray) -> np.ndarray:
        x, y = (scale * (points - low)).T
        return np.stack([MARGIN + x, height - MARGIN - y], axis=1)

    round_ = zip(placed(rings[:, :2]), scale * rings[:, 2], strict=True)
    drawn = [
        f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{r:.1f}" stroke-opacity="0.5"/>'
        for (x, y), r in round_
    ]
    return _svg(width, height, title, [*drawn, *(_line(placed(line)) for line in lines)])


def pins_in_bores(paths: Iterable[ArrayLike]) -> str:
    """Return paths of pins, in clearances, in the circle that they touch the bore on."""
    return path_in_circles(paths, "pin in its bore, within the clearance", [(0.0, 0.0, 1.0)])


def curve(x: ArrayLike, y: ArrayLike, title: str) -> str:
    """Return the curve of y over x, each in a scale of its own; the title says what they are."""
    points = _finite(np.stack([np.asarray(x, float), np.asarray(y, float)], axis=-1))
    low, size = _box(points)
    room = np.array([2 * SIDE, SIDE]) - 2 * MARGIN
    placed = MARGIN + (points - low) / np.where(size > 0, size, 1.0) * room
    placed[:, 1] = SIDE - placed[:, 1]
    return _svg(2 * SIDE, SIDE, title, [_line(placed)])


def _finite(path: ArrayLike) -> np.ndarray:
    points = np.asarray(path, float).reshape(-1, 2)
    points = points[np.isfinite(points).all(axis=1)]
    return points[:: len(points) // MOST_POINTS + 1]


def _box(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the lower left corner of points, and the size of their box."""
    if not len(points):
        return np.zeros(2), np.zeros(2)
    return points.min(axis=0), np.ptp(points, axis=0)


def _line(points: np.ndarray) -> str:
    listed = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
    return f'<polyline points="{listed}"/>'


def _svg(width: float, height: float, title: str, drawn: list[str]) -> str:
    below = html.escape(title)
    return (
        f'<figure style="margin: 0"><svg xmlns="http://www.w3.org/2000/svg" width="{width:.0f}" '
        f'height="{height:.0f}" fill="none" stroke="currentColor">{"".join(drawn)}</svg>'
        f'<figcaption style="font-size: smaller">{below}</figcaption></figure>'
    )

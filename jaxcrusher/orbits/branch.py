"""Branches of orbits over one parameter, followed round their folds.

Pseudo-arclength continuation (Keller 1977; Doedel's AUTO): the parameter is one unknown more, and
a step has its length along the branch, so that a fold is a point like any other. Where a branch
turns back there is more than one motion for one parameter. It takes any discretisation of
`jaxcrusher.orbits.problem`, and finds where a branch folds, doubles its period, loses a pair of
multipliers or the contact of a joint.
"""

import dataclasses
import itertools
from dataclasses import dataclass
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import ArrayLike, Complex, Float
from scipy.interpolate import CubicHermiteSpline
from scipy.optimize import brentq

from jaxcrusher.orbits.newton import linear_solution
from jaxcrusher.orbits.problem import AbstractPeriodicProblem, Bordered, Stride

# After so many of Newton's steps a step along the branch may grow.
EASY = 4
GROWTH, SHRINKAGE = 1.4, 0.5
# A longer turn of the tangent in a step than this cosine may be a hop to another branch.
LEAST_COSINE = 0.9
# A pair that meets the unit circle off the real axis lies so near it where it is located.
ON_CIRCLE = 1e-4
# Points followed back to where a branch of fewer turns was doubled.
BACK = 12

ENDS = (
    "The buffer is full.",
    "The parameter has left its bounds.",
    "What is monitored has become negative.",
    "No step is short enough for Newton's method.",
)
SHORTER = "The orbit repeats after fewer turns, which were doubled."
DOUBLING, PAIR = "period doubling", "Neimark-Sacker"


@dataclass(frozen=True)
class Point:
    """A point of a branch, the branch's direction there, and what is known of its orbit."""

    u: np.ndarray
    value: float  # of the parameter, in its scale
    along: Float[np.ndarray, " both"]  # of both, of length one
    multipliers: Complex[np.ndarray, " states"]
    monitors: Float[np.ndarray, " joints"]  # least penetrations, as far as they are watched
    turns: int  # after which it repeats already
    corrections: int
    seen: Any  # what its equations told

    @property
    def place(self) -> Float[np.ndarray, " n"]:
        """Unknowns and parameter."""
        return np.append(self.u, self.value)


@dataclass(frozen=True)
class Special:
    """Where a branch changes; no point where a change is seen but not located.

    `kind` is "fold", "period doubling", "Neimark-Sacker" or what the problem watches.
    """

    kind: str
    parameter: float
    point: Point | None


@dataclass(frozen=True)
class Branch:
    """Orbits of a problem along a branch, in the scale of the parameter, and why it ends."""

    problem: AbstractPeriodicProblem
    scale: float
    points: list[Point]
    ended: str
    parent: Point | None = None  # of fewer turns, past the doubling that the branch came from

    @property
    def parameter(self) -> Float[np.ndarray, " points"]:
        """Values of the parameter, in its unit."""
        return self.scale * np.array([point.value for point in self.points])


def follow(
    problem: AbstractPeriodicProblem,
    u: Float[ArrayLike, "..."],
    start: float,
    *,
    scale: float,
    bounds: tuple[float, float],
    upwards: bool = True,
    stride: Stride | None = None,
    points: int = 200,
) -> Branch:
    """Return the branch through the orbit near `u` at the parameter `start`.

    **Arguments:**

    - `problem`: a discretisation of the orbits.
    - `u`: its unknowns. `start`, `bounds`: in the parameter's unit.
    - `scale`: what a change of the parameter is to be small against, as u is of order one.
    - `upwards`: whether the parameter grows at first.
    - `stride`: steps in the norm of the problem; None is the problem's own.
    - `points`: at most. A branch also ends outside of the bounds, after the first point where what
      the problem watches is not > 0, and after an orbit of fewer turns.

    **Returns:** a `Branch`, without points where there is no orbit near `u`.
    """
    stride = problem.stride if stride is None else stride
    u = np.asarray(u, float)
    guess = np.append(u, start / scale)
    onward = np.append(np.zeros(u.size), 1.0 if upwards else -1.0)
    here = _corrected(problem, u.shape, scale, guess, onward)
    if here is None:
        return Branch(problem, scale, [], ENDS[3])
    found, length = [here], stride.first
    while len(found) < points:
        there = _corrected(problem, u.shape, scale, here.place + length * here.along, here.along)
        if there is None or not _reached(problem, here, there, length, stride):
            length *= SHRINKAGE
            if length < stride.shortest:
                return Branch(problem, scale, found, ENDS[3])
            continue
        if there.turns < problem.period:
            return Branch(problem, scale, found, SHORTER, there)
        found.append(there)
        if not bounds[0] <= scale * there.value <= bounds[1]:
            return Branch(problem, scale, found, ENDS[1])
        if not np.all(there.monitors > 0):
            return Branch(problem, scale, found, ENDS[2])
        here = there
        length = min(length * (GROWTH if here.corrections <= EASY else 1.0), stride.longest)
    return Branch(problem, scale, found, ENDS[0])


def _corrected(
    problem: AbstractPeriodicProblem,
    shape: tuple[int, ...],
    scale: float,
    guess: Float[np.ndarray, " n"],
    across: Float[np.ndarray, " n"],
) -> Point | None:
    """Return the point of the branch straight across a direction; None if there is none."""
    plane = jnp.asarray(guess), jnp.asarray(across)
    root = problem.solved(Bordered(problem, *plane, jnp.asarray(scale, float), shape))
    if root is None:
        return None
    onward = linear_solution(root.jacobian, np.append(np.zeros(guess.size - 1), 1.0))
    if not np.isfinite(onward).all():
        return None
    onward = onward / np.sqrt(_inner(problem, onward, onward))
    u, value = root.point[:-1].reshape(shape), float(root.point[-1])
    orbit = jnp.asarray(u), jnp.asarray(scale * value), root.seen
    watched = problem.monitors(*orbit) if problem.watched else np.zeros(0)
    multipliers, turns = problem.multipliers(*orbit), problem.turns(root.seen)
    return Point(u, value, onward, multipliers, watched, turns, root.steps, root.seen)


def _reached(
    problem: AbstractPeriodicProblem, here: Point, there: Point, length: float, stride: Stride
) -> bool:
    """Whether a step has stayed on its branch."""
    off = there.place - here.place - length * here.along
    astray = np.sqrt(_inner(problem, off, off))
    turned = _inner(problem, there.along, here.along)
    return bool(turned > LEAST_COSINE and astray <= stride.straight * length)


def _inner(problem: AbstractPeriodicProblem, one: np.ndarray, other: np.ndarray) -> float:
    """Return the product whose norm measures steps."""
    return float(problem.weight(one.size - 1) * (one[:-1] @ other[:-1]) + one[-1] * other[-1])


def special_points(branch: Branch) -> list[Special]:
    """Return folds, period doublings, Neimark-Sacker points, and where what is watched vanishes.

    Each lies between two points of the branch that a test function has different signs at. What
    vanishes twice between two points is not seen.
    """
    problem, found = branch.problem, []
    for here, there in itertools.pairwise(branch.points):
        before, after = (test_functions(point, problem.watched) for point in (here, there))
        for kind in before:
            if not before[kind] * after[kind] < 0:
                continue
            place = _located(branch, here, there, kind)
            if place is not None and place.turns < problem.period:
                # The branch meets its parent orbit at a period doubling, and goes on a turn later.
                kind = DOUBLING
            if place is None or kind != PAIR or leaves_circle(place.multipliers):
                value = np.nan if place is None else branch.scale * place.value
                found.append(Special(kind, value, place))
    return found


def test_functions(point: Point, watched: tuple[str, ...]) -> dict[str, float]:
    """Return what changes its sign where a branch changes; no two eigenvalues are told apart."""
    values = point.multipliers
    pairs = [1 - a * b for i, a in enumerate(values) for b in values[i + 1 :]]
    return {
        "fold": float(point.along[-1]),
        DOUBLING: float(np.prod(1 + values).real),
        # Of all products of two multipliers: the determinant of the bialternate product.
        PAIR: float(np.prod(pairs).real) if len(values) > 2 else 1.0,
        **dict(zip(watched, point.monitors.tolist(), strict=True)),
    }


def leaves_circle(values: Complex[np.ndarray, " n"]) -> bool:
    """Whether a pair lies on the unit circle, off the real axis: two real ones may be 1 / each."""
    off_axis = values[np.abs(np.imag(values)) > ON_CIRCLE]
    return bool(np.any(np.abs(np.abs(off_axis) - 1) < ON_CIRCLE))


class _Lost(Exception):
    """Newton's method leads from between two points to no orbit."""


def _located(branch: Branch, here: Point, there: Point, kind: str) -> Point | None:
    """Return the special point between two points, on planes across the line that joins them."""
    problem = branch.problem
    chord = there.place - here.place
    size = np.sqrt(_inner(problem, chord, chord))
    across = chord / size
    # A cubic through both, along the branch at both ends, is near it in between.
    ends = [size * one.along / _inner(problem, one.along, across) for one in (here, there)]
    curve = CubicHermiteSpline([0, 1], [here.place, there.place], ends)
    known = {0.0: here, 1.0: there}

    def test(share: float) -> float:
        if share not in known:
            found = _corrected(problem, here.u.shape, branch.scale, curve(share), across)
            if found is None:
                raise _Lost
            known[share] = found
        return test_functions(known[share], problem.watched)[kind]

    try:
        root = brentq(test, 0.0, 1.0, xtol=problem.stride.located)
        assert isinstance(root, float)
        test(root)
    except _Lost:
        return None
    return known[root]


def origin(branch: Branch, parent: Point) -> Special:
    """Return the doubling that a branch came from; `parent`, of fewer turns, is followed back."""
    back = follow(
        dataclasses.replace(branch.problem, period=parent.turns),
        parent.u,
        branch.scale * parent.value,
        scale=branch.scale,
        bounds=(-np.inf, np.inf),
        upwards=parent.value < branch.points[-1].value,
        points=BACK,
    )
    found = [one for one in special_points(back) if one.kind == DOUBLING]
    return found[0] if found else Special(DOUBLING, np.nan, None)

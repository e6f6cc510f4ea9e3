"""Branches of orbits over one parameter, followed round their folds.

Pseudo-arclength continuation (Keller 1977; Doedel's AUTO): the parameter is one more unknown, and
the length of a step is measured along the branch, so that a fold is a point like any other. Where a
branch turns back there is more than one motion for one parameter. Any discretisation of
`jaxcrusher.periodic.problem` will do. `jaxcrusher.periodic.events` finds where a branch changes.
"""

from dataclasses import dataclass
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import ArrayLike, Complex, Float
from scipy.optimize import linear_sum_assignment

from jaxcrusher.periodic.problem import AbstractPeriodicProblem, Bordered, Stride, Zero

# After so many of Newton's steps a step along the branch may grow.
EASY = 4
GROWTH, SHRINKAGE = 1.4, 0.5
# A longer turn of the tangent in a step than this cosine may be a hop to another branch.
LEAST_COSINE = 0.9
# After so many points a branch that comes back to its first one is closed.
CLOSED = 8
# No multiplier near the unit circle moves further in a step, so that none passes -1 or 1 unseen.
MOST_MOVED = 0.6
# The defect of the equations moves the branch. If this shift changes along a step by more than this
# share of the step, the branch of the equations may turn back where the exact one does not.
MOST_SHAKEN = 0.5

# Why a branch ends.
ENOUGH = "As many points as were asked for are found."
OUTSIDE = "The parameter has left its bounds."
HAPPENED = "The branch ends with an event: {}."
NO_STEP = "No step is short enough for Newton's method."
LOOP = "The branch is closed."
WIGGLES = "The branch wiggles within the error of its equations, and there are no finer ones."
SHORTER = "The orbit repeats after fewer turns, which were doubled."


@dataclass(frozen=True)
class Point:
    """A point of a branch, the branch's direction there, and what is known of its orbit."""

    u: np.ndarray
    value: float  # of the parameter, in its scale
    tangent: Float[np.ndarray, " both"]  # of both, of length one
    monodromy: Float[np.ndarray, "states states"]
    multipliers: Complex[np.ndarray, " states"]  # its eigenvalues
    monitors: Float[np.ndarray, " watched"]
    turns: int  # after which it repeats already
    corrections: int
    seen: Any  # what its equations told
    # Estimated shift to the exact branch, straight across; NaN at a branch point.
    off: Float[np.ndarray, " both"]
    # Of the branch that crosses this one at a branch point; None if there is none, or not known.
    crossing: Float[np.ndarray, " both"] | None = None

    @property
    def place(self) -> Float[np.ndarray, " n"]:
        """Unknowns and parameter."""
        return np.append(self.u, self.value)


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
    off: Float[np.ndarray, " n"] | None = None,
    stride: Stride | None = None,
    points: int = 200,
) -> Branch:
    """Return the branch through the orbit near `u` at the parameter `start`.

    **Arguments:**

    - `problem`: a discretisation of the orbits.
    - `u`: its unknowns. `start`, `bounds`: in the parameter's unit.
    - `scale`: of the parameter, against which its changes are small; u is of order one.
    - `upwards`: whether the parameter grows at first.
    - `off`: where another branch passes, the direction of u and the scaled parameter in which this
      branch leaves `u`, of any length; None: none passes. Backwards if not `upwards`.
    - `stride`: steps in the norm of the problem; None is the problem's own.
    - `points`: the most points. A branch also ends on one of the bounds, after an orbit of fewer
      turns, where it is closed and, for a problem that says so, where what it watches is not > 0.

    A branch that wiggles within the error of its equations is followed again, by finer equations
    and from its beginning. If the finest ones wiggle too, it ends there, and `ended` says so.

    **Returns:** a `Branch`, without points where there is no orbit near `u`, or where the first one
    off another branch is out of bounds.
    """
    stride = problem.stride if stride is None else stride
    u = np.asarray(u, float)
    how = scale, bounds, 1 if upwards else -1, stride, points
    while True:
        branch = _followed(problem, u, start, off, *how)
        finer = problem.resolved(u, True) if branch.ended == WIGGLES else None
        if finer is None:
            return branch
        if off is not None:
            way = problem.resolved(off[:-1].reshape(u.shape), True)
            assert way is not None
            off = np.append(way[1], off[-1])
        problem, u = finer


def _followed(
    problem: AbstractPeriodicProblem,
    u: np.ndarray,
    start: float,
    off: Float[np.ndarray, " n"] | None,
    scale: float,
    bounds: tuple[float, float],
    sign: int,
    stride: Stride,
    points: int,
) -> Branch:
    """Return the branch of the equations as they are."""
    guess = np.append(u, start / scale)
    onward = sign * (np.eye(guess.size)[-1] if off is None else off)
    if off is not None:
        onward = onward / np.sqrt(inner(problem, onward, onward))
        guess = guess + stride.first * onward
    here = corrected(problem, u.shape, scale, guess, onward)
    if here is None:
        return Branch(problem, scale, [], NO_STEP)
    low, high = np.array(bounds) / scale
    if not low - stride.shortest <= here.value <= high + stride.shortest:
        return Branch(problem, scale, [], OUTSIDE)
    found, length = [here], stride.first
    while len(found) < points:
        there = corrected(problem, u.shape, scale, here.place + length * here.tangent, here.tangent)
        lost = there is None or not _reached(problem, here, there, length, stride)
        if there is None or lost or (length > 2 * stride.shortest and _leapt(here, there)):
            length *= SHRINKAGE
            if length < stride.shortest:
                return Branch(problem, scale, found, NO_STEP)
            continue
        if _shaken(problem, here, there):
            return Branch(problem, scale, found, WIGGLES)
        bound = np.clip(there.value, low, high)
        left = there.value != bound
        if left:
            if abs(bound - here.value) <= stride.shortest:  # it begins on a bound
                return Branch(problem, scale, found, OUTSIDE)
            there = _at_bound(problem, scale, here, there, bound, stride)
            if there is None:
                length *= SHRINKAGE
                continue
        if there.turns < problem.period:
            return Branch(problem, scale, found, SHORTER, there)
        found.append(there)
        if problem.ends and not np.all(there.monitors > 0):
            happened = [
                name for name, at in zip(problem.watched, there.monitors, strict=True) if not at > 0
            ]
            return Branch(problem, scale, found, HAPPENED.format(", ".join(happened)))
        if left:
            return Branch(problem, scale, found, OUTSIDE)
        back = found[0].place - there.place
        near = np.sqrt(inner(problem, back, back)) < length
        if near and len(found) > CLOSED and inner(problem, found[0].tangent, there.tangent) > 0:
            if not inner(problem, back, there.tangent) > 0:  # past it, where events are known
                found.pop()
            found.append(found[0])  # an event may lie on what is left
            return Branch(problem, scale, found, LOOP)
        here = there
        length = min(length * (GROWTH if here.corrections <= EASY else 1.0), stride.longest)
    return Branch(problem, scale, found, ENOUGH)


def corrected(
    problem: AbstractPeriodicProblem,
    shape: tuple[int, ...],
    scale: float,
    guess: Float[np.ndarray, " n"],
    across: Float[np.ndarray, " n"],
) -> Point | None:
    """Return the point of the branch in the plane across a direction; None if there is none."""
    # In NumPy: what shooting does with them between its programs needs no program more.
    unit = np.asarray(scale, float)
    equations = Bordered(problem=problem, guess=guess, across=across, scale=unit, shape=shape)
    root = problem.find_zero(equations)
    if root is None:
        return None
    u, value = root.unknowns[:-1].reshape(shape), float(root.unknowns[-1])
    missed = problem.left_out(jnp.asarray(u), jnp.asarray(scale * value))
    right = np.stack([np.eye(guess.size)[-1], -np.append(np.ravel(missed), 0.0)], axis=1)
    try:
        onward, off = np.linalg.solve(root.jacobian, right).T
    except np.linalg.LinAlgError:
        return None
    if not np.isfinite(onward).all():
        return None
    return point_of(problem, shape, scale, root, onward, off)


def point_of(
    problem: AbstractPeriodicProblem,
    shape: tuple[int, ...],
    scale: float,
    root: Zero,
    onward: Float[np.ndarray, " n"],
    off: Float[np.ndarray, " n"],
) -> Point | None:
    """Return a point from its place, the branch's direction there and its shift.

    None if its multipliers are not known.
    """
    onward = onward / np.sqrt(inner(problem, onward, onward))
    u, value = root.unknowns[:-1].reshape(shape), float(root.unknowns[-1])
    orbit = jnp.asarray(u), jnp.asarray(scale * value), root.seen
    watched = problem.monitors(*orbit) if problem.watched else np.zeros(0)
    matrix, turns = problem.monodromy(*orbit), problem.turns(u, root.seen)
    if not np.isfinite(matrix).all():
        return None
    values = np.linalg.eigvals(matrix).astype(complex)
    return Point(u, value, onward, matrix, values, watched, turns, root.steps, root.seen, off)


def _reached(
    problem: AbstractPeriodicProblem, here: Point, there: Point, length: float, stride: Stride
) -> bool:
    """Whether a step has stayed on its branch."""
    off = there.place - here.place - length * here.tangent
    astray = np.sqrt(inner(problem, off, off))
    turned = inner(problem, there.tangent, here.tangent)
    return bool(turned > LEAST_COSINE and astray <= stride.straight * length)


def _at_bound(
    problem: AbstractPeriodicProblem,
    scale: float,
    here: Point,
    there: Point,
    bound: float,
    stride: Stride,
) -> Point | None:
    """Return the point between two at a value of the parameter, in its scale; None if lost."""
    step = there.place - here.place
    share = (bound - here.value) / step[-1]
    across = np.copysign(np.eye(step.size)[-1], step[-1])
    point = corrected(problem, here.u.shape, scale, here.place + share * step, across)
    length = share * np.sqrt(inner(problem, step, step))
    return point if point and _reached(problem, here, point, length, stride) else None


def _shaken(problem: AbstractPeriodicProblem, here: Point, there: Point) -> bool:
    """Whether the shift to the exact branch changes along a step about as much as the branch."""
    moved, step = there.off - here.off, there.place - here.place
    return inner(problem, moved, moved) > MOST_SHAKEN**2 * inner(problem, step, step)


def _leapt(here: Point, there: Point) -> bool:
    """Whether a multiplier has moved so far that it may have met the unit circle twice."""
    away = np.abs(here.multipliers[:, None] - there.multipliers)
    matched = linear_sum_assignment(away)
    room = np.maximum(np.abs(np.abs(here.multipliers[matched[0]]) - 1), MOST_MOVED)
    return bool(np.any(away[matched] > room))


def inner(problem: AbstractPeriodicProblem, one: np.ndarray, other: np.ndarray) -> float:
    """Return the inner product whose norm measures steps."""
    return float(problem.weight(one.size - 1) * (one[:-1] @ other[:-1]) + one[-1] * other[-1])

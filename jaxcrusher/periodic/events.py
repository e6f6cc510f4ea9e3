"""Events on branches of orbits: where a test function of a point changes its sign.

The test functions do not need the eigenvalues one by one (Kuznetsov, Elements of Applied
Bifurcation Theory, 2004, chapter 10). With M the monodromy matrix and mu its eigenvalues:

| event | what vanishes |
|---|---|
| fold | the parameter's part of the branch's direction |
| branch point | det(M - I), where there is no fold |
| period doubling | det(M + I) |
| Neimark-Sacker | the product of 1 - mu_i mu_j over pairs: det(C - I), C the second compound of M |
| contact lost | the least penetration of a joint |

Where a test function has the same sign at three points, and comes nearest to zero at the middle
one, it may vanish twice in between. So its extremum is searched for. At a branch point the
equations of the orbit are singular: `jaxcrusher.periodic.branch_point` has others, which locate it.

Where an event lies depends on how well the orbits there are resolved. Therefore it is located again
with more nodes, which also tells its error.
"""

import itertools
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float
from scipy.interpolate import CubicHermiteSpline
from scipy.optimize import brentq, minimize_scalar, newton

from jaxcrusher.periodic.branch import Branch, Point, corrected, follow, inner
from jaxcrusher.periodic.branch_point import branch_point
from jaxcrusher.periodic.multipliers import difference
from jaxcrusher.periodic.problem import AbstractPeriodicProblem, OfMatrix
from jaxcrusher.periodic.trigonometric import resample

FOLD, CROSSING, DOUBLING, PAIR = "fold", "branch point", "period doubling", "Neimark-Sacker"
# At a branch point the parameter's part of the branch's direction is larger; where it is not, few
# nodes let the multipliers tell of a fold some way off it.
STEEP = 0.05
# A pair that meets the unit circle off the real axis lies so near it where it is located.
ON_CIRCLE = 1e-4
# Points followed back to where a branch of fewer turns was doubled.
BACK = 12
# A test function that is no larger vanishes everywhere, as that of pairs does without damping; of a
# determinant the least singular value tells, since many multipliers near the circle make it small.
NOISE = 1e-9
# Of three points with one sign: the extremum of a parabola through them, as a share of the outer
# values, above which there is no zero; and how well the extremum is found, as a share of a step.
CLEAR, EXTREMUM = 0.5, 1e-3

# An event is located with more and more nodes until it moves by no more than this, in the scale of
# the parameter; and steps of the secant method that locates it: the first one, and the longest way
# along the branch.
SHARP, FIRST, FURTHEST = 1e-8, 1e-5, 0.5
# Events of one kind that are no further apart, in the norm of their problem, are one event.
SAME = 1e-6
# What steps leave of a monodromy matrix, as a share of its largest entry.
STEPS_LEAVE = 1e-6

# A number of a point whose sign matters.
Test = Callable[[Point], float]


@dataclass(frozen=True)
class Special:
    """Where a branch changes; without a point if the change is seen but not located.

    `kind` is `FOLD`, `CROSSING`, `DOUBLING`, `PAIR` or what the problem watches. A kind after
    "unresolved" is not confirmed by finer equations or by the multipliers.
    """

    kind: str
    parameter: float
    point: Point | None
    error: float = np.nan  # of the parameter, estimated


def special_points(branch: Branch) -> list[Special]:
    """Return the events along a branch, in its order.

    What vanishes twice between two points is found by its extremum, if that stands out between the
    points around it.
    """
    problem, found = branch.problem, []
    sizes = {
        kind: lambda point, of=of: _least(np.asarray(of(jnp.asarray(point.monodromy))))
        for kind, of in SINGULAR_OF.items()
    }
    for kind, test in tests(branch).items():
        folds = {int(where) for where, _ in found if kind == CROSSING}
        for where, point in zeros(branch, test, without=folds, size=sizes.get(kind)):
            if kind == CROSSING:
                i = int(where)
                exact = _Piece(branch, *branch.points[i : i + 2]).crossing(where - i)
                point = point if exact is None else exact
            turns = problem.period if point is None else point.turns
            if kind == CROSSING and point is not None and abs(point.tangent[-1]) < STEEP:
                continue
            if kind == PAIR and point is not None and not leaves_circle(point.multipliers):
                continue
            # The branch meets its parent orbit at a period doubling, and goes on a turn later.
            named = DOUBLING if turns < problem.period else kind
            value = np.nan if point is None else branch.scale * point.value
            found.append((where, Special(named, value, point)))
    return [special for _, special in sorted(found, key=lambda one: one[0])]


def tests(branch: Branch) -> dict[str, Test]:
    """Return what changes its sign where a branch changes, by the kind of event."""
    watched = branch.problem.watched
    joints = {kind: lambda point, i=i: float(point.monitors[i]) for i, kind in enumerate(watched)}
    return {
        FOLD: lambda point: float(point.tangent[-1]),
        **{
            kind: lambda point, of=of: float(of(jnp.asarray(point.monodromy)))
            for kind, of in ZERO_OF.items()
        },
        **joints,
    }


def _least(matrix: np.ndarray) -> float:
    """Return the least singular value; one state alone has no pairs, and none."""
    return float(np.min(np.linalg.svd(matrix, compute_uv=False), initial=np.inf))


def _shifted(sign: float, matrix: Array) -> Array:
    return matrix + sign * np.eye(len(matrix))


def _of_pairs(matrix: Array) -> Array:
    """Return C - I, where C holds all minors of two rows and two columns.

    Its eigenvalues are the products of two different ones of the matrix.
    """
    one, other = np.triu_indices(len(matrix), 1)
    at = lambda rows, columns: matrix[rows[:, None], columns[None, :]]  # noqa: E731
    minors = at(one, one) * at(other, other) - at(one, other) * at(other, one)
    return _shifted(-1.0, minors)


# What is singular at an event, and its determinant.
SINGULAR_OF: dict[str, Callable[[Array], Array]] = {
    CROSSING: jax.jit(lambda matrix: _shifted(-1.0, matrix)),
    DOUBLING: jax.jit(lambda matrix: _shifted(1.0, matrix)),
    PAIR: jax.jit(_of_pairs),
}
ZERO_OF: dict[str, OfMatrix] = {
    kind: jax.jit(lambda matrix, of=of: jnp.linalg.det(of(matrix)))
    for kind, of in SINGULAR_OF.items()
}


def leaves_circle(values: Complex[np.ndarray, " n"]) -> bool:
    """Whether a complex pair lies on the unit circle; a real pair mu and 1 / mu does not count."""
    off_axis = values[np.abs(np.imag(values)) > ON_CIRCLE]
    return bool(np.any(np.abs(np.abs(off_axis) - 1) < ON_CIRCLE))


def zeros(
    branch: Branch, test: Test, without: Collection[int] = (), size: Test | None = None
) -> Iterator[tuple[float, Point | None]]:
    """Yield places along a branch, counted in points, where a test function vanishes.

    With each place comes its point, None where it is not located. Steps in `without` are left out.
    A point is a zero if its `size` is noise; None is the size of the test function.
    """
    points, values = branch.points, np.array([test(point) for point in branch.points])
    found: dict[int, list[tuple[float, Point | None]]] = {}
    sizes = np.abs(values) if size is None else np.array([size(point) for point in points])
    values = np.where(sizes <= NOISE, 0.0, values)
    for here, there in itertools.pairwise(np.flatnonzero(values).tolist()):
        i = (here + there) // 2
        if not values[here] * values[there] < 0 or i in without:
            continue
        if there > here + 1:  # a point of the branch is the zero
            found[i] = [(0.0, points[i])]
            continue
        piece = _Piece(branch, points[i], points[i + 1])
        found[i] = [_located(piece, test, 0.0, 1.0)]
    for i in range(1, len(points) - 1):
        if not _may_vanish_twice(points[i - 1 : i + 2], values[i - 1 : i + 2]):
            continue
        for k in {i - 1, i} - set(without):
            piece = _Piece(branch, points[k], points[k + 1])
            past = _past(piece, test)
            if past is not None:
                found[k] = [_located(piece, test, *ends) for ends in ((0.0, past), (past, 1.0))]
                break
    for i, places in sorted(found.items()):
        yield from ((i + share, point) for share, point in places)


def _may_vanish_twice(points: list[Point], values: Float[np.ndarray, "3"]) -> bool:
    """Whether the middle one of three values of one sign is the least, and zero may be near."""
    size = np.abs(values)
    if (not (values > 0).all() and not (values < 0).all()) or size[1] > min(size[0], size[2]):
        return False
    steps = [np.linalg.norm(b.place - a.place) for a, b in itertools.pairwise(points)]
    parabola = np.polyfit(np.array([-steps[0], 0.0, steps[1]]), size, 2)
    least = np.polyval(parabola, -parabola[1] / (2 * parabola[0])) if parabola[0] > 0 else size[1]
    return bool(least < CLEAR * min(size[0], size[2]))


class _Lost(Exception):
    """Newton's method leads from between two points to no orbit."""


class _Piece:
    """The branch between two of its points, on planes across the line that joins them."""

    def __init__(self, branch: Branch, here: Point, there: Point) -> None:
        problem, chord = branch.problem, there.place - here.place
        size = np.sqrt(inner(problem, chord, chord))
        self._branch, self._across, self._size = branch, chord / size, size
        # A cubic through both, along the branch at both ends, is near it in between.
        ends = [
            size * one.tangent / inner(problem, one.tangent, self._across) for one in (here, there)
        ]
        self._curve = CubicHermiteSpline([0, 1], [here.place, there.place], ends)
        self._known = {0.0: here, 1.0: there}
        self.tolerance = problem.stride.located  # a share, to which a place is located

    def at(self, share: float) -> Point:
        """Return the point at a share of the way."""
        if share not in self._known:
            branch, shape = self._branch, self._known[0.0].u.shape
            place = self._curve(share), self._across
            found = corrected(branch.problem, shape, branch.scale, *place)
            if found is None:
                raise _Lost
            self._known[share] = found
        return self._known[share]

    def crossing(self, share: float) -> Point | None:
        """Return the branch point near a share of the way, at most the piece's length away."""
        problem, shape = self._branch.problem, self._known[0.0].u.shape
        place = self._curve(share), self._across
        return branch_point(problem, shape, self._branch.scale, *place, self._size)


def _located(piece: _Piece, test: Test, low: float, high: float) -> tuple[float, Point | None]:
    """Return where a test function vanishes that has different signs at two places."""
    try:
        root = brentq(lambda share: test(piece.at(share)), low, high, xtol=piece.tolerance)
        assert isinstance(root, float)
        return root, piece.at(root)
    except _Lost:
        return (low + high) / 2, None


class _Past(Exception):
    """A place past a zero is found, which is the argument."""


def _past(piece: _Piece, test: Test) -> float | None:
    """Return a place where a test function has not the sign of the ends; None if there is none."""
    sign = np.sign(test(piece.at(0.0)))

    def size(share: float) -> float:
        value = sign * test(piece.at(float(share)))
        if value < 0:
            raise _Past(float(share))
        return value

    try:
        minimize_scalar(size, bounds=(0.0, 1.0), method="bounded", options={"xatol": EXTREMUM})
    except _Past as found:
        return found.args[0]
    except _Lost:
        pass
    return None


def sharp_points(branch: Branch) -> list[Special]:
    """Return the events along a branch by finer equations.

    A branch point that moves to a fold is left out: with few nodes the multipliers show a fold some
    way off it. Events of one kind that move to the same orbit are one event.
    """
    found: list[Special] = []
    steep = lambda point: point is None or abs(point.tangent[-1]) >= STEEP  # noqa: E731
    for special in special_points(branch):
        one = sharpened(branch, special)
        again = any(_is_same(branch, one, other) for other in found)
        if not again and (one.kind != CROSSING or steep(one.point)):
            found.append(one)
    return found


def _is_same(branch: Branch, one: Special, other: Special) -> bool:
    """Whether two events are of one kind, and no further apart than their errors or `SAME`."""
    if one.kind != other.kind or one.point is None or other.point is None:
        return False
    here, there = (np.append(as_on(branch, at.u), at.value) for at in (one.point, other.point))
    apart, most = here - there, (one.error + other.error) / branch.scale
    return inner(branch.problem, apart, apart) <= max(most if np.isfinite(most) else 0.0, SAME) ** 2


def sharpened(branch: Branch, special: Special) -> Special:
    """Return an event located by finer equations, as long as that moves it, with its error.

    The error is the last move or, without finer equations, the move by coarser ones.
    """
    problem, point = branch.problem, special.point
    if point is None:
        return special
    # The point at which a branch meets the orbit of fewer turns is one of its folds.
    met = special.kind == DOUBLING and point.turns < problem.period
    kind, before, error = FOLD if met else special.kind, point, np.inf
    relocated = partial(_relocated, branch, kind)
    try:
        while error > SHARP * branch.scale and problem.resolved(point.u, True) is not None:
            before, point = point, relocated(point, finer=True)
            error = branch.scale * abs(point.value - before.value)
        if before is point:
            before = relocated(point, finer=False)
            error = branch.scale * abs(point.value - before.value)
    except _Lost:
        error = np.inf
    # A multiplier of a matrix that differs by no more than its error is as at the event.
    value = {FOLD: 1.0, CROSSING: 1.0, DOUBLING: 1.0 if met else -1.0}.get(special.kind)
    good = np.isfinite(error)
    if good and value is not None:
        matrix = point.monodromy
        allowed = STEPS_LEAVE + float(
            difference(jnp.asarray(before.monodromy), jnp.asarray(matrix))
        )
        nearest = np.linalg.svd(matrix - value * np.eye(len(matrix)))[1][-1]
        good = nearest <= allowed * max(np.max(np.abs(matrix)), 1.0)
    kind = special.kind if good else f"unresolved {special.kind}"
    return Special(kind, branch.scale * point.value, point, error)


def _relocated(branch: Branch, kind: str, point: Point, *, finer: bool) -> Point:
    """Return where an event of a kind is near a point, by finer or coarser equations."""
    problem, ways = branch.problem, (point.u, point.tangent[:-1].reshape(point.u.shape))
    both = [problem.resolved(one, finer) for one in ways]
    if both[0] is None or both[1] is None:
        raise _Lost
    (other, u), (_, way) = both[0], both[1]
    place, along = np.append(u, point.value), np.append(way, point.tangent[-1])
    if kind == CROSSING:
        crossing = branch_point(other, u.shape, branch.scale, place, along, FURTHEST)
        if crossing is not None:
            return crossing
    found, test = {}, tests(branch)[kind]

    def value(share: float) -> float:
        if not abs(share) < FURTHEST:
            raise _Lost
        at = corrected(other, u.shape, branch.scale, place + share * along, along)
        if at is None:
            raise _Lost
        found[share] = at
        return test(at)

    try:
        root = newton(value, 0.0, x1=FIRST, tol=100 * problem.stride.located)
    except RuntimeError as none:
        raise _Lost from none
    value(root)
    return found[root]


def as_on(branch: Branch, u: np.ndarray) -> np.ndarray:
    """Return unknowns at as many nodes as the points of a branch have."""
    shape = branch.points[0].u.shape
    return u if u.shape == shape else np.asarray(resample(jnp.asarray(u), shape[0]))


def other_branch(
    branch: Branch, special: Special
) -> tuple[AbstractPeriodicProblem, np.ndarray, np.ndarray]:
    """Return what `follow` needs for the branch that leaves another one at a special point.

    These are its problem, the unknowns there, and the direction in which it leaves. At a period
    doubling the branch has twice the turns, and its equations are singular in this direction.
    """
    point = special.point
    turns = point.turns * (2 if special.kind == DOUBLING else 1)
    problem, u = branch.problem.over(turns, as_on(branch, point.u))
    if special.kind == CROSSING and point.crossing is not None:
        way = point.crossing[:-1].reshape(point.u.shape)
        return problem, u, np.append(as_on(branch, way), point.crossing[-1])
    matrix = problem.linearised(jnp.asarray(u), jnp.asarray(branch.scale * point.value)).by_unknowns
    return problem, u, np.append(np.linalg.svd(matrix)[2][-1], 0.0)


def origin(branch: Branch, parent: Point) -> Special:
    """Return the doubling that a branch came from; `parent`, of fewer turns, is followed to it.

    It lies back where the branch came from, or ahead if two turns became alike before it.
    """
    shorter, u = branch.problem.over(parent.turns, parent.u)
    back = parent.value < branch.points[-1].value
    for upwards in (back, not back):
        way = follow(
            shorter,
            u,
            branch.scale * parent.value,
            scale=branch.scale,
            bounds=(-np.inf, np.inf),
            upwards=upwards,
            points=BACK,
        )
        for special in special_points(way):
            if special.kind == DOUBLING:
                return sharpened(way, special)
    return Special(DOUBLING, np.nan, None)

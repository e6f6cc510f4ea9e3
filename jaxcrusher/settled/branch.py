"""Branches of periodic solutions over one parameter, followed round their folds.

Pseudo-arclength continuation (Keller 1977; Doedel's AUTO): the parameter is one unknown more, and
a step has its length along the branch, so that a fold is a point like any other. Where a branch
turns back there is more than one motion for one parameter.
"""

from collections.abc import Callable
from dataclasses import dataclass

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Bool, Complex, Float, Int, Scalar
from scipy.optimize import brentq

from jaxcrusher.settled.collocation import TOLERANCE, System
from jaxcrusher.settled.multipliers import multipliers
from jaxcrusher.settled.newton import Root, newton

# The system at a value of the parameter; of solutions, what must stay > 0 (least penetration).
Family = Callable[[Scalar], System]
Monitor = Callable[[Float[Array, "nodes dims"]], Scalar]

# Newton's steps of a correction: more, and the step was too long. After so many it may grow.
MOST_CORRECTIONS, EASY = 8, 4
GROWTH, SHRINKAGE = 1.4, 0.5
# A longer turn of the tangent in a step than this cosine may be a hop to another branch.
LEAST_COSINE = 0.9
# Of the first step: a branch that wants shorter ones ends.
SHORTEST = 1e-6
# A pair that meets the unit circle off the real axis lies so near it where it is located.
ON_CIRCLE = 1e-4


class Branch(eqx.Module):
    """Solutions along a branch; NaN from `count` on."""

    count: Int[Array, ""]
    parameter: Float[Array, " points"]
    x: Float[Array, "points nodes dims"]
    tangent: Float[Array, " points"]  # of the parameter along the branch: 0 at a fold
    multipliers: Complex[Array, "points twodims"]
    monitor: Float[Array, " points"]
    result: Int[Array, ""]  # an index of `ENDS`


ENDS = (
    "The buffer is full.",
    "The parameter has left its bounds.",
    "What is monitored has become negative.",
    "No step is short enough for Newton's method.",
)


@dataclass(frozen=True)
class Special:
    """Where a branch changes: "fold", "period doubling", "Neimark-Sacker" or "monitor"."""

    kind: str
    parameter: float
    x: Float[np.ndarray, "nodes dims"]
    multipliers: Complex[np.ndarray, " twodims"]


class _Place(eqx.Module):
    """A point of a branch, the parameter in its scale, and the branch's direction there."""

    x: Array
    value: Scalar
    along_x: Array
    along: Scalar


class _State(eqx.Module):
    place: _Place
    step: Scalar
    branch: Branch
    tried: Int[Array, ""]
    done: Bool[Array, ""]


def _nothing(x: Float[Array, "nodes dims"]) -> Scalar:
    """A monitor that never ends a branch."""
    return jnp.ones(())


def follow(
    family: Family,
    x: Float[Array, "nodes dims"],
    start: Scalar,
    *,
    scale: float,
    bounds: tuple[float, float],
    step: float,
    longest: float,
    points: int = 200,
    monitor: Monitor | None = None,
) -> Branch:
    """The branch through the solution `x` at the parameter `start`.

    **Arguments:**

    - `family`: the system at a value of the parameter.
    - `x`: a solution at `start`, or near one. `start`, `bounds`: in the parameter's unit.
    - `scale`: what a change of the parameter is to be small against, as x is of order one.
    - `step`: the first, as a length in the root mean square of x and the scaled parameter; its
      sign is the direction in which the parameter sets out. `longest`: of all.
    - `points`: of the buffer: the branch ends when it is full.
    - `monitor`: of x; the branch ends after the first point where it is not > 0.

    **Returns:** a `Branch`. Pure JAX: branches of several designs run under `jax.vmap` and
    `jax.lax.map`. To be differentiated neither through nor by.
    """
    # As arrays, so that one program follows to either side and to any bounds.
    numbers = [jnp.asarray(n, float) for n in (start, scale, *bounds, step, longest)]
    return _follow(family, x, numbers, points, monitor)


@eqx.filter_jit
def _follow(
    family: Family,
    x: Float[Array, "nodes dims"],
    numbers: list[Scalar],
    points: int,
    monitor: Monitor | None,
) -> Branch:
    start, scale, low, high, step, longest = numbers
    watch = _nothing if monitor is None else monitor
    begin = _Place(x, start / scale, jnp.zeros_like(x), jnp.sign(step))
    shape, dims = (points, *x.shape), x.shape[1]
    empty = Branch(
        jnp.array(0),
        jnp.full(points, jnp.nan),
        jnp.full(shape, jnp.nan),
        jnp.full(points, jnp.nan),
        jnp.full((points, 2 * dims), jnp.nan, complex),
        jnp.full(points, jnp.nan),
        jnp.array(0),
    )

    # The start is put right by a step of no length, so that all is compiled once.
    def advance(state: _State) -> _State:
        first = state.branch.count == 0
        root = _correct(family, scale, state.place, jnp.where(first, 0.0, state.step))
        place, values = _arrive(family, scale, state.place, root)
        cosine = _inner(place, state.place)
        good = root.success & (first | (cosine > LEAST_COSINE))
        watched = watch(place.x)
        kept = _kept(state.branch, place, scale, values, watched)
        branch = jax.tree.map(lambda new, old: jnp.where(good, new, old), kept, state.branch)
        parameter = scale * place.value
        onward = good & ~first
        outside = onward & ((parameter < low) | (parameter > high))
        lost = onward & ~(watched > 0)
        full = branch.count >= points
        grown = jnp.where(root.steps <= EASY, GROWTH, 1.0)
        length = jnp.clip(state.step * jnp.where(good, grown, SHRINKAGE), None, longest)
        length = jnp.where(first, state.step, length)
        stuck = (length < SHORTEST * jnp.abs(step)) | (first & ~good)
        ends = [jnp.array(i) for i in (1, 2, 0, 3)]
        result = jnp.select([outside, lost, full, stuck], ends, branch.result)
        branch = eqx.tree_at(lambda b: b.result, branch, result)
        place = jax.tree.map(lambda new, old: jnp.where(good, new, old), place, state.place)
        done = outside | lost | full | stuck
        return _State(place, length, branch, state.tried + 1, done)

    begun = _State(begin, jnp.abs(step), empty, jnp.array(0), jnp.array(False))
    return jax.lax.while_loop(lambda state: ~state.done, advance, begun).branch


def special_points(
    family: Family,
    branch: Branch,
    *,
    scale: float,
    monitor: Monitor | None = None,
) -> list[Special]:
    """Folds, period doublings, Neimark-Sacker points and zeros of the monitor (concrete only).

    Each lies between two points of the branch that a test function has different signs at, and is
    located to rounding along the branch. What vanishes twice between two points is not seen.
    """
    count = int(branch.count)
    found = []
    for i in range(count - 1):
        here, there = (test_functions(*_seen(branch, k)) for k in (i, i + 1))
        for kind in here:
            if not here[kind] * there[kind] < 0:
                continue
            special = _locate(family, branch, i, kind, scale, monitor)
            if special is not None:
                found.append(special)
    return found


def _seen(branch: Branch, i: int) -> tuple[float, np.ndarray, float]:
    return float(branch.tangent[i]), np.asarray(branch.multipliers[i]), float(branch.monitor[i])


def test_functions(
    tangent: float, values: Complex[np.ndarray, " n"], watched: float
) -> dict[str, float]:
    """What changes its sign where a branch changes; no eigenvalue of these has to be told apart."""
    pairs = [1 - a * b for i, a in enumerate(values) for b in values[i + 1 :]]
    return {
        "fold": tangent,
        "period doubling": float(np.prod(1 + values).real),
        # Of all products of two multipliers: the determinant of the bialternate product.
        "Neimark-Sacker": float(np.prod(pairs).real) if len(values) > 2 else 1.0,
        "monitor": watched,
    }


def leaves_circle(values: Complex[np.ndarray, " n"]) -> bool:
    """Whether a pair lies on the unit circle, off the real axis: two real ones may be 1 / each."""
    off_axis = values[np.abs(np.imag(values)) > ON_CIRCLE]
    return bool(np.any(np.abs(np.abs(off_axis) - 1) < ON_CIRCLE))


def _locate(
    family: Family, branch: Branch, i: int, kind: str, scale: float, monitor: Monitor | None
) -> Special | None:
    watch = _nothing if monitor is None else monitor
    values = branch.parameter / scale
    # Along the line to the next point; the direction of the branch itself is not kept.
    change = branch.x[i + 1] - branch.x[i], values[i + 1] - values[i]
    size = jnp.sqrt(jnp.mean(change[0] ** 2) + change[1] ** 2)
    begin = _Place(branch.x[i], values[i], change[0] / size, change[1] / size)
    last: dict[str, tuple] = {}

    def test(length: float) -> float:
        numbers = jnp.asarray(scale), begin, jnp.asarray(length)
        place, found, watched = _at(family, *numbers, watch)
        last["seen"] = place, np.asarray(found), float(watched)
        return test_functions(float(place.along), np.asarray(found), float(watched))[kind]

    low, high = test(0.0), test(float(size))
    if not low * high < 0:
        return None
    # To a share of 1e-12 of the step along the branch.
    where = brentq(test, 0.0, float(size), xtol=1e-12 * float(size))
    assert isinstance(where, float)
    test(where)
    place, found, _ = last["seen"]
    if kind == "Neimark-Sacker" and not leaves_circle(found):
        return None
    return Special(kind, scale * float(place.value), np.asarray(place.x), found)


@eqx.filter_jit
def _at(family: Family, scale: Scalar, begin: _Place, length: Scalar, watch: Monitor):
    """The point so far along the branch."""
    place, values = _arrive(family, scale, begin, _correct(family, scale, begin, length))
    return place, values, watch(place.x)


def _inner(one: _Place, other: _Place) -> Scalar:
    return jnp.mean(one.along_x * other.along_x) + one.along * other.along


def _equations(
    family: Family, scale: Scalar, place: _Place, length: ArrayLike = 0.0
) -> tuple[Callable[[Array], Array], Callable[[Array], tuple[Array, Array]]]:
    """The system's residual and, last, the way along the branch less `length`; and linearised."""
    shape, size = place.x.shape, place.x.size

    def split(both: Array) -> tuple[Array, Scalar]:
        return both[:-1].reshape(shape), both[-1]

    def joined(left: Array, x: Array, value: Scalar) -> Array:
        ahead = jnp.mean(place.along_x * (x - place.x)) + place.along * (value - place.value)
        return jnp.append(left.ravel(), ahead - length)

    def residual(both: Array) -> Array:
        x, value = split(both)
        return joined(family(scale * value).residual(x), x, value)

    def linearised(both: Array) -> tuple[Array, Array]:
        x, value = split(both)
        left, matrix = family(scale * value).linearised(x)
        # Of one number: forward costs a residual more.
        _, column = jax.jvp(lambda v: family(scale * v).residual(x), (value,), (jnp.ones(()),))
        top = jnp.concatenate([matrix.reshape(size, size), column.reshape(size, 1)], axis=1)
        bottom = jnp.append(place.along_x.ravel() / size, place.along)
        return joined(left, x, value), jnp.concatenate([top, bottom[None]])

    return residual, linearised


def _correct(family: Family, scale: Scalar, place: _Place, length: Scalar) -> Root:
    """The solution a length further on."""
    residual, linearised = _equations(family, scale, place, length)
    ahead = place.x + length * place.along_x, place.value + length * place.along
    guess = jnp.append(ahead[0].ravel(), ahead[1])
    return newton(residual, linearised, guess, TOLERANCE, MOST_CORRECTIONS)


def _arrive(family: Family, scale: Scalar, before: _Place, root: Root) -> tuple[_Place, Array]:
    """The point that a correction found, its direction, and its multipliers."""
    x, value = root.point[:-1].reshape(before.x.shape), root.point[-1]
    _, linearised = _equations(family, scale, before)
    onward = jnp.zeros_like(root.point).at[-1].set(1.0)
    direction = jnp.linalg.solve(linearised(root.point)[1], onward)
    along_x, along = direction[:-1].reshape(x.shape), direction[-1]
    size = jnp.sqrt(jnp.mean(along_x**2) + along**2)
    place = _Place(x, value, along_x / size, along / size)
    return place, multipliers(family(scale * value), x).values


def _kept(branch: Branch, place: _Place, scale: Scalar, values: Array, watched: Scalar) -> Branch:
    """The branch with a point more."""
    i = branch.count
    return Branch(
        i + 1,
        branch.parameter.at[i].set(scale * place.value),
        branch.x.at[i].set(place.x),
        branch.tangent.at[i].set(place.along),
        branch.multipliers.at[i].set(values),
        branch.monitor.at[i].set(watched),
        branch.result,
    )

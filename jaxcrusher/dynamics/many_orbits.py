"""Periodic orbits of many designs: from the pin at rest, by a search each, and from neighbours.

Designs are given as stacked cases, and a function makes the scene of one. Newton's method from the
pin at rest is one program for all of them, which takes a millisecond a design. Where it leads to no
orbit that is surely stable, the orbit is searched for as for a single design
(`jaxcrusher.dynamics.searches`). A design without one is then tried from stable orbits of
neighbours.
"""

import functools
import itertools
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int, PyTree, Scalar

from jaxcrusher.basics.record import words
from jaxcrusher.batch.engines import Engine, run_all, without_lanes
from jaxcrusher.dynamics.searches import SEARCHES, together
from jaxcrusher.files.journal import Journal
from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.orbits.forced import unknowns
from jaxcrusher.orbits.periodic_orbit import orbit_by, periodic_orbit
from jaxcrusher.orbits.result import RESULTS, WAYS, PeriodicOrbit, missing
from jaxcrusher.orbits.search import SURELY_CLOSED, Attempt, OrbitSearch, is_unresolved
from jaxcrusher.orbits.transient import Lone
from jaxcrusher.periodic.collocation_problem import MOST_NODES
from jaxcrusher.periodic.trigonometric import resample

if TYPE_CHECKING:
    import distributed

Rows = dict[str, np.ndarray]
# Numbers that are free, and all others: of one design, and of stacked ones.
DesignCase = tuple[Float[Array, " n"], PyTree]
Cases = tuple[Float[np.ndarray, "cases n"], PyTree]
# Attributes of an orbit that a row holds besides its statistics.
SEEN = (
    "period",
    "error",
    "least_penetration",
    "largest_multiplier",
    "multipliers_error",
    "settling_turns",
    "success",
    "stable",
    "undecided",
)
# Designs solved between two looks at what their neighbours are.
CHUNK = 16
# What a row says of the motion from rest where that has no stable orbit.
MOTION = ("motion", "run_rms", "run_rms_error")


class Sought(eqx.Module):
    """The scene of a case, and the numbers of its orbit differentiated by the free numbers.

    All are functions that stand in a module, or `equinox.Partial`s of these: a program is compiled
    once for all cases, and solves for each orbit once.
    """

    scene: Callable[[Array, PyTree], Scene]
    numbers: tuple[Callable[[PeriodicOrbit, Scene, Array, PyTree], Scalar], ...]
    period: int | None = eqx.field(static=True)  # as in `jaxcrusher.periodic_orbit`
    dims: int = eqx.field(static=True)  # of an orbit: two a loose joint, three a frame on supports
    nodes: int | None = eqx.field(static=True, default=None)  # as in `jaxcrusher.periodic_orbit`

    @property
    def points(self) -> int:
        """Return how many points of an orbit are kept."""
        return (self.nodes or MOST_NODES) * (self.period or 1)


def solve_orbits(
    sought: Sought,
    cases: Cases,
    *,
    effort: str | None = None,
    neighbours: Callable[[int], list[int]] | None = None,
    chunk: int = CHUNK,
    engine: Engine | None = None,
    journal: Journal | None = None,
    scheduler: "distributed.Client | None" = None,
    progress: Callable[[int, int], None] | None = None,
) -> Rows:
    """Solve for the orbits of stacked cases, and return their rows in columns.

    **Arguments:**

    - `cases`: free numbers (cases, n), and a tree of all others.
    - `effort`: as in `jaxcrusher.periodic_orbit`; with None there is no search after Newton's
      method from the pin at rest.
    - `neighbours`: gives the cases beside a case, the nearest first. A case without an orbit is
      tried from their stable orbits; None: from no other orbit.
    - `engine`: as in `jaxcrusher.map_chunks`; None takes lanes only for turns of searches.
    - `journal`: of finished chunks.
    - `scheduler`: whose workers compute the chunks; None for this process.
    - `progress`: called with the number of finished and of all cases; during searches, the cases
      with a stable orbit count as finished.

    **Returns:** statistics, `SEEN`, `numbers` (cases, m) and their `slopes` (cases, m, n),
    `inside_model`, multipliers, `eccentricity` (cases, points, dims; NaN for an orbit of another
    period), `failure` and the way by which each was `found` in words; NaN where there is no orbit.
    `MOTION` is the kind of the motion from rest, where it was integrated and led to no stable
    orbit, and its RMS with a standard error.
    """
    count, report = len(cases[0]), progress or (lambda finished, of: None)
    settings = {"skips": True, "journal": journal, "scheduler": scheduler}

    def solve(which: np.ndarray, guesses: np.ndarray, progress: Any = None) -> Rows:
        given, how = (_part(cases, which), guesses), engine or without_lanes()
        program = eqx.Partial(_solve_case, sought=sought)
        return run_all(program, given, chunk, how, progress, whole=chunk, **settings)

    # NaN stands for the pin at rest.
    rows = solve(np.arange(count), np.full((count, sought.points, sought.dims), np.nan), report)
    if effort is not None and len(left := _open(rows)):
        lanes = functools.partial(together, engine=engine)
        if scheduler is None:
            lanes = functools.partial(lanes, tell=lambda: report(count - len(left), count))
        given = (
            _part(cases, left),
            tuple(rows[name][left] for name in ("code", "way", "eccentricity")),
        )
        search = eqx.Partial(_searched, sought=sought, effort=effort)
        for name, column in run_all(search, given, SEARCHES, lanes, **settings).items():
            rows[name][left] = column
    if neighbours is not None:
        from_neighbours(rows, neighbours, solve, chunk, sought.period or 1)
    report(count, count)
    for name, code in (("failure", "code"), ("motion", "from_rest")):
        rows[name] = _in_words(rows.pop(code), RESULTS, RESULTS.successful)
    rows["found"] = _in_words(rows.pop("way"), WAYS, WAYS.rest)
    rows["found"][~rows["success"]] = ""
    return rows


def _part(cases: Cases, which: Int[np.ndarray, " some"]) -> PyTree:
    return jax.tree.map(lambda leaf: np.asarray(leaf)[which], cases)


def _open(rows: Rows) -> Int[np.ndarray, " some"]:
    """Return the cases of which the pin at rest tells no orbit that is surely stable.

    A damping leads to the quietest of several motions.
    """
    closed, damped = rows["closure"] <= SURELY_CLOSED, rows["way"] == _code(WAYS.damping)
    return np.flatnonzero(~rows["stable"] | ~closed | damped)


def from_neighbours(
    rows: Rows,
    neighbours: Callable[[int], list[int]],
    solve: Callable[[np.ndarray, np.ndarray], Rows],
    chunk: int,
    period: int,
) -> None:
    """Solve cases without an orbit from stable orbits of neighbours, until none is new.

    What is known of their motion from rest is kept.
    """
    tried = set[tuple[int, int]]()
    while True:
        left = np.flatnonzero(~rows["success"])
        usable = rows["stable"] & (rows["period"] == period)
        # As many guesses of each as fill a chunk.
        most = max(1, chunk // max(1, len(left)))
        pairs = [
            pair
            for case in left.tolist()
            for pair in [
                (case, near)
                for near in neighbours(case)
                if usable[near] and (case, near) not in tried
            ][:most]
        ]
        if not pairs:
            return
        tried.update(pairs)
        which, near = np.array(pairs).T
        found = solve(which, rows["eccentricity"][near])
        # Of several guesses the first that leads counts.
        into, out = np.unique(np.where(found["success"], which, -1), return_index=True)
        into, out = into[into >= 0], out[into >= 0]
        found["way"] = np.full(len(which), _code(WAYS.neighbour))
        for name in found.keys() - {"from_rest", *MOTION}:
            rows[name][into] = found[name][out]


def _code(entry: PyTree) -> int:
    """Return the number that an entry of an enumeration is kept as."""
    return int(jax.tree.leaves(entry)[0])


def _entry(code: Any, like: PyTree) -> PyTree:
    """Return the entry of an enumeration that has a number; `like` is any of its entries."""
    return jax.tree.unflatten(jax.tree.structure(like), [jnp.asarray(code, jnp.int32)])


def _in_words(codes: np.ndarray, kind: Any, entry: PyTree) -> np.ndarray:
    """Return what the codes of an enumeration stand for; `entry` is any of its entries."""
    known, which = np.unique(codes, return_inverse=True)
    return np.array([words(kind, _entry(code, entry)) for code in known.tolist()], object)[which]


def _solve_case(
    given: tuple[DesignCase, Float[Array, "points dims"]], sought: Sought
) -> dict[str, Array]:
    """Solve one case by nodes, from those of a guess or, where these are NaN, from rest.

    A case of NaN, which only fills a chunk, is skipped.
    """

    @eqx.filter_jit  # traced once; what is jitted in a module cannot be pickled
    def solve(given: tuple[DesignCase, Array]) -> dict[str, Array]:
        case, guess = given
        first = guess if unknowns(sought.scene(*case)) else None
        find = eqx.Partial(periodic_orbit, period=sought.period, nodes=sought.nodes, guess=first)
        return _row(case, sought, find, jax.lax.map)

    like = jax.eval_shape(solve, given)
    nothing = jax.tree.map(lambda leaf: jnp.zeros(leaf.shape, leaf.dtype), like)
    fills = jnp.isnan(jnp.concatenate([leaf.ravel() for leaf in jax.tree.leaves(given[0])])).any()
    return jax.lax.cond(fills, lambda _: nothing, lambda given: solve(given), given)  # hashable


def _searched(
    given: tuple[DesignCase, tuple[Scalar, Scalar, Array]],
    runs: Lone,
    sought: Sought,
    effort: str,
) -> dict[str, Array]:
    """Search for the orbit of one case, of which it is known what nodes from rest came to."""
    case, (code, way, path) = given
    result = _entry(code, RESULTS.successful)

    def first(search: OrbitSearch) -> Attempt:
        if bool(result == RESULTS.successful) or is_unresolved(result):
            return search.by_nodes(path, search.turns).replaced(way=_entry(way, WAYS.rest))
        none = missing(search.still, search.turns, result)
        return Attempt(none, none)

    find = eqx.Partial(orbit_by, runs, period=sought.period, effort=effort, first=first)
    return _row(case, sought, find, _one_by_one)


@eqx.filter_jit
def _made(free: Array, rest: PyTree, sought: Sought) -> Scene:
    """Return the scene of a case, by a program for all of them: known values take 40 ms."""
    return sought.scene(free, rest)


def _one_by_one(function: Callable[[Array], Array], inputs: Array) -> Array:
    """Do as `jax.lax.map`, which compiles a function anew whose values are known."""
    return jnp.stack([function(one) for one in inputs])


def _row(
    case: DesignCase,
    sought: Sought,
    find: Callable[[Scene], PeriodicOrbit],
    each: Callable[[Callable[[Array], Array], Array], Array],
) -> dict[str, Array]:
    """Return the row of one case whose orbit is found so; slopes are mapped over by `each`."""
    free, rest = case

    def solved(free: Array) -> tuple[Float[Array, " numbers"], PeriodicOrbit]:
        made = _made(free, rest, sought)
        orbit = find(made)
        return jnp.stack([one(orbit, made, free, rest) for one in sought.numbers]), orbit

    # One after the other: side by side slopes by nine numbers took a quarter longer to compile.
    if not free.size:
        numbers, orbit = solved(free)
        slopes = jnp.zeros((len(numbers), 0))
    elif free.size <= len(sought.numbers):
        numbers, push, orbit = jax.linearize(solved, free, has_aux=True)
        slopes = each(push, jnp.eye(free.size)).T
    else:
        numbers, pull, orbit = jax.vjp(solved, free, has_aux=True)
        slopes = each(lambda one: pull(one)[0], jnp.eye(len(numbers)))
    row = dict(orbit.values) | {name: jnp.asarray(getattr(orbit, name)) for name in SEEN}
    run, name = orbit.run, orbit.scene.headline
    row |= {
        "numbers": jnp.where(orbit.success, numbers, jnp.nan),
        "slopes": jnp.where(orbit.success, slopes, jnp.nan),
        "inside_model": orbit.validity.inside,
        "closure": orbit.closure,
        "code": jax.tree.leaves(orbit.result)[0],
        "way": jax.tree.leaves(orbit.way)[0],
        "from_rest": jax.tree.leaves(orbit.from_rest or RESULTS.successful)[0],
        "run_rms": jnp.asarray(jnp.nan if run is None else run[name]),
        "run_rms_error": jnp.asarray(jnp.nan if run is None else run.standard_error(name)),
        "eccentricity": jnp.full((sought.points, sought.dims), jnp.nan),
    }
    if orbit.eccentricity is not None:
        parts = {"real": orbit.multipliers.real, "imag": orbit.multipliers.imag}
        row |= {f"multiplier_{part}": values for part, values in parts.items()}
        if orbit.period == (sought.period or 1):
            row["eccentricity"] = resample(orbit.eccentricity, sought.points)
    return row


def beside(shape: tuple[int, ...], ordered: Sequence[bool]) -> Callable[[int], list[int]]:
    """Return a function of a cell of a grid: the next cells along each ordered axis.

    Cells go by their number.
    """

    def near(cell: int) -> list[int]:
        place, found = np.array(np.unravel_index(cell, shape)), []
        for axis, step in itertools.product(np.flatnonzero(ordered), (-1, 1)):
            moved = place + step * (np.arange(len(shape)) == axis)
            if 0 <= moved[axis] < shape[axis]:
                found.append(int(np.ravel_multi_index(tuple(moved), shape)))
        return found

    return near

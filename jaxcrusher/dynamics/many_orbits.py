"""Periodic orbits of many designs: from the pin at rest, from waiting, and from neighbours.

Designs are given as stacked cases, and a function makes the scene of one. What is not found from
the pin at rest, or by a damping that is lowered, is tried from the motion that lanes have
integrated until the transient is averaged out, and with more nodes; then from the orbits of
neighbours. Where the motion that was waited for loses contact, and repeats, it is shot for. The
last ones are waited for in lanes over thousands of turns (`jaxcrusher.dynamics.lane_waits`), and
what has no stable orbit is named.
"""

import itertools
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PyTree, Scalar

from jaxcrusher.basics.record import words
from jaxcrusher.batch.engines import Engine, run_all, without_lanes
from jaxcrusher.dynamics.lane_waits import Cases, LaneWaits
from jaxcrusher.files.journal import Journal
from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.orbits.forced import unknowns
from jaxcrusher.orbits.periodic_orbit import periodic_orbit
from jaxcrusher.orbits.result import RESULTS, WAYS, PeriodicOrbit
from jaxcrusher.orbits.transient import TURNS
from jaxcrusher.periodic.collocation_problem import MOST_NODES
from jaxcrusher.periodic.trigonometric import resample

if TYPE_CHECKING:
    import distributed

Rows = dict[str, np.ndarray]
# Numbers that are free, and all others.
DesignCase = tuple[Float[Array, " n"], PyTree]
# Attributes of an orbit that a row holds besides its statistics.
SEEN = (
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
# Steps along an axis to the furthest neighbour. Where a branch folds back from the next cells, one
# that comes from further away may pass: in a tongue the shape of a motion matters more than how
# near it is.
REACH = 4
# A motion whose section points are no further from their mean, in clearances and m/s, repeats, but
# for a rest of its transient: those of chaotic motions are tenths apart.
SETTLED = 0.02
# The most turns that a design is waited for, and that all of them are from rest in a round: for 64
# designs 1920 turns. Where more are left they have no such motion.
LONGEST_WAIT, MOST_TURNS = 7680, 64 * 1920
# What a row says of a motion that has no stable orbit.
MOTION = ("motion", "run_rms", "run_rms_error")


class Sought(eqx.Module):
    """The scene of a case, and the numbers of its orbit that are differentiated by what is free.

    All are functions that stand in a module, or `equinox.Partial`s of these: a program is compiled
    once for all cases, and solves for each orbit once.
    """

    scene: Callable[[Array, PyTree], Scene]
    numbers: tuple[Callable[[PeriodicOrbit, Scene, Array, PyTree], Scalar], ...]
    period: int = eqx.field(static=True)
    dims: int = eqx.field(static=True)  # of an orbit: two a loose joint, three a frame on supports


def solve_orbits(
    sought: Sought,
    cases: Cases,
    levels: Sequence[int],
    neighbours: Callable[[int], list[int]] | None,
    *,
    sections: Float[np.ndarray, "cases states"] | None = None,
    quick: bool = False,
    chunk: int = CHUNK,
    enough: float = np.inf,
    engine: Engine | None = None,
    journal: Journal | None = None,
    scheduler: "distributed.Client | None" = None,
    progress: Callable[[int, int], None] | None = None,
) -> Rows:
    """Solve for the orbits of stacked cases, and return their rows in columns.

    **Arguments:**

    - `cases`: free numbers (cases, n), and a tree of all others.
    - `levels`: nodes a turn; more of them are for cases that are waited for, or left with an
      `error` above `enough`.
    - `neighbours`: the cases beside one, the nearest first. With None a case that fails from the
      pin at rest is left: it is tried from no other orbit, and not waited for.
    - `sections`: guesses of section points, from which is shot what nodes do not solve; None where
      nothing is known. What is waited for has its own.
    - `quick`: only from the pin at rest, with the first of `levels`. What these leave in doubt is
      undecided.
    - `engine`: as in `jaxcrusher.map_chunks`; None takes lanes only for what is waited for.
    - `journal`: of finished chunks.
    - `scheduler`: whose workers compute the chunks; None for this process.
    - `progress`: called with the number of finished and of all cases; while motions are waited for,
      those with a stable orbit are finished.

    **Returns:** statistics, `SEEN`, `numbers` (cases, m) and their `slopes` (cases, m, n),
    `inside_model`, multipliers, the orbits themselves, `failure` and the way by which each was
    `found` in words; NaN where there is no orbit. With `neighbours`, `MOTION` tells what the motion
    from rest is where there is no stable orbit, and its RMS with a standard error.
    """
    count = len(cases[0])
    points = levels[-1] * sought.period
    solutions = _Solutions(sought, cases, points, chunk, engine, journal, scheduler)
    report = progress or (lambda finished, of: None)
    solutions.fill(np.arange(count), levels[0], alone, report)
    if quick:
        return solutions.told()
    left = solutions.unsolved(np.inf)
    sections = np.full((count, 2 * sought.dims), np.nan) if sections is None else sections.copy()

    def tell() -> None:
        report(count - len(solutions.unstable()), count)

    waits = LaneWaits(sought.scene, cases, engine, journal, tell, scheduler)
    if neighbours is not None and len(left):
        sections[left] = solutions.wait(waits, left)
    for nodes in levels[1:] or levels:
        begun = solutions.begun(solutions.unsolved(enough))
        solutions.fill(begun, nodes, neighbours or alone, report)
    left = solutions.unsolved(np.inf)
    solutions.shoot(left[np.isfinite(sections[left]).all(axis=1)], sections)
    for nodes in (levels[-1], MOST_NODES):
        if len(doubted := solutions.doubted()):
            solutions.fill(doubted, nodes, alone, report)
    motions = Rows()
    if neighbours is not None:
        solutions.wait_on(waits, report)
        motions = solutions.motions(waits)
    report(count, count)
    return solutions.told() | motions


def alone(_: int) -> list[int]:
    """Return no neighbour: what fails from the pin at rest may still be waited for."""
    return []


class _Solutions:
    """The rows and orbits that are known so far, and how more are solved for."""

    def __init__(
        self,
        sought: Sought,
        cases: Cases,
        points: int,
        chunk: int,
        engine: Engine | None,
        journal: Journal | None,
        scheduler: "distributed.Client | None" = None,
    ) -> None:
        self._sought, self._cases, self._chunk = sought, cases, chunk
        engine = engine or without_lanes()
        self._settings = {"engine": engine, "journal": journal, "scheduler": scheduler}
        self.points, self.rows = points, Rows()
        # NaN stands for the pin at rest.
        self.orbits = np.full((len(cases[0]), points, sought.dims), np.nan)

    def told(self) -> Rows:
        """Return the rows with the orbits, and with failures and ways in words."""
        rows: dict[str, Any] = {**self.rows, "eccentricity": self.orbits}
        failure = _in_words(rows.pop("code"), RESULTS, RESULTS.successful)
        found = _in_words(rows.pop("way"), WAYS, WAYS.rest)
        found[~np.asarray(rows["success"], bool)] = ""
        return rows | {"failure": failure, "found": found}

    def unsolved(self, enough: float) -> np.ndarray:
        """Return the cases without an orbit, or with one whose error is above `enough`."""
        if not self.rows:
            return np.arange(len(self.orbits))
        good = np.logical_and(self.rows["success"], self.rows["error"] <= enough)
        return np.flatnonzero(~good)

    def doubted(self) -> np.ndarray:
        """Return the cases whose orbit is not known to be stable or unstable."""
        return np.flatnonzero(np.asarray(self.rows["undecided"], bool))

    def begun(self, cases: np.ndarray) -> np.ndarray:
        """Return the cases of which an orbit or a guess is known: more nodes help no others."""
        return cases[np.isfinite(self.orbits[cases]).all(axis=(1, 2))]

    def fill(
        self,
        cases: np.ndarray,
        nodes: int,
        neighbours: Callable[[int], list[int]],
        report: Callable[[int, int], None],
    ) -> None:
        """Solve cases from what is known of them, then from neighbours, until none is new."""
        pairs, tried = [(case, case) for case in cases.tolist()], set[tuple[int, int]]()
        while pairs:
            self._attempt(pairs, nodes, report)
            left = [case for case in cases.tolist() if not self.rows["success"][case]]
            # As many guesses of each as fill a chunk.
            most = max(1, self._chunk // max(1, len(left)))
            pairs = [
                pair
                for case in left
                for pair in [
                    (case, near)
                    for near in neighbours(case)
                    if self.rows["success"][near] and (case, near) not in tried
                ][:most]
            ]
            tried.update(pairs)

    def shoot(self, cases: np.ndarray, sections: Float[np.ndarray, "cases states"]) -> None:
        """Solve cases by the integrator, from their section points."""
        if not len(cases):
            return
        given = jax.tree.map(lambda leaf: np.asarray(leaf)[cases], self._cases), sections[cases]
        solve = eqx.Partial(_shot, sought=self._sought, points=self.points)
        found = self._run(solve, given)
        good = found["success"]
        self.orbits[cases[good]] = found.pop("eccentricity")[good]
        for name, column in found.items():
            self.rows[name][cases[good]] = column[good]

    def _run(
        self,
        solve: Callable[..., dict[str, Array]],
        given: PyTree,
        progress: Callable[[int, int], None] | None = None,
    ) -> Rows:
        """Solve stacked cases from their guesses; what fills the last chunk is skipped."""
        function = eqx.Partial(_row, solve=solve)
        settings = {"progress": progress, "whole": self._chunk, "skips": True, **self._settings}
        return run_all(function, given, self._chunk, **settings)

    def unstable(self) -> np.ndarray:
        """Return the cases without a stable orbit."""
        return np.flatnonzero(~np.asarray(self.rows["stable"], bool))

    def wait(self, waits: LaneWaits, cases: np.ndarray) -> Float[np.ndarray, "some states"]:
        """Wait until the transient of cases is averaged out, which leaves guesses of their orbits.

        Returns section points to shoot from, where a joint loses contact and the motion repeats.
        """
        waits.go_on(cases, TURNS)
        means, spreads = waits.means(cases, self._sought.period)
        kept = self._guess(waits, cases, means)
        repeats = ~kept & (np.sqrt(np.mean(spreads**2, axis=1)) < SETTLED)
        return np.where(repeats[:, None], means, np.nan)

    def wait_on(self, waits: LaneWaits, report: Callable[[int, int], None]) -> None:
        """Wait for what has no stable orbit, twice as long each time, and solve for it from there.

        What fails, whirls or is chaotic is not waited for again.
        """
        turns, given_up = 2 * TURNS, set[int]()
        while turns <= LONGEST_WAIT:
            left = np.array([n for n in self.unstable().tolist() if n not in given_up], int)
            if not len(left) or len(left) * turns > MOST_TURNS:
                return
            waits.go_on(left, turns)
            found = waits.near(left, self._sought.period)
            # Of an orbit that is known to be unstable nothing new is found.
            new = found.closed & ((found.multipliers < 1) | ~self.rows["success"][left])
            if new.any():
                cases, points = left[new], found.states[new]
                kept = self._guess(waits, cases, points)
                if kept.any():
                    self.fill(cases[kept], MOST_NODES, alone, report)
                sections = np.full((len(self.orbits), points.shape[1]), np.nan)
                sections[cases] = points
                self.shoot(cases[~self.rows["success"][cases] | ~kept], sections)
            left = np.intersect1d(left, self.unstable())
            given_up |= set(left[waits.hopeless(left)].tolist())
            turns *= 2

    def motions(self, waits: LaneWaits) -> Rows:
        """Return `MOTION`: what the motions are that have no stable orbit."""
        left, count = self.unstable(), len(self.orbits)
        rows = {name: np.full(count, np.nan) for name in MOTION}
        rows["motion"] = np.full(count, "", object)
        if len(left):
            waits.go_on(left, TURNS)
            rows["motion"][left] = waits.names(left)
            seen = [waits.statistics(case) for case in left.tolist()]
            pairs = [(one, *one.values) for one in seen]
            rows["run_rms"][left] = [float(one[name]) for one, name in pairs]
            rows["run_rms_error"][left] = [float(one.standard_error(name)) for one, name in pairs]
        return rows

    def _guess(
        self, waits: LaneWaits, cases: np.ndarray, points: Float[np.ndarray, "some states"]
    ) -> np.ndarray:
        """Make periods from section points guesses; return where these keep contact."""
        orbits, kept = waits.one_period(cases, points, self._sought.period)
        self.orbits[cases[kept]] = _resampled(orbits[kept], self.points)
        return kept

    def _attempt(
        self, pairs: list[tuple[int, int]], nodes: int, report: Callable[[int, int], None]
    ) -> None:
        """Solve cases from the orbits of others; of several guesses the first that leads counts."""
        sought, chosen = self._sought, np.array(pairs)
        given = (
            jax.tree.map(lambda leaf: np.asarray(leaf)[chosen[:, 0]], self._cases),
            self.orbits[chosen[:, 1]],
        )
        solve = eqx.Partial(_solved, sought=sought, nodes=nodes)
        total, first = len(self.orbits), not self.rows

        def tell(done: int, _: int) -> None:
            report(done if first else total, total)

        found = self._run(solve, given, tell)
        if first:
            self.rows = {
                name: np.zeros((total, *column.shape[1:]), column.dtype)
                for name, column in found.items()
                if name != "eccentricity"
            }
        taken: dict[int, int] = {}
        for i, (case, _) in enumerate(pairs):
            if found["success"][i] and case not in taken:
                taken[case] = i
            elif first:
                taken.setdefault(case, i)
        if not first:
            # From a guess of its own: an orbit that is refined, or a motion that was waited for.
            known = np.where(self.rows["success"], self.rows["way"], _code(WAYS.waiting))
            for case, i in taken.items():
                if pairs[i] == (case, case):
                    found["way"][i] = known[case]
        into, out = list(taken), list(taken.values())
        self.orbits[into] = found.pop("eccentricity")[out]
        for name, column in found.items():
            self.rows[name][into] = column[out]


def _resampled(orbits: np.ndarray, points: int) -> np.ndarray:
    return np.asarray(jax.vmap(lambda x: resample(x, points))(jnp.asarray(orbits)))


def _code(entry: PyTree) -> int:
    """Return the number that an entry of an enumeration is kept as."""
    return int(jax.tree.leaves(entry)[0])


def _in_words(codes: np.ndarray, kind: Any, entry: PyTree) -> np.ndarray:
    """Return what the codes of an enumeration stand for; `entry` is any of its entries."""
    known, which = np.unique(codes, return_inverse=True)
    like = jax.tree.structure(entry)
    said = [words(kind, jax.tree.unflatten(like, [jnp.asarray(code)])) for code in known.tolist()]
    return np.array(said, object)[which]


def _row(
    given: tuple[DesignCase, Array], solve: Callable[..., dict[str, Array]]
) -> dict[str, Array]:
    """Solve one case from a guess; a case of NaN, which only fills a chunk, is skipped."""
    solve = eqx.filter_jit(solve)  # traced once; what is jitted in a module cannot be pickled
    like = jax.eval_shape(solve, given)
    nothing = jax.tree.map(lambda leaf: jnp.zeros(leaf.shape, leaf.dtype), like)
    fills = jnp.isnan(jnp.concatenate([leaf.ravel() for leaf in jax.tree.leaves(given[0])])).any()
    return jax.lax.cond(fills, lambda _: nothing, lambda given: solve(given), given)  # hashable


def _solved(
    given: tuple[DesignCase, Float[Array, "points dims"]], sought: Sought, nodes: int
) -> dict[str, Array]:
    """Solve one case by nodes, from those of a guess or, where these are NaN, from rest."""
    case, guess = given
    first = guess if unknowns(sought.scene(*case)) else None
    return _described(case, guess, sought, nodes=nodes, guess=first)


def _shot(
    given: tuple[DesignCase, Float[Array, " states"]], sought: Sought, points: int
) -> dict[str, Array]:
    """Solve one case by the integrator, from a section point."""
    case, section = given
    like = jnp.zeros((points, sought.dims))
    return _described(case, like, sought, method="shooting", guess=section)


def _described(
    case: DesignCase, like: Float[Array, "points dims"], sought: Sought, **how: Any
) -> dict[str, Array]:
    """Return the row of one case, with its orbit at as many angles as `like`.

    The orbit is searched for as `periodic_orbit` is told how.
    """
    free, rest = case

    def solved(free: Array) -> tuple[Float[Array, " numbers"], PeriodicOrbit]:
        made = sought.scene(free, rest)
        orbit = periodic_orbit(made, period=sought.period, **how)
        return jnp.stack([one(orbit, made, free, rest) for one in sought.numbers]), orbit

    # One after the other: side by side slopes by nine numbers took a quarter longer to compile.
    if not free.size:
        numbers, orbit = solved(free)
        slopes = jnp.zeros((len(numbers), 0))
    elif free.size <= len(sought.numbers):
        numbers, push, orbit = jax.linearize(solved, free, has_aux=True)
        slopes = jax.lax.map(push, jnp.eye(free.size)).T
    else:
        numbers, pull, orbit = jax.vjp(solved, free, has_aux=True)
        slopes = jax.lax.map(lambda one: pull(one)[0], jnp.eye(len(numbers)))
    row = dict(orbit.values) | {name: getattr(orbit, name) for name in SEEN}
    row |= {
        "numbers": jnp.where(orbit.success, numbers, jnp.nan),
        "slopes": jnp.where(orbit.success, slopes, jnp.nan),
        "inside_model": orbit.validity.inside,
        "code": jax.tree.leaves(orbit.result)[0],
        "way": jax.tree.leaves(orbit.way)[0],
        "eccentricity": like,
    }
    if orbit.eccentricity is not None:
        parts = {"real": orbit.multipliers.real, "imag": orbit.multipliers.imag}
        row |= {f"multiplier_{part}": values for part, values in parts.items()}
        row["eccentricity"] = resample(orbit.eccentricity, len(like))
    return row


def beside(shape: tuple[int, ...], ordered: Sequence[bool]) -> Callable[[int], list[int]]:
    """Return a function of a cell of a grid: the cells a few steps along an ordered axis away.

    Cells go by their number. The nearest come first, up to `REACH` steps away.
    """
    steps = [sign * length for length in range(1, REACH + 1) for sign in (-1, 1)]

    def near(cell: int) -> list[int]:
        place, found = np.unravel_index(cell, shape), []
        for step, (axis, size) in itertools.product(steps, enumerate(shape)):
            if ordered[axis] and 0 <= place[axis] + step < size:
                moved = [p + step * (k == axis) for k, p in enumerate(place)]
                found.append(int(np.ravel_multi_index(moved, shape)))
        return found

    return near

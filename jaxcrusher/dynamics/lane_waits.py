"""Motions of many cases from the pins at rest, waited for in lanes, all of them at once.

An oscillation decays in thousands of turns. The mean of section points is near the orbit about
which it oscillates, and from there Newton's method solves for the orbit's section point. Its
slopes are differences of turns, which lanes integrate too: no further program is compiled. What
has no orbit is named by its section points, and has an RMS with a standard error.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int, PyTree

from jaxcrusher.basics.record import words
from jaxcrusher.batch.engines import Engine, run_all
from jaxcrusher.files.journal import Journal
from jaxcrusher.lanes.code import LANES
from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.motion.indicators import CHAOS
from jaxcrusher.motion.method import resolve
from jaxcrusher.motion.section import fine
from jaxcrusher.motion.statistics import Statistics, by_turns
from jaxcrusher.orbits.forced import pins
from jaxcrusher.orbits.oscillation import about_means
from jaxcrusher.orbits.result import RESULTS
from jaxcrusher.orbits.shot import STEPS
from jaxcrusher.orbits.transient import (
    APART,
    PIECE,
    REPEATS,
    TURNS,
    WAIT_RTOL,
    Round,
    SceneAt,
    growth_of,
    one_period,
    resting_start,
    section_points,
    whirls_next,
)
from jaxcrusher.periodic.shooting_problem import CLOSURE

if TYPE_CHECKING:
    import distributed

# The tolerance of a turn whose differences are slopes. It leaves 1e-9 of a clearance.
FINE = 1e-10
# Steps of these differences: a share of the spread of section points, and the shortest one. A
# spread as wide as the motion is deep bends the map by 1e-4 over the first.
SHARE, SHORTEST = 0.01, 1e-6
# Cases of a chunk on a cluster.
WORKER_CASES = 4 * LANES

# Numbers that are free, and all others, of stacked cases.
Cases = tuple[Float[np.ndarray, "cases n"], PyTree]


class Points(NamedTuple):
    """Section points that Newton's method came to, and whether it has converged."""

    states: Float[np.ndarray, "cases dims"]
    multipliers: Float[np.ndarray, " cases"]  # the largest moduli, to some 1e-4
    closed: Bool[np.ndarray, " cases"]


class LaneWaits:
    """Motions of stacked cases, each waited for as far as it is asked for.

    `tell` is called after each round of turns, and may raise an error to end the wait.
    """

    def __init__(
        self,
        scene: Callable[[Array, PyTree], Scene],
        cases: Cases,
        engine: Engine | None,
        journal: Journal | None,
        tell: Callable[[], None],
        scheduler: "distributed.Client | None" = None,
    ) -> None:
        self._scene, self._cases, self._tell = scene, cases, tell
        self._settings = {"engine": engine, "whole": LANES, "scheduler": scheduler}
        # All cores of this machine have work in one chunk, and each worker gets one of its own.
        self._chunk, self._journal = None if scheduler is None else WORKER_CASES, journal
        self._at: dict[int, np.ndarray] = {}  # states
        self._scenes: dict[int, Scene] = {}
        self._seen: dict[int, list[dict[str, np.ndarray]]] = {}

    def go_on(self, which: Int[np.ndarray, " some"], turns: int) -> None:
        """Integrate some cases until each has been waited for over so many turns from rest."""
        self._begin(np.array([n for n in which.tolist() if n not in self._at], int))
        while behind := [n for n in which.tolist() if TURNS * len(self._seen[n]) < turns]:
            found = self._run(_on, self._states(behind), behind, self._journal)
            for i, case in enumerate(behind):
                self._at[case] = found["states"][i, -1]
                self._seen[case].append({name: column[i] for name, column in found.items()})
            self._tell()

    def _begin(self, which: Int[np.ndarray, " some"]) -> None:
        """Set cases to rest."""
        if not len(which):
            return
        part = jax.tree.map(lambda leaf: np.asarray(leaf)[which], self._cases)
        begun = jax.vmap(lambda case: resting_start(self._scene(*case).steady()))(part)
        states, scenes = jax.tree.map(np.asarray, begun)
        for i, case in enumerate(which.tolist()):
            self._at[case], self._seen[case] = states[i], []
            self._scenes[case] = jax.tree.map(lambda leaf, i=i: leaf[i], scenes)

    def last(self, case: int, growth: float = 0.0) -> Round:
        """Return the section points of the last half of a case's turns."""
        return Round(self._joined(case, "states"), growth)

    def succeeded(self, case: int) -> bool:
        """Tell whether a case has been integrated to the end."""
        return all(bool(part["success"]) for part in self._seen[case])

    def statistics(self, case: int) -> Statistics:
        """Return the statistics of the last half of a case's turns."""
        scene = self._scenes[case]
        name, state = scene.leading, jnp.asarray(self._at[case])
        by_turn = jnp.asarray(self._joined(case, name))
        entries = scene.entries((name,))
        value = entries[0][1].reduction.of_pieces(by_turn)
        return Statistics(
            by_turn.size, fine(), {name: value}, {name: by_turn}, state, known=entries
        )

    def means(
        self, which: Int[np.ndarray, " some"], period: int
    ) -> tuple[Float[np.ndarray, "some dims"], Float[np.ndarray, "some dims"]]:
        """Return means of section points of some cases, a period apart, and their spread."""
        seen = [about_means(self.last(case).states, period) for case in which.tolist()]
        spreads = [np.sqrt(np.mean(apart[:, -1] ** 2, axis=0)) for _, apart in seen]
        return np.array([means[-1] for means, _ in seen]), np.array(spreads)

    def hopeless(self, which: Int[np.ndarray, " some"]) -> Bool[np.ndarray, " some"]:
        """Tell which cases no further turns lead to an orbit: they fail, whirl or are chaotic."""
        known = which.tolist()
        if not known:
            return np.zeros(0, bool)
        failed = np.array([not self.succeeded(case) for case in known])
        growth, whirls = self._ahead(known)
        return failed | whirls | (growth > CHAOS)

    def near(self, which: Int[np.ndarray, " some"], period: int) -> Points:
        """Return the section points near the means of some cases that repeat after a period.

        Newton's method solves for them; its slopes are central differences.
        """
        point, spreads = self.means(which, period)
        steps, (count, dims) = np.maximum(SHARE * spreads, SHORTEST), point.shape
        moduli, closed = np.full(count, np.nan), np.zeros(count, bool)
        eye = np.eye(dims)
        shifts = np.concatenate([np.zeros((1, dims)), eye, -eye])
        for _ in range(STEPS):
            going = np.flatnonzero(~closed & np.isfinite(point).all(axis=1))
            if not len(going):
                break
            begun = point[going] + shifts[:, None] * steps[going]
            cases = len(shifts) * which[going].tolist()
            ends = self._turns(begun.reshape(-1, dims), cases, period, FINE)
            at, above, below = np.split(ends.reshape(begun.shape), [1, 1 + dims])
            matrix = np.moveaxis((above - below) / (2 * steps[going].T[..., None]), 0, -1)
            known = np.asarray(np.isfinite(matrix).all(axis=(1, 2)))
            matrix = np.where(known[:, None, None], matrix, 0.0)
            step = np.linalg.solve(eye - matrix, (at[0] - point[going])[..., None])[..., 0]
            point[going] = np.where(known[:, None], point[going] + step, np.nan)
            moduli[going] = np.max(np.abs(np.linalg.eigvals(matrix)), axis=1)
            closed[going] = known & (np.max(np.abs(step), axis=1) < CLOSURE)
        return Points(point, moduli, closed)

    def names(self, which: Int[np.ndarray, " some"]) -> list[str]:
        """Say what the motions of some cases are."""
        known = which.tolist()
        seen = (column.tolist() for column in self._ahead(known))
        motions = map(self._motion, known, *seen)
        return [words(RESULTS, motion) for motion in motions]

    def _ahead(
        self, which: list[int]
    ) -> tuple[Float[np.ndarray, " some"], Bool[np.ndarray, " some"]]:
        """Return what a disturbance of some cases grows by, and which of them whirl."""
        begun = np.stack([self.last(case).states[-PIECE - 1] for case in which])
        end, beside = self._states(which), begun + APART / np.sqrt(begun.shape[1])
        growth = growth_of(end, self._turns(beside, which, PIECE, WAIT_RTOL))
        return np.atleast_1d(growth), self._run(whirls_next, end, which)[0]

    def _motion(self, case: int, growth: float, whirls: bool) -> RESULTS:
        if not self.succeeded(case):
            return RESULTS.not_integrated
        if whirls:
            return RESULTS.whirl
        last = self.last(case, growth)
        *_, (period, _) = last.means(None)
        if period > 1 and not last.chaotic:
            # It may swing about a stable orbit of more turns.
            found = self.near(np.array([case]), period)
            if bool(found.closed[0]) and float(found.multipliers[0]) < 1:
                return REPEATS[min(period, len(REPEATS)) - 1]
        return last.motion()

    def _turns(
        self, states: np.ndarray, which: list[int], turns: int, rtol: float
    ) -> Float[np.ndarray, "some dims"]:
        """Return where some turns lead from section points of cases."""
        go_on = eqx.Partial(section_points, turns=turns, rtol=rtol)
        return self._run(go_on, states, which)[0][:, -1]

    def one_period(
        self, which: Int[np.ndarray, " some"], states: np.ndarray, period: int
    ) -> tuple[Float[np.ndarray, "some angles half"], Bool[np.ndarray, " some"]]:
        """Return e / c of some cases over a period from section points, NaN where it fails.

        With it comes where every pin keeps contact.
        """
        known = which.tolist()
        orbits, success = self._run(eqx.Partial(one_period, period=period), states, known)
        kept = np.all(np.linalg.norm(pins(orbits), axis=3) > 1, axis=(1, 2)) & success
        return np.where(success[:, None, None], orbits, np.nan), kept

    def _run(
        self,
        function: Callable,
        states: np.ndarray,
        which: list[int],
        journal: Journal | None = None,
    ) -> Any:
        scenes = jax.tree.map(lambda *leaves: np.stack(leaves), *(self._scenes[n] for n in which))
        chunk = self._chunk or len(which)
        return run_all(function, (states, scenes), chunk, journal=journal, **self._settings)

    def _states(self, which: list[int]) -> np.ndarray:
        return np.stack([self._at[case] for case in which])

    def _joined(self, case: int, name: str) -> np.ndarray:
        whole = np.concatenate([part[name] for part in self._seen[case]])
        return whole[len(whole) // 2 :]


def _on(case: SceneAt) -> dict[str, Array]:
    """Return the section points of the next turns, and what tells their RMS."""
    state, scene = case
    outputs, method = scene.entries((scene.leading,)), resolve(scene, WAIT_RTOL)
    points, by_turn, outcome = by_turns(scene, state, TURNS, outputs, method)
    return {"states": points, "success": outcome.success, **by_turn}

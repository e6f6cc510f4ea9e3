"""A motion that is waited for: guesses of its periodic orbit, and what it does if it has none.

A swing of the pin dies in thousands of turns. The mean over some hundred turns removes it, and
leaves a guess from which Newton's method converges.
"""

import functools
import itertools
import logging
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Scalar

from jaxcrusher.basics import integrate as integration
from jaxcrusher.basics.integrate import Outcome, integrate
from jaxcrusher.basics.record import words
from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.mechanism.starts import InContact
from jaxcrusher.motion.flow import Flow, initial_state, unflattened
from jaxcrusher.motion.indicators import CHAOS, detect_period
from jaxcrusher.motion.method import Method, resolve
from jaxcrusher.motion.section import fine, first_failure
from jaxcrusher.motion.statistics import Statistics, by_turns, of_whirl, statistics_problem
from jaxcrusher.orbits.effort import PIECE, Spent
from jaxcrusher.orbits.forced import coordinates
from jaxcrusher.orbits.result import RESULTS
from jaxcrusher.orbits.shot import PATH

# Turns of the first round, half of which make a mean: a multiple of all periods up to six. Each
# round lasts as long as all before it. They are integrated in pieces, between which the steps are
# counted; half a piece is a multiple of all periods up to four.
TURNS = 240
# The integration's tolerance: at 1e-6 the method feeds a swing as much as the joint damps it; at
# 1e-7 it changes the decay by 5 to 14 %. No decay is judged by it.
WAIT_RTOL = 1e-7
# Instants a turn at which the motion from a mean is looked at.
ANGLES = 96
# The longest period that a motion is looked at for, and how much narrower it must be about the
# means of every p-th turn than about the mean of all.
LONGEST, NARROWER = 4, 0.5
# Section points so near, in clearances and m/s, repeat.
REPEATED = 1e-4
# How far a disturbance is from a motion, in clearances and m/s, at first and when it has grown.
APART, FAR = 1e-5, 0.1

_LOG = logging.getLogger(__name__)

# A section point, and the scene that moves from it.
SceneAt = tuple[Float[Array, " dims"], Scene]


def section_points(
    case: SceneAt, *, turns: int, rtol: float
) -> tuple[Float[Array, "turns dims"], Bool[Array, ""]]:
    """Return those of the next turns from a state, and whether the integration succeeded.

    One integration: in lanes designs do not wait for each other at each turn's end.
    """
    state, scene = case
    states, _, outcome = by_turns(scene, state, turns, (), resolve(scene, rtol))
    return states, outcome.success


def resting(scene: Scene) -> Scene:
    """Return the scene whose pins start at rest in their bores, whatever its own start."""
    return scene if scene.is_ideal else eqx.tree_at(lambda s: s.start, scene, InContact())


def resting_start(scene: Scene) -> SceneAt:
    """Return the scene with its pins resting in their bores, whatever its own start."""
    scene = resting(scene)
    return initial_state(scene), scene


def section_mean(
    case: SceneAt, *, period: int
) -> tuple[Float[Array, " dims"], Scalar, Bool[Array, ""]]:
    """Return the mean section point of some hundred turns, `period` apart.

    With it come how far they are from it, root mean square, and whether the integration succeeded.
    """
    states, success = section_points(case, turns=TURNS, rtol=WAIT_RTOL)
    states = states[TURNS // 2 + period - 1 :: period]
    mean = jnp.mean(states, axis=0)
    return mean, jnp.sqrt(jnp.mean((states - mean[None]) ** 2)), success


@eqx.filter_jit
def one_period(
    case: SceneAt, *, period: int
) -> tuple[Float[Array, "angles half"], Bool[Array, ""]]:
    """Return e / c at equal steps of phase over `period` turns from a section point.

    With it comes whether the integration succeeded.
    """
    begun, scene = case
    state = unflattened(begun, scene)
    assert state is not None
    phases = jnp.asarray(2 * np.pi * np.arange(1, ANGLES * period)[:, None] / ANGLES)
    flow, method = Flow(scene, state), resolve(scene, WAIT_RTOL)
    problem, _ = statistics_problem(flow, ())
    (states, _), outcome = integrate(flow, phases, problem=problem, method=method)
    path = jax.vmap(coordinates)(states)
    return jnp.concatenate([coordinates(state)[None], path]), outcome.success


class Followed(NamedTuple):
    """Some turns from a section point: the state after them, and what was seen on the way."""

    end: Float[Array, " dims"]
    path: Float[Array, "instants half"]  # e / c at `SAMPLES` instants a turn
    whirls: bool
    outcome: Outcome


def followed(case: SceneAt, turns: int, rtol: float, most: int | None) -> Followed:
    """Follow a motion turn by turn, in `most` steps each; concrete values only.

    One program serves all periods and tolerances: what it sees costs less than another one.
    """
    state, scene = case
    paths, values, outcome = [], [], fine()
    for _ in range(turns):
        state, path, seen, after = _turn((state, scene), jnp.asarray(rtol), most)
        outcome = first_failure(outcome, after)
        paths.append(path)
        values.append(seen)
    by_turn = {name: jnp.concatenate([one[name] for one in values]) for name in values[0]}
    table = scene.statistics
    means = {name: table[name].reduction.of_pieces(q) for name, q in by_turn.items()}
    known = tuple(table.items())
    whirls = Statistics(turns, outcome, means, by_turn, state, known=known).whirl
    return Followed(state, jnp.concatenate(paths), bool(whirls), outcome)


@eqx.filter_jit
def _turn(
    case: SceneAt, rtol: Scalar, most: int | None
) -> tuple[Array, Array, dict[str, Array], Outcome]:
    state, scene = case
    method = resolve(scene, rtol, Method(max_steps=most))
    outputs = scene.entries(of_whirl(scene)) + PATH
    states, values, outcome = by_turns(scene, state, 1, outputs, method)
    ((name, _),) = PATH
    begun = unflattened(state, scene)
    assert begun is not None
    # Instants are seen at the ends of steps between them, and so is the last one.
    path = jnp.concatenate([coordinates(begun)[None], values.pop(name)[0][:-1]])
    return states[-1], path, values, outcome


@eqx.filter_jit
def piece(case: SceneAt) -> tuple[Float[Array, "turns dims"], Outcome]:
    """Return the section points of the next `PIECE` turns from a state, and how they ended."""
    state, scene = case
    states, _, outcome = by_turns(scene, state, PIECE, (), resolve(scene, WAIT_RTOL))
    return states, outcome


@dataclass(frozen=True)
class Round:
    """Section points of the last turns that were waited for."""

    states: Float[np.ndarray, "turns dims"]
    chaotic: bool = False  # disturbances grow from its end on

    def means(self, period: int | None) -> Iterator[tuple[int, Float[Array, " dims"]]]:
        """Yield numbers of turns and the mean of section points so far apart.

        Without a `period` that is 1, and the least up to `LONGEST` about whose means the motion
        is clearly narrower.
        """
        one = self._spread(1)
        longer = (p for p in range(2, LONGEST + 1) if self._spread(p) < NARROWER * one)
        periods = (1, *itertools.islice(longer, 1)) if period is None else (period,)
        for turns in periods:
            yield turns, jnp.asarray(self.states[turns - 1 :: turns].mean(axis=0))

    def repeats_after(self) -> int | None:
        """Return the least number of turns, up to `LONGEST`, after which the points repeat."""
        return detect_period(self.states, longest=LONGEST, tolerance=0.0, noise=REPEATED)

    def _spread(self, period: int) -> float:
        parts = self.states.reshape(-1, period, self.states.shape[1])
        return float(np.sqrt(np.mean((parts - parts.mean(axis=0)) ** 2)))


class Wait:
    """The motion of a scene from its pins at rest, waited for as far as it is asked for.

    It is integrated in pieces of whole turns, within an effort.
    """

    def __init__(self, scene: Scene, spent: Spent) -> None:
        self._own, self.spent = scene, spent
        self._ended: Array | None = None  # the state after all turns so far
        self._last: Round | None = None
        self._failure: RESULTS | None = None

    # Most orbits need no wait.
    @functools.cached_property
    def _begun(self) -> SceneAt:
        return resting_start(self._own)

    @property
    def start(self) -> Array:
        """Return the state with its pins at rest."""
        return self._begun[0]

    def piece(self, state: Array) -> tuple[Float[Array, "turns dims"], Outcome]:
        """Return the section points of the next `PIECE` turns from a state, and how they ended."""
        return piece((state, self._begun[1]))

    def whirls_next(self, state: Array, most: int | None) -> tuple[bool, Outcome]:
        """Return whether the next two turns whirl, in `most` steps, and how they ended."""
        seen = followed((state, self._begun[1]), 2, WAIT_RTOL, most)
        return seen.whirls, seen.outcome

    def one_period(
        self, state: Array, turns: int
    ) -> tuple[Float[Array, "instants half"], Bool[Array, ""]]:
        """Return e / c over so many turns from a section point, and whether that succeeded."""
        seen = followed((state, self._begun[1]), turns, WAIT_RTOL, self.spent.most)
        return seen.path, seen.outcome.success

    @property
    def _state(self) -> Array:
        return self.start if self._ended is None else self._ended

    def rounds(self) -> Iterator[Round]:
        """Yield the last half of more and more turns.

        They end where the motion fails or whirls, after the second round where it is chaotic, and
        with what there is where the effort has no steps for a piece and a look at what grows.
        """
        seen = np.zeros((0, len(self._state)))
        last = self.spent.bounds.turns // TURNS - 1
        for turn in range(last + 1):
            if self._whirls() or self._failure is not None:
                return
            _LOG.info("waiting: turns %d to %d from rest", turn * TURNS + 1, (turn + 1) * TURNS)
            while len(seen) < (turn + 1) * TURNS and self.spent.affords(2 * PIECE):
                begun = self._state
                states, outcome = self.piece(begun)
                if not bool(outcome.success):
                    self._failure = RESULTS.not_integrated
                    return
                self.spent.integrated(outcome, PIECE)
                self.spent.turns += PIECE
                seen, self._ended = np.concatenate([seen, states]), states[-1]
            ends = not self.spent.affords(2 * PIECE)
            if len(seen) and (turn & (turn + 1) == 0 or ends):  # a power of two, or the last
                # Before what would be in vain, and at the end for its name.
                looks = turn in (0, 1, last) or ends
                chaotic = looks and self.growth(begun, seen[-PIECE:]) > CHAOS
                self._last = Round(seen[len(seen) // 2 :], chaotic)
                yield self._last
                ends |= chaotic and turn > 0
            if ends:
                return

    def told(self) -> str:
        """Say what was tried, and after turns that were waited for what the motion does."""
        motion = f"{words(RESULTS, self.regime(RESULTS.aperiodic))} " if self.spent.turns else ""
        return f"{motion}{self.spent}"

    def regime(self, otherwise: RESULTS) -> RESULTS:
        """Name what the motion does that has no orbit."""
        if self._failure is None and self._whirls():
            return RESULTS.whirl
        if self._failure is not None:
            return self._failure
        if self._last is None:
            return otherwise
        if Round(self._last.states[-TURNS // 2 :]).repeats_after() is not None:
            return RESULTS.repeats
        return RESULTS.chaotic if self._last.chaotic else RESULTS.aperiodic

    def growth(self, begun: Array, states: Float[np.ndarray, "turns dims"]) -> float:
        """Return the logarithm of what a disturbance grows by in a turn (Benettin 1980).

        It is that of a motion beside the one whose section points are `states`, begun together.
        """
        beside, outcome = self.piece(begun + APART / np.sqrt(begun.size))
        self.spent.integrated(outcome, PIECE)
        apart = np.linalg.norm(beside - states, axis=1)
        turns = np.append(np.flatnonzero(apart > FAR), PIECE - 1)[0] + 1
        return float(np.log(apart[turns - 1] / APART) / turns)

    def _whirls(self) -> bool:
        """Tell whether the next two turns whirl; of what fails or is too long a failure is kept."""
        whirls, outcome = self.whirls_next(self._state, self.spent.most)
        self.spent.integrated(outcome, 2)
        if not bool(outcome.success):
            long = bool(outcome.result == integration.RESULTS.max_steps_reached)
            self._failure = RESULTS.too_long if long else RESULTS.not_integrated
            return False
        return whirls

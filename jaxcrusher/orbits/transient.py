"""A transient: guesses of its periodic orbit, and the kind of motion if it has no orbit.

A swing of the pin dies in thousands of turns. The mean over some hundred turns removes it, and
leaves a guess from which Newton's method converges.
"""

import logging
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Scalar

from jaxcrusher.basics import integrate as integration
from jaxcrusher.basics.integrate import Outcome
from jaxcrusher.basics.record import words
from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.mechanism.starts import InContact
from jaxcrusher.motion import indicators
from jaxcrusher.motion.flow import initial_state, unflattened
from jaxcrusher.motion.method import Method, resolve
from jaxcrusher.motion.section import fine, first_failure
from jaxcrusher.motion.statistics import Statistics, by_turns, of_whirl
from jaxcrusher.orbits.effort import PIECE, Budget
from jaxcrusher.orbits.forced import coordinates
from jaxcrusher.orbits.oscillation import about_means
from jaxcrusher.orbits.result import RESULTS
from jaxcrusher.orbits.shot import PATH

# Turns of the first round, half of which make a mean: a multiple of all periods up to six. Each
# round lasts as long as all before it. They are integrated in pieces, between which the steps are
# counted; half a piece is a multiple of all periods up to four.
TURNS = 240
# The integration's tolerance: at 1e-6 the method feeds a swing as much as the joint damps it; at
# 1e-7 it changes the decay by 5 to 14 %. No decay is judged by it.
TRANSIENT_RTOL = 1e-7
# That of turns whose differences are slopes.
FINE = 1e-8
# How much narrower a motion of p turns must be about the means of every p-th turn than about the
# mean of all.
NARROWER = 0.6
# Section points so near, in clearances and m/s, repeat.
REPEATED = 1e-4
# How far a disturbance is from a motion, in clearances and m/s, at first.
APART = 1e-5
# Names of motions that repeat after so many turns, and of all longer ones.
REPEATS = (*(getattr(RESULTS, f"repeats_{n}") for n in range(1, 5)), RESULTS.repeats_late)

_LOG = logging.getLogger(__name__)

# A section point, and the scene that moves from it.
SceneAt = tuple[Float[Array, " dims"], Scene]
# Section points of turns (turns, dims), statistics of each turn, and how they ended; arrays of JAX,
# or of NumPy where lanes integrate.
NextTurns = tuple[Any, dict[str, Any], Outcome]
# Section points after a turn, and the steps of all these integrations.
Ends = tuple[np.ndarray, int]


def section_points(case: SceneAt, *, turns: int, rtol: float, most: int | None = None) -> NextTurns:
    """Return the next turns from a section point, in `most` steps each, with what tells a whirl.

    One integration: in lanes designs do not wait for each other at each turn's end.
    """
    state, scene = case
    method = resolve(scene, rtol, Method(max_steps=most))
    return by_turns(scene, state, turns, scene.entries(of_whirl(scene)), method)


_section_points = eqx.filter_jit(section_points)  # what is jitted in a module cannot be pickled


def piece(case: SceneAt, most: int | None = None) -> NextTurns:
    """Return the next `PIECE` turns from a section point, in `most` steps each."""
    return _section_points(case, turns=PIECE, rtol=TRANSIENT_RTOL, most=most)


@eqx.filter_jit
def whirls(scene: Scene, values: dict[str, Any]) -> Bool[Array, ""]:
    """Tell whether the last two of some turns whirl, by the statistics of each."""
    known = scene.entries(tuple(values))
    last = {name: one.reduction.of_pieces(values[name][-2:]) for name, one in known}
    return Statistics(2, fine(), last, values, jnp.zeros(0), known=known).whirl


class Lone:
    """Turns of one search alone, as it asks for them."""

    def piece(self, case: SceneAt, most: int | None) -> NextTurns:
        """Return the next `PIECE` turns from a section point, in `most` steps each."""
        return piece(case, most)

    def turn(self, states: Float[np.ndarray, "n dims"], scene: Scene) -> Ends:
        """Return where one turn leads from each of some section points, at `FINE`."""
        # By the program that looks at orbits, whatever that sees besides.
        ends = [_turn((jnp.asarray(state), scene), jnp.asarray(FINE)) for state in states]
        return np.array([one.end for one in ends]), sum(int(one.outcome.steps) for one in ends)


def resting(scene: Scene) -> Scene:
    """Return the scene whose pins start at rest in their bores, whatever its own start."""
    return scene if scene.is_ideal else eqx.tree_at(lambda s: s.start, scene, InContact())


def resting_start(scene: Scene) -> SceneAt:
    """The section point of the pins at rest in their bores, and the scene that starts there."""
    scene = resting(scene)
    return initial_state(scene), scene


class Followed(NamedTuple):
    """Some turns from a section point: the state after them, and what was seen on the way."""

    end: Float[Array, " dims"]
    path: Float[Array, "instants half"]  # e / c at `SAMPLES` instants a turn
    outcome: Outcome


def followed(case: SceneAt, turns: int, rtol: float) -> Followed:
    """Follow a motion turn by turn; concrete values only.

    One program serves all periods and tolerances.
    """
    (state, scene), paths, outcome = case, [], fine()
    for _ in range(turns):
        state, path, after = _turn((state, scene), jnp.asarray(rtol))
        outcome = first_failure(outcome, after)
        paths.append(path)
    return Followed(state, jnp.concatenate(paths), outcome)


@eqx.filter_jit
def _turn(case: SceneAt, rtol: Scalar) -> Followed:
    state, scene = case
    states, values, outcome = by_turns(scene, state, 1, PATH, resolve(scene, rtol))
    begun = unflattened(state, scene)
    assert begun is not None
    ((path,),) = values.values()
    # Instants are seen at the ends of steps between them, and so is the last one.
    path = jnp.concatenate([coordinates(begun)[None], path[:-1]])
    return Followed(states[-1], path, outcome)


def growth_of(end: Float[np.ndarray, " dims"], beside: Float[np.ndarray, " dims"]) -> float:
    """Return the logarithm of what a disturbance grows by in a turn (Benettin 1980).

    The two motions began `APART` and end so after `PIECE` turns. For motions as far apart as they
    can be the result is at least 0.3.
    """
    return float(np.log(np.linalg.norm(beside - end) / APART) / PIECE)


@dataclass(frozen=True)
class Round:
    """Section points of the last turns that were waited for, of one motion."""

    states: Float[np.ndarray, "turns dims"]
    growth: float = 0.0  # by `growth_of`, of a disturbance at its end

    @property
    def chaotic(self) -> bool:
        """Whether disturbances grow."""
        return self.growth > indicators.CHAOS

    def motion(self) -> RESULTS:
        """Name the motion, which neither fails nor whirls."""
        if period := self.repeats_after():
            return REPEATS[min(period, len(REPEATS)) - 1]
        if self.chaotic:
            return RESULTS.chaotic
        if indicators.spread_trend(self.states, noise=REPEATED)[1]:
            return RESULTS.unsettled
        if len(self.states) < indicators.ENOUGH:
            return RESULTS.aperiodic
        disorder = indicators.zero_one_test(indicators.widest(self.states))
        return RESULTS.quasi_periodic if disorder < indicators.ORDER else RESULTS.aperiodic

    def means(
        self, period: int | None, longest: int
    ) -> Iterator[tuple[int, Float[Array, " dims"]]]:
        """Yield numbers of turns, with the mean of section points so far apart.

        Without a `period` the numbers are 1 and the least one, up to the `longest`, about whose
        means the motion is clearly narrower.
        """
        enough = NARROWER * self._spread(1)
        longer = next((p for p in range(2, longest + 1) if self._spread(p) < enough), 1)
        for turns in sorted({1, longer}) if period is None else (period,):
            yield turns, jnp.asarray(about_means(self.states, turns)[0][-1])

    def repeats_after(self) -> int | None:
        """Return the least number of turns after which the last points repeat."""
        states = self.states[-TURNS // 2 :]
        return indicators.detect_period(states, tolerance=0.0, noise=REPEATED)

    def _spread(self, period: int) -> float:
        return float(np.sqrt(np.mean(about_means(self.states, period)[1] ** 2)))


class Transient:
    """The motion of a scene from its pins at rest, integrated as far as it is asked for.

    It is integrated in pieces of whole turns, within an effort.
    """

    def __init__(self, scene: Scene, budget: Budget, runs: Lone | None = None) -> None:
        self._own, self.budget, self._runs = scene, budget, runs or Lone()
        self._rested: SceneAt | None = None
        self._ended: Array | None = None  # the state after all turns so far
        self._values: list[dict[str, Any]] = []  # of each piece
        self._last: Round | None = None
        self._end: RESULTS | None = None  # why no further turns lead to an orbit

    @property
    def _rest(self) -> SceneAt:
        """Return its pins at rest, once it is asked for: most orbits need no wait.

        In Python 3.11 `functools.cached_property` would let one search wait for another's.
        """
        if self._rested is None:
            self._rested = resting_start(self._own)
        return self._rested

    @property
    def start(self) -> Array:
        """Return the state with its pins at rest."""
        return self._rest[0]

    def piece(self, state: Array) -> NextTurns:
        """Return the next `PIECE` turns from a state."""
        return self._runs.piece((state, self._rest[1]), self.budget.most)

    @property
    def _state(self) -> Array:
        return self.start if self._ended is None else self._ended

    def rounds(self) -> Iterator[Round]:
        """Yield the last half of more and more turns.

        They end where the motion fails or whirls, after the second round of a chaotic motion, and
        with the turns so far where the effort has no steps for a piece and a check of growth.
        """
        seen = np.zeros((0, len(self._state)))
        last = self.budget.bounds.turns // TURNS - 1
        for turn in range(last + 1):
            _LOG.info("waiting: turns %d to %d from rest", turn * TURNS + 1, (turn + 1) * TURNS)
            while len(seen) < (turn + 1) * TURNS and self.budget.affords(2 * PIECE):
                begun = self._state
                states, values, outcome = self.piece(begun)
                self.budget.integrated(outcome, PIECE)
                if not bool(outcome.success):
                    long = bool(outcome.result == integration.RESULTS.max_steps_reached)
                    self._end = RESULTS.too_long if long else RESULTS.not_integrated
                    return
                self.budget.turns += PIECE
                self._values.append(values)
                seen, self._ended = np.concatenate([seen, states]), jnp.asarray(states[-1])
                if bool(whirls(self._rest[1], values)):
                    self._end = RESULTS.whirl
                    return
            ends = not self.budget.affords(2 * PIECE)
            if len(seen) and (turn & (turn + 1) == 0 or ends):  # a power of two, or the last
                growth = self.growth(begun, seen[-1])
                self._last = Round(seen[len(seen) // 2 :], growth)
                yield self._last
                # Chaos of the first round may be of a transient.
                ends |= self._last.chaotic and turn > 0
            if ends:
                return

    def statistics(self) -> Statistics | None:
        """Return the statistics of the last half of the integrated turns; None without turns."""
        if not self._values:
            return None
        scene, first = self._rest[1], len(self._values) // 2
        known = scene.entries(tuple(self._values[first]))
        by_turn = {n: jnp.concatenate([v[n] for v in self._values[first:]]) for n, _ in known}
        values = {name: one.reduction.of_pieces(by_turn[name]) for name, one in known}
        turns = PIECE * (len(self._values) - first)
        return Statistics(turns, fine(), values, by_turn, self._state, known=known)

    def explanation(self) -> str:
        """Say what was tried and, if turns were integrated, what the motion does."""
        regime = self.regime() if self.budget.turns else None
        return str(self.budget) if regime is None else f"{words(RESULTS, regime)} {self.budget}"

    def regime(self) -> RESULTS | None:
        """Name the kind of a motion without an orbit; None if it was not integrated."""
        if self._end is not None or self._last is None:
            return self._end
        return self._last.motion()

    def growth(self, begun: Array, end: Float[np.ndarray, " dims"]) -> float:
        """Return the growth of a disturbance by `growth_of`, over a piece between two states."""
        beside, _, outcome = self.piece(begun + APART / np.sqrt(begun.size))
        self.budget.integrated(outcome, PIECE)
        return float(growth_of(end, np.asarray(beside)[-1]))

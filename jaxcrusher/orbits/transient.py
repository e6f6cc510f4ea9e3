"""A motion that is waited for: guesses of its periodic orbit, and what it does if it has none.

A swing of the pin dies in thousands of turns. The mean over some hundred turns removes it, and
leaves a guess from which Newton's method converges.
"""

import functools
import logging
from collections.abc import Iterator
from dataclasses import dataclass

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from jaxcrusher.basics import integrate as integration
from jaxcrusher.basics.integrate import Outcome, integrate
from jaxcrusher.basics.record import words
from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.mechanism.starts import InContact
from jaxcrusher.motion import indicators
from jaxcrusher.motion.flow import Flow, initial_state, unflattened
from jaxcrusher.motion.method import Method, resolve
from jaxcrusher.motion.statistics import by_turns, of_whirl, statistics, statistics_problem
from jaxcrusher.orbits.effort import Spent
from jaxcrusher.orbits.forced import coordinates
from jaxcrusher.orbits.oscillation import about_means
from jaxcrusher.orbits.result import RESULTS

# Turns of the first round, half of which make a mean: a multiple of all periods up to six. Each
# round lasts as long as all before it. They are integrated in pieces, between which the steps are
# counted; half a piece is a multiple of all periods up to four.
TURNS, PIECE = 240, 24
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
# How far a disturbance is from a motion, in clearances and m/s, at first.
APART = 1e-5
# Names of motions that repeat after so many turns, and of all longer ones.
REPEATS = (*(getattr(RESULTS, f"repeats_{n}") for n in range(1, 5)), RESULTS.repeats_late)

_LOG = logging.getLogger(__name__)

# A section point, and the scene that moves from it.
SceneAt = tuple[Float[Array, " dims"], Scene]


def section_points(
    case: SceneAt, *, turns: int, rtol: float
) -> tuple[Float[Array, "turns dims"], Outcome]:
    """Return those of the next turns from a state, and how they ended.

    One integration: in lanes designs do not wait for each other at each turn's end.
    """
    state, scene = case
    states, _, outcome = by_turns(scene, state, turns, (), resolve(scene, rtol))
    return states, outcome


# What is jitted in a module cannot be pickled.
piece = eqx.filter_jit(eqx.Partial(section_points, turns=PIECE, rtol=WAIT_RTOL))


def resting_start(scene: Scene) -> SceneAt:
    """Return the scene with its pins resting in their bores, whatever its own start."""
    if not scene.is_ideal:
        scene = eqx.tree_at(lambda s: s.start, scene, InContact())
    return initial_state(scene), scene


def section_mean(case: SceneAt, *, period: int) -> Float[Array, " dims"]:
    """Return the mean section point of some hundred turns, `period` apart."""
    states, _ = section_points(case, turns=TURNS, rtol=WAIT_RTOL)
    return about_means(states[TURNS // 2 :], period)[0][-1]


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


_one_period = eqx.filter_jit(one_period)


def whirls_next(case: SceneAt, most: int | None = None) -> tuple[Bool[Array, ""], Outcome]:
    """Return whether the next two turns whirl, in so many steps a turn, and how they ended."""
    state, scene = case
    outputs, method = of_whirl(scene), Method(max_steps=most)
    seen = statistics(scene, 0, 2, outputs=outputs, state=state, rtol=WAIT_RTOL, method=method)
    return seen.whirl, seen.outcome


def growth_of(
    end: Float[np.ndarray, "*cases dims"], beside: Float[np.ndarray, "*cases dims"]
) -> Float[np.ndarray, "*cases"] | np.float64:
    """Return the logarithm of what a disturbance grows by in a turn (Benettin 1980).

    It is that of motions whose `PIECE` turns end so, and which began `APART`. Of those that are as
    far from each other as they come it is at least 0.3.
    """
    return np.log(np.linalg.norm(beside - end, axis=-1) / APART) / PIECE


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

    def means(self, period: int | None) -> Iterator[tuple[int, Float[Array, " dims"]]]:
        """Yield numbers of turns and the mean of section points so far apart.

        Without a `period` that is 1, and the least up to `LONGEST` about whose means the motion
        is clearly narrower.
        """
        enough = NARROWER * self._spread(1)
        longer = next((p for p in range(2, LONGEST + 1) if self._spread(p) < enough), 1)
        for turns in sorted({1, longer}) if period is None else (period,):
            yield turns, jnp.asarray(about_means(self.states, turns)[0][-1])

    def repeats_after(self) -> int | None:
        """Return the least number of turns after which the last points repeat."""
        states = self.states[-TURNS // 2 :]
        return indicators.detect_period(states, tolerance=0.0, noise=REPEATED)

    def _spread(self, period: int) -> float:
        return float(np.sqrt(np.mean(about_means(self.states, period)[1] ** 2)))


class Wait:
    """The motion of a scene from its pins at rest, waited for as far as it is asked for.

    It is integrated in pieces of whole turns, within an effort.
    """

    def __init__(self, scene: Scene, spent: Spent) -> None:
        self._own, self.spent = scene, spent
        self._ended: Array | None = None  # the state after all turns so far
        self._last: Round | None = None
        self._end: RESULTS | None = None  # why no further turns lead to an orbit

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
        """Return whether the next two turns whirl, as `whirls_next` does."""
        whirls, outcome = whirls_next((state, self._begun[1]), most)
        return bool(whirls), outcome

    def one_period(
        self, state: Array, turns: int
    ) -> tuple[Float[Array, "angles half"], Bool[Array, ""]]:
        """Return e / c over so many turns from a section point, as `one_period` does."""
        return _one_period((state, self._begun[1]), period=turns)

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
            if self._ends() is not None:
                return
            _LOG.info("waiting: turns %d to %d from rest", turn * TURNS + 1, (turn + 1) * TURNS)
            while len(seen) < (turn + 1) * TURNS and self.spent.affords(2 * PIECE):
                begun = self._state
                states, outcome = self.piece(begun)
                if not bool(outcome.success):
                    self._end = RESULTS.not_integrated
                    return
                self.spent.integrated(outcome, PIECE)
                self.spent.turns += PIECE
                seen, self._ended = np.concatenate([seen, states]), states[-1]
            ends = not self.spent.affords(2 * PIECE)
            if len(seen) and (turn & (turn + 1) == 0 or ends):  # a power of two, or the last
                growth = self.growth(begun, seen[-1])
                self._last = Round(seen[len(seen) // 2 :], growth)
                yield self._last
                # Chaos of the first round may be of a transient.
                ends |= self._last.chaotic and turn > 0
            if ends:
                return

    def told(self) -> str:
        """Say what was tried, and after turns that were waited for what the motion does."""
        motion = f"{words(RESULTS, self.regime(RESULTS.aperiodic))} " if self.spent.turns else ""
        return f"{motion}{self.spent}"

    def regime(self, otherwise: RESULTS) -> RESULTS:
        """Name what the motion does that has no orbit."""
        if (end := self._ends()) is not None:
            return end
        return otherwise if self._last is None else self._last.motion()

    def growth(self, begun: Array, end: Float[np.ndarray, " dims"]) -> float:
        """Return by `growth_of` what a disturbance grows by in a piece that begins and ends so."""
        beside, outcome = self.piece(begun + APART / np.sqrt(begun.size))
        self.spent.integrated(outcome, PIECE)
        return float(growth_of(end, np.asarray(beside)[-1]))

    def _ends(self) -> RESULTS | None:
        """Tell why a wait ends: the next two turns whirl, fail or are too long."""
        if self._end is not None:
            return self._end
        bounds = self.spent.bounds
        # More steps a turn leave no piece of turns within the bound.
        most = int(bounds.steps / PIECE) if bounds.bounded else None
        whirls, outcome = self.whirls_next(self._state, most)
        self.spent.integrated(outcome, 2)
        if not bool(outcome.success):
            long = bool(outcome.result == integration.RESULTS.max_steps_reached)
            self._end = RESULTS.too_long if long else RESULTS.not_integrated
        elif whirls:
            self._end = RESULTS.whirl
        return self._end

"""A motion that is waited for: guesses of its periodic orbit, and what it does if it has none.

A swing of the pin dies in thousands of turns. The mean over some hundred turns removes it, and
leaves a guess from which Newton's method converges.
"""

import functools
import itertools
import logging
from collections.abc import Iterator
from dataclasses import dataclass

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Scalar

from jaxcrusher.basics.integrate import integrate
from jaxcrusher.mechanism.scene import AbstractScene
from jaxcrusher.mechanism.starts import InContact
from jaxcrusher.motion.flow import Flow, flat, initial_state, unflattened
from jaxcrusher.motion.indicators import CHAOS, detect_period, lyapunov_spectrum
from jaxcrusher.motion.method import resolve
from jaxcrusher.motion.section import poincare_section
from jaxcrusher.motion.statistics import of_whirl, statistics_problem
from jaxcrusher.motion.tangents import SLICES, same, tangents
from jaxcrusher.orbits.forced import coordinates
from jaxcrusher.orbits.result import RESULTS

# Turns of the first round, half of which make a mean: a multiple of all periods up to six. Each
# round lasts as long as all before it, and 1920 turns take a second.
TURNS, ROUNDS, QUICK_ROUNDS = 240, 4, 2
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
# Turns over which a disturbance is followed.
GROWN = 24

# An orbit is the mean of a swing if it is no further from it, as a share of its spread and in
# clearances.
ABOUT, NEAR = 0.25, 1e-3

_LOG = logging.getLogger(__name__)

# A section point, and the scene that moves from it.
SceneAt = tuple[Float[Array, " dims"], AbstractScene]


def section_points(
    case: SceneAt, *, turns: int, rtol: float
) -> tuple[Float[Array, "turns dims"], Bool[Array, ""]]:
    """Return those of the next turns from a state, and whether the integration succeeded.

    One integration: in lanes designs do not wait for each other at each turn's end.
    """
    return _states(case, 2 * np.pi * np.arange(1, turns + 1), rtol)


def _states(
    case: SceneAt, phases: Float[np.ndarray, " n"], rtol: float
) -> tuple[Float[Array, "n dims"], Bool[Array, ""]]:
    """Return states at phases after a section point, and whether the run succeeded."""
    state, scene = case
    flow, method = Flow(scene, unflattened(state, scene)), resolve(scene, rtol)
    (states, _), outcome = integrate(
        flow, jnp.asarray(phases)[:, None], problem=statistics_problem(()), method=method
    )
    return jax.vmap(lambda one: flat(one, scene))(states), outcome.success


def resting_start(scene: AbstractScene) -> SceneAt:
    """Return the scene with its pins resting in their bores, whatever its own start."""
    if not scene.is_ideal:
        scene = eqx.tree_at(lambda s: s.start, scene, InContact())
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
    return mean, jnp.sqrt(jnp.mean((states - mean) ** 2)), success


def one_period(
    case: SceneAt, *, period: int
) -> tuple[Float[Array, "angles half"], Bool[Array, ""]]:
    """Return e / c at equal steps of phase over `period` turns from a section point.

    With it comes whether the integration succeeded.
    """
    steps = 2 * np.pi * np.arange(1, ANGLES * period) / ANGLES
    states, success = _states(case, steps, WAIT_RTOL)
    states, scene = jnp.concatenate([case[0][None], states]), case[1]
    return jax.vmap(lambda one: _coordinates(one, scene))(states), success


def _coordinates(section: Float[Array, " dims"], scene: AbstractScene) -> Float[Array, " half"]:
    state = unflattened(section, scene)
    assert state is not None
    return coordinates(state)


def places(
    states: Float[np.ndarray, "*turns dims"], joints: int
) -> Float[np.ndarray, "*turns half"]:
    """Return the eccentricities of section points, which begin with four numbers a loose joint."""
    of_joints = states[..., : 4 * joints].reshape(*states.shape[:-1], joints, 4)
    return of_joints[..., :2].reshape(*states.shape[:-1], 2 * joints)


def allowed(spread: float) -> float:
    """Return how far an orbit may be from the mean of a swing about it, both in clearances."""
    return max(ABOUT * spread, NEAR)


_points, one_period = eqx.filter_jit(section_points), eqx.filter_jit(one_period)


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

    def swings_about(self, section: Array, joints: int) -> bool:
        """Tell whether the pins of so many loose joints swing about an orbit's section point."""
        pins = places(self.states, joints)
        middle = pins.mean(axis=0)
        spread = float(np.sqrt(np.mean((pins - middle) ** 2)))
        apart = middle - places(np.asarray(section), joints)
        return float(np.sqrt(np.mean(apart**2))) < allowed(spread)

    def repeats_after(self) -> int | None:
        """Return the least number of turns, up to `LONGEST`, after which the points repeat."""
        return detect_period(self.states, longest=LONGEST, tolerance=0.0, noise=REPEATED)

    def _spread(self, period: int) -> float:
        parts = self.states.reshape(-1, period, self.states.shape[1])
        return float(np.sqrt(np.mean((parts - parts.mean(axis=0)) ** 2)))


class Wait:
    """A motion from the pins at rest, waited for in so many rounds, as far as it is asked for."""

    def __init__(self, scene: AbstractScene, rounds: int = ROUNDS) -> None:
        self._own, self._rounds = scene, rounds
        self._ended: Array | None = None  # the state after all turns so far
        self._last: Round | None = None
        self._failed = self._chaotic = False

    # Most orbits need no wait.
    @functools.cached_property
    def _start(self) -> SceneAt:
        return resting_start(self._own)

    @property
    def scene(self) -> AbstractScene:
        """Return the scene that is waited for, with its pins at rest."""
        return self._start[1]

    @property
    def _state(self) -> Array:
        return self._start[0] if self._ended is None else self._ended

    def rounds(self) -> Iterator[Round]:
        """Yield the last half of more and more turns.

        They end where the motion fails or whirls, and after the second round where it is chaotic.
        """
        seen: list[np.ndarray] = []
        last = 2 ** (self._rounds - 1) - 1
        for turn in range(last + 1):
            if self._whirls():
                return
            case = self._state, self.scene
            _LOG.info("waiting: turns %d to %d from rest", turn * TURNS + 1, (turn + 1) * TURNS)
            states, success = _points(case, turns=TURNS, rtol=WAIT_RTOL)
            self._failed = not bool(success)
            if self._failed:
                return
            seen.append(np.asarray(states))
            self._ended, count = states[-1], turn + 1
            if count & turn == 0:  # a power of two
                # Half a second each: before what would be in vain, and at the end for its name.
                self._chaotic = turn in (0, 1, last) and self._growth() > CHAOS
                half = np.concatenate(seen)[count * TURNS // 2 :]
                self._last = Round(half, self._chaotic)
                yield self._last
                if self._chaotic and turn > 0:
                    return

    def regime(self, otherwise: RESULTS) -> RESULTS:
        """Name what the motion does that has no orbit."""
        if self._failed:
            return RESULTS.not_integrated
        if self._whirls():
            return RESULTS.whirl
        if self._last is None:
            return otherwise
        if Round(self._last.states[-TURNS // 2 :]).repeats_after() is not None:
            return RESULTS.repeats
        if self._chaotic:
            return RESULTS.chaotic
        return RESULTS.aperiodic if self._rounds == ROUNDS else RESULTS.open_end

    def _whirls(self) -> bool:
        seen = poincare_section(
            self.scene, 0, 2, state=self._state, outputs=of_whirl(self.scene), rtol=WAIT_RTOL
        )
        return bool(seen.success) and bool(seen.statistics.whirl)

    def _growth(self) -> float:
        """Return the logarithm of what a disturbance grows by in a turn (Benettin 1980)."""
        build = eqx.Partial(same, scene=self.scene)
        along = tangents(build, jnp.zeros(0), self.scene.leading, self._state, GROWN, WAIT_RTOL)
        exponents = lyapunov_spectrum(along.jacobians, slices=SLICES, discard=0.0).exponents
        return float(exponents[0])

"""Guesses of a periodic orbit from a motion that is waited for.

A swing of the pin dies in thousands of turns. The mean over some hundred turns removes it, and
leaves a guess from which Newton's method converges.
"""

from collections.abc import Iterator

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from jaxcrusher.crusher.scene import Scene
from jaxcrusher.crusher.starts import InContact
from jaxcrusher.motion.flow import Flow, flat, initial_state, unflattened
from jaxcrusher.motion.integrate import integrate
from jaxcrusher.motion.method import resolve
from jaxcrusher.motion.statistics import statistics_problem
from jaxcrusher.orbits.forced import coordinates

# Turns that pass before each mean, turns of a mean, and means that are tried. Turns of a mean are a
# multiple of all periods up to six.
SETTLE, TURNS, ROUNDS = 150, 120, 3
# The integration's tolerance: at 1e-6 the swing dies twice as fast as it should.
RTOL = 1e-7
# Shaft angles a turn at which the motion from a mean is looked at.
ANGLES = 96

# A section point, and the scene that moves from it.
Case = tuple[Float[Array, " dims"], Scene]


def section_points(
    case: Case, *, turns: int, rtol: float
) -> tuple[Float[Array, "turns dims"], Bool[Array, ""]]:
    """Return those of the next turns from a state, and whether the integration succeeded.

    One integration: in lanes designs do not wait for each other at each turn's end.
    """
    return _states(case, 2 * np.pi * np.arange(1, turns + 1), rtol)


def _states(
    case: Case, angles: Float[np.ndarray, " n"], rtol: float
) -> tuple[Float[Array, "n dims"], Bool[Array, ""]]:
    """Return states at shaft angles after a section point, and whether the run succeeded."""
    state, scene = case
    flow, method = Flow(scene, unflattened(state, scene)), resolve(scene, rtol)
    (states, _), outcome = integrate(
        flow, jnp.asarray(angles)[:, None], problem=statistics_problem(()), method=method
    )
    return jax.vmap(lambda one: flat(one, scene))(states), outcome.success


def resting_start(scene: Scene) -> Case:
    """Return the scene with its pins resting in their bores, whatever its own start."""
    if not scene.is_ideal:
        scene = eqx.tree_at(lambda s: s.start, scene, InContact())
    return initial_state(scene), scene


def section_mean(
    case: Case, *, period: int
) -> tuple[Float[Array, " dims"], Float[Array, " dims"], Bool[Array, ""]]:
    """Return the mean section point of some hundred turns, `period` apart, and the last state.

    With them comes whether the integration succeeded.
    """
    states, success = section_points(case, turns=SETTLE + TURNS, rtol=RTOL)
    return jnp.mean(states[SETTLE + period - 1 :: period], axis=0), states[-1], success


def one_period(case: Case, *, period: int) -> tuple[Float[Array, "angles half"], Bool[Array, ""]]:
    """Return e / c at equal steps of shaft angle over `period` turns from a section point.

    With it comes whether the integration succeeded.
    """
    steps = 2 * np.pi * np.arange(1, ANGLES * period) / ANGLES
    states, success = _states(case, steps, RTOL)
    states, scene = jnp.concatenate([case[0][None], states]), case[1]
    return jax.vmap(lambda one: _coordinates(one, scene))(states), success


def _coordinates(section: Float[Array, " dims"], scene: Scene) -> Float[Array, " half"]:
    state = unflattened(section, scene)
    assert state is not None
    return coordinates(state)


_mean, _period = eqx.filter_jit(section_mean), eqx.filter_jit(one_period)


def guesses(
    scene: Scene, period: int
) -> Iterator[tuple[Float[Array, " dims"], Float[Array, "angles half"]]]:
    """Yield mean section points over later and later turns, and the motion over a period from each.

    They end where the motion fails.
    """
    state, scene = resting_start(scene)
    for _ in range(ROUNDS):
        mean, state, success = _mean((state, scene), period=period)
        if not bool(success):
            return
        seen, success = _period((mean, scene), period=period)
        if bool(success):
            yield mean, seen

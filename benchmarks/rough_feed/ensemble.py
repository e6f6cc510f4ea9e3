"""Motions under many random feeds, beside the linear response of their orbit."""

import dataclasses
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

import jaxcrusher as jc
from jaxcrusher.batch.engines import stack
from jaxcrusher.crusher.rough_feed import RoughFeed, rough_feed
from jaxcrusher.orbits.feed_response import linearised

# Sets of orders, pairs of opposite phases of each, turns of each motion, instants of each turn.
SETS, PAIRS, TURNS, INSTANTS = 8, 20, 4, 256


class Fed(NamedTuple):
    """A feed, and the response (x, x') to it at shaft angle zero, both for a scatter of one."""

    feed: RoughFeed
    start: np.ndarray


def feeds(orbit: jc.PeriodicOrbit) -> list[Fed]:
    """Return random feeds; a motion that starts on its response has no swing left of a start."""
    modes = linearised(orbit).modes
    begin = eqx.filter_jit(lambda order: modes.responses(order, np.zeros(1))[0, :-1, 0])
    random, found = np.random.default_rng(0), []
    load = orbit.scene.load
    assert isinstance(load, RoughFeed)
    for number in range(SETS):
        made = rough_feed(load.load, 1.0, load.bandwidth, number)
        responses = np.stack([np.asarray(begin(one)) for one in made.places * made.bandwidth])
        for phases in random.uniform(0, 2 * np.pi, (PAIRS, len(made.phases))):
            start = np.sqrt(2 / len(phases)) * (np.exp(1j * phases) @ responses).real
            for turned, sign in ((0, 1), (np.pi, -1)):
                feed = dataclasses.replace(made, phases=jnp.asarray(phases + turned))
                found.append(Fed(feed, sign * start))
    return found


def _run(case: tuple[jc.Scene, jax.Array], times: np.ndarray) -> tuple[jax.Array, jax.Array]:
    scene, state = case
    seen = ("foundation_force", "penetration_ratio")
    motion = jc.simulate(scene, times, outputs=seen, state=state, rtol=1e-8)
    return motion.foundation_force, motion.penetration_ratio


def compared(orbit: jc.PeriodicOrbit, random: list[Fed], scatter: float) -> list[str]:
    """Return what the ensemble gives, with its standard error, and what was predicted."""
    scene = eqx.tree_at(lambda s: s.load.scatter, orbit.scene, jnp.asarray(scatter))
    told = jc.feed_response(dataclasses.replace(orbit, scene=scene))
    joint, speed = orbit.scene.joint, float(orbit.scene.drive.speed)
    assert joint is not None
    units = np.repeat([1.0, float(joint.clearance) * speed], 2)
    cases = []
    for feed, start in random:
        rough = dataclasses.replace(feed, scatter=jnp.asarray(scatter))
        state = np.asarray(orbit.section) + scatter * units * start
        cases.append((dataclasses.replace(orbit.scene, load=rough), jnp.asarray(state)))
    times = 2 * np.pi * np.arange(TURNS * INSTANTS) / INSTANTS / speed
    force, depth = jc.map_all(eqx.Partial(_run, times=times), stack(cases))
    force = force.reshape(len(random), TURNS, INSTANTS)
    quiet = 2 * np.pi * np.arange(INSTANTS) / INSTANTS
    still = np.asarray(orbit.motion(quiet, ("foundation_force",))["foundation_force"])

    def pair(values: np.ndarray) -> np.ndarray:
        """Of opposite phases, which are not independent, the mean."""
        return values.reshape(-1, 2).mean(axis=1)

    def with_error(values: np.ndarray) -> tuple[float, float]:
        return values.mean(), values.std(ddof=1) / np.sqrt(len(values))

    squares, error = with_error(pair(np.mean((force - still) ** 2, axis=(1, 2))))
    deviation = np.sqrt(squares)
    by_turn = np.sqrt(np.mean(force**2, axis=2))
    turn, turn_error = with_error(pair(np.mean((by_turn - by_turn.mean()) ** 2, axis=1)))
    whole, whole_error = with_error(pair(np.mean(force**2, axis=(1, 2))))
    rms = float(orbit.foundation_rms)
    shift, shift_error = np.sqrt(whole) - rms, whole_error / (2 * rms)
    lost = np.mean(np.min(depth.reshape(force.shape), axis=2) < 0)
    predicted = np.sqrt(np.mean(np.asarray(told.force) ** 2))
    return [
        f"{deviation:.0f} ± {error / (2 * deviation):.0f}",
        f"{predicted:.0f}",
        f"{np.sqrt(turn):.0f} ± {turn_error / (2 * np.sqrt(turn)):.0f}",
        f"{float(told.rms):.0f}",
        f"{shift:.1f} ± {shift_error:.1f}",
        f"{float(told.expected_rms) - rms:.1f}",
        f"{lost:.2%}",
        f"{float(told.chance):.1g}",
    ]

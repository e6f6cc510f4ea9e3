"""The tries by which the orbit of a scene with known values is searched for, one after the other.

1. Newton's method from the guess, or from the pins at rest and by way of a damping. The damping
   leads to the quietest of several motions: the motion from rest is looked at, and goes before.
2. Shooting from the guess's section point, and without a guess: rest.
3. Rest with twice the nodes, and shooting from what nodes do not resolve.
4. Turns that are waited for from rest: their mean, by nodes and by shooting.

The first stable orbit is the answer. Under `jax.jit` the first try is all: see
`jaxcrusher.orbits.solving`.
"""

import dataclasses
from collections.abc import Iterator
from typing import NamedTuple

import jax
import numpy as np
from jaxtyping import Array

from jaxcrusher.basics.checks import concrete
from jaxcrusher.crusher.scene import Scene
from jaxcrusher.motion.section import poincare_section
from jaxcrusher.orbits.result import RESULTS, WAYS, PeriodicOrbit, without_slopes
from jaxcrusher.orbits.shooting import shoot
from jaxcrusher.orbits.solving import MOST_NODES, NODES, SETTLED, solved, with_statistics
from jaxcrusher.orbits.transient import Round, Wait, one_period

# Of the orbit integrated once round, in clearances and m/s, and the tolerance of doing so.
CLOSURE, RTOL = 1e-6, 1e-11


class Try(NamedTuple):
    """An orbit with the slopes of its scene, None where nobody knows them, and its values."""

    sloped: PeriodicOrbit | None
    orbit: PeriodicOrbit


def searched(
    scene: Scene,
    still: Scene,
    guess: Array | None,
    section: Array | None,
    period: int | None,
    nodes: int | None,
) -> PeriodicOrbit:
    """Return the stable orbit of a scene whose values `still` are known.

    Without one the first that is unstable; where there is none, why, and what the motion does
    instead. `section` is the section point of a guess, which may lose contact. A `period` of None
    is 1, or else what the motion that is waited for repeats after.
    """
    wait, found = Wait(still), []
    if nodes is None:
        tries = _tries(scene, still, guess, section, period, wait)
    else:
        tries = iter([_by_nodes(scene, still, guess, period or 1, nodes, nodes)])
    for one in tries:
        found.append(one)
        if bool(one.orbit.stable) or _is_stiff(one):
            break
    first = next((one for one in found if bool(one.orbit.success)), found[0])
    chosen = found[-1] if bool(found[-1].orbit.stable) else first
    orbit = chosen.orbit
    if nodes is None and not bool(orbit.success):
        orbit = dataclasses.replace(orbit, result=wait.regime(orbit.result))
    if not any(concrete(leaf) is None for leaf in jax.tree.leaves(scene)):
        return orbit
    if chosen.sloped is None or not bool(orbit.success):
        return without_slopes(orbit, scene)
    return chosen.sloped


def _tries(
    scene: Scene,
    still: Scene,
    guess: Array | None,
    section: Array | None,
    period: int | None,
    wait: Wait,
) -> Iterator[Try]:
    """Yield what each try comes to, cheap ones first."""
    turns = period or 1

    def nodes(guess: Array | None, count: int = NODES, turns: int = turns) -> Try:
        return _by_nodes(scene, still, guess, turns, count, MOST_NODES)

    def shots(start: Array, turns: int = turns) -> Iterator[Try]:
        """Yield a shot, and where it keeps contact the nodes there, which have slopes."""
        shot = shoot(still, start, turns)
        if bool(shot.least_penetration > 0):
            yield _found(nodes(shot.eccentricity, 2 * NODES, turns), WAYS.shooting)
        yield Try(None, shot)

    def waited(rest: Round) -> Iterator[Try]:
        """Yield what the means of turns lead to."""
        for turns, mean in rest.means(period):
            seen, success = one_period((mean, wait.scene), period=turns)
            if bool(success):
                yield _found(nodes(seen, turns=turns), WAYS.waiting)
            yield from shots(mean, turns)

    first, rounds = nodes(guess), wait.rounds()
    if turns == 1 and bool(first.orbit.stable) and bool(first.orbit.way == WAYS.damping):
        rest = next(rounds, None)
        if rest is not None and not rest.swings_about(first.orbit.section, still.joints.count):
            yield from waited(rest)
    yield first
    if section is not None:
        yield from shots(section)
    if guess is not None:
        yield nodes(None)
    yield nodes(None, 2 * NODES)
    if _is_unresolved(first.orbit):
        # What Newton's method converged to is near the orbit that loses contact.
        yield from shots(first.orbit.section)
    for rest in rounds:
        yield from waited(rest)


def _found(one: Try, way: WAYS) -> Try:
    """Say by which way a guess came about."""
    assert one.sloped is not None
    return Try(dataclasses.replace(one.sloped, way=way), dataclasses.replace(one.orbit, way=way))


def _by_nodes(
    scene: Scene, still: Scene, guess: Array | None, period: int, count: int, most: int
) -> Try:
    """Return the orbit with as many nodes a turn as it needs, from `count` to `most`.

    Once with the slopes of `scene`, and once with the values of `still` that tell how good it is.
    """
    way = None
    while True:
        found, factors = solved(still, guess, period, count * period)
        way = found.way if way is None else way
        found = dataclasses.replace(found, way=way)
        sloped = with_statistics(scene, found, factors, period)
        orbit = jax.lax.stop_gradient(sloped)
        if concrete(orbit.error) is None:  # slopes by several numbers at once hide the values
            orbit = with_statistics(still, found, factors, period)
        closed = not bool(orbit.success) or _is_closed(orbit)
        if count >= most or (closed and not _wants_nodes(orbit)):
            break
        guess, count = orbit.eccentricity, 2 * count
    return Try(sloped, orbit if closed else dataclasses.replace(orbit, result=RESULTS.not_closed))


def _is_unresolved(orbit: PeriodicOrbit) -> bool:
    """Whether Newton's method converged to what the nodes do not resolve."""
    return bool((orbit.result == RESULTS.contact_lost) | (orbit.result == RESULTS.unresolved))


def _is_stiff(one: Try) -> bool:
    """Whether springs swing too fast for the nodes to tell multipliers; a wait takes minutes."""
    known = bool(one.orbit.multipliers_error < 1)
    return one.sloped is not None and bool(one.orbit.success) and not known


def _wants_nodes(orbit: PeriodicOrbit) -> bool:
    """Whether more nodes may help."""
    return _is_unresolved(orbit) or (bool(orbit.success) and not float(orbit.error) <= SETTLED)


def _is_closed(orbit: PeriodicOrbit) -> bool:
    """Whether the integrator comes back to where it set out."""
    state = orbit.section
    end = poincare_section(orbit.scene, 0, orbit.period, state=state, rtol=RTOL)
    apart = np.max(np.abs(np.asarray(end.states)[-1] - np.asarray(state)))
    return bool(end.success) and bool(apart < CLOSURE)

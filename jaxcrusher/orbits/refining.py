"""Orbits of scenes whose numbers are known, refined until they can be trusted.

Nodes are added, the orbit is closed by integration, and what collocation does not find is shot
for or waited for. Under `jax.jit` nothing of this is done: see `jaxcrusher.orbits.solving`.
"""

import dataclasses
import itertools
from collections.abc import Iterator

import jax
import numpy as np
from jaxtyping import Array

from jaxcrusher.basics.checks import concrete
from jaxcrusher.crusher.scene import Scene
from jaxcrusher.motion.section import poincare_section
from jaxcrusher.orbits.result import RESULTS, PeriodicOrbit, without_slopes
from jaxcrusher.orbits.shooting import shoot
from jaxcrusher.orbits.solving import (
    MOST_NODES,
    NODES,
    SETTLED,
    solved,
    with_statistics,
)
from jaxcrusher.orbits.transient import guesses

# Of the orbit integrated once round, in clearances and m/s, and the tolerance of doing so.
CLOSURE, RTOL = 1e-6, 1e-11


def refined(
    scene: Scene,
    still: Scene,
    guess: Array | None,
    section: Array | None,
    period: int,
    nodes: int | None,
) -> PeriodicOrbit:
    """Return the orbit of a scene whose values `still` are known.

    `section` is the section point of a guess, which may lose contact. Where all tries fail, the
    first one says why.
    """
    first = _collocated(scene, still, guess, period, nodes)
    further = () if nodes else _further(scene, still, first[1], section, period)
    tries = itertools.chain([first], further)
    sloped, orbit = next((one for one in tries if bool(one[1].success)), first)
    if not any(concrete(leaf) is None for leaf in jax.tree.leaves(scene)):
        return orbit
    if sloped is None or not bool(orbit.success):
        return without_slopes(orbit, scene)
    return sloped


def _further(
    scene: Scene, still: Scene, failed: PeriodicOrbit, section: Array | None, period: int
) -> Iterator[tuple[PeriodicOrbit | None, PeriodicOrbit]]:
    """Try what is left where collocation fails: shooting, and a motion that is waited for."""
    if section is not None:
        yield None, shoot(still, section, period)
    if _is_unresolved(failed):
        # What Newton's method converged to is near the orbit that loses contact.
        yield None, shoot(still, failed.section, period)
    for mean, seen in guesses(still, period):
        yield _collocated(scene, still, seen, period, None)
        yield None, shoot(still, mean, period)


def _collocated(
    scene: Scene, still: Scene, guess: Array | None, period: int, nodes: int | None
) -> tuple[PeriodicOrbit, PeriodicOrbit]:
    """Return the orbit with as many nodes as it needs, or with as many as are given.

    Once with the slopes of `scene`, and once with the values of `still` that tell how good it is.
    """
    count = nodes or NODES
    while True:
        found = solved(still, guess, period, count * period)
        sloped = with_statistics(scene, *found, period)
        orbit = jax.lax.stop_gradient(sloped)
        if concrete(orbit.error) is None:  # slopes by several numbers at once hide the values
            orbit = with_statistics(still, *found, period)
        closed = not bool(orbit.success) or _is_closed(orbit)
        if nodes is not None or count >= MOST_NODES or (closed and not _wants_nodes(orbit)):
            break
        guess, count = orbit.eccentricity, 2 * count
    return sloped, orbit if closed else dataclasses.replace(orbit, result=RESULTS.not_closed)


def _is_unresolved(orbit: PeriodicOrbit) -> bool:
    """Whether Newton's method converged to what the nodes do not resolve."""
    return bool((orbit.result == RESULTS.contact_lost) | (orbit.result == RESULTS.unresolved))


def _wants_nodes(orbit: PeriodicOrbit) -> bool:
    """Whether more nodes may help."""
    return _is_unresolved(orbit) or (bool(orbit.success) and not float(orbit.error) <= SETTLED)


def _is_closed(orbit: PeriodicOrbit) -> bool:
    """Whether the integrator comes back to where it set out."""
    state = orbit.section
    end = poincare_section(orbit.scene, 0, orbit.period, state=state, rtol=RTOL)
    apart = np.max(np.abs(np.asarray(end.states)[-1] - np.asarray(state)))
    return bool(end.success) and bool(apart < CLOSURE)

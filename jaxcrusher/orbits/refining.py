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
from jaxcrusher.orbits.newton import Factors
from jaxcrusher.orbits.result import RESULTS, PeriodicOrbit, without_slopes
from jaxcrusher.orbits.shooting import shoot
from jaxcrusher.orbits.solving import (
    MOST_NODES,
    NODES,
    SETTLED,
    Nodes,
    solved,
    with_statistics,
)
from jaxcrusher.orbits.transient import guesses

# Of the orbit integrated once round, in clearances and m/s, and the tolerance of doing so.
CLOSURE, RTOL = 1e-6, 1e-11

_Found = tuple[Nodes, Factors]


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
    first = _collocated(still, guess, period, nodes)
    further = () if nodes else _further(still, first[1], section, period)
    tries = itertools.chain([first], further)
    found, orbit = next((one for one in tries if bool(one[1].success)), first)
    if not any(concrete(leaf) is None for leaf in jax.tree.leaves(scene)):
        return orbit
    if found is None or not bool(orbit.success):
        return without_slopes(orbit, scene)
    return with_statistics(scene, *found, period)


def _further(
    scene: Scene, failed: PeriodicOrbit, section: Array | None, period: int
) -> Iterator[tuple[_Found | None, PeriodicOrbit]]:
    """Try what is left where collocation fails: shooting, and a motion that is waited for."""
    if section is not None:
        yield None, shoot(scene, section, period)
    if _is_unresolved(failed):
        # What Newton's method converged to is near the orbit that loses contact.
        yield None, shoot(scene, failed.section, period)
    for mean, seen in guesses(scene, period):
        yield _collocated(scene, seen, period, None)
        yield None, shoot(scene, mean, period)


def _collocated(
    scene: Scene, guess: Array | None, period: int, nodes: int | None
) -> tuple[_Found, PeriodicOrbit]:
    """Return the orbit with as many nodes as it needs, or with as many as are given."""
    count = nodes or NODES
    while True:
        found = solved(scene, guess, period, count * period)
        orbit = with_statistics(scene, *found, period)
        closed = not bool(orbit.success) or _is_closed(orbit)
        if nodes is not None or count >= MOST_NODES or (closed and not _wants_nodes(orbit)):
            break
        guess, count = orbit.eccentricity, 2 * count
    return found, orbit if closed else dataclasses.replace(orbit, result=RESULTS.not_closed)


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

"""The search for the orbit of a scene with known values: attempts, one after the other.

1. Newton's method by nodes from the guess, or from the pins at rest and by continuation in a
   damping. The damping leads to the quietest of several motions: the motion from rest is checked,
   and goes before.
2. Section points: of the guess, and then means of turns integrated from rest, unless these are
   chaotic. Newton's method, with differences of turns, leads to a section point that repeats. Its
   orbit is solved for by nodes and, where it loses contact, by shooting.
3. The section point of a motion that nodes do not resolve.

Where a try leads to an unstable orbit whose period has doubled, the orbit of twice the turns is
searched for beside it. The first stable orbit is the answer. An unbounded effort takes the third
try before it integrates from rest. Under `jax.jit` there is only the first try: see
`jaxcrusher.orbits.solving`.

A search asks for its turns, so that turns of many searches are integrated at once
(`jaxcrusher.dynamics.searches`): the search for one orbit and for many is the same.
"""

import dataclasses
import itertools
import logging
from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Scalar

from jaxcrusher.basics.checks import concrete, is_concrete, without_slopes
from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.mechanism.state import pins_of
from jaxcrusher.orbits.effort import Budget
from jaxcrusher.orbits.forced import can_be_shot, pins, remembers, unknowns
from jaxcrusher.orbits.oscillation import NEAR, about_means, oscillation_about
from jaxcrusher.orbits.result import RESULTS, WAYS, PeriodicOrbit, missing
from jaxcrusher.orbits.shot import ORBIT_RTOL, closed, integrated_multipliers, orbit_through
from jaxcrusher.orbits.solving import NODES, SETTLED, Nodes, orbit_nodes, with_statistics
from jaxcrusher.orbits.transient import (
    TRANSIENT_RTOL,
    TURNS,
    Followed,
    Lone,
    Round,
    Transient,
    followed,
    resting,
    resting_start,
    section_points,
)
from jaxcrusher.periodic.multipliers import UNSURE
from jaxcrusher.periodic.newton import Root, advanced, first_iterate
from jaxcrusher.periodic.trigonometric import resample

# Distances in clearances from an unstable orbit, at which that of twice the turns is searched for.
# Where |mu| is 1.0004 to 1.01 the first one leads there.
BESIDE = (0.01, 0.003, 0.03, 0.1)
# How near the orbit that is integrated once round comes to its beginning, in clearances and m/s.
COMES_BACK = 1e-6
# An orbit with this estimate is not integrated. At 130 orbits of drawn crushers the integrated
# closure was at most 1.7 times the estimate, where it was above 1e-7.
SURELY_CLOSED = 1e-7
# Turns of a transient that cost as much as shooting for a period of one turn.
SHOT = 300
# Differences of turns are over twice this shift of a section point, in clearances and m/s; their
# tolerance of 1e-8 leaves 1e-4 of a slope. Newton's last step, from where nodes or shooting go on.
DIFFERENCE, NEAR_ENOUGH = 1e-4, 1e-5
# Points that it looks at, at most, and the shortest share of its steps: where multipliers are all
# but one it goes by short ones for a while.
LOOKS, LEAST_SHARE = 24, 0.01

# Tells each try as it begins, for a program that shows how far it is.
_LOG = logging.getLogger(__name__)


class Attempt(NamedTuple):
    """An orbit with the slopes of its scene, and its values alone."""

    sloped: PeriodicOrbit
    orbit: PeriodicOrbit

    def replaced(self, **fields: Any) -> "Attempt":
        """Return both with other values of some fields."""
        return Attempt(*(dataclasses.replace(orbit, **fields) for orbit in self))


class OrbitSearch(NamedTuple):
    """A scene whose values `still` are known, and from where its orbit is searched for."""

    scene: Scene
    still: Scene
    guess: Array | None  # of nodes
    section: Array | None  # the section point of a guess, which may lose contact
    period: int | None  # None is 1, or else what the motion that is waited for repeats after
    budget: Budget
    runs: Lone = Lone()  # how turns are integrated
    first: Attempt | None = None  # what Newton's method from the guess, or from rest, came to

    @property
    def turns(self) -> int:
        """Return the period to begin with."""
        return self.period or 1

    def by_nodes(
        self, guess: Array | None, turns: int, count: int = NODES, most: int | None = None
    ) -> Attempt:
        """Return the orbit with as many nodes a turn as it needs, from `count` to `most`.

        Once with the slopes of the scene, and once with the values that tell how good it is.
        """
        way, most = None, most or self.budget.bounds.nodes
        while True:
            self.budget.nodes.add(count)
            _LOG.info("Newton's method for a period of %d, %d nodes a turn", turns, count)
            one, found = self.by_so_many(guess, turns, count)
            way = found.way if way is None else way
            orbit = one.orbit
            enough = count >= most or not self._wants_nodes(orbit, bool(found.doubted))
            if enough and (not bool(orbit.success) or self._is_closed(orbit, found.closure)):
                break
            if count >= most:
                one = one._replace(orbit=dataclasses.replace(orbit, result=RESULTS.not_closed))
                break
            guess, count = orbit.eccentricity, 2 * count
        return self.with_multipliers(one.replaced(way=way), found)

    def by_so_many(self, guess: Array | None, turns: int, count: int) -> tuple[Attempt, Nodes]:
        """Return the orbit with `count` nodes a turn, and what Newton's method came to."""
        start = self._start(guess, count * turns)
        found, factors = orbit_nodes(self.still, start, turns, count * turns)
        sloped = with_statistics(self.scene, found, factors, turns)
        orbit = without_slopes(sloped)
        if concrete(orbit.error) is None:  # slopes by several numbers at once hide the values
            orbit = with_statistics(self.still, found, factors, turns)
        return Attempt(sloped, orbit), found

    def _start(self, guess: Array | None, nodes: int) -> Array:
        """Return a guess with so many nodes, NaN for none: one program serves both."""
        if guess is None:
            return jnp.full((nodes, unknowns(self.still)), jnp.nan, float)
        return guess if len(guess) == nodes else resample(guess, nodes)

    def _wants_nodes(self, orbit: PeriodicOrbit, doubted: bool) -> bool:
        """Tell whether more nodes may help: what loses contact is sooner shot for."""
        if bool(orbit.success):
            return doubted or not float(orbit.error) <= SETTLED
        lost = bool(orbit.result == RESULTS.contact_lost) and not self.budget.bounds.bounded
        return lost or bool(orbit.result == RESULTS.unresolved)

    def with_multipliers(self, found: Attempt, nodes: Nodes) -> Attempt:
        """Return an orbit with multipliers by the integrator, if steps or nodes leave them unsure.

        Where that is beyond the effort they stay as they are, with their error.
        """
        orbit = found.orbit
        unsure = not bool(nodes.multipliers.error <= UNSURE) or bool(nodes.doubted)
        if not (bool(orbit.success) and unsure) or not can_be_shot(self.still, orbit.section):
            return found
        # Tangents of four numbers cost as much as 8 to 30 turns, of eight as 90 to 170.
        turns = orbit.section.size**2 * orbit.period
        if not self.budget.steps:
            self._comes_back(orbit)
        if not self.budget.affords(turns):
            return found
        self.budget.spend(turns)
        values, error = integrated_multipliers(self.still, orbit.section, orbit.period)
        return found.replaced(multipliers=values, multipliers_error=error)

    def _is_closed(self, orbit: PeriodicOrbit, closure: Scalar) -> bool:
        """Whether a motion that begins on the orbit comes back, by estimate or integrated."""
        return float(closure) <= SURELY_CLOSED or self._comes_back(orbit)

    def _comes_back(self, orbit: PeriodicOrbit) -> bool:
        """Whether a motion that begins on the orbit comes back, by the integrator."""
        end, _, outcome = self._followed(orbit.section, orbit.period)
        self.budget.integrated(outcome, orbit.period)
        apart = np.max(np.abs(np.asarray(end) - np.asarray(orbit.section)))
        return bool(outcome.success) and bool(apart < COMES_BACK)

    def _followed(self, state: Array, turns: int) -> Followed:
        """Follow the motion from a section point."""
        return followed((state, resting(self.still)), turns, ORBIT_RTOL)

    def can_shoot(self, start: Array, turns: int) -> bool:
        """Tell whether the integrator may solve from a section point, within the effort."""
        able = self.budget.bounds.shoots and can_be_shot(self.still, start)
        return able and self.budget.affords(SHOT * turns)

    def by_shooting(self, start: Array, turns: int) -> Attempt:
        """Return the orbit through a section point near `start`."""
        _LOG.info("shooting for a period of %d", turns)
        self.budget.spend(SHOT * turns)
        self.budget.shots += 1
        found = closed(self.still, start, turns)
        orbit = orbit_through(self.still, found, turns)
        if is_concrete(self.scene) or not bool(orbit.success):
            return Attempt(orbit, orbit)
        return Attempt(orbit_through(self.scene, found, turns), orbit)

    def approached(self, start: Array, turns: int) -> Root | None:
        """Return the section point near `start` that repeats, None if there is none.

        By Newton's method, whose slopes are central differences of turns.
        """
        _LOG.info("Newton's method on section points for a period of %d", turns)
        eye, now, rested = np.eye(start.size), first_iterate(start), resting(self.still)
        shifts = DIFFERENCE * np.concatenate([np.zeros((1, start.size)), eye, -eye])
        for _ in range(LOOKS):
            ends = point = np.asarray(now.point) + shifts
            for _ in range(turns):
                ends, steps = self.runs.turn(ends, rested)
                self.budget.steps += steps
            above, below = np.split(ends[1:], 2)
            left, matrix = ends[0] - point[0], (above - below).T / (2 * DIFFERENCE) - eye
            now = advanced(now, left, matrix, NEAR_ENOUGH, LOOKS, least=LEAST_SHARE)
            if bool(now.done):
                return now if bool(now.success) else None
        return None

    def by_shots(self, start: Array, turns: int, way: WAYS) -> Iterator[Attempt]:
        """Yield the orbit near a section point: by nodes, or by shooting where it loses contact.

        A film has no contact to lose.
        """
        found = self.approached(start, turns)
        if found is None:
            return
        state = found.point
        path = np.asarray(self._followed(state, turns).path)
        touching = pins(path)[:, list(self.still.dry)]
        if np.all(np.linalg.norm(touching, axis=-1) > 1) and not remembers(self.still):
            nodes = self.by_nodes(jnp.asarray(path), turns, 2 * NODES).replaced(way=way)
            yield nodes
            if bool(nodes.orbit.success):
                return
        if self.can_shoot(state, turns):
            yield self.by_shooting(state, turns)

    def doubled(self, orbit: PeriodicOrbit) -> Iterator[Attempt]:
        """Yield attempts beside an unstable orbit until one leads to an orbit of twice its turns.

        They start along the disturbance that alternates in sign.
        """
        turns, start = 2 * orbit.period, orbit.section
        if turns > self.budget.bounds.longest or not self.can_shoot(start, turns):
            return
        found = self.approached(start, orbit.period)
        if found is None:
            return
        values, vectors = np.linalg.eig(np.asarray(found.jacobian) + np.eye(start.size))
        way = np.real(vectors[:, np.argmin(np.where(np.imag(values), np.inf, np.real(values)))])
        way /= np.max(np.abs(way[pins_of(self.still)]))
        for distance in BESIDE:
            for one in self.by_shots(start + distance * way, turns, WAYS.doubling):
                yield one
                if bool(one.orbit.success) and not _is_near(one.orbit.section, start):
                    return

    def transient(self) -> Transient:
        """Return the transient for the motion from rest, which has not begun."""
        return Transient(self.still, self.budget, self.runs)


def searched(search: OrbitSearch, nodes: int | None) -> PeriodicOrbit:
    """Return the stable orbit of a scene, with so many nodes a turn, or by all attempts.

    If none is stable, it is the first unstable one, with what the motion from rest does instead; a
    failure says why.
    """
    if nodes is not None:
        return first_stable([search.by_nodes(search.guess, search.turns, nodes, nodes)])
    transient = search.transient()
    return first_stable(with_doubled(search, _attempts(search, transient)), transient)


def shot_for(search: OrbitSearch) -> PeriodicOrbit:
    """Return the stable orbit that shooting leads to, as `searched` does.

    It starts from the section point of a guess, and then from means of turns of the transient.
    """
    transient = search.transient()
    return first_stable(_shots(search, transient), transient)


def shot_once(scene: Scene, still: Scene, section: Array | None, turns: int) -> PeriodicOrbit:
    """Return the orbit that shooting leads to once, whose values may be traced.

    It starts from a section point, or from the mean of the last half of 240 turns from rest.
    """
    if section is None:
        states, *_ = section_points(resting_start(still), turns=TURNS, rtol=TRANSIENT_RTOL)
        section = jnp.asarray(about_means(states[TURNS // 2 :], turns)[0][-1])
    return orbit_through(scene, closed(still, section, turns), turns)


def first_stable(attempts: Iterable[Attempt], transient: Transient | None = None) -> PeriodicOrbit:
    """Return the first stable orbit, or else the first."""
    found: list[Attempt] = []
    try:
        for one in attempts:
            found.append(one)
            if bool(one.orbit.stable) or _is_stiff(one.orbit):
                break
    except KeyboardInterrupt:
        raise KeyboardInterrupt(_so_far(found, transient)) from None
    first = next((one for one in found if bool(one.orbit.success)), found[0])
    sloped, orbit = found[-1] if bool(found[-1].orbit.stable) else first
    settled = bool(orbit.stable) or _is_stiff(orbit)
    # The result of an orbit whose slopes are asked for may be traced.
    sloped = dataclasses.replace(sloped, result=orbit.result)
    if transient is None or settled:
        return sloped
    regime = transient.regime()
    sloped = dataclasses.replace(sloped, from_rest=regime, run=transient.statistics())
    if bool(orbit.success):
        return sloped
    return dataclasses.replace(sloped, result=regime or orbit.result, tried=str(transient.budget))


def _so_far(found: list[Attempt], transient: Transient | None) -> str:
    """Say what an interrupted search has come to."""
    orbit = next((one.orbit for one in found if bool(one.orbit.success)), None)
    seen = "no orbit yet" if orbit is None else f"an orbit. {orbit.instability}"
    return seen if transient is None else f"{seen.rstrip('.')}. {transient.explanation()}"


def _attempts(search: OrbitSearch, transient: Transient) -> Iterator[Attempt]:
    """Yield what each try comes to, cheap ones first."""
    scene, turns, bounds = search.still, search.turns, search.budget.bounds
    shot_from: list[tuple[int, Array]] = []

    def shots(start: Array, turns: int, way: WAYS) -> Iterator[Attempt]:
        """Yield what section points lead to.

        The mean of later turns may be where one led to an orbit: that is not started from again.
        """
        if any(turns == n and _is_near(start, at) for n, at in shot_from):
            return
        for one in search.by_shots(start, turns, way):
            yield one
            if bool(one.orbit.success):
                shot_from.append((turns, start))

    def waited(rest: Round) -> Iterator[Attempt]:
        """Yield what the means of turns lead to; those of chaos lead nowhere that is stable."""
        if rest.chaotic:
            return
        for turns, mean in rest.means(search.period, bounds.longest):
            yield from shots(mean, turns, WAYS.waiting)

    def near_unresolved() -> Iterator[Attempt]:
        """Yield what lies near a motion that nodes do not resolve: it may lose contact."""
        if is_unresolved(first.orbit.result):
            yield from shots(first.orbit.section, turns, WAYS.unresolved)

    # An unbounded search needs the more nodes sooner or later: one program then serves all orbits.
    begin = NODES if bounds.bounded else 2 * NODES
    first, rounds = search.first or search.by_nodes(search.guess, turns, begin), transient.rounds()
    if turns == 1 and bool(first.orbit.stable) and bool(first.orbit.way == WAYS.damping):
        pins = pins_of(scene)
        section = np.asarray(first.orbit.section)[None, pins]
        for rest in itertools.islice(rounds, 1):
            if not oscillation_about(rest.states, 1, pins).is_about(section):
                yield from waited(rest)
    yield first
    if search.section is not None:
        yield from shots(search.section, turns, WAYS.guess)
    if search.guess is not None:
        yield search.by_nodes(None, turns)
    if not bounds.bounded:
        yield from near_unresolved()
    chaotic = False
    for rest in rounds:
        yield from waited(rest)
        chaotic = rest.chaotic
    if bounds.bounded and not chaotic:
        yield from near_unresolved()


def with_doubled(search: OrbitSearch, attempts: Iterable[Attempt]) -> Iterator[Attempt]:
    """Yield attempts; after an unstable orbit whose period has doubled, try twice its turns too.

    A call that asks for a period has no such attempts.
    """
    left: list[Array] = []
    for one in attempts:
        yield one
        orbit = one.orbit
        if search.period is not None or not _has_doubled(orbit):
            continue
        if any(_is_near(orbit.section, at) for at in left):
            continue
        left.append(orbit.section)
        yield from with_doubled(search, search.doubled(orbit))


def _has_doubled(orbit: PeriodicOrbit) -> bool:
    """Whether a disturbance of the orbit changes sides each period and grows."""
    values = np.asarray(orbit.multipliers)
    flips = bool(np.any((np.imag(values) == 0) & (np.real(values) < -1)))
    return bool(orbit.success) and not bool(orbit.stable) and flips


def _is_near(one: Array, other: Array) -> bool:
    """Whether two section points are one place."""
    return bool(np.max(np.abs(one - other)) < NEAR)


def _shots(search: OrbitSearch, transient: Transient) -> Iterator[Attempt]:
    """Yield what shooting comes to."""
    if search.section is not None:
        yield search.by_shooting(search.section, search.turns)
    for rest in transient.rounds():
        for turns, mean in rest.means(search.period, search.budget.bounds.longest):
            yield search.by_shooting(mean, turns)
    none = missing(search.still, search.turns, RESULTS.not_closed)
    yield Attempt(none, none)


def is_unresolved(result: RESULTS) -> bool:
    """Tell whether Newton's method converged to what the nodes do not resolve."""
    return bool(result == RESULTS.contact_lost) or bool(result == RESULTS.unresolved)


def _is_stiff(orbit: PeriodicOrbit) -> bool:
    """Whether springs swing too fast for multipliers to be known; a transient takes minutes."""
    return bool(orbit.success) and not bool(orbit.multipliers_error < 1)

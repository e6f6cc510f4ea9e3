"""The problem of orbits by the integrator over a parameter: multiple shooting.

Such orbits may lose contact and impact. See `jaxcrusher.orbits.shot` for one orbit alone.
"""

import dataclasses
from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float

from jaxcrusher.crusher.scene import Scene
from jaxcrusher.motion.tangents import SLICES, Build, Tangents, slices_apart, tangents
from jaxcrusher.orbits import newton
from jaxcrusher.orbits.newton import HostRoot, newton_on_host
from jaxcrusher.orbits.problem import (
    MOST_CORRECTIONS,
    AbstractPeriodicProblem,
    Bordered,
    Linearised,
    OfMatrix,
    Stride,
    Vanishing,
)
from jaxcrusher.orbits.result import PeriodicOrbit
from jaxcrusher.orbits.shot import (
    CLOSURE,
    COARSER,
    RTOL,
    Closed,
    can_be_shot,
    closed,
    described,
    least_penetrations_from,
)

# Section points so near, in clearances and m/s, are one. Turns differ by thousandths where a branch
# has left its doubling by hundredths of a rad/s.
ALIKE = 1e-4
# Steps of differences, as a share of what a function depends on.
DIFFERENCE = 1e-6
# The tolerance along a branch, and what two integrations that start all but alike differ by. Where
# contact is lost such a difference moves the speed by more than Newton's last step may be.
BRANCH_RTOL, NOISE = 1e-10, 1e-9


class Turns(NamedTuple):
    """The map over a period: where each of its slices ends, and what it makes of a shift."""

    ends: Float[np.ndarray, "turns dims"]  # of turns
    jacobians: Float[np.ndarray, "slices dims dims"]  # of slices

    @property
    def matrix(self) -> Float[np.ndarray, "dims dims"]:
        """Return what the period makes of a shift of the section point."""
        return _products(self.jacobians)[-1]


class Shooting(AbstractPeriodicProblem):
    """By the integrator, from many states of the period: u are those where its slices begin.

    The scene of the numbers p is `build(p)`. A disturbance may grow a thousandfold in a period;
    in a slice it does not, so that Newton's method leads from further off.
    """

    build: Build
    period: int = eqx.field(static=True)
    slices: int = eqx.field(static=True, default=SLICES)  # a turn
    rtol: float = eqx.field(static=True, default=BRANCH_RTOL)
    watched: tuple[str, ...] = eqx.field(static=True, default=())

    # Where branches fold a state differs by thousandths of a clearance: a tangent leads less far.
    # The integrations leave some 3e-8 of a step in a place.
    stride: ClassVar[Stride] = Stride(
        first=0.02, longest=0.4, shortest=2e-6, straight=0.1, located=1e-7
    )
    ends: ClassVar[bool] = False

    def states(self, u: Float[ArrayLike, " n"]) -> Float[np.ndarray, "slices dims"]:
        """Return the states where slices begin, the section point first."""
        return np.asarray(u).reshape(self.period * self.slices, -1)

    def along(self, section: Float[ArrayLike, " dims"], p: Any) -> Float[np.ndarray, " n"]:
        """Return the unknowns of the motion from a section point."""
        states, point = np.tile(section, (self.slices, 1)), jnp.asarray(p, float).reshape(-1)
        rtol, found = jnp.asarray(self.rtol), []
        for _ in range(self.period):
            for k in range(self.slices):
                # The program of all slices serves this too, though one of them is new.
                ends, _, _ = slices_apart(self.build, point, jnp.asarray(states), rtol)
                found.append(states[k].copy())
                states[(k + 1) % self.slices] = ends[k]
        return np.concatenate(found)

    def residual(self, u: Float[Array, " n"], p: Any) -> Array:
        """Return how far each slice leads from where the next one begins."""
        return jnp.asarray(self.linearised(u, p).residual)

    def linearised(self, u: Float[ArrayLike, " n"], p: Any) -> Linearised:
        """Return the residual with its derivatives by u and by p, and the turns."""
        states = self.states(u)
        count, dims = states.shape
        ends, jacobians, forcing = self._slices(states, p)
        matrix = np.zeros((count, dims, count, dims))
        here = np.arange(count)
        matrix[here, :, here, :] += jacobians
        matrix[here, :, (here + 1) % count, :] -= np.eye(dims)
        left = ends - np.roll(states, -1, axis=0)
        seen = Turns(ends[self.slices - 1 :: self.slices], jacobians)
        size = count * dims
        return Linearised(left.ravel(), matrix.reshape(size, size), forcing.reshape(size, -1), seen)

    def _slices(self, states: np.ndarray, p: Any) -> tuple[np.ndarray, ...]:
        """Return where slices end, with derivatives. One program serves all periods."""
        point, rtol = jnp.asarray(p, float).reshape(-1), jnp.asarray(self.rtol)
        turns = np.split(states, self.period)
        parts = [slices_apart(self.build, point, jnp.asarray(one), rtol) for one in turns]
        return tuple(np.concatenate(part) for part in zip(*parts, strict=True))

    def solved(self, equations: Bordered) -> HostRoot | None:
        """Return the zero of bordered equations, None if there is none."""

        def evaluated(both: np.ndarray) -> tuple[np.ndarray, np.ndarray, Turns]:
            left, jacobian, seen = equations.linearised(both)
            return np.asarray(left), np.asarray(jacobian), seen

        return newton_on_host(
            evaluated, np.asarray(equations.guess), CLOSURE, MOST_CORRECTIONS, NOISE
        )

    def monodromy(self, u: Any, p: Any, seen: Turns) -> Float[np.ndarray, "dims dims"]:
        """Return what a period makes of a shift from the orbit."""
        return seen.matrix

    def vanishing(self, of: OfMatrix, u: Any, p: Any, seen: Turns) -> Vanishing:
        """Return a function of the monodromy matrix, with slopes by one-sided differences.

        Their error lets Newton's method converge more slowly, to the same zero. A slice's matrix
        depends on its own state alone, so that all states are shifted at once.
        """
        states, p = self.states(u), np.asarray(p)
        before, after = _products(seen.jacobians), _products(seen.jacobians[::-1], other=True)[::-1]
        value = float(of(jnp.asarray(seen.matrix)))

        def grown(matrix: np.ndarray) -> float:
            return (float(of(jnp.asarray(matrix))) - value) / DIFFERENCE

        by_states = np.empty(states.shape)
        for i, shift in enumerate(DIFFERENCE * np.eye(states.shape[1])):
            moved = self._slices(states + shift, p)[1]
            for k, one in enumerate(moved):
                by_states[k, i] = grown(after[k + 1] @ one @ before[k])
        by_p = []
        for shift in np.diag(DIFFERENCE * np.abs(np.ravel(p))):
            moved = self._slices(states, np.ravel(p) + shift)[1]
            by_p.append(grown(_products(moved)[-1]))
        return Vanishing(value, (by_states.ravel(), np.array(by_p) / np.abs(np.ravel(p))))

    def grazing(self, joint: int, u: Any, p: Any, seen: Turns) -> Vanishing:
        """Return the least penetration of a joint, with slopes by one-sided differences."""
        states, p = self.states(u), np.ravel(p)
        both = np.concatenate([states[0], p])

        def depth(both: np.ndarray) -> float:
            section, numbers = np.split(both, [states.shape[1]])
            return float(self._depths(section, numbers)[joint])

        value = depth(both)
        steps = DIFFERENCE * np.concatenate([np.ones(states.shape[1]), np.abs(p)])
        moved = np.array([depth(both + shift) for shift in np.diag(steps)])
        by_section, by_p = np.split((moved - value) / steps, [states.shape[1]])
        by_states = np.zeros(states.shape)
        by_states[0] = by_section
        return Vanishing(value, (by_states.ravel(), by_p))

    def turns(self, u: Any, seen: Turns) -> int:
        """Return after how many turns an orbit repeats already."""
        apart = np.max(np.abs(seen.ends - seen.ends[-1]), axis=1)
        return 1 + int(np.argmax(apart < ALIKE))

    def monitors(self, u: Any, p: Any, seen: Turns) -> Float[np.ndarray, " joints"]:
        """Return the least penetration of each joint over the period, in clearances."""
        return self._depths(self.states(u)[0], p)

    def _depths(self, section: np.ndarray, p: Any) -> Float[np.ndarray, " joints"]:
        scene = self.build(jnp.asarray(p).reshape(-1))
        return np.asarray(least_penetrations_from(scene, section, self.period))

    def orbit(self, u: Any, p: Any, seen: Turns, scales: Any = None) -> PeriodicOrbit:
        """Return all that is known of an orbit, but for an error of its multipliers.

        Its `error` is what a tolerance 100 times as large makes of the RMS.
        """
        successful, matrix = newton.RESULTS.successful, jnp.asarray(seen.matrix)
        unknown, steps = jnp.asarray(jnp.nan), jnp.array(0)
        found = Closed(jnp.asarray(self.states(u)[0]), matrix, unknown, steps, successful)
        return described(self.build(jnp.asarray(p).reshape(-1)), found, self.period)

    def over(self, turns: int, u: np.ndarray) -> tuple["Shooting", np.ndarray]:
        """Return the problem of so many turns, and the states repeated or cut."""
        return dataclasses.replace(self, period=turns), np.resize(u, u.size * turns // self.period)

    def resolved(self, u: np.ndarray, finer: bool) -> tuple["Shooting", np.ndarray] | None:
        """Return the same states; coarser equations have a tolerance 100 times as large."""
        return None if finer else (dataclasses.replace(self, rtol=COARSER * self.rtol), u)

    def weight(self, size: int) -> float:
        """Return that of a mean over slices."""
        return 1 / (self.period * self.slices)


def _products(
    jacobians: Float[np.ndarray, "slices dims dims"], *, other: bool = False
) -> list[Float[np.ndarray, "dims dims"]]:
    """Return the products of the first none, one, ... of some matrices.

    The last one stands on the left or, of the `other` order, on the right.
    """
    found = [np.eye(jacobians.shape[1])]
    for one in jacobians:
        found.append(found[-1] @ one if other else one @ found[-1])
    return found


def section_point(
    build: Build,
    point: Float[Array, " n"],
    metric: str,
    guess: Float[ArrayLike, " dims"],
    period: int,
) -> tuple[np.ndarray, Tangents] | None:
    """Return the section point near `guess` that repeats after `period` turns.

    With it come the derivatives along the orbit. None if Newton's method does not converge, if a
    multiplier is 1 (whatever is near repeats too), or if the state holds more than eccentricity
    and rate (a memory that no impact renews repeats whatever it is).
    """
    scene, start = _built(build, point), jnp.asarray(guess, float)
    if not can_be_shot(scene, start):
        return None
    found = closed(scene, start, period)
    if not bool(found.result == newton.RESULTS.successful):
        return None
    state = np.asarray(found.state)
    return state, tangents(build, point, metric, state, period, RTOL)


@eqx.filter_jit  # traced: a neighbour of a parameter at its limit lies outside
def _built(build: Build, point: Array) -> Scene:
    return build(point)

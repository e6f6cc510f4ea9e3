"""The problem of orbits by the integrator over a parameter, whose unknowns are a section point.

Such orbits may lose contact and impact. See `jaxcrusher.orbits.shot` for one orbit alone.
"""

import dataclasses
from collections.abc import Callable
from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float

from jaxcrusher.crusher.scene import Scene
from jaxcrusher.motion.tangents import Build, Tangents, chain, tangents
from jaxcrusher.orbits import newton
from jaxcrusher.orbits.newton import HostRoot, newton_on_host
from jaxcrusher.orbits.problem import (
    ALIKE,
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
    RTOL,
    Closed,
    can_be_shot,
    closed,
    described,
    least_penetrations_from,
)

# Steps of differences, as a share of what a function depends on.
DIFFERENCE = 1e-6
# The tolerance along a branch, and a statistic whose derivatives come along, unused.
BRANCH_RTOL, METRIC = 1e-10, "foundation_rms"


class Turns(NamedTuple):
    """The map over a period: the state after each turn, and what a period makes of a shift."""

    ends: Float[np.ndarray, "turns dims"]
    matrix: Float[np.ndarray, "dims dims"]


class Shooting(AbstractPeriodicProblem):
    """By the integrator: u is a section point; the scene of the numbers p is `build(p)`."""

    build: Build
    period: int = eqx.field(static=True)
    rtol: float = eqx.field(static=True, default=BRANCH_RTOL)
    watched: tuple[str, ...] = eqx.field(static=True, default=())

    # Where branches fold a state differs by thousandths of a clearance: a tangent leads less far.
    # The integrations leave some 3e-8 of a step in a place.
    stride: ClassVar[Stride] = Stride(
        first=0.02, longest=0.4, shortest=2e-5, straight=0.1, located=1e-7
    )
    ends: ClassVar[bool] = False

    def residual(self, u: Float[Array, " dims"], p: Any) -> Array:
        """Return how far a period leads from u."""
        return jnp.asarray(self.linearised(u, p).residual)

    def linearised(self, u: Float[ArrayLike, " dims"], p: Any) -> Linearised:
        """Return the residual with its derivatives by u and by p, and the turns."""
        point, parts, state = jnp.asarray(p).reshape(-1), [], np.asarray(u)
        for _ in range(self.period):
            parts.append(tangents(self.build, point, METRIC, state, 1, self.rtol))
            state = parts[-1].state
        joined = {
            name: np.concatenate([getattr(part, name) for part in parts])
            for name in ("jacobians", "forcing", "values", "by_state", "by_parameter")
        }
        along = dataclasses.replace(parts[-1], **joined)
        matrix, forcing = chain(along)
        seen = Turns(np.array([part.state for part in parts]), matrix)
        return Linearised(state - np.asarray(u), matrix - np.eye(state.size), forcing, seen)

    def solved(self, equations: Bordered) -> HostRoot | None:
        """Return the zero of bordered equations, None if there is none."""

        def evaluated(both: np.ndarray) -> tuple[np.ndarray, np.ndarray, Turns]:
            left, jacobian, seen = equations.linearised(both)
            return np.asarray(left), np.asarray(jacobian), seen

        return newton_on_host(evaluated, np.asarray(equations.guess), CLOSURE, MOST_CORRECTIONS)

    def monodromy(self, u: Any, p: Any, seen: Turns) -> Float[np.ndarray, "dims dims"]:
        """Return what a period makes of a shift from the orbit."""
        return seen.matrix

    def vanishing(self, of: OfMatrix, u: Any, p: Any, seen: Turns) -> Vanishing:
        """Return a function of the monodromy matrix, with slopes by differences."""

        def value(u: np.ndarray, p: np.ndarray) -> float:
            return float(of(jnp.asarray(self.linearised(u, p).seen.matrix)))

        return _with_differences(value, float(of(jnp.asarray(seen.matrix))), u, p)

    def grazing(self, joint: int, u: Any, p: Any, seen: Turns) -> Vanishing:
        """Return the least penetration of a joint, with slopes by differences."""

        def value(u: np.ndarray, p: np.ndarray) -> float:
            return float(self.monitors(u, p, seen)[joint])

        u, p = np.asarray(u), np.asarray(p)
        return _with_differences(value, value(u, p), u, p)

    def turns(self, u: Any, seen: Turns) -> int:
        """Return after how many turns an orbit repeats already."""
        apart = np.max(np.abs(seen.ends - seen.ends[-1]), axis=1)
        return 1 + int(np.argmax(apart < ALIKE))

    def monitors(self, u: Any, p: Any, seen: Turns) -> Float[np.ndarray, " joints"]:
        """Return the least penetration of each joint over the period, in clearances."""
        scene = self.build(jnp.asarray(p).reshape(-1))
        return np.asarray(least_penetrations_from(scene, u, self.period))

    def orbit(
        self, u: Any, p: Any, seen: Turns, equations: Bordered | None = None
    ) -> PeriodicOrbit:
        """Return all that is known of an orbit, but for an error of its multipliers.

        Its `error` is what a tolerance 100 times as large makes of the RMS.
        """
        successful, matrix = newton.RESULTS.successful, jnp.asarray(seen.matrix)
        unknown, steps = jnp.asarray(jnp.nan), jnp.array(0)
        found = Closed(jnp.asarray(u), matrix, unknown, steps, successful)
        return described(self.build(jnp.asarray(p).reshape(-1)), found, self.period)

    def over(self, turns: int, u: np.ndarray) -> tuple["Shooting", np.ndarray]:
        """Return the problem of so many turns, and the same section point."""
        return dataclasses.replace(self, period=turns), u

    def weight(self, size: int) -> float:
        """Return that of a sum of squares."""
        return 1.0


def _with_differences(
    of: Callable[[np.ndarray, np.ndarray], float], value: float, u: Any, p: Any
) -> Vanishing:
    """Return the value of a function at u and p, with slopes by one-sided differences.

    Their error lets Newton's method converge more slowly, to the same zero.
    """
    both = np.concatenate([u, np.ravel(p)])
    steps = DIFFERENCE * np.concatenate([np.ones(len(u)), np.abs(np.ravel(p))])
    moved = (np.split(both + shift, [len(u)]) for shift in np.diag(steps))
    slopes = np.array([of(*there) - value for there in moved]) / steps
    return Vanishing(value, tuple(np.split(slopes, [len(u)])))


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

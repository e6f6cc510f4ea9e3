"""The problem of orbits over a parameter by multiple shooting.

An integrator carries states over slices of a turn, and so impacts do not disturb it.
"""

import dataclasses
from abc import abstractmethod
from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float, Scalar
from typing_extensions import override

from jaxcrusher.periodic.newton import advanced, first_iterate
from jaxcrusher.periodic.problem import (
    MOST_CORRECTIONS,
    AbstractEquations,
    AbstractPeriodicProblem,
    Linearised,
    OfMatrix,
    Stride,
    Vanishing,
    Zero,
    zero_of,
)

# States so near, in their own units, are one. Turns of a crusher differ by thousandths where a
# branch has left its doubling by hundredths of a rad/s.
ALIKE = 1e-4
# Newton's last step, in these units.
CLOSURE = 1e-7
# Newton's shortest step as a share of the whole one: each look at the equations may take seconds.
LEAST_SHARE = 0.1
# Steps of differences, as a share of what a function depends on.
DIFFERENCE = 1e-6
# The tolerance along a branch, and what two integrations that start all but alike differ by. Where
# contact is lost such a difference moves the speed by more than Newton's last step may be.
BRANCH_RTOL, NOISE = 1e-10, 1e-9
# A tolerance so many times as large tells the error of an event.
COARSER = 100.0


class AbstractFlow(eqx.Module):
    """Motions over one turn of the forcing, over parameters p of shape (n,).

    A state is any array to which an orbit comes back. It is of order one.
    """

    @abstractmethod
    def slices(
        self, p: Float[Array, " n"], states: Float[Array, "slices dims"], rtol: Scalar
    ) -> tuple[
        Float[Array, "slices dims"],
        Float[Array, "slices dims dims"],
        Float[Array, "slices dims n"],
    ]:
        """Return where each slice of a turn leads from its state, with slopes by state and p.

        Slices are of one length; the first one begins with the turn. NaN where a motion fails.
        """

    @abstractmethod
    def monitors(
        self, p: Float[Array, " n"], state: Float[np.ndarray, " dims"], turns: int
    ) -> Float[np.ndarray, " watched"]:
        """Return what is > 0 over so many turns from a state, if no watched event happens."""


class Turns(NamedTuple):
    """The map over a period: where its turns end, and the Jacobians of its slices."""

    ends: Float[np.ndarray, "turns dims"]  # of turns
    jacobians: Float[np.ndarray, "slices dims dims"]  # of slices

    @property
    def matrix(self) -> Float[np.ndarray, "dims dims"]:
        """Return the monodromy matrix, which maps a shift of the section point."""
        return _products(self.jacobians)[-1]


class ShootingProblem(AbstractPeriodicProblem):
    """Multiple shooting by the integrator: u holds the states where slices of the period begin.

    A disturbance may grow a thousandfold in a period; in a slice it does not, so that Newton's
    method converges from further off.
    """

    flow: AbstractFlow
    period: int = eqx.field(static=True, default=1)
    slices: int = eqx.field(static=True, default=8)  # a turn
    rtol: float = eqx.field(static=True, default=BRANCH_RTOL)
    watched: tuple[str, ...] = eqx.field(static=True, default=())

    # Where branches fold a crusher's state differs by thousandths: a tangent leads less far. The
    # integrations leave some 3e-8 of a step in a place.
    stride: ClassVar[Stride] = Stride(
        first=0.02, longest=0.4, shortest=2e-6, straight=0.1, located=1e-7
    )
    ends: ClassVar[bool] = False

    def states(self, u: Float[ArrayLike, " n"]) -> Float[np.ndarray, "slices dims"]:
        """Return the states where slices begin, the section point first."""
        return np.asarray(u).reshape(self.period * self.slices, -1)

    def unknowns_from(self, section: Float[ArrayLike, " dims"], p: Any) -> Float[np.ndarray, " n"]:
        """Return the unknowns of the motion from a section point."""
        states, point = np.tile(section, (self.slices, 1)), jnp.asarray(p, float).reshape(-1)
        rtol, found = jnp.asarray(self.rtol), []
        for _ in range(self.period):
            for k in range(self.slices):
                # The program of all slices serves this too, though one of them is new.
                ends, _, _ = self.flow.slices(point, jnp.asarray(states), rtol)
                found.append(states[k].copy())
                states[(k + 1) % self.slices] = ends[k]
        return np.concatenate(found)

    @override
    def linearised(self, u: Float[ArrayLike, " n"], p: Any) -> Linearised:
        """Linearise how far each slice ends from where the next one begins; `Turns` are seen."""
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
        parts = [self.flow.slices(point, jnp.asarray(one), rtol) for one in turns]
        return tuple(np.concatenate(part) for part in zip(*parts, strict=True))

    @override
    def left_out(self, u: Any, p: Any) -> np.ndarray:
        """Return zeros: the integrator's tolerance is far below a step along a branch."""
        return np.zeros(np.shape(u))

    @override
    def find_zero(self, equations: AbstractEquations) -> Zero | None:
        limits = CLOSURE, MOST_CORRECTIONS, NOISE, LEAST_SHARE
        now = first_iterate(jnp.asarray(equations.guess))
        for _ in range(MOST_CORRECTIONS):
            left, jacobian, seen = equations.residual_and_jacobian(np.asarray(now.point))
            now = advanced(now, left, jacobian, *limits)
            if bool(now.done):
                return zero_of(now, seen)
        return None

    @override
    def monodromy(self, u: Any, p: Any, seen: Turns) -> Float[np.ndarray, "dims dims"]:
        return seen.matrix

    @override
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
        by_p, sizes = [], _sizes(np.ravel(p))
        for shift in np.diag(DIFFERENCE * sizes):
            moved = self._slices(states, np.ravel(p) + shift)[1]
            by_p.append(grown(_products(moved)[-1]))
        return Vanishing(value, (by_states.ravel(), np.array(by_p) / sizes))

    @override
    def monitored(self, which: int, u: Any, p: Any, seen: Turns) -> Vanishing:
        """Return a monitor, with slopes by one-sided differences."""
        states, p = self.states(u), np.ravel(p)
        both = np.concatenate([states[0], p])

        def monitor(both: np.ndarray) -> float:
            section, numbers = np.split(both, [states.shape[1]])
            return float(self.flow.monitors(jnp.asarray(numbers), section, self.period)[which])

        value = monitor(both)
        steps = DIFFERENCE * np.concatenate([np.ones(states.shape[1]), _sizes(p)])
        moved = np.array([monitor(both + shift) for shift in np.diag(steps)])
        by_section, by_p = np.split((moved - value) / steps, [states.shape[1]])
        by_states = np.zeros(states.shape)
        by_states[0] = by_section
        return Vanishing(value, (by_states.ravel(), by_p))

    @override
    def turns(self, u: Any, seen: Turns) -> int:
        apart = np.max(np.abs(seen.ends - seen.ends[-1]), axis=1)
        return 1 + int(np.argmax(apart < ALIKE))

    @override
    def monitors(self, u: Any, p: Any, seen: Turns) -> Float[np.ndarray, " watched"]:
        return self.flow.monitors(jnp.asarray(p).reshape(-1), self.states(u)[0], self.period)

    @override
    def over(self, turns: int, u: np.ndarray) -> tuple["ShootingProblem", np.ndarray]:
        return dataclasses.replace(self, period=turns), np.resize(u, u.size * turns // self.period)

    @override
    def resolved(self, u: np.ndarray, finer: bool) -> tuple["ShootingProblem", np.ndarray] | None:
        """Return the same states; coarser equations have a tolerance 100 times as large."""
        return None if finer else (dataclasses.replace(self, rtol=COARSER * self.rtol), u)

    @override
    def weight(self, size: int) -> float:
        return 1 / (self.period * self.slices)


def _sizes(p: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
    """Return what steps of differences by parameters are shares of; 1 where one is zero."""
    return np.where(p == 0, 1.0, np.abs(p))


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

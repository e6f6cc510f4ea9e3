"""A periodic problem over one parameter: what a discretisation must tell, and what it may be.

After BifurcationKit's `AbstractPeriodicOrbitProblem`: Newton's method and the continuation of
`jaxcrusher.orbits.branch` know a discretisation by this alone. There are two, `Collocation` here
and `Shooting` in `jaxcrusher.orbits.shooting`.
"""

import dataclasses
from abc import abstractmethod
from collections.abc import Callable
from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float, Scalar

from jaxcrusher.motion.statistic import Chosen
from jaxcrusher.orbits.collocation import TOLERANCE, System
from jaxcrusher.orbits.multipliers import monodromy
from jaxcrusher.orbits.newton import HostRoot, newton
from jaxcrusher.orbits.node_errors import Family
from jaxcrusher.orbits.result import WAYS, PeriodicOrbit
from jaxcrusher.orbits.solving import INSTANTS, MOST_NODES, described, of_nodes
from jaxcrusher.orbits.trigonometric import evaluate, resample

# Two places so near, in clearances, that they are one.
ALIKE = 1e-3
# Steps that lead from an instant of a grid to the least penetration beside it.
POLISHED = 3
# Newton's steps of a correction: more, and the step along the branch was too long.
MOST_CORRECTIONS = 8


class Linearised(NamedTuple):
    """The equations at unknowns u and a parameter p, with what else their evaluation told."""

    residual: Array | np.ndarray  # of the shape of u
    by_unknowns: Array | np.ndarray  # (size of u, size of u)
    by_parameter: Array | np.ndarray  # of the shape of u, and behind it that of p
    seen: Any = None


# One number or, of a curve of events, two.
Parameters = Float[Array, " *count"]
# A number of a monodromy matrix.
OfMatrix = Callable[[Array], Scalar]


class Vanishing(NamedTuple):
    """What vanishes at an event, and its slopes by the unknowns and by the parameters."""

    value: Any
    slopes: tuple[Any, Any]


class Stride(NamedTuple):
    """Steps along a branch, in the norm of its problem."""

    first: float
    longest: float
    shortest: float  # a branch that wants shorter ones ends
    # A step that ends further off the tangent, as a share of it, is taken again, half as long.
    straight: float = np.inf
    located: float = 1e-12  # of a special point, as a share of the step that holds it


class AbstractPeriodicProblem(eqx.Module):
    """Equations of unknowns u whose zeros are orbits of `period` turns, over a parameter p."""

    period: eqx.AbstractVar[int]
    watched: eqx.AbstractVar[tuple[str, ...]]  # what happens where each monitor vanishes
    stride: eqx.AbstractClassVar[Stride]
    ends: eqx.AbstractClassVar[bool]  # whether a branch ends there

    @abstractmethod
    def residual(self, u: Array, p: Any) -> Array:
        """Return what the equations leave, of the shape of u."""

    @abstractmethod
    def linearised(self, u: Array, p: Any) -> Linearised:
        """Return the residual with its derivatives by u and by p."""

    @abstractmethod
    def solved(self, equations: "Bordered") -> HostRoot | None:
        """Return the zero of bordered equations and what they told there; None if there is none."""

    @abstractmethod
    def monodromy(self, u: Array, p: Any, seen: Any) -> Float[np.ndarray, "n n"]:
        """Return what a period makes of disturbances; `seen` is what its equations told."""

    @abstractmethod
    def vanishing(self, of: OfMatrix, u: Array, p: Any, seen: Any) -> Vanishing:
        """Return a function of the monodromy matrix, with its slopes by u and by p."""

    @abstractmethod
    def grazing(self, joint: int, u: Array, p: Any, seen: Any) -> Vanishing:
        """Return one of the `monitors`, with its slopes by u and by p."""

    @abstractmethod
    def turns(self, u: Any, seen: Any) -> int:
        """Return after how many turns an orbit repeats already."""

    @abstractmethod
    def monitors(self, u: Array, p: Any, seen: Any) -> Float[np.ndarray, " joints"]:
        """Return the least penetration / clearance of each loose joint: > 0 keeps contact."""

    @abstractmethod
    def orbit(self, u: Array, p: Any, seen: Any, scales: Array) -> PeriodicOrbit:
        """Return all that is known of an orbit of a crusher; `scales` are those of p."""

    @abstractmethod
    def over(self, turns: int, u: np.ndarray) -> tuple["AbstractPeriodicProblem", np.ndarray]:
        """Return the problem of so many turns, and the unknowns of an orbit that repeats in both.

        One of the two numbers of turns is a multiple of the other.
        """

    @abstractmethod
    def resolved(
        self, u: np.ndarray, finer: bool
    ) -> tuple["AbstractPeriodicProblem", np.ndarray] | None:
        """Return finer or coarser equations for the same orbits, and the unknowns of one.

        None where there are no finer ones. A change of unknowns becomes one of theirs.
        """

    @abstractmethod
    def weight(self, size: int) -> float:
        """Return what the square of each of `size` unknowns counts beside the parameter's."""


class Bordered(eqx.Module):
    """The equations of a problem, and a plane across a branch: unknowns are u and p / scale."""

    problem: AbstractPeriodicProblem
    guess: Float[Array, " n"]  # in the plane
    across: Float[Array, " n"]  # its normal
    scale: Array
    shape: tuple[int, ...] = eqx.field(static=True)

    def split(self, both: Any) -> tuple[Any, Any]:
        """Return u and p."""
        return both[:-1].reshape(self.shape), self.scale * both[-1]

    def residual(self, both: Array) -> Array:
        """Return that of the equations and, last, the way from the plane."""
        left = self.problem.residual(*self.split(both))
        return jnp.append(left.ravel(), self._normal() @ (both - self.guess))

    def linearised(self, both: ArrayLike) -> tuple[Array, Array, Any]:
        """Return the residual, its Jacobian, and what else the evaluation told."""
        at = self.problem.linearised(*self.split(both))
        normal = self._normal()
        left = jnp.append(at.residual.ravel(), normal @ (both - self.guess))
        column = self.scale * at.by_parameter.reshape(-1, 1)
        rows = jnp.concatenate([at.by_unknowns, column], axis=1)
        return left, jnp.concatenate([rows, normal[None]]), at.seen

    def _normal(self) -> Array:
        """Return the last row of the Jacobian: the normal, weighted."""
        weight = self.problem.weight(len(self.across) - 1)
        return self.across * np.append(np.full(len(self.across) - 1, weight), 1.0)


class Collocation(AbstractPeriodicProblem):
    """By Fourier collocation: u are x at equally spaced times of the period."""

    family: Callable[[Array], System]  # the system at values of the parameters
    period: int = eqx.field(static=True, default=1)
    watched: tuple[str, ...] = eqx.field(static=True, default=())
    outputs: Chosen = eqx.field(static=True, default=())  # statistics of `orbit`

    stride: ClassVar[Stride] = Stride(first=0.01, longest=0.1, shortest=1e-8)
    ends: ClassVar[bool] = True  # nodes do not resolve impacts

    def residual(self, u: Float[Array, "nodes dims"], p: Parameters) -> Float[Array, "nodes dims"]:
        """Return by what the nodes' acceleration exceeds x''."""
        return self.family(p).residual(u)

    def linearised(self, u: Float[Array, "nodes dims"], p: Parameters) -> Linearised:
        """Return the residual with its derivatives by u and by p."""
        left, matrix = self.family(p).linearised(u)
        # Of few numbers: forward each costs a residual more.
        columns = jax.jacfwd(lambda p: self.residual(u, p))(p)
        return Linearised(left, matrix.reshape(u.size, u.size), columns)

    def vanishing(self, of: OfMatrix, u: Array, p: Array, seen: Any) -> Vanishing:
        """Return a function of the monodromy matrix, with slopes in reverse."""

        def value(u: Array, p: Array) -> Scalar:
            return of(monodromy(self.family(p), u))

        return Vanishing(*jax.value_and_grad(value, argnums=(0, 1))(u, p))

    def grazing(self, joint: int, u: Array, p: Array, seen: Any) -> Vanishing:
        """Return the least penetration of a joint, which is a function of the nodes alone."""
        value, by_nodes = jax.value_and_grad(lambda u: least_penetrations(u)[joint])(u)
        return Vanishing(value, (by_nodes, jnp.zeros_like(p)))

    def solved(self, equations: Bordered) -> HostRoot | None:
        """Return the zero of bordered equations, found by one program; None if there is none."""
        point, steps, success = _solved(equations)
        if not bool(success):
            return None
        jacobian = _jacobian(equations, point)
        return HostRoot(np.asarray(point), np.asarray(jacobian), None, int(steps))

    def monodromy(self, u: Array, p: Any, seen: Any) -> Float[np.ndarray, "n n"]:
        """Return the matrix that the variational equations give."""
        return np.asarray(_monodromy(self, u, jnp.asarray(p)))

    def turns(self, u: Any, seen: Any) -> int:
        """Return after how many turns the nodes repeat already."""
        by_turn, period = np.asarray(u).reshape(self.period, -1), self.period
        shorter = (turns for turns in range(1, period + 1) if period % turns == 0)
        apart = lambda turns: np.max(np.abs(by_turn - np.roll(by_turn, turns, axis=0)))  # noqa: E731
        return next(turns for turns in shorter if apart(turns) < ALIKE)

    def monitors(self, u: Array, p: Any, seen: Any) -> Float[np.ndarray, " joints"]:
        """Return the least penetration of each joint, whose nodes are in clearances."""
        return np.asarray(least_penetrations(u))

    def orbit(self, u: Array, p: Any, seen: Any, scales: Array) -> PeriodicOrbit:
        """Return all that is known of an orbit of a crusher."""
        return _described(self, u, jnp.asarray(p), jnp.asarray(scales))

    def over(self, turns: int, u: np.ndarray) -> tuple["Collocation", np.ndarray]:
        """Return the problem of so many turns, and the nodes repeated or cut."""
        family = eqx.Partial(_over, family=self.family, share=turns / self.period)
        nodes = np.resize(u, (len(u) * turns // self.period, *u.shape[1:]))
        return dataclasses.replace(self, family=family, period=turns), nodes

    def resolved(self, u: np.ndarray, finer: bool) -> tuple["Collocation", np.ndarray] | None:
        """Return twice as many nodes, up to the most that an orbit gets, or half as many."""
        if finer and len(u) >= MOST_NODES * self.period:
            return None
        return self, np.asarray(resample(jnp.asarray(u), 2 * len(u) if finer else len(u) // 2))

    def weight(self, size: int) -> float:
        """Return that of a mean square."""
        return 1 / size


@eqx.filter_jit
def _solved(equations: Bordered):
    root = newton(
        equations.residual,
        lambda both: equations.linearised(both)[:2],
        equations.guess,
        TOLERANCE,
        MOST_CORRECTIONS,
    )
    return root.point, root.steps, root.success


# A program of its own: of an event's curve this is by far the largest part of all that is compiled.
@eqx.filter_jit
def _jacobian(equations: Bordered, both: Array) -> Array:
    return equations.linearised(both)[1]


@eqx.filter_jit
def _monodromy(problem: Collocation, u: Array, p: Parameters) -> Array:
    return monodromy(problem.family(p), u)


def _over(p: Parameters, *, family: Callable[[Array], System], share: float) -> System:
    """Return a system over a share or a multiple of its period."""
    system = family(p)
    return dataclasses.replace(system, period=share * system.period)


@eqx.filter_jit
def _described(problem: Collocation, u: Array, p: Array, scales: Array) -> PeriodicOrbit:
    system = problem.family(p)
    found = of_nodes(system, u, None, WAYS.branch, family=Family(problem.family, p, scales))
    return described(system, found, u, problem.period, problem.outputs)


@eqx.filter_jit
def least_penetrations(x: Float[Array, "nodes dims"]) -> Float[Array, " joints"]:
    """Return the least penetration of each joint over the period, in clearances.

    Between the instants of a grid Newton's method goes on, so that it is smooth in the nodes.
    """
    # A frame's three coordinates stand behind the pairs of the joints.
    pairs = x[:, : x.shape[1] - x.shape[1] % 2 * 3].reshape(len(x), -1, 2)
    grid = resample(pairs, max(INSTANTS, 4 * len(x)))

    def least(pin: Float[Array, "nodes 2"], grid: Float[Array, "instants 2"]) -> Scalar:
        def step(place: Scalar) -> Scalar:
            e, rate, bend = (evaluate(pin, place, order) for order in range(3))
            curve = rate @ rate + e @ bend
            # A pin at rest is nowhere nearer.
            return jnp.where(curve > 0, e @ rate / curve, 0.0) / (2 * np.pi)

        start = jnp.argmin(jnp.sum(grid**2, axis=1)) / len(grid)
        place = jax.lax.fori_loop(0, POLISHED, lambda _, place: place - step(place), start)
        place = jax.lax.stop_gradient(place)
        # The place has slopes, and so the penetration has second derivatives.
        left = step(place)
        place = place - (left - jax.lax.stop_gradient(left))
        return jnp.linalg.norm(evaluate(pin, place)) - 1

    return jax.vmap(least, in_axes=1)(pairs, grid)

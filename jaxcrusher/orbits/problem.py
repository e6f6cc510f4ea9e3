"""A periodic problem over one parameter: what a discretisation must tell, and what it may be.

After BifurcationKit's `AbstractPeriodicOrbitProblem`: Newton's method and the continuation of
`jaxcrusher.orbits.branch` know a discretisation by this alone. There are two, `Collocation` here
and `Shooting` in `jaxcrusher.orbits.shooting`.
"""

from abc import abstractmethod
from collections.abc import Callable
from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.scipy.linalg import lu_factor
from jaxtyping import Array, ArrayLike, Complex, Float, Scalar

from jaxcrusher.motion.statistic import Chosen
from jaxcrusher.orbits.collocation import TOLERANCE, System
from jaxcrusher.orbits.multipliers import multipliers
from jaxcrusher.orbits.newton import HostRoot, newton
from jaxcrusher.orbits.result import WAYS, PeriodicOrbit
from jaxcrusher.orbits.solving import INSTANTS, described, of_nodes
from jaxcrusher.orbits.trigonometric import resample

# Newton's steps of a correction: more, and the step along the branch was too long.
MOST_CORRECTIONS = 8


class Linearised(NamedTuple):
    """The equations at unknowns u and a parameter p, with what else their evaluation told."""

    residual: Array | np.ndarray  # of the shape of u
    by_unknowns: Array | np.ndarray  # (size of u, size of u)
    by_parameter: Array | np.ndarray
    seen: Any = None


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
    watched: eqx.AbstractVar[tuple[str, ...]]  # what ends a branch, by monitor; none: nothing does
    stride: eqx.AbstractClassVar[Stride]

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
    def multipliers(self, u: Array, p: Any, seen: Any) -> Complex[np.ndarray, " n"]:
        """Return the Floquet multipliers of an orbit; `seen` is what its equations told."""

    @abstractmethod
    def turns(self, seen: Any) -> int:
        """Return after how many turns an orbit repeats already."""

    @abstractmethod
    def monitors(self, u: Array, p: Any, seen: Any) -> Float[np.ndarray, " joints"]:
        """Return the least penetration / clearance of each loose joint: > 0 keeps contact."""

    @abstractmethod
    def orbit(self, u: Array, p: Any, seen: Any) -> PeriodicOrbit:
        """Return all that is known of an orbit of a crusher."""

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

    family: Callable[[Scalar], System]  # the system at a value of the parameter
    period: int = eqx.field(static=True, default=1)
    watched: tuple[str, ...] = eqx.field(static=True, default=())
    outputs: Chosen = eqx.field(static=True, default=())  # statistics of `orbit`

    stride: ClassVar[Stride] = Stride(first=0.01, longest=0.1, shortest=1e-8)

    def residual(self, u: Float[Array, "nodes dims"], p: Scalar) -> Float[Array, "nodes dims"]:
        """Return by what the nodes' acceleration exceeds x''."""
        return self.family(p).residual(u)

    def linearised(self, u: Float[Array, "nodes dims"], p: Scalar) -> Linearised:
        """Return the residual with its derivatives by u and by p."""
        left, matrix = self.family(p).linearised(u)
        # Of one number: forward costs a residual more.
        _, column = jax.jvp(lambda p: self.residual(u, p), (p,), (jnp.ones(()),))
        return Linearised(left, matrix.reshape(u.size, u.size), column)

    def solved(self, equations: Bordered) -> HostRoot | None:
        """Return the zero of bordered equations, found by one program; None if there is none."""
        point, jacobian, steps, success = _solved(equations)
        if not bool(success):
            return None
        return HostRoot(np.asarray(point), np.asarray(jacobian), None, int(steps))

    def multipliers(self, u: Array, p: Any, seen: Any) -> Complex[np.ndarray, " n"]:
        """Return the Floquet multipliers, of the variational equations."""
        return np.asarray(_multipliers(self, u, jnp.asarray(p)))

    def turns(self, seen: Any) -> int:
        """Return `period`: nodes do not tell a motion from its double."""
        return self.period

    def monitors(self, u: Array, p: Any, seen: Any) -> Float[np.ndarray, " joints"]:
        """Return the least penetration of each joint, whose nodes are in clearances."""
        return np.asarray(least_penetrations(u))

    def orbit(self, u: Array, p: Any, seen: Any) -> PeriodicOrbit:
        """Return all that is known of an orbit of a crusher."""
        return _described(self, u, jnp.asarray(p))

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
    _, jacobian, _ = equations.linearised(root.point)
    return root.point, jacobian, root.steps, root.success


@eqx.filter_jit
def _multipliers(problem: Collocation, u: Array, p: Scalar) -> Array:
    return multipliers(problem.family(p), u).values


@eqx.filter_jit
def _described(problem: Collocation, u: Array, p: Scalar) -> PeriodicOrbit:
    system = problem.family(p)
    matrix = system.linearised(u)[1].reshape(u.size, u.size)
    lower, rows = lu_factor(matrix)
    found = of_nodes(system, u, (lower, rows), WAYS.branch)
    return described(system, found, u, problem.period, problem.outputs)


@eqx.filter_jit
def least_penetrations(x: Float[Array, "nodes dims"]) -> Float[Array, " joints"]:
    """Return the least penetration of each joint over the period, in clearances."""
    # A frame's three coordinates stand behind the pairs of the joints.
    pairs = x[:, : x.shape[1] - x.shape[1] % 2 * 3]
    by_joint = resample(pairs, INSTANTS).reshape(INSTANTS, -1, 2)
    return jnp.min(jnp.linalg.norm(by_joint, axis=2), axis=0) - 1

"""A periodic problem over one parameter: what a discretisation of its orbits must tell.

After BifurcationKit's `AbstractPeriodicOrbitProblem`: Newton's method and the continuation of
`jaxcrusher.periodic.branch` know a discretisation by this alone. There are two:
`CollocationProblem`, of orbits that nodes resolve, and `ShootingProblem`, by an integrator.
"""

from abc import abstractmethod
from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Scalar
from typing_extensions import override

from jaxcrusher.periodic.newton import Root

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


class Zero(NamedTuple):
    """A zero of equations, their Jacobian one step before, and further results there."""

    unknowns: np.ndarray
    jacobian: np.ndarray
    seen: Any
    steps: int  # of Newton's method


def zero_of(root: Root, seen: Any = None) -> Zero | None:
    """Return the zero at which Newton's method ended; None if it has failed."""
    if not bool(root.success):
        return None
    return Zero(np.asarray(root.point), np.asarray(root.jacobian), seen, int(root.steps))


class Stride(NamedTuple):
    """Steps along a branch, in the norm of its problem."""

    first: float
    longest: float
    shortest: float  # a branch that wants shorter ones ends
    # A step that ends further off the tangent, as a share of it, is taken again, half as long.
    straight: float = np.inf
    located: float = 1e-12  # of a special point, as a share of the step that holds it


class AbstractPeriodicProblem(eqx.Module):
    """Equations of unknowns u whose zeros are periodic orbits, over a parameter p.

    An orbit repeats after `period` turns. A turn is one period of the forcing.
    """

    period: eqx.AbstractVar[int]
    watched: eqx.AbstractVar[tuple[str, ...]]  # what happens where each monitor vanishes
    stride: eqx.AbstractClassVar[Stride]
    ends: eqx.AbstractClassVar[bool]  # whether a branch ends there

    @abstractmethod
    def linearised(self, u: Array, p: Any) -> Linearised:
        """Return the residual with its derivatives by u and by p."""

    @abstractmethod
    def left_out(self, u: Array, p: Any) -> Array | np.ndarray:
        """Return the defect at a zero: the exact equations' residual, in the shape of this one."""

    @abstractmethod
    def find_zero(self, equations: "AbstractEquations") -> Zero | None:
        """Return the zero near the guess and further results there; None if there is none."""

    @abstractmethod
    def monodromy(self, u: Array, p: Any, seen: Any) -> Float[np.ndarray, "n n"]:
        """Return the monodromy matrix; `seen` holds further results of the equations."""

    @abstractmethod
    def vanishing(self, of: OfMatrix, u: Array, p: Any, seen: Any) -> Vanishing:
        """Return a function of the monodromy matrix, with its slopes by u and by p."""

    @abstractmethod
    def monitored(self, which: int, u: Array, p: Any, seen: Any) -> Vanishing:
        """Return one of the `monitors`, with its slopes by u and by p."""

    @abstractmethod
    def turns(self, u: Any, seen: Any) -> int:
        """Return after how many turns an orbit repeats already."""

    @abstractmethod
    def monitors(self, u: Array, p: Any, seen: Any) -> Float[np.ndarray, " watched"]:
        """Return the numbers that are > 0 as long as no `watched` event happens."""

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

        None where there are no finer ones. `u` may also be a change of unknowns.
        """

    @abstractmethod
    def weight(self, size: int) -> float:
        """Return what the square of each of `size` unknowns counts beside the parameter's."""


class AbstractEquations(eqx.Module):
    """The equations of a problem with others beside them, for as many unknowns."""

    guess: eqx.AbstractVar[Array | np.ndarray]

    @abstractmethod
    def residual_and_jacobian(self, unknowns: Any) -> tuple[Array, Array, Any]:
        """Return the residual, its Jacobian, and what else the evaluation told."""


def residual_and_jacobian_by_both(
    problem: AbstractPeriodicProblem, both: Any, scale: Array | np.ndarray, shape: tuple[int, ...]
) -> tuple[Array, Array, Any]:
    """Return a problem's residual, its Jacobian by u and p / scale, and what else it told."""
    at = problem.linearised(both[:-1].reshape(shape), scale * both[-1])
    column = scale * at.by_parameter.reshape(-1, 1)
    return jnp.ravel(at.residual), jnp.concatenate([at.by_unknowns, column], axis=1), at.seen


class Bordered(AbstractEquations):
    """The equations of a problem, and a plane across a branch: unknowns are u and p / scale."""

    problem: AbstractPeriodicProblem
    guess: Array | np.ndarray  # in the plane
    across: Array | np.ndarray  # its normal
    scale: Array | np.ndarray
    shape: tuple[int, ...] = eqx.field(static=True)

    @override
    def residual_and_jacobian(self, both: Any) -> tuple[Array, Array, Any]:
        residual, rows, seen = residual_and_jacobian_by_both(
            self.problem, both, self.scale, self.shape
        )
        size = len(self.across) - 1
        normal = self.across * np.append(np.full(size, self.problem.weight(size)), 1.0)
        left = jnp.append(residual, normal @ (both - self.guess))
        return left, jnp.concatenate([rows, normal[None]]), seen

"""Branch points: orbits at which two branches cross.

The equations that lead to a point of a branch are singular there. Those of the branch point itself
are not: beside the orbit and the parameter, an unfolding b is unknown, which is zero in the end
(Moore, Numer. Funct. Anal. Optim. 2, 1980). With z the orbit's unknowns and the parameter, F(z) = 0
its equations, F' their Jacobian, and constants w and V near the left null vector of F' and near its
kernel of two dimensions, the equations are

    F(z) + b w = 0,  g(z) = 0,  where F' v + w g = 0 and V^T v is the unit matrix,

with v of two columns and g a row of two numbers, which vanish where F' has lost its rank (Govaerts,
Numerical Methods for Bifurcations of Dynamical Equilibria, 2000, the minimally augmented system).
"""

from dataclasses import replace
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from typing_extensions import override

from jaxcrusher.periodic.branch import Point, inner, point_of
from jaxcrusher.periodic.problem import (
    AbstractEquations,
    AbstractPeriodicProblem,
    residual_and_jacobian_by_both,
)

# Steps of the central differences of a Jacobian, in the unit of the unknowns. They do not move the
# zero of the equations.
DIFFERENCE = 1e-5


class Crossing(AbstractEquations):
    """The equations of a branch point; unknowns are u, p / scale and the unfolding."""

    problem: AbstractPeriodicProblem
    guess: Float[Array, " n+1"]
    left: Float[Array, " n-1"]  # w, as large as the Jacobian
    kernel: Float[Array, "n 2"]  # V
    scale: Array
    shape: tuple[int, ...] = eqx.field(static=True)

    @override
    def residual_and_jacobian(self, unknowns: Any) -> tuple[Array, Array, Any]:
        both, unfolding = unknowns[:-1], unknowns[-1]
        residual, jacobian, seen = self._of_orbit(both)
        rows = jnp.concatenate([jacobian, self.left[:, None]], axis=1)
        bordered = jnp.concatenate([rows, jnp.append(self.kernel.T, jnp.zeros((2, 1)), axis=1)])
        unit = jnp.eye(len(bordered))
        ways = jnp.linalg.solve(bordered, unit[:, -2:])  # v, and below it g
        adjoint = jnp.linalg.solve(bordered.T, unit[-1])[:-2]
        slopes = [
            jnp.append(-adjoint @ self._jacobian_derivative(both, way), 0.0) for way in ways[:-1].T
        ]
        left = jnp.append(residual + unfolding * self.left, ways[-1])
        return left, jnp.concatenate([rows, jnp.stack(slopes)]), seen

    def _of_orbit(self, both: Any) -> tuple[Array, Array, Any]:
        return residual_and_jacobian_by_both(self.problem, both, self.scale, self.shape)

    def _jacobian_derivative(self, both: Any, way: Array) -> Array:
        """Return the derivative of the orbit's Jacobian along a way."""
        before, after = (self._of_orbit(both + step * way)[1] for step in (-DIFFERENCE, DIFFERENCE))
        return (after - before) / (2 * DIFFERENCE)


def branch_point(
    problem: AbstractPeriodicProblem,
    shape: tuple[int, ...],
    scale: float,
    guess: Float[np.ndarray, " n"],
    along: Float[np.ndarray, " n"],
    furthest: float,
) -> Point | None:
    """Return the branch point near a guess; None if there is none within a distance.

    `guess` and `along` are of u and p / scale, `along` the direction of one of the branches.
    """
    place, unit = jnp.asarray(guess), jnp.asarray(scale, float)
    jacobian = np.asarray(residual_and_jacobian_by_both(problem, place, unit, shape)[1])
    if not np.isfinite(jacobian).all():
        return None
    lefts, sizes, rights = np.linalg.svd(jacobian)
    kernel = rights[-2:].T
    equations = Crossing(
        problem=problem,
        guess=jnp.append(place, 0.0),
        left=jnp.asarray(sizes[0] * lefts[:, -1]),
        kernel=jnp.asarray(kernel),
        scale=unit,
        shape=shape,
    )
    root = problem.find_zero(equations)
    # With an unfolding the orbit is none of the problem.
    if root is None or abs(root.unknowns[-1]) > problem.stride.located:
        return None
    away = root.unknowns[:-1] - guess
    ways = _ways(root.jacobian, kernel)
    if ways is None or not inner(problem, away, away) < furthest**2:
        return None
    towards = [inner(problem, way, along) / np.sqrt(inner(problem, way, way)) for way in ways]
    nearest = int(np.argmax(np.abs(towards)))
    onward, other = np.sign(towards[nearest]) * ways[nearest], ways[1 - nearest]
    root = root._replace(unknowns=root.unknowns[:-1])
    point = point_of(problem, shape, scale, root, onward, np.full(guess.size, np.nan))
    # Along it the parameter grows, where it does not turn back.
    return None if point is None else replace(point, crossing=np.copysign(1, other[-1]) * other)


def _ways(
    jacobian: Float[np.ndarray, "n+1 n+1"], kernel: Float[np.ndarray, "n 2"]
) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"]] | None:
    """Return the directions of both branches; None if the branch point is a lone orbit.

    Along both a quadratic form on the kernel of F' vanishes, the algebraic branching equation. The
    last rows of the Jacobian of `Crossing` hold it.
    """
    near = np.linalg.svd(jacobian[:-2, :-1])[2][-2:].T
    basis = near @ np.linalg.pinv(kernel.T @ near)
    (low, high), axes = np.linalg.eigh(jacobian[-2:, :-1] @ basis)
    if not low < 0 < high:
        return None
    return basis @ axes @ np.sqrt([high, -low]), basis @ axes @ [np.sqrt(high), -np.sqrt(-low)]

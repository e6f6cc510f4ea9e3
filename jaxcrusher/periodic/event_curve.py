"""Curves of events over two parameters: orbits at which a function of their multipliers vanishes.

The minimally augmented system (Govaerts, Numerical Methods for Bifurcations of Dynamical
Equilibria, 2000): beside the equations of an orbit stands the scalar that vanishes at the event,
and the first parameter is one unknown more. Such orbits form a branch over the second parameter,
which `jaxcrusher.periodic.branch` follows as any other.
"""

import itertools
from typing import Any, ClassVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Scalar
from typing_extensions import override

from jaxcrusher.periodic.branch import Branch, Point
from jaxcrusher.periodic.events import CROSSING, FOLD, PAIR, ZERO_OF, Special, zeros
from jaxcrusher.periodic.problem import (
    AbstractEquations,
    AbstractPeriodicProblem,
    Linearised,
    OfMatrix,
    Stride,
    Vanishing,
    Zero,
)

CUSP = "cusp"


class EventCurve(AbstractPeriodicProblem):
    """Orbits at an event; unknowns are those of the orbit and, last, the first parameter.

    The problem `base` is of two parameters p, of shape (2,).
    """

    base: AbstractPeriodicProblem
    scale: Scalar  # what a change of the first parameter is small against
    bounds: tuple[Scalar, Scalar]  # of it
    kind: str = eqx.field(static=True)  # FOLD, one of ZERO_OF, or what `base` watches
    shape: tuple[int, ...] = eqx.field(static=True)  # of an orbit's unknowns
    watched: tuple[str, ...] = eqx.field(static=True)
    period: int = eqx.field(static=True)

    # Of collocation: along a curve of events an orbit's shape changes more slowly than on a branch.
    stride: ClassVar[Stride] = Stride(first=0.01, longest=0.3, shortest=1e-6)
    ends: ClassVar[bool] = True

    def split(self, u: Any, p: Any) -> tuple[Any, Array]:
        """Return an orbit's unknowns, and both parameters."""
        return u[:-1].reshape(self.shape), jnp.stack([self._unit() * u[-1], jnp.asarray(p)])

    def joined(self, u: np.ndarray, first: float) -> Float[np.ndarray, " n"]:
        """Return the unknowns of an orbit at a value of the first parameter."""
        return np.append(u, first / float(self._unit()))

    def _unit(self) -> Scalar:
        """Return the unit of the last unknown: in the norm it then counts as the parameter does."""
        size = int(np.prod(self.shape))
        return self.scale * np.sqrt(self.base.weight(size))

    @override
    def linearised(self, u: Any, p: Any) -> Linearised:
        """Return the orbit's equations, linearised, and last what vanishes at the event."""
        x, both = self.split(u, p)
        at = self.base.linearised(x, both)
        value, (by_x, by_both) = self._event(x, both, at.seen)
        first, second = jnp.moveaxis(jnp.asarray(at.by_parameter).reshape(-1, 2), 1, 0)
        columns = jnp.concatenate([at.by_unknowns, self._unit() * first[:, None]], axis=1)
        row = jnp.append(jnp.ravel(by_x), self._unit() * by_both[0])
        return Linearised(
            jnp.append(jnp.ravel(at.residual), value),
            jnp.concatenate([columns, row[None]]),
            jnp.append(second, by_both[1]),
            at.seen,
        )

    @override
    def left_out(self, u: Any, p: Any) -> Array:
        """Return the defect of the orbit's equations; the event's defect is not known."""
        return jnp.append(jnp.ravel(self.base.left_out(*self.split(u, p))), 0.0)

    def _event(self, x: Any, both: Array, seen: Any) -> Vanishing:
        """Return what vanishes at the event, with its slopes by the orbit's own numbers."""
        if self.kind in self.base.watched:
            return self.base.monitored(self.base.watched.index(self.kind), x, both, seen)
        of = ZERO_OF[CROSSING if self.kind == FOLD else self.kind]
        return self.base.vanishing(of, x, both, seen)

    @override
    def find_zero(self, equations: AbstractEquations) -> Zero | None:
        return self.base.find_zero(equations)

    @override
    def monodromy(self, u: Array, p: Any, seen: Any) -> Float[np.ndarray, "n n"]:
        return self.base.monodromy(*self.split(u, p), seen)

    @override
    def vanishing(self, of: OfMatrix, u: Array, p: Any, seen: Any) -> Vanishing:
        """Return a function of the monodromy matrix, with slopes by the orbit's own numbers."""
        return self.base.vanishing(of, *self.split(u, p), seen)

    @override
    def monitored(self, which: int, u: Array, p: Any, seen: Any) -> Vanishing:
        """Return a monitor of the orbit, with slopes by the orbit's own numbers."""
        return self.base.monitored(which, *self.split(u, p), seen)

    @override
    def turns(self, u: Any, seen: Any) -> int:
        return self.base.turns(u[:-1].reshape(self.shape), seen)

    @override
    def monitors(self, u: Array, p: Any, seen: Any) -> Float[np.ndarray, " n"]:
        """Return what has to be > 0, in the order of `watched`.

        These are the distances of the first parameter from its bounds, the squared sine of the
        angle of a pair on the unit circle (real ones, mu and 1 / mu, are no event), and least
        penetrations.
        """
        x, both = self.split(u, p)
        found = [(both[0] - self.bounds[0]) / self.scale, (self.bounds[1] - both[0]) / self.scale]
        if self.kind == PAIR:
            values = np.linalg.eigvals(self.monodromy(u, p, seen))
            one, other = np.triu_indices(len(values), 1)
            nearest = np.argmin(np.abs(1 - values[one] * values[other]))
            found.append(1 - np.real(values[one] + values[other])[nearest] ** 2 / 4)
        if any(kind in self.base.watched for kind in self.watched):
            depths = dict(zip(self.base.watched, self.base.monitors(x, both, seen), strict=True))
            found += [depth for kind, depth in depths.items() if kind in self.watched]
        return np.array([*map(float, found)])

    @override
    def over(self, turns: int, u: np.ndarray) -> tuple[AbstractPeriodicProblem, np.ndarray]:
        """Return the orbits' problem of so many turns, and the unknowns of one."""
        return self.base.over(turns, u[:-1].reshape(self.shape))

    @override
    def resolved(self, u: np.ndarray, finer: bool) -> None:
        """Return None: finer equations would each take a minute to compile."""

    @override
    def weight(self, size: int) -> float:
        return self.base.weight(size - 1)


def curve_of(
    base: AbstractPeriodicProblem,
    kind: str,
    shape: tuple[int, ...],
    scale: float,
    bounds: tuple[float, float],
) -> EventCurve:
    """Return the problem of orbits at an event, with the first parameter between bounds."""
    ends = ("first at its lower bound", "first at its upper bound")
    resonance = ("strong resonance",) if kind == PAIR else ()
    joints = tuple(one for one in base.watched if base.ends and one != kind)
    watched = (*ends, *resonance, *joints)
    limits = jnp.asarray(bounds[0], float), jnp.asarray(bounds[1], float)
    return EventCurve(
        base=base,
        scale=jnp.asarray(scale, float),
        bounds=limits,
        kind=kind,
        shape=shape,
        watched=watched,
        period=base.period,
    )


def cusps(branch: Branch) -> list[Special]:
    """Return where a curve of folds has a cusp: both parameters turn back at once.

    At the cusp the two branches of a fold meet; beyond it there is no fold.
    """
    problem, found = branch.problem, []
    assert isinstance(problem, EventCurve)
    size = np.sqrt(problem.base.weight(int(np.prod(problem.shape))))

    def way(point: Point) -> Float[np.ndarray, "2"]:
        """Return the direction of both parameters, in their scales."""
        return np.array([size * point.tangent[-2], point.tangent[-1]])

    for here, there in itertools.pairwise(branch.points):
        turn = way(here) - way(there)
        if way(here) @ way(there) < 0:
            piece = Branch(problem, branch.scale, [here, there], "")
            ((_, at),) = zeros(piece, lambda point, turn=turn: float(way(point) @ turn))
            found.append(Special(CUSP, np.nan if at is None else branch.scale * at.value, at))
    return found

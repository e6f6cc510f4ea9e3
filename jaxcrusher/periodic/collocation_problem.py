"""The problem of orbits over a parameter by Fourier collocation."""

import dataclasses
from collections.abc import Callable
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Scalar
from typing_extensions import override

from jaxcrusher.basics.loops import one_by_one
from jaxcrusher.periodic.collocation import TOLERANCE
from jaxcrusher.periodic.multipliers import (
    MORE_STEPS,
    STEPS,
    UNSURE,
    Multipliers,
    monodromy,
    multipliers,
)
from jaxcrusher.periodic.newton import Root, newton
from jaxcrusher.periodic.problem import (
    MOST_CORRECTIONS,
    AbstractEquations,
    AbstractPeriodicProblem,
    Linearised,
    OfMatrix,
    Parameters,
    Stride,
    Vanishing,
    Zero,
    zero_of,
)
from jaxcrusher.periodic.system import System
from jaxcrusher.periodic.trigonometric import resample

# Two places so near, in the unit of x, that they are one.
ALIKE = 1e-3
# The most nodes a turn that a motion gets, and an event is located again with.
MOST_NODES = 384

# Nodes -> numbers that are > 0 as long as nothing that is watched happens.
Watch = Callable[[Float[Array, "nodes dims"]], Float[Array, " watched"]]


def nothing(x: Float[Array, "nodes dims"]) -> Float[Array, "0"]:
    """Watch for nothing."""
    return jnp.zeros(0)


class CollocationProblem(AbstractPeriodicProblem):
    """Fourier collocation: u is x at equally spaced times of the period.

    `family(p)` is the system of orbits of `period` turns. `watch` makes the `monitors` of the nodes
    alone, in JAX, one for each name of `watched`.
    """

    family: Callable[[Array], System]  # the system at values of the parameters
    period: int = eqx.field(static=True, default=1)
    watched: tuple[str, ...] = eqx.field(static=True, default=())
    watch: Watch = eqx.field(static=True, default=nothing)

    stride: ClassVar[Stride] = Stride(first=0.01, longest=0.1, shortest=1e-8)
    ends: ClassVar[bool] = True

    @override
    def linearised(self, u: Float[Array, "nodes dims"], p: Parameters) -> Linearised:
        left, matrix = self.family(p).residual_and_jacobian(u)
        # Of few numbers: forward each costs a residual more.
        columns = jax.jacfwd(lambda p: self.family(p).residual(u))(p)
        return Linearised(left, matrix.reshape(u.size, u.size), columns)

    @eqx.filter_jit
    @override
    def left_out(self, u: Float[Array, "nodes dims"], p: Parameters) -> Array:
        """Return the defect, seen at twice as many points, in the harmonics that the nodes have."""
        system = self.family(p)
        at = system.at(u, 2 * len(u))
        found = one_by_one(system.acceleration, at, system.args)
        return resample(system.defect(u, found), len(u))

    @override
    def vanishing(self, of: OfMatrix, u: Array, p: Array, seen: Any) -> Vanishing:
        """Return a function of the monodromy matrix, with slopes in reverse.

        At a fold two multipliers may almost coincide. Then the steps that suffice elsewhere would
        place it where the multipliers by more steps are 1e-4 off 1.
        """

        def value(u: Array, p: Array) -> Scalar:
            return of(monodromy(self.family(p), u, MORE_STEPS[0]))

        return Vanishing(*jax.value_and_grad(value, argnums=(0, 1))(u, p))

    @override
    def monitored(self, which: int, u: Array, p: Array, seen: Any) -> Vanishing:
        value, by_nodes = jax.value_and_grad(lambda u: self.watch(u)[which])(u)
        return Vanishing(value, (by_nodes, jnp.zeros_like(p)))

    @override
    def find_zero(self, equations: AbstractEquations) -> Zero | None:
        return zero_of(_find_zero(equations))

    @override
    def monodromy(self, u: Array, p: Any, seen: Any) -> Float[np.ndarray, "n n"]:
        """Return the matrix that the variational equations give, in as many steps as it needs."""
        found = _multipliers(self, u, jnp.asarray(p), STEPS)
        for steps in MORE_STEPS:
            if found.error <= UNSURE:
                break
            found = _multipliers(self, u, jnp.asarray(p), steps)
        return np.asarray(found.monodromy)

    @override
    def turns(self, u: Any, seen: Any) -> int:
        by_turn, period = np.asarray(u).reshape(self.period, -1), self.period
        shorter = (turns for turns in range(1, period + 1) if period % turns == 0)
        apart = lambda turns: np.max(np.abs(by_turn - np.roll(by_turn, turns, axis=0)))  # noqa: E731
        return next(turns for turns in shorter if apart(turns) < ALIKE)

    @override
    def monitors(self, u: Array, p: Any, seen: Any) -> Float[np.ndarray, " watched"]:
        return np.asarray(self.watch(u))

    @override
    def over(self, turns: int, u: np.ndarray) -> tuple["CollocationProblem", np.ndarray]:
        family = eqx.Partial(_over, family=self.family, share=turns / self.period)
        nodes = np.resize(u, (len(u) * turns // self.period, *u.shape[1:]))
        return dataclasses.replace(self, family=family, period=turns), nodes

    @override
    def resolved(
        self, u: np.ndarray, finer: bool
    ) -> tuple["CollocationProblem", np.ndarray] | None:
        """Return twice as many nodes, up to the most that an orbit gets, or half as many.

        A turn has an even number of nodes.
        """
        if finer and len(u) >= MOST_NODES * self.period:
            return None
        count = 2 * len(u) if finer else len(u) // (4 * self.period) * 2 * self.period
        return self, np.asarray(resample(jnp.asarray(u), count))

    @override
    def weight(self, size: int) -> float:
        return 1 / size


@eqx.filter_jit
def _find_zero(equations: AbstractEquations) -> Root:
    linearised = lambda unknowns: equations.residual_and_jacobian(unknowns)[:2]  # noqa: E731
    return newton(linearised, jnp.asarray(equations.guess), TOLERANCE, MOST_CORRECTIONS)


@eqx.filter_jit
def _multipliers(problem: CollocationProblem, u: Array, p: Parameters, steps: int) -> Multipliers:
    return multipliers(problem.family(p), u, steps)


def _over(p: Parameters, *, family: Callable[[Array], System], share: float) -> System:
    """Return a system over a share or a multiple of its period."""
    system = family(p)
    return dataclasses.replace(system, period=share * system.period)

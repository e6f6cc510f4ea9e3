"""Motions of a system by the integrator, for shooting: their acceleration may have sharp bends."""

from collections.abc import Callable

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PyTree, Scalar
from typing_extensions import override

from jaxcrusher.basics.integrate import (
    Carried,
    InitialValueProblem,
    Integration,
    integrate,
    pi_controller,
)
from jaxcrusher.periodic.collocation_problem import Watch, nothing
from jaxcrusher.periodic.shooting_problem import BRANCH_RTOL, AbstractFlow
from jaxcrusher.periodic.system import System

# Steps of one integration, and the first step, as a share of its length.
MOST_STEPS, FIRST_STEP = 100_000, 1e-4
# Instants of a turn at which a motion is watched.
INSTANTS = 256


class IntegratedSystem(AbstractFlow):
    """Motions of the system `family(p)`, whose period is a turn, p of shape (n,).

    A state is x and behind it x', both of order one. `watch` makes the monitors of x at 256 equal
    steps a turn, in JAX, as of the nodes of a `CollocationProblem`.
    """

    family: Callable[[Float[Array, " n"]], System]
    watch: Watch = eqx.field(static=True, default=nothing)

    @eqx.filter_jit
    @override
    def slices(
        self, p: Float[Array, " n"], states: Float[Array, "slices twodims"], rtol: Scalar
    ) -> tuple[Array, Array, Array]:
        count, dims = states.shape

        def one(begin: tuple[Scalar, Array]) -> tuple[Array, Array]:
            place, state = begin

            def after(both: Array) -> tuple[Array, Array]:
                end = _passed(self.family(both[dims:]), both[:dims], (place, count), 1, rtol)[1]
                return end, end

            return jax.jacfwd(after, has_aux=True)(jnp.concatenate([state, p]))

        derivatives, ends = jax.lax.map(one, (jnp.arange(count) / count, states))
        return ends, derivatives[:, :, :dims], derivatives[:, :, dims:]

    @override
    def monitors(
        self, p: Float[Array, " n"], state: Float[np.ndarray, " twodims"], turns: int
    ) -> Float[np.ndarray, " watched"]:
        path, at = [], jnp.asarray(state)
        for _ in range(turns):
            seen, at = _turn(self, p, at)
            path.append(seen)
        return np.asarray(self.watch(jnp.concatenate(path)))


@eqx.filter_jit
def _turn(flow: IntegratedSystem, p: Array, state: Array) -> tuple[Array, Array]:
    """Return x at equal steps of a turn, its beginning first, and the state at its end."""
    path, end = _passed(flow.family(p), state, (0.0, 1), INSTANTS, BRANCH_RTOL)
    return jnp.concatenate([state[None, : path.shape[1]], path[:-1]]), end


def _passed(
    system: System,
    state: Float[Array, " twodims"],
    part: tuple[Scalar | float, int],
    instants: int,
    rtol: Scalar | float,
) -> tuple[Float[Array, "instants dims"], Float[Array, " twodims"]]:
    """Return x at equal steps of a part of a turn, and the state at its end; NaN of a failure.

    The part begins at a place in the turn; the other number says how many parts make a turn. Its
    time is counted in parts, so that it has the same length for every p.
    """
    tolerance = jax.lax.stop_gradient(jnp.asarray(rtol, float))
    method = Integration(diffrax.Dopri8(), pi_controller(tolerance), MOST_STEPS, FIRST_STEP, None)
    place, parts = part
    times = jnp.arange(1, instants + 1)[None] / instants
    (path, end), _ = integrate(
        (system, state, system.period * place, system.period / parts),
        times,
        problem=_PROBLEM,
        method=method,
    )
    return path[0], end[0]


def _initial(args: PyTree) -> Carried:
    return Carried(args[1], None)


def _field(share: Scalar, carried: Carried, args: PyTree) -> Carried:
    system, _, begin, length = args
    x, rate = jnp.split(carried.motion, 2)
    second = system.acceleration_at(begin + share * length, x, rate)
    return Carried(length * jnp.concatenate([rate, second]), None)


def _observe(share: Scalar, carried: Carried, args: PyTree) -> Array:
    return jnp.split(carried.motion, 2)[0]


def _summarise(seen: Array, carried: Carried, kept: None) -> tuple[Array, Array]:
    return seen, carried.motion


_PROBLEM = InitialValueProblem(_initial, _field, _observe, _summarise)

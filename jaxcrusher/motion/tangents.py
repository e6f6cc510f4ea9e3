"""A motion with its derivatives by its state and by parameters, slice by slice of a turn.

One compiled turn serves Lyapunov exponents, tangents over any horizon and the slope along a
periodic orbit: they are sums and products of the same matrices.
"""

from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float, PyTree, Scalar

from jaxcrusher.basics.integrate import Outcome, failure_text
from jaxcrusher.mechanism.reductions import Chosen, Statistic, of_slices
from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.motion.method import resolve
from jaxcrusher.motion.section import Slices, Sloped, fine, first_failure

Build = Callable[[Array], Scene]

# Slices of a turn between two orthonormalisations: exponents reach 14 a turn.
SLICES = 8


def same(_: Array, scene: Scene) -> Scene:
    """Build a scene that no parameter moves."""
    return scene


def tangents(
    build: Build,
    point: Float[Array, " n"],
    metric: str,
    state: Float[ArrayLike, " dims"],
    turns: int,
    rtol: float,
) -> Slices:
    """Return the slices of `turns` turns of `build(point)` from the section point `state`.

    They are NumPy arrays with the values of one `metric`, and NaN from a failure on. The tangents
    are integrated beside the motion, under the same tolerance. Every call runs the same compiled
    turn, whatever its length, tolerance, state and point.
    """
    state, parts, outcome = jnp.asarray(state), [], fine()
    outputs = build(point).entries((metric,))
    for _ in range(turns):
        state, part, after = sloped_turn(
            build, point, state, jnp.asarray(rtol, dtype=float), outputs
        )
        parts.append(part)
        outcome = first_failure(outcome, after)
    along = jax.tree.map(lambda *leaves: np.concatenate(leaves), *parts)
    return Slices(
        along.jacobians,
        along.forcing,
        along.values[metric],
        along.by_state[metric],
        along.by_parameter[metric],
        failure_text(outcome, "rad of phase"),
    )


@eqx.filter_jit
def sloped_turn(
    build: Build,
    point: Float[Array, " n"],
    state: Float[Array, " dims"],
    rtol: Scalar,
    outputs: Chosen = (),
) -> tuple[Float[Array, " dims"], Slices, Outcome]:
    """Return where a turn leads from a section point, its slices with slopes, and the outcome."""
    return Sloped(build, point, resolve(build(point), rtol), outputs).turn(state, SLICES)


@eqx.filter_jit
def slices_apart(
    build: Build, point: Float[Array, " n"], states: Float[Array, "slices dims"], rtol: Scalar
) -> tuple[
    Float[Array, "slices dims"], Float[Array, "slices dims dims"], Float[Array, "slices dims n"]
]:
    """Return where each slice leads from its own state, with slopes by the state and parameters.

    NaN from a failure on.
    """
    sloped, span = Sloped(build, point, resolve(build(point), rtol)), 2 * np.pi / len(states)

    def one(begin: tuple[Array, Array]) -> tuple[Array, Array, Array]:
        end, found, _ = sloped.slice(*begin, span)
        return end, found.jacobians, found.forcing

    return jax.lax.map(one, (states, span * jnp.arange(len(states), dtype=float)))


def changes(
    parts: Slices, moved: Float[np.ndarray, "dims n"]
) -> PyTree[Float[np.ndarray, "slices ... n"]]:
    """dm/dp of each slice, if dx/dp is `moved` at the beginning.

    Not finite where a tangent has left the range of floats.
    """
    before = np.empty((len(parts.jacobians), *moved.shape))
    with np.errstate(over="ignore", invalid="ignore"):
        for i, jacobian in enumerate(parts.jacobians):
            before[i], moved = moved, jacobian @ moved + parts.forcing[i]
        # One product of matrices a slice, whatever a slice keeps.
        return jax.tree.map(
            lambda by_state, by_parameter: (
                np.einsum("i...d,idn->i...n", by_state, before) + by_parameter
            ),
            parts.by_state,
            parts.by_parameter,
        )


def combine(
    metric: Statistic,
    values: PyTree[Float[np.ndarray, "slices ..."]],
    changes: PyTree[Float[np.ndarray, "slices ... n"]],
) -> Float[np.ndarray, " n"]:
    """Slopes of the statistic over the whole turns that all slices make, or over a part of one."""
    turns = max(1, len(jax.tree.leaves(values)[0]) // SLICES)
    weights = jax.grad(lambda kept: of_slices(metric.reduction, kept, turns))(values)
    with np.errstate(over="ignore", invalid="ignore"):
        parts = jax.tree.map(lambda w, c: np.tensordot(w, c, np.ndim(w)), weights, changes)
        return np.sum(jax.tree.leaves(parts), axis=0)

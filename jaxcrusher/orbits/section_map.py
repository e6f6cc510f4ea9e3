"""The map of a turn, from section point to section point, and its slopes, in pure JAX.

The motion may lose contact and impact. Contact sets in without a jump of the force, and loads are
smooth: tangents pass an impact as they are integrated, and nothing is added to them there (a
saltation matrix would be the identity). Tangents are taken in slices of a turn, since those of a
whole turn of impacts have no digits left.
"""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Float, PyTree, Scalar

from jaxcrusher.mechanism.reductions import Chosen
from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.motion.flow import Flow, flat, unflattened
from jaxcrusher.motion.method import resolve
from jaxcrusher.motion.section import Slices, advance
from jaxcrusher.motion.tangents import SLICES, sloped_turn

# A section point, and what slices of turns keep of statistics: means, or samples.
Passed = tuple[Float[Array, " dims"], dict[str, PyTree[Array]]]


@eqx.filter_jit
def passed(
    scene: Scene, state: Float[Array, " dims"], rtol: Scalar | float, outputs: Chosen = ()
) -> Passed:
    """Return where a turn leads from a section point, and the outputs of its slices."""
    method, span = resolve(scene, rtol), 2 * np.pi / SLICES

    def slice_of(state: Array, phase: Scalar) -> Passed:
        # A failure leaves NaN, with which all that follows fails at once.
        flow = Flow(scene, unflattened(state, scene), phase)
        end, seen, _ = advance(flow, span, method, outputs)
        return flat(end), seen

    return jax.lax.scan(slice_of, state, span * jnp.arange(SLICES, dtype=float))


def chained(
    jacobians: Float[Array, "slices dims dims"], first: Float[Array, "dims dims"]
) -> Float[Array, "dims dims"]:
    """Multiply the Jacobians of slices, the last on the left and `first` on the right."""
    return jax.lax.scan(lambda matrix, one: (one @ matrix, None), first, jacobians)[0]


def outputs_along(
    scene: Scene, state: Float[Array, " dims"], period: int, rtol: float, outputs: Chosen
) -> Passed:
    """Return the section point of an orbit and the outputs of all slices, with slopes.

    Slopes are by the scene's numbers: x = P(x, p) moves by (I - P_x)^-1 P_p, and outputs with it.
    `state` has no slopes of its own. Turn by turn, one program serves all periods.
    """
    state = jax.lax.stop_gradient(state)
    return _outputs_along(scene, state, period=period, rtol=rtol, outputs=outputs)


@eqx.filter_custom_jvp
def _outputs_along(
    scene: Scene, state: Array, *, period: int, rtol: float, outputs: Chosen
) -> Passed:
    parts, x = [], state
    if not outputs:
        return state, {}
    for _ in range(period):
        x, seen = passed(scene, x, jnp.asarray(rtol), outputs)
        parts.append(seen)
    return state, _joined(parts)


@_outputs_along.def_jvp
def _outputs_along_jvp(
    primals: tuple, tangents: tuple, *, period: int, rtol: float, outputs: Chosen
) -> tuple[Passed, Passed]:
    (scene, state), (change, _) = primals, tangents
    moves = jax.tree.map(lambda leaf: leaf is not None, change, is_leaf=lambda leaf: leaf is None)
    moving, fixed = eqx.partition(scene, moves)
    point, unravel = ravel_pytree(moving)
    # It has slopes of its own, by which second derivatives are right.
    state, _ = _outputs_along(scene, state, period=period, rtol=rtol, outputs=())
    build, parts, x = eqx.Partial(_combined, unravel=unravel, fixed=fixed), [], state
    for _ in range(period):
        x, slices, _ = sloped_turn(build, point, x, jnp.asarray(rtol), outputs)
        parts.append(slices)
    slices = _joined(parts)
    return (state, slices.values), _moved(slices, ravel_pytree(change)[0])


def _combined(point: Array, unravel: Any, fixed: Scene) -> Scene:
    return eqx.combine(unravel(point), fixed)


@jax.jit
def _moved(slices: Slices, change: Float[Array, " n"]) -> Passed:
    """Return how an orbit's section point and outputs move when its numbers change."""

    def carried(moved: Array, one: Slices) -> tuple[Array, dict[str, PyTree[Array]]]:
        both = one.by_state, one.by_parameter
        seen = jax.tree.map(lambda by_x, by_p: by_x @ moved + by_p @ change, *both)
        return one.jacobians @ moved + one.forcing @ change, seen

    eye = jnp.eye(slices.jacobians.shape[1])
    forcing, _ = jax.lax.scan(carried, jnp.zeros(len(eye)), slices)
    moved = jnp.linalg.solve(eye - chained(slices.jacobians, eye), forcing)
    return moved, jax.lax.scan(carried, moved, slices)[1]


def _joined(parts: list[PyTree]) -> PyTree:
    return jax.tree.map(lambda *leaves: jnp.concatenate(leaves), *parts)

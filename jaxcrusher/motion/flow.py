"""A piece of motion: its scene, initial state and initial phase.

The phase is omega t in radians, where omega is the drive's nominal speed: 2 pi a turn, not reset at
each turn. At constant speed it is the angle that the shaft has turned through; for a free shaft it
is not.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, ArrayLike, Float, PyTree, Scalar

from jaxcrusher.basics.checks import require
from jaxcrusher.basics.plane import scalar
from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.mechanism.snapshot import Snapshot
from jaxcrusher.mechanism.state import unwound


class Flow(eqx.Module):
    """The scene and initial state of a motion; without a state it begins with the scene's start."""

    scene: Scene
    state: PyTree[Scalar] | None = None
    phase: Scalar = eqx.field(converter=scalar, default=0.0)  # rad

    def initial(self) -> PyTree[Scalar]:
        """The state to begin with."""
        return self.scene.formulation.initial(self.scene) if self.state is None else self.state


@jax.jit  # one trace for the rate, for what is observed, and for every set of outputs
def by_phase(phase: Scalar, state: PyTree[Scalar], scene: Scene) -> tuple[PyTree[Scalar], Snapshot]:
    """The derivative of the state by the phase (rad), and its snapshot.

    By phase every design has the same span.
    """
    speed = scene.drive.speed
    snapshot = scene.formulation.snapshot(phase / speed, state, scene)
    rate = scene.formulation.rate(snapshot, state, scene)
    return jax.tree.map(lambda leaf: leaf / speed, rate), snapshot


@eqx.filter_jit
def initial_state(scene: Scene) -> Float[Array, " dims"]:
    """Where the scene starts, as a section point."""
    return flat(scene.formulation.initial(scene))


def flat(state: PyTree[Scalar]) -> Float[Array, " dims"]:
    """A state as a section point: a free shaft's angle is counted from the nearest whole turn."""
    return ravel_pytree(unwound(state))[0].astype(float)


def unflattened(state: Float[ArrayLike, " dims"] | None, scene: Scene) -> PyTree[Scalar] | None:
    """The state of a section point; None, which stands for the scene's start, remains.

    Raises ValueError for another shape than the scene's states have.
    """
    if state is None:
        return None
    start, unravel = ravel_pytree(scene.formulation.initial(scene))
    require(jnp.shape(state) == start.shape, "state", f"have shape {start.shape}", jnp.shape(state))
    return unravel(jnp.asarray(state, dtype=start.dtype))

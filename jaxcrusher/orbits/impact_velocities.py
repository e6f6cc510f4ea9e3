"""Tracked impact velocities, held at their final values.

In contact a tracked impact velocity is constant, and any value of it repeats: an orbit does not
determine it. The motion from the scene's own start does. Once this motion neither closes nor opens
a gap that tracks, its last impact has fixed the velocity, and the scene with this constant has the
same motion. A slider in its guide tracks a velocity at each of its corners.
"""

import dataclasses
from collections.abc import Mapping

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float, PyTree, Scalar

from jaxcrusher.joint.clearance import touches_of
from jaxcrusher.mechanism.named import Named
from jaxcrusher.mechanism.reductions import ALL_THE_TIME, ShareAboveZero, Statistic
from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.mechanism.snapshot import Snapshot
from jaxcrusher.motion.flow import initial_state, unflattened
from jaxcrusher.motion.section import poincare_section
from jaxcrusher.orbits import forced
from jaxcrusher.orbits.effort import Budget
from jaxcrusher.orbits.transient import PIECE, TRANSIENT_RTOL, TURNS, piece

# Turns that must keep contact, looked at after each `TURNS`.
KEPT = 12


@dataclasses.dataclass(frozen=True)
class Depth:
    """The penetration at one of the touches of a joint, m."""

    joint: str
    touch: int

    def __call__(self, s: Snapshot, scene: Scene) -> Scalar:
        """Return it at an instant."""
        contact = s.contacts.at(self.joint)
        return (contact.corners or (contact,))[self.touch].penetration


def settled_velocities(scene: Scene, budget: Budget) -> dict[str, Array] | None:
    """Return the final impact velocities of the joints that track them, from the scene's start.

    In m/s: one of a pin, four of a slider's corners. None where touches go on closing within an
    effort: each impact then sets another velocity. Concrete values only.
    """
    tracking = forced.tracking(scene)
    counts = {name: len(touches_of(scene.joints.at(name).initial_memory())) for name in tracking}
    depths = [Depth(name, touch) for name, count in counts.items() for touch in range(count)]
    how = "1", "share of the time in which it is closed"
    closed = {
        f"touch_{i}": Statistic(*how, depth, ShareAboveZero()) for i, depth in enumerate(depths)
    }
    watched = scene.with_statistics(closed)
    state = initial_state(scene)
    for _ in range(budget.bounds.turns // TURNS):
        for _ in range(TURNS // PIECE):
            if not budget.affords(PIECE):
                return None
            states, _, outcome = piece((state, scene))
            budget.integrated(outcome, PIECE)
            budget.turns += PIECE
            state = states[-1]
            if not bool(outcome.success):
                return None
        seen = poincare_section(
            watched, 0, KEPT, state=state, outputs=tuple(closed), rtol=TRANSIENT_RTOL
        )
        shares = [np.asarray(seen.values[name]) for name in closed]
        # A touch that never closes has no impacts either, and its velocity does not matter.
        if all(bool(np.all(one >= ALL_THE_TIME) or np.all(one == 0)) for one in shares):
            at = unflattened(state, scene)
            assert at is not None
            return {name: _velocities(scene, name, at.parts.memories[name]) for name in tracking}
    return None


def _velocities(scene: Scene, name: str, memory: PyTree[Array]) -> Float[Array, "*touches"]:
    law = scene.joints.at(name).normal.impact_velocity
    found = [law.value(one.impact) for one in touches_of(memory)]
    return found[0] if len(found) == 1 else jnp.stack(found)


def held(scene: Scene, velocities: Mapping[str, Float[ArrayLike, "*touches"]]) -> Scene:
    """Return the scene whose joints of these names have constant impact velocities."""
    joints = {
        name: joint.holding(velocities[name]) if name in velocities else joint
        for name, joint in scene.joints.items()
    }
    return dataclasses.replace(scene, joints=Named(joints))

"""Tracked impact velocities, held at their final values.

In contact a tracked impact velocity is constant, and any value of it repeats: an orbit does not
determine it. The motion from the scene's own start does. Once this motion keeps contact at every
joint, its last impact has fixed the velocity, and the scene with this constant has the same motion.
"""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxcrusher.joint.clearance import Memory
from jaxcrusher.joint.normal import ConstantImpactVelocity
from jaxcrusher.mechanism.reductions import ALL_THE_TIME
from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.motion.flow import initial_state, unflattened
from jaxcrusher.motion.section import poincare_section
from jaxcrusher.orbits.effort import Budget
from jaxcrusher.orbits.transient import PIECE, TRANSIENT_RTOL, TURNS, piece

# Turns that must keep contact, looked at after each `TURNS`.
KEPT = 12


def settled_velocities(scene: Scene, budget: Budget) -> dict[str, Array] | None:
    """Return the final impact velocity of each joint, from the scene's start, in m/s.

    None where contact is not kept within an effort: each impact then sets another velocity.
    Concrete values only.
    """
    outputs = tuple(f"{scene.prefix(name)}contact_fraction" for name in scene.joints.names)
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
        seen = poincare_section(scene, 0, KEPT, state=state, outputs=outputs, rtol=TRANSIENT_RTOL)
        if all(bool(np.all(seen.values[name] >= ALL_THE_TIME)) for name in outputs):
            at = unflattened(state, scene)
            assert at is not None
            found = {}
            for name, joint in scene.joints.items():
                memory = at.parts.memories[name]
                impact = memory.impact if isinstance(memory, Memory) else None
                found[name] = joint.normal.impact_velocity.value(impact)
            return found
    return None


def held(scene: Scene, velocities: dict[str, Array]) -> Scene:
    """Return the scene whose joints that track their impact velocity have these constant ones."""
    for name, velocity in velocities.items():
        if scene.joints.at(name).normal.impact_velocity.initial() is None:
            continue  # the law of a whole bearing of one's own may not be a field of it
        law = ConstantImpactVelocity(jnp.asarray(velocity))
        scene = eqx.tree_at(lambda s, n=name: s.joints[n].normal.impact_velocity, scene, law)
    return scene

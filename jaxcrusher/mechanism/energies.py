"""Energies of an instant: sums over the bodies of a linkage, and over a frame on supports."""

import jax.numpy as jnp
from jaxtyping import Scalar

from jaxcrusher.mechanism.arms import plus
from jaxcrusher.mechanism.scene import AbstractScene
from jaxcrusher.mechanism.snapshot import Snapshot


def kinetic_energy(s: Snapshot, scene: AbstractScene) -> Scalar:
    """Return the kinetic energy of the bodies, and of a frame on supports, J."""
    total, drift = jnp.zeros_like(s.motion.crank.speed), None
    frame, foundation = s.frame, scene.supports
    if frame is not None and foundation is not None:
        drift = frame.velocity.seen_from(frame.axis)
        total = foundation.mass * drift.dot(drift) + foundation.inertia * frame.spin**2
    for name, body in scene.linkage.bodies.items():
        velocity, spin = s.motion.centre_velocity(name), s.motion.spin(name)
        if drift is not None and frame is not None and foundation is not None:
            arm = s.motion.centre(name) - foundation.point
            velocity = drift + frame.spin * arm.perp() + velocity
            spin = plus(spin, frame.spin)
        total = total + body.mass * velocity.dot(velocity)
        total = total if spin is None else total + body.inertia * spin**2
    return 0.5 * total


def potential_energy(s: Snapshot, scene: AbstractScene) -> Scalar:
    """Return the potential energy of weight, zero at the height of the origin as drawn, J."""
    total, frame, foundation = jnp.zeros_like(s.motion.crank.speed), s.frame, scene.supports
    places = [(body, s.motion.centre(name)) for name, body in scene.linkage.bodies.items()]
    if frame is not None and foundation is not None:
        centre = foundation.point + frame.displacement
        total = foundation.mass * centre.y
        places = [(b, centre + (at - foundation.point).along(frame.axis)) for b, at in places]
    for body, place in places:
        total = total + body.mass * place.y
    return scene.linkage.gravity * total

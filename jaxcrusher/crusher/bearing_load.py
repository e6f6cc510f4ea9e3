"""What the main bearing stands: stiffness, and of rollers the pressure and the fatigue life."""

import jax
import jax.numpy as jnp
from jaxtyping import Scalar

from jaxcrusher.basics.checks import require, require_own_process, require_positive
from jaxcrusher.joint.clearance import AbstractBearing
from jaxcrusher.joint.rollers import LIFE_EXPONENT, RollerBearing
from jaxcrusher.mechanism.observables import force_at
from jaxcrusher.mechanism.scene import AbstractScene
from jaxcrusher.mechanism.snapshot import Snapshot

# Turns that a bearing at its dynamic rating lasts (ISO 281), and seconds an hour.
RATED_TURNS, HOUR = 1e6, 3600.0


def bearing_stiffness(scene: AbstractScene, force: float | Scalar) -> Scalar:
    """Return dF/de of the main bearing at rest under a force (N, > 0), N/m.

    Raises ValueError for an ideal bearing.
    """
    require_own_process()
    require_positive("force", force, "N")
    law = _main(scene, "scene").normal
    return jax.grad(law.elastic_force)(law.penetration_under(jnp.asarray(force, float)))


def stiffness_now(s: Snapshot, scene: AbstractScene) -> Scalar:
    """Return dF/de of the main bearing where it is, N/m; ValueError for an ideal one."""
    joint, contact = _main(scene, "outputs"), s.contacts["main"]
    assert contact is not None
    return jax.grad(joint.normal.elastic_force)(contact.penetration)


def roller_pressure(s: Snapshot, scene: AbstractScene) -> Scalar:
    """Return Hertz's pressure of the most loaded roller, Pa; ValueError without rollers."""
    bearing, contact = _rollers(scene), s.contacts["main"]
    assert contact is not None
    return bearing.pressure(contact.penetration)


def static_load(s: Snapshot, scene: AbstractScene) -> Scalar:
    """Return the load of a bearing over its static rating; ValueError without rollers."""
    bearing = _rollers(scene)
    return force_at(s, scene, "main") / (bearing.bearings * bearing.static_rating)


def fatigue(s: Snapshot, scene: AbstractScene) -> Scalar:
    """Return the share of its life L10 that a bearing uses in an hour; ValueError without rollers.

    ISO 281 with the exponent 10/3, without its factor of lubrication and cleanness. The rings turn
    against each other once in a turn of the shaft.
    """
    bearing = _rollers(scene)
    load = force_at(s, scene, "main") / (bearing.bearings * bearing.dynamic_rating)
    turns = jnp.abs(s.motion.crank.speed) / (2 * jnp.pi) * HOUR
    return turns / RATED_TURNS * load**LIFE_EXPONENT


def _main(scene: AbstractScene, name: str) -> AbstractBearing:
    joint = scene.joints["main"]
    require(joint is not None, name, "go with a main bearing with clearance", "with an ideal one")
    assert joint is not None
    return joint


def _rollers(scene: AbstractScene) -> RollerBearing:
    joint = scene.joints["main"]
    if not isinstance(joint, RollerBearing):
        raise ValueError("Argument `outputs` must not ask for rollers where A has none, but does.")
    return joint

"""Slopes of a statistic of the settled motion, beside differences of settled motions."""

from collections.abc import Callable
from dataclasses import dataclass

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxcrusher.crusher.scene import Scene
from jaxcrusher.motion.flow import flat, initial_state
from jaxcrusher.settled.forced import refusal
from jaxcrusher.settled.periodic_orbit import periodic_orbit
from jaxcrusher.settled.result import PeriodicOrbit

# A start no further from the orbit, in clearances and m/s, swings about it: the contact is
# some hundredths of a clearance deep.
NEAR = 0.01
# An orbit that penetrates less, in clearances, is about to lose contact.
GRAZING = 1e-3
# A radius so much smaller tells what rounding and the equations' solution leave in a slope.
SMALLER = 1e-3


@dataclass(frozen=True)
class SettledSlopes:
    """Of one statistic of an orbit by n numbers."""

    orbit: PeriodicOrbit
    values: Float[np.ndarray, " n"]
    errors: Float[np.ndarray, " n"]  # the distance from differences over a small radius
    beside: Float[np.ndarray, " n"]  # differences over the radius; NaN where there is no orbit


def settled_slopes(
    build: Callable[[Array], Scene],
    point: Float[Array, " n"],
    metric: str,
    radii: Float[np.ndarray, " n"],
) -> SettledSlopes | None:
    """By the numbers of `point`, of the stable motion that the scene `build(point)` starts beside.

    None where there is none to be had so: for a scene that `periodic_orbit` refuses, an orbit that
    is not found, not stable, hardly in contact, or not near the scene's start.
    """
    scene = _built(build, point)
    if scene.joint is None or refusal(scene):
        return None
    orbit = periodic_orbit(scene)
    if orbit.eccentricity is None or not bool(orbit.stable & (orbit.least_penetration > GRAZING)):
        return None
    if jnp.max(jnp.abs(initial_state(scene) - flat(orbit.state(), scene))) > NEAR:
        return None
    nodes = len(orbit.eccentricity)

    # Not under `jax.jit`: the program that has solved for the orbit serves all of these.
    def value(point: Array) -> Array:
        return periodic_orbit(_built(build, point), nodes=nodes)[metric]

    def difference(shift: Float[np.ndarray, " n"], radius: float) -> float:
        ahead, behind = (float(value(point + sign * shift)) for sign in (1, -1))
        if np.isfinite(ahead) and np.isfinite(behind):
            return (ahead - behind) / (2 * radius)
        # At a limit of the number the parabola through it and two points on its other side.
        side = 1 if np.isfinite(ahead) else -1
        near = ahead if side == 1 else behind
        far = float(value(point + 2 * side * shift))
        return side * (4 * near - far - 3 * float(orbit[metric])) / (2 * radius)

    def differences(radii: Float[np.ndarray, " n"]) -> np.ndarray:
        pairs = zip(np.diag(radii), radii, strict=True)
        return np.array([difference(shift, radius) for shift, radius in pairs])

    values = np.asarray(jax.jacfwd(value)(point))

    return SettledSlopes(
        orbit, values, np.abs(differences(SMALLER * radii) - values), differences(radii)
    )


@eqx.filter_jit
def _built(build: Callable[[Array], Scene], point: Array) -> Scene:
    return build(point)

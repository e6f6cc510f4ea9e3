"""Slopes of a statistic of a periodic orbit, beside differences of orbits."""

from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.motion.flow import flat, initial_state
from jaxcrusher.motion.tangents import Build
from jaxcrusher.orbits.forced import refusal
from jaxcrusher.orbits.periodic_orbit import periodic_orbit
from jaxcrusher.orbits.result import WAYS, PeriodicOrbit
from jaxcrusher.orbits.shot import shoot

# A start no further from the orbit, in clearances and m/s, swings about it: the contact is
# some hundredths of a clearance deep.
NEAR = 0.01
# An orbit that penetrates less, in clearances, is about to lose contact.
GRAZING = 1e-3
# A radius so much smaller tells what rounding and the equations' solution leave in a slope.
SMALLER = 1e-3


def orbit_beside(scene: Scene) -> PeriodicOrbit | None:
    """Return the stable motion that a scene starts beside, with what its slopes need.

    None where there is none: for a scene that `periodic_orbit` refuses, and for an orbit that is
    not found, not stable, hardly in contact, or not near the scene's start.
    """
    if scene.is_ideal or refusal(scene):
        return None
    orbit = periodic_orbit(scene, effort="thorough")
    if orbit.eccentricity is None or not bool(orbit.stable & (orbit.least_penetration > GRAZING)):
        return None
    apart = jnp.max(jnp.abs(initial_state(scene) - flat(orbit.state())))
    return orbit if apart <= NEAR else None


def orbit_slopes(
    build: Build,
    point: Float[Array, " n"],
    metric: str,
    radii: Float[np.ndarray, " n"],
    orbit: PeriodicOrbit,
) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"], Float[np.ndarray, " n"]]:
    """Return slopes of a statistic by `point` of the orbit of the scene `build(point)`.

    With them come their errors, which are the distances from differences over small radii, and
    differences over the `radii`, which are NaN where there is no orbit. Neighbours are found by
    shooting if the orbit was, otherwise by collocation.
    """
    by_shooting, how = bool(orbit.way == WAYS.shooting), orbit.alike

    # Not under `jax.jit`: the program that has solved for the orbit serves all of these.
    def value(point: Array) -> Array:
        scene = _built(build, point)
        if by_shooting:
            return shoot(scene, orbit.section, orbit.period)[metric]
        return periodic_orbit(scene, **how)[metric]

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
    return values, np.abs(differences(SMALLER * radii) - values), differences(radii)


@eqx.filter_jit  # traced: a neighbour of a parameter at its limit lies outside
def _built(build: Callable[[Array], Scene], point: Array) -> Scene:
    return build(point)

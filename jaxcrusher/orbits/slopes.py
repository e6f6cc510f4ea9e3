"""Slopes of a statistic of a periodic orbit, beside differences of orbits.

By collocation (`orbit_slopes`), and by tangents along an orbit that was shot for.
"""

from collections.abc import Callable
from dataclasses import dataclass

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float

from jaxcrusher.crusher.scene import Scene
from jaxcrusher.motion.flow import flat, initial_state
from jaxcrusher.motion.statistics import over_pieces
from jaxcrusher.motion.tangents import Build, Tangents, chain, changes, combine
from jaxcrusher.orbits.forced import refusal
from jaxcrusher.orbits.periodic_orbit import periodic_orbit
from jaxcrusher.orbits.result import PeriodicOrbit
from jaxcrusher.orbits.shooting import section_point

# A start no further from the orbit, in clearances and m/s, swings about it: the contact is
# some hundredths of a clearance deep.
NEAR = 0.01
# An orbit that penetrates less, in clearances, is about to lose contact.
GRAZING = 1e-3
# A radius so much smaller tells what rounding and the equations' solution leave in a slope.
SMALLER = 1e-3


@dataclass(frozen=True)
class SettledSlopes:
    """Slopes of one statistic of an orbit by n numbers."""

    orbit: PeriodicOrbit
    values: Float[np.ndarray, " n"]
    errors: Float[np.ndarray, " n"]  # the distance from differences over a small radius
    beside: Float[np.ndarray, " n"]  # differences over the radius; NaN where there is no orbit


def orbit_slopes(
    build: Callable[[Array], Scene],
    point: Float[Array, " n"],
    metric: str,
    radii: Float[np.ndarray, " n"],
) -> SettledSlopes | None:
    """Return slopes by `point` of the stable motion that the scene `build(point)` starts beside.

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
    how = orbit.alike

    # Not under `jax.jit`: the program that has solved for the orbit serves all of these.
    def value(point: Array) -> Array:
        return periodic_orbit(_built(build, point), **how)[metric]

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


def orbit_shift(along: Tangents) -> Float[np.ndarray, "dims n"]:
    """Return how the section point of the orbit moves: x = P(x, p) gives (I - P_x)^-1 P_p."""
    matrix, forcing = chain(along)
    return np.linalg.solve(np.eye(len(matrix)) - matrix, forcing)


def periodic_slopes(along: Tangents, metric: str) -> Float[np.ndarray, " n"]:
    """Return slopes of `metric` by the parameters, the motion staying on its orbit.

    m(x, p) over a period has the slope m_p + m_x dx/dp, with dx/dp of `orbit_shift`. Exact for a
    motion that has settled; a run that has not differs by its swing.
    """
    return combine(metric, along.values, changes(along, orbit_shift(along)))


def multipliers(along: Tangents) -> Complex[np.ndarray, " dims"]:
    """Return the Floquet multipliers: a shift from the orbit grows by these in a period."""
    return np.linalg.eigvals(chain(along)[0])


def orbit_differences(
    build: Build,
    point: Float[np.ndarray, " n"],
    metric: str,
    orbit: tuple[np.ndarray, Tangents],
    period: int,
    radius: Float[np.ndarray, " n"],
) -> Float[np.ndarray, " n"]:
    """Return central differences of `metric` over orbits at `point` ± `radius`, one by one.

    `orbit` is the one at `point`. NaN where there is no neighbour that repeats after `period`.
    """
    state, along = orbit
    found = np.full(len(point), np.nan)
    for i, shift in enumerate(np.diag(radius)):
        ends = [
            section_point(
                build,
                jnp.asarray(point + sign * shift),
                metric,
                state + sign * orbit_shift(along) @ shift,
                period,
            )
            for sign in (1, -1)
        ]
        high, low = (np.nan if end is None else _value(end[1], metric) for end in ends)
        found[i] = (high - low) / (2 * radius[i])
    return found


def _value(along: Tangents, metric: str) -> float:
    return float(over_pieces(metric, jnp.asarray(along.values)))

"""Periodic orbits by the integrator: Newton's method on the map from section to section.

They may lose contact and impact. The map's derivatives are tangents under error control, in slices
of a turn, since none of a whole turn of impacts has digits left.
"""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Complex, Float

from jaxcrusher.crusher.formulations import EccentricityFormulation
from jaxcrusher.crusher.scene import Scene
from jaxcrusher.joint.validity import validity
from jaxcrusher.motion.section import poincare_section
from jaxcrusher.motion.simulation import simulate
from jaxcrusher.motion.statistic import SAMPLES, STATISTIC
from jaxcrusher.motion.statistics import over_pieces
from jaxcrusher.motion.tangents import Build, Tangents, chain, changes, combine, tangents
from jaxcrusher.settled import newton
from jaxcrusher.settled.result import RESULTS, PeriodicOrbit, judged

ITERATIONS = 8
# Of Newton's last step, in clearances and m/s, and the tolerance of the integration.
CLOSURE, RTOL = 1e-7, 1e-11


def shoot(scene: Scene, guess: Float[ArrayLike, " 4"], period: int) -> PeriodicOrbit:
    """The orbit of `scene` through a section point near `guess` (concrete values only).

    Its `error` is what a tolerance 100 times as large makes of the RMS, that of its multipliers
    what it makes of their matrix.
    """
    build, none = eqx.Partial(_same, scene=scene), jnp.zeros(0)
    found = section_point(build, none, "foundation_rms", guess, period)
    if found is None:
        missing = jnp.full(4, jnp.nan)
        return judged(_described(scene, missing, period, None), RESULTS.open)
    state, along = found
    matrix, _ = chain(along)
    state = state + np.linalg.solve(np.eye(4) - matrix, along.state - state)
    coarse, _ = chain(tangents(build, none, "foundation_rms", state, period, 100 * RTOL))
    blur = np.max(np.abs(coarse - matrix)) / np.max(np.abs(matrix))
    orbit = _described(scene, state, period, (np.linalg.eigvals(matrix), blur))
    return judged(orbit, orbit.result)


def _same(_: Array, scene: Scene) -> Scene:
    return scene


def _described(
    scene: Scene,
    state: Float[ArrayLike, " 4"],
    period: int,
    found: tuple[np.ndarray, float] | None,
) -> PeriodicOrbit:
    """What is known of the orbit through a section point."""
    assert scene.joint is not None
    slides = scene.joint.friction is not None
    names = tuple(n for n in STATISTIC if slides or n != "sliding_power")
    runs = [
        poincare_section(scene, 0, period, state=state, outputs=names, rtol=rtol)
        for rtol in (RTOL, 100 * RTOL)
    ]
    values = {name: over_pieces(name, runs[0].values[name]) for name in names}
    coarse = over_pieces("foundation_rms", runs[1].values["foundation_rms"])
    points = SAMPLES * period
    times = 2 * np.pi / scene.drive.speed * np.arange(points) / SAMPLES
    seen = simulate(scene, times, state=state, outputs=("eccentricity", "penetration_ratio"))
    multipliers, blur = (np.full(4, np.nan, complex), np.nan) if found is None else found
    return PeriodicOrbit(
        scene,
        period,
        seen["eccentricity"] / scene.joint.clearance,
        RESULTS.promote(newton.RESULTS.successful),
        jnp.array(0),
        values,
        jnp.abs(coarse / values["foundation_rms"] - 1),
        jnp.min(seen["penetration_ratio"]),
        jnp.asarray(multipliers, complex),
        jnp.asarray(blur),
        validity(scene.joint, values["penetration_ratio"], values["impact_speed"]),
    )


def section_point(
    build: Build,
    point: Float[Array, " n"],
    metric: str,
    guess: Float[ArrayLike, " dims"],
    period: int,
) -> tuple[np.ndarray, Tangents] | None:
    """The section point near `guess` that repeats after `period` turns, by Newton's method.

    With it come the derivatives along the orbit. None if the iteration does not converge, if a
    multiplier is 1 (whatever is near repeats too), or if the state holds more than eccentricity
    and rate (a memory that no impact renews repeats whatever it is).
    """
    x = np.asarray(guess, dtype=float)
    # Traced: a neighbour of a parameter at its limit lies outside.
    scene = eqx.filter_eval_shape(build, point)
    if not isinstance(scene.formulation, EccentricityFormulation) or x.size != 4:
        return None
    for _ in range(ITERATIONS):
        along = tangents(build, point, metric, x, period, RTOL)
        matrix, _ = chain(along)
        if not np.isfinite(matrix).all():
            return None
        try:
            step = np.linalg.solve(np.eye(4) - matrix, along.state - x)
        except np.linalg.LinAlgError:
            return None
        if float(np.max(np.abs(step))) < CLOSURE:
            return x, along
        x = x + step
    return None


def orbit_shift(along: Tangents) -> Float[np.ndarray, "dims n"]:
    """How the section point of the orbit moves: x = P(x, p) gives (I - P_x)^-1 P_p."""
    matrix, forcing = chain(along)
    return np.linalg.solve(np.eye(len(matrix)) - matrix, forcing)


def periodic_slopes(along: Tangents, metric: str) -> Float[np.ndarray, " n"]:
    """Slopes of `metric` by the parameters, the motion staying on its orbit.

    m(x, p) over a period has the slope m_p + m_x dx/dp, with dx/dp of `orbit_shift`. Exact for a
    motion that has settled; a run that has not differs by its swing.
    """
    return combine(metric, along.values, changes(along, orbit_shift(along)))


def multipliers(along: Tangents) -> Complex[np.ndarray, " dims"]:
    """Floquet multipliers: a shift from the orbit grows by these in a period."""
    return np.linalg.eigvals(chain(along)[0])


def orbit_differences(
    build: Build,
    point: Float[np.ndarray, " n"],
    metric: str,
    orbit: tuple[np.ndarray, Tangents],
    period: int,
    radius: Float[np.ndarray, " n"],
) -> Float[np.ndarray, " n"]:
    """Central differences of `metric` over orbits at `point` ± `radius`, one parameter at a time.

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

"""Periodic orbits by the integrator: Newton's method on the map from section to section.

They may lose contact and impact. The map's derivatives are tangents under error control, in slices
of a turn, since none of a whole turn of impacts has digits left.
"""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Complex, Float, Scalar

from jaxcrusher.crusher.formulations import EccentricityFormulation
from jaxcrusher.crusher.joints import before
from jaxcrusher.crusher.scene import Scene
from jaxcrusher.motion.flow import initial_state
from jaxcrusher.motion.section import Section, poincare_section
from jaxcrusher.motion.simulation import simulate
from jaxcrusher.motion.statistic import SAMPLES, statistics_of
from jaxcrusher.motion.statistics import limits_of, over_pieces
from jaxcrusher.motion.tangents import Build, Tangents, chain, changes, combine, tangents
from jaxcrusher.settled import newton
from jaxcrusher.settled.result import RESULTS, PeriodicOrbit

# Of the map, and the shortest step as a share of Newton's.
EVALUATIONS, LEAST_SHARE = 16, 0.1
# Of Newton's last step, in clearances and m/s, and the tolerance of the integration.
CLOSURE, RTOL = 1e-7, 1e-11
# A step so long, in these units, leaves what its tangents told of; after one so short the tolerance
# is no longer this.
LEAP, NEAR, COARSE_RTOL = 1.0, 1e-4, 1e-8


def shoot(scene: Scene, guess: Float[ArrayLike, " dims"], period: int) -> PeriodicOrbit:
    """The orbit of `scene` through a section point near `guess` (concrete values only).

    Its `error` is what a tolerance 100 times as large makes of the RMS, that of its multipliers
    what it makes of their matrix.
    """
    build, none = eqx.Partial(_same, scene=scene), jnp.zeros(0)
    found = section_point(build, none, "foundation_rms", guess, period)
    if found is None:
        return missing(scene, period)
    state, along = found
    matrix, _ = chain(along)
    state = state + _step(matrix, along.state - state)
    coarse, _ = chain(tangents(build, none, "foundation_rms", state, period, 100 * RTOL))
    blur = np.max(np.abs(coarse - matrix)) / np.max(np.abs(matrix))
    orbit = described(scene, state, period, np.linalg.eigvals(matrix), blur)
    return orbit


def _same(_: Array, scene: Scene) -> Scene:
    return scene


def missing(scene: Scene, period: int) -> PeriodicOrbit:
    """No orbit: NaN in every number."""
    lost, values = jnp.asarray(jnp.nan), dict.fromkeys(statistics_of(scene), jnp.asarray(jnp.nan))
    limits, dims = limits_of(scene, values), initial_state(scene).size
    assert limits is not None
    return PeriodicOrbit(
        scene,
        period,
        jnp.full((SAMPLES * period, dims // 2), jnp.nan),
        jnp.full(dims, jnp.nan),
        RESULTS.open,
        jnp.array(0),
        values,
        lost,
        lost,
        jnp.full(dims, jnp.nan, complex),
        lost,
        limits,
    )


def described(
    scene: Scene,
    state: Float[ArrayLike, " dims"],
    period: int,
    multipliers: Complex[np.ndarray, " dims"],
    blur: float,
) -> PeriodicOrbit:
    """What is known of the orbit through a section point.

    Turn by turn: the same programs serve all periods.
    """
    joints = dict(scene.joints.present())
    places = {name: before(name) + "eccentricity" for name in joints}
    depths = [before(name) + "penetration_ratio" for name in joints]
    times = 2 * np.pi / scene.drive.speed * np.arange(SAMPLES) / SAMPLES
    names, parts, seen, coarse = statistics_of(scene), [], [], []
    again = state
    for _ in range(period):
        seen.append(simulate(scene, times, state=state, outputs=(*places.values(), *depths)))
        parts.append(poincare_section(scene, 0, 1, state=state, outputs=names, rtol=RTOL))
        coarse.append(poincare_section(scene, 0, 1, state=again, outputs=names, rtol=100 * RTOL))
        state, again = parts[-1].state, coarse[-1].state

    def over(turns: list[Section], name: str) -> Scalar:
        return over_pieces(name, jnp.concatenate([turn.values[name] for turn in turns]))

    values = {name: over(parts, name) for name in names}
    relative = [
        jnp.concatenate([turn[places[name]] for turn in seen]) / joint.clearance
        for name, joint in joints.items()
    ]
    limits = limits_of(scene, values)
    assert limits is not None
    return PeriodicOrbit(
        scene,
        period,
        jnp.concatenate(relative, axis=1),
        jnp.asarray(state, float),
        RESULTS.promote(newton.RESULTS.successful),
        jnp.array(0),
        values,
        jnp.abs(over(coarse, "foundation_rms") / values["foundation_rms"] - 1),
        jnp.min(jnp.array([jnp.min(turn[depth]) for turn in seen for depth in depths])),
        jnp.asarray(multipliers, complex),
        jnp.asarray(blur),
        limits,
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
    joints = len(list(scene.joints.present()))
    if not isinstance(scene.formulation, EccentricityFormulation) or x.size != 4 * joints:
        return None
    rtol, share, step, last = COARSE_RTOL, 1.0, np.zeros(x.size), np.eye(x.size)
    for _ in range(EVALUATIONS):
        along = tangents(build, point, metric, x + share * step, period, rtol)
        matrix, _ = chain(along)
        left = along.state - (x + share * step)
        if not np.isfinite(matrix).all():
            return None
        # Deuflhard's test: seen with the last matrix, the next step must be shorter.
        if np.any(step) and not _size(_step(last, left)) < (1 - share / 4) * _size(step):
            share /= 2
            if share < LEAST_SHARE:
                return None
            continue
        x, last, share = x + share * step, matrix, min(1.0, 2 * share)
        step = _step(matrix, left)
        if _size(step) < CLOSURE and rtol == RTOL:
            return x, along
        if not _size(step) < LEAP:
            return None
        rtol = RTOL if _size(step) < NEAR else rtol
    return None


def solved(
    matrix: Float[np.ndarray, "n n"], right: Float[np.ndarray, " n"]
) -> Float[np.ndarray, " n"]:
    """The solution of linear equations, not finite where the matrix is singular."""
    try:
        return np.linalg.solve(matrix, right)
    except np.linalg.LinAlgError:
        return np.full(len(right), np.nan)


def _step(matrix: Float[np.ndarray, "n n"], left: Float[np.ndarray, " n"]) -> np.ndarray:
    """Newton's step, not finite where a multiplier is 1."""
    return solved(np.eye(len(left)) - matrix, left)


def _size(step: Float[np.ndarray, " n"]) -> float:
    return float(np.max(np.abs(step)))


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

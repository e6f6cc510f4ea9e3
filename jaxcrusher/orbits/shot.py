"""Orbits by the integrator, in pure JAX: Newton's method on the map of a period.

They may lose contact and impact. An eager call and a traced one run the same programs.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Complex, Float, Int, PyTree, Scalar

from jaxcrusher.basics.checks import without_slopes
from jaxcrusher.basics.loops import design_by_design
from jaxcrusher.mechanism.reductions import Chosen, of_slices, samples_of
from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.mechanism.snapshot import Observable
from jaxcrusher.motion.tangents import same, sloped_turn
from jaxcrusher.orbits.forced import can_be_shot, coordinates_seen, least_penetrations
from jaxcrusher.orbits.result import RESULTS, WAYS, PeriodicOrbit, built, missing
from jaxcrusher.orbits.section_map import chained, outputs_along
from jaxcrusher.periodic import newton
from jaxcrusher.periodic.multipliers import eigenvalues, matrix_error
from jaxcrusher.periodic.shooting_problem import CLOSURE, COARSER

# The most of Newton's steps, at either tolerance of the integration.
STEPS = 16
# The tolerance of the integration.
ORBIT_RTOL = 1e-11
# Tolerance of the integration, Newton's last step in clearances and m/s, and the most steps: coarse
# until they are short, then fine. Where they ended the matrix is looked at coarsely and finely.
# Rounds of less than no step integrate nothing.
ROUNDS = ((1e-8, 1e-4, STEPS), (ORBIT_RTOL, CLOSURE, STEPS))
MATRICES = ((COARSER * ORBIT_RTOL, 0.0, 0), (ORBIT_RTOL, 0.0, 0))
SKIPPED = ((ORBIT_RTOL, 0.0, -1),) * len(ROUNDS)
# The unknowns of an orbit at 1024 instants a turn, as statistics look at them.
PATH = samples_of({"path": Observable(coordinates_seen, "1", "unknowns of the orbit")})


class Closed(eqx.Module):
    """Where Newton's method on the map of a period ended; NaN of a failure."""

    state: Float[Array, " dims"]
    matrix: Float[Array, "dims dims"]  # what a period makes of a disturbance
    error: Scalar  # of the matrix, estimated, as `matrix_error` measures it
    steps: Int[Array, ""]
    result: newton.RESULTS


def closed(scene: Scene, guess: Float[Array, " dims"], period: int) -> Closed:
    """Return the section point near `guess` that repeats after `period` turns.

    One program serves all periods. Under `jax.vmap` on a CPU one design after the other.
    """
    return _closed(scene, guess, jnp.asarray(period), jnp.array(ROUNDS + MATRICES))


@eqx.filter_jit
@design_by_design
def _closed(
    scene: Scene,
    guess: Float[Array, " dims"],
    period: Int[Array, ""],
    rounds: Float[Array, "rounds 3"],
) -> Closed:
    """Return where rounds of Newton's method end; the last two only look at the matrix."""
    eye, build = jnp.eye(guess.size), eqx.Partial(same, scene=scene)

    # In one place for all rounds: tangents take most of the time that the program is compiled.
    def closer(start: Array, now: Array) -> tuple[Array, newton.Root]:
        rtol, tolerance, steps = now
        turns = jnp.where(steps < 0, 0, period)

        def turn(_, carry: tuple[Array, Array]) -> tuple[Array, Array]:
            end, slices, _ = sloped_turn(build, jnp.zeros(0), carry[0], rtol)
            return end, chained(slices.jacobians, carry[1])

        def mapped(x: Array) -> tuple[Array, Array]:
            end, matrix = jax.lax.fori_loop(0, turns, turn, (x, eye))
            return end - x, matrix - eye

        root = newton.newton(mapped, start, tolerance, steps)
        # What has failed coarsely fails at once.
        return jnp.where(root.success | (steps <= 0), root.point, jnp.nan), root

    state, roots = jax.lax.scan(closer, guess, rounds)
    coarse, fine = roots.jacobian[-2:] + eye[None]
    last = jax.tree.map(lambda leaf: leaf[-3], roots.result)
    return Closed(state, fine, matrix_error(fine, coarse - fine), jnp.sum(roots.steps), last)


def integrated_multipliers(
    scene: Scene, state: Float[Array, " dims"], period: int
) -> tuple[Complex[Array, " dims"], Scalar]:
    """Return the multipliers of the orbit through a section point, and their error.

    The tangents are integrated beside the motion. Multipliers are NaN, and their error infinite,
    where that fails.
    """
    # By the program that closes orbits.
    found = _closed(scene, state, jnp.asarray(period), jnp.array(SKIPPED + MATRICES))
    return eigenvalues(found.matrix, jnp.all(jnp.isfinite(found.matrix))), found.error


def orbit_through(scene: Scene, found: Closed, period: int) -> PeriodicOrbit:
    """Return the orbit through a section point, with slopes by the numbers of `scene`."""
    outputs = scene.entries()
    seen_too = outputs + PATH
    # Of the same outputs, by the same program.
    _, rough = outputs_along(
        without_slopes(scene), found.state, period, COARSER * ORBIT_RTOL, seen_too
    )
    section, seen = outputs_along(scene, found.state, period, ORBIT_RTOL, seen_too)
    return _orbit_through(scene, found, period, outputs, section, seen, rough[scene.headline])


@eqx.filter_jit
def _orbit_through(
    scene: Scene,
    found: Closed,
    period: int,
    outputs: Chosen,
    section: Array,
    seen: dict[str, PyTree[Array]],
    rough: PyTree[Float[Array, "slices ..."]],
) -> PeriodicOrbit:
    table, path = dict(outputs), _path(seen)
    values = {name: of_slices(table[name].reduction, seen[name], period) for name in table}
    apart = of_slices(table[scene.headline].reduction, rough, period) / values[scene.headline] - 1
    good = found.result == newton.RESULTS.successful
    result = RESULTS.promote(newton.RESULTS.successful)
    return built(
        scene,
        period,
        path,
        section,
        values,
        result=RESULTS.where(good, result, RESULTS.not_closed),
        error=jax.lax.stop_gradient(jnp.abs(apart)),
        least_penetration=jnp.min(least_penetrations(path, scene.dry), initial=jnp.inf),
        multipliers=eigenvalues(found.matrix, good),
        multipliers_error=found.error,
        way=WAYS.shooting,
        steps=found.steps,
    )


def shoot(scene: Scene, guess: Float[ArrayLike, " dims"], period: int) -> PeriodicOrbit:
    """Return the orbit of `scene` through a section point near `guess`.

    Its `error` is the change of the RMS by a tolerance 100 times as large; that of its multipliers
    is the change of these or of their matrix.
    """
    if not can_be_shot(scene, guess):
        return missing(scene, period, RESULTS.not_closed)
    still, start = without_slopes((scene, jnp.asarray(guess, float)))
    return orbit_through(scene, closed(still, start, period), period)


def least_penetrations_from(
    scene: Scene, state: Float[ArrayLike, " dims"], period: int
) -> Float[Array, " joints"]:
    """Return `jaxcrusher.orbits.forced.least_penetrations` of dry joints from a section point."""
    _, seen = outputs_along(scene, jnp.asarray(state), period, ORBIT_RTOL, PATH)
    return least_penetrations(_path(seen), scene.dry)


def _path(seen: dict[str, PyTree[Array]]) -> Float[Array, "nodes dims"]:
    """Return all unknowns at equal steps of phase, from zero on."""
    # Slices look at their ends, and not at their beginnings.
    return jnp.roll(jnp.concatenate(list(seen[PATH[0][0]])), 1, axis=0)

"""Periodic orbits by the integrator: Newton's method on the map from section to section.

They may lose contact and impact. The map's derivatives are tangents under error control, in slices
of a turn, since none of a whole turn of impacts has digits left.
"""

import dataclasses
from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float, Scalar

from jaxcrusher.crusher.formulations import EccentricityFormulation
from jaxcrusher.crusher.joints import before
from jaxcrusher.crusher.moving_frame import frame_units
from jaxcrusher.crusher.scene import Scene
from jaxcrusher.motion.section import Section, poincare_section
from jaxcrusher.motion.simulation import simulate
from jaxcrusher.motion.statistic import SAMPLES, statistics_of
from jaxcrusher.motion.statistics import over_pieces
from jaxcrusher.motion.tangents import Build, Tangents, chain, same, tangents
from jaxcrusher.orbits import newton
from jaxcrusher.orbits.forced import unknowns
from jaxcrusher.orbits.newton import HostRoot, newton_on_host
from jaxcrusher.orbits.problem import (
    ALIKE,
    MOST_CORRECTIONS,
    AbstractPeriodicProblem,
    Bordered,
    Linearised,
    OfMatrix,
    Stride,
    Vanishing,
    least_penetrations,
)
from jaxcrusher.orbits.result import RESULTS, WAYS, PeriodicOrbit, built, missing

# Evaluations of the map, at either tolerance.
EVALUATIONS = 16
# Of Newton's last step, in clearances and m/s, and the tolerance of the integration.
CLOSURE, RTOL = 1e-7, 1e-11
# A step so long, in these units, leaves what its tangents told of. Until one is as short as `NEAR`
# the tolerance is coarse.
LEAP, NEAR, COARSE_RTOL = 1.0, 1e-4, 1e-8
# Steps of differences of a matrix, as a share of what it depends on.
DIFFERENCE = 1e-6
# The tolerance along a branch.
BRANCH_RTOL = 1e-10


class Turns(NamedTuple):
    """The map over a period: the state after each turn, and derivatives along them."""

    ends: Float[np.ndarray, "turns dims"]
    along: Tangents
    matrix: Float[np.ndarray, "dims dims"]


class Shooting(AbstractPeriodicProblem):
    """By the integrator: u is a section point; the scene of the numbers p is `build(p)`."""

    build: Build
    period: int = eqx.field(static=True)
    rtol: float = eqx.field(static=True, default=BRANCH_RTOL)
    metric: str = eqx.field(static=True, default="foundation_rms")  # whose derivatives come along
    watched: tuple[str, ...] = eqx.field(static=True, default=())

    # Where branches fold a state differs by thousandths of a clearance: a tangent leads less far.
    # The integrations leave some 3e-8 of a step in a place.
    stride: ClassVar[Stride] = Stride(
        first=0.02, longest=0.4, shortest=2e-5, straight=0.1, located=1e-7
    )
    ends: ClassVar[bool] = False

    def residual(self, u: Float[Array, " dims"], p: Any) -> Array:
        """Return how far a period leads from u."""
        return jnp.asarray(self.linearised(u, p).residual)

    def linearised(self, u: Float[ArrayLike, " dims"], p: Any) -> Linearised:
        """Return the residual with its derivatives by u and by p, and the turns."""
        point, parts, state = jnp.asarray(p).reshape(-1), [], np.asarray(u)
        for _ in range(self.period):
            parts.append(tangents(self.build, point, self.metric, state, 1, self.rtol))
            state = parts[-1].state
        joined = {
            name: np.concatenate([getattr(part, name) for part in parts])
            for name in ("jacobians", "forcing", "values", "by_state", "by_parameter")
        }
        along = dataclasses.replace(parts[-1], **joined)
        matrix, forcing = chain(along)
        seen = Turns(np.array([part.state for part in parts]), along, matrix)
        return Linearised(state - np.asarray(u), matrix - np.eye(state.size), forcing, seen)

    def solved(self, equations: Bordered) -> HostRoot | None:
        """Return the zero of bordered equations, None if there is none."""

        def evaluated(both: np.ndarray) -> tuple[np.ndarray, np.ndarray, Turns]:
            left, jacobian, seen = equations.linearised(both)
            return np.asarray(left), np.asarray(jacobian), seen

        return newton_on_host(evaluated, np.asarray(equations.guess), CLOSURE, MOST_CORRECTIONS)

    def monodromy(self, u: Any, p: Any, seen: Turns) -> Float[np.ndarray, "dims dims"]:
        """Return what a period makes of a shift from the orbit."""
        return seen.matrix

    def vanishing(self, of: OfMatrix, u: Any, p: Any, seen: Turns) -> Vanishing:
        """Return a function of the monodromy matrix, with slopes by one-sided differences.

        Their error lets Newton's method converge more slowly, to the same zero.
        """
        both, value = np.concatenate([u, np.ravel(p)]), float(of(jnp.asarray(seen.matrix)))
        sizes = np.concatenate([np.ones(len(u)), np.abs(np.ravel(p))])

        def moved(shift: np.ndarray) -> float:
            u_now, p_now = np.split(both + shift, [len(u)])
            return float(of(jnp.asarray(self.linearised(u_now, p_now).seen.matrix)))

        steps = DIFFERENCE * sizes
        slopes = [
            (moved(shift) - value) / h for shift, h in zip(np.diag(steps), steps, strict=True)
        ]
        return Vanishing(value, (np.array(slopes[: len(u)]), np.array(slopes[len(u) :])))

    def turns(self, u: Any, seen: Turns) -> int:
        """Return after how many turns an orbit repeats already."""
        apart = np.max(np.abs(seen.ends - seen.ends[-1]), axis=1)
        return 1 + int(np.argmax(apart < ALIKE))

    def monitors(self, u: Any, p: Any, seen: Turns) -> Float[np.ndarray, " joints"]:
        """Return the least penetration of each joint over the period, in clearances."""
        scene = self.build(jnp.asarray(p).reshape(-1))
        return np.asarray(least_penetrations(_motion(scene, [np.asarray(u), *seen.ends[:-1]])))

    def orbit(
        self, u: Any, p: Any, seen: Turns, equations: Bordered | None = None
    ) -> PeriodicOrbit:
        """Return all that is known of an orbit, but for an error of its multipliers.

        Its `error` is what a tolerance 100 times as large makes of the RMS. Turn by turn: the same
        programs serve all periods.
        """
        scene = self.build(jnp.asarray(p).reshape(-1))
        names = statistics_of(scene)

        def sections(rtol: float) -> list[Section]:
            parts, state = [], u
            for _ in range(self.period):
                parts.append(poincare_section(scene, 0, 1, state=state, outputs=names, rtol=rtol))
                state = parts[-1].state
            return parts

        def over(turns: list[Section], name: str) -> Scalar:
            return over_pieces(name, jnp.concatenate([turn.values[name] for turn in turns]))

        fine, coarse = sections(RTOL), sections(100 * RTOL)
        values = {name: over(fine, name) for name in names}
        path = _motion(scene, [u, *(turn.state for turn in fine[:-1])])
        return built(
            scene,
            self.period,
            path,
            fine[-1].state,
            values,
            result=RESULTS.promote(newton.RESULTS.successful),
            error=jnp.abs(over(coarse, "foundation_rms") / values["foundation_rms"] - 1),
            least_penetration=jnp.min(least_penetrations(path)),
            multipliers=np.linalg.eigvals(seen.matrix),
            multipliers_error=np.nan,
            way=WAYS.shooting,
        )

    def over(self, turns: int, u: np.ndarray) -> tuple["Shooting", np.ndarray]:
        """Return the problem of so many turns, and the same section point."""
        return dataclasses.replace(self, period=turns), u

    def weight(self, size: int) -> float:
        """Return that of a sum of squares."""
        return 1.0


def _motion(scene: Scene, starts: list) -> Float[Array, "n half"]:
    """Return all unknowns at equal steps over turns from section points."""
    joints = dict(scene.joints.present())
    places = [before(name) + "eccentricity" for name in joints]
    frame = () if scene.supports is None else ("frame_displacement", "frame_rotation")
    times = 2 * np.pi / scene.drive.speed * np.arange(SAMPLES) / SAMPLES
    outputs = (*places, *frame)
    seen = [simulate(scene, times, state=state, outputs=outputs) for state in starts]
    relative = [
        jnp.concatenate([turn[place] for turn in seen]) / joint.clearance
        for place, joint in zip(places, joints.values(), strict=True)
    ]
    if frame:
        units = frame_units(scene)
        moved, turned = (jnp.concatenate([turn[name] for turn in seen]) for name in frame)
        shift = jnp.stack([jnp.zeros(()), units.sag])
        relative += [(moved + shift) / jnp.stack([units.x, units.y])]
        relative += [turned[:, None] / units.angle]
    return jnp.concatenate(relative, axis=1)


def shoot(scene: Scene, guess: Float[ArrayLike, " dims"], period: int) -> PeriodicOrbit:
    """Return the orbit of `scene` through a section point near `guess` (concrete values only).

    Its `error` is what a tolerance 100 times as large makes of the RMS, that of its multipliers
    what it makes of their matrix.
    """
    build, none = eqx.Partial(same, scene=scene), jnp.zeros(0)
    problem = Shooting(build=build, period=period, rtol=RTOL)
    found = _repeats(problem, none, guess)
    if found is None:
        return missing(scene, period, RESULTS.not_closed)
    state, seen = found
    coarse = dataclasses.replace(problem, rtol=100 * RTOL).linearised(state, none).seen.matrix
    error = np.max(np.abs(coarse - seen.matrix)) / np.max(np.abs(seen.matrix))
    orbit = problem.orbit(state, none, seen)
    return dataclasses.replace(orbit, multipliers_error=jnp.asarray(error))


def section_point(
    build: Build,
    point: Float[Array, " n"],
    metric: str,
    guess: Float[ArrayLike, " dims"],
    period: int,
) -> tuple[np.ndarray, Tangents] | None:
    """Return the section point near `guess` that repeats after `period` turns.

    With it come the derivatives along the orbit. None if Newton's method does not converge, if a
    multiplier is 1 (whatever is near repeats too), or if the state holds more than eccentricity
    and rate (a memory that no impact renews repeats whatever it is).
    """
    found = _repeats(Shooting(build=build, period=period, rtol=RTOL, metric=metric), point, guess)
    return None if found is None else (found[0], found[1].along)


def _repeats(
    problem: Shooting, point: Float[Array, " n"], guess: Float[ArrayLike, " dims"]
) -> tuple[np.ndarray, Turns] | None:
    """Return the section point of an orbit and its turns; coarsely first, then finely."""
    x, seen = np.asarray(guess, dtype=float), None
    # Traced: a neighbour of a parameter at its limit lies outside.
    scene = eqx.filter_eval_shape(problem.build, point)
    states = 2 * unknowns(scene)
    if not isinstance(scene.formulation, EccentricityFormulation) or x.size != states:
        return None
    for rtol, tolerance in ((COARSE_RTOL, NEAR), (problem.rtol, CLOSURE)):
        tried = dataclasses.replace(problem, rtol=rtol)

        def evaluated(x: np.ndarray, of: Shooting = tried) -> tuple[np.ndarray, np.ndarray, Turns]:
            at = of.linearised(x, point)
            return np.asarray(at.residual), np.asarray(at.by_unknowns), at.seen

        root = newton_on_host(evaluated, x, tolerance, EVALUATIONS, LEAP)
        if root is None:
            return None
        x, seen = root.point, root.seen
    assert seen is not None
    return x, seen

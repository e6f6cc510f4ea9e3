"""The orbits of a scene over one or more of its numbers, as a periodic problem."""

from collections.abc import Callable

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Scalar
from typing_extensions import override

from jaxcrusher.mechanism.reductions import Chosen
from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.motion.tangents import SLICES, Build, slices_apart
from jaxcrusher.orbits import forced, shot
from jaxcrusher.orbits.forced import least_penetrations
from jaxcrusher.orbits.result import WAYS, PeriodicOrbit
from jaxcrusher.orbits.solving import of_nodes, orbit_of_nodes
from jaxcrusher.periodic import newton
from jaxcrusher.periodic.branch import Branch, Point
from jaxcrusher.periodic.collocation_problem import CollocationProblem
from jaxcrusher.periodic.event_curve import EventCurve
from jaxcrusher.periodic.multipliers import matrix_error
from jaxcrusher.periodic.node_errors import Family
from jaxcrusher.periodic.problem import AbstractPeriodicProblem
from jaxcrusher.periodic.shooting_problem import AbstractFlow, ShootingProblem, Turns
from jaxcrusher.periodic.system import System

# Joint -> kind of the event where its pin leaves its bore.
LOST = {
    "main": "contact lost",
    "elbow": "contact lost at the elbow",
    "pivot": "contact lost at the pivot",
    "shaft_bearing": "contact lost at the shaft's bearing",
}


def lost(joint: str) -> str:
    """Return the kind of the event where the pin of a joint leaves its bore."""
    return LOST.get(joint, f"contact lost at {joint}")


class SceneFlow(AbstractFlow):
    """Motions of the scene `build(p)`, from section points."""

    build: Build

    @override
    def slices(
        self, p: Float[Array, " n"], states: Float[Array, "slices dims"], rtol: Scalar
    ) -> tuple[Array, Array, Array]:
        return slices_apart(self.build, p, states, rtol)

    @override
    def monitors(
        self, p: Float[Array, " n"], state: Float[np.ndarray, " dims"], turns: int
    ) -> Float[np.ndarray, " joints"]:
        """Return the least penetration of each dry joint, in clearances."""
        return np.asarray(shot.least_penetrations_from(self.build(p), state, turns))


def problem_of(
    scene: Callable[[Array], Scene], value: Array, period: int, nodal: bool
) -> AbstractPeriodicProblem:
    """Return the problem of the orbits of a scene over one or more numbers, like `value`.

    It is by collocation if `nodal`, otherwise by shooting.
    """
    now = scene(value)
    watched = tuple(lost(now.joints.names[i]) for i in now.dry)
    if not nodal:
        flow = SceneFlow(eqx.Partial(_made, scene=scene, shape=value.shape))
        return ShootingProblem(flow=flow, period=period, slices=SLICES, watched=watched)
    family = eqx.Partial(_family, scene=scene, period=period)
    watch = eqx.Partial(least_penetrations, joints=now.dry)
    return CollocationProblem(family=family, period=period, watched=watched, watch=watch)


def orbit_of(branch: Branch, point: Point) -> PeriodicOrbit:
    """Return all that is known of the orbit at a point of a branch, or of a curve of events."""
    problem, u = branch.problem, jnp.asarray(point.u)
    p, scales = jnp.asarray(branch.scale * point.value), jnp.asarray(branch.scale, float)
    if isinstance(problem, EventCurve):
        (u, p), scales = problem.split(u, p), jnp.stack([problem.scale, scales])
        problem = problem.base
    if isinstance(problem, CollocationProblem):
        return _by_nodes(problem, u, p, scales, problem.family(p).args.entries())
    assert isinstance(problem, ShootingProblem)
    return _by_slices(problem, u, p, point.seen)


@eqx.filter_jit
def _by_nodes(
    problem: CollocationProblem, u: Array, p: Array, scales: Array, outputs: Chosen
) -> PeriodicOrbit:
    system = problem.family(p)
    found = of_nodes(system, u, None, WAYS.branch, family=Family(problem.family, p, scales))
    return orbit_of_nodes(system, found, u, problem.period, outputs)


def _by_slices(problem: ShootingProblem, u: Array, p: Array, seen: Turns) -> PeriodicOrbit:
    """Return an orbit, whose errors are what a tolerance 100 times as large makes of it."""
    assert isinstance(problem.flow, SceneFlow)
    coarser = problem.resolved(np.asarray(u), finer=False)
    assert coarser is not None
    matrix, rough = jnp.asarray(seen.matrix), coarser[0].linearised(u, p).seen.matrix
    found = shot.Closed(
        jnp.asarray(problem.states(u)[0]),
        matrix,
        matrix_error(matrix, rough - matrix),
        jnp.array(0),
        newton.RESULTS.successful,
    )
    return shot.orbit_through(problem.flow.build(p.reshape(-1)), found, problem.period)


def _family(value: Array, *, scene: Callable[[Array], Scene], period: int) -> System:
    return forced.system(scene(value).steady(), period)


def _made(point: Float[Array, " n"], scene: Callable[[Array], Scene], shape: tuple) -> Scene:
    return scene(point.reshape(shape)).steady()

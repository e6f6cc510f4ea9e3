"""The crusher as a forced second-order system: its eccentricity in clearances over shaft angle."""

import jax
import jax.numpy as jnp
import numpy as np
from jax.scipy.linalg import lu_solve
from jaxtyping import Array, Float, Scalar

from jaxcrusher.basics.plane import Vector
from jaxcrusher.crusher.formulations import ClosedLinkage, EccentricityFormulation
from jaxcrusher.crusher.formulations.eccentricity import EccentricityState
from jaxcrusher.crusher.observables import foundation_force
from jaxcrusher.crusher.scene import Scene
from jaxcrusher.crusher.snapshot import Snapshot
from jaxcrusher.crusher.starts import resting
from jaxcrusher.settled.collocation import System, one_by_one
from jaxcrusher.settled.newton import Factors
from jaxcrusher.settled.trigonometric import differentiation, nodes, resample

# Refinements of the first guess: each adds what the last one's acceleration asks of the contact.
REFINEMENTS = 2


def refusal(scene: Scene) -> str:
    """What a scene must be for collocation in the eccentricity and is not, or nothing."""
    if not isinstance(scene.formulation, EccentricityFormulation | ClosedLinkage):
        return "be written by eccentricity, but is written by multipliers"
    if scene.drive.initial() is not None:
        return "turn at constant speed, but its shaft is free: it repeats at a speed not given"
    if scene.joint is None or scene.joint.normal.impact_velocity.initial() is None:
        return ""
    return "have a constant impact velocity, but tracks it: in contact any value repeats itself"


def state(x: Array, rate: Array, scene: Scene) -> EccentricityState:
    """From e / c and its derivative by the shaft angle."""
    assert scene.joint is not None
    speed = scene.drive.speed * scene.joint.clearance
    return EccentricityState(Vector(x[0], x[1]), Vector(*(speed * rate)), None, None)


def acceleration(
    angle: Scalar, x: Float[Array, "2"], rate: Float[Array, "2"], scene: Scene
) -> Float[Array, "2"]:
    """The second derivative of e / c by the shaft angle."""
    assert scene.joint is not None
    seen = snapshot(angle, x, rate, scene)
    change = scene.formulation.rate(seen, state(x, rate, scene), scene)
    return change.rate.array() / (scene.joint.clearance * scene.drive.speed**2)


def quasi_static(scene: Scene, period: int, count: int) -> Float[Array, "count 2"]:
    """The pin resting under the force of a motion that its own depth corrects."""
    assert scene.joint is not None
    pace = scene.drive.speed / period
    first, second = (pace**k * matrix for k, matrix in enumerate(differentiation(count), start=1))
    times = 2 * jnp.pi * jnp.asarray(nodes(count)) / pace
    e = jax.vmap(lambda time: Vector(0 * time, 0 * time))(times)
    along = jax.vmap(resting, in_axes=(0, 0, 0, 0, None))
    for _ in range(1 + REFINEMENTS):
        rate, curvature = (jax.tree.map(lambda part, m=m: m @ part, e) for m in (first, second))
        e = along(times, e, rate, curvature, scene)
    return jnp.stack([e.x, e.y], axis=1) / scene.joint.clearance


def snapshot(angle: Scalar, x: Array, rate: Array, scene: Scene) -> Snapshot:
    """At an instant of an orbit."""
    return scene.formulation.snapshot(angle / scene.drive.speed, state(x, rate, scene), scene)


def missed(system: System, x: Float[Array, "nodes 2"], factors: Factors) -> Scalar:
    """What the nodes miss of the mean square of the force, estimated.

    The defect, zero at the nodes, is what the polynomial cannot follow between them; the dual of
    the mean square says what it matters (Becker and Rannacher, Acta Numerica 10, 2001).
    """

    def square(angle: Scalar, x: Array, rate: Array, scene: Scene) -> Scalar:
        return foundation_force(snapshot(angle, x, rate, scene), scene) ** 2

    points, pace = 2 * len(x), 2 * np.pi / system.period
    by_both = jax.jacfwd(square, argnums=(1, 2))
    by_x, by_rate = one_by_one(by_both, system.at(x, len(x)), system.args)
    weights = by_x + pace * differentiation(len(x))[0].T @ by_rate
    dual = lu_solve(factors, weights.ravel(), trans=1).reshape(x.shape)
    times, between, rate = system.at(x, points)
    acceleration = one_by_one(system.acceleration, (times, between, rate), system.args)
    defect = acceleration - pace**2 * resample(x, points, order=2)
    return jnp.mean(jnp.sum(resample(dual, points) * defect, axis=1))

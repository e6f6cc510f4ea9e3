"""Where the pin starts in its bore."""

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Scalar

from jaxcrusher.basics.plane import Vector
from jaxcrusher.basics.smooth import norm
from jaxcrusher.crusher import linkage
from jaxcrusher.crusher.interfaces import AbstractScene, AbstractStart
from jaxcrusher.crusher.scene import Scene
from jaxcrusher.crusher.snapshot import crank_motion, pin_acceleration, pin_position, pin_velocity


class Centred(AbstractStart):
    """e = e' = 0 relative to the ideal motion, the paper's initial condition: a hard start."""

    def eccentricity(self, scene: AbstractScene) -> tuple[Vector, Vector]:
        """Zero and zero."""
        return Vector(0.0, 0.0), Vector(0.0, 0.0)


def _chebyshev(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Chebyshev points of [-1, 1] and the differentiation matrix on them (Trefethen 2000)."""
    points = np.cos(np.pi * np.arange(count) / (count - 1))
    ends = np.where(np.isin(np.arange(count), (0, count - 1)), 2.0, 1.0)
    weights = ends * (-1.0) ** np.arange(count)
    gaps = points[:, None] - points + np.eye(count)
    matrix = np.outer(weights, 1 / weights) / gaps
    return points, matrix - np.diag(matrix.sum(axis=1))


class InContact(AbstractStart):
    """The pin rests in the bore and follows the joint force without swinging.

    First e lies along the ideal joint force, deep enough to carry it. Left with e' = 0 it
    would swing at about 130 Hz for thousands of turns (the contact hardly damps), so the
    slow motion is refined: the time derivatives of e correct the motion of the jaw, and with
    it the force that e must carry. Each refinement shrinks the swing about thirtyfold; with
    two, the derivative by clearance over 15 turns agrees with differences over 8 um to 0.1 %,
    with e' = 0 to 20 %. Friction is not in the balance: with surface slip a swing remains.
    """

    refinements: int = eqx.field(static=True, default=2)

    def eccentricity(self, scene: AbstractScene) -> tuple[Vector, Vector]:
        """By collocation at nine instants within 0.1 rad of the shaft about time zero."""
        points, matrix = _chebyshev(9)
        times = 0.1 / scene.drive.speed * points
        matrix = scene.drive.speed / 0.1 * matrix

        def rate(e: Vector) -> Vector:
            return jax.tree.map(lambda part: matrix @ part, e)

        e = jax.vmap(lambda time: Vector(0 * time, 0 * time))(times)
        for _ in range(1 + self.refinements):
            e = jax.vmap(resting, in_axes=(0, 0, 0, 0, None))(
                times, e, rate(e), rate(rate(e)), scene
            )
        middle = len(points) // 2
        return jax.tree.map(lambda leaf: leaf[middle], (e, rate(e)))


def resting(
    time: Scalar, e: Vector, rate: Vector, curvature: Vector, scene: AbstractScene
) -> Vector:
    """The eccentricity that carries the joint force of a jaw whose bearing is e off the pin."""
    assert scene.joint is not None
    machine = scene.machine
    shaft = crank_motion(scene.drive.speed * time, scene.drive.speed)
    chain = linkage.assemble(
        machine, pin_position(machine, shaft.crank) - e, pin_velocity(machine, shaft) - rate
    )
    velocity = linkage.mass_centre_velocity(machine, chain)
    load = None if scene.load is None else scene.load.force(chain.jaw, velocity)
    acceleration = linkage.chain_acceleration_to_reach(
        machine, chain, pin_acceleration(machine, shaft) - curvature
    )
    force = linkage.joint_force_for(machine, chain, load, acceleration)
    size = norm(force, 0.0)
    depth = scene.joint.clearance + scene.joint.normal.penetration_under(size)
    return depth * (force / size)


class Given(AbstractStart):
    """Any eccentricity and rate: `relative` in clearances, `rate` in m/s."""

    relative: Vector
    rate: Vector = eqx.field(default_factory=lambda: Vector(0.0, 0.0))

    def eccentricity(self, scene: AbstractScene) -> tuple[Vector, Vector]:
        """As given."""
        assert scene.joint is not None
        return scene.joint.clearance * self.relative, self.rate


def shifted_start(scene: Scene, offset: Vector) -> Scene:
    """The same scene with its start as numbers, `offset` clearances off.

    Scenes that differ in their start then run as one program.
    """
    assert scene.joint is not None and scene.start is not None
    eccentricity, rate = scene.start.eccentricity(scene)
    start = Given(eccentricity / scene.joint.clearance + offset, rate)
    return eqx.tree_at(lambda s: s.start, scene, start)

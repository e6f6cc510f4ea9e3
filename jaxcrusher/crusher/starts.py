"""Where pins start in their bores."""

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Scalar

from jaxcrusher.basics.plane import Vector
from jaxcrusher.basics.smooth import norm
from jaxcrusher.crusher import free_bodies, linkage
from jaxcrusher.crusher.applied import applied
from jaxcrusher.crusher.interfaces import AbstractScene, AbstractStart
from jaxcrusher.crusher.joints import AtJoints
from jaxcrusher.crusher.linkage import Play
from jaxcrusher.crusher.scene import Scene
from jaxcrusher.crusher.snapshot import chain_of, crank_motion, pin_acceleration
from jaxcrusher.joint.clearance import AbstractBearing


class Centred(AbstractStart):
    """e = e' = 0 relative to the ideal motion, the paper's initial condition: a hard start."""

    def eccentricities(self, scene: AbstractScene) -> tuple[Play, Play]:
        """Zero and zero."""
        none = scene.joints.map(lambda _: Vector(0.0, 0.0))
        return none, none


def _chebyshev(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Chebyshev points of [-1, 1] and the differentiation matrix on them (Trefethen 2000)."""
    points = np.cos(np.pi * np.arange(count) / (count - 1))
    ends = np.where(np.isin(np.arange(count), (0, count - 1)), 2.0, 1.0)
    weights = ends * (-1.0) ** np.arange(count)
    gaps = points[:, None] - points + np.eye(count)
    matrix = np.outer(weights, 1 / weights) / gaps
    return points, matrix - np.diag(matrix.sum(axis=1))


class InContact(AbstractStart):
    """Each pin rests in its bore and follows the joint force without swinging.

    First e lies along the ideal joint's force, deep enough to carry it. Left with e' = 0 it
    would swing at about 130 Hz for thousands of turns (the contact hardly damps), so the
    slow motion is refined: the time derivatives of e correct the motion of the jaw, and with
    it the force that e must carry. Each refinement shrinks the swing about thirtyfold; with
    two, the derivative by clearance over 15 turns agrees with differences over 8 um to 0.1 %,
    with e' = 0 to 20 %. Friction is not in the balance: with surface slip a swing remains.
    """

    refinements: int = eqx.field(static=True, default=2)

    def eccentricities(self, scene: AbstractScene) -> tuple[Play, Play]:
        """By collocation at nine instants within 0.1 rad of the shaft about time zero."""
        points, matrix = _chebyshev(9)
        times = 0.1 / scene.drive.speed * points
        matrix = scene.drive.speed / 0.1 * matrix

        def rate(e: Play) -> Play:
            return jax.tree.map(lambda part: matrix @ part, e)

        along = jax.vmap(resting, in_axes=(0, 0, 0, 0, None))
        e = jax.vmap(lambda time: scene.joints.map(lambda _: Vector(0 * time, 0 * time)))(times)
        e = jax.lax.fori_loop(
            0, 1 + self.refinements, lambda _, e: along(times, e, rate(e), rate(rate(e)), scene), e
        )
        middle = len(points) // 2
        return jax.tree.map(lambda leaf: leaf[middle], (e, rate(e)))


def resting(time: Scalar, e: Play, rate: Play, curvature: Play, scene: AbstractScene) -> Play:
    """The eccentricities that carry the forces of a motion whose pins are e off their bores."""
    machine = scene.machine
    shaft = crank_motion(scene.drive.speed * time, scene.drive.speed)
    chain = chain_of(machine, shaft, e, rate)
    on_jaw = applied(scene, shaft, chain).total
    reached = pin_acceleration(machine, shaft)
    reached = reached if curvature.main is None else reached - curvature.main
    acceleration = linkage.chain_acceleration_to_reach(machine, chain, reached, curvature)
    forces = AtJoints(main=linkage.joint_force_for(machine, chain, on_jaw, acceleration))
    if not scene.joints.only_main:
        forces = free_bodies.forces_for(machine, chain, on_jaw, acceleration)

    def depth(joint: AbstractBearing, force: Vector) -> Vector:
        size = norm(force, 0.0)
        return (joint.clearance + joint.normal.penetration_under(size)) * (force / size)

    return scene.joints.map(depth, forces)


class Given(AbstractStart):
    """Any eccentricities and rates: `relative` in clearances, `rate` in m/s; zero where none is."""

    relative: Vector  # of the main joint
    rate: Vector = eqx.field(default_factory=lambda: Vector(0.0, 0.0))
    others: AtJoints[tuple[Vector, Vector]] = AtJoints()  # those of elbow and pivot

    def eccentricities(self, scene: AbstractScene) -> tuple[Play, Play]:
        """As given."""
        still = Vector(0.0, 0.0), Vector(0.0, 0.0)
        given = AtJoints(
            (self.relative, self.rate), self.others.elbow or still, self.others.pivot or still
        )
        return (
            scene.joints.map(lambda joint, at: joint.clearance * at[0], given),
            scene.joints.map(lambda _, at: at[1], given),
        )


def shifted_start(scene: Scene, offset: Vector) -> Scene:
    """The same scene with its start as numbers, the main joint's pin `offset` clearances off.

    Scenes that differ in their start then run as one program.
    """
    assert scene.joint is not None and scene.start is not None
    e, rates = scene.start.eccentricities(scene)
    relative = scene.joints.map(lambda joint, at: at / joint.clearance, e)
    assert relative.main is not None and rates.main is not None
    both = relative.map(lambda at, rate: (at, rate), rates)
    start = Given(relative.main + offset, rates.main, AtJoints(None, both.elbow, both.pivot))
    return eqx.tree_at(lambda s: s.start, scene, start)

"""Where pins start in their bores."""

from collections.abc import Mapping
from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Scalar
from typing_extensions import override

from jaxcrusher.basics.checks import require
from jaxcrusher.basics.plane import Vector, plus
from jaxcrusher.mechanism.equations import solve
from jaxcrusher.mechanism.motion import Crank, moving
from jaxcrusher.mechanism.named import Named
from jaxcrusher.mechanism.scene import AbstractStart, Scene
from jaxcrusher.mechanism.state import snapshot_of


class Centred(AbstractStart):
    """e = e' = 0 relative to the ideal motion, the paper's initial condition: a hard start."""

    @override
    def eccentricities(self, scene: Scene) -> tuple[Named[Vector], Named[Vector]]:
        none = scene.joints.map(lambda _: Vector(0.0, 0.0))
        return none, none


def _named(values: Named[Vector] | Mapping[str, Vector]) -> Named[Vector]:
    return values if isinstance(values, Named) else Named(values)


def _chebyshev(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return Chebyshev points of [-1, 1] and their differentiation matrix (Trefethen 2000)."""
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
    slow motion is refined: the time derivatives of e correct the motion of the bodies, and with
    it the force that e must carry. Each refinement shrinks the swing about thirtyfold; with
    two, the derivative by clearance over 15 turns agrees with differences over 8 um to 0.1 %,
    with e' = 0 to 20 %. Friction is not in the balance: with surface slip a swing remains.
    """

    refinements: int = eqx.field(static=True, default=2)

    @override
    def eccentricities(self, scene: Scene) -> tuple[Named[Vector], Named[Vector]]:
        """Return them by collocation at nine instants, within 0.1 rad about time zero."""
        points, matrix = _chebyshev(9)
        times = 0.1 / scene.drive.speed * points
        matrix = scene.drive.speed / 0.1 * matrix

        def rate(e: Named[Vector]) -> Named[Vector]:
            return jax.tree.map(lambda part: matrix @ part, e)

        along = jax.vmap(resting, in_axes=(0, 0, 0, 0, None))
        e = jax.vmap(lambda time: scene.joints.map(lambda _: Vector(0 * time, 0 * time)))(times)
        e = jax.lax.fori_loop(
            0, 1 + self.refinements, lambda _, e: along(times, e, rate(e), rate(rate(e)), scene), e
        )
        middle = len(points) // 2
        return jax.tree.map(lambda leaf: leaf[middle], (e, rate(e)))


def resting(
    time: Scalar,
    e: Named[Vector],
    rate: Named[Vector],
    curvature: Named[Vector],
    scene: Scene,
) -> Named[Vector]:
    """Return the eccentricities that carry the forces of a motion whose pins are e off their bores.

    The contact force is the reaction of the joint, held in this motion; the frame is clamped.
    """
    drive = scene.drive
    crank = Crank(drive.speed * time, drive.speed)
    if drive.initial() is None:
        crank = drive.crank(time, None)
    motion = moving(scene.linkage, crank, e, rate)
    held = partial(solve, curvatures=curvature)
    found = snapshot_of(scene, motion, Named(), None, None, held).accelerations
    forces = dict(found.forces.items())
    for name, slide in scene.linkage.slides.items():
        if name in scene.joints:
            at = found.slides.at(name)
            forces[name] = Vector(at.force, at.moment / slide.half_length)

    def mean_spin(name: str) -> Scalar:
        ends = motion.ends(name)
        both = plus(motion.spin(ends.bore.body), motion.spin(ends.pin.body))
        return jnp.zeros(()) if both is None else both / 2

    spins = Named({name: mean_spin(name) for name in scene.joints.names})
    return scene.joints.map(lambda one, *by: one.resting(*by), Named(forces), spins)


class Given(AbstractStart):
    """Any eccentricities and rates, of joints by their names; zero where none is given.

    `eccentricities` raises ValueError for a joint that has no clearance in the scene.
    """

    relative: Named[Vector] = eqx.field(converter=_named)  # in clearances
    rate: Named[Vector] = eqx.field(converter=_named, default_factory=Named)  # m/s

    @override
    def eccentricities(self, scene: Scene) -> tuple[Named[Vector], Named[Vector]]:
        loose, still = scene.joints.names, Vector(0.0, 0.0)
        for name in (*self.relative.names, *self.rate.names):
            must = f"name joints with clearance: {', '.join(loose)}"
            require(name in loose, "start", must, name)
        return (
            scene.joints.map(lambda joint, at: joint.clearance * (at or still), self.relative),
            scene.joints.map(lambda _, at: at or still, self.rate),
        )


def shifted_start(scene: Scene, offset: Vector, joint: str | None = None) -> Scene:
    """Return the scene with its start as numbers, and a joint's pin shifted by `offset` clearances.

    The joint is the first one with clearance, if none is named. Scenes that differ in their start
    then run as one program.
    """
    e, rates = start_of(scene).eccentricities(scene)
    relative = scene.joints.map(lambda one, at: at / one.clearance, e)
    name = relative.names[0] if joint is None else joint
    start = Given({**dict(relative.items()), name: relative.at(name) + offset}, rates)
    return eqx.tree_at(lambda s: s.start, scene, start)


def start_of(scene: Scene) -> AbstractStart:
    """Return the scene's start, which joints with clearance need."""
    if scene.is_ideal:
        return Centred()
    if scene.start is None:
        raise ValueError(
            "Argument `scene` must have a start, as it has joints with clearance, but has none."
        )
    return scene.start

"""A scene as a forced second-order system: eccentricities in clearances over phase.

The phase is omega t in radians, 2 pi a turn: an orbit of p turns repeats after 2 pi p.

The unknowns x are those of each loose joint, in the order of their names; behind them the three
coordinates of a frame on supports, in the units of its state.
"""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Scalar

from jaxcrusher.basics.loops import one_by_one
from jaxcrusher.basics.plane import Vector
from jaxcrusher.joint.clearance import AbstractBearing
from jaxcrusher.mechanism.eccentricity import EccentricityFormulation, EccentricityState, JointState
from jaxcrusher.mechanism.frame import FrameState, frame_units, initial_frame
from jaxcrusher.mechanism.named import Named
from jaxcrusher.mechanism.scene import AbstractScene
from jaxcrusher.mechanism.snapshot import Snapshot
from jaxcrusher.mechanism.starts import resting
from jaxcrusher.periodic.system import System
from jaxcrusher.periodic.trigonometric import differentiation, nodes

# Refinements of the first guess: each adds what the last one's acceleration asks of the contact.
REFINEMENTS = 2


def refusal(scene: AbstractScene) -> str:
    """Say what a scene must be for collocation and is not; nothing if it can be solved for."""
    if not isinstance(scene.formulation, EccentricityFormulation):
        return "be written by eccentricity, but is written by multipliers"
    if scene.drive.initial() is not None:
        return "turn at a given speed, but its shaft is free: it repeats at a speed not given"
    if tracks(scene):
        return "have a constant impact velocity, but tracks it: in contact any value repeats itself"
    return ""


def tracks(scene: AbstractScene) -> bool:
    """Tell whether a joint of the scene tracks its impact velocity."""
    laws = (joint.normal.impact_velocity for joint in scene.joints.values)
    return any(law.initial() is not None for law in laws)


def unknowns(scene: AbstractScene) -> int:
    """Count the unknowns of an orbit: two a joint with clearance, three a frame on supports."""
    return 2 * len(scene.joints) + (0 if scene.supports is None else 3)


def pairs(x: Float[Array, " dims *nodes"], scene: AbstractScene) -> Named[Vector]:
    """Give two of the numbers to each joint with clearance."""
    return Named({n: Vector(x[2 * i], x[2 * i + 1]) for i, n in enumerate(scene.joints.names)})


def numbers(e: Named[Vector], frame: tuple[Array, ...] = ()) -> Float[Array, " dims *nodes"]:
    """Invert `pairs`, with the coordinates of a frame behind them."""
    return jnp.stack([*(part for one in e.values for part in (one.x, one.y)), *frame])


def state(x: Array, rate: Array, scene: AbstractScene) -> EccentricityState:
    """Make a state from e / c, a frame's coordinates, and their derivatives by the phase."""
    speed = scene.drive.speed

    def one(joint: AbstractBearing, at: Vector, change: Vector) -> JointState:
        return JointState(at, speed * joint.clearance * change, None)

    frame = None
    if scene.supports is not None:
        units, (right, up, turned) = frame_units(scene), speed * rate[-3:]
        velocity = Vector(units.x * right, units.y * up)
        spin = units.radius * units.angle * turned
        frame = FrameState(Vector(x[-3], x[-2]), x[-1], velocity, spin)
    joints = scene.joints.map(one, pairs(x, scene), pairs(rate, scene))
    return EccentricityState(joints, None, frame)


def coordinates(state: EccentricityState) -> Float[Array, " dims"]:
    """Return the unknowns of a state."""
    at, frame = state.joints.map(lambda one: one.relative_eccentricity), state.frame
    if frame is None:
        return numbers(at)
    return numbers(at, (frame.displacement.x, frame.displacement.y, frame.rotation))


@jax.jit  # traced once for all that is asked of orbits
def acceleration(
    phase: Scalar, x: Float[Array, " dims"], rate: Float[Array, " dims"], scene: AbstractScene
) -> Float[Array, " dims"]:
    """Return the second derivative of e / c, and of a frame's coordinates, by the phase."""
    seen, square = snapshot(phase, x, rate, scene), scene.drive.speed**2
    change = scene.formulation.rate(seen, state(x, rate, scene), scene)
    scaled = scene.joints.map(lambda joint, at: at.rate / (joint.clearance * square), change.joints)
    if change.frame is None:
        return numbers(scaled)
    units, second = frame_units(scene), change.frame
    moved = second.velocity.x / (units.x * square), second.velocity.y / (units.y * square)
    return numbers(scaled, (*moved, second.spin / (units.radius * units.angle * square)))


def system(scene: AbstractScene, period: int) -> System:
    """Return the system of motions that repeat after `period` turns."""
    return System(acceleration, jnp.asarray(2 * np.pi * period), scene)


def quasi_static(scene: AbstractScene, period: int, count: int) -> Float[Array, "count dims"]:
    """Return the pins resting under the forces of a motion that their own depth corrects.

    A frame on supports stands under its weight and does not move yet.
    """
    frame = initial_frame(scene)
    still = ()
    if frame is not None:
        at = frame.displacement.x, frame.displacement.y, frame.rotation
        still = tuple(jnp.broadcast_to(one, (count,)) for one in at)
    if scene.is_ideal:
        return numbers(Named(), still).T
    pace = scene.drive.speed / period
    first, second = (pace**k * matrix for k, matrix in enumerate(differentiation(count), start=1))
    times = 2 * jnp.pi * jnp.asarray(nodes(count)) / pace
    e = jax.vmap(lambda time: scene.joints.map(lambda _: Vector(0 * time, 0 * time)))(times)

    def refined(_, e: Named[Vector]) -> Named[Vector]:
        rate, curvature = (jax.tree.map(lambda part, m=m: m @ part, e) for m in (first, second))
        return one_by_one(resting, (times, e, rate, curvature), scene)

    e = jax.lax.fori_loop(0, 1 + REFINEMENTS, refined, e)
    relative = jax.vmap(lambda e: scene.joints.map(lambda joint, at: at / joint.clearance, e))(e)
    return numbers(relative, still).T


@jax.jit  # as above
def snapshot(phase: Scalar, x: Array, rate: Array, scene: AbstractScene) -> Snapshot:
    """Look at an instant of an orbit."""
    return scene.formulation.snapshot(phase / scene.drive.speed, state(x, rate, scene), scene)

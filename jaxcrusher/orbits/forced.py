"""A scene as a forced second-order system: eccentricities in clearances over phase.

The phase is omega t in radians, 2 pi a turn: an orbit of p turns repeats after 2 pi p.

The unknowns x are those of each loose joint, in the order of their names; behind them the three
coordinates of a frame on supports, in the units of its state.
"""

from collections.abc import Iterator
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float, PyTree, Scalar

from jaxcrusher.basics.loops import one_by_one
from jaxcrusher.basics.plane import Vector
from jaxcrusher.joint.clearance import Memory
from jaxcrusher.mechanism.eccentricity import EccentricityFormulation, EccentricityState, JointState
from jaxcrusher.mechanism.named import Named
from jaxcrusher.mechanism.reductions import SAMPLES
from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.mechanism.snapshot import Snapshot
from jaxcrusher.mechanism.starts import resting
from jaxcrusher.mechanism.state import FrameState, frame_units, initial_frame
from jaxcrusher.periodic.system import System
from jaxcrusher.periodic.trigonometric import differentiation, evaluate, nodes, resample

# Refinements of the first guess: each adds what the last one's acceleration asks of the contact.
REFINEMENTS = 2
# Steps that lead from an instant of a grid to the least penetration beside it.
POLISHED = 3


def refusal(scene: Scene) -> str:
    """Say what a scene must be for collocation and is not; nothing if it can be solved for."""
    if why := unrepeatable(scene):
        return why
    if remembers(scene):
        return "have bearings without a memory, but one remembers what nodes do not tell"
    return ""


def unrepeatable(scene: Scene) -> str:
    """Say what a scene must be for an orbit and is not, be it by nodes or by shooting."""
    if not isinstance(scene.formulation, EccentricityFormulation):
        return "be written by eccentricity, but is written by multipliers"
    if scene.drive.initial() is not None:
        return "turn at a given speed, but its shaft is free: it repeats at a speed not given"
    if tracks(scene):
        return "have a constant impact velocity, but tracks it: in contact any value repeats itself"
    if any(not isinstance(one, Memory | None) for one in _memories(scene)):
        return "have bearings without a memory, but one remembers what an orbit does not tell"
    return ""


def remembers(scene: Scene) -> bool:
    """Tell whether a law remembers something, as bristles do: the integrator alone knows it."""
    return any(one is not None for one in _memories(scene))


def _memories(scene: Scene) -> list[PyTree]:
    return [joint.initial_memory() for joint in scene.joints.values]


def tracks(scene: Scene) -> bool:
    """Tell whether a joint of the scene tracks its impact velocity."""
    return bool(tracking(scene))


def tracking(scene: Scene) -> list[str]:
    """Return the joints that track their impact velocity."""
    joints = scene.joints.items()
    return [name for name, one in joints if one.normal.impact_velocity.initial() is not None]


def unknowns(scene: Scene) -> int:
    """Count the unknowns of an orbit: two a joint with clearance, three a frame on supports."""
    return 2 * len(scene.joints) + (0 if scene.supports is None else 3)


def states(scene: Scene) -> int:
    """Count the numbers of a section point: unknowns, their rates, and what bearings remember."""
    return 2 * unknowns(scene) + len(jax.tree.leaves(_memories(scene)))


def can_be_shot(scene: Scene, guess: Float[ArrayLike, " dims"]) -> bool:
    """Whether the scene has orbits, and a guess is a section point of it."""
    return not unrepeatable(scene) and np.shape(guess) == (states(scene),)


def _stacked(e: Named[Vector], frame: FrameState | None) -> Float[Array, " dims *nodes"]:
    """Return the unknowns, from e / c of the joints and the state of a frame."""
    moved = None if frame is None else (frame.displacement, frame.rotation)
    return jnp.stack(jax.tree.leaves((e, moved)))


def coordinates(state: EccentricityState) -> Float[Array, " dims"]:
    """Return the unknowns of a state."""
    return _stacked(state.parts.eccentricities, state.frame)


def coordinates_seen(s: Snapshot, scene: Scene) -> Float[Array, " dims"]:
    """Return the unknowns at an instant."""
    e = scene.joints.map(lambda joint, at: at / joint.clearance, s.motion.eccentricities)
    return _stacked(e, None if s.frame is None else frame_units(scene).state(s.frame))


def pins(x: Float[Any, "*nodes dims"]) -> Float[Any, "*nodes joints 2"]:
    """Return the unknowns that are e / c, by joint; the three of a frame stand behind them."""
    dims = x.shape[-1]
    return x[..., : dims - dims % 2 * 3].reshape(*x.shape[:-1], -1, 2)


def _units(scene: Scene) -> list[Scalar]:
    """Return what a rate of each unknown of one a second is as a velocity of the state, m/s."""
    units = [joint.clearance for joint in scene.joints.values for _ in range(2)]
    if scene.supports is None:
        return units
    frame = frame_units(scene)
    return [*units, frame.x, frame.y, frame.radius * frame.angle]


def state(x: Array, rate: Array, scene: Scene) -> EccentricityState:
    """Make a state from the unknowns and their derivatives by the phase."""
    speed, places = scene.drive.speed, iter(x)
    velocities = (speed * unit * one for unit, one in zip(_units(scene), rate, strict=True))

    def pair(numbers: Iterator[Array]) -> Vector:
        return Vector(next(numbers), next(numbers))

    joints = scene.joints.map(lambda _: JointState(pair(places), pair(velocities), None))
    if scene.supports is None:
        return EccentricityState(joints)
    moved = pair(places), next(places), pair(velocities), next(velocities)
    return EccentricityState(joints, None, FrameState(*moved))


@jax.jit  # traced once for all that is asked of orbits
def acceleration(
    phase: Scalar, x: Float[Array, " dims"], rate: Float[Array, " dims"], scene: Scene
) -> Float[Array, " dims"]:
    """Return the second derivative of the unknowns by the phase."""
    return _acceleration(snapshot(phase, x, rate, scene), x, rate, scene)


@jax.jit  # likewise
def acceleration_and_force(
    phase: Scalar, x: Float[Array, " dims"], rate: Float[Array, " dims"], scene: Scene
) -> tuple[Float[Array, " dims"], Scalar]:
    """Return the second derivative of the unknowns by the phase, and the headline force, N.

    Both follow from one look at the instant: what they share is compiled once.
    """
    seen = snapshot(phase, x, rate, scene)
    force = scene.statistics[scene.headline].quantity(seen, scene)
    return _acceleration(seen, x, rate, scene), jnp.asarray(force)


def _acceleration(seen: Snapshot, x: Array, rate: Array, scene: Scene) -> Float[Array, " dims"]:
    change = scene.formulation.rate(seen, state(x, rate, scene), scene)
    square = scene.drive.speed**2
    frame = None if change.frame is None else (change.frame.velocity, change.frame.spin)
    second = zip(jax.tree.leaves((change.parts.rates, frame)), _units(scene), strict=True)
    return jnp.stack([one / (unit * square) for one, unit in second])


def system(scene: Scene, period: int) -> System:
    """Return the system of motions that repeat after `period` turns."""
    return System(acceleration, jnp.asarray(2 * np.pi * period), scene)


def quasi_static(scene: Scene, period: int, count: int) -> Float[Array, "count dims"]:
    """Return the pins resting under the forces of the motion, corrected for their penetration.

    A frame on supports stands under its weight and does not move yet.
    """
    still = jax.tree.map(lambda one: jnp.broadcast_to(one, (count,)), initial_frame(scene))
    if scene.is_ideal:
        return _stacked(Named(), still).T
    pace = scene.drive.speed / period
    first, second = (pace**k * matrix for k, matrix in enumerate(differentiation(count), start=1))
    times = 2 * jnp.pi * jnp.asarray(nodes(count)) / pace
    e = jax.vmap(lambda time: scene.joints.map(lambda _: Vector(0 * time, 0 * time)))(times)

    def refined(_, e: Named[Vector]) -> Named[Vector]:
        rate, curvature = (jax.tree.map(lambda part, m=m: m @ part, e) for m in (first, second))
        return one_by_one(resting, (times, e, rate, curvature), scene)

    e = jax.lax.fori_loop(0, 1 + REFINEMENTS, refined, e)
    relative = jax.vmap(lambda e: scene.joints.map(lambda joint, at: at / joint.clearance, e))(e)
    return _stacked(relative, still).T


@jax.jit  # as above
def snapshot(phase: Scalar, x: Array, rate: Array, scene: Scene) -> Snapshot:
    """Look at an instant of an orbit."""
    return scene.formulation.snapshot(phase / scene.drive.speed, state(x, rate, scene), scene)


@eqx.filter_jit
def least_penetrations(
    x: Float[Array, "nodes dims"], joints: tuple[int, ...] | None = None
) -> Float[Array, " joints"]:
    """Return the least penetration of each joint over the period, in clearances.

    `joints` of None are all. Between the instants of a grid Newton's method goes on, so that the
    result is smooth in the nodes.
    """
    pairs = pins(x) if joints is None else pins(x)[:, list(joints)]
    grid = resample(pairs, max(SAMPLES, 4 * len(x)))

    def least(pin: Float[Array, "nodes 2"], grid: Float[Array, "instants 2"]) -> Scalar:
        def step(place: Scalar) -> Scalar:
            e, rate, second = (evaluate(pin, place, order) for order in range(3))
            curve = rate @ rate + e @ second
            # A pin at rest is nowhere nearer, and has slopes in reverse too.
            bent = curve > 0
            return jnp.where(bent, e @ rate, 0.0) / jnp.where(bent, 2 * np.pi * curve, 1.0)

        start = jnp.argmin(jnp.sum(grid**2, axis=1)) / len(grid)
        place = jax.lax.fori_loop(0, POLISHED, lambda _, place: place - step(place), start)
        place = jax.lax.stop_gradient(place)
        # The place has slopes, and so the penetration has second derivatives.
        left = step(place)
        place = place - (left - jax.lax.stop_gradient(left))
        return jnp.linalg.norm(evaluate(pin, place)) - 1

    return jax.vmap(least, in_axes=1)(pairs, grid)

"""The layout of a scene's state, and the instant that follows from its motion.

A frame on supports has a state of its own here: its units, where it starts, and how it changes.
"""

import functools
from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.lax import stop_gradient
from jaxtyping import Int, PyTree, Scalar

from jaxcrusher.basics.linear import solve_symmetric
from jaxcrusher.basics.plane import Vector
from jaxcrusher.basics.record import Record
from jaxcrusher.joint.clearance import AbstractBearing, Contact
from jaxcrusher.joint.guide import Guide
from jaxcrusher.mechanism.acting import acting
from jaxcrusher.mechanism.equations import Accelerations, Forces
from jaxcrusher.mechanism.guide_friction import rubbing
from jaxcrusher.mechanism.motion import Crank, Motion, moving
from jaxcrusher.mechanism.named import Named
from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.mechanism.snapshot import FrameMotion, Snapshot, frame_at
from jaxcrusher.mechanism.topology import FRAME

# Unit of a displacement on springs that do not give way, in throws of the crank.
LEAST = 1e-6


class FrameState(Record):
    """State of a frame on supports, scaled to order one by `FrameUnits`."""

    displacement: Vector  # of G from where all weight would push it straight down
    rotation: Scalar
    velocity: Vector  # m/s
    spin: Scalar  # at the radius of gyration, m/s


class Parts(NamedTuple):
    """The `parts` of any state, whatever its coordinates are."""

    eccentricities: Named[Vector]  # e / c of loose joints; none where the bodies' places tell them
    rates: Named[Vector]  # e' of the same joints, m/s
    memories: Named[PyTree[Scalar]]  # of the bearings that have one
    angle: Scalar | None  # of the crank, rad; None where the drive tells it
    frame: FrameState | None  # None: clamped


def unwound(state: PyTree[Scalar]) -> PyTree[Scalar]:
    """Return the same state, with the angle of its crank counted from the nearest whole turn.

    A motion goes on from there, at the end of a turn, as from angle zero.
    """
    angle = state.parts.angle
    if angle is None:
        return state
    whole = 2 * jnp.pi * jnp.round(angle / (2 * jnp.pi))
    return eqx.tree_at(lambda s: s.parts.angle, state, angle - whole)


def places_of(scene: Scene) -> Parts:
    """Return the parts of a section point, with its place, from 0 on, in place of each number."""
    shapes = eqx.filter_eval_shape(scene.formulation.initial, scene)
    leaves, structure = jax.tree.flatten(shapes)
    return jax.tree.unflatten(structure, range(len(leaves))).parts


def pins_of(scene: Scene) -> Int[np.ndarray, " half"]:
    """Return the places of e / c of the loose joints, x and y of each."""
    return np.array(jax.tree.leaves(places_of(scene).eccentricities), int)


def snapshot_of(
    scene: Scene,
    motion: Motion,
    contacts: Named[Contact],
    torque: Scalar | None,
    frame: FrameMotion | None,
    solve: Callable[[Motion, Forces], Accelerations],
) -> Snapshot:
    """Return an instant of a scene: the forces of its motion, and the accelerations under them.

    Every formulation passes its own `solve` of its equations. Friction of slides follows from the
    reactions, which `solve` gives under any forces.
    """
    applied = acting(motion, scene.pushes, scene.springs, scene.supports)
    upright = Vector(0.0, -scene.linkage.gravity)
    forces = Forces(applied.wrenches, upright, contacts, torque)
    if frame is not None and (supports := scene.supports) is not None:
        wrenches = (*applied.wrenches, supports.wrench(frame))
        upright = upright.seen_from(frame.axis)
        forces = Forces(wrenches, upright, contacts, torque, supports.moving(frame))
    under = functools.partial(solve, motion)
    found = rubbing(motion, scene.guides, forces, under) if len(scene.guides) else under(forces)
    return Snapshot(motion, contacts, applied, found, frame)


def contacts_of(scene: Scene, motion: Motion, memories: Named) -> Named[Contact]:
    """Return the contacts of joints and slides with clearance, whose gaps have these memories."""
    found = {}
    for name, one in scene.joints.items():
        ends, memory = motion.ends(name), memories[name]
        play = motion.eccentricities.at(name), motion.rates.at(name)
        if isinstance(one, Guide):
            slide = motion.linkage.slides.at(name)
            along, speed = slide.direction, slide.direction.dot(motion.velocity(ends.pin))
            found[name] = one.contact(along, slide.half_sizes, *play, speed, memory)
            continue
        assert isinstance(one, AbstractBearing)
        bore, pin = (motion.spin(point.body) for point in (ends.bore, ends.pin))
        spins = 0.0 if bore is None else bore, 0.0 if pin is None else pin
        found[name] = one.contact(*play, *spins, memory)
    return Named(found)


class FrameUnits(Record):
    """Units of the coordinates in the state of a frame."""

    x: Scalar  # m
    y: Scalar  # m
    angle: Scalar  # rad
    radius: Scalar  # of gyration, m
    sag: Scalar  # by which springs give way straight down under all weight, m

    def state(self, frame: FrameMotion) -> FrameState:
        """Return the state of a motion."""
        moved = Vector(frame.displacement.x / self.x, (frame.displacement.y + self.sag) / self.y)
        rotation = frame.rotation / self.angle
        return FrameState(moved, rotation, frame.velocity, self.radius * frame.spin)

    def motion(self, state: FrameState) -> FrameMotion:
        """Return the motion of a state, without accelerations."""
        moved = Vector(self.x * state.displacement.x, self.y * state.displacement.y - self.sag)
        spin = state.spin / self.radius
        return frame_at(moved, self.angle * state.rotation, state.velocity, spin)


def frame_units(scene: Scene) -> FrameUnits:
    """Return units in which a frame moves by numbers of order one, stiff or soft, light or heavy.

    The unit of a displacement is the throw of the crank over 1 + (natural / running frequency)^2,
    and a millionth of it more: so that the tolerance of an orbit stays above rounding where springs
    are stiffer still. Units are no part of the model and have no slopes.
    """
    foundation, speed = scene.supports, scene.drive.speed
    assert foundation is not None
    throw = scene.throw
    horizontal, vertical = foundation.horizontal_stiffness, foundation.vertical_stiffness

    def unit(stiffness: Scalar, inertia: Scalar) -> Scalar:
        return throw * (LEAST + 1 / (1 + stiffness / (inertia * speed**2)))

    radius = jnp.sqrt(foundation.inertia / foundation.mass)
    units = FrameUnits(
        unit(2 * horizontal, foundation.mass),
        unit(2 * vertical, foundation.mass),
        unit(foundation.rotational_stiffness(), foundation.inertia) / radius,
        radius,
        _weight(scene) / (2 * vertical),
    )
    return stop_gradient(units)


def _weight(scene: Scene) -> Scalar:
    """Return the weight of frame and bodies, N."""
    foundation, linkage = scene.supports, scene.linkage
    assert foundation is not None
    return linkage.gravity * (foundation.mass + linkage.mass)


def initial_frame(scene: Scene) -> FrameState | None:
    """Return the frame at rest where its supports carry all weight, or None if it is clamped.

    The crank is at angle zero, its pins are in the middle of their bores. Rotations are small here.
    """
    foundation, linkage = scene.supports, scene.linkage
    if foundation is None:
        return None
    still = jnp.zeros_like(scene.drive.speed)
    motion = moving(linkage, Crank(still, still), Named(), Named())
    moment = still
    for name, body in linkage.bodies.items():
        lever = motion.centre(name).x - foundation.point.x
        moment = moment - body.mass * linkage.gravity * lever
    (left, right), rigid = foundation.arms(), {}
    horizontal, vertical = foundation.horizontal_stiffness, foundation.vertical_stiffness
    rigid[0, 0], rigid[1, 1] = 2 * horizontal, 2 * vertical
    rigid[2, 0], rigid[2, 1] = -horizontal * (left.y + right.y), vertical * (left.x + right.x)
    rigid[2, 2] = foundation.rotational_stiffness()
    x, y, angle = solve_symmetric(rigid, [still, -_weight(scene), moment])
    frame = frame_at(Vector(x, y), angle, Vector(still, still), still)
    return frame_units(scene).state(frame)


def frame_rate(
    scene: Scene, frame: FrameMotion | None, accelerations: Accelerations
) -> FrameState | None:
    """Return the time derivative of the frame's state, or None if it is clamped."""
    if frame is None:
        return None
    units = frame_units(scene)
    second, spin_up = accelerations.centres.at(FRAME), accelerations.spin_ups.at(FRAME)
    velocity = Vector(frame.velocity.x / units.x, frame.velocity.y / units.y)
    turning = frame.spin / units.angle, units.radius * spin_up
    return FrameState(velocity, turning[0], second.along(frame.axis), turning[1])

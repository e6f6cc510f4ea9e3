"""What stands where in a state of a scene, and the instant that follows from its motion."""

from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Int, PyTree, Scalar

from jaxcrusher.basics.plane import Vector
from jaxcrusher.joint.clearance import Contact
from jaxcrusher.mechanism.drives import from_nearest_turn
from jaxcrusher.mechanism.equations import Accelerations, Forces
from jaxcrusher.mechanism.frame import FrameState
from jaxcrusher.mechanism.motion import Motion
from jaxcrusher.mechanism.named import Named
from jaxcrusher.mechanism.scene import AbstractScene
from jaxcrusher.mechanism.snapshot import FrameMotion, Snapshot


class Parts(NamedTuple):
    """What every state tells as its `parts`, whatever coordinates it is written in."""

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
    return eqx.tree_at(lambda s: s.parts.angle, state, from_nearest_turn(angle))


def places_of(scene: AbstractScene) -> Parts:
    """Return the parts of a section point: in the stead of each number its place, from 0 on."""
    shapes = eqx.filter_eval_shape(scene.formulation.initial, scene)
    leaves, structure = jax.tree.flatten(shapes)
    return jax.tree.unflatten(structure, range(len(leaves))).parts


def pins_of(scene: AbstractScene) -> Int[np.ndarray, " half"]:
    """Return the places of e / c of the loose joints, x and y of each."""
    return np.array(jax.tree.leaves(places_of(scene).eccentricities), int)


def snapshot_of(
    scene: AbstractScene,
    motion: Motion,
    contacts: Named[Contact],
    torque: Scalar | None,
    frame: FrameMotion | None,
    solve: Callable[[Motion, Forces], Accelerations],
) -> Snapshot:
    """Return an instant of a scene: the forces of its motion, and the accelerations under them.

    Every formulation comes here with its own way to solve its equations. A force that follows from
    what holds the bodies together, such as friction of a slide, belongs here: `solve` tells the
    reactions under any forces.
    """
    applied, upright = scene.applied(motion), Vector(0.0, -scene.linkage.gravity)
    forces = Forces(applied.wrenches, upright, contacts, torque)
    if frame is not None and (supports := scene.supports) is not None:
        wrenches = (*applied.wrenches, supports.wrench(frame))
        upright = upright.seen_from(frame.axis)
        forces = Forces(wrenches, upright, contacts, torque, supports.moving(frame))
    return Snapshot(motion, contacts, applied, solve(motion, forces), frame)


def contacts_of(scene: AbstractScene, motion: Motion, memories: Named) -> Named[Contact]:
    """Return the contacts of the joints with clearance, whose bearings have these memories."""
    found = {}
    for name, one in scene.joints.items():
        joint = motion.linkage.joint(name)
        bore, pin = motion.spin(joint.bore.body), motion.spin(joint.pin.body)
        found[name] = one.contact(
            motion.eccentricities.at(name),
            motion.rates.at(name),
            0.0 if bore is None else bore,
            0.0 if pin is None else pin,
            memories[name],
        )
    return Named(found)

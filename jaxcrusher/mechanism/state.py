"""The instant of a scene that follows from a motion, whatever its equations are written in."""

from collections.abc import Callable

from jaxtyping import Scalar

from jaxcrusher.basics.plane import Vector
from jaxcrusher.joint.clearance import Contact
from jaxcrusher.mechanism.equations import Accelerations, Forces
from jaxcrusher.mechanism.motion import Motion
from jaxcrusher.mechanism.named import Named
from jaxcrusher.mechanism.scene import AbstractScene
from jaxcrusher.mechanism.snapshot import FrameMotion, Snapshot


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


def contacts_of(scene: AbstractScene, motion: Motion, memories: Named[Scalar]) -> Named[Contact]:
    """Return the contacts of the joints with clearance; `memories` are those of normal laws."""
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

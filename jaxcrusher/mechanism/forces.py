"""What acts on a motion: contacts of its loose joints, loads, supports and weight."""

from jaxtyping import Scalar

from jaxcrusher.basics.plane import Vector
from jaxcrusher.joint.clearance import AbstractBearing, Contact
from jaxcrusher.mechanism.equations import MovingFrame, Wrench
from jaxcrusher.mechanism.motion import Motion
from jaxcrusher.mechanism.named import Named
from jaxcrusher.mechanism.scene import AbstractApplied, AbstractScene
from jaxcrusher.mechanism.snapshot import FrameMotion


def contacts_of(scene: AbstractScene, motion: Motion, memories: Named[Scalar]) -> Named[Contact]:
    """Return the contacts of the joints with clearance; `memories` are those of normal laws."""
    found = {}
    for name, one in scene.joints.items():
        found[name] = _contact(one, motion, name, memories[name])
    return Named(found)


def _contact(one: AbstractBearing, motion: Motion, name: str, memory: Scalar | None) -> Contact:
    joint = motion.linkage.joint(name)
    e, rate = motion.eccentricities[name], motion.rates[name]
    assert e is not None and rate is not None
    bore, pin = motion.spin(joint.bore.body), motion.spin(joint.pin.body)
    still = 0.0
    return one.contact(
        e, rate, still if bore is None else bore, still if pin is None else pin, memory
    )


def wrenches_of(
    scene: AbstractScene, applied: AbstractApplied, frame: FrameMotion | None
) -> tuple[list[Wrench], Vector, MovingFrame | None]:
    """Return what acts besides contacts, the weight of a unit mass, and the frame as a body."""
    upright = Vector(0.0, -scene.linkage.gravity)
    if frame is None or scene.supports is None:
        return list(applied.wrenches), upright, None
    wrenches = [*applied.wrenches, scene.supports.wrench(frame)]
    return wrenches, upright.seen_from(frame.axis), scene.supports.moving(frame)

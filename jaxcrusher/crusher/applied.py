"""What acts on the jaw besides its weight and its joints."""

from jaxtyping import Scalar

from jaxcrusher.crusher.interfaces import AbstractScene
from jaxcrusher.crusher.linkage import AtJaw, Chain
from jaxcrusher.crusher.loads import JawMotion
from jaxcrusher.crusher.snapshot import Applied, JawForce, ShaftMotion


def applied(scene: AbstractScene, shaft: ShaftMotion, chain: Chain) -> Applied:
    """Return what acts on the jaw of a scene that moves so."""
    jaw = JawMotion(scene.machine, shaft, chain)
    load = None if scene.load is None else scene.load.force(jaw)
    total = None if load is None else AtJaw(load.force, _moment(jaw, load))
    if scene.rod is None:
        return Applied(load, None, total)
    rod = scene.rod.pull(jaw)
    force, moment = rod.force, rod.arm.cross(rod.force)
    if total is not None:
        force = force + total.force
        moment = moment if total.moment is None else moment + total.moment
    return Applied(load, rod, AtJaw(force, moment))


def _moment(jaw: JawMotion, one: JawForce) -> Scalar | None:
    """Return the moment of a force about S2, None where it acts there."""
    if one.along is None:
        return None
    return (jaw.arm(one.along) - jaw.arm(None)).cross(one.force)

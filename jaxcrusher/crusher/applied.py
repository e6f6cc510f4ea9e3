"""What acts on the jaw besides its weight and its joints."""

from jaxtyping import Scalar

from jaxcrusher.crusher.interfaces import AbstractScene
from jaxcrusher.crusher.linkage import AtJaw, Chain
from jaxcrusher.crusher.loads import JawMotion
from jaxcrusher.crusher.snapshot import Applied, JawForce, ShaftMotion


def applied(scene: AbstractScene, shaft: ShaftMotion, chain: Chain) -> Applied:
    """Return what acts on the jaw of a scene that moves so."""
    if scene.load is None:
        return Applied(None, None)
    jaw = JawMotion(scene.machine, shaft, chain)
    load = scene.load.force(jaw)
    return Applied(load, AtJaw(load.force, _moment(jaw, load)))


def _moment(jaw: JawMotion, one: JawForce) -> Scalar | None:
    """Return the moment of a force about S2, None where it acts there."""
    if one.along is None:
        return None
    return (jaw.arm(one.along) - jaw.arm(None)).cross(one.force)

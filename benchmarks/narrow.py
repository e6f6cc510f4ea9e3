"""A scene all but without smoothing."""

import equinox as eqx
from jaxtyping import Scalar

import jaxcrusher as jc


def narrow(scene: jc.Scene) -> jc.Scene:
    """Return a scene with a hundredth of the widths that smooth contacts' corners and |e|."""

    def widths(scene: jc.Scene) -> list[Scalar]:
        joints = [joint for _, joint in scene.joints.present()]
        return [width for joint in joints for width in (joint.normal.width, joint.norm_width)]

    return eqx.tree_at(widths, scene, [width / 100 for width in widths(scene)])

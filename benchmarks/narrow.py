"""A scene all but without smoothing."""

import equinox as eqx
from jaxtyping import Scalar

import jaxcrusher as jc
from jaxcrusher.joint.normal import AbstractNormalLaw


def narrow(scene: jc.Scene) -> jc.Scene:
    """Return a scene with a hundredth of the widths that smooth contacts' corners and |e|."""

    def widths(scene: jc.Scene) -> list[Scalar]:
        found = []
        for _, joint in scene.joints.items():
            assert isinstance(joint.normal, AbstractNormalLaw)
            found += [joint.normal.width, joint.norm_width]
        return found

    return eqx.tree_at(widths, scene, [width / 100 for width in widths(scene)])

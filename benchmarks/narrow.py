"""A scene all but without smoothing."""

from typing import TypeVar

import equinox as eqx
from jaxtyping import Scalar

from jaxcrusher.joint.normal import AbstractNormalLaw
from jaxcrusher.mechanism.scene import Scene

Machine = TypeVar("Machine", bound=Scene)


def narrow(scene: Machine) -> Machine:
    """Return a scene with a hundredth of the widths that smooth contacts' corners and |e|."""

    def widths(scene: Scene) -> list[Scalar]:
        found = []
        for _, joint in scene.bearings.items():
            assert isinstance(joint.normal, AbstractNormalLaw)
            found += [joint.normal.width, joint.norm_width]
        return found

    return eqx.tree_at(widths, scene, [width / 100 for width in widths(scene)])

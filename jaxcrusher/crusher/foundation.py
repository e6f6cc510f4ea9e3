"""What the frame stands on: the ground itself, where forces and moments are counted from."""

import equinox as eqx

from jaxcrusher.basics.plane import Vector


class AbstractFoundation(eqx.Module):
    """Ground under the frame; a scene without a foundation has a clamped frame and counts about C.

    `point` (m, C is the origin) is what moments on the ground are counted about.
    """

    point: eqx.AbstractVar[Vector]


class Clamped(AbstractFoundation):
    """A frame that does not move."""

    point: Vector  # m

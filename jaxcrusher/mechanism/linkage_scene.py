"""A scene of any linkage: its drive, bearings where joints are loose, and forces that stay."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Scalar

from jaxcrusher.basics.plane import Vector
from jaxcrusher.joint.clearance import AbstractBearing
from jaxcrusher.mechanism.drives import AbstractDrive
from jaxcrusher.mechanism.eccentricity import EccentricityFormulation
from jaxcrusher.mechanism.equations import Wrench, wrench_at
from jaxcrusher.mechanism.linkage import Linkage, Point
from jaxcrusher.mechanism.motion import Motion
from jaxcrusher.mechanism.named import Named
from jaxcrusher.mechanism.scene import (
    AbstractApplied,
    AbstractFormulation,
    AbstractScene,
    AbstractStart,
)
from jaxcrusher.mechanism.starts import Centred
from jaxcrusher.mechanism.supports import AbstractFoundation
from jaxcrusher.mechanism.topology import FRAME


class Push(eqx.Module):
    """A force that stays as it is, in the frame's axes (N), on a point of a body.

    What it has as its reaction, such as a cylinder's end under the gas on a piston, is one more.
    """

    at: Point
    force: Vector


class Pushed(AbstractApplied):
    """What the pushes do."""

    wrenches: tuple[Wrench, ...]


class LinkageScene(AbstractScene):
    """A linkage as drawn, with a drive, the bearings of its loose joints by name, and pushes.

    Joints that are not named are ideal. With no `foundation` the frame is clamped.
    """

    drawn: Linkage
    bearings: Named[AbstractBearing]
    drive: AbstractDrive
    pushes: tuple[Push, ...] = ()
    formulation: AbstractFormulation = eqx.field(default_factory=EccentricityFormulation)
    start: AbstractStart | None = eqx.field(default_factory=Centred)
    foundation: AbstractFoundation | None = None

    @property
    def linkage(self) -> Linkage:
        """Return bodies, joints and slides."""
        return self.drawn

    @property
    def joints(self) -> Named[AbstractBearing]:
        """Return the joints with clearance."""
        return self.bearings

    @property
    def throw(self) -> Scalar:
        """Return how far the crank's pin is from its bearing, m."""
        linkage, crank = self.linkage, self.linkage.crank
        pin = next(n for n, *both in linkage.ends if crank in both and n != linkage.bearing)
        arm = linkage.side_of(pin, crank) - linkage.side_of(linkage.bearing, crank)
        squared = arm.squared()
        assert squared is not None, "two joints of a body are apart"
        return jnp.sqrt(squared)

    def applied(self, motion: Motion) -> Pushed:
        """Return the forces of all pushes; those on a clamped frame move nothing."""
        found = []
        for push in self.pushes:
            if push.at.body != FRAME:
                found.append(wrench_at(motion, push.at, push.force))
            elif self.supports is not None:
                arm = push.at.arm.vector() - self.supports.point
                found.append(Wrench(FRAME, push.force, arm.cross(push.force)))
        return Pushed(tuple(found))

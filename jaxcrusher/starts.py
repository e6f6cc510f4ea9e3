"""Where the pin starts in its bore."""

import equinox as eqx

from jaxcrusher.formulations.closed_linkage import ClosedLinkage
from jaxcrusher.plane import Vector, scalar
from jaxcrusher.scene import AbstractStart, Scene
from jaxcrusher.smooth import norm


class Centred(AbstractStart):
    """e = e' = 0 relative to the ideal motion, the paper's initial condition: a hard start."""

    def eccentricity(self, scene: Scene) -> tuple[Vector, Vector]:
        """Zero and zero."""
        return Vector(0.0, 0.0), Vector(0.0, 0.0)


class InContact(AbstractStart):
    """The pin rests in the bore under the ideal joint's force, with the ideal velocities."""

    def eccentricity(self, scene: Scene) -> tuple[Vector, Vector]:
        """Along the ideal joint force, deep enough to carry it; rate zero."""
        assert scene.joint is not None
        time = scalar(0.0)
        ideal = ClosedLinkage().snapshot(time, scene.drive.initial(), scene)
        size = norm(ideal.joint_force, 0.0)
        depth = scene.joint.clearance + scene.joint.normal.penetration_under(size)
        return depth * (ideal.joint_force / size), Vector(0.0, 0.0)


class Given(AbstractStart):
    """Any eccentricity and rate: `relative` in clearances, `rate` in m/s."""

    relative: Vector
    rate: Vector = eqx.field(default_factory=lambda: Vector(0.0, 0.0))

    def eccentricity(self, scene: Scene) -> tuple[Vector, Vector]:
        """As given."""
        assert scene.joint is not None
        return scene.joint.clearance * self.relative, self.rate

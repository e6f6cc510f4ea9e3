"""A scene of any linkage: its drive, bearings where joints are loose, and forces on bodies."""

import dataclasses
from collections.abc import Callable, Mapping
from typing import Any

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Scalar

from jaxcrusher.basics.checks import require, require_x64
from jaxcrusher.basics.plane import plus
from jaxcrusher.joint.clearance import AbstractBearing
from jaxcrusher.joint.validity import Turning
from jaxcrusher.mechanism.acting import (
    AbstractPush,
    Acting,
    PushByAngle,
    Spring,
    acting,
    push_power,
    spring_loss,
)
from jaxcrusher.mechanism.drives import AbstractDrive
from jaxcrusher.mechanism.eccentricity import EccentricityFormulation
from jaxcrusher.mechanism.linkage import Linkage, Point
from jaxcrusher.mechanism.linkage_statistics import (
    Parts,
    may_rest,
    observables_of,
    statistics_of,
    usual_of,
)
from jaxcrusher.mechanism.motion import Motion
from jaxcrusher.mechanism.named import Named, before
from jaxcrusher.mechanism.reductions import Chosen, Statistic
from jaxcrusher.mechanism.scene import (
    AbstractFormulation,
    AbstractScene,
    AbstractStart,
    require_clearance,
)
from jaxcrusher.mechanism.snapshot import Observable, Snapshot
from jaxcrusher.mechanism.starts import Centred
from jaxcrusher.mechanism.supports import AbstractFoundation
from jaxcrusher.mechanism.topology import FRAME


class LinkageScene(AbstractScene):
    """A linkage as drawn, with a drive, the bearings of its loose joints by name, and forces.

    Joints that are not named are ideal. With no `foundation` the frame is clamped. Of `points`, and
    of the mass centre of each body, there are position, velocity and acceleration. `own` is what
    `with_statistics` adds.

    Raises ValueError (concrete values only) if 64-bit floats are off, for a bearing of a joint that
    there is not, for a clearance that is not inside (0, R_i), for a push or a spring at a body that
    there is not, for a push of the frame, and for a name of a point or slide by which a result
    would be named that has this name already.
    """

    drawn: Linkage
    bearings: Named[AbstractBearing]
    drive: AbstractDrive
    pushes: tuple[AbstractPush, ...] = ()
    springs: tuple[Spring, ...] = ()
    formulation: AbstractFormulation = eqx.field(default_factory=EccentricityFormulation)
    start: AbstractStart | None = eqx.field(default_factory=Centred)
    foundation: AbstractFoundation | None = None
    points: Named[Point] = eqx.field(default_factory=Named)
    own: Chosen = eqx.field(static=True, default=())

    def __check_init__(self):
        require_x64()
        known = self.drawn.joints.names
        for name, bearing in self.bearings.items():
            require(name in known, "bearings", f"be of joints: {', '.join(known)}", f"of {name}")
            require_clearance(bearing.clearance, bearing.bore_radius, before(name))
        bodies = self.drawn.bodies.names
        for name, point in self.points.items():
            require(name not in bodies, "points", "have names that no body has", name)
            require(point.body in bodies, f"points.{name}", "be of a body", f"of {point.body}")
        must = f"be at bodies that there are: {', '.join(bodies)}"
        for push in self.pushes:  # one of the frame would be its own reaction
            require(push.at.body in bodies, "pushes", must, f"at {push.at.body}")
        for body in (point.body for spring in self.springs for point in spring.ends):
            require(body in (*bodies, FRAME), "springs", f"{must}, {FRAME}", f"at {body}")
        observables_of(self._parts)

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
        """Return how far the crank's pin is from its bearing, m; alone, its radius of gyration."""
        linkage, crank = self.linkage, self.linkage.crank
        body, bearing = linkage.body(crank), linkage.side_of(linkage.bearing, crank)
        pins = [n for n, *both in linkage.ends if crank in both and n != linkage.bearing]
        end = linkage.side_of(pins[0], crank) if pins else body.mass_centre
        squared = (end - bearing).squared()
        squared = squared if pins else plus(squared, body.inertia / body.mass)
        assert squared is not None, "two joints of a body are apart"
        return jnp.sqrt(squared)

    def point(self, name: str) -> Point:
        """Return a point by its name, or the mass centre of the body of that name."""
        return self.points[name] or self.linkage.centre(name)

    def applied(self, motion: Motion) -> Acting:
        """Return what pushes and springs do to bodies, and by their reactions to the frame."""
        pushes = [(push.at, push.force(motion)) for push in self.pushes]
        return acting(motion, pushes, self.springs, self.supports)

    @property
    def _parts(self) -> Parts:
        rubbing = (name for name, one in self.joints.items() if one.friction is not None)
        linkage = self.linkage
        return Parts(
            linkage.joints.names,
            self.joints.names,
            tuple(rubbing),
            linkage.slides.names,
            tuple(dict.fromkeys((*linkage.bodies.names, *self.points.names))),
            self.supports is not None,
            may_rest(self),
        )

    @property
    def observables(self) -> Mapping[str, Observable]:
        """Return those of its joints, slides and points, of the machine and of its supports."""
        return observables_of(self._parts)

    @property
    def statistics(self) -> Mapping[str, Statistic]:
        """Return those of joints and points, of the machine, of its supports, and the user's."""
        return statistics_of(self._parts) | dict(self.own)

    @property
    def usual_statistics(self) -> tuple[str, ...]:
        """Return the names of what is computed without being asked for."""
        return (*usual_of(self._parts), *dict(self.own))

    @property
    def works(self) -> Mapping[str, Callable[[Snapshot, AbstractScene], Scalar]]:
        """Return the power of the pushes, and what dampers of springs take."""
        springs = {"spring_loss": spring_loss} if self.springs else {}
        return {"load_work": push_power} | springs

    @property
    def limits(self) -> Mapping[str, tuple[Callable[..., Any], tuple[str, ...]]]:
        """Return the limit of a free crank under friction."""
        return {"free crank": (Turning, ("crank_speed_least",))} if may_rest(self) else {}

    def steady(self) -> "LinkageScene":
        """Return the scene: its forces repeat with the crank's turn, or ValueError is raised."""
        for push in self.pushes:
            if isinstance(push, PushByAngle):
                push.require_period()
        return self

    def ideal(self) -> "LinkageScene":
        """Return the same scene with ideal joints."""
        formulation = EccentricityFormulation()
        none = Named[AbstractBearing]()
        return dataclasses.replace(self, bearings=none, start=None, formulation=formulation)

"""A scene of any linkage: its drive, bearings where joints are loose, and forces on bodies."""

import abc
import dataclasses
from collections.abc import Callable, Mapping
from typing import Any

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Scalar

from jaxcrusher.basics.checks import require, require_x64
from jaxcrusher.basics.plane import Vector, scalar, total
from jaxcrusher.basics.smooth import norm
from jaxcrusher.joint.clearance import AbstractBearing
from jaxcrusher.joint.validity import Turning
from jaxcrusher.mechanism.drives import AbstractDrive
from jaxcrusher.mechanism.eccentricity import EccentricityFormulation
from jaxcrusher.mechanism.equations import Wrench, wrench_at
from jaxcrusher.mechanism.linkage import Linkage, Point, require_direction
from jaxcrusher.mechanism.linkage_statistics import (
    Parts,
    may_rest,
    observables_of,
    statistics_of,
    usual_of,
)
from jaxcrusher.mechanism.motion import Motion
from jaxcrusher.mechanism.named import Named, before
from jaxcrusher.mechanism.reductions import Statistic
from jaxcrusher.mechanism.scene import (
    AbstractApplied,
    AbstractFormulation,
    AbstractScene,
    AbstractStart,
    require_clearance,
)
from jaxcrusher.mechanism.snapshot import Observable, Snapshot
from jaxcrusher.mechanism.starts import Centred
from jaxcrusher.mechanism.supports import AbstractFoundation
from jaxcrusher.mechanism.topology import FRAME


class AbstractPush(eqx.Module):
    """A force between the frame and a point of a body.

    Its reaction acts on the frame in the same line, as that of the gas on a piston acts on the
    cylinder's end, so that it does not shake the ground by itself.
    """

    at: eqx.AbstractVar[Point]

    @abc.abstractmethod
    def force(self, motion: Motion) -> Vector:
        """Return the force on the body, in the frame's axes, N."""


class Push(AbstractPush):
    """A force that stays as it is, in the frame's axes."""

    at: Point
    given: Vector  # N

    def force(self, motion: Motion) -> Vector:
        """Return the given force."""
        return self.given


class PushByAngle(AbstractPush):
    """A force along a direction that stays, by the angle of the crank.

    Raises ValueError for a direction without length.
    """

    at: Point
    along: Vector  # of any length
    size: Callable[[Scalar], Scalar]  # N, by the angle in rad

    def __check_init__(self):
        require_direction(self.along)

    def force(self, motion: Motion) -> Vector:
        """Return the force at the crank's angle."""
        return self.size(motion.crank.angle) * (self.along / norm(self.along, 0.0))


class Spring(eqx.Module):
    """A spring with a damper beside it, between two points of bodies or of the frame.

    It pulls its ends together by preload + stiffness (L - L0) + damping L', and pushes them apart
    where that is negative.
    """

    ends: tuple[Point, Point]
    stiffness: Scalar = eqx.field(converter=scalar)  # N/m
    length: Scalar = eqx.field(converter=scalar)  # L0, m
    damping: Scalar = eqx.field(converter=scalar, default=0.0)  # N s/m
    preload: Scalar = eqx.field(converter=scalar, default=0.0)  # N

    def stretched(self, motion: Motion) -> "Stretched":
        """Return how far and how fast it is stretched in a motion."""
        begin, end = self.ends
        apart = motion.position(end) - motion.position(begin)
        length = norm(apart, 0.0)
        axis = apart / length
        rate = (motion.velocity(end) - motion.velocity(begin)).dot(axis)
        return Stretched(self, axis, length - self.length, rate)


class Stretched(eqx.Module):
    """A spring as it is stretched at an instant."""

    spring: Spring
    axis: Vector  # from its first to its second end, unit
    stretch: Scalar  # L - L0, m
    rate: Scalar  # m/s

    @property
    def pull(self) -> Scalar:
        """Return the force by which it pulls its ends together, N."""
        elastic = self.spring.preload + self.spring.stiffness * self.stretch
        return elastic + self.spring.damping * self.rate

    @property
    def energy(self) -> Scalar:
        """Return the work of its spring since the length L0, J."""
        half = 0.5 * self.spring.stiffness * self.stretch
        return (self.spring.preload + half) * self.stretch

    @property
    def loss(self) -> Scalar:
        """Return the power that its damper takes, W."""
        return self.spring.damping * self.rate**2


class Acting(AbstractApplied):
    """What pushes and springs do."""

    wrenches: tuple[Wrench, ...]
    pushes: tuple[tuple[Point, Vector], ...]
    springs: tuple[Stretched, ...]

    def elastic_energy(self) -> Scalar | None:
        """Return what the springs have stored, J; None without one."""
        return total([one.energy for one in self.springs])


def _push_power(s: Snapshot, scene: AbstractScene) -> Scalar:
    power = jnp.zeros_like(s.motion.crank.speed)
    for point, force in s.applied.pushes:
        power = power + force.dot(s.motion.velocity(point))
    return power


def _spring_loss(s: Snapshot, scene: AbstractScene) -> Scalar:
    loss = jnp.zeros_like(s.motion.crank.speed)
    for one in s.applied.springs:
        loss = loss + one.loss
    return loss


class LinkageScene(AbstractScene):
    """A linkage as drawn, with a drive, the bearings of its loose joints by name, and forces.

    Joints that are not named are ideal. With no `foundation` the frame is clamped. Of `points`, and
    of the mass centre of each body, there are position, velocity and acceleration.

    Raises ValueError (concrete values only) if 64-bit floats are off, for a bearing of a joint that
    there is not, for a clearance that is not inside (0, R_i), and for a name of a point or slide by
    which a result would be named that has this name already.
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
        """Return how far the crank's pin is from its bearing, m."""
        linkage, crank = self.linkage, self.linkage.crank
        pin = next(n for n, *both in linkage.ends if crank in both and n != linkage.bearing)
        arm = linkage.side_of(pin, crank) - linkage.side_of(linkage.bearing, crank)
        squared = arm.squared()
        assert squared is not None, "two joints of a body are apart"
        return jnp.sqrt(squared)

    def point(self, name: str) -> Point:
        """Return a point by its name, or the mass centre of the body of that name."""
        found = self.points[name]
        return found or Point(name, self.linkage.body(name).mass_centre)

    def applied(self, motion: Motion) -> Acting:
        """Return what pushes and springs do to bodies, and by their reactions to the frame."""
        pushes: tuple[tuple[Point, Vector], ...]
        pushes = tuple((push.at, push.force(motion)) for push in self.pushes)
        springs = tuple(one.stretched(motion) for one in self.springs)
        wrenches = []
        for point, force in pushes:
            wrenches += self._wrenches(motion, point, force)
            wrenches += self._on_frame(motion, point, -force)
        for one in springs:
            begin, end = one.spring.ends
            wrenches += self._wrenches(motion, begin, one.pull * one.axis)
            wrenches += self._wrenches(motion, end, -one.pull * one.axis)
        return Acting(tuple(wrenches), pushes, springs)

    def _wrenches(self, motion: Motion, point: Point, force: Vector) -> list[Wrench]:
        if point.body == FRAME:
            return self._on_frame(motion, point, force)
        return [wrench_at(motion, point, force)]

    def _on_frame(self, motion: Motion, point: Point, force: Vector) -> list[Wrench]:
        """Return what the frame feels of a force at the place of a point, if it can move."""
        if self.supports is None:
            return []
        arm = motion.position(point) - self.supports.point
        return [Wrench(FRAME, force, arm.cross(force))]

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
        """Return those of its joints and points, of the machine and of its supports."""
        return statistics_of(self._parts)

    @property
    def usual_statistics(self) -> tuple[str, ...]:
        """Return the names of what is computed without being asked for."""
        return usual_of(self._parts)

    @property
    def works(self) -> Mapping[str, Callable[[Snapshot, AbstractScene], Scalar]]:
        """Return the power of the pushes, and what dampers of springs take."""
        springs = {"spring_loss": _spring_loss} if self.springs else {}
        return {"load_work": _push_power} | springs

    @property
    def limits(self) -> Mapping[str, tuple[Callable[..., Any], tuple[str, ...]]]:
        """Return the limit of a free crank under friction."""
        return {"crank": (Turning, ("crank_speed_least",))} if may_rest(self) else {}

    def steady(self) -> "LinkageScene":
        """Return the scene: its forces repeat with the crank's turn."""
        return self

    def ideal(self) -> "LinkageScene":
        """Return the same scene with ideal joints."""
        formulation = EccentricityFormulation()
        none = Named[AbstractBearing]()
        return dataclasses.replace(self, bearings=none, start=None, formulation=formulation)

"""A planar revolute joint with radial clearance: a journal (pin) loose in a bearing (bore).

Nothing here knows of the crusher: a bearing body, a journal body, and the eccentricity
between their centres.
"""

import abc
import dataclasses
import functools

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import ArrayLike, Float, PyTree, Scalar
from typing_extensions import override

from jaxcrusher.basics import smooth
from jaxcrusher.basics.plane import Vector, plus, scalar
from jaxcrusher.basics.record import Printed, Record
from jaxcrusher.joint.film import Film
from jaxcrusher.joint.friction import AbstractFriction
from jaxcrusher.joint.normal import AbstractNormalForce, ConstantImpactVelocity


class Contact(Record):
    """The state of the contact and what it does to the two bodies.

    Both forces act at one point, the bore's surface at R_i n from the bearing's centre, so
    action and reaction balance in moment too. (Others take the middle of the overlap, as
    EXUDYN does: penetration / (2 R_i) more moment.)
    """

    penetration: Scalar  # delta = |e| - c, m; negative in flight
    penetration_rate: Scalar  # delta' = e'.n, m/s
    orbit_speed: Scalar  # of the pin round the bore, (e x e') / |e|^2, rad/s
    normal_force: Scalar  # F_n, N
    force: Vector  # on the bearing, N
    normal_loss: Scalar  # power that the damping takes, W
    friction_force: Scalar | None = None  # F_t on the bearing along t, N
    friction_loss: Scalar | None = None  # power that friction and a film take, W
    surface_speed: Scalar | None = None  # bearing's material past the journal's, along t, m/s
    slip_speed: Scalar | None = None  # of these two or of the centres, as friction sees it, m/s
    bearing_moment: Scalar | None = None  # on the bearing about its centre, N m
    journal_moment: Scalar | None = None  # on the journal about its centre, N m
    corners: "tuple[Contact, ...]" = ()  # of which it is the sum, if it is one

    @property
    def approach(self) -> Scalar:
        """Return the speed of the place that approaches fastest, m/s: a corner if it has any.

        The deepest corner changes in an instant, and its rate with it; this one does not jump.
        """
        rates = (one.penetration_rate for one in self.corners or (self,))
        return functools.reduce(jnp.maximum, rates)


class Memory(Record):
    """What the laws of a bearing remember along the motion; None: nothing."""

    impact: Scalar | None  # of the impact velocity, m/s
    friction: Scalar | None


def touches_of(memory: PyTree[Scalar] | None) -> list[Memory]:
    """Return what each place where a gap closes remembers: one for a pin, more for corners."""
    parts = jax.tree.leaves(memory, is_leaf=lambda part: isinstance(part, Memory))
    return [part for part in parts if isinstance(part, Memory)]


class AbstractGap(Printed):
    """A gap between two bodies, and what they do to each other where it closes.

    `friction` acts between sliding surfaces; None: there is none.
    """

    bore_radius: eqx.AbstractVar[Scalar]  # R_i, m; infinite between straight edges
    clearance: eqx.AbstractVar[Scalar]  # c, m
    normal: eqx.AbstractVar[AbstractNormalForce]
    friction: eqx.AbstractVar[AbstractFriction | None]

    @abc.abstractmethod
    def half_width_ratio(self, penetration: Scalar) -> Scalar:
        """Hertz's half-width over the radius against which it must be small."""

    @abc.abstractmethod
    def resting(self, force: Vector, mean_spin: Scalar) -> Vector:
        """The e (m) at which a body that hardly moves in the gap carries a force (N) on the other.

        `mean_spin` is the mean of both spins, rad/s.
        """

    def initial_memory(self) -> PyTree[Scalar] | None:
        """What the gap remembers at the start of a motion, of order one; None: nothing.

        It is part of the state. Here it is what the impact velocity and the friction remember; a
        gap whose laws remember more returns a record of all, and its rate by `memory_rate`.
        """
        friction = None if self.friction is None else self.friction.initial()
        found = Memory(self.normal.impact_velocity.initial(), friction)
        return found if jax.tree.leaves(found) else None

    def holding(self, velocities: Float[ArrayLike, "*touches"]) -> "AbstractGap":
        """Return the gap with a constant impact velocity (m/s), or with one of each touch."""
        law = ConstantImpactVelocity(jnp.asarray(velocities, float))
        return eqx.tree_at(lambda gap: gap.normal.impact_velocity, self, law)

    def memory_rate(self, contact: Contact, memory: PyTree[Scalar] | None) -> PyTree[Scalar] | None:
        """The time derivative of what the gap remembers, per second."""
        if memory is None:
            return None
        depth, approach = contact.penetration, contact.penetration_rate
        in_contact, friction = self.normal.in_contact(depth), None
        impact = self.normal.impact_velocity.rate(memory.impact, in_contact, depth, approach)
        if memory.friction is not None:
            assert self.friction is not None and contact.slip_speed is not None
            friction = self.friction.rate(memory.friction, in_contact, contact.slip_speed)
        return Memory(impact, friction)

    def pressed(
        self, penetration: Scalar, rate: Scalar, memory: Memory | None
    ) -> tuple[Scalar, Scalar]:
        """The normal force at a penetration (m), N, and the power of its damping, W."""
        impact = None if memory is None else memory.impact
        force = self.normal.force(penetration, rate, impact)
        return force, (force - self.normal.elastic_force(penetration)) * rate

    def rubbed(self, normal_force: Scalar, slip: Scalar, memory: Memory | None) -> Scalar:
        """The friction force at a slip (m/s), as the law sees it, N."""
        assert self.friction is not None, "nothing rubs there"
        known = () if memory is None or memory.friction is None else (memory.friction,)
        return self.friction.force(normal_force, slip, *known)

    def elastic_energy(self, contact: Contact) -> Scalar:
        """Energy stored in the contact, J."""
        return self.normal.elastic_energy(contact.penetration)


class AbstractBearing(AbstractGap):
    """A bearing body, a journal body, a radial clearance, and what they do to each other.

    `norm_width` (m) smooths |e| at e = 0.
    """

    norm_width: eqx.AbstractVar[Scalar]  # m

    @abc.abstractmethod
    def contact(
        self,
        eccentricity: Vector,
        rate: Vector,
        bearing_spin: Scalar | float,
        journal_spin: Scalar | float,
        memory: PyTree[Scalar] | None,
    ) -> Contact:
        """The contact at eccentricity e = journal centre - bearing centre (m), rate e' (m/s).

        Spins in rad/s, counterclockwise; `memory` is what the bearing remembers.
        """

    @override
    def resting(self, force: Vector, mean_spin: Scalar) -> Vector:
        size = smooth.norm(force, 0.0)
        return (self.clearance + self.normal.penetration_under(size)) * (force / size)


class ClearanceJoint(AbstractBearing):
    """Bore of radius R_i, pin of radius R_i - c, a normal law and a friction law or None.

    A `film` between them adds its force to that of the contact.

    `norm_width` (m) smooths |e| at e = 0, where (2) of the paper is undefined; it shifts a
    penetration by norm_width**2 / (2 c), 1e-14 m.
    """

    bore_radius: Scalar = eqx.field(converter=scalar)  # R_i, m
    clearance: Scalar = eqx.field(converter=scalar)  # c = R_i - R_j, m
    normal: AbstractNormalForce
    friction: AbstractFriction | None
    norm_width: Scalar = eqx.field(converter=scalar, default=1e-9)
    film: Film | None = None

    @override
    def contact(
        self,
        eccentricity: Vector,
        rate: Vector,
        bearing_spin: Scalar | float,
        journal_spin: Scalar | float,
        memory: Memory | None,
    ) -> Contact:
        touch = self._dry(eccentricity, rate, bearing_spin, journal_spin, memory)
        if self.film is None:
            return touch
        sizes = self.bore_radius, self.clearance
        film = self.film.action(eccentricity, rate, bearing_spin, journal_spin, *sizes)
        return dataclasses.replace(
            touch,
            force=touch.force + film.force,
            friction_loss=plus(touch.friction_loss, film.loss),
            bearing_moment=plus(touch.bearing_moment, film.bearing_moment),
            journal_moment=plus(touch.journal_moment, film.journal_moment),
        )

    @override
    def resting(self, force: Vector, mean_spin: Scalar) -> Vector:
        if self.film is None:
            return super().resting(force, mean_spin)
        return self.film.resting(force, mean_spin, self.bore_radius, self.clearance)

    def _dry(
        self,
        eccentricity: Vector,
        rate: Vector,
        bearing_spin: Scalar | float,
        journal_spin: Scalar | float,
        memory: Memory | None,
    ) -> Contact:
        """Return what pin and bore do to each other where they touch.

        delta' = e'.n, the opposite of (6)'s v_n: with (6) the damping would be negative.
        """
        length = smooth.norm(eccentricity, self.norm_width)
        normal = eccentricity / length
        penetration = length - self.clearance
        penetration_rate = rate.dot(normal)
        normal_force, normal_loss = self.pressed(penetration, penetration_rate, memory)
        touch = Contact(
            penetration=penetration,
            penetration_rate=penetration_rate,
            orbit_speed=normal.cross(rate) / length,
            normal_force=normal_force,
            force=normal_force * normal,
            normal_loss=normal_loss,
        )
        if self.friction is None:
            return touch
        tangent = normal.perp()
        journal_arm = self.bore_radius - length
        centre_speed = -rate.dot(tangent)
        surface_speed = centre_speed + self.bore_radius * bearing_spin - journal_arm * journal_spin
        slip = self.friction.slip.speed(centre_speed, surface_speed)
        friction_force = self.rubbed(normal_force, slip, memory)
        return dataclasses.replace(
            touch,
            force=touch.force + friction_force * tangent,
            friction_force=friction_force,
            friction_loss=-friction_force * surface_speed,
            surface_speed=surface_speed,
            slip_speed=slip,
            bearing_moment=self.bore_radius * friction_force,
            journal_moment=-journal_arm * friction_force,
        )

    @override
    def half_width_ratio(self, penetration: Scalar) -> Scalar:
        """Hertz's half-width over the radius of the bore."""
        radius = self.bore_radius * (self.bore_radius - self.clearance) / self.clearance
        return self.normal.half_width(penetration, radius) / self.bore_radius

"""A guide with a gap: a slider between two straight edges, which its four corners may touch.

The slider is a rectangle of the length L and the height 2 h, its origin in the middle. Along the
slide its sides have a gap c to each edge while it is straight in the middle. Displaced to the
left by x and tilted by p (counterclockwise), its corner (i, j), i = 1 in front and -1
behind, j = 1 on the left and -1 on the right, lies from its origin at

    ahead  i L/2 cos p - j h sin p,        left  i L/2 sin p + j h cos p,

and penetrates the edge by

    delta = j x + i j L/2 sin p - h (1 - cos p) - c.

None, one, two on one side or two across may touch, the four cases of Flores, Ambrosio, Claro and
Lankarani (J. Comput. Nonlinear Dyn. 2008, 3, 011007). Each corner has a contact law of its own,
that of a sphere of the corner's radius on a plane, and friction along the edge. The four forces are
counted at the slider's origin: a force, and a moment about it.

The unknowns are x and y = p L/2, both in m: for small tilts x + y is how far the front end is off,
and x - y how far the rear end. The force to the left does work on x, and the moment over L/2 on y.
"""

import dataclasses
import functools
import itertools
import operator
from typing import cast

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import ArrayLike, Float, PyTree, Scalar
from typing_extensions import override

from jaxcrusher.basics import smooth
from jaxcrusher.basics.plane import Vector, direction, scalar, total
from jaxcrusher.joint.clearance import AbstractGap, Contact, Memory
from jaxcrusher.joint.friction import AbstractFriction
from jaxcrusher.joint.normal import AbstractNormalForce

# Corners of a slider: in front and behind, on the left and on the right.
CORNERS = tuple(itertools.product((1, -1), (1, -1)))
# Keeps the direction of the force on an end, where there is none: a share of the force on both.
_NO_FORCE = 1e-10


class Guide(AbstractGap):
    """Two edges with a gap to the corners of a slider, whose sizes its slide has."""

    clearance: Scalar = eqx.field(converter=scalar)  # c, on either side, m
    corner_radius: Scalar = eqx.field(converter=scalar)  # of a corner, m
    normal: AbstractNormalForce  # of a corner
    friction: AbstractFriction | None
    # Of each corner, where they hold velocities of their own; None: `normal` of all.
    normals: tuple[AbstractNormalForce, ...] | None = None

    @property
    @override
    def bore_radius(self) -> Scalar:
        """Infinite: the edges are straight."""
        return jnp.full_like(self.clearance, jnp.inf)

    def contact(
        self,
        along: Vector,
        sizes: Vector,
        play: Vector,
        rate: Vector,
        speed: Scalar,
        memory: PyTree[Scalar] | None,
    ) -> Contact:
        """Return what the slider does to the frame, counted at its origin.

        `along` is the unit vector ahead on the slide, `sizes` are half of the slider's length and
        of its height (m), `play` and its `rate` are the unknowns x and y (m, m/s), `speed` is that
        ahead (m/s), and `memory` is what the corners remember.
        """
        tilt, tilting = play.y / sizes.x, rate.y / sizes.x
        axis, bulge = direction(tilt), sizes.y * 2 * jnp.sin(tilt / 2) ** 2
        remembered = (None,) * len(CORNERS) if memory is None else memory
        corners, moments = [], []
        for (i, j), own, known in zip(CORNERS, self._alone, remembered, strict=True):
            arm = Vector(i * sizes.x, j * sizes.y).along(axis)
            depth = j * play.x + i * j * sizes.x * axis.y - bulge - self.clearance
            moved = Vector(speed, rate.x) + tilting * arm.perp()
            corner = own._corner(depth, j * moved.y, -moved.x, j, known)
            corners.append(corner)
            moments.append(arm.cross(corner.force))

        def summed(part: str) -> Scalar | None:
            return total(getattr(one, part) for one in corners)

        moment, normal_force, lost = total(moments), summed("normal_force"), summed("normal_loss")
        assert moment is not None and normal_force is not None and lost is not None
        deepest = functools.reduce(_deeper, corners)
        force = functools.reduce(operator.add, (one.force for one in corners))
        rubs = self.friction is not None
        return Contact(
            penetration=deepest.penetration,
            penetration_rate=deepest.penetration_rate,
            orbit_speed=jnp.zeros_like(speed),
            normal_force=normal_force,
            force=force.along(along),
            normal_loss=lost,
            friction_force=summed("friction_force"),
            friction_loss=summed("friction_loss"),
            surface_speed=-speed if rubs else None,
            slip_speed=-speed if rubs else None,
            bearing_moment=moment,
            journal_moment=-moment,
            corners=tuple(corners),
        )

    @property
    def _alone(self) -> "list[Guide]":
        """Return for each corner the guide of which all corners have its law."""
        laws = self.normals or (self.normal,) * len(CORNERS)
        return [dataclasses.replace(self, normal=law, normals=None) for law in laws]

    def _corner(
        self, depth: Scalar, rate: Scalar, slip: Scalar, side: int, memory: Memory | None
    ) -> Contact:
        """Return the contact of a corner with an edge, its force in the axes of the slide."""
        pressed, lost = self.pressed(depth, rate, memory)
        none = jnp.zeros_like(slip)
        if self.friction is None:
            return Contact(depth, rate, none, pressed, Vector(none, side * pressed), lost)
        rubbing = self.rubbed(pressed, slip, memory)
        force = Vector(rubbing, side * pressed)
        return Contact(
            depth, rate, none, pressed, force, lost, rubbing, -rubbing * slip, slip, slip
        )

    @override
    def holding(self, velocities: Float[ArrayLike, "*touches"]) -> "Guide":
        each = jnp.broadcast_to(velocities, len(CORNERS))
        laws = tuple(super(Guide, self).holding(one).normal for one in each)
        return dataclasses.replace(self, normal=laws[0], normals=laws)

    @override
    def half_width_ratio(self, penetration: Scalar) -> Scalar:
        """Hertz's half-width over the radius of a corner."""
        return self.normal.half_width(penetration, self.corner_radius) / self.corner_radius

    @override
    def initial_memory(self) -> PyTree[Scalar] | None:
        one = super().initial_memory()
        return None if one is None else (one,) * len(CORNERS)

    @override
    def memory_rate(self, contact: Contact, memory: PyTree[Scalar] | None) -> PyTree[Scalar] | None:
        if memory is None:
            return None
        pairs = zip(contact.corners, memory, strict=True)
        return tuple(super(Guide, self).memory_rate(corner, one) for corner, one in pairs)

    @override
    def resting(self, force: Vector, mean_spin: Scalar) -> Vector:
        """Return where a slider carries a force to the left and a moment over L/2 (N): x and y, m.

        Each end lies at the edge that its share of the force presses it to. Spins do not matter.
        """
        least = _NO_FORCE * smooth.norm(force, 0.0)

        def off(share: Scalar) -> Scalar:
            size = smooth.norm(Vector(share, least), 0.0)
            return (self.clearance + self.normal.penetration_under(size)) * share / size

        front, rear = off((force.x + force.y) / 2), off((force.x - force.y) / 2)
        return Vector((front + rear) / 2, (front - rear) / 2)

    @override
    def elastic_energy(self, contact: Contact) -> Scalar:
        parts = (self.normal.elastic_energy(one.penetration) for one in contact.corners)
        return cast(Scalar, total(parts))


def _deeper(one: Contact, other: Contact) -> Contact:
    """Return which of two contacts is the deeper one."""
    is_deeper = other.penetration > one.penetration
    return jax.tree.map(lambda a, b: jnp.where(is_deeper, b, a), one, other)

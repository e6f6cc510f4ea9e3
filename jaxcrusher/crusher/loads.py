"""Crushing loads on the jaw; the reaction of each acts on the fixed jaw along the same line.

A load is a function of the shaft's angle, and of pose and velocity of the jaw. It gives the force
and where it acts on the line A-B.

The bed of rock of a chamber is pressed in every stroke. Its pressure at a depth is a power law of
the compression ratio, the stroke over the width of the bed. Evertsson (Cone Crusher Performance,
Chalmers 2000) measured the pressure of beds over this ratio; the power law is a simplification.
The stroke at a depth is counted from where the jaw of the ideal linkage is furthest away there.
While a depth opens, the rock falls and does not press. The law has no sizes of rock, no breakage
and no rock that leaves; the bed is the same in every stroke. Its modulus is to be fitted to a
measured force or power.
"""

import abc
from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Scalar
from typing_extensions import override

from jaxcrusher.basics import smooth
from jaxcrusher.basics.checks import nan_unless, primal, require
from jaxcrusher.basics.periodic_spline import PeriodicSeries, PeriodicSpline
from jaxcrusher.basics.plane import Arm, Vector, direction, optional_scalar, scalar
from jaxcrusher.basics.record import Record
from jaxcrusher.crusher.capacity import ANGLES, stationary
from jaxcrusher.crusher.machine import lengths_of
from jaxcrusher.mechanism.acting import AbstractPush
from jaxcrusher.mechanism.linkage import Linkage, Point
from jaxcrusher.mechanism.motion import Motion, ideal_at_rest

# Angles of a turn at which the closing stroke's ends are looked for.
_ANGLES = 720


class JawMotion(Record):
    """The jaw's motion at an instant, in the frame's axes; only what a load uses is computed.

    A point of the jaw is given by its distance (m) from A towards B; None is the mass centre S2.
    """

    motion: Motion

    @property
    def angle(self) -> Scalar:
        """Return the shaft's angle theta1, from -pi to pi; 0 where A lies to the right of O."""
        crank = self.motion.axis("shaft")
        return jnp.arctan2(crank.y, crank.x)

    @property
    def axis(self) -> Vector:
        """Return the unit vector along B-A."""
        return self.motion.axis("jaw")

    @property
    def away(self) -> Vector:
        """Return the unit vector across the jaw, away from the fixed jaw, to the toggle's side."""
        (side,) = self.motion.linkage.sides
        left = self.axis.perp()
        return left if side < 0 else -left

    @property
    def spin(self) -> Scalar:
        """Return the angular velocity of the jaw, counterclockwise, rad/s."""
        spin = self.motion.spin("jaw")
        assert spin is not None
        return spin

    def point(self, along: Scalar | float | None = None) -> Point:
        """Return a point of the jaw."""
        if along is None:
            return self.motion.linkage.centre("jaw")
        return Point("jaw", Arm(-along))

    def position(self, along: Scalar | float | None = None) -> Vector:
        """Return a point of the jaw, m; C is the origin."""
        return self.motion.position(self.point(along))

    def velocity(self, along: Scalar | float | None = None) -> Vector:
        """Return the velocity of a point of the jaw, m/s."""
        return self.motion.velocity(self.point(along))


class JawForce(Record):
    """A force on the jaw, and how far from A towards B its line meets the jaw's axis."""

    force: Vector  # N
    along: Scalar | None = eqx.field(converter=optional_scalar, default=None)  # m; None: at S2


class AbstractLoad(AbstractPush):
    """A force on the jaw."""

    @abc.abstractmethod
    def force(self, jaw: JawMotion) -> JawForce:
        """Return the force (N) on the jaw in this motion, and where it acts."""

    @property
    @override
    def body(self) -> str:
        return "jaw"

    @override
    def action(self, motion: Motion) -> tuple[Point, Vector]:
        jaw = JawMotion(motion)
        load = self.force(jaw)
        return jaw.point(load.along), load.force


def along_jaw(jaw: JawMotion) -> Vector:
    """Return the direction from A to B."""
    return -jaw.axis


def normal_to_jaw(jaw: JawMotion) -> Vector:
    """Return the direction across the jaw, away from the fixed jaw."""
    return jaw.away


class AbstractConstantLoad(AbstractLoad):
    """A force of one size."""

    magnitude: Scalar = eqx.field(converter=scalar)  # N
    along: Scalar | None = eqx.field(converter=optional_scalar, default=None)  # m; None: at S2


class AlongJaw(AbstractConstantLoad):
    """Constant, along the jaw towards B: (18) of the paper, taken literally."""

    @override
    def force(self, jaw: JawMotion) -> JawForce:
        return JawForce(self.magnitude * along_jaw(jaw), self.along)


class NormalToJaw(AbstractConstantLoad):
    """Constant, normal to the jaw's face, away from the fixed jaw."""

    @override
    def force(self, jaw: JawMotion) -> JawForce:
        return JawForce(self.magnitude * normal_to_jaw(jaw), self.along)


class ClosingStroke(AbstractConstantLoad):
    """Normal to the jaw's face, only while its point moves towards the fixed jaw.

    The switch at rest is smoothed over `width` (m/s) of the closing speed.
    """

    width: Scalar = eqx.field(converter=scalar, default=0.01)  # m/s

    @override
    def force(self, jaw: JawMotion) -> JawForce:
        closing = smooth.step(-jaw.velocity(self.along).dot(jaw.away), self.width)
        return JawForce(self.magnitude * closing * jaw.away, self.along)


class HalfSineStroke(AbstractConstantLoad):
    """Normal to the jaw's face over the closing stroke, with edges of half a sine.

    F (1 - cos(pi x)) / 2 rises and falls over the angle `edge`, x from 0 to 1. The stroke's
    `middle` and `span` (rad, of theta1) are those of ideal joints: see `closing_stroke_of`.
    """

    middle: Scalar = eqx.field(converter=scalar, default=0.0)
    span: Scalar = eqx.field(converter=scalar, default=jnp.pi)
    edge: Scalar = eqx.field(converter=scalar, default=0.2)

    @override
    def force(self, jaw: JawMotion) -> JawForce:
        crank, middle = jaw.motion.axis("shaft"), direction(self.middle)
        away = jnp.abs(jnp.arctan2(middle.cross(crank), middle.dot(crank)))
        inside = jnp.clip((self.span / 2 - away) / self.edge, 0.0, 1.0)
        size = self.magnitude * (1 - jnp.cos(jnp.pi * inside)) / 2
        return JawForce(size * jaw.away, self.along)


@jax.jit  # its operations one by one would take seconds
def closing_stroke_of(linkage: Linkage, along: Scalar | float | None) -> tuple[Scalar, Scalar]:
    """Return middle and span (rad) of the angles theta1 over which a point of the jaw closes.

    `along` as in `JawForce`; the joints are ideal. Angles are exact to some 1e-5 rad. The span of a
    point that does not close just once in a turn is NaN.
    """
    step = 2 * jnp.pi / _ANGLES
    angles = step * jnp.arange(_ANGLES, dtype=float)

    def closing(angle: Scalar) -> Scalar:
        def point(at: Scalar) -> Vector:
            return _ideal(linkage, at).position(along)

        moved = jax.jvp(point, (angle,), (jnp.ones_like(angle),))[1]
        return -moved.dot(_ideal(linkage, angle).away)

    now = jax.vmap(closing)(angles)
    then = jnp.roll(now, -1)

    def change(at: Array) -> Scalar:
        index = jnp.argmax(at)
        return angles[index] + step * now[index] / (now[index] - then[index])

    begins = (now <= 0) & (then > 0)
    begin, end = change(begins), change((now > 0) & (then <= 0))
    span = nan_unless(jnp.sum(begins) == 1, jnp.mod(end - begin, 2 * jnp.pi))
    return begin + span / 2, span


class ByAngle(AbstractLoad):
    """A curve over the shaft's angle, as loads are measured and published, times a factor."""

    curve: PeriodicSpline | PeriodicSeries  # N, of rad
    direction: Callable[[JawMotion], Vector] = eqx.field(static=True)
    factor: Scalar = eqx.field(converter=scalar, default=1.0)
    along: Scalar | None = eqx.field(converter=optional_scalar, default=None)  # m; None: at S2

    @override
    def force(self, jaw: JawMotion) -> JawForce:
        size = self.factor * self.curve(jaw.angle)
        return JawForce(size * self.direction(jaw), self.along)


# Gauss's points over the height of the chamber. Depths stop one after the other while the rest
# closes: with half as many the peak of |R_O| + |R_C| is off by 2.5 %, with these by 0.1 %.
_PLACES, _WEIGHTS = np.polynomial.legendre.leggauss(16)
# Corner of the compression ratio where the bed begins to press.
_CORNER = 1e-5
# A force (N) that places the resultant in the middle of the chamber where nothing presses.
_NOTHING = 1e-6


class CrushingBed(AbstractLoad):
    """Pressure p = E (u / b)^n on the jaw's face while u grows, normal to it."""

    along: Float[Array, " depths"]  # from A towards B, m
    areas: Float[Array, " depths"]  # of the face that each depth stands for, m2
    widths: Float[Array, " depths"]  # b, of the bed when it is not pressed, m
    open: Float[Array, " depths"]  # where the face is furthest from the fixed jaw, m
    towards: Vector  # the direction in which the bed is pressed
    modulus: Scalar = eqx.field(converter=scalar)  # E, Pa
    exponent: Scalar = eqx.field(converter=scalar)  # n
    closing: Scalar = eqx.field(converter=scalar, default=0.01)  # smooths the switch, m/s

    @override
    def force(self, jaw: JawMotion) -> JawForce:
        compression = _reach(jaw, self.along, self.towards) - self.open
        speed = _speed(jaw, self.along, self.towards)
        pressure = smooth.positive_power(compression / self.widths, _CORNER, self.exponent)
        pressed = self.modulus * self.areas * pressure * smooth.step(speed, self.closing)
        total, middle = jnp.sum(pressed), jnp.mean(self.along)
        place = jnp.sum(pressed * (self.along - middle)) / (total + _NOTHING)
        return JawForce(total * jaw.away, middle + place)


def crushing_bed(
    linkage: Linkage, length, height, discharge, nip_angle, modulus, exponent
) -> CrushingBed:
    """Return the bed between the jaws of a machine.

    The chamber reaches `height` (m) up from B and is `length` (m) long. The bed is `discharge` (m)
    wide at B and wider upwards by the tangent of `nip_angle` (rad). Raises ValueError for a bed
    that the jaw would press to zero width; if only `jax.jit` knows such a bed, it is NaN.
    """
    half, jaw_length = height / 2, lengths_of(linkage)["jaw.length"]
    along = jaw_length - half * (1 - _PLACES)
    widths = discharge + (jaw_length - along) * jnp.tan(nip_angle)
    towards = -_ideal(linkage, jnp.zeros(())).away

    def reach(angle: Scalar, at: Array, linkage: Linkage, towards: Vector) -> Array:
        return _reach(_ideal(linkage, angle), at, towards)

    angles = jnp.linspace(0, 2 * jnp.pi, ANGLES, endpoint=False)
    held = jax.lax.stop_gradient((along, linkage, towards))
    seen = jax.vmap(lambda angle: reach(angle, *held))(angles)
    near = angles[jnp.argmin(seen, axis=0)]
    furthest = jax.vmap(lambda angle, at: stationary(reach, angle, at, linkage, towards))(
        near, along
    )
    at_rest = jax.vmap(reach, (0, 0, None, None))(furthest, along, linkage, towards)
    left = widths - (jnp.max(seen, axis=0) - at_rest)
    known, opening = primal(left), primal(discharge)
    if known is None or opening is None:
        widths = nan_unless(jnp.all(left > 0), widths)
    else:
        must = "be wider than the jaw presses the bed at each depth"
        require(bool(np.all(known > 0)), "chamber.discharge", must, f"{1e3 * opening:g} mm")
    areas = length * half * jnp.asarray(_WEIGHTS)
    return CrushingBed(along, areas, widths, at_rest, towards, modulus, exponent)


def _ideal(linkage: Linkage, angle: Scalar) -> JawMotion:
    """Return the jaw at an angle of the shaft (rad), ideal joints at rest."""
    return JawMotion(ideal_at_rest(linkage, angle))


def _reach(jaw: JawMotion, along: Array, towards: Vector) -> Array:
    """Return how far points of the jaw have come towards the fixed jaw, m."""
    return jaw.position(0.0).dot(towards) - along * jaw.axis.dot(towards)


def _speed(jaw: JawMotion, along: Array, towards: Vector) -> Array:
    """Return how fast points of the jaw come towards the fixed jaw, m/s."""
    return jaw.velocity(0.0).dot(towards) - along * jaw.spin * jaw.axis.perp().dot(towards)

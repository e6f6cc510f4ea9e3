"""A load from the chamber: a bed of rock that the jaw presses in every stroke.

The pressure at a depth is a power law of the compression ratio, stroke over width of the bed, which
is what Evertsson (Cone Crusher Performance, Chalmers 2000) measured pressures of beds over; the
power itself is a simplification. The stroke of a depth is counted from where the ideal linkage is
furthest away there. While a depth opens, the rock falls and does not press.

The law knows neither sizes of rock nor breakage, no rock that leaves, and the same bed in every
stroke. Its modulus is to be fitted to a measured force or power.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Scalar

from jaxcrusher.basics import smooth
from jaxcrusher.basics.plane import Vector, scalar
from jaxcrusher.crusher.capacity import ANGLES, stationary
from jaxcrusher.crusher.loads import AbstractLoad, JawForce, JawMotion
from jaxcrusher.crusher.machine import Machine
from jaxcrusher.mechanism.motion import ideal_at_rest

# Gauss's points over the height of the chamber: the mean of the resultant is right to 1e-4.
_PLACES, _WEIGHTS = np.polynomial.legendre.leggauss(8)
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

    def force(self, jaw: JawMotion) -> JawForce:
        """The resultant of the depths, and its place."""
        compression = _reach(jaw, self.along, self.towards) - self.open
        speed = _speed(jaw, self.along, self.towards)
        pressure = smooth.positive_power(compression / self.widths, _CORNER, self.exponent)
        pressed = self.modulus * self.areas * pressure * smooth.step(speed, self.closing)
        total, middle = jnp.sum(pressed), jnp.mean(self.along)
        place = jnp.sum(pressed * (self.along - middle)) / (total + _NOTHING)
        return JawForce(total * jaw.away, middle + place)


def crushing_bed(
    machine: Machine, length, height, discharge, nip_angle, modulus, exponent
) -> CrushingBed:
    """Return the bed between the jaws of a machine.

    The chamber reaches `height` (m) up from B and is `length` (m) long. The bed is `discharge` (m)
    wide at B and wider upwards by the tangent of `nip_angle` (rad).
    """
    half = height / 2
    along = machine.jaw.length - half * (1 - _PLACES)
    widths = discharge + (machine.jaw.length - along) * jnp.tan(nip_angle)
    towards = -_ideal(machine, jnp.zeros(())).away

    def reach(angle: Scalar, at: Array, machine: Machine, towards: Vector) -> Array:
        return _reach(_ideal(machine, angle), at, towards)

    angles = jnp.linspace(0, 2 * jnp.pi, ANGLES, endpoint=False)
    held = jax.lax.stop_gradient((along, machine, towards))
    near = angles[jnp.argmin(jax.vmap(lambda angle: reach(angle, *held))(angles), axis=0)]
    furthest = jax.vmap(lambda angle, at: stationary(reach, angle, at, machine, towards))(
        near, along
    )
    at_rest = jax.vmap(reach, (0, 0, None, None))(furthest, along, machine, towards)
    areas = length * half * jnp.asarray(_WEIGHTS)
    return CrushingBed(along, areas, widths, at_rest, towards, modulus, exponent)


def _ideal(machine: Machine, angle: Scalar) -> JawMotion:
    """Return the jaw at an angle of the shaft (rad), ideal joints at rest."""
    return JawMotion(ideal_at_rest(machine.linkage, angle))


def _reach(jaw: JawMotion, along: Array, towards: Vector) -> Array:
    """Return how far points of the jaw have come towards the fixed jaw, m."""
    return jaw.position(0.0).dot(towards) - along * jaw.axis.dot(towards)


def _speed(jaw: JawMotion, along: Array, towards: Vector) -> Array:
    """Return how fast points of the jaw come towards the fixed jaw, m/s."""
    return jaw.velocity(0.0).dot(towards) - along * jaw.spin * jaw.axis.perp().dot(towards)

"""The tension rod, which pulls the jaw back onto its toggle and the toggle into its seats.

It is no crushing load: its other end pulls at the frame, and not at the fixed jaw.
"""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Scalar

from jaxcrusher.basics import smooth
from jaxcrusher.basics.plane import Vector, scalar
from jaxcrusher.crusher.loads import JawMotion
from jaxcrusher.crusher.machine import Machine
from jaxcrusher.mechanism.linkage import Point
from jaxcrusher.mechanism.motion import ideal_at_rest


class RodPull(eqx.Module):
    """What the tension rod does to the jaw; its other end pulls at the frame by the opposite."""

    force: Vector  # on the jaw, N
    tension: Scalar  # N
    wanted: Scalar  # N, negative where the rod is slack
    stretch: Scalar  # L - L0, m
    rate: Scalar  # m/s
    rod: "Rod"

    def elastic_energy(self) -> Scalar:
        """Return the work of the spring since the length L0, J."""
        rod = self.rod
        pulled = rod.preload + rod.stiffness * self.stretch
        stored = self._integral(pulled) - self._integral(rod.preload)
        elastic = rod.stiffness > 0
        work = stored / jnp.where(elastic, rod.stiffness, 1.0)
        constant = smooth.positive_part(rod.preload, rod.width) * self.stretch
        return jnp.where(elastic, work, constant)

    def loss(self) -> Scalar:
        """Return the power that the damper takes, W; not negative."""
        spring = self.rod.preload + self.rod.stiffness * self.stretch
        return (self.tension - smooth.positive_part(spring, self.rod.width)) * self.rate

    def _integral(self, wanted: Scalar) -> Scalar:
        return smooth.positive_power_integral(wanted, self.rod.width, 1.0)


class Rod(eqx.Module):
    """A rod with a spring and a damper, which pulls and never pushes.

    Tension = preload + stiffness (L - L0) + damping L', where that is positive. Where it would be
    negative the rod is slack; the corner is off by `width` / 4 at most.
    """

    stiffness: Scalar = eqx.field(converter=scalar)  # N/m
    preload: Scalar = eqx.field(converter=scalar)  # N
    damping: Scalar = eqx.field(converter=scalar)  # N s/m
    along: Scalar = eqx.field(converter=scalar)  # its end on the jaw, from A towards B, m
    across: Scalar = eqx.field(converter=scalar)  # and from there towards the fixed jaw, m
    on_frame: Vector  # its end on the frame, m
    length: Scalar = eqx.field(converter=scalar)  # L0, m
    width: Scalar = eqx.field(converter=scalar, default=1.0)  # N

    def end(self, jaw: JawMotion) -> Point:
        """Return the point of the jaw that the rod pulls at."""
        return jaw.point(self.along, self.across)

    def pull(self, jaw: JawMotion) -> RodPull:
        """Return what the rod does to a jaw that moves so."""
        end = self.end(jaw)
        apart = jaw.motion.position(end) - self.on_frame
        length = smooth.norm(apart, 0.0)
        axis = apart / length
        velocity = jaw.motion.velocity(end)
        stretch, rate = length - self.length, velocity.dot(axis)
        wanted = self.preload + self.stiffness * stretch + self.damping * rate
        tension = smooth.positive_part(wanted, self.width)
        return RodPull(-tension * axis, tension, wanted, stretch, rate, self)


def rod_at(machine: Machine, stiffness, preload, damping, on_jaw: Vector, on_frame: Vector) -> Rod:
    """Return a rod on a machine: its L0 is the length at theta1 = 0 with ideal joints.

    `on_jaw` is its end from A towards B and across to the fixed jaw, m; `on_frame` the other, m.
    """
    jaw = JawMotion(ideal_at_rest(machine.linkage, 0.0))
    end = jaw.motion.position(jaw.point(on_jaw.x, on_jaw.y))
    length = smooth.norm(end - on_frame, 0.0)
    return Rod(stiffness, preload, damping, on_jaw.x, on_jaw.y, on_frame, length)

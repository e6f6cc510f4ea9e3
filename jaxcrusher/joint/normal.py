"""Normal contact laws of the clearance joint: elastic force with hysteresis damping."""

import abc
from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Scalar
from typing_extensions import override

from jaxcrusher.basics import smooth
from jaxcrusher.basics.plane import scalar
from jaxcrusher.basics.record import Printed

# e* of a free impact by powers of the damping factor, highest first: the equation of
# `AbstractNormalLaw.delivered_restitution` solved power by power.
_REBOUND = np.array([-40 / 189, 104 / 405, -44 / 135, 4 / 9, -2 / 3, 1])

# Of spheres in contact: F is as the penetration to this power.
HERTZ = 1.5
# Where a force that has no corner of its own counts as touching, m.
TOUCH = 1e-8


def inverse(function: Callable[[Scalar], Scalar], value: Scalar, guess: Scalar) -> Scalar:
    """Return where a function near a power law is `value` (> 0), by Newton in logarithms."""
    for _ in range(6):
        found, slope = jax.jvp(function, (guess,), (jnp.ones_like(guess),))
        guess = guess * (value / found) ** (found / (guess * slope))
    return guess


def cylinder_stiffness(bore_radius, clearance, young=207e9, poisson=0.29) -> Scalar:
    """K = 4 / (3 (h_i + h_j)) sqrt(R_i R_j / (R_i - R_j)), in N/m^1.5 (paper, (9)-(10)).

    Lengths in m, `young` in Pa, both surfaces of the same material. The formula is that
    of a sphere in a spherical bore, used by the paper for a line contact.
    """
    return sphere_stiffness(bore_radius * (bore_radius - clearance) / clearance, young, poisson)


def sphere_stiffness(radius, young=207e9, poisson=0.29) -> Scalar:
    """K = 4 / (3 (h_i + h_j)) sqrt(R) of a sphere on a plane, in N/m^1.5: Hertz.

    Length in m, `young` in Pa, both surfaces of the same material.
    """
    compliance = 2 * (1 - poisson**2) / young
    return 4 / (3 * compliance) * jnp.sqrt(radius)


class AbstractImpactVelocity(Printed):
    """The impact velocity that a dissipative law divides by.

    `memory` is what it must remember along the motion: a scalar (m/s), or None.
    """

    @abc.abstractmethod
    def initial(self) -> Scalar | None:
        """The memory at the start."""

    @abc.abstractmethod
    def value(self, memory: Scalar | None) -> Scalar:
        """The impact velocity, m/s, > 0."""

    @abc.abstractmethod
    def rate(
        self, memory: Scalar | None, in_contact: Scalar, penetration: Scalar, approach: Scalar
    ) -> Scalar | None:
        """The time derivative of the memory, for a pin that approaches at `approach` m/s.

        A pin in flight has a gap: its `penetration` (m) is negative. `in_contact` is 1 in contact,
        0 in flight, and smooth between.
        """


class ConstantImpactVelocity(AbstractImpactVelocity):
    """The same for every impact: the paper takes 0.5 m/s (Table 2)."""

    speed: Scalar = eqx.field(converter=scalar)  # m/s

    @override
    def initial(self) -> None:
        return None

    @override
    def value(self, memory: Scalar | None) -> Scalar:
        return self.speed

    @override
    def rate(self, memory: None, in_contact: Scalar, penetration: Scalar, approach: Scalar) -> None:
        return None


class TrackedImpactVelocity(AbstractImpactVelocity):
    """The approach speed at the last touch-down, not below a floor.

    While a pin approaches its bore the memory u follows the approach speed v as the gap g closes:
    u' = (v - u) v / (b (g + w)), so that du/dg = (u - v) / (b (g + w)) does not depend on time.
    After a gap G, u at touch-down is v but for (w / G)^(1/b) of its earlier value, and but for
    b w a / v^2 of v under an acceleration a: 2e-4 for an impact of 0.01 m/s under gravity, 1e-5 for
    one of 2 m/s under 20 000 m/s2. While pin and bore part, and in contact, u is constant. Below a
    floor of 0.03 m/s the slowest contacts may pull (F_n < 0) for a moment.
    """

    floor: Scalar = eqx.field(converter=scalar, default=0.01)  # m/s
    lag: Scalar = eqx.field(converter=scalar, default=0.25)  # b, a share of the gap
    least_gap: Scalar = eqx.field(converter=scalar, default=1e-8)  # w, m

    @override
    def initial(self) -> Scalar:
        return self.floor

    @override
    def value(self, memory: Scalar) -> Scalar:
        return jnp.maximum(memory, self.floor)

    @override
    def rate(
        self, memory: Scalar, in_contact: Scalar, penetration: Scalar, approach: Scalar
    ) -> Scalar:
        gap = jnp.maximum(-penetration, 0) + self.least_gap
        closing = (1 - in_contact) * jnp.maximum(approach, 0)
        return (approach - memory) * closing / (self.lag * gap)


class AbstractNormalForce(Printed):
    """A normal force by penetration and its rate; positive where it pushes the surfaces apart."""

    impact_velocity: eqx.AbstractVar[AbstractImpactVelocity]

    @abc.abstractmethod
    def force(self, penetration: Scalar, rate: Scalar, memory: Scalar | None) -> Scalar:
        """F_n (N) at a penetration (m) and its rate (m/s), with the impact velocity's memory."""

    @abc.abstractmethod
    def elastic_force(self, penetration: Scalar) -> Scalar:
        """The part of the force that is there at rest, N."""

    @abc.abstractmethod
    def elastic_energy(self, penetration: Scalar) -> Scalar:
        """The work of the elastic part, J."""

    @abc.abstractmethod
    def penetration_under(self, force: Scalar) -> Scalar:
        """The penetration (m) at which the elastic part is `force` (N, > 0) at rest."""

    def asked_restitution(self) -> Scalar | None:
        """The coefficient of restitution that the law was made for; None: for none."""
        return None

    def delivered_restitution(self, speed: Scalar) -> Scalar | None:
        """Rebound over impact speed of a free impact at `speed` (m/s); None where it is unknown."""
        return None

    def in_contact(self, penetration: Scalar) -> Scalar:
        """1 in contact, 0 in flight, smooth between."""
        return smooth.step(penetration, TOUCH)

    def half_width(self, penetration: Scalar, radius: Scalar) -> Scalar:
        """Hertz's half-width of the contact, sqrt(R delta), m, of a sphere of radius R (m)."""
        return jnp.sqrt(radius * jnp.maximum(penetration, 0))


class AbstractHysteresis(AbstractNormalForce):
    """F_n = F_e(delta) (1 + D delta' / v): any spring with hysteresis damping.

    delta (m) is the penetration, delta' (m/s) its rate, v (m/s) the impact velocity, and D
    the law's damping factor. F_n is positive when it pushes the surfaces apart. Valid while
    D delta'/v > -1; beyond it the published law pulls.
    """

    restitution: eqx.AbstractVar[Scalar]
    width: eqx.AbstractVar[Scalar]  # of the corner at delta = 0, m

    @abc.abstractmethod
    def damping_factor(self) -> Scalar:
        """D, from the coefficient of restitution."""

    @override
    def force(self, penetration: Scalar, rate: Scalar, memory: Scalar | None) -> Scalar:
        damping = self.damping_factor() * rate / self.impact_velocity.value(memory)
        return self.elastic_force(penetration) * (1 + damping)

    @override
    def asked_restitution(self) -> Scalar:
        return self.restitution

    @override
    def delivered_restitution(self, speed: Scalar) -> Scalar:
        """Rebound over impact speed e* of a free impact at `speed` (m/s).

        D - ln(1 + D) = -D e* - ln(1 - D e*), for any stiffness, mass and exponent, with D times
        the ratio of `speed` to the law's impact velocity. With u = -ln(1 - D e*) that is
        u + exp(-u) - 1 = D - ln(1 + D), which Newton solves to rounding in four steps. Below
        D = 0.01, where the logarithms cancel, the series of e* in D is used. Errors are below
        1e-11, those of derivatives, by Newton's last step, below 1e-9.
        """
        factor = self.damping_factor() * speed / self.impact_velocity.value(speed)
        small = factor < 1e-2
        # No derivative of the branch not taken may be infinite.
        apart = jnp.where(small, 1.0, factor)
        spent = apart - jnp.log1p(apart)
        u = jnp.sqrt(2 * spent) + spent / 3
        for _ in range(4):
            u = u - (u + jnp.expm1(-u) - spent) / -jnp.expm1(-u)
        return jnp.where(small, jnp.polyval(_REBOUND, factor), -jnp.expm1(-u) / apart)

    @override
    def in_contact(self, penetration: Scalar) -> Scalar:
        return smooth.step(penetration, self.width)


class AbstractNormalLaw(AbstractHysteresis):
    """F_e = K delta^1.5: Hertz's spring, its corner smoothed over `width`."""

    stiffness: eqx.AbstractVar[Scalar]  # K, N/m^1.5

    @override
    def elastic_force(self, penetration: Scalar) -> Scalar:
        return self.stiffness * smooth.positive_power(penetration, self.width, HERTZ)

    @override
    def elastic_energy(self, penetration: Scalar) -> Scalar:
        return self.stiffness * smooth.positive_power_integral(penetration, self.width, HERTZ)

    @override
    def penetration_under(self, force: Scalar) -> Scalar:
        return (force / self.stiffness) ** (1 / HERTZ)


class AbstractPublishedLaw(AbstractNormalLaw):
    """A law of the literature, whose damping factor depends on the restitution alone."""

    stiffness: Scalar = eqx.field(converter=scalar)  # K, N/m^1.5
    restitution: Scalar = eqx.field(converter=scalar)  # e
    impact_velocity: AbstractImpactVelocity
    width: Scalar = eqx.field(converter=scalar, default=1e-8)  # m


class LankaraniNikravesh(AbstractPublishedLaw):
    """D = 3 (1 - e^2) / 4: Lankarani and Nikravesh 1990 (paper, (8)).

    Derived for e near 1: asked for e = 0.9 it delivers 0.9132, for 0.5 it delivers 0.725.
    """

    @override
    def damping_factor(self) -> Scalar:
        return 3 * (1 - self.restitution**2) / 4


class HuntCrossley(AbstractPublishedLaw):
    """D = 3 (1 - e) / 2: Hunt and Crossley 1975. Asked for 0.9 it delivers 0.9090."""

    @override
    def damping_factor(self) -> Scalar:
        return 3 * (1 - self.restitution) / 2


class Flores(AbstractPublishedLaw):
    """D = 8 (1 - e) / (5 e): Flores and co-workers 2011, for e from 0 to 1."""

    @override
    def damping_factor(self) -> Scalar:
        return 8 * (1 - self.restitution) / (5 * self.restitution)


class Gonthier(AbstractPublishedLaw):
    """D = (1 - e^2) / e: Gonthier and co-workers 2004.

    It is near the root D of (1 + D) / (1 - D e) = exp(D (1 + e)), which delivers e itself: the
    closed form of `delivered_restitution`. Asked for 0.9 it delivers 0.8764.
    """

    @override
    def damping_factor(self) -> Scalar:
        return (1 - self.restitution**2) / self.restitution


class ZhiyingQishao(AbstractPublishedLaw):
    """D = 3 (1 - e^2) exp(2 (1 - e)) / 4: Zhiying and Qishao 2006.

    It is Lankarani and Nikravesh's law with a factor for lower e. Asked for 0.9 it delivers 0.8959.
    """

    @override
    def damping_factor(self) -> Scalar:
        return 3 * (1 - self.restitution**2) * jnp.exp(2 * (1 - self.restitution)) / 4


class HuGuo(AbstractPublishedLaw):
    """D = 3 (1 - e) / (2 e): Hu and Guo 2015. Asked for 0.9 it delivers 0.8999."""

    @override
    def damping_factor(self) -> Scalar:
        return 3 * (1 - self.restitution) / (2 * self.restitution)

"""Line contacts of a pin in a bore, damped as Lankarani and Nikravesh do.

The paper's K is that of a sphere in a spherical bore. For cylinders of the length L, radial
clearance c and 1 / E = 2 (1 - nu^2) / Young, with x = F / (pi E L), these are published; the
overview by Pereira, Ramalho and Ambrosio (Nonlinear Dyn. 2011, 63, 681) compares them:

    Johnson 1985      delta = x (ln(4 c / x) - 1)
    ESDU 78035        delta = x (ln(4 c / x) + 1)
    Liu et al. 2007   x = (delta / 2) sqrt(delta / (2 (c + delta)))

All hold while the contact is narrow against the bore; by finite elements, Liu's in wider ones too.
"""

import abc

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Scalar
from typing_extensions import override

from jaxcrusher.basics import smooth
from jaxcrusher.basics.plane import scalar
from jaxcrusher.joint.normal import AbstractHysteresis, AbstractImpactVelocity, inverse

# The logarithmic laws go on along their tangent beyond ln(4 c / x) = 4, where the contact's
# half-width is 0.54 bore radii and so outside of Hertz's theory.
_LAST = 4.0
# Below this penetration (m) they are proportional to it.
_LEAST = 1e-14
# Of Newton's method, which starts within 0.4 of the root and then squares the error.
_STEPS = 5

_METRE = {"unit": "m"}


class AbstractCylinders(AbstractHysteresis):
    """F = pi E L x(delta) (1 + D delta' / v), D = 3 (1 - e^2) / 4.

    The corner at delta = 0 is smoothed over `width` (m). The length is judged: as long as the
    chamber of the PE250x400 is wide.
    """

    restitution: Scalar = eqx.field(converter=scalar)
    impact_velocity: AbstractImpactVelocity
    clearance: Scalar = eqx.field(converter=scalar, metadata=_METRE)  # c
    modulus: Scalar = eqx.field(converter=scalar, metadata={"unit": "Pa"})  # E
    length: Scalar = eqx.field(converter=scalar, default=0.4, metadata=_METRE)  # L
    width: Scalar = eqx.field(converter=scalar, default=1e-8, metadata=_METRE)

    @abc.abstractmethod
    def load(self, depth: Scalar) -> Scalar:
        """Return x, m, of a penetration >= 0."""

    @abc.abstractmethod
    def work(self, depth: Scalar) -> Scalar:
        """Return the integral of x from 0 to a penetration >= 0, m2."""

    @override
    def damping_factor(self) -> Scalar:
        return 3 * (1 - self.restitution**2) / 4

    def _per_load(self) -> Scalar:
        return np.pi * self.modulus * self.length

    @override
    def elastic_force(self, penetration: Scalar) -> Scalar:
        """Return the slope of the elastic energy, N."""
        deep = smooth.positive_part(penetration, self.width)
        corner = jnp.clip((penetration + self.width) / (2 * self.width), 0, 1)
        return self._per_load() * self.load(deep) * corner

    @override
    def elastic_energy(self, penetration: Scalar) -> Scalar:
        return self._per_load() * self.work(smooth.positive_part(penetration, self.width))

    @override
    def penetration_under(self, force: Scalar) -> Scalar:
        return self.depth(force / self._per_load())

    @abc.abstractmethod
    def depth(self, x: Scalar) -> Scalar:
        """Return the penetration (m) under a load x (m, > 0)."""

    @override
    def half_width(self, penetration: Scalar, radius: Scalar) -> Scalar:
        """Hertz's half-width of a line contact, sqrt(4 x R), m."""
        return jnp.sqrt(4 * radius * self.load(jnp.maximum(penetration, 0)))


class AbstractLogarithmic(AbstractCylinders):
    """delta = x (ln(4 c / x) + k)."""

    constant: eqx.AbstractClassVar[float]  # k  # pyright: ignore

    def _last(self) -> tuple[Scalar, Scalar, float]:
        """Return load, penetration and d delta / dx where the tangent begins."""
        x = 4 * self.clearance * np.exp(-_LAST)
        return x, x * (_LAST + self.constant), _LAST + self.constant - 1

    @override
    def depth(self, x: Scalar) -> Scalar:
        last, deepest, slope = self._last()
        within = jnp.minimum(x, last)
        depth_within = within * (jnp.log(4 * self.clearance / within) + self.constant)
        return jnp.where(x < last, depth_within, deepest + (x - last) * slope)

    @override
    def load(self, depth: Scalar) -> Scalar:
        last, deepest, slope = self._last()
        within = jnp.clip(depth, _LEAST, deepest)
        x = within / (jnp.log(4 * self.clearance / within) + self.constant)
        for _ in range(_STEPS):
            ratio = jnp.log(4 * self.clearance / x) + self.constant
            x = x - (x * ratio - within) / (ratio - 1)
        shallow = x * jnp.minimum(depth / _LEAST, 1)
        return jnp.where(depth < deepest, shallow, last + (depth - deepest) / slope)

    @override
    def work(self, depth: Scalar) -> Scalar:
        last, deepest, slope = self._last()

        def within(x: Scalar) -> Scalar:
            safe = jnp.maximum(x, _LEAST**2)
            return x**2 * ((jnp.log(4 * self.clearance / safe) + self.constant) / 2 - 0.25)

        beyond = jnp.maximum(depth - deepest, 0)
        return within(jnp.minimum(self.load(depth), last)) + beyond * (last + beyond / (2 * slope))


class Johnson(AbstractLogarithmic):
    """delta = x (ln(4 c / x) - 1): Johnson, Contact Mechanics, 1985."""

    constant = -1.0


class Esdu(AbstractLogarithmic):
    """delta = x (ln(4 c / x) + 1): ESDU 78035, 1978."""

    constant = 1.0


class Liu(AbstractCylinders):
    """x = (delta / 2) sqrt(delta / (2 (c + delta))): Liu, Zhang and Yang 2007."""

    @override
    def load(self, depth: Scalar) -> Scalar:
        return self._power(depth, 1.5) / jnp.sqrt(8 * (self.clearance + depth))

    @override
    def work(self, depth: Scalar) -> Scalar:
        c = self.clearance
        root = self._power(depth, 0.5)
        algebraic = root * jnp.sqrt(c + depth) * (depth / 2 - 3 * c / 4)
        return (algebraic + 3 * c**2 / 4 * jnp.arcsinh(root / jnp.sqrt(c))) / np.sqrt(8)

    @override
    def depth(self, x: Scalar) -> Scalar:
        return inverse(self.load, x, 2 * x)

    def _power(self, depth: Scalar, exponent: float) -> Scalar:
        inside = depth > 0
        return jnp.where(inside, jnp.where(inside, depth, 1) ** exponent, 0)

"""A roller bearing: a continuum of rollers between two rings, with clearance.

After Harris, Rolling Bearing Analysis, with Palmgren's line contact: a roller under Q (N) between
two raceways moves them together by 2 * 3.84e-5 Q^0.9 / l^0.8 (mm), over its length l (mm). Steel on
steel, loaded radially, with rigid rings. The law is the same at each shaft angle: it does not model
single rollers that pass the load.

A roller at the angle psi off the load is pressed by e cos psi - c, where that is positive. With the
penetration d = e - c and q = d / (2 e), the sine of a quarter of the zone's width is sqrt(q), and
sin(psi / 2) = x sqrt(q) maps the zone onto x from -1 to 1: e cos psi - c = d (1 - x^2). What is
left of Sjovall's integrals is smooth in q from 0 to 1/2, so that a fixed Gauss rule is exact to
rounding.
"""

import functools

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, Scalar
from typing_extensions import override

from jaxcrusher.basics import smooth
from jaxcrusher.basics.checks import require
from jaxcrusher.basics.plane import Vector, scalar
from jaxcrusher.joint.clearance import AbstractBearing, Contact
from jaxcrusher.joint.normal import (
    AbstractImpactVelocity,
    AbstractNormalForce,
    ConstantImpactVelocity,
    inverse,
)

# Palmgren's line contact: Q is as its penetration to this power.
EXPONENT = 10 / 9
# Even, so that half of the nodes serve both halves of the zone. The integrand's singularity at
# x = sqrt(2) or beyond leaves an error of (1 + sqrt(2))^-40 = 5e-16.
_NODES = 20


@functools.cache
def _rule(exponent: float) -> tuple[Float[np.ndarray, " half"], Float[np.ndarray, " half"]]:
    """Return x^2 and weights of Gauss's rule for (1 - x^2)^exponent on [0, 1], of even ones."""
    # Only rollers need it, and to import it takes a tenth of the package's time.
    from scipy.special import roots_gegenbauer

    nodes, weights = roots_gegenbauer(_NODES, exponent + 0.5)
    half = nodes > 0
    return nodes[half] ** 2, weights[half]


def force_factor(q: Scalar) -> Scalar:
    """Return (1 / 2 pi) int (1 - x^2)^(10/9) cos psi dpsi over sqrt(q)."""
    squares, weights = _rule(EXPONENT)
    return 2 / np.pi * jnp.sum(weights * (1 - 2 * q * squares) / jnp.sqrt(1 - q * squares))


def energy_factor(q: Scalar) -> Scalar:
    """Return (1 / 2 pi) int (1 - x^2)^(19/9) dpsi over sqrt(q)."""
    squares, weights = _rule(EXPONENT + 1)
    return 2 / np.pi * jnp.sum(weights / jnp.sqrt(1 - q * squares))


def damping_shares(root: Scalar) -> tuple[Scalar, Scalar]:
    """Return (2 / pi) int cos^2 and sin^2 psi dpsi over the zone, where `root` is sqrt(q).

    Along the load and across it; both are 1 where half of the bearing is loaded.
    """
    zone = 2 * jnp.arcsin(root)
    swell = 2 * root * jnp.sqrt(1 - root**2) * (1 - 2 * root**2)
    return 2 / np.pi * (zone + swell), 2 / np.pi * (zone - swell)


# 1 / (2 * 3.84e-5)^(10/9) N / mm^2, of N/mm^(10/9) and mm^(8/9), in N / m^2.
PALMGREN = 1e6 * (2 * 3.84e-5) ** -EXPONENT
# E / (2 (1 - nu^2)) of two bodies of bearing steel, with the 206 GPa and 0.3 of ISO 76, Pa.
STEEL = 206e9 / (2 * (1 - 0.3**2))
# Pressure at the static rating, Pa: ISO 76 for roller bearings.
STATIC_PRESSURE = 4e9
# Exponent of life over load of roller bearings: ISO 281.
LIFE_EXPONENT = 10 / 3
# Speed (rad/s) over which the friction moment turns round where the rings stand still.
REST = 0.01


class Rollers(AbstractNormalForce):
    """F = (Z / 2 pi) int K (e cos psi - c)^(10/9) cos psi dpsi: Sjovall's integral.

    Near touch F is as the penetration to the power 29/18, far from it to 10/9. Each loaded roller
    damps by a coefficient, so that light damping may pull for a moment where the zone closes. The
    corner at touch is smoothed over `width` (m). There is no impact velocity in it.
    """

    clearance: Scalar = eqx.field(converter=scalar)  # c, radial, m
    count: Scalar = eqx.field(converter=scalar)  # Z, of all rows of all bearings
    length: Scalar = eqx.field(converter=scalar)  # l, of contact of a roller, m
    damping: Scalar = eqx.field(converter=scalar)  # where half of the rollers are loaded, N s/m
    impact_velocity: AbstractImpactVelocity = eqx.field(
        default_factory=lambda: ConstantImpactVelocity(1.0)
    )
    width: Scalar = eqx.field(converter=scalar, default=1e-8)

    def roller_stiffness(self) -> Scalar:
        """K of one roller between both rings, N/m^(10/9)."""
        return PALMGREN * self.length ** (8 / 9)

    def roller_load(self, penetration: Scalar) -> Scalar:
        """The load of the roller in the middle of the zone, N."""
        power = smooth.positive_power(penetration, self.width, EXPONENT)
        return self.roller_stiffness() * power

    def _share(self, deep: Scalar) -> Scalar:
        """The square of the sine of a quarter of the load zone's width, q."""
        return deep / (2 * (self.clearance + deep))

    def _sjovall(self, deep: Scalar, power: Scalar) -> Scalar:
        """The integral at a penetration > 0, of which `power` is the power 29/18, N."""
        stiffness = self.count * self.roller_stiffness() / jnp.sqrt(2 * (self.clearance + deep))
        return stiffness * power * force_factor(self._share(deep))

    @override
    def elastic_force(self, penetration: Scalar) -> Scalar:
        """The slope of the elastic energy, N."""
        deep = smooth.positive_part(penetration, self.width)
        power = smooth.positive_power(penetration, self.width, EXPONENT + 0.5)
        corner = jnp.clip((penetration + self.width) / (2 * self.width), 0, 1)
        return self._sjovall(deep, power) * corner

    @override
    def elastic_energy(self, penetration: Scalar) -> Scalar:
        deep = smooth.positive_part(penetration, self.width)
        power = smooth.positive_power(penetration, self.width, EXPONENT + 1.5)
        stiffness = self.count * self.roller_stiffness() / (EXPONENT + 1)
        stiffness = stiffness / jnp.sqrt(2 * (self.clearance + deep))
        return stiffness * power * energy_factor(self._share(deep))

    def damping_coefficients(self, penetration: Scalar) -> tuple[Scalar, Scalar]:
        """Damping along the load and across it, N s/m."""
        deep = smooth.positive_part(penetration, self.width)
        root = smooth.positive_power(penetration, self.width, 0.5)
        along, across = damping_shares(root / jnp.sqrt(2 * (self.clearance + deep)))
        return self.damping * along, self.damping * across

    @override
    def force(self, penetration: Scalar, rate: Scalar, memory: Scalar | None) -> Scalar:
        return self.elastic_force(penetration) + self.damping_coefficients(penetration)[0] * rate

    @override
    def penetration_under(self, force: Scalar) -> Scalar:
        # The elastic part is a power between 29/18 and 10/9.
        guess = (force / (self.count * self.roller_stiffness())) ** (1 / EXPONENT)
        return inverse(lambda deep: self._sjovall(deep, deep ** (EXPONENT + 0.5)), force, guess)


class RollerBearing(AbstractBearing):
    """Equal bearings side by side on one journal, their rollers taken together.

    A damper turns with the cage, so that a bearing that turns as one body loses nothing. Its force
    across the load puts a moment on each ring by the cage's share in the ring's speed, and action
    and reaction balance in moment too. Rolling takes a moment mu F d / 2 between the rings.
    """

    bore_radius: Scalar = eqx.field(converter=scalar)  # of the jaw, m
    clearance: Scalar = eqx.field(converter=scalar)  # c, radial, m
    normal: Rollers
    bearings: Scalar = eqx.field(converter=scalar)  # how many
    roller_diameter: Scalar = eqx.field(converter=scalar)  # D_w, m
    pitch_diameter: Scalar = eqx.field(converter=scalar)  # D_pw, of the rollers' centres, m
    bore: Scalar = eqx.field(converter=scalar)  # d, of the inner ring, m
    rolling_friction: Scalar = eqx.field(converter=scalar)  # mu
    static_rating: Scalar = eqx.field(converter=scalar)  # C_0 of one bearing, N
    dynamic_rating: Scalar = eqx.field(converter=scalar)  # C of one bearing, N
    norm_width: Scalar = eqx.field(converter=scalar, default=1e-9)
    friction: None = None  # nothing slides

    @override
    def contact(
        self,
        eccentricity: Vector,
        rate: Vector,
        bearing_spin: Scalar | float,
        journal_spin: Scalar | float,
        memory: Scalar | None,
    ) -> Contact:
        length = smooth.norm(eccentricity, self.norm_width)
        normal = eccentricity / length
        tangent = normal.perp()
        penetration = length - self.clearance
        penetration_rate = rate.dot(normal)
        along, across = self.normal.damping_coefficients(penetration)
        elastic = self.normal.elastic_force(penetration)
        normal_force = elastic + along * penetration_rate
        # The cage turns as rollers roll on both raceways without slip.
        inner = (1 - self.roller_diameter / self.pitch_diameter) / 2
        cage_spin = inner * journal_spin + (1 - inner) * bearing_spin
        sweep = rate.dot(tangent) - length * cage_spin
        swept = across * sweep
        lever = length * swept
        turning = journal_spin - bearing_spin
        rolling = self.rolling_friction * elastic * self.bore / 2
        rolling = rolling * turning / jnp.sqrt(turning**2 + REST**2)
        return Contact(
            penetration=penetration,
            penetration_rate=penetration_rate,
            orbit_speed=normal.cross(rate) / length,
            normal_force=normal_force,
            force=normal_force * normal + swept * tangent,
            normal_loss=along * penetration_rate**2 + across * sweep**2,
            friction_force=swept,
            friction_loss=rolling * turning,
            bearing_moment=(1 - inner) * lever + rolling,
            journal_moment=inner * lever - rolling,
        )

    @override
    def half_width_ratio(self, penetration: Scalar) -> Scalar:
        """Hertz's half-width over the radius of the most loaded roller, at the inner ring."""
        load = self.normal.roller_load(penetration) / self.normal.length
        width = jnp.sqrt(4 * load * self._contact_radius() / (jnp.pi * STEEL))
        return 2 * width / self.roller_diameter

    def pressure(self, penetration: Scalar) -> Scalar:
        """Hertz's pressure between the most loaded roller and the inner ring, Pa."""
        load = self.normal.roller_load(penetration) / self.normal.length
        return jnp.sqrt(load * STEEL / (jnp.pi * self._contact_radius()))

    def _contact_radius(self) -> Scalar:
        """The radius of a roller on a plane that is as curved as roller and inner ring, m."""
        raceway = self.pitch_diameter - self.roller_diameter
        return self.roller_diameter * raceway / (2 * (self.roller_diameter + raceway))


SOURCE_OF_CLASSES = "ISO 5753-1:2009, spherical roller bearings with a cylindrical bore"
# Bore over and up to, mm -> bounds between C2, normal, C3, C4 and C5, um, of the diametral play.
# SKF's chart of the norm agrees up to a bore of 355 mm, but for 185 as the end of C5 up to 80 mm.
_OVER = (24, 30, 40, 50, 65, 80, 100, 120, 140, 160, 180, 200, 225, 250, 280, 315, 355, 400, 450)
_UP_TO = (*_OVER[1:], 500)
_BOUNDS = (
    (15, 25, 40, 55, 75, 95),
    (15, 30, 45, 60, 80, 100),
    (20, 35, 55, 75, 100, 125),
    (20, 40, 65, 90, 120, 150),
    (30, 50, 80, 110, 145, 180),
    (35, 60, 100, 135, 180, 225),
    (40, 75, 120, 160, 210, 260),
    (50, 95, 145, 190, 240, 300),
    (60, 110, 170, 220, 280, 350),
    (65, 120, 180, 240, 310, 390),
    (70, 130, 200, 260, 340, 430),
    (80, 140, 220, 290, 380, 470),
    (90, 150, 240, 320, 420, 520),
    (100, 170, 260, 350, 460, 570),
    (110, 190, 280, 370, 500, 630),
    (120, 200, 310, 410, 550, 690),
    (130, 220, 340, 450, 600, 750),
    (140, 240, 370, 500, 660, 820),
    (140, 260, 410, 550, 720, 900),
)
CLASSES = ("less than C2", "C2", "normal", "C3", "C4", "C5", "more than C5")


def clearance_class(bore: float, clearance: float) -> tuple[str, str]:
    """Return the class of a radial clearance (m) for a bore (m), and the classes' diametral bounds.

    Raises ValueError for a bore that is not over 24 and up to 500 mm.
    """
    # To a millionth, since errors of floats would move what is on a bound.
    wide, play = round(1e3 * bore, 6), round(2e6 * clearance, 6)
    inside = [i for i, end in enumerate(_UP_TO) if _OVER[i] < wide <= end]
    require(len(inside) == 1, "bore", "be over 24 and up to 500 mm", f"{wide:g} mm")
    bounds = _BOUNDS[inside[0]]
    least, low, high, loose, looser, _ = bounds
    told = f"normal {low} to {high}, C3 to {loose}, C4 to {looser} um"
    # A play on a bound belongs to the tighter class, and the least one to C2.
    return CLASSES[1 if play == least else int(np.searchsorted(bounds, play))], told

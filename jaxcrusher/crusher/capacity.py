"""Crushing capacity by laminating crushing theory (paper, (21)-(25)), and the box it allows."""

from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Float, PyTree, Scalar
from typing_extensions import override

from jaxcrusher.basics.plane import scalar
from jaxcrusher.files.summary import Row, Summarised, Summary, value_text
from jaxcrusher.mechanism.linkage import Linkage
from jaxcrusher.mechanism.motion import ideal_at_rest

Values = Float[Array, "*shape"]

AFFLUENCE = 1.67  # k: greatest over least capacity, after (25)
# Angles looked at for the ends of the stroke, and Newton steps from the best of them: from
# 2.5 deg off, three leave less than rounding.
ANGLES, POLISH = 72, 3


CAUTION = (
    "By laminating crushing theory capacity falls with the speed: slower is always more there. A "
    "real crusher has a best speed, below which rock waits for the jaw."
)


# What a motion does to each volume that is crushed: a power (W), as a statistic is named, and what
# `per_volume` makes of it.
PER_VOLUME = {
    "wear": ("sliding_power", "wear: normal force times surface slip, per volume crushed"),
    "energy": ("drive_power", "drive energy per volume crushed"),
}


class CrushingChamber(Summarised, eqx.Module):
    """The chamber: Q = 60 n V mu, V = S L, S = (2b - s) h / 2, h = g t^2 / 2, t = 30 / n.

    The paper gives neither b nor s; its greatest capacity, 9.41 m3/h at 25 rad/s, implies
    2b - s = 60.6 mm (the default). `jaxcrusher.scenes.build.build_chamber` takes s from the links.
    """

    opening_length: Scalar = eqx.field(converter=scalar, default=0.4)  # L, m
    height: Scalar = eqx.field(converter=scalar, default=0.6)  # H, m
    loosening: Scalar = eqx.field(converter=scalar, default=0.7)  # mu
    double_width: Scalar = eqx.field(converter=scalar, default=0.0606)  # 2b - s, m
    gravity: Scalar = eqx.field(converter=scalar, default=9.81)  # m/s2

    def layer_height(self, speed: ArrayLike) -> Values:
        """h, the fall in half a turn (m), at `speed` (rad/s)."""
        return self.gravity * (jnp.pi / jnp.asarray(speed)) ** 2 / 2

    def capacity(self, speed: ArrayLike) -> Values:
        """Q at `speed` (rad/s), in m3/h: inversely proportional to the speed."""
        turns_per_minute = 30 * jnp.asarray(speed) / jnp.pi
        section = self.double_width / 2 * self.layer_height(speed)
        return 60 * turns_per_minute * section * self.opening_length * self.loosening

    def lowest_speed(self) -> Scalar:
        """The speed at which the layer is as high as the chamber, rad/s: 8.98, not 25."""
        return jnp.pi * jnp.sqrt(self.gravity / (2 * self.height))

    @override
    def _summary(self) -> Summary:
        slowest = self.lowest_speed()
        most = f"{value_text(self.capacity(slowest), 'm3/h')} at {value_text(slowest, 'rad/s')}"
        return Summary(
            "CrushingChamber by laminating theory",
            [
                Row("opening_length", value_text(self.opening_length, "m"), "L"),
                Row("height", value_text(self.height, "m"), "H"),
                Row("loosening", value_text(self.loosening, "1"), "mu"),
                Row("double_width", value_text(self.double_width, "m"), "2b - s"),
                Row("capacity", most, "falls inversely to the speed"),
            ],
        )

    def highest_speed(self, floor) -> Scalar:
        """The speed at which the capacity falls to `floor` (m3/h), rad/s."""
        return self.capacity(1.0) / floor


def per_volume(power: ArrayLike, capacity: ArrayLike) -> Values:
    """Return the energy for each volume crushed (J/m3) of a power (W) at a capacity (m3/h)."""
    return 3600 * jnp.asarray(power) / capacity


def throughput(capacity: float, bulk_density: float) -> float:
    """Convert a capacity in m3/h to t/h, at a bulk density in kg/m3."""
    return 1e-3 * bulk_density * capacity


def lower_end(angle: Scalar, linkage: Linkage) -> Scalar:
    """How far right of C the jaw's end B is (m) at an angle of the shaft (rad); ideal joint."""
    return ideal_at_rest(linkage, angle).position(linkage.joints.at("elbow").pin).x


def stationary(travel: Callable[..., Scalar], angle: Scalar, *numbers: PyTree) -> Scalar:
    """Return the angle near a given one (rad) at which a travel (m) is least or greatest.

    `travel` is a function of the angle and of numbers. By these numbers the angle has first
    derivatives, so that the travel there has second ones.
    """
    rate, held = jax.grad(travel), jax.lax.stop_gradient(numbers)

    def closer(_, at: Scalar) -> Scalar:
        return at - rate(at, *held) / curvature(at)

    def curvature(at: Scalar) -> Scalar:
        return jax.grad(rate)(at, *held)

    end = jax.lax.stop_gradient(jax.lax.fori_loop(0, POLISH, closer, angle))
    left = rate(end, *numbers)
    return end - (left - jax.lax.stop_gradient(left)) / curvature(end)


def stroke_ratio(linkage: Linkage) -> Scalar:
    """Return the vertical over the horizontal travel of the jaw's lower end over a turn.

    Computed at 720 angles, to some 1e-5. The abrasion of the jaws grows with it.
    """
    pin = linkage.joints.at("elbow").pin
    angles = jnp.linspace(0, 2 * jnp.pi, 10 * ANGLES, endpoint=False)
    places = jax.vmap(lambda angle: ideal_at_rest(linkage, angle).position(pin))(angles)
    return jnp.ptp(places.y) / jnp.ptp(places.x)


def stroke(linkage: Linkage) -> Scalar:
    """s, the horizontal travel of the jaw's lower end B over a turn (m); ideal joint.

    It is exact to rounding, with first and second derivatives.
    """
    angles = jnp.linspace(0, 2 * jnp.pi, ANGLES, endpoint=False)
    travel = jax.vmap(lower_end, (0, None))(angles, jax.lax.stop_gradient(linkage))
    ends = angles[jnp.stack([jnp.argmax(travel), jnp.argmin(travel)])]
    ends = jax.vmap(lambda end: stationary(lower_end, end, linkage))(ends)
    right, left = jax.vmap(lower_end, (0, None))(ends, linkage)
    return right - left

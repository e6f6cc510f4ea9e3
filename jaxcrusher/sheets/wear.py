"""Wear of a joint whose surfaces slide: Archard's depth over the angles of bore and pin.

Where surfaces slide at v under a pressure p, each loses the depth k p |v| a second (Archard, J.
Appl. Phys. 24, 1953). Along a bore of width L and radius R the pressure of a normal force F_n is
Hertz's ellipse of the half-width a. So a sector from x = l to x = u, in units of a, takes the share
C(u) - C(l) of the volume k F_n |v| that is worn off a second,

    C(x) = 1/2 + (x sqrt(1 - x^2) + asin x) / pi.

The volume of a turn over 2 pi R L is the mean depth. The clearance grows by the mean depths of bore
and pin. Coefficients of wear span decades, and a worn bore is no longer round: this tells
which sector wears first, and how hours compare.
"""

from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Scalar
from typing_extensions import override

from jaxcrusher.basics.checks import require, require_positive, require_whole
from jaxcrusher.files import svg
from jaxcrusher.files.summary import Summarised, Summary
from jaxcrusher.mechanism.observables import HOUR
from jaxcrusher.mechanism.quantities import sliding_power
from jaxcrusher.mechanism.reductions import SAMPLES
from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.mechanism.snapshot import Observable, OfPart, Snapshot
from jaxcrusher.orbits.forced import remembers
from jaxcrusher.orbits.periodic_orbit import periodic_orbit
from jaxcrusher.orbits.result import PeriodicOrbit, observables_along, require_one

# What published coefficients of steel on steel span, m2/N: as those of Rabinowicz (Friction and
# Wear of Materials, 1965) over a hardness of 2 GPa, from memory; well greased, and dry.
PUBLISHED = 1e-16, 1e-12
# Steps of Heun's method over the hours of a clearance that grows.
STEPS = 4


class Archard(NamedTuple):
    """What wears the surfaces of a joint: the coefficient k, m2/N, and the width L, m."""

    coefficient: float
    width: float

    def growth(self, power: Scalar | float, radius: Scalar | float) -> Scalar | float:
        """Return by how much a clearance grows, m/s, of the mean of F_n |v| (W) in a bore (m)."""
        return self.coefficient * power / (np.pi * radius * self.width)


class Wear(Summarised, eqx.Module):
    """Depths worn off a joint a second, over sectors of its bore and its pin."""

    angle: Float[Array, " sectors"]  # of a sector's middle, from the x axis of its body, rad
    bore: Float[Array, " sectors"]  # m/s
    pin: Float[Array, " sectors"]  # m/s

    @property
    def growth(self) -> Scalar:
        """Return by how much the clearance grows, m/s: by the mean depths of both."""
        return jnp.mean(self.bore) + jnp.mean(self.pin)

    @override
    def __str__(self) -> str:
        """Say in mm how deep the worst sectors are after 1000 h (concrete values only)."""
        lines = []
        for name, depths in (("bore", self.bore), ("pin", self.pin)):
            worst, mean = (1e6 * HOUR * float(of(depths)) for of in (jnp.max, jnp.mean))
            at = np.degrees(float(self.angle[int(jnp.argmax(depths))]))
            lines.append(f"{name}: {worst:.3g} mm in 1000 h at {at:.0f} deg, {mean:.3g} mm in mean")
        return "\n".join(lines)

    @override
    def _summary(self) -> Summary:
        return Summary("Wear of a joint, by sector", (), str(self).splitlines())

    @override
    def _picture(self) -> str:
        return svg.curve(self.angle, self.bore, "wear of the bore by angle")


def _rubbed(s: Snapshot, scene: Scene, joint: str) -> Float[Array, "6"]:
    """Return F_n |v| (W), the contact's direction in the axes of bore and pin, and a / R."""
    ends, contact = scene.linkage.joints.at(joint), s.contacts.at(joint)
    e = s.motion.eccentricities.at(joint)
    bore, pin = (e.seen_from(s.motion.axis(end.body)) for end in (ends.bore, ends.pin))
    width = scene.joints.at(joint).half_width_ratio(contact.penetration)
    power = sliding_power(s, scene, joint)
    return jnp.stack([power, bore.x, bore.y, pin.x, pin.y, width])


def wear_of(
    orbit: PeriodicOrbit, joint: str | None = None, *, by: Archard, sectors: int = 72
) -> Wear:
    """Return how fast the sectors of a joint wear along an orbit, with slopes.

    **Arguments:**

    - `orbit`: a single orbit.
    - `joint`: by its name; None is the joint that is looked at.
    - `by`: coefficient of wear and width of the bore.
    - `sectors`: how many there are round the bore, and round the pin.

    Raises ValueError for a joint without friction of sliding surfaces, for a batch, for bearings
    with a memory, and for numbers out of range.
    """
    require_one(orbit)
    scene = orbit.scene
    joint = scene.joint_looked_at(joint)
    require_whole("sectors", sectors, 4)
    for name, value in by._asdict().items():
        require_positive(name, value, {"coefficient": "m2/N", "width": "m"}[name])
    must = f"be a joint with a bore: {', '.join(scene.bearings.names)}"
    require(joint in scene.bearings, "joint", must, joint)
    bearing = scene.bearings.at(joint)
    require(not remembers(scene), "orbit", "be of bearings without a memory", "of one with it")
    must = "be one with friction of sliding surfaces"
    require(bearing.friction is not None, "joint", must, f"{joint}, which has none")
    count = SAMPLES * orbit.period
    phases = 2 * np.pi * np.arange(count) / SAMPLES
    look = ("rubbed", Observable(OfPart(_rubbed, joint), "", "what rubs"))
    seen = observables_along(orbit, jnp.asarray(phases), (look,))["rubbed"]
    return _over_sectors(seen, bearing.bore_radius, jnp.asarray(by), sectors)


@eqx.filter_jit
def _over_sectors(
    seen: Float[Array, "instants 6"], radius: Scalar, by: Float[Array, "2"], sectors: int
) -> Wear:
    step = 2 * np.pi / sectors
    middles = step * (jnp.arange(sectors, dtype=float) + 0.5)
    coefficient, width = by

    def depths(power: Array, x: Array, y: Array, half: Array) -> Array:
        off = middles[:, None] - jnp.arctan2(y, x)[None]
        off = off - 2 * jnp.pi * jnp.round(off / (2 * jnp.pi))
        half = jnp.maximum(half, 1e-9)[None]  # in flight there is none
        share = _below((off + step / 2) / half) - _below((off - step / 2) / half)
        return coefficient / (radius * step * width) * (share @ power) / len(power)

    power, x, y, u, v, half = seen.T
    return Wear(middles, depths(power, x, y, half), depths(power, u, v, half))


def _below(x: Array) -> Array:
    """Return the share of Hertz's ellipse that lies below x, in half-widths."""
    x = jnp.clip(x, -1 + 1e-12, 1 - 1e-12)
    return 0.5 + (x * jnp.sqrt(1 - x**2) + jnp.arcsin(x)) / jnp.pi


def worn_clearance(
    scene: Callable[[Scalar], Scene],
    clearance: float,
    hours: float,
    joint: str | None = None,
    *,
    by: Archard,
    steps: int = STEPS,
) -> Float[Array, " steps"]:
    """Return the clearance of a joint after equal steps of hours, m, from 0 on.

    `scene` makes the machine at a clearance (m), whose orbit wears it. By Heun's method: the orbit
    is solved for twice a step. Raises ValueError where there is none.
    """
    require_positive("hours", hours, "h")
    require_whole("steps", steps, 1)
    span = HOUR * hours / steps

    def growth(at: Scalar) -> Scalar:
        orbit = periodic_orbit(scene(at))
        if not bool(jax.lax.stop_gradient(orbit.success)):
            raise ValueError(f"Argument `scene` must have an orbit at {at}. {orbit.failure}")
        return wear_of(orbit, joint, by=by).growth

    found = [jnp.asarray(clearance, float)]
    for _ in range(steps):
        first = growth(found[-1])
        second = growth(found[-1] + span * first)
        found.append(found[-1] + span * (first + second) / 2)
    return jnp.stack(found)

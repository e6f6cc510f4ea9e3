"""A bore and a pin of two bodies in the plane: the published laws of contact, not smoothed.

Vectors of the plane are complex numbers, as in `equations`; SI units.
"""

import cmath
import math
from dataclasses import dataclass
from functools import cached_property

from benchmarks.peers.equations import cross, dot

# Between which slips (m/s) friction grows from nothing to its full value.
V0, V1 = 0.1, 1.0


@dataclass
class Body:
    """A rigid body at an instant, and what pushes it: force (N) and moment about its centre."""

    centre: complex
    velocity: complex
    angle: float
    spin: float
    force: complex = 0j
    moment: float = 0.0

    @cached_property
    def axis(self) -> complex:
        """The direction of its x axis."""
        return cmath.exp(1j * self.angle)

    def velocity_at(self, place: complex) -> complex:
        """Return the velocity of its material at a place of the plane, m/s."""
        return self.velocity + 1j * self.spin * (place - self.centre)

    def push(self, force: complex, place: complex) -> None:
        """Add a force (N) that acts at a place of the plane."""
        self.force += force
        self.moment += cross(place - self.centre, force)


@dataclass(frozen=True)
class Touch:
    """A joint at an instant: what it does to the bore's body, and to the energy."""

    eccentricity: complex  # pin's centre less bore's, m
    place: complex  # where the force acts, m
    corners: list[float]  # of the law, where these pass zero
    force: complex = 0j  # on the bore's body, N
    normal: float = 0.0  # F_n, N
    elastic_energy: float = 0.0  # J
    damping_loss: float = 0.0  # W
    friction_loss: float = 0.0  # W


@dataclass(frozen=True)
class LooseJoint:
    """Lankarani and Nikravesh's contact with Ambrosio's friction; pin and bore of one material.

    `slip` "surface" is the speed of the bore's material relative to the pin's where they touch,
    "centre" that of its centre.
    """

    clearance: float
    bore_radius: float
    friction: float
    restitution: float
    impact_velocity: float
    young: float
    poisson: float
    slip: str

    @cached_property
    def stiffness(self) -> float:
        """K of (9)-(10), N/m^1.5."""
        pin_radius = self.bore_radius - self.clearance
        compliance = 2 * (1 - self.poisson**2) / self.young
        return 4 / (3 * compliance) * math.sqrt(self.bore_radius * pin_radius / self.clearance)

    def push_apart(self, bore: Body, pin: Body, bore_centre: complex, pin_centre: complex) -> Touch:
        """Push both bodies at one point, on the bore's surface."""
        e = pin_centre - bore_centre
        n = e / abs(e) if e else 1 + 0j
        place = bore_centre + self.bore_radius * n
        depth = abs(e) - self.clearance
        rate = pin.velocity_at(pin_centre) - bore.velocity_at(bore_centre)
        of_surfaces = dot(bore.velocity_at(place) - pin.velocity_at(place), 1j * n)
        slip = of_surfaces if self.slip == "surface" else -dot(rate, 1j * n)
        corners = [depth, abs(slip) - V0, abs(slip) - V1] if self.friction else [depth]
        if depth <= 0:
            return Touch(e, place, corners)
        elastic = self.stiffness * depth**1.5
        damping = 0.75 * (1 - self.restitution**2) * dot(rate, n) / self.impact_velocity
        normal = elastic * (1 + damping)
        share = min(max((abs(slip) - V0) / (V1 - V0), 0.0), 1.0)
        tangential = -self.friction * share * normal * math.copysign(1.0, slip)
        force = normal * n + tangential * 1j * n
        bore.push(force, place)
        pin.push(-force, place)
        return Touch(
            e,
            place,
            corners,
            force,
            normal,
            elastic_energy=0.4 * elastic * depth,
            damping_loss=elastic * damping * dot(rate, n),
            friction_loss=-tangential * of_surfaces,
        )

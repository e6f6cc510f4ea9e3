"""The counterweight on the crank that leaves the least of the shaking force's first order.

At a constant speed omega and with ideal joints the first order of the shaking force is two forces
of constant size that turn: one with the crank and one against it,

    F_x + i F_y = P e^(i theta) + N e^(-i theta).

The tip goes round an ellipse with the semi-axes |P| + |N| and ||P| - |N||. A mass m at the radius r
from the crank's bearing, ahead of the crank's x axis by psi, adds m r omega^2 e^(i (theta + psi)),
which turns with the crank. So it changes P alone. P = 0 leaves the least RMS and the least largest
force, which is |N| in all directions. For a slider-crank |N| is the force of half the reciprocating
mass, the usual rule. P = -conj(N) leaves nothing horizontally and 2 |N| vertically, P = conj(N) the
other way round. No mass on the crank changes the other orders.
"""

import cmath
from dataclasses import dataclass
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Complex

from jaxcrusher.basics.checks import require, require_positive
from jaxcrusher.basics.plane import Vector
from jaxcrusher.crusher.machine import with_counterweight
from jaxcrusher.mechanism.drives import AbstractMotion, ConstantSpeed
from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.orbits.periodic_orbit import periodic_orbit
from jaxcrusher.sheets.harmonics import harmonics


@dataclass(frozen=True)
class Ellipse:
    """A harmonic of a force in the plane, as two forces that turn: `forward` with the crank."""

    forward: complex  # P, N
    backward: complex  # N, N

    @classmethod
    def of(cls, amplitudes: Complex[np.ndarray, "2"]) -> "Ellipse":
        """Return the ellipse of complex amplitudes (N) of the horizontal and vertical component."""
        x, y = map(complex, amplitudes)
        return cls((x + 1j * y) / 2, (x.conjugate() + 1j * y.conjugate()) / 2)

    @property
    def largest(self) -> float:
        """Return the largest force of the turn, N."""
        return abs(self.forward) + abs(self.backward)

    @property
    def sides(self) -> tuple[float, float]:
        """Return the amplitudes of the horizontal and of the vertical component, N."""
        other = self.backward.conjugate()
        return abs(self.forward + other), abs(self.forward - other)


@dataclass(frozen=True)
class Balance:
    """The first two orders of the shaking force, and the effect of a mass on the crank.

    First moments of masses (kg m) are complex numbers: their size is mass times radius, and their
    angle is ahead of the crank's x axis, which is the line O-A of a crusher.
    """

    speed: float  # of the crank, rad/s
    first: Ellipse
    second: Ellipse

    def with_moment(self, moment: complex) -> Ellipse:
        """Return the first order with a mass of this first moment added to the crank."""
        return Ellipse(self.first.forward + moment * self.speed**2, self.first.backward)

    @property
    def moments(self) -> dict[str, complex]:
        """Return the first moments to add to the crank, each by the directions that it balances."""
        against = self.first.backward.conjugate()
        goals = {"in all directions": 0j, "horizontally": -against, "vertically": against}
        return {way: (goal - self.first.forward) / self.speed**2 for way, goal in goals.items()}


def balance_of(scene: Scene) -> Balance:
    """Return the first two orders of the shaking force of a scene with ideal joints.

    An uneven speed counts with its mean, and a frame on supports is at rest.

    Raises ValueError for a drive whose speed is not given, and for a scene that does not move.
    """
    drive = scene.drive
    must = "have a given speed: a free shaft has none that a counterweight could be made for"
    require(isinstance(drive, AbstractMotion), "scene", must, type(drive).__name__)
    still = eqx.tree_at(lambda one: one.drive, scene.ideal(), ConstantSpeed(drive.speed))
    orders = harmonics(periodic_orbit(still), 2)
    force = orders.isel(quantity=slice(0, 2))
    amplitudes = force.amplitude.to_numpy() * np.exp(1j * force.phase.to_numpy())
    first, second = (Ellipse.of(amplitudes[:, order]) for order in (1, 2))
    return Balance(float(jnp.asarray(drive.speed)), first, second)


def with_moment(scene: Scene, moment: complex, radius: float) -> Scene:
    """Return the scene with a point mass on its crank, of a first moment (kg m) about its bearing.

    Raises ValueError for a radius (m) that is not positive.
    """
    require_positive("radius", radius, "m")
    linkage = scene.linkage
    place = cmath.rect(radius, cmath.phase(moment))
    centre = linkage.side_of(linkage.bearing, linkage.crank).vector()
    at = centre + Vector(place.real, place.imag)
    heavier = with_counterweight(linkage.bodies.at(linkage.crank), abs(moment) / radius, at)

    def crank(one: Scene) -> Any:
        return one.linkage.bodies.at(linkage.crank)

    return eqx.tree_at(crank, scene, heavier)

"""A bore and a pin of two bodies in the plane: the published laws of contact, not smoothed.

Lankarani and Nikravesh's contact with Ambrosio's friction, compiled by numba; pin and bore are of
one material. Vectors of the plane are complex numbers; SI units.
"""

import math
from collections.abc import Mapping
from typing import Any

from benchmarks.peers.dopri5 import compiled

# Between which slips (m/s) friction grows from nothing to its full value.
V0, V1 = 0.1, 1.0


@compiled
def dot(u, v):
    """Return the scalar product u . v."""
    return u.real * v.real + u.imag * v.imag


@compiled
def cross(u, v):
    """Return the vector product u x v: the moment of v at arm u."""
    return u.real * v.imag - u.imag * v.real


def law_of(values: Mapping[str, Any], joint: str) -> list[float]:
    """Return the row that `push` takes, of the numbers of a joint's contact by name.

    `slip` "surface" is the speed of the bore's material relative to the pin's where they touch,
    "centre" that of its centre.
    """
    names = "clearance bore_radius young poisson restitution impact_velocity friction slip"
    c, bore, young, poisson, restitution, velocity, friction, slip = (
        values[f"{joint}.{name}"] for name in names.split()
    )
    compliance = 2 * (1 - poisson**2) / young
    stiffness = 4 / (3 * compliance) * math.sqrt(bore * (bore - c) / c)  # (9)-(10), N/m^1.5
    damping = 0.75 * (1 - restitution**2) / velocity
    return [c, bore, stiffness, damping, friction, float(slip == "centre")]


@compiled
def push(law, e, rate, bore_spin, pin_spin):
    """Return the bore's force (N), the pair's moments about both centres (N m), normal force.

    Both bodies are pushed at one point, on the bore's surface.
    """
    c, radius, stiffness, damping, friction, of_centre = law
    length = math.sqrt(e.real * e.real + e.imag * e.imag)
    if length <= c or c == 0.0:
        return 0j, 0.0, 0.0, 0.0
    n, depth = e / length, length - c
    normal = stiffness * depth * math.sqrt(depth) * (1 + damping * dot(rate, n))
    slip = -cross(n, rate)
    if of_centre == 0.0:
        slip += radius * bore_spin - (radius - length) * pin_spin
    share = min(max((abs(slip) - V0) / (V1 - V0), 0.0), 1.0)
    tangential = -friction * share * normal * math.copysign(1.0, slip)
    force = (normal + 1j * tangential) * n
    return force, radius * tangential, -(radius - length) * tangential, normal

"""A bore and a pin of two bodies in the plane: the published laws of contact, not smoothed.

Lankarani and Nikravesh's contact with Ambrosio's friction, and the film of a short bearing,
compiled by numba; pin and bore are of one material. Vectors of the plane are complex numbers; SI
units.
"""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from benchmarks.peers.dopri5 import compiled

# Between which slips (m/s) friction grows from nothing to its full value.
V0, V1 = 0.1, 1.0
# Gauss's points and weights over the half of the bore where a film carries.
POINTS, WEIGHTS = np.polynomial.legendre.leggauss(64)


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
    "centre" that of its centre. A bearing without `film.viscosity` is dry.
    """
    names = "clearance bore_radius young poisson restitution impact_velocity friction slip"
    c, bore, young, poisson, restitution, velocity, friction, slip = (
        values[f"{joint}.{name}"] for name in names.split()
    )
    compliance = 2 * (1 - poisson**2) / young
    stiffness = 4 / (3 * compliance) * math.sqrt(bore * (bore - c) / c)  # (9)-(10), N/m^1.5
    damping = 0.75 * (1 - restitution**2) / velocity
    film = values.get(f"{joint}.film.viscosity", 0.0), values.get(f"{joint}.film.width", 0.0)
    return [c, bore, stiffness, damping, friction, float(slip == "centre"), *film]


@compiled
def flow(c, radius, viscosity, width, e, rate, bore_spin, pin_spin):
    """Return a film's force on the bore (N), and the moment of its shear (N m).

    Where wedge and squeeze thicken the film it cavitates; the rest is half of the bore.
    """
    spin, force = (bore_spin + pin_spin) / 2, 0j
    closing = rate - 1j * spin * e
    middle = math.atan2(closing.imag, closing.real)
    for k in range(POINTS.size):
        angle = middle + math.pi / 2 * POINTS[k]
        n = complex(math.cos(angle), math.sin(angle))
        thickening = -spin * dot(e, 1j * n) - dot(rate, n)
        height = c - dot(e, n)
        force -= math.pi / 2 * WEIGHTS[k] * thickening / height**3 * n
    share = math.sqrt(e.real * e.real + e.imag * e.imag) / c
    shear = 2 * math.pi * viscosity * radius**3 * width / (c * math.sqrt(1 - share * share))
    return viscosity * radius * width**3 * force, shear * (pin_spin - bore_spin)


@compiled
def push(law, e, rate, bore_spin, pin_spin):
    """Return the bore's force (N), the pair's moments about both centres (N m), normal force.

    In contact both bodies are pushed at one point, on the bore's surface.
    """
    c, radius, stiffness, damping, friction, of_centre, viscosity, width = law
    length = math.sqrt(e.real * e.real + e.imag * e.imag)
    if length <= c and viscosity > 0.0:
        film, shear = flow(c, radius, viscosity, width, e, rate, bore_spin, pin_spin)
        half = cross(e, film) / 2
        return film, half + shear, half - shear, 0.0
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

"""The bodies of `crusher_bodies` in eccentricities, by numba: the published laws, not smoothed.

In eccentricities a penetration of 1e-6 m is right to rounding of itself, not of the 1 m of a
position, and nothing drifts. Time is the shaft's angle. State: e / c of A, B and C (6), e' (m/s,
6), and the integral of |R_O| + |R_C| squared over a turn; those of ideal joints stay zero.

Vectors of the plane are complex numbers, as in `equations`; SI units.
"""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from benchmarks.peers import dopri5
from benchmarks.peers.any_linkage import AnyLinkage
from benchmarks.peers.crusher_bodies import PREFIXES
from benchmarks.peers.dopri5 import compiled
from benchmarks.peers.loose_joint import cross, dot, push

# Joints that may be loose here; O is ideal.
LOOSE = ("A", "B", "C")

Numbers = tuple[np.ndarray, np.ndarray, np.ndarray]


def numbers(bodies: AnyLinkage) -> Numbers:
    """Return what the compiled field reads: vectors, scalars, and a row for each joint."""
    speed, gravity, masses, _, arms, laws, _, loads, _ = bodies.numbers
    (to_a, pin), (to_b, half), _, (bearing, axis) = arms
    (shaft_mass, _), (m2, j2), (m3, j3) = masses[1:]
    lengths = abs(pin - axis), abs(to_a - to_b), 2 * abs(half)
    # From O to the shaft's mass centre.
    vectors = np.array([bearing, to_a / lengths[1], -shaft_mass * axis, loads[0, 2]])
    return vectors, np.array([speed, *lengths, m2, j2, m3, j3, gravity, shaft_mass]), laws[:3]


@compiled
def _at(y, i):
    return complex(y[i], y[i + 1])


@compiled
def _plays(at_a, at_b, at_c, on_jaw, on_toggle, jaw_moment, toggle_moment, arms, masses):
    """Return accelerations of the pins against their bores (m/s2), but for what the spins give.

    Under forces on the bores (N) and further ones on the mass centres, with moments (N m).
    """
    (to_a, to_b, half), (m2, j2, m3, j3) = arms, masses
    of_s2, of_s3 = (at_a + at_b + on_jaw) / m2, (on_toggle - at_b - at_c) / m3
    jaw_rate = (cross(to_a, at_a) + cross(to_b, at_b) + jaw_moment) / j2
    toggle_rate = (cross(half, at_c) - cross(half, at_b) + toggle_moment) / j3
    of_a = -of_s2 - 1j * jaw_rate * to_a
    of_b = of_s3 + 1j * toggle_rate * half - of_s2 - 1j * jaw_rate * to_b
    return of_a, of_b, of_s3 - 1j * toggle_rate * half


@compiled
def _kept(free, laws, arms, masses):
    """Return the forces (N) at ideal joints that undo the accelerations `free` of their pins."""
    of = [j for j in range(3) if laws[j, 0] == 0.0]
    count = 2 * len(of)
    rows, forces = np.empty((count, count + 1)), np.zeros(3, np.complex128)
    for i, j in enumerate(of):
        rows[2 * i, count], rows[2 * i + 1, count] = -free[j].real, -free[j].imag
        for way, unit in enumerate((1.0 + 0j, 1j)):
            forces[j] = unit
            found = _plays(forces[0], forces[1], forces[2], 0j, 0j, 0.0, 0.0, arms, masses)
            for k, other in enumerate(of):
                column = 2 * i + way
                rows[2 * k, column] = found[other].real
                rows[2 * k + 1, column] = found[other].imag
        forces[j] = 0j
    # Gauss and Jordan; a definite matrix needs no pivots, and NaN passes.
    for k in range(count):
        for i in range(count):
            if i != k:
                rows[i] -= rows[i, k] / rows[k, k] * rows[k]
    for i, j in enumerate(of):
        x, y = 2 * i, 2 * i + 1
        forces[j] = complex(rows[x, count] / rows[x, x], rows[y, count] / rows[y, y])
    return forces[0], forces[1], forces[2]


@compiled
def instant(angle, y, p):
    """Return e'' by joint (m/s2), R_O on the shaft, R_C on the toggle and normal forces (N)."""
    vectors, scalars, laws = p
    bearing, a_share, unbalance, load = vectors
    w, l1, l2, l3, m2, j2, m3, j3, g, shaft_mass = scalars
    turned = complex(math.cos(angle), math.sin(angle))
    e_a, e_b, e_c = laws[0, 0] * _at(y, 0), laws[1, 0] * _at(y, 2), laws[2, 0] * _at(y, 4)
    u_a, u_b, u_c = _at(y, 6), _at(y, 8), _at(y, 10)
    # Toggle and jaw are two sides of a triangle, the elbow to the right of the third.
    third = bearing + l1 * turned - e_a + e_b - e_c
    moving = 1j * w * l1 * turned - u_a + u_b - u_c
    squared = dot(third, third)
    share = (squared + l3 * l3 - l2 * l2) / (2 * squared)
    toggle = third * complex(share, -math.sqrt(l3 * l3 / squared - share * share))
    jaw = third - toggle
    area = cross(toggle, jaw)
    w3, w2 = dot(moving, jaw) / area, -dot(moving, toggle) / area
    to_a = a_share * jaw
    to_b, half = to_a - jaw, toggle / 2
    # Contacts push, and weights, load and the spins of bodies.
    at_a, jaw_m, _, normal_a = push(laws[0], e_a, u_a, w2, w)
    at_b, on_jaw_m, toggle_m, normal_b = push(laws[1], e_b, u_b, w2, w3)
    at_c, _, on_toggle_m, normal_c = push(laws[2], e_c, u_c, 0.0, w3)
    arms, masses = (to_a, to_b, half), (m2, j2, m3, j3)
    on_jaw, on_toggle = load / l2 * jaw - 1j * g * m2, -1j * g * m3
    jaw_m, toggle_m = jaw_m + on_jaw_m, toggle_m + on_toggle_m
    a_a, a_b, a_c = _plays(at_a, at_b, at_c, on_jaw, on_toggle, jaw_m, toggle_m, arms, masses)
    a_a += w2 * w2 * to_a - w * w * l1 * turned
    a_b += w2 * w2 * to_b - w3 * w3 * half
    a_c += w3 * w3 * half
    if laws[0, 0] * laws[1, 0] * laws[2, 0] == 0.0:
        k_a, k_b, k_c = _kept((a_a, a_b, a_c), laws, arms, masses)
        d_a, d_b, d_c = _plays(k_a, k_b, k_c, 0j, 0j, 0.0, 0.0, arms, masses)
        at_a, at_b, at_c = at_a + k_a, at_b + k_b, at_c + k_c
        a_a, a_b, a_c = a_a + d_a, a_b + d_b, a_c + d_c
    at_o = at_a + 1j * g * shaft_mass - w * w * unbalance * turned
    return (a_a, a_b, a_c), (at_o, -at_c), (normal_a, normal_b, normal_c)


@compiled
def field(angle, y, p, rate):
    """Write the rate of `y` by shaft angle into `rate`."""
    w, laws = p[1][0], p[2]
    accelerations, (at_o, at_c), _ = instant(angle, y, p)
    for j, a in enumerate(accelerations):
        c = laws[j, 0]
        rate[2 * j], rate[2 * j + 1], rate[6 + 2 * j], rate[7 + 2 * j] = 0.0, 0.0, 0.0, 0.0
        if c > 0.0:
            rate[2 * j], rate[2 * j + 1] = y[6 + 2 * j] / (c * w), y[7 + 2 * j] / (c * w)
            rate[6 + 2 * j], rate[7 + 2 * j] = a.real / w, a.imag / w
    force = math.sqrt(dot(at_o, at_o)) + math.sqrt(dot(at_c, at_c))
    rate[12] = force * force / (2 * math.pi)


@compiled
def integrate(y, p, settle, turns, rtol, h, most=1_000_000_000):
    """Return the mean square of |R_O| + |R_C| over turns, and steps: `dopri5.integrate`."""
    return dopri5.integrate(field, y, p, settle, turns, rtol, h, most)


@dataclass
class CompiledBodies:
    """The motion of a crusher's bodies from their start, as `sundials_peer` takes one."""

    bodies: AnyLinkage

    @cached_property
    def numbers(self) -> Numbers:
        """The numbers that the compiled field reads."""
        return numbers(self.bodies)

    @cached_property
    def start(self) -> np.ndarray:
        """The state at time 0."""
        y = np.zeros(13)
        for j, joint in enumerate(LOOSE):
            c = self.numbers[2][j, 0]
            if c:
                e, rate = (of.get(joint, 0j) for of in (self.bodies.e, self.bodies.rates))
                y[2 * j : 2 * j + 2] = e.real / c, e.imag / c
                y[6 + 2 * j : 8 + 2 * j] = rate.real, rate.imag
        return y

    def field(self, time: float, y) -> np.ndarray:
        """Return the rate y' by time (s), without the integral."""
        speed, rate = self.bodies.numbers[0], np.empty(13)
        field(speed * time, y, self.numbers, rate)
        rate[12] = 0.0
        return speed * rate

    def observe(self, times, states) -> dict[str, np.ndarray]:
        """Return `foundation_force` (N), each joint's `eccentricity` (m), `normal_force` (N)."""
        speed, found = self.bodies.numbers[0], {"foundation_force": []}
        loose = {j: PREFIXES[name] for j, name in enumerate(LOOSE) if self.numbers[2][j, 0]}
        for prefix in loose.values():
            found |= {f"{prefix}eccentricity": [], f"{prefix}normal_force": []}
        for time, y in zip(np.asarray(times).tolist(), states, strict=True):
            _, (at_o, at_c), normal = instant(speed * time, y, self.numbers)
            found["foundation_force"].append(abs(at_o) + abs(at_c))
            for j, prefix in loose.items():
                e = self.numbers[2][j, 0] * y[2 * j : 2 * j + 2]
                found[f"{prefix}eccentricity"].append(e)
                found[f"{prefix}normal_force"].append(normal[j])
        return {name: np.array(values) for name, values in found.items()}

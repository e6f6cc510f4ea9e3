"""The crusher in plain Python, derived apart from jaxcrusher: the published laws, no smoothing.

Wang, Cui, Wang, Appl. Sci. 2023, 13, 238; SI units. Origin at C, x right, y up; theta1 and
theta2 count counterclockwise, theta3 clockwise. Vectors of the plane are complex numbers:
u x v is the imaginary part of conj(u) v, u . v the real part. Toggle and jaw are an open chain
C-B-A in the angles (theta3, theta2); Newton's law is projected on the chain's velocities.
"""

import cmath
import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np


@dataclass(frozen=True)
class Crusher:
    """Tables 1 and 2. `friction` None leaves it out; its slip is that of the surfaces."""

    clearance: float = 0.06e-3
    friction: float | None = None
    speed: float = 30.0
    m1: float = 95.0
    m2: float = 524.0
    m3: float = 22.0
    j1: float = 0.2
    j2: float = 128.48
    j3: float = 0.7154
    l0: float = 0.64
    theta0: float = math.radians(22.5)
    l1: float = 0.01
    l11: float = 0.006
    l2: float = 0.695
    l21: float = 0.3
    l3: float = 0.3
    shaft_angle: float = math.radians(30)
    jaw_angle: float = math.radians(15)
    bore: float = 0.13
    young: float = 207e9
    restitution: float = 0.9
    impact_velocity: float = 0.5
    v0: float = 0.1
    v1: float = 1.0
    load: float = 8.8e3
    g: float = 9.81
    # Where in the overlap the contact acts: 0 the bore's surface, 1 the pin's.
    overlap: float = 0.0

    @cached_property
    def stiffness(self) -> float:
        """K of (9)-(10), N/m^1.5."""
        h = (1 - 0.29**2) / self.young
        pin = self.bore - self.clearance
        return 4 / (3 * 2 * h) * math.sqrt(self.bore * pin / self.clearance)

    @cached_property
    def bearing(self) -> complex:
        """O, m."""
        return self.l0 * complex(math.sin(self.theta0), math.cos(self.theta0))

    @cached_property
    def shaft_inertia(self) -> float:
        """The shaft's inertia about O, kg m2."""
        return self.j1 + self.m1 * self.l11**2


def dot(u: complex, v: complex) -> float:
    """Return the scalar product u . v."""
    return u.real * v.real + u.imag * v.imag


def cross(u: complex, v: complex) -> float:
    """Return the vector product u x v: the moment of v at arm u."""
    return u.real * v.imag - u.imag * v.real


def normal_force(crusher: Crusher, depth: float, rate: float) -> float:
    """Return the force of Lankarani and Nikravesh, (8), N."""
    if depth <= 0:
        return 0.0
    damping = 3 * (1 - crusher.restitution**2) / 4 * rate / crusher.impact_velocity
    return crusher.stiffness * depth**1.5 * (1 + damping)


def ramp(crusher: Crusher, speed: float) -> float:
    """Return c_d of (11)."""
    return min(max((abs(speed) - crusher.v0) / (crusher.v1 - crusher.v0), 0.0), 1.0)


class Shaft:
    """Arms from O to pin and S1, and the pin's velocity."""

    def __init__(self, crusher: Crusher, angle: float, spin: float):
        """Place the shaft at theta1 (rad) and theta1' (rad/s)."""
        crank = cmath.exp(1j * angle)
        self.spin = spin
        self.to_pin = crusher.l1 * crank
        self.to_s1 = crusher.l11 * crank * cmath.exp(1j * crusher.shaft_angle)
        self.pin = crusher.bearing + self.to_pin
        self.pin_velocity = 1j * spin * self.to_pin

    def moment(self, crusher: Crusher, force: complex, point: complex) -> float:
        """Return the moment about O of weight and of the reaction to `force` on the jaw."""
        weight = crusher.m1 * crusher.g * self.to_s1.real
        return -cross(point - crusher.bearing, force) - weight

    def reaction(self, crusher: Crusher, force: complex, spin_rate: float) -> complex:
        """Return R_O on the shaft, N."""
        of_s1 = (1j * spin_rate - self.spin**2) * self.to_s1
        return crusher.m1 * (of_s1 + 1j * crusher.g) + force


class Chain:
    """Toggle and jaw: positions, their derivatives by the angles, centripetal terms."""

    def __init__(self, crusher: Crusher, angles, spins):
        """Place the chain by (theta3, theta2) and their rates."""
        (t3, t2), (w3, w2) = angles, spins
        jaw = cmath.exp(1j * t2)
        self.b = crusher.l3 * cmath.exp(-1j * t3)
        b_to_a = 1j * crusher.l2 * jaw
        b_to_s2 = b_to_a - 1j * crusher.l21 * jaw * cmath.exp(1j * crusher.jaw_angle)
        self.a = self.b + b_to_a
        self.db = -1j * self.b  # by theta3
        self.da = 1j * b_to_a  # by theta2
        self.ds2 = 1j * b_to_s2  # by theta2
        self.velocity_b = self.db * w3
        self.velocity_a = self.velocity_b + self.da * w2
        self.still_b = -self.b * w3**2
        self.still_a = self.still_b - b_to_a * w2**2
        self.still_s2 = self.still_b - b_to_s2 * w2**2
        self.load = -1j * crusher.load * jaw

    def accelerations(self, crusher: Crusher, force: complex, moment: float):
        """Return theta3'' and theta2'' under `force` (N) at A and `moment` (N m) on the jaw."""
        c = crusher
        at_s2 = self.load - c.m2 * (self.still_s2 + 1j * c.g)
        at_s3 = -c.m3 * (self.still_b / 2 + 1j * c.g)
        m33 = (c.m2 + c.m3 / 4) * dot(self.db, self.db) + c.j3
        m32 = c.m2 * dot(self.db, self.ds2)
        m22 = c.m2 * dot(self.ds2, self.ds2) + c.j2
        q3 = dot(self.db, at_s2 + force + at_s3 / 2)
        q2 = dot(self.ds2, at_s2) + dot(self.da, force) + moment
        determinant = m33 * m22 - m32**2
        return (m22 * q3 - m32 * q2) / determinant, (m33 * q2 - m32 * q3) / determinant

    def reactions(self, crusher: Crusher, force: complex, accelerations):
        """Return R_B on the jaw and R_C on the toggle, N, by Newton's law."""
        c = crusher
        a3, a2 = accelerations
        of_s2 = self.still_s2 + self.db * a3 + self.ds2 * a2
        of_s3 = (self.still_b + self.db * a3) / 2
        at_b = c.m2 * (of_s2 + 1j * c.g) - self.load - force
        return at_b, c.m3 * (of_s3 + 1j * c.g) + at_b


@dataclass
class Touch:
    """The contact at A."""

    force: complex  # on the jaw, N
    point: complex  # m
    normal: float  # F_n, N
    tangential: float  # F_t, N
    eccentricity: complex  # m
    depth: float  # delta, m


def contact(
    crusher: Crusher,
    pin: complex,
    pin_velocity: complex,
    a: complex,
    velocity_a: complex,
    jaw_spin: float,
    spin: float,
) -> Touch:
    """Return the contact of a pin (m, m/s, rad/s) in the jaw's bore round `a`."""
    c = crusher
    e, rate = pin - a, pin_velocity - velocity_a
    length = abs(e)
    depth = length - c.clearance
    if depth <= 0:
        return Touch(0j, a, 0.0, 0.0, e, depth)
    n = e / length
    t = 1j * n
    fn = normal_force(c, depth, dot(rate, n))
    arm = c.bore + c.overlap * depth
    point = a + arm * n
    if c.friction is None:
        return Touch(fn * n, point, fn, 0.0, e, depth)
    # Velocities of the two bodies' material at that point.
    slip = -dot(rate, t) + arm * jaw_spin - (arm - length) * spin
    ft = -c.friction * ramp(c, slip) * fn * math.copysign(1.0, slip)
    return Touch(fn * n + ft * t, point, fn, ft, e, depth)


def assemble(crusher: Crusher, pin: complex) -> tuple[float, float]:
    """Return (theta3, theta2) with A at `pin`, the elbow to the right."""
    c = crusher
    distance = abs(pin)
    at_c = math.acos((distance**2 + c.l3**2 - c.l2**2) / (2 * distance * c.l3))
    angle = cmath.phase(pin) - at_c
    return -angle, cmath.phase((pin - cmath.rect(c.l3, angle)) / 1j)


def to_move(chain: Chain, velocity: complex) -> tuple[float, float]:
    """Return (x, y) with db x + da y = `velocity`: the rates that give A a velocity."""
    area = cross(chain.db, chain.da)
    return cross(velocity, chain.da) / area, cross(chain.db, velocity) / area


def histories(rows: list[dict]) -> dict[str, np.ndarray]:
    """Gather one array a quantity; that of a vector has shape (times, 2)."""
    return pairs({name: np.array([row[name] for row in rows]) for name in rows[0]})


def pairs(complexes: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Turn histories of complex numbers into those of vectors, shape (times, 2)."""
    return {
        name: values.view(float).reshape(-1, 2) if np.iscomplexobj(values) else values
        for name, values in complexes.items()
    }

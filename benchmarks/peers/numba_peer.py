"""The crusher by hand for numba: eccentricity coordinates, smoothed laws, Dormand-Prince 5(4).

The same right-hand side, tableau, error norm and controller as `jaxcrusher.statistics` with
`diffrax.Dopri5`, in scalar code, so that the two differ in their compiler only. Time is the
shaft's angle. State: e / c (2), e' (m/s, 2), and the integral of |R_O| + |R_C| squared.
"""

import math

import numpy as np

from benchmarks.peers import dopri5
from benchmarks.peers.dopri5 import compiled
from benchmarks.peers.equations import Crusher

# Widths of the smoothed corners, as in jaxcrusher.
NORM_WIDTH, CONTACT_WIDTH, FRICTION_WIDTH, FORCE_WIDTH = 1e-9, 1e-8, 1e-4, 1e-6


def numbers(crusher: Crusher) -> np.ndarray:
    """Return the numbers that the compiled field reads, in its order."""
    c = crusher
    bearing, turn = c.bearing, complex(math.cos(c.jaw_angle), math.sin(c.jaw_angle))
    return np.array([
        c.speed, c.clearance, bearing.real, bearing.imag, c.l1, c.l2, c.l3, c.m1, c.m2, c.m3,
        c.j2, c.j3, c.g, c.load, c.stiffness, 0.75 * (1 - c.restitution**2) / c.impact_velocity,
        0.0 if c.friction is None else c.friction, c.v0, c.v1, c.bore,
        c.l11 * math.cos(c.shaft_angle), c.l11 * math.sin(c.shaft_angle),
        -c.l21 * turn.real, -c.l21 * turn.imag,
    ])  # fmt: skip


@compiled
def _positive(x, width):
    blend = min(max(x + width, 0.0), 2 * width)
    return blend * blend / (4 * width) + max(x - width, 0.0)


@compiled
def field(angle, y, p, rate):
    """Write the rate of `y` by shaft angle into `rate`."""
    (w, c, ox, oy, l1, l2, l3, m1, m2, m3, j2, j3, g, load, k, damping, cf, v0, v1, bore,
     s1x, s1y, s2x, s2y) = p  # fmt: skip
    cosine, sine = math.cos(angle), math.sin(angle)
    ex, ey, ux, uy = c * y[0], c * y[1], y[2], y[3]
    ax, ay = ox + l1 * cosine - ex, oy + l1 * sine - ey
    vx, vy = -l1 * w * sine - ux, l1 * w * cosine - uy
    # Toggle and jaw: unit vectors and spins.
    squared = ax * ax + ay * ay
    share = (squared + l3 * l3 - l2 * l2) / (2 * squared)
    height = -math.sqrt(l3 * l3 / squared - share * share)
    tx, ty = (share * ax - height * ay) / l3, (share * ay + height * ax) / l3
    jx, jy = (ax - l3 * tx) / l2, (ay - l3 * ty) / l2
    lever = tx * jy - ty * jx
    w3 = (vx * jx + vy * jy) / (l3 * lever)
    w2 = -(vx * tx + vy * ty) / (l2 * lever)
    # Contact.
    length = math.sqrt(ex * ex + ey * ey + NORM_WIDTH * NORM_WIDTH)
    nx, ny = ex / length, ey / length
    depth, approach = length - c, ux * nx + uy * ny
    base = _positive(depth, CONTACT_WIDTH)
    normal = k * base * math.sqrt(base) * (1 + damping * approach)
    arm = bore - length
    slip = ux * ny - uy * nx + bore * w2 - arm * w
    ramp = (
        _positive(slip - v0, FRICTION_WIDTH)
        - _positive(slip - v1, FRICTION_WIDTH)
        - _positive(-slip - v0, FRICTION_WIDTH)
        + _positive(-slip - v1, FRICTION_WIDTH)
    ) / (v1 - v0)
    tangential = -cf * normal * ramp
    fx, fy = normal * nx - tangential * ny, normal * ny + tangential * nx
    moment = bore * tangential
    # Lagrange's equations of toggle and jaw.
    rx, ry = l2 * jx + s2x * jx - s2y * jy, l2 * jy + s2x * jy + s2y * jx
    lx, ly = -load * jx, -load * jy - m2 * g
    swing = m2 * l3 * (tx * ry - ty * rx)
    m11 = j3 + (m3 / 4 + m2) * l3 * l3
    m12 = m2 * l3 * (tx * rx + ty * ry)
    m22 = j2 + m2 * (rx * rx + ry * ry)
    q3 = swing * w2 * w2 + l3 * (tx * ly - ty * lx) - m3 * g * l3 / 2 * tx
    q3 += l3 * (tx * fy - ty * fx)
    q2 = -swing * w3 * w3 + rx * ly - ry * lx + l2 * (jx * fy - jy * fx) + moment
    determinant = m11 * m22 - m12 * m12
    a3, a2 = (m22 * q3 - m12 * q2) / determinant, (m11 * q2 - m12 * q3) / determinant
    # Accelerations of B, A and S2; reactions at O and C.
    bx, by = l3 * (-a3 * ty - w3 * w3 * tx), l3 * (a3 * tx - w3 * w3 * ty)
    axx, axy = bx + l2 * (-a2 * jy - w2 * w2 * jx), by + l2 * (a2 * jx - w2 * w2 * jy)
    sx, sy = bx - a2 * ry - w2 * w2 * rx, by + a2 * rx - w2 * w2 * ry
    hx, hy = s1x * cosine - s1y * sine, s1x * sine + s1y * cosine
    at_ox, at_oy = -m1 * w * w * hx + fx, m1 * (g - w * w * hy) + fy
    at_cx = m2 * sx - fx - lx + m3 * bx / 2
    at_cy = m2 * sy - fy - ly + m3 * (by / 2 + g)
    force = math.sqrt(at_ox * at_ox + at_oy * at_oy + FORCE_WIDTH * FORCE_WIDTH)
    force += math.sqrt(at_cx * at_cx + at_cy * at_cy + FORCE_WIDTH * FORCE_WIDTH)
    rate[0], rate[1] = ux / (c * w), uy / (c * w)
    rate[2] = (-l1 * w * w * cosine - axx) / w
    rate[3] = (-l1 * w * w * sine - axy) / w
    rate[4] = force * force / (2 * math.pi)


@compiled
def integrate(y, p, settle, turns, rtol, h, most=1_000_000_000):
    """Integrate `y` over whole turns; return the mean of |R_O| + |R_C| squared and the steps.

    As `dopri5.integrate`, whose compiled code is kept with this.
    """
    return dopri5.integrate(field, y, p, settle, turns, rtol, h, most)

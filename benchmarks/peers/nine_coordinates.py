"""The crusher in nine coordinates with Lagrange multipliers, derived apart from jaxcrusher.

q = (S1, theta1, S2, theta2, S3, theta3), theta3 clockwise. The constraints tie points of two
bodies, so that each pair of multipliers is a reaction: R_O on the shaft, R_B on the jaw, R_C on
the toggle; the last is the drive's torque. M q'' = Q + Phi_q^T lambda, Phi_q q'' = gamma.
"""

import cmath

import numpy as np

from benchmarks.peers.equations import Chain, Crusher, Shaft, contact, cross, histories
from benchmarks.peers.motion import Motion

# Where the paper's coordinates stand among q, and the multipliers after q and q'.
SHAFT, JAW, TOGGLE = slice(0, 3), slice(3, 6), slice(6, 9)
COORDINATES, VELOCITIES, MULTIPLIERS = slice(0, 9), slice(9, 18), slice(18, 25)


def mass_matrix(crusher: Crusher) -> np.ndarray:
    """Return the diagonal of M, kg and kg m2."""
    c = crusher
    return np.array([c.m1, c.m1, c.j1, c.m2, c.m2, c.j2, c.m3, c.m3, c.j3])


def _body(values) -> tuple[complex, float]:
    x, y, angle = values
    return complex(x, y), angle


class Instant:
    """Phi, Phi_q, gamma and the applied forces Q at (q, q'); all vectors in the paper's order."""

    def __init__(self, crusher: Crusher, time: float, q, v):
        """Evaluate all at `time` (s)."""
        c = crusher
        q, v = np.asarray(q).tolist(), np.asarray(v).tolist()
        (s1, t1), (s2, t2), (s3, t3) = (_body(q[body]) for body in (SHAFT, JAW, TOGGLE))
        (u1, w1), (u2, w2), (_, w3) = (_body(v[body]) for body in (SHAFT, JAW, TOGGLE))
        to_s1 = c.l11 * cmath.exp(1j * (t1 + c.shaft_angle))
        s1_to_pin = c.l1 * cmath.exp(1j * t1) - to_s1
        a_to_s2 = -1j * c.l21 * cmath.exp(1j * (t2 + c.jaw_angle))
        b_to_s2 = a_to_s2 + 1j * c.l2 * cmath.exp(1j * t2)
        half = c.l3 / 2 * cmath.exp(-1j * t3)
        closed = [s1 - to_s1 - c.bearing, s2 - b_to_s2 - s3 - half, s3 - half]
        # Rows of O, B and C: the coefficients of S1', theta1', S2', theta2', S3', theta3'.
        rows = [
            (1, -1j * to_s1, 0, 0, 0, 0),
            (0, 0, 1, -1j * b_to_s2, -1, 1j * half),
            (0, 0, 0, 0, 1, 1j * half),
        ]
        gamma = [-(w1**2) * to_s1, -(w2**2) * b_to_s2 - w3**2 * half, -(w3**2) * half]
        self.phi = np.array([*_parts(closed), t1 - c.speed * time])
        self.gamma = np.array([*_parts(gamma), 0.0])
        self.phi_q = np.zeros((7, 9))
        for i, row in enumerate(rows):
            for body in range(3):
                shift, turn = complex(row[2 * body]), complex(row[2 * body + 1])
                self.phi_q[2 * i : 2 * i + 2, 3 * body : 3 * body + 2] = shift.real * np.eye(2)
                self.phi_q[2 * i : 2 * i + 2, 3 * body + 2] = turn.real, turn.imag
        self.phi_q[6, 2] = 1.0
        pin, pin_velocity = s1 + s1_to_pin, u1 + 1j * w1 * s1_to_pin
        a, velocity_a = s2 - a_to_s2, u2 - 1j * w2 * a_to_s2
        self.touch = touch = contact(c, pin, pin_velocity, a, velocity_a, w2, w1)
        at_s2 = touch.force - 1j * c.load * cmath.exp(1j * t2) - 1j * c.m2 * c.g
        self.force = np.array(
            [
                -touch.force.real,
                -touch.force.imag - c.m1 * c.g,
                -cross(touch.point - s1, touch.force),
                at_s2.real,
                at_s2.imag,
                cross(touch.point - s2, touch.force),
                0.0,
                -c.m3 * c.g,
                0.0,
            ]
        )

    def solve(self, masses) -> np.ndarray:
        """Return accelerations q'' and multipliers."""
        system = np.block([[np.diag(masses), -self.phi_q.T], [self.phi_q, np.zeros((7, 7))]])
        return np.linalg.solve(system, np.concatenate([self.force, self.gamma]))


def _parts(vectors) -> list[float]:
    return [part for vector in vectors for part in (vector.real, vector.imag)]


def start(motion: Motion) -> tuple[np.ndarray, np.ndarray]:
    """Return (q, q', lambda) at the motion's start, and its derivative, zero for lambda."""
    c = motion.crusher
    t3, t2, w3, w2 = motion.start[:4]
    shaft, chain = Shaft(c, 0.0, c.speed), Chain(c, (t3, t2), (w3, w2))
    s2 = chain.b - 1j * chain.ds2
    u2 = chain.db * w3 + chain.ds2 * w2
    u1 = 1j * c.speed * shaft.to_s1
    s1 = c.bearing + shaft.to_s1
    q = [*_parts([s1]), 0.0, *_parts([s2]), t2, *_parts([chain.b / 2]), t3]
    v = [*_parts([u1]), c.speed, *_parts([u2]), w2, *_parts([chain.velocity_b / 2]), w3]
    solution = Instant(c, 0.0, q, v).solve(mass_matrix(c))
    return (np.concatenate([q, v, solution[9:]]), np.concatenate([v, solution[:9], np.zeros(7)]))


def observe(crusher: Crusher, times, states) -> dict[str, np.ndarray]:
    """Return histories: contact, reactions from the multipliers, largest constraint residual."""
    rows = []
    for time, y in zip(np.asarray(times).tolist(), states, strict=True):
        now = Instant(crusher, time, y[COORDINATES], y[VELOCITIES])
        ox, oy, bx, by, cx, cy, torque = y[MULTIPLIERS].tolist()
        rows.append(
            {
                "contact_force": abs(now.touch.force),
                "normal_force": now.touch.normal,
                "friction_force": now.touch.tangential,
                "eccentricity": now.touch.eccentricity,
                "bearing_reaction": complex(ox, oy),
                "elbow_reaction": complex(bx, by),
                "toggle_reaction": complex(cx, cy),
                "foundation_force": abs(complex(ox, oy)) + abs(complex(cx, cy)),
                "drive_torque": torque,
                "constraint_residual": abs(now.phi).max(),
            }
        )
    return histories(rows)

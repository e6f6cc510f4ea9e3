"""The four-bar of the examples against two bars by hand, in both formulations."""

import cmath
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import jaxcrusher as jc
from benchmarks.peers.loose_joint import Body, LooseJoint
from jaxcrusher.scenes.linkages import read_linkage

FILE = Path(__file__).parents[2] / "examples" / "four_bar.toml"
# The peer's contact law has its speeds of friction fixed at these.
CHANGED = {"start": "centred", "joints.B.static_speed": 0.1, "joints.B.full_speed": 1.0}
GRAVITY, CRANK, COUPLER, ROCKER, BASE = 9.81, 0.1, 0.3, 0.25, 0.3
TIMES = np.linspace(0, 0.03, 601)


class Bars:
    """Coupler (held by the crank's pin A) and rocker (by D), each with one angle, loose at B."""

    def __init__(self, of):
        names = "clearance bore_radius friction restitution impact_velocity young poisson slip"
        self.joint = LooseJoint(**{name: of[f"joints.B.{name}"] for name in names.split()})
        self.speed = of["speed"]
        self.coupler = of["bodies.coupler.mass"], of["bodies.coupler.inertia"], 0.15
        self.rocker = of["bodies.rocker.mass"], of["bodies.rocker.inertia"], 0.125

    def start(self):
        """Angles by the law of cosines, the coupler to the left of A-D, and their rates."""
        third = BASE - CRANK + 0j
        corner = np.arccos((abs(third) ** 2 + COUPLER**2 - ROCKER**2) / (2 * third.real * COUPLER))
        one = cmath.phase(third) + corner
        b = CRANK + cmath.rect(COUPLER, one)
        other = cmath.phase(b - BASE)
        u, v = cmath.exp(1j * one), cmath.exp(1j * other)
        columns = np.array([1j * COUPLER * u, -1j * ROCKER * v])
        matrix = np.array([columns.real, columns.imag])
        rates = np.linalg.solve(matrix, [0.0, -self.speed * CRANK])
        return np.array([one, other, *rates])

    def at(self, time, y):
        """Bodies after the contact has pushed them, the touch, and the acceleration of A."""
        one, other, spin, spun = y
        pin = cmath.rect(CRANK, self.speed * time)
        pin_rate = 1j * self.speed * pin
        bodies = []
        for hinge, rate, angle, turning, (mass, _, arm) in (
            (pin, pin_rate, one, spin, self.coupler),
            (BASE + 0j, 0j, other, spun, self.rocker),
        ):
            to = cmath.rect(arm, angle)
            body = Body(hinge + to, rate + 1j * turning * to, angle, turning)
            body.push(-1j * GRAVITY * mass, body.centre)
            bodies.append((hinge, body))
        (_, coupler), (_, rocker) = bodies
        ends = pin + cmath.rect(COUPLER, one), BASE + cmath.rect(ROCKER, other)
        touch = self.joint.push_apart(coupler, rocker, *ends)
        return bodies, touch, -(self.speed**2) * pin

    def rate(self, time, y):
        """Moments about what holds each bar: (J + m d^2) w' = M - m d x a of its hinge."""
        bodies, _, second = self.at(time, y)
        found = []
        both = zip(bodies, (self.coupler, self.rocker), (second, 0j), strict=True)
        for (hinge, body), (mass, inertia, arm), a in both:
            to = body.centre - hinge
            moment = body.moment + (to.conjugate() * (body.force - mass * a)).imag
            found.append(moment / (inertia + mass * arm**2))
        return np.array([y[2], y[3], *found])


@pytest.mark.parametrize("formulation", ["eccentricity", "multiplier"])
def test_impacts_of_a_four_bar_by_hand(formulation):
    """Some ten impacts in 30 ms, pointwise."""
    drawing, values, _ = read_linkage(FILE)
    values = values | CHANGED | {"formulation": formulation}
    bars = Bars(values)
    # A hundredth of the shortest contact; tolerances of an angle of 1 rad on arms of 0.3 m.
    how = {"t_eval": TIMES, "rtol": 1e-12, "atol": 1e-13, "max_step": 1e-5}
    hand = solve_ivp(bars.rate, (0, TIMES[-1]), bars.start(), "DOP853", **how)
    seen = [bars.at(time, y)[1] for time, y in zip(TIMES, hand.y.T, strict=True)]
    by_hand = np.array([touch.eccentricity for touch in seen])
    force = np.array([touch.normal for touch in seen])
    outputs = ("B_eccentricity", "B_normal_force")
    motion = jc.simulate(drawing(**values), TIMES, outputs=outputs, rtol=1e-12)
    assert bool(motion.success), motion.failure
    own = motion.B_eccentricity @ np.array([1, 1j])
    assert np.sum(np.diff((force > 0).astype(int)) > 0) >= 5
    # Corners of contact and friction are sharp by hand, and rounding of 1e-16 rad is 3e-13
    # clearances; both grow a hundred times and more over the impacts.
    assert np.abs(own - by_hand).max() < 1e-5 * 1e-4
    assert np.abs(motion.B_normal_force - force).max() < 1e-4 * force.max()

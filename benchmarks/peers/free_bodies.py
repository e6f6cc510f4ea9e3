"""The crusher with clearance in O, A, B and C, or in any of them, as free bodies.

Jaw and toggle are free in the plane (x, y and angle each, counterclockwise), and so is the shaft's
axis; the shaft turns at constant speed, the frame stands. An ideal joint is two constraints on
accelerations. Origin at C; vectors of the plane are complex numbers, as in `equations`; SI units.

Positions of 1 m carry penetrations of 1e-6 m. By `scipy_peer` at rtol 1e-13 the eccentricities of
three loose joints are within 2e-9 clearances after 10 ms, and 2e-7 after 20 ms.
"""

import cmath
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from benchmarks.peers.equations import dot, histories
from benchmarks.peers.loose_joint import Body, LooseJoint, Touch

# The prefix of a joint's numbers: the main bearing's have none.
PREFIXES = {"A": "", "B": "elbow.", "C": "pivot.", "O": "shaft_bearing."}
# Radius of the bore at O where a description has none, m.
SHAFT_BORE = 0.07
# For the others where a description has none; Young's modulus and Poisson's ratio are those of A.
DEFAULTS = {"bore_radius": 0.04, "friction": 0.1, "restitution": 0.9, "impact_velocity": 0.5}
# The only ones here.
LAWS = dict(load_law="along_jaw", contact_law="lankarani_nikravesh", impact_law="constant")
WORKS = ("drive_work", "load_work", "damping_loss", "friction_loss")
# Rows of the moving bodies in the constraints.
ROWS = {"jaw": slice(0, 3), "toggle": slice(3, 6), "shaft": slice(6, 8)}


@dataclass(frozen=True)
class Instant:
    """The accelerations, forces and powers at a time and state."""

    accelerations: np.ndarray  # of x, y and angle of jaw and toggle, of x and y of the shaft's axis
    forces: dict[str, complex]  # on the bore's body by joint, N
    touches: dict[str, Touch]  # of the loose joints
    energy: float  # of jaw, toggle and their contacts, J
    powers: list[float]  # the rates of WORKS, W


@dataclass
class FreeBodies:
    """A motion from eccentricities `e` (m) and `rates` (m/s) by joint, 0 where not named.

    `numbers` are those of a description, by name. A joint without a `clearance` is ideal, and A
    is if its `joint` is "ideal". A state has x, y and angle of jaw and toggle (the directions of
    B-A and C-B), x and y of the shaft's axis, their rates, and the works of `WORKS` (J).
    """

    numbers: Mapping[str, Any]
    e: dict[str, complex] = field(default_factory=dict)
    rates: dict[str, complex] = field(default_factory=dict)

    def __post_init__(self):
        """Numbers of the bodies; centres of bores and pins in their bodies' axes."""
        of = self.numbers
        for name, choice in LAWS.items():
            if of.get(name, choice) != choice:
                raise ValueError(f"Argument `{name}` must be {choice!r}, but is {of[name]!r}.")
        self.shaft_mass = of["shaft.mass"] + of["counterweight.mass"]
        s1 = cmath.rect(of["shaft.mass_centre_radius"], of["shaft.mass_centre_angle"])
        counterweight = cmath.rect(of["counterweight.radius"], of["counterweight.angle"])
        self.unbalance = of["shaft.mass"] * s1 + of["counterweight.mass"] * counterweight
        self.bearing = 1j * cmath.rect(of["bearing.distance"], -of["bearing.inclination"])
        to_a = cmath.rect(of["jaw.mass_centre_distance"], of["jaw.mass_centre_angle"])
        half = of["toggle.length"] / 2 + 0j
        self.joints = {
            "A": ("jaw", to_a, "shaft", of["shaft.eccentricity"] + 0j),
            "B": ("jaw", to_a - of["jaw.length"], "toggle", half),
            "C": ("frame", 0j, "toggle", -half),
            "O": ("frame", self.bearing, "shaft", 0j),
        }
        self.laws = {joint: self._law(prefix) for joint, prefix in PREFIXES.items()}

    def _law(self, prefix: str) -> LooseJoint | None:
        of = self.numbers
        if prefix + "clearance" not in of or (not prefix and of.get("joint") == "ideal"):
            return None
        usual = DEFAULTS | {name: of[name] for name in ("young", "poisson")}
        if prefix == PREFIXES["O"]:
            usual["bore_radius"] = SHAFT_BORE
        values = {name: of.get(prefix + name, value) for name, value in usual.items()}
        return LooseJoint(clearance=of[prefix + "clearance"], slip=of["slip"], **values)

    @cached_property
    def start(self) -> np.ndarray:
        """The state at time 0."""
        of = self.numbers
        e_a, e_b, e_c, e_o = (self.e.get(joint, 0j) for joint in self.joints)
        rate_a, rate_b, rate_c, rate_o = (self.rates.get(joint, 0j) for joint in self.joints)
        toggle, jaw = of["toggle.length"], of["jaw.length"]
        crank = of["shaft.eccentricity"] + 0j
        # Toggle and jaw are two sides of a triangle, the elbow to the right of the third.
        pin, pin_rate = self.bearing + e_o + crank, rate_o + 1j * of["speed"] * crank
        third = pin - e_a + e_b - e_c
        moving = pin_rate - rate_a + rate_b - rate_c
        corner = math.acos((abs(third) ** 2 + toggle**2 - jaw**2) / (2 * abs(third) * toggle))
        c_to_b = cmath.rect(toggle, cmath.phase(third) - corner)
        b_to_a = third - c_to_b
        matrix = [[-c_to_b.imag, -b_to_a.imag], [c_to_b.real, b_to_a.real]]
        toggle_spin, jaw_spin = np.linalg.solve(matrix, [moving.real, moving.imag])
        s2_to_a = self.joints["A"][1] * b_to_a / jaw
        s2, s3 = pin - e_a - s2_to_a, e_c + c_to_b / 2
        u2 = pin_rate - rate_a - 1j * jaw_spin * s2_to_a
        u3 = rate_c + 1j * toggle_spin * c_to_b / 2
        places = [s2.real, s2.imag, cmath.phase(b_to_a), s3.real, s3.imag, cmath.phase(c_to_b)]
        speeds = [u2.real, u2.imag, jaw_spin, u3.real, u3.imag, toggle_spin]
        axis = self.bearing + e_o
        places += [axis.real, axis.imag]
        speeds += [rate_o.real, rate_o.imag]
        return np.array([*places, *speeds, *np.zeros(len(WORKS))])

    def instant(self, time: float, y) -> Instant:
        """Solve Newton's and Euler's laws."""
        of = self.numbers
        x2, y2, t2, x3, y3, t3, x1, y1, u2, v2, w2, u3, v3, w3, u1, v1 = y[:16].tolist()
        jaw = Body(complex(x2, y2), complex(u2, v2), t2, w2)
        toggle = Body(complex(x3, y3), complex(u3, v3), t3, w3)
        shaft = Body(complex(x1, y1), complex(u1, v1), of["speed"] * time, of["speed"])
        bodies = {"frame": Body(0j, 0j, 0.0, 0.0), "shaft": shaft, "jaw": jaw, "toggle": toggle}
        load = -of["load"] * jaw.axis
        jaw.push(load - 1j * of["gravity"] * of["jaw.mass"], jaw.centre)
        toggle.push(-1j * of["gravity"] * of["toggle.mass"], toggle.centre)
        # The shaft's mass centre turns about its axis, of which the equations are.
        of_mass = of["speed"] ** 2 * self.unbalance * shaft.axis
        shaft.push(of_mass - 1j * of["gravity"] * self.shaft_mass, shaft.centre)
        touches, closed, rows, gamma = {}, [], [], []
        for joint, (bore, bore_point, pin, pin_point) in self.joints.items():
            arms = {bore: bodies[bore].axis * bore_point, pin: bodies[pin].axis * pin_point}
            law = self.laws[joint]
            if law is not None:
                centres = [bodies[name].centre + arm for name, arm in arms.items()]
                touches[joint] = law.push_apart(bodies[bore], bodies[pin], *centres)
                continue
            row, known = constraint(arms, bodies)
            closed.append(joint)
            rows.append(row)
            gamma += [known.real, known.imag]
        moving = ("jaw", "toggle")
        m2, j2, m3, j3 = (of[f"{b}.{what}"] for b in moving for what in ("mass", "inertia"))
        applied = [part for b in (jaw, toggle) for part in (b.force.real, b.force.imag, b.moment)]
        applied += [shaft.force.real, shaft.force.imag]
        phi, count = np.concatenate([np.zeros((0, 8)), *rows]), len(gamma)
        masses = np.diag([m2, m2, j2, m3, m3, j3, self.shaft_mass, self.shaft_mass])
        system = np.block([[masses, -phi.T], [phi, np.zeros((count, count))]])
        solution = np.linalg.solve(system, [*applied, *gamma])
        forces = {joint: touch.force for joint, touch in touches.items()}
        forces |= {j: complex(*solution[8 + 2 * i : 10 + 2 * i]) for i, j in enumerate(closed)}
        pin = shaft.centre + shaft.axis * self.joints["A"][3]
        driven = shaft.velocity_at(touches["A"].place if "A" in touches else pin)
        kinetic = (m2 * abs(jaw.velocity) ** 2 + j2 * w2**2) / 2
        kinetic += (m3 * abs(toggle.velocity) ** 2 + j3 * w3**2) / 2
        potential = of["gravity"] * (m2 * y2 + m3 * y3)
        between = [touch for joint, touch in touches.items() if joint != "O"]
        return Instant(
            solution[:8],
            forces,
            touches,
            kinetic + potential + sum(touch.elastic_energy for touch in between),
            [
                dot(forces["A"], driven),
                dot(load, jaw.velocity),
                sum(touch.damping_loss for touch in between),
                sum(touch.friction_loss for touch in between),
            ],
        )

    def field(self, time: float, y) -> np.ndarray:
        """Return the rate y'."""
        now = self.instant(time, y)
        return np.concatenate([y[8:16], now.accelerations, now.powers])

    def corners(self, time: float, y) -> list[float]:
        """Return numbers that pass zero where a law has a corner."""
        touches = self.instant(time, y).touches.values()
        return [corner for touch in touches for corner in touch.corners]

    def observe(self, times, states) -> dict[str, np.ndarray]:
        """Return histories at `times` (s), with the prefixes of the joints' numbers.

        `eccentricity` (m) and `normal_force` (N) of each loose joint; `joint_force` on the jaw at
        A, `elbow_reaction` on the jaw at B, `toggle_reaction` of the frame on the toggle at C,
        `bearing_reaction` R_O on the shaft (N); `energy` and `WORKS` (J) of jaw and toggle, and the
        `imbalance` of the two, that is, their error.
        """
        rows = []
        for time, y in zip(np.asarray(times).tolist(), states, strict=True):
            now = self.instant(time, y)
            row = {
                "joint_force": now.forces["A"],
                "elbow_reaction": now.forces["B"],
                "toggle_reaction": -now.forces["C"],
                "bearing_reaction": -now.forces["O"],
                "energy": now.energy,
                **dict(zip(WORKS, y[16:], strict=True)),
            }
            for joint, touch in now.touches.items():
                row[PREFIXES[joint] + "eccentricity"] = touch.eccentricity
                row[PREFIXES[joint] + "normal_force"] = touch.normal
            rows.append(row)
        known = histories(rows)
        drive, load, damping, friction = (known[work] for work in WORKS)
        gained = known["energy"] - known["energy"][0]
        return known | {"imbalance": gained - drive - load + damping + friction}


def constraint(arms: dict[str, complex], bodies: dict[str, Body]) -> tuple[np.ndarray, complex]:
    """Return Phi_q and gamma of a joint: two ends of `arms` (m), by body, accelerate alike.

    Coefficients of the accelerations, shape (2, 8), and what their sum must be. The shaft's spin
    does not change.
    """
    row, known = np.zeros((2, 8)), 0j
    for (name, arm), sign in zip(arms.items(), (1, -1), strict=True):
        known += sign * bodies[name].spin ** 2 * arm
        if name in ROWS:
            full = sign * np.array([[1, 0, -arm.imag], [0, 1, arm.real]])
            row[:, ROWS[name]] = full[:, :2] if name == "shaft" else full
    return row, known

"""A slider-crank whose guide has a gap or rubs, as free bodies in absolute coordinates by NumPy.

Ideal joints, the drive and a guide without a gap are constraints, whose forces are found together
with the accelerations. Numbers are named as in a description whose joints are O (frame, crank), A
(rod, crank) and B (rod, slider), by bore and pin, and whose slide is called guide. Vectors of the
plane are complex numbers; those on the guide are ahead and to the left. SI units.
"""

import math
from collections.abc import Mapping
from functools import cached_property
from typing import Any

import numpy as np

from benchmarks.peers.loose_joint import V0, V1

BODIES = CRANK, ROD, SLIDER = "crank", "rod", "slider"
JOINTS = ("O", None, CRANK), ("A", ROD, CRANK), ("B", ROD, SLIDER)
# Rows of the constraints: two of each joint, the drive, and the guide's line and angle.
DRIVE, GUIDE = 6, 7
# The corners: in front on the left, in front on the right, and the same behind.
FRONT, LEFT = np.array([1, 1, -1, -1]), np.array([1, -1, 1, -1])
# Friction has come to rest where it changes by this share of the largest force.
ROUNDING = 1e-15


def moment_of(force, arm):
    """Return the moment of a force at an arm."""
    return (np.conj(arm) * force).imag


class SliderCrank:
    """The motion of one, as `scipy_peer` takes it: x, y and angle of all bodies, and their rates.

    A slider with a gap begins in the middle of its guide, straight, and without a rate of its own.
    One without is where the crank's angle puts it.
    """

    def __init__(self, values: Mapping[str, Any]):
        def at(name: str) -> complex:
            return complex(values.get(f"{name}.x", 0.0), values.get(f"{name}.y", 0.0))

        def guide(name: str, default: float = 0.0) -> float:
            return values.get(f"slides.guide.{name}", default)

        centres = {body: at(f"bodies.{body}.mass_centre") for body in BODIES} | {None: 0j}
        names = "mass", "mass", "inertia"
        self.inertias = np.array([values[f"bodies.{body}.{of}"] for body in BODIES for of in names])
        self.weights = -values.get("gravity", 9.81) * self.inertias * np.tile([0, 1, 0], 3)
        self.speed, along = values["speed"], at("slides.guide.along")
        self.along, self.through = along / abs(along), at("slides.guide.through")
        self.to_origin = -centres[SLIDER]
        # Row, sign, number of the body, and arm from its mass centre of both ends of the joints.
        self.ends = [
            (
                2 * k,
                sign,
                None if body is None else BODIES.index(body),
                at(f"joints.{name}.{end}") - centres[body],
            )
            for k, (name, *both) in enumerate(JOINTS)
            for sign, end, body in zip((-1, 1), ("bore", "pin"), both, strict=True)
        ]
        self.rod = at("joints.B.bore") - at("joints.A.bore")
        self.length, self.height = guide("length"), guide("height")
        self.shape = (FRONT * self.length + 1j * LEFT * self.height) / 2
        self.clearance = guide("clearance")
        self.ramp = guide("friction"), guide("static_speed", V0), guide("full_speed", V1)
        if self.clearance:
            compliance = 2 * (1 - guide("poisson") ** 2) / guide("young")
            self.stiffness = 4 / (3 * compliance) * math.sqrt(guide("corner_radius"))  # N/m^1.5
            self.damping = 0.75 * (1 - guide("restitution") ** 2) / guide("impact_velocity")

    def constraints(self, time: float, y) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return rows by accelerations, what they come to, and by how much they are not kept."""
        rows, known, gaps = np.zeros((9, 9)), np.zeros(9), np.zeros(9)

        def put(row: int, way: complex, body: int, arm: complex):
            """Count how a point of a body moves in a way."""
            x, back = 3 * body, way.conjugate()
            arm *= complex(math.cos(y[x + 2]), math.sin(y[x + 2]))
            rows[row, x : x + 3] = way.real, way.imag, (back * 1j * arm).real
            known[row] += y[x + 11] ** 2 * (back * arm).real
            gaps[row] += (back * (complex(y[x], y[x + 1]) + arm)).real

        for row, sign, body, arm in self.ends:
            for place, way in ((row, sign + 0j), (row + 1, 1j * sign)):
                if body is None:
                    gaps[place] += (way.conjugate() * arm).real
                else:
                    put(place, way, body, arm)
        rows[DRIVE, 2], gaps[DRIVE] = 1.0, y[2] - self.speed * time
        put(GUIDE, 1j * self.along, 2, self.to_origin)
        gaps[GUIDE] -= (self.through / self.along).imag
        rows[GUIDE + 1, 8], gaps[GUIDE + 1] = 1.0, y[8]
        return rows, known, gaps

    def together(self, time: float) -> np.ndarray:
        """Return the state with the slider straight on its line, the rod ahead of the crank."""
        y, rates = np.zeros(18), np.zeros(9)
        y[2], y[5] = self.speed * time, np.angle(self.along / self.rod)
        for _ in range(50):
            rows, _, gaps = self.constraints(time, y)
            step = np.linalg.solve(rows, -gaps)
            y[:9] += step
            if abs(step).max() < 1e-15:
                break
        rates[DRIVE] = self.speed
        y[9:] = np.linalg.solve(rows, rates)
        return y

    @cached_property
    def start(self) -> np.ndarray:
        """The state at time 0."""
        return self.together(0.0)

    def slider(self, y) -> tuple[complex, complex, complex]:
        """Return place and velocity of its origin, from the guide, and how far it has turned."""
        turn = complex(math.cos(y[8]), math.sin(y[8]))
        arm = self.to_origin * turn
        velocity = complex(y[15], y[16]) + 1j * y[17] * arm
        return (complex(y[6], y[7]) + arm - self.through) / self.along, velocity / self.along, turn

    def friction(self, normal, speed):
        """Return Ambrosio's friction on the guide, ahead, of a slider with a speed ahead."""
        coefficient, v0, v1 = self.ramp
        return coefficient * normal * np.sign(speed) * np.clip((abs(speed) - v0) / (v1 - v0), 0, 1)

    def corners(self, time: float, y) -> np.ndarray:
        """Return how deep each corner is in its edge, m."""
        place, _, turn = self.slider(y)
        return LEFT * (place + turn * self.shape).imag - self.height / 2 - self.clearance

    def contact(self, time: float, y) -> tuple[complex, float]:
        """Return the force of the corners on their edges, and its moment about the origin."""
        _, velocity, turn = self.slider(y)
        arms, deep = turn * self.shape, np.maximum(self.corners(time, y), 0.0)
        moving = velocity + 1j * y[17] * arms
        normal = self.stiffness * deep**1.5 * (1 + self.damping * LEFT * moving.imag)
        forces = 1j * LEFT * normal + self.friction(normal, moving.real)
        return complex(forces.sum()), float(moment_of(forces, arms).sum())

    def solved(self, rows, known, y, force: complex, moment: float):
        """Return accelerations and forces of constraints, where a slider acts on its guide."""
        matrix, forces, n = np.zeros((9 + len(rows),) * 2), self.weights.copy(), 9
        force, arm = -force * self.along, self.to_origin * self.slider(y)[2]
        forces[6:] += force.real, force.imag, moment_of(force, arm) - moment
        matrix[:n, :n], matrix[:n, n:], matrix[n:, :n] = np.diag(self.inertias), -rows.T, rows
        found = np.linalg.solve(matrix, np.concatenate([forces, known]))
        return found[:n], found[n:]

    def instant(self, time: float, y):
        """Return accelerations, forces of constraints, force and moment on the guide.

        Without a gap its friction is found by iteration; RuntimeError where that does not end.
        """
        rows, known, _ = self.constraints(time, y)
        if self.clearance:
            acting = self.contact(time, y)
            return *self.solved(rows[:GUIDE], known[:GUIDE], y, *acting), *acting
        rubbing, speed = 0.0, self.slider(y)[1].real
        for _ in range(500):
            found, held = self.solved(rows, known, y, rubbing, 0.0)
            left, moment = -held[GUIDE:]
            turning = 2 * moment / self.length if self.length else 0.0
            pressed = abs(left + turning) / 2 + abs(left - turning) / 2
            before, rubbing = rubbing, self.friction(pressed, speed)
            if abs(rubbing - before) <= ROUNDING * abs(held[:DRIVE]).max():
                return found, held, complex(rubbing, left), moment
        raise RuntimeError(f"Friction at {time} s does not come to rest: the slider jams.")

    def field(self, time: float, y) -> np.ndarray:
        """Return the rate y'."""
        return np.concatenate([y[9:], self.instant(time, y)[0]])

    def observe(self, times, states) -> dict[str, np.ndarray]:
        """Return places (m), forces (N) and moments (N m) by the names of a scene's."""
        found: dict[str, list] = {}
        rubbing = "guide_friction_force" if self.clearance else "guide_friction"
        for time, y in zip(times, states, strict=True):
            _, held, force, moment = self.instant(time, y)
            row = {"guide_force": force.imag, "guide_moment": moment, rubbing: force.real}
            row |= {"A_reaction": -held[2:4], "B_reaction": -held[4:6], "drive_torque": held[DRIVE]}
            row["slider_position"] = y[6:8]
            if self.clearance:
                row["guide_eccentricity"] = self.slider(y)[0].imag, y[8] * self.length / 2
            for name, value in row.items():
                found.setdefault(name, []).append(value)
        return {name: np.array(values) for name, values in found.items()}

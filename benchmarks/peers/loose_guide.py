"""A slider-crank as free bodies in absolute coordinates, its guide with a gap or with friction.

By NumPy and SciPy alone, from the mechanics: bodies, joints and the drive are constraints on
accelerations, corners of the slider are points of the world, each with its distance from its edge,
and the friction of a guide without a gap is what the reactions under it come to. Laws are those
that are published, not smoothed. Vectors of the plane are complex numbers; SI units.
"""

import cmath
import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from benchmarks.peers.loose_joint import cross, dot

CRANK, ROD, SLIDER = range(3)
# Rounds of friction and reactions at most: each gains what friction feeds back, some hundredths.
ROUNDS = 60


@dataclass
class GuidedSlider:
    """The motion of a slider-crank by the numbers of a description, such as `machine.values`."""

    values: Mapping[str, Any]

    def _at(self, name: str) -> complex:
        return complex(self.values.get(f"{name}.x", 0.0), self.values.get(f"{name}.y", 0.0))

    def _guide(self, name: str) -> float:
        return float(self.values[f"slides.guide.{name}"])

    @property
    def has_gap(self) -> bool:
        """Whether the slider is loose in its guide."""
        return "slides.guide.clearance" in self.values

    @cached_property
    def ahead(self) -> complex:
        """The unit vector along the slide."""
        along = self._at("slides.guide.along")
        return along / abs(along)

    @cached_property
    def masses(self) -> np.ndarray:
        """Mass, mass and inertia of each body."""
        found = []
        for body in ("crank", "rod", "slider"):
            mass, inertia = (self.values[f"bodies.{body}.{of}"] for of in ("mass", "inertia"))
            found += [mass, mass, inertia]
        return np.array(found)

    @cached_property
    def origins(self) -> list[complex]:
        """Each body's origin from its mass centre."""
        return [-self._at(f"bodies.{body}.mass_centre") for body in ("crank", "rod", "slider")]

    @cached_property
    def joints(self) -> list[tuple[int, complex, int, complex]]:
        """Body and point from its mass centre of each side of O, A and B; body -1 is the frame."""
        o, at = self.origins, self._at
        return [
            (-1, at("joints.O.bore"), CRANK, at("joints.O.pin") + o[CRANK]),
            (ROD, at("joints.A.bore") + o[ROD], CRANK, at("joints.A.pin") + o[CRANK]),
            (ROD, at("joints.B.bore") + o[ROD], SLIDER, at("joints.B.pin") + o[SLIDER]),
        ]

    @cached_property
    def start(self) -> np.ndarray:
        """The state at crank angle zero, the slider straight and in the middle: y, then y'."""
        (_, o, _, o_pin), (_, a_rod, _, a_crank), (_, b_rod, _, b_slider) = self.joints
        speed, along = self.values["speed"], self.ahead
        z_crank = o - o_pin
        a, a_rate = z_crank + a_crank, 1j * speed * (a_crank - o_pin)
        # B on its line: through + way ahead + its place on the slider, at the rod's length from A.
        on_line = self._at("slides.guide.through") + b_slider - self.origins[SLIDER]
        foot = (on_line - a) / along
        length = abs(b_rod - a_rod)
        way = -foot.real + math.sqrt(length**2 - foot.imag**2)
        b = on_line + way * along
        axis = (b - a) / (b_rod - a_rod)
        # The rates of b - a along and across: the rod turns, the slider goes ahead.
        u = b - a
        spin = dot(a_rate, 1j * along) / -dot(1j * u, 1j * along)
        going = a_rate + 1j * spin * u
        z_rod, z_slider = a - axis * a_rod, b - b_slider
        rod_rate = a_rate - 1j * spin * axis * a_rod
        crank_rate = -1j * speed * o_pin
        places = [(z_crank, 0.0), (z_rod, cmath.phase(axis)), (z_slider, 0.0)]
        rates = [(crank_rate, speed), (rod_rate, spin), (going, 0.0)]
        return np.array([part for z, p in (*places, *rates) for part in (z.real, z.imag, p)])

    def instant(self, y: np.ndarray) -> tuple[np.ndarray, dict[str, Any]]:
        """Return the accelerations, and what acts on the guide and in B."""
        z = [complex(y[3 * i], y[3 * i + 1]) for i in range(3)]
        v = [complex(y[9 + 3 * i], y[10 + 3 * i]) for i in range(3)]
        axis, spin = (
            [cmath.exp(1j * y[3 * i + 2]) for i in range(3)],
            [y[11 + 3 * i] for i in range(3)],
        )
        forces = np.zeros(9)
        forces[1::3] = -self.values.get("gravity", 9.81) * self.masses[1::3]
        rows, right = [], []

        def point(body: int, arm: complex, sign: float, across: complex | None = None):
            """Add the acceleration of a point, or its part in a direction, to the last rows."""
            arm = arm * axis[body]
            for row, way in zip(
                rows[-2:] if across is None else rows[-1:],
                (1.0, 1j) if across is None else (across,),
                strict=True,
            ):
                row[3 * body] += sign * dot(way, 1.0 + 0j)
                row[3 * body + 1] += sign * dot(way, 1j)
                row[3 * body + 2] += sign * dot(way, 1j * arm)
            return sign * spin[body] ** 2 * arm

        for bore, on_bore, pin, on_pin in self.joints:
            rows += [np.zeros(9), np.zeros(9)]
            known = point(pin, on_pin, 1.0)
            if bore >= 0:
                known += point(bore, on_bore, -1.0)
            right += [known.real, known.imag]
        rows.append(np.eye(9)[2])  # the crank's speed stays
        right.append(0.0)
        origin = z[SLIDER] + axis[SLIDER] * self.origins[SLIDER]
        going = v[SLIDER] + 1j * spin[SLIDER] * (origin - z[SLIDER])
        told: dict[str, Any] = {"way": dot(origin, self.ahead)}
        if self.has_gap:
            push, moment = self._pushed(origin, going, y[8], spin[SLIDER])
            acting = self._on_slider(-push, -moment, origin - z[SLIDER])
            told |= {"force": dot(push, 1j * self.ahead), "moment": moment}
            found, held = self._solve(rows, right, forces + acting)
        else:
            rows.append(np.zeros(9))
            known = point(SLIDER, self.origins[SLIDER], 1.0, 1j * self.ahead)
            rows.append(np.eye(9)[8])
            right += [dot(known, 1j * self.ahead), 0.0]
            rubbed = 0.0
            for _ in range(ROUNDS):
                acting = self._on_slider(-rubbed * self.ahead, 0.0, origin - z[SLIDER])
                found, held = self._solve(rows, right, forces + acting)
                # Multipliers are the frame's force on the slider, and the moment.
                force, moment = -held[7], -held[8]
                before, rubbed = rubbed, self._rubbed(force, moment, dot(going, self.ahead))
                if abs(rubbed - before) <= 1e-15 * abs(force):
                    break
            told |= {"force": force, "moment": moment, "friction": rubbed}
        told["B"] = complex(-held[4], -held[5])
        return found, told

    def _solve(self, rows, right, forces) -> tuple[np.ndarray, np.ndarray]:
        phi = np.array(rows)
        light = phi / self.masses
        held = np.linalg.solve(light @ phi.T, np.array(right) - light @ forces)
        return (forces + phi.T @ held) / self.masses, held

    def _on_slider(self, force: complex, moment: float, arm: complex) -> np.ndarray:
        found = np.zeros(9)
        found[6:] = force.real, force.imag, moment + cross(arm, force)
        return found

    def _share(self, speed: float) -> float:
        """Ambrosio's friction of 1 N, against a speed."""
        if "slides.guide.friction" not in self.values:
            return 0.0
        slow, full = self._guide("static_speed"), self._guide("full_speed")
        ramp = min(max((abs(speed) - slow) / (full - slow), 0.0), 1.0)
        return self._guide("friction") * ramp * math.copysign(1.0, speed)

    def _rubbed(self, force: float, moment: float, speed: float) -> float:
        """Friction ahead on the frame, of both ends or of the middle."""
        length = self.values.get("slides.guide.length")
        turning = 0.0 if length is None else moment / length
        return self._share(speed) * (abs(force / 2 + turning) + abs(force / 2 - turning))

    def corners(self, origin: complex, tilt: float) -> list[tuple[float, complex, float]]:
        """Return how deep each corner is in its edge (m), where it is, and its side (1, -1)."""
        begin, across = self._at("slides.guide.through"), 1j * self.ahead
        half, tall = self._guide("length") / 2, self._guide("height") / 2
        found = []
        for front, left in itertools.product((1, -1), (1, -1)):
            # The slider's axes are the frame's while it is straight, along the slide.
            place = origin + self.ahead * cmath.exp(1j * tilt) * complex(front * half, left * tall)
            wall = left * (tall + self._guide("clearance"))
            depth = left * (dot(place - begin, across) - wall)
            found.append((depth, place, left))
        return found

    def _pushed(
        self, origin: complex, going: complex, tilt: float, spin: float
    ) -> tuple[complex, float]:
        """Return force and moment about the slider's origin on the frame by its corners."""
        compliance = 2 * (1 - self._guide("poisson") ** 2) / self._guide("young")
        stiffness = 4 / (3 * compliance) * math.sqrt(self._guide("corner_radius"))
        damping = 0.75 * (1 - self._guide("restitution") ** 2) / self._guide("impact_velocity")
        force, moment = 0j, 0.0
        for depth, place, left in self.corners(origin, tilt):
            if depth <= 0:
                continue
            moved = going + 1j * spin * (place - origin)
            rate = left * dot(moved, 1j * self.ahead)
            pressed = stiffness * depth**1.5 * (1 + damping * rate)
            push = left * pressed * 1j * self.ahead
            push += pressed * self._share(dot(moved, self.ahead)) * self.ahead
            force += push
            moment += cross(place - origin, push)
        return force, moment

    def motion(self, times: np.ndarray, rtol: float = 1e-11) -> dict[str, np.ndarray]:
        """Return what is seen at times from 0 on, by SciPy's DOP853; impacts need short steps."""

        def field(_, y):
            return np.concatenate([y[9:], self.instant(y)[0]])

        span = (0.0, float(times[-1]))
        method = {
            "method": "DOP853",
            "rtol": rtol,
            "atol": rtol * 1e-3,
            "max_step": 2e-5 if self.has_gap else 2e-4,
        }
        states = solve_ivp(field, span, self.start, t_eval=times, **method).y.T
        seen: dict[str, list] = {}
        for y in states:
            told = self.instant(y)[1]
            origin = complex(y[6], y[7]) + cmath.exp(1j * y[8]) * self.origins[SLIDER]
            off = dot(origin - self._at("slides.guide.through"), 1j * self.ahead)
            told |= {"off": off, "tilt": y[8], "B": [told["B"].real, told["B"].imag]}
            if self.has_gap:
                told["touching"] = sum(depth > 0 for depth, *_ in self.corners(origin, y[8]))
            for name, value in told.items():
                seen.setdefault(name, []).append(value)
        return {name: np.array(values) for name, values in seen.items()}

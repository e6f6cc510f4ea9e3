"""Any linkage with clearance as free bodies in absolute coordinates, compiled by numba.

Body 0 is the frame, which stands if its mass is infinite, and body 1 the crank. Ideal joints,
slides and the drive are constraints on accelerations, whose drift is not mended; contacts are those
of `loose_joint`, not smoothed. Vectors of the plane are complex numbers; SI units.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from benchmarks.peers.dopri5 import compiled
from benchmarks.peers.loose_joint import dot, law_of, push

SUPPORT = ("horizontal_stiffness", "vertical_stiffness", "horizontal_damping", "vertical_damping")


@compiled
def _add(rows, row, body, sign, arm):
    """Add the acceleration of a body's point, of each way on one row."""
    rows[row, 3 * body] += sign
    rows[row + 1, 3 * body + 1] += sign
    rows[row, 3 * body + 2] -= sign * arm.imag
    rows[row + 1, 3 * body + 2] += sign * arm.real


@compiled
def _act(forces, body, force, arm, moment):
    forces[3 * body] += force.real
    forces[3 * body + 1] += force.imag
    forces[3 * body + 2] += arm.real * force.imag - arm.imag * force.real + moment


@compiled
def instant(time, y, p):
    """Return accelerations, forces on bores (N), e (m), normal forces (N), constraints, their gaps.

    `y` has x, y and angle of all bodies, and their rates.
    """
    speed, gravity, masses, ends, arms, laws, slides, loads, supports = p
    n, joints = len(masses), len(ends)
    z, u = np.empty(n, np.complex128), np.empty(n, np.complex128)
    axis, spin = np.empty(n, np.complex128), np.empty(n)
    inverse, forces = np.empty(3 * n), np.zeros(3 * n)
    for i in range(n):
        z[i] = complex(y[3 * i], y[3 * i + 1])
        axis[i] = complex(np.cos(y[3 * i + 2]), np.sin(y[3 * i + 2]))
        u[i], spin[i] = complex(y[3 * (n + i)], y[3 * (n + i) + 1]), y[3 * (n + i) + 2]
        inverse[3 * i : 3 * i + 2], inverse[3 * i + 2] = 1 / masses[i, 0], 1 / masses[i, 1]
        if np.isfinite(masses[i, 0]):
            forces[3 * i + 1] = -gravity * masses[i, 0]
    for k in range(len(loads)):
        i, arm, force = int(loads[k, 0].real), loads[k, 1], loads[k, 2]
        arm *= axis[i]
        force *= axis[i] if loads[k, 3].real else axis[0]
        _act(forces, i, force, arm, 0.0)
        _act(forces, 0, -force, z[i] + arm - z[0], 0.0)
    for k in range(len(supports)):
        arm, drawn = axis[0] * supports[k, 0], supports[k, 1]
        stiff, damped = supports[k, 2], supports[k, 3]
        moved, rate = z[0] + arm - drawn, u[0] + 1j * spin[0] * arm
        force = complex(stiff.real * moved.real, stiff.imag * moved.imag)
        force += complex(damped.real * rate.real, damped.imag * rate.imag)
        _act(forces, 0, -force, arm, 0.0)
    ideal = laws[:, 0] == 0.0
    count = 2 * ideal.sum() + 2 * len(slides) + 1
    phi, known, gap = np.zeros((count, 3 * n)), np.zeros(count), np.zeros(count)
    e, at_bores = np.zeros(joints, np.complex128), np.zeros(joints, np.complex128)
    normals, row = np.zeros(joints), 0
    for j in range(joints):
        one, other = ends[j]
        a, b = axis[one] * arms[j, 0], axis[other] * arms[j, 1]
        e[j] = z[other] + b - z[one] - a
        if ideal[j]:
            _add(phi, row, one, -1.0, a)
            _add(phi, row, other, 1.0, b)
            inward = spin[other] ** 2 * b - spin[one] ** 2 * a
            known[row], known[row + 1] = inward.real, inward.imag
            gap[row], gap[row + 1] = e[j].real, e[j].imag
            row += 2
            continue
        rate = u[other] + 1j * spin[other] * b - u[one] - 1j * spin[one] * a
        force, moment, back, normals[j] = push(laws[j], e[j], rate, spin[one], spin[other])
        at_bores[j] = force
        _act(forces, one, force, a, moment)
        _act(forces, other, -force, b, back)
    for k in range(len(slides)):
        i, b, a = int(slides[k, 0].real), slides[k, 1], axis[0] * slides[k, 2]
        b *= axis[i]
        normal = 1j * axis[0] * slides[k, 3]
        apart = z[i] + b - z[0] - a
        rate = u[i] + 1j * spin[i] * b - u[0] - 1j * spin[0] * a
        phi[row, 3 * i], phi[row, 3 * i + 1] = normal.real, normal.imag
        phi[row, 3 * i + 2] = dot(normal, 1j * b)
        phi[row, 0], phi[row, 1] = -normal.real, -normal.imag
        phi[row, 2] = dot(1j * normal, apart) - dot(normal, 1j * a)
        inward = spin[i] ** 2 * b + spin[0] ** 2 * (apart - a)
        known[row] = dot(normal, inward) - 2 * spin[0] * dot(1j * normal, rate)
        gap[row] = dot(normal, apart)
        phi[row + 1, 3 * i + 2], phi[row + 1, 2] = 1.0, -1.0
        gap[row + 1] = y[3 * i + 2] - y[2]
        row += 2
    phi[row, 5], phi[row, 2], gap[row] = 1.0, -1.0, y[5] - y[2] - speed * time
    light = phi * inverse
    multipliers = np.linalg.solve(light @ phi.T, known - light @ forces)
    row = 0
    for j in range(joints):
        if ideal[j]:
            at_bores[j] = -complex(multipliers[row], multipliers[row + 1])
            row += 2
    return inverse * (forces + phi.T @ multipliers), at_bores, e, normals, phi, gap


@dataclass
class AnyLinkage:
    """The motion of a linkage, as `scipy_peer` takes one, from e (m) and e' (m/s) of its joints.

    `values` are the numbers of a description by name. Of `joints` there are name, bore's and pin's
    body, of `slides` the bodies and of `pushed` the bodies with a force of one size, and whether it
    turns with them; else it does with the frame. The first body is the crank. `angles` are those of
    the bodies about which it is put together, crank first. Of a frame on supports there are x, y
    (m), angle and their rates from where it is drawn, in the ground's axes; None hangs it in its
    springs.
    """

    values: Mapping[str, Any]
    bodies: tuple[str, ...]
    joints: tuple[tuple[str, str, str], ...]
    slides: tuple[tuple[str, str], ...]
    pushed: tuple[tuple[str, str, bool], ...]
    angles: np.ndarray
    e: Mapping[str, complex]
    rates: Mapping[str, complex] = field(default_factory=dict)
    frame: np.ndarray | None = None

    def _at(self, name: str) -> complex:
        of = self.values
        return complex(of.get(f"{name}.x", 0.0), of.get(f"{name}.y", 0.0))

    def _arm(self, name: str, body: str) -> complex:
        """Return a point of a body from its mass centre."""
        own = "foundation" if body == "frame" else f"bodies.{body}.mass_centre"
        return self._at(name) - self._at(own)

    @property
    def loose(self) -> tuple[str, ...]:
        """The names of the loose joints."""
        return tuple(n for n, *_ in self.joints if f"joints.{n}.clearance" in self.values)

    @cached_property
    def numbers(self) -> tuple:
        """What the compiled field reads."""
        of, number = self.values, {name: i for i, name in enumerate(("frame", *self.bodies))}
        masses = [(of.get("foundation.mass", np.inf), of.get("foundation.inertia", np.inf))]
        masses += [tuple(of[f"bodies.{b}.{m}"] for m in ("mass", "inertia")) for b in self.bodies]
        laws, arms = np.zeros((len(self.joints), 8)), []
        for row, (name, bore, pin) in zip(laws, self.joints, strict=True):
            at = f"joints.{name}"
            arms.append((self._arm(f"{at}.bore", bore), self._arm(f"{at}.pin", pin)))
            if name in self.loose:
                row[:] = law_of(of, at)
        slides = []
        for name, body in self.slides:
            along, origin = (
                self._at(f"slides.{name}.along"),
                -self._at(f"bodies.{body}.mass_centre"),
            )
            through = self._arm(f"slides.{name}.through", "frame")
            slides.append((number[body], origin, through, along / abs(along)))
        loads = [
            (number[body], self._arm(f"forces.{n}.at", body), self._at(f"forces.{n}.force"), turns)
            for n, body, turns in self.pushed
        ]
        supports = []
        for side in ("left", "right") if "foundation.mass" in of else ():
            place = complex(of[f"foundation.{side}"], of["foundation.base"])
            kx, ky, cx, cy = (of[f"foundation.{name}"] for name in SUPPORT)
            centre = self._at("foundation")
            supports.append((place - centre, place, complex(kx, ky), complex(cx, cy)))
        ends = [(number[bore], number[pin]) for _, bore, pin in self.joints]
        tables = (np.array(rows, complex).reshape(-1, 4) for rows in (slides, loads, supports))
        parts = np.array(masses), np.array(ends), np.array(arms), laws, *tables
        return (of["speed"], of.get("gravity", 9.81), *parts)

    @cached_property
    def held(self) -> tuple:
        """The same with constraints in all joints."""
        return (*self.numbers[:5], np.zeros_like(self.numbers[5]), *self.numbers[6:])

    @cached_property
    def start(self) -> np.ndarray:
        """The state at time 0: the frame stands where it is, then all is put together."""
        speed, gravity, masses, _, _, _, slides, _, supports = self.numbers
        n, held = len(masses), self.held
        rest = [0j] * len(slides)
        target = np.array([self.e.get(name, 0j) for name, *_ in self.joints] + rest)
        rates = np.array([self.rates.get(name, 0j) for name, *_ in self.joints] + rest)
        y = np.zeros(6 * n)
        y[:2] = self._at("foundation").real, self._at("foundation").imag
        y[5 : 3 * n : 3] = self.angles

        def rows(e, last):
            return np.append(np.stack([e.real, e.imag], axis=1).ravel(), last)

        def together(e):
            for _ in range(50):
                *_, phi, gap = instant(0.0, y, held)
                step = np.linalg.solve(phi[:, 3:], rows(e, 0.0) - gap)
                y[3 : 3 * n] += step
                if abs(step).max() < 1e-15:
                    break
            return phi

        phi = together(0 * target)
        if self.frame is not None:
            y[:3] += self.frame[:3]
            y[3 * n : 3 * n + 3] = self.frame[3:]
        elif len(supports):
            stiff, weight = np.zeros((3, 3)), np.zeros(3)
            for arm, _, k, _ in supports:
                x, z = np.array([1.0, 0.0, -arm.imag]), np.array([0.0, 1.0, arm.real])
                stiff += k.real * np.outer(x, x) + k.imag * np.outer(z, z)
            for i in range(n):
                weight -= masses[i, 0] * gravity * np.array([0.0, 1.0, y[3 * i] - y[0]])
            y[:3] += np.linalg.solve(stiff, weight)
        y[5 : 3 * n : 3] += y[2]
        turn, spin = np.exp(1j * y[2]), y[3 * n + 2]
        phi = together(turn * target)
        wanted = (
            rows(turn * (rates + 1j * spin * target), speed) - phi[:, :3] @ y[3 * n : 3 * n + 3]
        )
        y[3 * n + 3 :] = np.linalg.solve(phi[:, 3:], wanted)
        return y

    def field(self, time: float, y) -> np.ndarray:
        """Return the rate y', NaN where a trial step goes out of all bounds."""
        half = len(y) // 2
        try:
            return np.concatenate([y[half:], instant(time, y, self.numbers)[0]])
        except np.linalg.LinAlgError:
            return np.full(len(y), np.nan)

    def corners(self, time: float, y) -> list[float]:
        """Return by how much each loose pin is inside of its bore's wall."""
        e, clearances = instant(time, y, self.numbers)[2], self.numbers[5][:, 0]
        return [abs(at) - c for at, c in zip(e, clearances, strict=True) if c]

    def relative(self, y) -> np.ndarray:
        """Return e and the frame's x, y and angle, and behind them their rates."""
        half, count = len(y) // 2, 2 * len(self.joints)
        *_, phi, gap = instant(0.0, y, self.held)
        rates = phi[:count] @ y[half:]
        return np.concatenate([gap[:count], y[:3], rates, y[half : half + 3]])

    def observe(self, times, states) -> dict[str, np.ndarray]:
        """Return `NAME_eccentricity` (m), `NAME_normal_force` and `NAME_reaction` (N) of joints.

        They are in the frame's axes. Besides there is `frame_displacement` (m) on supports.
        """
        found: dict[str, list] = {}
        for time, y in zip(np.asarray(times).tolist(), states, strict=True):
            _, at_bores, e, normals, *_ = instant(time, y, self.numbers)
            back = np.exp(-1j * y[2])
            row: dict[str, Any] = {}
            if len(self.numbers[-1]):
                row["frame_displacement"] = complex(y[0], y[1]) - self._at("foundation")
            for j, (name, *_) in enumerate(self.joints):
                row[f"{name}_reaction"] = back * at_bores[j]
                if self.numbers[5][j, 0]:
                    row[f"{name}_eccentricity"] = back * e[j]
                    row[f"{name}_normal_force"] = normals[j]
            for name, value in row.items():
                two = [value.real, value.imag] if np.iscomplexobj(value) else value
                found.setdefault(name, []).append(two)
        return {name: np.array(values) for name, values in found.items()}

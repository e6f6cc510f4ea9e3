"""The slider-crank with clearance for EXUDYN and for SciPy; nothing here imports jaxcrusher.

Lankarani-Nikravesh with a sharp corner, no gravity. Each impact has its own impact velocity,
read where it begins, but not less than a given one. Friction is that of the surfaces, with a
linear ramp up to the speed from which it slides. It acts, and the surfaces' speed is taken,
`contact_point` penetrations outside the bore's radius: EXUDYN's is half-way, jaxcrusher's at 0.
"""

# EXUDYN's stubs take modules for types, and lack some settings.
# pyright: reportArgumentType=false, reportAttributeAccessIssue=false

import cmath
import math
from dataclasses import dataclass

import exudyn
import exudyn.itemInterface as items
import numpy as np
from scipy.integrate import solve_ivp

from benchmarks.peers.exudyn_parts import Parts


@dataclass(frozen=True)
class Numbers:
    """Flores, Ambrosio, Claro, Lankarani 2006; SI units."""

    crank_length: float = 0.05
    rod_length: float = 0.12
    rod_mass: float = 0.21
    rod_inertia: float = 2.5e-4
    slider_mass: float = 0.14
    speed: float = 5000 * 2 * np.pi / 60
    bore_radius: float = 0.01
    clearance: float = 0.5e-3
    young: float = 207e9
    poisson: float = 0.3
    restitution: float = 0.9
    least_impact_velocity: float = 0.01
    friction: float = 0.0
    full_sliding_speed: float = 0.5
    contact_point: float = 0.0

    @property
    def stiffness(self) -> float:
        """K of a sphere in a spherical bore of the same steel, N/m^1.5."""
        curvature = 1 / (self.bore_radius - self.clearance) - 1 / self.bore_radius
        return 2 / 3 * self.young / (1 - self.poisson**2) / np.sqrt(curvature)


@dataclass(frozen=True)
class Result:
    """A motion at `time` (s); forces in N, lengths in m."""

    time: np.ndarray
    contact_force: np.ndarray
    slider_acceleration: np.ndarray
    crank_moment: np.ndarray
    eccentricity: np.ndarray  # journal centre - bearing centre, shape (times, 2)


def by_scipy(numbers: Numbers, times: np.ndarray, rtol: float = 1e-12) -> Result:
    """Integrate Lagrange's equations in the rod's angle and the slider's position by DOP853.

    It stops wherever the surfaces touch or part, so that no step crosses the law's corner.
    Vectors of the plane are complex numbers.
    """
    n, factor = numbers, 0.75 * (1 - numbers.restitution**2)
    r, half = n.crank_length, n.rod_length / 2
    inertia = n.rod_inertia + n.rod_mass * half**2

    def gap(time, y):
        arm, rod = r * cmath.exp(1j * n.speed * time), n.rod_length * cmath.exp(1j * y[0])
        e, e_rate = y[1] - (arm + rod), y[3] - 1j * (n.speed * arm + y[2] * rod)
        normal = e / abs(e) if abs(e) > 0 else 1.0
        return abs(e) - n.clearance, e_rate * normal.conjugate(), normal, e

    def forces(time, y, velocity):
        """Return the force on the rod, its moment about the bearing, and e."""
        depth, relative, normal, e = gap(time, y)
        if velocity is None or depth < 0:
            return 0j, 0.0, e
        size = n.stiffness * depth**1.5 * (1 + factor * relative.real / velocity)
        arm = n.bore_radius + n.contact_point * depth
        slip = arm * y[2] - relative.imag
        rub = -n.friction * size * max(-1.0, min(1.0, slip / n.full_sliding_speed))
        return (size + 1j * rub) * normal, arm * rub, e

    def accelerations(time, y, force, moment):
        swing = n.rod_mass * r * half * n.speed**2 * math.sin(y[0] - n.speed * time)
        lever = n.rod_length * (cmath.exp(-1j * y[0]) * force).imag
        return (lever + moment - swing) / inertia, -force.real / n.slider_mass

    def field(time, y, velocity):
        force, moment, _ = forces(time, y, velocity)
        return [y[2], y[3], *accelerations(time, y, force, moment)]

    def touch(time, y, velocity):
        return gap(time, y)[0]

    y, now, velocity = np.array([0.0, r + n.rod_length, 0.0, 0.0]), 0.0, None
    y[2] = -r * n.speed / n.rod_length  # crank and rod in one line
    rows, reported = [], 0
    while reported < len(times):
        touch.direction, touch.terminal = (1 if velocity is None else -1), True  # pyright: ignore
        solution = solve_ivp(
            field,
            (now, times[-1]),
            y,
            "DOP853",
            dense_output=True,
            events=touch,
            args=(velocity,),
            rtol=rtol,
            atol=rtol * 1e-2,
            first_step=min(1e-8, times[-1] - now),
            max_step=1e-5,
        )
        if solution.status < 0:
            raise RuntimeError(f"DOP853 stopped at {now} s: {solution.message}")
        last = int(np.searchsorted(times, solution.t[-1], side="right"))
        for time in times[reported:last]:
            at = solution.sol(time)
            force, moment, e = forces(time, at, velocity)
            turn, slide = accelerations(time, at, force, moment)
            lag = n.speed * time - at[0]
            along = r * (cmath.exp(-1j * n.speed * time) * force).imag
            torque = n.rod_mass * r * half * (turn * np.cos(lag) + at[2] ** 2 * np.sin(lag)) - along
            rows.append((time, abs(force), slide, torque, e.real, e.imag))
        reported, now, y = last, solution.t[-1], solution.y[:, -1]
        velocity = None if velocity else max(gap(now, y)[1].real, n.least_impact_velocity)
    columns = np.array(rows).T
    return Result(columns[0], columns[1], columns[2], columns[3], columns[4:].T)


def by_exudyn(numbers: Numbers, end: float, step: float) -> Result:
    """Integrate three rigid bodies and a pin in a hollow sphere by the trapezoidal rule.

    Constraints are those of velocities: by positions EXUDYN's Newton iteration fails after
    0.115 s, with any of its tolerances, at 1 us and at 0.25 us. Every step is reported.
    """
    n, parts = numbers, Parts(0.0)
    r, length = n.crank_length, n.rod_length
    spin = -r * n.speed / length
    # The crank's mass does not matter at constant speed, nor the slider's inertia.
    crank, crank_node = parts.body(0.3, 1e-4, 0j, 0.0, 0j, n.speed)
    middle, velocity = r + length / 2 + 0j, 1j * spin * -length / 2
    rod, _ = parts.body(n.rod_mass, n.rod_inertia, middle, 0.0, velocity, spin)
    slider, slider_node = parts.body(n.slider_mass, 1e-4, r + length + 0j, 0.0, 0j, 0.0)
    parts.hinge(parts.marker(parts.ground, 0j), parts.marker(crank, 0j))
    parts.hinge(parts.marker(crank, r + 0j), parts.marker(rod, -length / 2 + 0j))
    parts.drive("drive", crank_node, n.speed)
    for index in (1, 2):
        markers = [parts.still, parts.coordinate(slider_node, index)]
        parts.system.AddObject(items.CoordinateConstraint(markerNumbers=markers))
    journal, bearing = parts.marker(slider, 0j), parts.marker(rod, length / 2 + 0j)
    radii = n.bore_radius - n.clearance, n.bore_radius
    law = n.stiffness, n.restitution, n.least_impact_velocity
    friction = {"dynamicFriction": n.friction, "frictionProportionalZone": n.full_sliding_speed}
    parts.contact("contact", journal, bearing, radii, *law, **friction)
    parts.place("journal", journal)
    parts.place("bearing", bearing)
    kind = exudyn.OutputVariableType.Acceleration
    parts.sensor("slider", items.SensorNode(nodeNumber=slider_node, outputVariableType=kind))
    raw = parts.run(end, step, step)
    force = raw["contact"]
    e = (raw["journal"] - raw["bearing"])[:, 1:3]
    size = np.linalg.norm(force[:, 1:3], axis=1)
    # The multiplier is what the crank does to the drive.
    return Result(force[:, 0], size, raw["slider"][:, 1], -raw["drive"][:, 1], e)

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

from benchmarks.peers.exudyn_settings import settings, solve


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
    """Lagrange's equations in the rod's angle and the slider's position, by DOP853.

    Stopped wherever the surfaces touch or part, so that no step crosses the law's corner.
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
        """The force on the rod, its moment about the bearing, and e."""
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
    """Three rigid bodies and `ObjectContactSphereSphere`, by Newmark's method (trapezoidal rule).

    Constraints by their velocities: by positions EXUDYN's Newton iteration fails after 0.115 s,
    with any of its tolerances, at 1 us and at 0.25 us.
    The restitution (1 + e^2) / 2 makes EXUDYN's Hunt-Crossley law Lankarani's and Nikravesh's.
    The recipe for the solver: steps that are never adapted, and a contact iteration that may
    run out. Every step is reported.
    """
    n = numbers
    system = exudyn.SystemContainer().AddSystem()
    ground = system.AddObject(items.ObjectGround())
    fixed = system.AddMarker(items.MarkerBodyPosition(bodyNumber=ground))
    still = system.AddMarker(
        items.MarkerNodeCoordinate(nodeNumber=system.AddNode(items.NodePointGround()), coordinate=0)
    )

    def body(mass, inertia, start, velocity):
        node = system.AddNode(
            items.NodeRigidBody2D(referenceCoordinates=start, initialVelocities=velocity)
        )
        made = items.ObjectRigidBody2D(mass=mass, inertia=inertia, nodeNumber=node)
        return node, system.AddObject(made)

    def coordinate(node, index):
        return system.AddMarker(items.MarkerNodeCoordinate(nodeNumber=node, coordinate=index))

    def point(of, x):
        return system.AddMarker(items.MarkerBodyRigid(bodyNumber=of, localPosition=[x, 0, 0]))

    r, length = n.crank_length, n.rod_length
    spin = -r * n.speed / length
    # The crank's mass does not matter at constant speed.
    crank_node, crank = body(0.3, 1e-4, [0, 0, 0], [0, 0, n.speed])
    rod_start = [r + length / 2, 0, 0]
    _, rod = body(n.rod_mass, n.rod_inertia, rod_start, [0, spin * -length / 2, spin])
    slider_node, slider = body(n.slider_mass, 1e-4, [r + length, 0, 0], [0, 0, 0])
    pivot = system.AddMarker(items.MarkerBodyPosition(bodyNumber=crank))
    system.AddObject(items.RevoluteJoint2D(markerNumbers=[fixed, pivot]))
    pin, big_end = point(crank, r), point(rod, -length / 2)
    system.AddObject(items.RevoluteJoint2D(markerNumbers=[pin, big_end]))
    drive = system.AddObject(
        items.CoordinateConstraint(
            markerNumbers=[still, coordinate(crank_node, 2)], velocityLevel=True, offset=n.speed
        )
    )
    for index in (1, 2):
        markers = [still, coordinate(slider_node, index)]
        system.AddObject(items.CoordinateConstraint(markerNumbers=markers))
    data = system.AddNode(
        items.NodeGenericData(initialCoordinates=[n.clearance, 0, 0, 0], numberOfDataCoordinates=4)
    )
    journal, bearing = point(slider, 0), point(rod, length / 2)
    contact = system.AddObject(
        items.ObjectContactSphereSphere(
            markerNumbers=[journal, bearing],
            nodeNumber=data,
            spheresRadii=[n.bore_radius - n.clearance, n.bore_radius],
            isHollowSphere1=True,
            contactStiffness=n.stiffness,
            contactStiffnessExponent=1.5,
            dynamicFriction=n.friction,
            frictionProportionalZone=n.full_sliding_speed,
            impactModel=1,
            restitutionCoefficient=(1 + n.restitution**2) / 2,
            minimumImpactVelocity=n.least_impact_velocity,
        )
    )
    kinds = exudyn.OutputVariableType
    stored = {"storeInternal": True, "writeToFile": False}
    force_kind = {"outputVariableType": kinds.Force, **stored}
    position_kind = {"outputVariableType": kinds.Position, **stored}
    acceleration_kind = {"outputVariableType": kinds.Acceleration, **stored}
    sensors = [
        system.AddSensor(sensor)
        for sensor in (
            items.SensorObject(objectNumber=contact, **force_kind),
            items.SensorNode(nodeNumber=slider_node, **acceleration_kind),
            items.SensorObject(objectNumber=drive, **force_kind),
            items.SensorMarker(markerNumber=journal, **position_kind),
            items.SensorMarker(markerNumber=bearing, **position_kind),
        )
    ]
    system.Assemble()
    chosen = settings(end, step, step)
    chosen.timeIntegration.generalizedAlpha.useIndex2Constraints = True
    chosen.timeIntegration.generalizedAlpha.useNewmark = True
    chosen.timeIntegration.generalizedAlpha.computeInitialAccelerations = True
    solve(system, chosen)
    force, slide, torque, at_journal, at_bearing = (
        np.array(system.GetSensorStoredData(s)) for s in sensors
    )
    e = (at_journal - at_bearing)[:, 1:3]
    size = np.linalg.norm(force[:, 1:3], axis=1)
    # The multiplier is what the crank does to the drive.
    return Result(force[:, 0], size, slide[:, 1], -torque[:, 1], e)

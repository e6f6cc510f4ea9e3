"""EXUDYN's models: bodies of the plane, their points, joints, contacts, sensors, and a run."""

# EXUDYN's stubs take modules for types, and lack some settings.
# pyright: reportArgumentType=false, reportAttributeAccessIssue=false

import exudyn as exu
import numpy as np
from exudyn import itemInterface as items


def xyz(vector: complex) -> list[float]:
    """Return a vector of the plane for EXUDYN."""
    return [vector.real, vector.imag, 0.0]


class Parts:
    """A system that grows by parts, with sensors by name."""

    def __init__(self, gravity: float):
        """Empty but for the ground; `gravity` in m/s2."""
        self.container = exu.SystemContainer()
        self.system = self.container.AddSystem()
        self.gravity = gravity
        self.sensors = {}
        self.ground = self.system.AddObject(items.ObjectGround())
        self.still = self.coordinate(self.system.AddNode(items.NodePointGround()), 0)

    def body(self, mass, inertia, centre: complex, angle, velocity: complex, spin):
        """Add a rigid body under its weight; return its number and its node's."""
        node = self.system.AddNode(
            items.NodeRigidBody2D(
                referenceCoordinates=[centre.real, centre.imag, angle],
                initialVelocities=[velocity.real, velocity.imag, spin],
            )
        )
        body = self.system.AddObject(
            items.ObjectRigidBody2D(mass=mass, inertia=inertia, nodeNumber=node)
        )
        self.system.AddLoad(
            items.LoadMassProportional(
                markerNumber=self.system.AddMarker(items.MarkerBodyMass(bodyNumber=body)),
                loadVector=[0.0, -self.gravity, 0.0],
            )
        )
        return body, node

    def marker(self, body, point: complex):
        """Mark a point of a body, relative to its mass centre, in its axes."""
        return self.system.AddMarker(
            items.MarkerBodyRigid(bodyNumber=body, localPosition=xyz(point))
        )

    def sensor(self, name: str, sensor) -> None:
        """Keep what a sensor sees, by name."""
        sensor.storeInternal = True
        sensor.writeToFile = False
        self.sensors[name] = self.system.AddSensor(sensor)

    def place(self, name: str, marker) -> None:
        """Keep the position of a marker."""
        position = exu.OutputVariableType.Position
        self.sensor(name, items.SensorMarker(markerNumber=marker, outputVariableType=position))

    def hinge(self, first, second) -> None:
        """Add an ideal joint whose force is not kept."""
        self.system.AddObject(items.ObjectJointRevolute2D(markerNumbers=[first, second]))

    def joint(self, name: str, first, second) -> None:
        """Add an ideal joint; its force is kept, in the axes of the first marker's body."""
        joint = self.system.AddObject(
            items.ObjectJointGeneric(
                markerNumbers=[first, second], constrainedAxes=[1, 1, 0, 0, 0, 0]
            )
        )
        force = exu.OutputVariableType.ForceLocal
        self.sensor(name, items.SensorObject(objectNumber=joint, outputVariableType=force))

    def contact(
        self, name: str, pin, bore, radii, stiffness, restitution, impact_velocity, **friction
    ) -> None:
        """Add a pin in a hollow sphere from EXUDYN's library; the force on the pin is kept.

        Between markers of their centres, of the two `radii` (m); Lankarani and Nikravesh's law
        with `stiffness` (N/m^1.5) and `impact_velocity` (m/s); EXUDYN's own numbers of friction.
        """
        pin_radius, bore_radius = radii
        data = self.system.AddNode(
            items.NodeGenericData(
                initialCoordinates=[bore_radius - pin_radius, 0.0, 0.0, 0.0],
                numberOfDataCoordinates=4,
            )
        )
        contact = self.system.AddObject(
            items.ObjectContactSphereSphere(
                markerNumbers=[pin, bore],
                nodeNumber=data,
                spheresRadii=[pin_radius, bore_radius],
                isHollowSphere1=True,
                contactStiffness=stiffness,
                contactStiffnessExponent=1.5,
                impactModel=1,
                # Its D is 3 (1 - e) / 2, so that this e makes it the law's 3 (1 - c_e^2) / 4.
                restitutionCoefficient=(1 + restitution**2) / 2,
                minimumImpactVelocity=impact_velocity,
                **friction,
            )
        )
        force = exu.OutputVariableType.Force
        self.sensor(name, items.SensorObject(objectNumber=contact, outputVariableType=force))

    def support(self, name: str, ground, body, stiffness: complex, damping: complex) -> None:
        """Add springs and dampers between two markers; the force on the first one is kept.

        Real parts are horizontal (N/m, N s/m), imaginary ones vertical. There is no force where
        the markers are at one place.
        """
        support = self.system.AddObject(
            items.ObjectConnectorCartesianSpringDamper(
                markerNumbers=[ground, body], stiffness=xyz(stiffness), damping=xyz(damping)
            )
        )
        force = exu.OutputVariableType.Force
        self.sensor(name, items.SensorObject(objectNumber=support, outputVariableType=force))

    def coordinate(self, node, index: int):
        """Mark a node's coordinate."""
        return self.system.AddMarker(items.MarkerNodeCoordinate(nodeNumber=node, coordinate=index))

    def drive(self, name: str, node, speed: float, base=None) -> None:
        """Turn a node at a constant speed (rad/s), against the ground or the node `base`.

        The torque is kept.
        """
        against = self.still if base is None else self.coordinate(base, 2)
        drive = self.system.AddObject(
            items.ObjectConnectorCoordinate(
                markerNumbers=[against, self.coordinate(node, 2)],
                velocityLevel=True,
                offset=speed,
            )
        )
        force = exu.OutputVariableType.Force
        self.sensor(name, items.SensorObject(objectNumber=drive, outputVariableType=force))

    def run(
        self, end: float, step: float, every: float, radius: float | None = None
    ) -> dict[str, np.ndarray]:
        """Integrate with a fixed `step` to `end` (s); return what the sensors keep every `every`.

        A sensor's columns are the time, then its values. The method is generalised-alpha with
        spectral `radius`: at 1 the multipliers oscillate, below it the motion is damped a little.
        Without `radius` it is Newmark's trapezoidal rule, with constraints by their velocities.
        RuntimeError if EXUDYN stops early.
        """
        self.system.Assemble()
        chosen = exu.SimulationSettings()
        chosen.solution.file.write = False
        chosen.solution.sensors.writePeriod = every
        time = chosen.timeIntegration
        time.numberOfSteps, time.endTime = round(end / step), end
        time.verboseMode = 0
        # With its own choice of steps and iterations EXUDYN stops at the first impact.
        time.adaptiveStep = False
        time.discontinuous.useRecommendedStepSize = False
        time.discontinuous.maxIterations = 8
        time.discontinuous.ignoreMaxIterations = True
        time.discontinuous.iterationTolerance = 1e3
        if radius is None:
            time.generalizedAlpha.useIndex2Constraints = True
            time.generalizedAlpha.useNewmark = True
            time.generalizedAlpha.computeInitialAccelerations = True
        else:
            time.generalizedAlpha.spectralRadius = radius
        if not self.system.SolveDynamic(chosen):
            raise RuntimeError("EXUDYN stopped before the end")
        return {
            name: np.array(self.system.GetSensorStoredData(s)) for name, s in self.sensors.items()
        }

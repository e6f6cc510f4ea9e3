"""Bodies of the plane, their points, joints, contacts and sensors for EXUDYN's models."""

# EXUDYN's stubs take modules for types, and lack some settings.
# pyright: reportArgumentType=false, reportAttributeAccessIssue=false

import exudyn as exu
import numpy as np
from exudyn import itemInterface as items

from benchmarks.peers.exudyn_settings import settings, solve


def xyz(vector: complex) -> list[float]:
    """A vector of the plane for EXUDYN."""
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

    def body(self, mass, inertia, centre: complex, angle, velocity: complex, spin):
        """A rigid body (its number and its node's) under its weight."""
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
        """A point of a body, relative to its mass centre, in its axes."""
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

    def joint(self, name: str, first, second) -> None:
        """An ideal joint; its force is kept, in the axes of the first marker's body."""
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
        """A pin in a hollow sphere from EXUDYN's library; the force on the pin is kept.

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

    def coordinate(self, node, index: int):
        """A marker of a node's coordinate."""
        return self.system.AddMarker(items.MarkerNodeCoordinate(nodeNumber=node, coordinate=index))

    def drive(self, name: str, node, speed: float) -> None:
        """Turn a body's node at a constant speed (rad/s); the torque is kept."""
        point = self.system.AddNode(items.NodePointGround())
        drive = self.system.AddObject(
            items.ObjectConnectorCoordinate(
                markerNumbers=[self.coordinate(point, 0), self.coordinate(node, 2)],
                velocityLevel=True,
                offset=speed,
            )
        )
        force = exu.OutputVariableType.Force
        self.sensor(name, items.SensorObject(objectNumber=drive, outputVariableType=force))

    def run(self, end: float, step: float, every: float, radius: float) -> dict[str, np.ndarray]:
        """What the sensors keep every `every` seconds to `end`: the time, then the values.

        Generalised-alpha with a fixed `step` (s) and spectral `radius`: at 1 the multipliers
        oscillate, below it the motion is damped a little.
        """
        self.system.Assemble()
        chosen = settings(end, step, every)
        chosen.timeIntegration.generalizedAlpha.spectralRadius = radius
        solve(self.system, chosen)
        return {
            name: np.array(self.system.GetSensorStoredData(s)) for name, s in self.sensors.items()
        }

"""The crusher in EXUDYN: rigid bodies, joints and a pin in a hollow sphere from its library.

Its contact law is Lankarani and Nikravesh's with the constant velocity of 0.5 m/s as long as no
impact is faster; its friction has the slip of the surfaces and a ramp that starts at zero speed,
not at v0, which tells no difference at slips of about 4 m/s.
"""

# EXUDYN's stubs take modules for types, and lack some settings.
# pyright: reportArgumentType=false, reportAttributeAccessIssue=false

import cmath

import exudyn as exu
import numpy as np
from exudyn import itemInterface as items

from benchmarks.peers.equations import Chain, Shaft
from benchmarks.peers.exudyn_settings import settings, solve
from benchmarks.peers.motion import Motion


def _xyz(vector: complex) -> list[float]:
    return [vector.real, vector.imag, 0.0]


class Model:
    """The mechanism at its start, with a clearance at A (or the ideal joint), and its sensors."""

    def __init__(self, motion: Motion, ideal: bool = False):
        """The motion's start and drive; `ideal` puts a revolute joint at A."""
        c = self.crusher = motion.crusher
        self.torque, self.ideal = motion.torque, ideal
        self.container = exu.SystemContainer()
        self.system = self.container.AddSystem()
        self.sensors = {}
        add = self.system
        t3, t2, w3, w2 = motion.start[:4]
        shaft, chain = Shaft(c, 0.0, c.speed), Chain(c, (t3, t2), (w3, w2))
        ground = add.AddObject(items.ObjectGround())
        s1_velocity, s2_velocity = 1j * c.speed * shaft.to_s1, chain.db * w3 + chain.ds2 * w2
        s2 = chain.b - 1j * chain.ds2
        s1, s3 = c.bearing + shaft.to_s1, chain.b / 2
        b1, n1 = self._body(c.m1, c.j1, s1, 0.0, s1_velocity, c.speed)
        b2, _ = self._body(c.m2, c.j2, s2, t2, s2_velocity, w2)
        b3, _ = self._body(c.m3, c.j3, s3, -t3, chain.velocity_b / 2, -w3)
        # Points of a body relative to its mass centre, in its own axes.
        to_s1 = c.l11 * cmath.exp(1j * c.shaft_angle)
        s2_to_a = 1j * c.l21 * cmath.exp(1j * c.jaw_angle)
        frame = self._marker(ground, 0j)
        # The ground's side first: forces come out in its axes.
        self._joint("O", self._marker(ground, c.bearing), self._marker(b1, -to_s1))
        self._joint("C", frame, self._marker(b3, -c.l3 / 2 + 0j))
        add.AddObject(
            items.ObjectJointRevolute2D(
                markerNumbers=[
                    self._marker(b2, s2_to_a - 1j * c.l2),
                    self._marker(b3, c.l3 / 2 + 0j),
                ]
            )
        )
        pin, bore = self._marker(b1, c.l1 - to_s1), self._marker(b2, s2_to_a)
        for name, marker in (("pin", pin), ("bore", bore)):
            self._sensor(
                name,
                items.SensorMarker(
                    markerNumber=marker, outputVariableType=exu.OutputVariableType.Position
                ),
            )
        if ideal:
            self._joint("A", pin, bore)
        else:
            self._contact(pin, bore)
        self._drive(b1, n1)
        # (18): along the jaw, that is, fixed to its axes, at S2.
        add.AddLoad(
            items.LoadForceVector(
                markerNumber=self._marker(b2, 0j), loadVector=[0.0, -c.load, 0.0], bodyFixed=True
            )
        )

    def _body(self, mass, inertia, centre: complex, angle, velocity: complex, spin):
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
                loadVector=[0.0, -self.crusher.g, 0.0],
            )
        )
        return body, node

    def _marker(self, body, point: complex):
        return self.system.AddMarker(
            items.MarkerBodyRigid(bodyNumber=body, localPosition=_xyz(point))
        )

    def _sensor(self, name: str, sensor):
        sensor.storeInternal = True
        sensor.writeToFile = False
        self.sensors[name] = self.system.AddSensor(sensor)

    def _joint(self, name: str, first, second):
        joint = self.system.AddObject(
            items.ObjectJointGeneric(
                markerNumbers=[first, second], constrainedAxes=[1, 1, 0, 0, 0, 0]
            )
        )
        self._sensor(
            name,
            items.SensorObject(
                objectNumber=joint, outputVariableType=exu.OutputVariableType.ForceLocal
            ),
        )

    def _contact(self, pin, bore):
        c = self.crusher
        data = self.system.AddNode(
            items.NodeGenericData(
                initialCoordinates=[c.clearance, 0.0, 0.0, 0.0], numberOfDataCoordinates=4
            )
        )
        contact = self.system.AddObject(
            items.ObjectContactSphereSphere(
                markerNumbers=[pin, bore],
                nodeNumber=data,
                spheresRadii=[c.bore - c.clearance, c.bore],
                isHollowSphere1=True,
                contactStiffness=c.stiffness,
                contactStiffnessExponent=1.5,
                impactModel=1,
                # Its D is 3 (1 - e) / 2, so that this e makes it the law's 3 (1 - c_e^2) / 4.
                restitutionCoefficient=(1 + c.restitution**2) / 2,
                minimumImpactVelocity=c.impact_velocity,
                dynamicFriction=c.friction or 0.0,
                frictionProportionalZone=c.v1,
            )
        )
        self._sensor(
            "contact",
            items.SensorObject(
                objectNumber=contact, outputVariableType=exu.OutputVariableType.Force
            ),
        )

    def _drive(self, body, node):
        coordinate = self.system.AddMarker(
            items.MarkerNodeCoordinate(nodeNumber=node, coordinate=2)
        )
        self._sensor(
            "shaft",
            items.SensorNode(
                nodeNumber=node, outputVariableType=exu.OutputVariableType.AngularVelocity
            ),
        )
        if self.torque is not None:
            self.system.AddLoad(items.LoadCoordinate(markerNumber=coordinate, load=self.torque))
            return
        point = self.system.AddNode(items.NodePointGround())
        still = self.system.AddMarker(items.MarkerNodeCoordinate(nodeNumber=point, coordinate=0))
        drive = self.system.AddObject(
            items.ObjectConnectorCoordinate(
                markerNumbers=[still, coordinate], velocityLevel=True, offset=self.crusher.speed
            )
        )
        self._sensor(
            "drive",
            items.SensorObject(objectNumber=drive, outputVariableType=exu.OutputVariableType.Force),
        )

    def run(
        self, end: float, step: float = 1e-6, every: float = 1e-5, radius: float = 0.9
    ) -> dict[str, np.ndarray]:
        """Histories every `every` seconds to `end`: time, forces in N, eccentricity in m.

        Generalised-alpha with a fixed `step` (s) and spectral `radius`: at 1 the multipliers
        oscillate, below it the motion is damped a little.
        """
        self.system.Assemble()
        chosen = settings(end, step, every)
        chosen.timeIntegration.generalizedAlpha.spectralRadius = radius
        solve(self.system, chosen)
        return self._histories()

    def _histories(self) -> dict[str, np.ndarray]:
        raw = {
            name: np.array(self.system.GetSensorStoredData(s)) for name, s in self.sensors.items()
        }
        # Its connectors' forces are those on the first marker's body; reactions here on the second.
        planar = {name: values[:, 1:3] for name, values in raw.items()}
        known = {
            "time": raw["pin"][:, 0],
            "eccentricity": planar["pin"] - planar["bore"],
            "bearing_reaction": -planar["O"],
            "toggle_reaction": -planar["C"],
            "foundation_force": sum(np.linalg.norm(planar[joint], axis=1) for joint in "OC"),
            "shaft_speed": raw["shaft"][:, 3],
        }
        if self.torque is None:
            known["drive_torque"] = -raw["drive"][:, 1]
        if not self.ideal:
            known["contact_force"] = np.linalg.norm(planar["contact"], axis=1)
        return known

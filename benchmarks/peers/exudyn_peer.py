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
from benchmarks.peers.exudyn_parts import Parts
from benchmarks.peers.motion import Motion


class Model:
    """The mechanism at its start, with a clearance at A (or the ideal joint), and its sensors."""

    def __init__(self, motion: Motion, ideal: bool = False):
        """Take the motion's start and drive; `ideal` puts a revolute joint at A."""
        c = self.crusher = motion.crusher
        self.torque, self.ideal = motion.torque, ideal
        self.parts = parts = Parts(c.g)
        t3, t2, w3, w2 = motion.start[:4]
        shaft, chain = Shaft(c, 0.0, c.speed), Chain(c, (t3, t2), (w3, w2))
        s1_velocity, s2_velocity = 1j * c.speed * shaft.to_s1, chain.db * w3 + chain.ds2 * w2
        s2 = chain.b - 1j * chain.ds2
        s1, s3 = c.bearing + shaft.to_s1, chain.b / 2
        b1, n1 = parts.body(c.m1, c.j1, s1, 0.0, s1_velocity, c.speed)
        b2, _ = parts.body(c.m2, c.j2, s2, t2, s2_velocity, w2)
        b3, _ = parts.body(c.m3, c.j3, s3, -t3, chain.velocity_b / 2, -w3)
        # Points of a body relative to its mass centre, in its own axes.
        to_s1 = c.l11 * cmath.exp(1j * c.shaft_angle)
        s2_to_a = 1j * c.l21 * cmath.exp(1j * c.jaw_angle)
        frame = parts.marker(parts.ground, 0j)
        # The ground's side first: forces come out in its axes.
        parts.joint("O", parts.marker(parts.ground, c.bearing), parts.marker(b1, -to_s1))
        parts.joint("C", frame, parts.marker(b3, -c.l3 / 2 + 0j))
        parts.hinge(parts.marker(b2, s2_to_a - 1j * c.l2), parts.marker(b3, c.l3 / 2 + 0j))
        pin, bore = parts.marker(b1, c.l1 - to_s1), parts.marker(b2, s2_to_a)
        parts.place("pin", pin)
        parts.place("bore", bore)
        if ideal:
            parts.joint("A", pin, bore)
        else:
            friction = {"dynamicFriction": c.friction or 0.0, "frictionProportionalZone": c.v1}
            radii = c.bore - c.clearance, c.bore
            law = c.stiffness, c.restitution, c.impact_velocity
            parts.contact("contact", pin, bore, radii, *law, **friction)
        speed = exu.OutputVariableType.AngularVelocity
        parts.sensor("shaft", items.SensorNode(nodeNumber=n1, outputVariableType=speed))
        if self.torque is None:
            parts.drive("drive", n1, c.speed)
        else:
            turning = parts.coordinate(n1, 2)
            parts.system.AddLoad(items.LoadCoordinate(markerNumber=turning, load=self.torque))
        # (18): along the jaw, that is, fixed to its axes, at S2.
        parts.system.AddLoad(
            items.LoadForceVector(
                markerNumber=parts.marker(b2, 0j), loadVector=[0.0, -c.load, 0.0], bodyFixed=True
            )
        )

    def run(
        self, end: float, step: float = 1e-6, every: float = 1e-5, radius: float = 0.9
    ) -> dict[str, np.ndarray]:
        """Return histories every `every` seconds to `end`: time, forces in N, eccentricity in m.

        In steps of `step` (s), as `Parts.run` says.
        """
        raw = self.parts.run(end, step, every, radius)
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

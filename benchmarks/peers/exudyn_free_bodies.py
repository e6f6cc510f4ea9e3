"""The crusher of `free_bodies` in EXUDYN: its bodies, ideal joints and contacts.

Its contact law is Lankarani and Nikravesh's with the constant velocity as long as no impact is
faster. Its friction has a ramp from zero speed and acts in the middle of the overlap: friction is
a load written here.
"""

# EXUDYN's stubs take modules for types, and lack some settings.
# pyright: reportArgumentType=false, reportAttributeAccessIssue=false

import exudyn as exu
import numpy as np
from exudyn import itemInterface as items

from benchmarks.peers.exudyn_parts import Parts, xyz
from benchmarks.peers.free_bodies import PREFIXES, ROWS, FreeBodies, pairs
from benchmarks.peers.loose_joint import V0, V1, LooseJoint

KINDS = exu.OutputVariableType


class Model:
    """The mechanism at the motion's start, and its sensors."""

    def __init__(self, motion: FreeBodies):
        """Take the motion's start, points of joints and numbers, and none of its equations."""
        of = motion.numbers
        self.motion = motion
        self.parts = parts = Parts(of["gravity"])
        to_s1 = motion.unbalance / motion.shaft_mass
        s1, velocity = motion.bearing + to_s1, 1j * of["speed"] * to_s1
        inertia = of["shaft.inertia"]
        shaft, node = parts.body(motion.shaft_mass, inertia, s1, 0.0, velocity, of["speed"])
        bodies = {"frame": parts.ground, "shaft": shaft}
        for name, rows in ROWS.items():
            (x, y, angle), (u, v, spin) = motion.start[:6][rows], motion.start[6:12][rows]
            mass, inertia = of[f"{name}.mass"], of[f"{name}.inertia"]
            bodies[name], _ = parts.body(mass, inertia, complex(x, y), angle, complex(u, v), spin)
        # The ground's side first: forces come out in its axes.
        parts.joint("O", parts.marker(parts.ground, motion.bearing), parts.marker(shaft, -to_s1))
        parts.drive("drive", node, of["speed"])
        for joint, (bore_body, bore_point, pin_body, pin_point) in motion.joints.items():
            # Points of the shaft are given from O.
            shift = -to_s1 if pin_body == "shaft" else 0j
            bore = parts.marker(bodies[bore_body], bore_point)
            pin = parts.marker(bodies[pin_body], pin_point + shift)
            law = motion.laws[joint]
            if law is None:
                parts.joint(joint, bore, pin)
                continue
            parts.place(f"{joint} bore", bore)
            parts.place(f"{joint} pin", pin)
            radii = law.bore_radius - law.clearance, law.bore_radius
            numbers = law.stiffness, law.restitution, law.impact_velocity
            parts.contact(joint, pin, bore, radii, *numbers)
            if law.friction:
                self._friction(joint, law, bore, pin)
        turn = items.SensorBody(bodyNumber=bodies["jaw"], outputVariableType=KINDS.Rotation)
        parts.sensor("jaw", turn)
        load = [-of["load"], 0.0, 0.0]
        parts.system.AddLoad(
            items.LoadForceVector(
                markerNumber=parts.marker(bodies["jaw"], 0j), loadVector=load, bodyFixed=True
            )
        )

    def _friction(self, joint: str, law: LooseJoint, bore, pin) -> None:
        """Add friction's loads on both bodies; that on the pin is kept."""

        def rub(system) -> tuple[complex, float, float]:
            """Return the bore's force, and moments about the bore's and the pin's centre."""

            def see(marker, kind):
                return system.GetMarkerOutput(marker, kind)

            places = [complex(*see(marker, KINDS.Position)[:2]) for marker in (bore, pin)]
            e = places[1] - places[0]
            depth = abs(e) - law.clearance
            if depth <= 0:
                return 0j, 0.0, 0.0
            speeds = [complex(*see(marker, KINDS.Velocity)[:2]) for marker in (bore, pin)]
            # The pin's motion along and across the line of centres.
            relative = (speeds[1] - speeds[0]) * abs(e) / e
            arms = law.bore_radius, law.bore_radius - abs(e)
            slip = -relative.imag
            if law.slip == "surface":
                spins = [see(marker, KINDS.AngularVelocityLocal)[2] for marker in (bore, pin)]
                slip += spins[0] * arms[0] - spins[1] * arms[1]
            damping = 0.75 * (1 - law.restitution**2) * relative.real / law.impact_velocity
            normal = law.stiffness * depth**1.5 * (1 + damping)
            share = np.clip((abs(slip) - V0) / (V1 - V0), 0.0, 1.0) * np.sign(slip)
            size = -law.friction * share * normal
            return 1j * size * e / abs(e), arms[0] * size, -arms[1] * size

        add = self.parts.system.AddLoad
        for marker, sign, moment in ((bore, 1, 1), (pin, -1, 2)):
            force = add(
                items.LoadForceVector(
                    markerNumber=marker,
                    loadVectorUserFunction=lambda s, t, v, sign=sign: xyz(sign * rub(s)[0]),
                )
            )
            add(
                items.LoadTorqueVector(
                    markerNumber=marker,
                    loadVectorUserFunction=lambda s, t, v, at=moment: [0.0, 0.0, rub(s)[at]],
                )
            )
        self.parts.sensor(f"{joint} friction", items.SensorLoad(loadNumber=force))

    def run(
        self, end: float, step: float = 1e-6, every: float = 1e-5, radius: float = 0.9
    ) -> dict[str, np.ndarray]:
        """Return histories by the names of `FreeBodies.observe`, and `time` (s).

        Every `every` seconds to `end`, in steps of `step` (s); see `Parts.run`.
        """
        raw = self.parts.run(end, step, every, radius)
        # A rotation is that from the start; a joint's force is in the jaw's axes at A and at B.
        axis = np.exp(1j * (self.motion.start[2] + raw["jaw"][:, 1]))

        def planar(name: str) -> np.ndarray:
            return raw[name][:, 1] + 1j * raw[name][:, 2]

        known, forces = {"time": raw["jaw"][:, 0]}, {}
        for joint, law in self.motion.laws.items():
            # A connector's force is that on the first marker's body: the bore's, or the pin's.
            if law is None:
                forces[joint] = planar(joint) * (1.0 if joint == "C" else axis)
                continue
            prefix, contact = PREFIXES[joint], planar(joint)
            known[prefix + "eccentricity"] = planar(f"{joint} pin") - planar(f"{joint} bore")
            known[prefix + "normal_force"] = abs(contact)
            rubbing = planar(f"{joint} friction") if law.friction else 0.0
            forces[joint] = -contact - rubbing
        known |= {
            "joint_force": forces["A"],
            "elbow_reaction": forces["B"],
            "toggle_reaction": -forces["C"],
            "bearing_reaction": -planar("O"),
        }
        return pairs(known)

"""The crusher of `free_bodies` in EXUDYN: its bodies, ideal joints and contacts.

Its contact law is Lankarani and Nikravesh's with the constant velocity as long as no impact is
faster. Its friction has a ramp from zero speed and acts in the middle of the overlap: friction is
a load written here.
"""

# EXUDYN's stubs take modules for types, and lack some settings.
# pyright: reportArgumentType=false, reportAttributeAccessIssue=false

from collections.abc import Callable
from dataclasses import dataclass

import exudyn as exu
import numpy as np
from exudyn import itemInterface as items

from benchmarks.peers.equations import pairs
from benchmarks.peers.exudyn_parts import Parts, xyz
from benchmarks.peers.free_bodies import PREFIXES, ROWS, FreeBodies
from benchmarks.peers.loose_joint import V0, V1, LooseJoint

KINDS = exu.OutputVariableType


@dataclass(frozen=True)
class Stand:
    """Where a frame on supports stands at the start, at rest; `centre` is G as drawn, m."""

    centre: complex = 0j
    displacement: complex = 0j  # of G, m
    rotation: float = 0.0

    @property
    def axis(self) -> complex:
        """The frame's x axis."""
        return complex(np.exp(1j * self.rotation))

    def place(self, point: complex) -> complex:
        """Return where a point of the drawing is."""
        return self.centre + self.displacement + self.axis * (point - self.centre)


@dataclass(frozen=True)
class JawLoad:
    """A force on the jaw over time, in axes that turn with it: x from B to A; N and s."""

    along: float  # from A towards B to where it acts, m
    force: Callable[[float], complex]


class Model:
    """The mechanism at the motion's start, and its sensors."""

    def __init__(self, motion: FreeBodies, stand: Stand | None = None, load: JawLoad | None = None):
        """Take the motion's start, points of joints and numbers, and none of its equations.

        With a `stand` the frame is a body on supports, of the numbers `foundation.*`. It feels the
        opposite of the load on the jaw along the same line. A `load` stands in place of the
        constant one. With a number `rod.stiffness` a spring and damper of EXUDYN's library, with
        that preload, pulls at jaw and frame.
        """
        of = motion.numbers
        self.motion = motion
        self.parts = parts = Parts(of["gravity"])
        at, base, base_node = stand or Stand(), parts.ground, None
        if stand is not None:
            mass, inertia = of["foundation.mass"], of["foundation.inertia"]
            start = at.place(at.centre), at.rotation, 0j, 0.0
            base, base_node = parts.body(mass, inertia, *start)
            self._supports(base, at.centre)
            for name, kind in (("displacement", "Displacement"), ("rotation", "Rotation")):
                seen = getattr(KINDS, kind)
                sensor = items.SensorNode(nodeNumber=base_node, outputVariableType=seen)
                parts.sensor(name, sensor)
        to_s1 = motion.unbalance / motion.shaft_mass
        axis, moving = (complex(*motion.start[k : k + 2]) for k in (6, 14))
        s1, velocity = axis + to_s1, (moving + 1j * of["speed"] * to_s1) * at.axis
        turning = of["shaft.inertia"], at.place(s1), at.rotation, velocity, of["speed"]
        shaft, node = parts.body(motion.shaft_mass, *turning)
        bodies = {"frame": base, "shaft": shaft}
        for name in ("jaw", "toggle"):
            rows = ROWS[name]
            (x, y, angle), (u, v, spin) = motion.start[:8][rows], motion.start[8:16][rows]
            moving = angle + at.rotation, complex(u, v) * at.axis, spin
            mass, inertia = of[f"{name}.mass"], of[f"{name}.inertia"]
            bodies[name], _ = parts.body(mass, inertia, at.place(complex(x, y)), *moving)
        # Points of shaft and frame are given from O and from C.
        shifts = {"shaft": -to_s1, "frame": -at.centre if stand else 0j}
        parts.drive("drive", node, of["speed"], base_node)
        for joint, (bore_body, bore_point, pin_body, pin_point) in motion.joints.items():
            bore = parts.marker(bodies[bore_body], bore_point + shifts.get(bore_body, 0j))
            pin = parts.marker(bodies[pin_body], pin_point + shifts.get(pin_body, 0j))
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
        if "rod.stiffness" in of:
            self._rod(base, bodies["jaw"])
        if load is None:
            place, force = 0j, {"loadVector": xyz(complex(-of["load"]))}
        else:
            place = motion.joints["A"][1] - load.along
            force = {"loadVectorUserFunction": lambda s, time, v: xyz(load.force(time))}
        marker = parts.marker(bodies["jaw"], place)
        parts.system.AddLoad(items.LoadForceVector(markerNumber=marker, bodyFixed=True, **force))
        if stand is not None:
            self._react(base, bodies["jaw"])

    def _supports(self, base, centre: complex) -> None:
        of, parts = self.motion.numbers, self.parts
        stiffness, damping = (
            complex(of[f"foundation.horizontal_{what}"], of[f"foundation.vertical_{what}"])
            for what in ("stiffness", "damping")
        )
        for side in ("left", "right"):
            foot = complex(of[f"foundation.{side}"], of["foundation.base"])
            markers = parts.marker(parts.ground, foot), parts.marker(base, foot - centre)
            parts.support(side, *markers, stiffness, damping)

    def _rod(self, base, jaw) -> None:
        """Pull at the jaw; the length without stretch is that at the start."""
        of, parts = self.motion.numbers, self.parts
        own = self.motion.joints["A"][1] - of["rod.jaw_along"] - 1j * of["rod.jaw_across"]
        x, y, angle = self.motion.start[ROWS["jaw"]]
        end, foot = complex(x, y) + np.exp(1j * angle) * own, complex(of["rod.x"], of["rod.y"])
        parts.system.AddObject(
            items.ObjectConnectorSpringDamper(
                markerNumbers=[parts.marker(base, foot), parts.marker(jaw, own)],
                referenceLength=abs(end - foot),
                stiffness=of["rod.stiffness"],
                damping=of["rod.damping"],
                force=of["rod.preload"],
            )
        )

    def _react(self, base, jaw) -> None:
        """Add the load's opposite on the frame."""
        of, parts = self.motion.numbers, self.parts
        centre, ahead, own = (
            parts.marker(jaw, 0j),
            parts.marker(jaw, 1 + 0j),
            parts.marker(base, 0j),
        )

        def opposite(system) -> tuple[complex, float]:
            """Return the force on the frame, and its moment about G."""
            places = [
                complex(*system.GetMarkerOutput(marker, KINDS.Position)[:2])
                for marker in (centre, ahead, own)
            ]
            force = of["load"] * (places[1] - places[0])
            return force, ((places[0] - places[2]).conjugate() * force).imag

        parts.system.AddLoad(
            items.LoadForceVector(
                markerNumber=own, loadVectorUserFunction=lambda s, t, v: xyz(opposite(s)[0])
            )
        )
        parts.system.AddLoad(
            items.LoadTorqueVector(
                markerNumber=own, loadVectorUserFunction=lambda s, t, v: [0.0, 0.0, opposite(s)[1]]
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
                forces[joint] = planar(joint) * (1.0 if joint in "CO" else axis)
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
            "bearing_reaction": -forces["O"],
        }
        return pairs(known)

"""The crusher of `crusher_bodies` in EXUDYN: its bodies, ideal joints and contacts.

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

from benchmarks.peers.any_linkage import AnyLinkage
from benchmarks.peers.crusher_bodies import JOINTS, PREFIXES, REACTIONS
from benchmarks.peers.equations import pairs
from benchmarks.peers.exudyn_parts import Parts, xyz
from benchmarks.peers.loose_joint import V0, V1

KINDS = exu.OutputVariableType


@dataclass(frozen=True)
class JawLoad:
    """A force on the jaw over time, in axes that turn with it: x from B to A; N and s."""

    along: float  # from A towards B to where it acts, m
    force: Callable[[float], complex]


class Model:
    """The mechanism at the motion's start, and its sensors."""

    def __init__(self, motion: AnyLinkage, load: JawLoad | None = None):
        """Take the motion's start, points of joints and numbers, and none of its equations.

        A frame on supports feels the opposite of the constant load on the jaw along the same line.
        A `load` stands in place of the constant one. With a number `rod.stiffness` a spring and
        damper of EXUDYN's library, with that preload, pulls at jaw and frame.
        """
        self.motion = motion
        speed, gravity, masses, ends, arms, laws, _, loads, supports = motion.numbers
        self.parts = parts = Parts(gravity)
        places, rates = motion.start.reshape(2, -1, 3)
        bodies, nodes = [], []
        for own, (x, y, angle), (u, v, spin) in zip(masses, places, rates, strict=True):
            (mass, inertia), body, node = own, parts.ground, None
            if np.isfinite(mass):
                body, node = parts.body(mass, inertia, complex(x, y), angle, complex(u, v), spin)
            bodies.append(body)
            nodes.append(node)
        (frame, _, jaw, _), (base, shaft, _, _) = bodies, nodes
        if len(supports):
            for name, kind in (("displacement", "Displacement"), ("rotation", "Rotation")):
                sensor = items.SensorNode(nodeNumber=base, outputVariableType=getattr(KINDS, kind))
                parts.sensor(name, sensor)
        for side, row in zip(("left", "right"), supports, strict=False):
            arm, foot, *law = map(complex, row)
            parts.support(side, parts.marker(parts.ground, foot), parts.marker(frame, arm), *law)
        parts.drive("drive", shaft, speed, base)
        for (joint, *_), of, on, law in zip(JOINTS, ends, arms, laws, strict=True):
            bore, pin = (parts.marker(bodies[i], arm) for i, arm in zip(of, on, strict=True))
            if joint not in motion.loose:
                parts.joint(joint, bore, pin)
                continue
            parts.place(f"{joint} bore", bore)
            parts.place(f"{joint} pin", pin)
            if law[6]:
                raise ValueError(f"Argument `motion` must be dry, but has a film at {joint}.")
            clearance, radius, stiffness, _, friction, _ = law[:6]
            names = (f"joints.{joint}.{name}" for name in ("restitution", "impact_velocity"))
            impact = (motion.values[name] for name in names)
            parts.contact(joint, pin, bore, (radius - clearance, radius), stiffness, *impact)
            if friction:
                self._friction(joint, law, bore, pin)
        parts.sensor("jaw", items.SensorBody(bodyNumber=jaw, outputVariableType=KINDS.Rotation))
        if "rod.stiffness" in motion.values:
            self._rod(frame, jaw, arms[0, 0])
        if load is None:
            place, force = loads[0, 1], {"loadVector": xyz(loads[0, 2])}
        else:
            place = arms[0, 0] - load.along
            force = {"loadVectorUserFunction": lambda s, time, v: xyz(load.force(time))}
        marker = parts.marker(jaw, place)
        parts.system.AddLoad(items.LoadForceVector(markerNumber=marker, bodyFixed=True, **force))
        if len(supports):
            self._react(frame, jaw)

    def _rod(self, base, jaw, to_a: complex) -> None:
        """Pull at the jaw; the length without stretch is that at the start."""
        of, parts = self.motion.values, self.parts
        own = to_a - of["rod.jaw_along"] - 1j * of["rod.jaw_across"]
        x, y, angle = self.motion.start[6:9]
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
        force, parts = -self.motion.numbers[7][0, 2], self.parts
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
            turned = force * (places[1] - places[0])
            return turned, ((places[0] - places[2]).conjugate() * turned).imag

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

    def _friction(self, joint: str, law, bore, pin) -> None:
        """Add friction's loads on both bodies; that on the pin is kept."""
        clearance, radius, stiffness, damping, friction, of_centre = law[:6]

        def rub(system) -> tuple[complex, float, float]:
            """Return the bore's force, and moments about the bore's and the pin's centre."""

            def see(marker, kind):
                return system.GetMarkerOutput(marker, kind)

            places = [complex(*see(marker, KINDS.Position)[:2]) for marker in (bore, pin)]
            e = places[1] - places[0]
            depth = abs(e) - clearance
            if depth <= 0:
                return 0j, 0.0, 0.0
            speeds = [complex(*see(marker, KINDS.Velocity)[:2]) for marker in (bore, pin)]
            # The pin's motion along and across the line of centres.
            relative = (speeds[1] - speeds[0]) * abs(e) / e
            arms = radius, radius - abs(e)
            slip = -relative.imag
            if not of_centre:
                spins = [see(marker, KINDS.AngularVelocityLocal)[2] for marker in (bore, pin)]
                slip += spins[0] * arms[0] - spins[1] * arms[1]
            normal = stiffness * depth**1.5 * (1 + damping * relative.real)
            share = np.clip((abs(slip) - V0) / (V1 - V0), 0.0, 1.0) * np.sign(slip)
            size = -friction * share * normal
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
        """Return histories by the names of `crusher_bodies.observe`, and `time` (s).

        Every `every` seconds to `end`, in steps of `step` (s); see `Parts.run`.
        """
        raw = self.parts.run(end, step, every, radius)
        # A rotation is that from the start; a joint's force is in the jaw's axes at A and at B.
        axis = np.exp(1j * (self.motion.start[8] + raw["jaw"][:, 1]))

        def planar(name: str) -> np.ndarray:
            return raw[name][:, 1] + 1j * raw[name][:, 2]

        known = {"time": raw["jaw"][:, 0]}
        for joint, bore, _ in JOINTS:
            # A connector's force is that on the first marker's body: the bore's, or the pin's.
            force, prefix = planar(joint), PREFIXES[joint]
            if joint in self.motion.loose:
                known[prefix + "eccentricity"] = planar(f"{joint} pin") - planar(f"{joint} bore")
                known[prefix + "normal_force"] = abs(force)
                force = -force - (planar(f"{joint} friction") if f"{joint} friction" in raw else 0)
            elif bore == "jaw":
                force = force * axis
            name, sign = REACTIONS[joint]
            known[name] = sign * force
        return pairs(known)

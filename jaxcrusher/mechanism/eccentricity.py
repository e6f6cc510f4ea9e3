"""Two degrees of freedom for each joint with clearance: the eccentricity of its pin in its bore.

With the eccentricities known every dyad closes as an ideal one does, about shifted points. There
are no constraints and no drift, and no penetration is a difference of two large numbers. A free
crank and a frame on supports add their own states; with ideal joints there may be none at all.
"""

from jaxtyping import PyTree, Scalar
from typing_extensions import override

from jaxcrusher.basics.plane import Vector
from jaxcrusher.basics.record import Record
from jaxcrusher.joint.clearance import AbstractGap, Contact
from jaxcrusher.mechanism.drives import CrankState
from jaxcrusher.mechanism.equations import solve
from jaxcrusher.mechanism.motion import Motion, moving
from jaxcrusher.mechanism.named import Named
from jaxcrusher.mechanism.scene import AbstractFormulation, Scene
from jaxcrusher.mechanism.snapshot import Snapshot
from jaxcrusher.mechanism.starts import start_of
from jaxcrusher.mechanism.state import (
    FrameState,
    Parts,
    contacts_of,
    frame_rate,
    frame_units,
    initial_frame,
    snapshot_of,
)


class JointState(Record):
    """State of one joint, scaled to order one so that one tolerance fits all entries."""

    relative_eccentricity: Vector  # e / c
    rate: Vector  # e', m/s
    memory: PyTree[Scalar] | None  # of its bearing


class EccentricityState(Record):
    """State of the joints with clearance, of a free crank, and of a frame on supports."""

    joints: Named[JointState]
    crank: CrankState | None = None
    frame: FrameState | None = None

    @property
    def parts(self) -> Parts:
        """Return the parts of the state."""
        return Parts(
            self.joints.map(lambda at: at.relative_eccentricity),
            self.joints.map(lambda at: at.rate),
            self.joints.map(lambda at: at.memory),
            None if self.crank is None else self.crank.angle,
            self.frame,
        )


class EccentricityFormulation(AbstractFormulation):
    """Kane's equations in eccentricities, and in the spins of what is held together."""

    @override
    def initial(self, scene: Scene) -> EccentricityState:
        def one(joint: AbstractGap, e: Vector, rate: Vector) -> JointState:
            return JointState(e / joint.clearance, rate, joint.initial_memory())

        joints = scene.joints.map(one, *start_of(scene).eccentricities(scene))
        return EccentricityState(joints, scene.drive.initial(), initial_frame(scene))

    @override
    def motion(self, time: Scalar, state: EccentricityState, scene: Scene) -> Motion:
        parts = state.parts
        e = scene.joints.map(lambda one, at: one.clearance * at, parts.eccentricities)
        return moving(scene.linkage, scene.drive.crank(time, state.crank), e, parts.rates)

    @override
    def snapshot(self, time: Scalar, state: EccentricityState, scene: Scene) -> Snapshot:
        frame = None if state.frame is None else frame_units(scene).motion(state.frame)
        motion = self.motion(time, state, scene)
        contacts = contacts_of(scene, motion, state.parts.memories)
        torque = scene.drive.torque(time, motion.crank)
        return snapshot_of(scene, motion, contacts, torque, frame, solve)

    @override
    def rate(self, snapshot: Snapshot, state: EccentricityState, scene: Scene) -> EccentricityState:
        found = snapshot.accelerations

        def one(joint: AbstractGap, at: JointState, contact: Contact, second: Vector) -> JointState:
            memory = joint.memory_rate(contact, at.memory)
            return JointState(at.rate / joint.clearance, second, memory)

        joints = scene.joints.map(one, state.joints, snapshot.contacts, found.eccentricities)
        crank = scene.drive.rate(snapshot.motion.crank, found.past_frame(scene.linkage.crank))
        return EccentricityState(joints, crank, frame_rate(scene, snapshot.frame, found))

    @override
    def tolerance(self, scene: Scene, rtol: Scalar | float) -> Scalar | float:
        """Return the same: the state is e / c itself, and all else is of order one."""
        return rtol

"""Two degrees of freedom for each joint with clearance: the eccentricity of its pin in its bore.

With the eccentricities known every dyad closes as an ideal one does, about shifted points. No
constraints, no drift, and no penetration is a difference of two large numbers. A free crank and a
frame on supports add their own states; with ideal joints there may be none at all.
"""

import equinox as eqx
from jaxtyping import Scalar

from jaxcrusher.basics.plane import Vector
from jaxcrusher.basics.record import Record
from jaxcrusher.joint.clearance import AbstractBearing, Contact
from jaxcrusher.mechanism.drives import CrankState, from_nearest_turn
from jaxcrusher.mechanism.equations import solve
from jaxcrusher.mechanism.frame import FrameState, frame_rate, frame_units, initial_frame
from jaxcrusher.mechanism.motion import moving
from jaxcrusher.mechanism.named import Named
from jaxcrusher.mechanism.scene import AbstractFormulation, AbstractScene
from jaxcrusher.mechanism.snapshot import Snapshot
from jaxcrusher.mechanism.starts import start_of
from jaxcrusher.mechanism.state import contacts_of, snapshot_of


class JointState(Record):
    """State of one joint, scaled to order one so that one tolerance fits all entries."""

    relative_eccentricity: Vector  # e / c
    rate: Vector  # e', m/s
    impact_velocity: Scalar | None  # the normal law's memory, m/s


class EccentricityState(Record):
    """State of the joints with clearance, of a free crank, and of a frame on supports."""

    joints: Named[JointState]
    crank: CrankState | None = None
    frame: FrameState | None = None


class EccentricityFormulation(AbstractFormulation):
    """Kane's equations in eccentricities, and in the spins of what is held together."""

    def initial(self, scene: AbstractScene) -> EccentricityState:
        """Return what the scene's start says, with crank and frame at theirs."""
        joints = scene.joints.map(joint_state, *start_of(scene).eccentricities(scene))
        return EccentricityState(joints, scene.drive.initial(), initial_frame(scene))

    def snapshot(self, time: Scalar, state: EccentricityState, scene: AbstractScene) -> Snapshot:
        """Return an instant: places first, then the forces, then the accelerations."""
        frame = None if state.frame is None else frame_units(scene).motion(state.frame)
        e = scene.joints.map(lambda one, at: one.clearance * at.relative_eccentricity, state.joints)
        rates = state.joints.map(lambda at: at.rate)
        motion = moving(scene.linkage, scene.drive.crank(time, state.crank), e, rates)
        contacts = contacts_of(scene, motion, state.joints.map(lambda at: at.impact_velocity))
        torque = scene.drive.torque(time, motion.crank)
        return snapshot_of(scene, motion, contacts, torque, frame, solve)

    def rate(
        self, snapshot: Snapshot, state: EccentricityState, scene: AbstractScene
    ) -> EccentricityState:
        """Return e' and e'', and the rates of crank and frame."""
        found = snapshot.accelerations

        def one(
            joint: AbstractBearing, at: JointState, contact: Contact, second: Vector
        ) -> JointState:
            memory = joint.memory_rate(contact, at.impact_velocity)
            return JointState(at.rate / joint.clearance, second, memory)

        joints = scene.joints.map(one, state.joints, snapshot.contacts, found.eccentricities)
        crank = scene.drive.rate(snapshot.motion.crank, found.past_frame(scene.linkage.crank))
        return EccentricityState(joints, crank, frame_rate(scene, snapshot.frame, found))

    def unwound(self, state: EccentricityState) -> EccentricityState:
        """Return the state with a free crank's angle unwound; nothing else of it is an angle."""
        if state.crank is None:
            return state
        angle = from_nearest_turn(state.crank.angle)
        return eqx.tree_at(lambda s: s.crank.angle, state, angle)

    def tolerance(self, scene: AbstractScene, rtol: Scalar | float) -> Scalar | float:
        """Return the same: the state is e / c itself, and all else is of order one."""
        return rtol


def joint_state(joint: AbstractBearing, eccentricity: Vector, rate: Vector) -> JointState:
    """Return a joint that begins with e (m) and e' (m/s)."""
    memory = joint.normal.impact_velocity.initial()
    return JointState(eccentricity / joint.clearance, rate, memory)

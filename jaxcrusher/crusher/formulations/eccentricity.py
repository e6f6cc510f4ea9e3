"""Two degrees of freedom for each joint with clearance: the eccentricity of its pin in its bore.

With a clearance there is no closed loop: the jaw's bearing is at A_jaw = A_shaft - e_A, its lower
end e_B off the toggle's pin, the toggle's foot e_C off the frame's pivot, and the eccentricities
determine the rest. No constraints, no drift, and no penetration is a difference of two large
numbers.
"""

import dataclasses

import equinox as eqx
from jaxtyping import Scalar

from jaxcrusher.basics.plane import Vector
from jaxcrusher.crusher import free_bodies, linkage
from jaxcrusher.crusher.applied import applied
from jaxcrusher.crusher.drives import ShaftState
from jaxcrusher.crusher.interfaces import AbstractFormulation, AbstractScene, AbstractStart
from jaxcrusher.crusher.joints import AtJoints
from jaxcrusher.crusher.linkage import InertialForces
from jaxcrusher.crusher.moving_frame import FrameState, frame_rate, initial_frame, with_frame
from jaxcrusher.crusher.snapshot import (
    Snapshot,
    chain_of,
    crank_motion,
    moment_on_shaft,
    pin_acceleration,
    shaft_inertia,
)
from jaxcrusher.joint.clearance import AbstractBearing, Contact


class JointState(eqx.Module):
    """State of one joint, scaled to order one so that one tolerance fits all entries."""

    relative_eccentricity: Vector  # e / c
    rate: Vector  # e', m/s
    impact_velocity: Scalar | None  # the normal law's memory, m/s


class EccentricityState(eqx.Module):
    """State of the joints with clearance, of a free shaft, and of a frame on supports."""

    joints: AtJoints[JointState]
    shaft: ShaftState | None
    frame: FrameState | None = None

    def unwound(self) -> "EccentricityState":
        """Return the state with the angle of a free shaft counted from the nearest whole turn."""
        if self.shaft is None:
            return self
        return EccentricityState(self.joints, self.shaft.unwound(), self.frame)


class EccentricityFormulation(AbstractFormulation):
    """Newton-Euler in eccentricity coordinates.

    Of the open chain C-B-A if the main joint alone is loose, of free bodies if B or C is.
    """

    def initial(self, scene: AbstractScene) -> EccentricityState:
        """As the scene's start says."""
        start = start_of(scene)
        return EccentricityState(
            scene.joints.map(joint_state, *start.eccentricities(scene)),
            scene.drive.initial(),
            initial_frame(scene),
        )

    def snapshot(self, time: Scalar, state: EccentricityState, scene: AbstractScene) -> Snapshot:
        """Contacts first, then the accelerations."""
        machine = scene.machine
        shaft = crank_motion(*scene.drive.motion(time, state.shaft))
        eccentricities = scene.joints.map(
            lambda joint, at: joint.clearance * at.relative_eccentricity, state.joints
        )
        rates = state.joints.map(lambda at: at.rate)
        chain = chain_of(machine, shaft, eccentricities, rates)
        memories = state.joints.map(lambda at: at.impact_velocity)
        contacts = contacts_of(scene, eccentricities, rates, chain, shaft.speed, memories)
        on_jaw = applied(scene, shaft, chain)
        main, moments = contacts.main, (None, None)
        if main is not None:
            moments = main.bearing_moment, main.journal_moment

        def mechanism(inertial: InertialForces | None) -> Snapshot:
            if scene.joints.only_main:
                assert main is not None
                force = main.force
                acceleration = linkage.chain_acceleration(
                    machine, chain, on_jaw.total, force, moments[0], inertial
                )
                # The moment arm of the joint's force is counted from O to A_shaft, that of the
                # contact point from there.
                moment = moment_on_shaft(machine, shaft.crank, force, moments[1], inertial)
                spin_up = scene.drive.acceleration(moment, shaft_inertia(machine))
                moving = dataclasses.replace(shaft, acceleration=spin_up)
            else:
                moving, acceleration, force = free_bodies.accelerations(
                    machine, shaft, scene.drive, chain, on_jaw.total, contacts, inertial
                )
            return Snapshot(
                moving, chain, acceleration, contacts, eccentricities, force, *moments, on_jaw, None
            )

        return with_frame(scene, state.frame, shaft, chain, mechanism)

    def rate(
        self, snapshot: Snapshot, state: EccentricityState, scene: AbstractScene
    ) -> EccentricityState:
        """By e'': the pin's acceleration less the bore's."""
        second = snapshot.chain_acceleration.play
        if scene.joints.only_main:
            bearing = linkage.joint_acceleration(
                scene.machine, snapshot.chain, snapshot.chain_acceleration
            )
            second = AtJoints(main=pin_acceleration(scene.machine, snapshot.shaft) - bearing)

        def one(
            joint: AbstractBearing, at: JointState, contact: Contact, second: Vector
        ) -> JointState:
            memory = joint.memory_rate(contact, at.impact_velocity)
            return JointState(at.rate / joint.clearance, second, memory)

        return EccentricityState(
            scene.joints.map(one, state.joints, snapshot.contacts, second),
            scene.drive.rate(snapshot.shaft.speed, snapshot.shaft.acceleration),
            frame_rate(snapshot.frame, scene),
        )

    def unwound(self, state: EccentricityState) -> EccentricityState:
        """Only a free shaft's angle is part of the state."""
        return state.unwound()

    def tolerance(self, scene: AbstractScene, rtol: Scalar | float) -> Scalar | float:
        """The state is e / c itself."""
        return rtol


def joint_state(joint: AbstractBearing, eccentricity: Vector, rate: Vector) -> JointState:
    """A joint that begins with e (m) and e' (m/s)."""
    memory = joint.normal.impact_velocity.initial()
    return JointState(eccentricity / joint.clearance, rate, memory)


def contacts_of(
    scene: AbstractScene,
    eccentricities: AtJoints[Vector],
    rates: AtJoints[Vector],
    chain: linkage.Chain,
    speed: Scalar,
    memories: AtJoints[Scalar],
) -> AtJoints[Contact]:
    """Return the contacts of the joints with clearance.

    `speed` (rad/s) is the shaft's, `memories` are those of the normal laws.
    """
    bearings = AtJoints(chain.jaw_spin, chain.jaw_spin, 0.0)
    journals = AtJoints(speed, chain.toggle_spin, chain.toggle_spin)
    return scene.joints.map(
        lambda joint, *seen: joint.contact(*seen),
        eccentricities,
        rates,
        bearings,
        journals,
        memories,
    )


def start_of(scene: AbstractScene) -> AbstractStart:
    """The scene's start, which a formulation with clearance cannot do without."""
    if scene.start is None or not any(scene.joints.present()):
        raise ValueError(
            "Argument `scene` must have a clearance joint and a start for this formulation, "
            f"but has joint {scene.joint} and start {scene.start}."
        )
    return scene.start

"""Two degrees of freedom: the eccentricity of the pin in its bore and its rate.

With a clearance at A there is no closed loop: the jaw's bearing is at A_jaw = A_shaft - e,
and e determines the rest. No constraints, no drift, and the penetration is not a difference
of two large numbers.
"""

import equinox as eqx
from jaxtyping import Scalar

from jaxcrusher.basics.plane import Vector
from jaxcrusher.crusher import linkage
from jaxcrusher.crusher.drives import ShaftState
from jaxcrusher.crusher.interfaces import AbstractFormulation, AbstractScene
from jaxcrusher.crusher.snapshot import (
    ShaftMotion,
    Snapshot,
    crank_motion,
    moment_on_shaft,
    pin_acceleration,
    pin_position,
    pin_velocity,
    shaft_inertia,
)


class EccentricityState(eqx.Module):
    """All of order one, so that one tolerance fits."""

    relative_eccentricity: Vector  # e / c
    rate: Vector  # e', m/s
    impact_velocity: Scalar | None  # the normal law's memory, m/s
    shaft: ShaftState | None


class EccentricityFormulation(AbstractFormulation):
    """Newton-Euler of the open chain C-B-A, in eccentricity coordinates."""

    def initial(self, scene: AbstractScene) -> EccentricityState:
        """As the scene's start says."""
        joint, start = clearance_joint(scene)
        eccentricity, rate = start.eccentricity(scene)
        return EccentricityState(
            eccentricity / joint.clearance,
            rate,
            joint.normal.impact_velocity.initial(),
            scene.drive.initial(),
        )

    def snapshot(self, time: Scalar, state: EccentricityState, scene: AbstractScene) -> Snapshot:
        """Contact first, then the chain's two equations."""
        machine, (joint, _) = scene.machine, clearance_joint(scene)
        shaft = crank_motion(*scene.drive.motion(time, state.shaft))
        eccentricity = joint.clearance * state.relative_eccentricity
        chain = linkage.assemble(
            machine,
            pin_position(machine, shaft.crank) - eccentricity,
            pin_velocity(machine, shaft) - state.rate,
        )
        contact = joint.contact(
            eccentricity, state.rate, chain.jaw_spin, shaft.speed, state.impact_velocity
        )
        velocity = linkage.mass_centre_velocity(machine, chain)
        load = None if scene.load is None else scene.load.force(chain.jaw, velocity)
        acceleration = linkage.chain_acceleration(
            machine, chain, load, contact.force, contact.bearing_moment
        )
        moment = moment_on_shaft(machine, shaft.crank, contact.force, contact.journal_moment)
        # The moment arm of the joint's force is counted from O to A_shaft, that of the
        # contact point from there.
        shaft = ShaftMotion(
            shaft.crank, shaft.speed, scene.drive.acceleration(moment, shaft_inertia(machine))
        )
        return Snapshot(
            shaft,
            chain,
            acceleration,
            contact,
            eccentricity,
            contact.force,
            contact.bearing_moment,
            contact.journal_moment,
            load,
            None,
        )

    def rate(
        self, snapshot: Snapshot, state: EccentricityState, scene: AbstractScene
    ) -> EccentricityState:
        """By e'': the pin's acceleration less the bearing's."""
        machine, (joint, _) = scene.machine, clearance_joint(scene)
        assert snapshot.contact is not None
        bearing_acceleration = linkage.joint_acceleration(
            machine, snapshot.chain, snapshot.chain_acceleration
        )
        return EccentricityState(
            state.rate / joint.clearance,
            pin_acceleration(machine, snapshot.shaft) - bearing_acceleration,
            joint.memory_rate(snapshot.contact, state.impact_velocity),
            scene.drive.rate(snapshot.shaft.speed, snapshot.shaft.acceleration),
        )

    def unwound(self, state: EccentricityState) -> EccentricityState:
        """Only a free shaft's angle is part of the state."""
        if state.shaft is None:
            return state
        return eqx.tree_at(lambda s: s.shaft, state, state.shaft.unwound())

    def tolerance(self, scene: AbstractScene, rtol: Scalar | float) -> Scalar | float:
        """The state is e / c itself."""
        return rtol


def clearance_joint(scene: AbstractScene):
    """The scene's joint and start, which a formulation with clearance cannot do without."""
    if scene.joint is None or scene.start is None:
        raise ValueError(
            "Argument `scene` must have a clearance joint and a start for this formulation, "
            f"but has joint {scene.joint} and start {scene.start}."
        )
    return scene.joint, scene.start

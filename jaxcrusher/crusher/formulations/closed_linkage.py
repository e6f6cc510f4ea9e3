"""Ideal joints: a closed linkage, its motion given by the shaft's."""

import jax.numpy as jnp
from jaxtyping import Scalar

from jaxcrusher.basics.plane import Vector
from jaxcrusher.crusher import linkage
from jaxcrusher.crusher.drives import ShaftState
from jaxcrusher.crusher.interfaces import AbstractFormulation, AbstractScene
from jaxcrusher.crusher.joints import AtJoints
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


class ClosedLinkage(AbstractFormulation):
    """One degree of freedom or none: kinematics forwards, forces backwards."""

    def initial(self, scene: AbstractScene) -> ShaftState | None:
        """The shaft's, or nothing."""
        return scene.drive.initial()

    def snapshot(self, time: Scalar, state: ShaftState | None, scene: AbstractScene) -> Snapshot:
        """Inverse dynamics; a free shaft is solved for its acceleration first."""
        machine = scene.machine
        shaft = crank_motion(*scene.drive.motion(time, state))
        pin = pin_position(machine, shaft.crank)
        chain = linkage.assemble(machine, pin, pin_velocity(machine, shaft))
        velocity = linkage.mass_centre_velocity(machine, chain)
        load = None if scene.load is None else scene.load.force(chain.jaw, velocity)

        def joint_force(shaft: ShaftMotion) -> tuple[Vector, linkage.ChainAcceleration]:
            acceleration = linkage.chain_acceleration_to_reach(
                machine, chain, pin_acceleration(machine, shaft)
            )
            return linkage.joint_force_for(machine, chain, load, acceleration), acceleration

        force, acceleration = joint_force(shaft)
        if state is not None:
            # The force is linear in the shaft's acceleration: two points give the line.
            unit = ShaftMotion(shaft.crank, shaft.speed, jnp.ones_like(shaft.speed))
            slope = joint_force(unit)[0] - force
            moment = moment_on_shaft(machine, shaft.crank, force, None)
            arm = machine.shaft.eccentricity * shaft.crank
            inertia = shaft_inertia(machine) + arm.cross(slope)
            shaft = ShaftMotion(shaft.crank, shaft.speed, scene.drive.acceleration(moment, inertia))
            force, acceleration = joint_force(shaft)
        none = AtJoints()
        return Snapshot(shaft, chain, acceleration, none, none, force, None, None, load, None)

    def rate(
        self, snapshot: Snapshot, state: ShaftState | None, scene: AbstractScene
    ) -> ShaftState | None:
        """The shaft's, or nothing."""
        return scene.drive.rate(snapshot.shaft.speed, snapshot.shaft.acceleration)

    def unwound(self, state: ShaftState | None) -> ShaftState | None:
        """The shaft's, or nothing."""
        return None if state is None else state.unwound()

    def tolerance(self, scene: AbstractScene, rtol: Scalar | float) -> Scalar | float:
        """Angles and speeds of order one."""
        return rtol

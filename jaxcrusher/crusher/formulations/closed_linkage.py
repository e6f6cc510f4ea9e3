"""Ideal joints: a closed linkage, its motion given by the shaft's."""

import dataclasses

import jax.numpy as jnp
from jaxtyping import Scalar

from jaxcrusher.basics.plane import Vector
from jaxcrusher.crusher import linkage
from jaxcrusher.crusher.applied import applied
from jaxcrusher.crusher.formulations.eccentricity import EccentricityState
from jaxcrusher.crusher.interfaces import AbstractFormulation, AbstractScene
from jaxcrusher.crusher.joints import AtJoints
from jaxcrusher.crusher.linkage import InertialForces
from jaxcrusher.crusher.moving_frame import frame_rate, initial_frame, with_frame
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
    """Kinematics forwards, forces backwards; a free shaft and a frame on supports have states."""

    def initial(self, scene: AbstractScene) -> EccentricityState:
        """Return the initial state of shaft and frame, or nothing."""
        return EccentricityState(AtJoints(), scene.drive.initial(), initial_frame(scene))

    def snapshot(self, time: Scalar, state: EccentricityState, scene: AbstractScene) -> Snapshot:
        """Inverse dynamics; a free shaft is solved for its acceleration first."""
        machine = scene.machine
        shaft = crank_motion(*scene.drive.motion(time, state.shaft))
        pin = pin_position(machine, shaft.crank)
        chain = linkage.assemble(machine, pin, pin_velocity(machine, shaft))
        on_jaw = applied(scene, shaft, chain)

        def mechanism(inertial: InertialForces | None) -> Snapshot:
            def joint_force(shaft: ShaftMotion) -> tuple[Vector, linkage.ChainAcceleration]:
                acceleration = linkage.chain_acceleration_to_reach(
                    machine, chain, pin_acceleration(machine, shaft)
                )
                force = linkage.joint_force_for(
                    machine, chain, on_jaw.total, acceleration, inertial
                )
                return force, acceleration

            moving = shaft
            force, acceleration = joint_force(moving)
            if state.shaft is not None:
                # The force is linear in the shaft's acceleration: two points give the line.
                unit = dataclasses.replace(shaft, acceleration=jnp.ones_like(shaft.speed))
                slope = joint_force(unit)[0] - force
                moment = moment_on_shaft(machine, shaft.crank, force, None, inertial)
                arm = machine.shaft.eccentricity * shaft.crank
                inertia = shaft_inertia(machine) + arm.cross(slope)
                spin_up = scene.drive.acceleration(moment, inertia)
                moving = dataclasses.replace(shaft, acceleration=spin_up)
                force, acceleration = joint_force(moving)
            none = AtJoints()
            return Snapshot(
                moving, chain, acceleration, none, none, force, None, None, on_jaw, None
            )

        return with_frame(scene, state.frame, shaft, chain, mechanism)

    def rate(
        self, snapshot: Snapshot, state: EccentricityState, scene: AbstractScene
    ) -> EccentricityState:
        """Return the rates of shaft and frame, or nothing."""
        shaft = scene.drive.rate(snapshot.shaft.speed, snapshot.shaft.acceleration)
        return EccentricityState(AtJoints(), shaft, frame_rate(snapshot.frame, scene))

    def unwound(self, state: EccentricityState) -> EccentricityState:
        """Only a free shaft's angle is part of the state."""
        return state.unwound()

    def tolerance(self, scene: AbstractScene, rtol: Scalar | float) -> Scalar | float:
        """Angles, speeds and the frame's coordinates are of order one."""
        return rtol

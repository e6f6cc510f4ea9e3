"""Interfaces between a scene, a start and a formulation."""

import abc

import equinox as eqx
from jaxtyping import PyTree, Scalar

from jaxcrusher.basics.plane import Vector
from jaxcrusher.crusher.drives import AbstractDrive
from jaxcrusher.crusher.foundation import AbstractFoundation, OnSupports
from jaxcrusher.crusher.joints import AtJoints
from jaxcrusher.crusher.loads import AbstractLoad
from jaxcrusher.crusher.machine import Machine
from jaxcrusher.crusher.rod import Rod
from jaxcrusher.crusher.snapshot import Snapshot
from jaxcrusher.joint.clearance import AbstractBearing


class AbstractScene(eqx.Module):
    """Who takes part, as starts and formulations see it; the one there is: `Scene`."""

    machine: eqx.AbstractVar[Machine]
    drive: eqx.AbstractVar[AbstractDrive]
    joint: eqx.AbstractVar[AbstractBearing | None]
    load: eqx.AbstractVar[AbstractLoad | None]
    formulation: eqx.AbstractVar["AbstractFormulation"]
    start: eqx.AbstractVar["AbstractStart | None"]
    elbow: eqx.AbstractVar[AbstractBearing | None]
    pivot: eqx.AbstractVar[AbstractBearing | None]
    foundation: eqx.AbstractVar[AbstractFoundation | None]
    rod: eqx.AbstractVar[Rod | None]

    @property
    def joints(self) -> AtJoints[AbstractBearing]:
        """Return the joints with clearance."""
        return AtJoints(self.joint, self.elbow, self.pivot)

    @property
    def supports(self) -> OnSupports | None:
        """Return what the frame moves on, or None where it is clamped."""
        return self.foundation if isinstance(self.foundation, OnSupports) else None


class AbstractStart(eqx.Module):
    """Where pins start in their bores."""

    @abc.abstractmethod
    def eccentricities(self, scene: AbstractScene) -> tuple[AtJoints[Vector], AtJoints[Vector]]:
        """The eccentricity e (m) and its rate (m/s) at time zero, of each joint with clearance."""


class AbstractFormulation(eqx.Module):
    """How the equations of motion of a scene are written and solved for the accelerations.

    A state is a PyTree of scalars. `time` is in seconds.
    """

    @abc.abstractmethod
    def initial(self, scene: AbstractScene) -> PyTree[Scalar]:
        """The state at time zero."""

    @abc.abstractmethod
    def snapshot(self, time: Scalar, state: PyTree[Scalar], scene: AbstractScene) -> Snapshot:
        """All accelerations and forces at a state."""

    @abc.abstractmethod
    def rate(
        self, snapshot: Snapshot, state: PyTree[Scalar], scene: AbstractScene
    ) -> PyTree[Scalar]:
        """The time derivative of the state, per second."""

    @abc.abstractmethod
    def unwound(self, state: PyTree[Scalar]) -> PyTree[Scalar]:
        """The same state, its shaft angle (if it holds one) counted from the nearest whole turn.

        So a motion goes on from the end of a turn as from angle zero.
        """

    @abc.abstractmethod
    def tolerance(self, scene: AbstractScene, rtol: Scalar | float) -> Scalar | float:
        """The solver's tolerance for an error of `rtol` clearances in the eccentricity."""

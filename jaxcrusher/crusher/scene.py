"""A scene: who takes part. What it leaves out is None, and is never traced."""

import abc

import equinox as eqx
from jaxtyping import PyTree, Scalar

from jaxcrusher.basics.checks import concrete, require, require_positive, require_x64
from jaxcrusher.basics.plane import Vector
from jaxcrusher.crusher.drives import AbstractDrive
from jaxcrusher.crusher.loads import AbstractLoad
from jaxcrusher.crusher.machine import Machine
from jaxcrusher.crusher.snapshot import Snapshot
from jaxcrusher.joint.clearance import ClearanceJoint


class AbstractStart(eqx.Module):
    """Where the pin starts in its bore."""

    @abc.abstractmethod
    def eccentricity(self, scene: "Scene") -> tuple[Vector, Vector]:
        """The eccentricity e (m) and its rate (m/s) at time zero."""


class AbstractFormulation(eqx.Module):
    """How the equations of motion of a scene are written and solved for the accelerations.

    A state is a PyTree of scalars. `time` is in seconds.
    """

    @abc.abstractmethod
    def initial(self, scene: "Scene") -> PyTree[Scalar]:
        """The state at time zero."""

    @abc.abstractmethod
    def snapshot(self, time: Scalar, state: PyTree[Scalar], scene: "Scene") -> Snapshot:
        """All accelerations and forces at a state."""

    @abc.abstractmethod
    def rate(self, snapshot: Snapshot, state: PyTree[Scalar], scene: "Scene") -> PyTree[Scalar]:
        """The time derivative of the state, per second."""

    @abc.abstractmethod
    def tolerance(self, scene: "Scene", rtol: Scalar | float) -> Scalar | float:
        """The solver's tolerance for an error of `rtol` clearances in the eccentricity."""


class Scene(eqx.Module):
    """A machine, what drives and loads it, its main joint (None: ideal) and how to solve it.

    Raises ValueError (concrete values only) if 64-bit floats are off, if the clearance is
    not inside (0, R_i), or if it lets the linkage reach a dead point.
    """

    machine: Machine
    drive: AbstractDrive
    joint: ClearanceJoint | None
    load: AbstractLoad | None
    formulation: AbstractFormulation
    start: AbstractStart | None

    def __check_init__(self):
        require_x64()
        if self.joint is not None:
            require_clearance(self.joint.clearance, self.joint.bore_radius)
            self.machine.require_assembly(self.joint.clearance)


def require_clearance(clearance, bore_radius) -> None:
    """Check 0 < clearance < bore radius (m)."""
    require_positive("clearance", clearance, "m")
    known, bore = concrete(clearance), concrete(bore_radius)
    if known is not None and bore is not None:
        limit = f"be smaller than the bore radius {bore.min():g} m"
        require(bool((known < bore).all()), "clearance", limit, clearance)

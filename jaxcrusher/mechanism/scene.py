"""What equations of motion ask of a scene, and what a scene asks of them."""

import abc

import equinox as eqx
from jaxtyping import PyTree, Scalar

from jaxcrusher.basics.plane import Vector
from jaxcrusher.joint.clearance import AbstractBearing
from jaxcrusher.mechanism.drives import AbstractDrive
from jaxcrusher.mechanism.equations import Wrench
from jaxcrusher.mechanism.linkage import Linkage
from jaxcrusher.mechanism.motion import Motion
from jaxcrusher.mechanism.named import Named
from jaxcrusher.mechanism.snapshot import Snapshot
from jaxcrusher.mechanism.supports import AbstractFoundation, OnSupports


class AbstractApplied(eqx.Module):
    """What acts on the bodies besides weight and joints.

    `wrenches` are forces and moments on bodies, and on the frame what it feels of them.
    """

    wrenches: eqx.AbstractVar[tuple[Wrench, ...]]


class AbstractScene(eqx.Module):
    """A linkage with its drive, its loose joints, and how its equations are written."""

    drive: eqx.AbstractVar[AbstractDrive]
    formulation: eqx.AbstractVar["AbstractFormulation"]
    start: eqx.AbstractVar["AbstractStart | None"]
    foundation: eqx.AbstractVar[AbstractFoundation | None]

    @property
    @abc.abstractmethod
    def linkage(self) -> Linkage:
        """Return bodies and joints."""

    @property
    @abc.abstractmethod
    def joints(self) -> Named[AbstractBearing]:
        """Return the joints with clearance."""

    @property
    @abc.abstractmethod
    def throw(self) -> Scalar:
        """Return how far the crank carries its pin, m: what a moving frame is measured by."""

    @abc.abstractmethod
    def applied(self, motion: Motion) -> AbstractApplied:
        """Return what acts on the bodies of a motion besides weight and joints."""

    @property
    def supports(self) -> OnSupports | None:
        """Return what the frame moves on, None where it is clamped."""
        return self.foundation if isinstance(self.foundation, OnSupports) else None

    @property
    def is_ideal(self) -> bool:
        """Whether no joint has clearance."""
        return len(self.joints) == 0


class AbstractStart(eqx.Module):
    """Where pins start in their bores."""

    @abc.abstractmethod
    def eccentricities(self, scene: AbstractScene) -> tuple[Named[Vector], Named[Vector]]:
        """Return e (m) and its rate (m/s) at time zero, of each joint with clearance."""


class AbstractFormulation(eqx.Module):
    """How the equations of motion of a scene are written and solved for the accelerations.

    A state is a PyTree of scalars. `time` is in seconds.
    """

    @abc.abstractmethod
    def initial(self, scene: AbstractScene) -> PyTree[Scalar]:
        """Return the state at time zero."""

    @abc.abstractmethod
    def snapshot(self, time: Scalar, state: PyTree[Scalar], scene: AbstractScene) -> Snapshot:
        """Return all accelerations and forces at a state."""

    @abc.abstractmethod
    def rate(
        self, snapshot: Snapshot, state: PyTree[Scalar], scene: AbstractScene
    ) -> PyTree[Scalar]:
        """Return the time derivative of the state, per second."""

    @abc.abstractmethod
    def unwound(self, state: PyTree[Scalar]) -> PyTree[Scalar]:
        """Return the same state, its crank angle (if it holds one) from the nearest whole turn.

        So a motion goes on from the end of a turn as from angle zero.
        """

    @abc.abstractmethod
    def tolerance(self, scene: AbstractScene, rtol: Scalar | float) -> Scalar | float:
        """Return the solver's tolerance for an error of `rtol` clearances in the eccentricity."""

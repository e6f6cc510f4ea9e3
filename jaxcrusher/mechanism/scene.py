"""What equations of motion ask of a scene, and what a scene asks of them."""

import abc
import dataclasses
from collections.abc import Callable, Iterable, Mapping
from typing import Any, ClassVar, Self

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import PyTree, Scalar

# Its integrator is made with the first scene, before a program of it is traced.
import jaxcrusher.basics.loops  # noqa: F401
from jaxcrusher.basics.checks import (
    primal,
    require,
    require_double,
    require_kind,
    require_own_process,
    require_positive,
)
from jaxcrusher.basics.plane import Vector
from jaxcrusher.basics.record import Printed
from jaxcrusher.joint.clearance import AbstractBearing
from jaxcrusher.mechanism.acting import Acting
from jaxcrusher.mechanism.drives import AbstractDrive
from jaxcrusher.mechanism.linkage import Linkage
from jaxcrusher.mechanism.motion import Motion
from jaxcrusher.mechanism.named import Named, before
from jaxcrusher.mechanism.reductions import Chosen, Statistic, chosen
from jaxcrusher.mechanism.snapshot import Observable, Snapshot
from jaxcrusher.mechanism.supports import AbstractFoundation, OnSupports


class AbstractScene(Printed):
    """A linkage with its drive, its loose joints, and how its equations are written."""

    # The statistic by which errors of a motion are judged.
    leading: ClassVar[str] = "shaking_rms"

    drive: eqx.AbstractVar[AbstractDrive]
    formulation: eqx.AbstractVar["AbstractFormulation"]
    start: eqx.AbstractVar["AbstractStart | None"]
    foundation: eqx.AbstractVar[AbstractFoundation | None]
    own: eqx.AbstractVar[Chosen]  # statistics of the user's own

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
    def applied(self, motion: Motion) -> Acting:
        """Return what acts on the bodies of a motion besides weight and joints."""

    @property
    @abc.abstractmethod
    def observables(self) -> Mapping[str, Observable]:
        """Return all that may be asked of an instant, by name."""

    @property
    def own_observables(self) -> tuple[str, ...]:
        """Return the names of those that this scene has: all of them, or fewer."""
        return tuple(self.observables)

    @property
    @abc.abstractmethod
    def statistics(self) -> Mapping[str, Statistic]:
        """Return all that may be asked of a motion, by name."""

    def with_statistics(self, own: Mapping[str, Statistic]) -> Self:
        """Return the scene with statistics of one's own, by name; they need not be asked for.

        They are part of its structure: a program is compiled anew for another function. Raises
        ValueError for a name that is none of Python, or is that of a statistic already.
        """
        for name in own:
            require(name.isidentifier(), "own", "have names as Python's", name)
            require(name not in self.statistics, "own", "have names of their own", name)
        return dataclasses.replace(self, own=(*self.own, *own.items()))

    def entries(self, names: Iterable[str] | None = None) -> Chosen:
        """Return the entries of these names; None: those of all that the scene has."""
        return chosen(self.statistics, self.own_statistics if names is None else names)

    @property
    def own_statistics(self) -> tuple[str, ...]:
        """Return the names of those that this scene has: all of them, or fewer."""
        return tuple(self.statistics)

    @property
    @abc.abstractmethod
    def usual_statistics(self) -> tuple[str, ...]:
        """Return the names of those that are computed without being asked for."""

    @property
    @abc.abstractmethod
    def works(self) -> Mapping[str, Callable[[Snapshot, "AbstractScene"], Scalar]]:
        """Return the powers (W) of loads, and what dampers at the bodies take, by their work."""

    @property
    @abc.abstractmethod
    def limits(self) -> Mapping[str, tuple[Callable[..., Any], tuple[str, ...]]]:
        """Return what else the model is limited by: a verdict on statistics, and their names."""

    @abc.abstractmethod
    def steady(self) -> "AbstractScene":
        """Return the scene under loads that repeat with the crank's turn."""

    @abc.abstractmethod
    def ideal(self) -> "AbstractScene":
        """Return the same scene with ideal joints: what a clearance adds to."""

    @property
    def supports(self) -> OnSupports | None:
        """Return what the frame moves on, None where it is clamped."""
        return self.foundation if isinstance(self.foundation, OnSupports) else None

    @property
    def is_ideal(self) -> bool:
        """Whether no joint has clearance."""
        return len(self.joints) == 0

    @property
    def has_unknowns(self) -> bool:
        """Whether a joint has clearance or the frame stands on supports: what an orbit is of."""
        return not self.is_ideal or self.supports is not None


class AbstractStart(eqx.Module):
    """Where pins start in their bores."""

    @abc.abstractmethod
    def eccentricities(self, scene: AbstractScene) -> tuple[Named[Vector], Named[Vector]]:
        """Return e (m) and its rate (m/s) at time zero, of each joint with clearance."""


class AbstractFormulation(eqx.Module):
    """How the equations of motion of a scene are written and solved for the accelerations.

    A state is a PyTree of scalars that tells its `parts` (`jaxcrusher.mechanism.state.Parts`).
    `time` is in seconds.
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
    def tolerance(self, scene: AbstractScene, rtol: Scalar | float) -> Scalar | float:
        """Return the solver's tolerance for an error of `rtol` clearances in the eccentricity."""


def require_scene(scene: Any) -> None:
    """Check that it is one scene, of 64-bit floats."""
    require_own_process()
    require_kind("scene", scene, AbstractScene, "jaxcrusher.paper_scene(30.0, 6e-5)")
    require_double("scene", scene)
    shapes = {"speed": jnp.shape(getattr(scene.drive, "speed", 0.0))}
    for joint, clearance in scene.joints.items():
        shapes[f"{before(joint)}clearance"] = jnp.shape(clearance.clearance)
    for name, shape in shapes.items():
        must = "be one number (jax.vmap and jaxcrusher.sweep take many)"
        require(shape == (), name, must, f"of shape {shape}")


def require_steady(scene: AbstractScene) -> None:
    """Check that the load repeats with the crank's turn, so that there is a map from turn to turn.

    Raises ValueError in one line.
    """
    good = scene.steady() is scene
    must = "have a load that repeats each turn"
    require(good, "scene", must, "a rough feed (load_scatter)")


def require_maker(scene: Callable[..., AbstractScene]) -> None:
    """Check that it is a function: of what it makes nothing is known yet."""
    makes = "be a function that makes a scene of the parameters, such as jaxcrusher.paper_scene"
    require(callable(scene), "scene", makes, f"a {type(scene).__name__}")


def require_clearance(clearance, bore_radius, prefix: str = "") -> None:
    """Check 0 < clearance < bore radius (m) of the joint whose parameters have a `prefix`."""
    require_positive(f"{prefix}clearance", clearance, "m")
    known, bore = primal(clearance), primal(bore_radius)
    if known is not None and bore is not None:
        limit = f"be smaller than the bore radius {bore.min():g} m"
        require(bool((known < bore).all()), f"{prefix}clearance", limit, clearance)

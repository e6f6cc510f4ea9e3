"""A scene: who takes part. What it leaves out is None, and is never traced."""

import dataclasses
from collections.abc import Callable
from typing import Any

import jax.numpy as jnp
from jaxtyping import Scalar

# Made with the first scene, before a program of it is traced.
import jaxcrusher.basics.integrator  # noqa: F401
from jaxcrusher.basics.checks import (
    concrete,
    require,
    require_double,
    require_kind,
    require_own_process,
    require_positive,
    require_x64,
)
from jaxcrusher.crusher.joints import before
from jaxcrusher.crusher.loads import AbstractLoad, JawForce, JawMotion
from jaxcrusher.crusher.machine import Machine
from jaxcrusher.crusher.rod import Rod, RodPull
from jaxcrusher.joint.clearance import AbstractBearing
from jaxcrusher.mechanism.drives import AbstractDrive
from jaxcrusher.mechanism.eccentricity import EccentricityFormulation
from jaxcrusher.mechanism.equations import Wrench, wrench_at
from jaxcrusher.mechanism.linkage import Linkage
from jaxcrusher.mechanism.motion import Motion
from jaxcrusher.mechanism.named import Named
from jaxcrusher.mechanism.scene import (
    AbstractApplied,
    AbstractFormulation,
    AbstractScene,
    AbstractStart,
)
from jaxcrusher.mechanism.supports import AbstractFoundation
from jaxcrusher.mechanism.topology import FRAME


class Applied(AbstractApplied):
    """Forces on the jaw by their source, None where there is none, and all they do to bodies."""

    load: JawForce | None
    rod: RodPull | None
    wrenches: tuple[Wrench, ...]


class Scene(AbstractScene):
    """A machine, what drives and loads it, its joints (None: ideal) and how to solve it.

    `joint` is the main one, A; `elbow` is B, `pivot` C, `shaft_bearing` O. With no `foundation` the
    frame is clamped, and moments on the ground are counted about C. A `rod` pulls the jaw onto its
    toggle.

    Raises ValueError (concrete values only) if 64-bit floats are off, if a clearance is not
    inside (0, R_i), or if the clearances let the linkage reach a dead point.
    """

    machine: Machine
    drive: AbstractDrive
    joint: AbstractBearing | None
    load: AbstractLoad | None
    formulation: AbstractFormulation
    start: AbstractStart | None
    elbow: AbstractBearing | None = None
    pivot: AbstractBearing | None = None
    foundation: AbstractFoundation | None = None
    rod: Rod | None = None
    shaft_bearing: AbstractBearing | None = None

    def __check_init__(self):
        require_x64()
        total = 0.0
        for name, joint in self.joints.items():
            prefix = "" if name == "main" else f"{name}."
            require_clearance(joint.clearance, joint.bore_radius, prefix)
            total = total + joint.clearance
        self.machine.require_assembly(total)

    @property
    def joints(self) -> Named[AbstractBearing]:
        """Return the joints with clearance."""
        every = {
            "main": self.joint,
            "elbow": self.elbow,
            "pivot": self.pivot,
            "shaft_bearing": self.shaft_bearing,
        }
        return Named({name: joint for name, joint in every.items() if joint is not None})

    @property
    def linkage(self) -> Linkage:
        """Return bodies and joints of the machine."""
        return self.machine.linkage

    @property
    def throw(self) -> Scalar:
        """Return the shaft's eccentricity, m."""
        return self.machine.shaft.eccentricity

    def applied(self, motion: Motion) -> Applied:
        """Return what load and rod do to the jaw, and to the frame by their reactions."""
        jaw, load, rod, wrenches = JawMotion(motion), None, None, []
        if self.load is not None:
            load = self.load.force(jaw)
            wrenches.append((jaw.point(load.along), load.force))
        if self.rod is not None:
            rod = self.rod.pull(jaw)
            wrenches.append((self.rod.end(jaw), rod.force))
        on_bodies = [wrench_at(motion, point, force) for point, force in wrenches]
        if self.supports is not None:
            # Each has its reaction on the frame, in the same line.
            for point, force in wrenches:
                arm = motion.position(point) - self.supports.point
                on_bodies.append(Wrench(FRAME, -force, arm.cross(-force)))
        return Applied(load=load, rod=rod, wrenches=tuple(on_bodies))

    def ideal(self) -> "Scene":
        """The same machine, drive and load with ideal joints: what a clearance adds to."""
        ideal = {"joint": None, "elbow": None, "pivot": None, "shaft_bearing": None, "start": None}
        return dataclasses.replace(self, formulation=EccentricityFormulation(), **ideal)


def require_scene(scene: Any) -> None:
    """Check that it is one scene, of 64-bit floats."""
    require_own_process()
    require_kind("scene", scene, Scene, "jaxcrusher.paper_scene(30.0, 6e-5)")
    require_double("scene", scene)
    shapes = {"speed": jnp.shape(getattr(scene.drive, "speed", 0.0))}
    for joint, clearance in scene.joints.items():
        shapes[f"{before(joint)}clearance"] = jnp.shape(clearance.clearance)
    for name, shape in shapes.items():
        must = "be one number (jax.vmap and jaxcrusher.sweep take many)"
        require(shape == (), name, must, f"of shape {shape}")


def require_maker(scene: Callable[..., Scene]) -> None:
    """Check that it is a function: of what it makes nothing is known yet."""
    makes = "be a function that makes a scene of the parameters, such as jaxcrusher.paper_scene"
    require(callable(scene), "scene", makes, f"a {type(scene).__name__}")


def require_clearance(clearance, bore_radius, prefix: str = "") -> None:
    """Check 0 < clearance < bore radius (m) of the joint whose parameters have a `prefix`."""
    require_positive(f"{prefix}clearance", clearance, "m")
    known, bore = concrete(clearance), concrete(bore_radius)
    if known is not None and bore is not None:
        limit = f"be smaller than the bore radius {bore.min():g} m"
        require(bool((known < bore).all()), f"{prefix}clearance", limit, clearance)

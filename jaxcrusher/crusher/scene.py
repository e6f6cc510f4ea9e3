"""A scene: who takes part. What it leaves out is None, and is never traced."""

import dataclasses
from collections.abc import Callable, Mapping
from typing import Any, ClassVar

import equinox as eqx
from jaxtyping import Scalar

from jaxcrusher.basics.checks import require, require_x64
from jaxcrusher.crusher.loads import AbstractLoad, JawMotion, RoughFeed
from jaxcrusher.crusher.machine import Machine
from jaxcrusher.crusher.observables import OBSERVABLES, observables_with
from jaxcrusher.crusher.statistics_table import STATISTIC, statistics_with, usual_with
from jaxcrusher.joint.clearance import AbstractBearing
from jaxcrusher.joint.rollers import STATIC_PRESSURE, RollerBearing
from jaxcrusher.joint.validity import RollerLoad, Tautness, Turning
from jaxcrusher.mechanism.acting import Acting, Spring, acting, push_power, spring_loss
from jaxcrusher.mechanism.drives import AbstractDrive
from jaxcrusher.mechanism.eccentricity import EccentricityFormulation
from jaxcrusher.mechanism.linkage import Linkage
from jaxcrusher.mechanism.linkage_statistics import may_rest
from jaxcrusher.mechanism.motion import Motion
from jaxcrusher.mechanism.named import Named
from jaxcrusher.mechanism.reductions import Chosen, Statistic
from jaxcrusher.mechanism.scene import (
    AbstractFormulation,
    AbstractScene,
    AbstractStart,
    require_clearance,
)
from jaxcrusher.mechanism.snapshot import Observable, Snapshot
from jaxcrusher.mechanism.supports import AbstractFoundation


class Scene(AbstractScene):
    """A machine, what drives and loads it, its joints (None: ideal) and how to solve it.

    `joint` is the main one, A; `elbow` is B, `pivot` C, `shaft_bearing` O. With no `foundation` the
    frame is clamped, and moments on the ground are counted about C. A `rod` pulls the jaw onto its
    toggle. `own` is what `with_statistics` adds.

    Raises ValueError (concrete values only) if 64-bit floats are off, if a clearance is not
    inside (0, R_i), or if the clearances let the linkage reach a dead point.
    """

    leading: ClassVar[str] = "foundation_rms"

    machine: Machine
    drive: AbstractDrive
    joint: AbstractBearing | None
    load: AbstractLoad | None
    formulation: AbstractFormulation
    start: AbstractStart | None
    elbow: AbstractBearing | None = None
    pivot: AbstractBearing | None = None
    foundation: AbstractFoundation | None = None
    rod: Spring | None = None
    shaft_bearing: AbstractBearing | None = None
    own: Chosen = eqx.field(static=True, default=())

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

    def applied(self, motion: Motion) -> Acting:
        """Return what load and rod do to the jaw, and to the frame by their reactions."""
        jaw, pushes = JawMotion(motion), []
        if self.load is not None:
            load = self.load.force(jaw)
            pushes.append((jaw.point(load.along), load.force))
        return acting(motion, pushes, () if self.rod is None else (self.rod,), self.supports)

    @property
    def observables(self) -> Mapping[str, Observable]:
        """Return those of any crusher."""
        return OBSERVABLES

    @property
    def own_observables(self) -> tuple[str, ...]:
        """Return all but those of joints that are ideal, and of supports and rod if none."""
        loose = self.joints.names
        return observables_with(loose, self.supports is not None, self.rod is not None)

    @property
    def statistics(self) -> Mapping[str, Statistic]:
        """Return those of any crusher, and the user's."""
        return STATISTIC | dict(self.own)

    @property
    def own_statistics(self) -> tuple[str, ...]:
        """Return the names of all that this crusher has."""
        return (*statistics_with(self._parts()), *dict(self.own))

    @property
    def usual_statistics(self) -> tuple[str, ...]:
        """Return the names of what is computed without being asked for."""
        return (*usual_with(self._parts()), *dict(self.own))

    def _parts(self) -> set[str]:
        """Return the parts that have statistics of their own."""
        loose = dict(self.joints.items())
        there = {
            "supports": self.supports is not None,
            "rod": self.rod is not None,
            "shaft": may_rest(self),
            "loose main": self.joint is not None,
            "rollers": isinstance(self.joint, RollerBearing),
        }
        rubbing = {f"friction of {name}" for name, one in loose.items() if one.friction is not None}
        return {"main", *loose, *(part for part, has in there.items() if has)} | rubbing

    @property
    def works(self) -> Mapping[str, Callable[[Snapshot, AbstractScene], Scalar]]:
        """Return the power of the crushing load, and what the damper of a rod takes."""
        return {"load_work": push_power} | ({} if self.rod is None else {"rod_loss": spring_loss})

    @property
    def limits(self) -> Mapping[str, tuple[Callable[..., Any], tuple[str, ...]]]:
        """Return the limits of a rod, of a free shaft and of rollers."""
        every: dict[str, tuple[Callable[..., Any], tuple[str, ...]]] = {
            "rod": (Tautness, ("rod_tension_least",)),
            "shaft": (Turning, ("shaft_speed_least",)),
            "rollers": (_roller_load, ("roller_pressure", "static_load_ratio")),
        }
        there = self._parts()
        return {part: limit for part, limit in every.items() if part in there}

    def steady(self) -> "Scene":
        """Return the scene under its mean load, which repeats with the shaft's turn."""
        load = None if self.load is None else self.load.steady()
        return self if load is self.load else dataclasses.replace(self, load=load)

    def ideal(self) -> "Scene":
        """The same machine, drive and load with ideal joints: what a clearance adds to."""
        ideal = {"joint": None, "elbow": None, "pivot": None, "shaft_bearing": None, "start": None}
        return dataclasses.replace(self, formulation=EccentricityFormulation(), **ideal)


def crusher_of(scene: AbstractScene) -> Scene:
    """Return a scene that is a crusher's; ValueError for another one."""
    good = isinstance(scene, Scene)
    must = "be a crusher's, as jaxcrusher.paper_scene makes it"
    require(good, "scene", must, f"a {type(scene).__name__}")
    assert isinstance(scene, Scene)
    return scene


def _roller_load(pressure: Scalar, load: Scalar) -> RollerLoad:
    return RollerLoad(pressure / STATIC_PRESSURE, load)


def later(scene: Scene, angle: Any) -> Scene:
    """Return the scene whose time zero is when the shaft has turned by `angle` (rad).

    A run that goes on from the state of another one begins its rough feed again; under this scene
    it goes on with it. `angle` is whole turns, as states are known at angle zero.
    """
    load = scene.load
    if not isinstance(load, RoughFeed):
        return scene
    phases = load.phases + load.places * (load.bandwidth * angle)
    return dataclasses.replace(scene, load=dataclasses.replace(load, phases=phases))

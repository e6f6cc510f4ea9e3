"""A scene: its parts, and what equations of motion need; a part that is None is not traced."""

import abc
import dataclasses
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import PyTree, Scalar
from typing_extensions import override

# Its integrator is made with the first scene, before a program of it is traced.
import jaxcrusher.basics.loops  # noqa: F401
from jaxcrusher.basics.checks import (
    primal,
    require,
    require_double,
    require_kind,
    require_names,
    require_own_process,
    require_positive,
    require_x64,
)
from jaxcrusher.basics.plane import Vector, plus
from jaxcrusher.files.summary import Summarised, Summary
from jaxcrusher.joint.clearance import AbstractBearing, AbstractGap, ClearanceJoint
from jaxcrusher.joint.friction import AbstractFriction
from jaxcrusher.joint.guide import Guide
from jaxcrusher.joint.rollers import RollerBearing
from jaxcrusher.mechanism.acting import AbstractPush, Spring
from jaxcrusher.mechanism.drives import AbstractDrive
from jaxcrusher.mechanism.linkage import Linkage, Point
from jaxcrusher.mechanism.motion import Motion
from jaxcrusher.mechanism.named import Named
from jaxcrusher.mechanism.quantities import LACKING, Asked, Parts, Template, asked_of
from jaxcrusher.mechanism.reductions import Chosen, Statistic
from jaxcrusher.mechanism.scene_summary import sketch_of, summary_of
from jaxcrusher.mechanism.snapshot import Observable, Snapshot
from jaxcrusher.mechanism.supports import AbstractFoundation, OnSupports
from jaxcrusher.mechanism.topology import FRAME


def _eccentricities() -> "AbstractFormulation":
    """Return the usual formulation, whose module takes scenes and so is above this one."""
    from jaxcrusher.mechanism.eccentricity import EccentricityFormulation

    return EccentricityFormulation()


def _centred() -> "AbstractStart":
    """Return the usual start, whose module takes scenes and so is above this one."""
    from jaxcrusher.mechanism.starts import Centred

    return Centred()


class Scene(Summarised, eqx.Module):
    """A linkage with a drive, the gaps of its loose joints and slides, and forces on its bodies.

    Joints and slides that are not named are ideal; a slide without a gap may have friction by
    `guides`. With no `foundation` the frame is clamped, and moments on the ground are counted about
    its origin. `points` of bodies or of a frame on supports, and the mass centre of each body, have
    a velocity and an acceleration as a sensor there shows them. `own` holds the statistics that
    `with_statistics` adds. The `template` names the results, and adds observables.

    Raises ValueError (concrete values only) if 64-bit floats are off, for a bearing of an unknown
    joint, for a clearance that is not inside (0, R_i), for a guide whose slider has no length and
    height, for friction of a slide that has a gap, for a friction law with a memory at a slide, for
    a push or a spring at an unknown body, for a push of the frame, and for a name of a point or
    slide that gives a result a name that another result has.
    """

    linkage: Linkage
    joints: Named[AbstractGap]  # with clearance; of slides a `Guide`
    drive: AbstractDrive
    pushes: tuple[AbstractPush, ...] = ()
    springs: tuple[Spring, ...] = ()
    formulation: "AbstractFormulation" = eqx.field(default_factory=_eccentricities)
    start: "AbstractStart | None" = eqx.field(default_factory=_centred)
    foundation: AbstractFoundation | None = None
    points: Named[Point] = eqx.field(default_factory=Named)
    guides: Named[AbstractFriction] = eqx.field(default_factory=Named)  # of slides without a gap
    own: Chosen = eqx.field(static=True, default=())
    template: Template = eqx.field(static=True, default=Template())

    def __check_init__(self):
        require_x64()
        slides = self.linkage.slides
        known = (*self.linkage.joints.names, *slides.names)
        for name, gap in self.joints.items():
            require(name in known, "joints", f"be of joints: {', '.join(known)}", f"of {name}")
            slide, prefix = slides[name], f"{name}." if self.prefix(name) else ""
            must = "be a Guide at a slide, and a bearing at a joint"
            fits = isinstance(gap, AbstractBearing if slide is None else Guide)
            require(fits, f"joints.{name}", must, type(gap).__name__)
            require_clearance(gap.clearance, gap.bore_radius, prefix)
            if slide is not None:
                sized = slide.length is not None and slide.height is not None
                require(sized, f"slides.{name}", "have a length and a height", "without")
        for name, law in self.guides.items():
            held = name in slides and name not in self.joints
            require(held, "guides", "be of slides without a gap", f"of {name}")
            must = "be of a law that remembers nothing"
            require(law.initial() is None, f"guides.{name}", must, type(law).__name__)
        bodies = self.linkage.bodies.names
        for name, point in self.points.items():
            require(name not in bodies, "points", "have names that no body has", name)
            known = bodies if self.supports is None else (*bodies, FRAME)
            must = "be of a body, or of a frame on supports"
            require(point.body in known, f"points.{name}", must, f"of {point.body}")
        must = f"be at bodies that there are: {', '.join(bodies)}"
        for push in self.pushes:  # one of the frame would be its own reaction
            require(push.body in bodies, "pushes", must, f"at {push.body}")
        for body in (point.body for spring in self.springs for point in spring.ends):
            require(body in (*bodies, FRAME), "springs", f"{must}, {FRAME}", f"at {body}")
        asked_of(self.template, self._parts)  # which checks names

    @property
    def throw(self) -> Scalar:
        """Return the throw of the crank's pin, m; of a crank without a pin its radius of gyration.

        It scales the displacements of a moving frame.
        """
        linkage, crank = self.linkage, self.linkage.crank
        body, bearing = linkage.bodies.at(crank), linkage.side_of(linkage.bearing, crank)
        pins = [n for n, *both in linkage.ends if crank in both and n != linkage.bearing]
        end = linkage.side_of(pins[0], crank) if pins else body.mass_centre
        squared = (end - bearing).squared()
        squared = squared if pins else plus(squared, body.inertia / body.mass)
        assert squared is not None, "two joints of a body are apart"
        return jnp.sqrt(squared)

    def point(self, name: str) -> Point:
        """Return a point by its name, or the mass centre of the body of that name."""
        return self.points[name] or self.linkage.centre(name)

    def prefix(self, joint: str) -> str:
        """Return the prefix of the names of a joint's results, such as "elbow_"."""
        return self.template.joint(joint).prefix

    @property
    def watched(self) -> dict[str, str]:
        """Return the joints of whose contact there are statistics, each with its prefix.

        The template's first joint is among them also where it is ideal.
        """
        return {name: at.prefix for name, at in self.template.watched(self._parts).items()}

    def joint_looked_at(self, joint: str | None = None) -> str:
        """Return a loose joint: the named one, or the template's first, or the only one.

        Raises ValueError where there is none of them.
        """
        loose, names = self.joints.names, self.linkage.joints.names
        must = f"name a joint with clearance: {', '.join(loose) or 'there is none'}"
        joint = self.template.first if joint is None else joint
        if joint is None:
            require(len(loose) == 1, "joint", must, "missing")
            (joint,) = loose
        known = "an ideal one" if joint in names else "unknown"
        require(joint in loose, "joint", must, f"{joint}, {known}")
        return joint

    @property
    def bearings(self) -> Named[AbstractBearing]:
        """Return the bearings of the loose joints; slides with a gap have none."""
        both = self.joints.items()
        return Named({name: one for name, one in both if isinstance(one, AbstractBearing)})

    def with_bearing(self, joint: str, bearing: AbstractBearing | None) -> "Scene":
        """Return the scene with another bearing at a joint; None: with an ideal joint there."""
        joints = Named({**dict(self.joints.items()), joint: bearing})
        return dataclasses.replace(self, joints=joints)

    @property
    def lubricated(self) -> tuple[str, ...]:
        """The joints with a film, which pins need not touch."""
        sliding = {n: one for n, one in self.joints.items() if isinstance(one, ClearanceJoint)}
        return tuple(name for name, one in sliding.items() if one.film is not None)

    @property
    def dry(self) -> tuple[int, ...]:
        """Which of the loose joints have a bore and no film: their pins lie in the bore, or fly."""
        wet = self.lubricated
        dry = [name for name in self.bearings.names if name not in wet]
        return tuple(i for i, name in enumerate(self.joints.names) if name in dry)

    @property
    def _parts(self) -> Parts:
        loose, linkage = dict(self.joints.items()), self.linkage
        rubbing = tuple(name for name, one in loose.items() if one.friction is not None)
        rolling = tuple(name for name, one in loose.items() if isinstance(one, RollerBearing))
        # Friction, also of rollers, might hold a free crank.
        rests = bool(rubbing or rolling) and self.drive.initial() is not None
        return Parts(
            linkage.joints.names,
            tuple(loose),
            rubbing,
            rolling,
            self.lubricated,
            linkage.slides.names,
            self.guides.names,
            linkage.bodies.names,
            self.points.names,
            self.supports is not None,
            bool(self.springs),
            rests,
        )

    @property
    def _asked(self) -> Asked:
        return asked_of(self.template, self._parts)

    @property
    def observables(self) -> Mapping[str, Observable]:
        """Return all that may be asked of an instant, by name."""
        return self._asked.observables

    @property
    def measurable(self) -> tuple[str, ...]:
        """Return the observables that sensors show: of points, bearings, supports and the motor."""
        return self._asked.measurable

    @property
    def statistics(self) -> Mapping[str, Statistic]:
        """Return all that may be asked of a motion, by name, with the user's own."""
        known = self._asked.statistics
        return {**known, **dict(self.own)} if self.own else known

    @property
    def usual_statistics(self) -> tuple[str, ...]:
        """Return the names of the statistics that are computed without being asked for."""
        return (*self._asked.usual, *dict(self.own))

    def require_outputs(self, outputs: Any, table: Mapping[str, Any], *others: str) -> None:
        """Check that names are of one of the scene's tables, or `others`.

        Raises ValueError, which says what the scene lacks for a name.
        """
        many = isinstance(outputs, Iterable) and not isinstance(outputs, str)
        for name in outputs if many else ():
            for lacking, change in LACKING.items() if name not in table else ():
                whole = asked_of(self.template, change(self._parts))
                needs = name in whole.observables or name in whole.statistics
                must = f"ask for {name} only of a scene with {lacking}"
                require(not needs, "outputs", must, "asked")
        require_names("outputs", outputs, (*table, *others))

    @property
    def headline(self) -> str:
        """Return the statistic by which errors of a motion are judged."""
        return self.template.headline

    def with_statistics(self, own: Mapping[str, Statistic]) -> "Scene":
        """Return the scene with statistics of one's own, by name; they need not be asked for.

        They are part of its structure: a program is compiled anew for another function. Raises
        ValueError for a name that is none of Python, or is that of a statistic already.
        """
        for name in own:
            require(name.isidentifier(), "own", "have names as Python's", name)
            require(name not in self.statistics, "own", "have names of their own", name)
        return dataclasses.replace(self, own=(*self.own, *own.items()))

    def entries(self, names: Iterable[str] | None = None) -> Chosen:
        """Return the entries of these names; None: of all statistics of the scene."""
        table = self.statistics
        return tuple((name, table[name]) for name in (table if names is None else names))

    @property
    def limits(self) -> Mapping[str, tuple[Callable[..., Any], tuple[str, ...]]]:
        """Return further limits of the model: for each a verdict on statistics, and their names."""
        return self._asked.limits

    def steady(self) -> "Scene":
        """Return the scene under pushes that repeat with the crank's turn: itself where they do.

        Raises ValueError for a push that does not repeat and has no mean.
        """
        return self._pushed(push.steady() for push in self.pushes)

    def _pushed(self, pushes: Iterable[AbstractPush]) -> "Scene":
        """Return the scene with other pushes, or itself where they are its own."""
        pushes = tuple(pushes)
        same = all(one is other for one, other in zip(pushes, self.pushes, strict=True))
        return self if same else dataclasses.replace(self, pushes=pushes)

    def ideal(self) -> "Scene":
        """Return the same scene with ideal joints, as the reference for a clearance."""
        formulation = _eccentricities()
        return dataclasses.replace(self, joints=Named(), start=None, formulation=formulation)

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
        """Whether a joint has clearance or the frame stands on supports: an orbit's unknowns."""
        return not self.is_ideal or self.supports is not None

    @override
    def _summary(self) -> Summary:
        return summary_of(self)

    @override
    def _picture(self) -> str:
        return sketch_of(self)


def later(scene: Scene, angle: Any) -> Scene:
    """Return the scene whose time zero is when the crank has turned by `angle` (rad).

    A run that goes on from the state of another one begins its rough feed again; under this scene
    it goes on with it. `angle` is whole turns, as states are known at angle zero.
    """
    return scene._pushed(push.later(angle) for push in scene.pushes)


class AbstractStart(eqx.Module):
    """Where pins start in their bores."""

    @abc.abstractmethod
    def eccentricities(self, scene: Scene) -> tuple[Named[Vector], Named[Vector]]:
        """Return e (m) and its rate (m/s) at time zero, of each joint with clearance."""


class AbstractFormulation(eqx.Module):
    """How the equations of motion of a scene are written and solved for the accelerations.

    A state is a PyTree of scalars that tells its `parts` (`jaxcrusher.mechanism.state.Parts`).
    `time` is in seconds.
    """

    @abc.abstractmethod
    def initial(self, scene: Scene) -> PyTree[Scalar]:
        """Return the state at time zero."""

    @abc.abstractmethod
    def motion(self, time: Scalar, state: PyTree[Scalar], scene: Scene) -> Motion:
        """Return all places and velocities at a state, without a force."""

    @abc.abstractmethod
    def snapshot(self, time: Scalar, state: PyTree[Scalar], scene: Scene) -> Snapshot:
        """Return all accelerations and forces at a state."""

    @abc.abstractmethod
    def rate(self, snapshot: Snapshot, state: PyTree[Scalar], scene: Scene) -> PyTree[Scalar]:
        """Return the time derivative of the state, per second."""

    @abc.abstractmethod
    def tolerance(self, scene: Scene, rtol: Scalar | float) -> Scalar | float:
        """Return the solver's tolerance for an error of `rtol` clearances in the eccentricity."""


def require_scene(scene: Any) -> None:
    """Check that it is one scene, of 64-bit floats."""
    require_own_process()
    require_kind("scene", scene, Scene, "jaxcrusher.paper_scene(30.0, 6e-5)")
    require_double("scene", scene)
    shapes = {"speed": jnp.shape(getattr(scene.drive, "speed", 0.0))}
    for joint, clearance in scene.joints.items():
        shapes[f"{scene.prefix(joint)}clearance"] = jnp.shape(clearance.clearance)
    for name, shape in shapes.items():
        must = "be one number (jax.vmap and jaxcrusher.sweep take many)"
        require(shape == (), name, must, f"of shape {shape}")


def require_steady(scene: Scene) -> None:
    """Check that the load repeats with the crank's turn, so that there is a map from turn to turn.

    Raises ValueError in one line.
    """
    good = scene.steady() is scene
    must = "have a load that repeats each turn"
    require(good, "scene", must, "a rough feed (load_scatter)")


def require_clearance(clearance, bore_radius, prefix: str = "") -> None:
    """Check 0 < clearance < bore radius (m) of the joint whose parameters have a `prefix`."""
    require_positive(f"{prefix}clearance", clearance, "m")
    known, bore = primal(clearance), primal(bore_radius)
    if known is not None and bore is not None:
        limit = f"be smaller than the bore radius {bore.min():g} m"
        require(bool((known < bore).all()), f"{prefix}clearance", limit, clearance)

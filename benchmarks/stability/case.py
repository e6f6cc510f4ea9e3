"""What a case is: a description of a crusher, and where its pins start."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import equinox as eqx
from jaxtyping import Scalar

import jaxcrusher as jc
from benchmarks.peers.free_bodies import PREFIXES
from benchmarks.stability.peer import AbstractPeer, Pins
from jaxcrusher.basics.plane import Vector, scalar
from jaxcrusher.crusher.joints import AtJoints
from jaxcrusher.crusher.linkage import Play
from jaxcrusher.crusher.starts import Given, InContact
from jaxcrusher.joint.friction import AmbrosioFriction
from jaxcrusher.scenes.parameters import PE250X400

Formulation = Literal["eccentricity", "multiplier"]
FORMULATIONS: tuple[Formulation, ...] = ("eccentricity", "multiplier")
# Along every axis: at rest amid the bores, resting in them, thrown at the wall of one.
STARTS = ("centred", "in contact", "violent")


@dataclass(frozen=True)
class AbstractCase(ABC):
    """A crusher and a start; `axis`, `value` and `start` are its labels."""

    axis: str
    value: str
    start: str

    @property
    @abstractmethod
    def peer(self) -> AbstractPeer:
        """The crusher of the other programs."""

    @property
    @abstractmethod
    def values(self) -> Mapping[str, float | str]:
        """The same as a description."""

    @property
    @abstractmethod
    def given(self) -> Pins:
        """The start, if it is not "in contact"."""

    @cached_property
    def pins(self) -> Pins:
        """The start, the same for all programs."""
        if self.start != "in contact":
            return self.given
        e, rates = resting(scene_of(self.values, "eccentricity"))
        return Pins(complexes(e), complexes(rates))

    def scene(self, formulation: Formulation, pins: Pins | None = None) -> jc.Scene:
        """Ours, of one structure for all cases: one compiled program serves them.

        From other `pins` if given. ValueError as `jaxcrusher.build_scene`.
        """
        at = self.pins if pins is None else pins
        scene, starts = scene_of(self.values, formulation), {}
        for (name, joint), e, rate in zip(scene.joints.present(), at.e, at.rates, strict=True):
            relative = e / float(joint.clearance)
            starts[name] = Vector(relative.real, relative.imag), Vector(rate.real, rate.imag)
        still = Vector(0.0, 0.0), Vector(0.0, 0.0)
        main = starts.pop("main", still)
        return eqx.tree_at(lambda s: s.start, scene, Given(main[0], main[1], AtJoints(**starts)))


def scene_of(values: Mapping[str, float | str], formulation: Formulation) -> jc.Scene:
    """The scene of a description, centred. ValueError as `jaxcrusher.build_scene`."""
    jc.build_scene(values)  # as a user would, with every check
    loose = [p for p in PREFIXES.values() if p + "friction" in values]
    # A friction of zero would be left out, and be another program.
    standing = {prefix + "friction": PE250X400["friction"] for prefix in loose}
    scene = jc.build_scene({**values, **standing, "formulation": formulation})
    coefficients = [scalar(values[prefix + "friction"]) for prefix in loose]
    return eqx.tree_at(frictions, scene, coefficients)


def frictions(scene: jc.Scene) -> list[Scalar]:
    """The coefficients of the loose joints."""
    laws = (joint.friction for _, joint in scene.joints.present())
    return [law.coefficient for law in laws if isinstance(law, AmbrosioFriction)]


def complexes(of: Play) -> tuple[complex, ...]:
    """Vectors of the loose joints, in their order."""
    return tuple(complex(v.x, v.y) for _, v in of.present())


@eqx.filter_jit
def resting(scene: jc.Scene) -> tuple[Play, Play]:
    """Where pins rest in their bores."""
    return InContact().eccentricities(scene)

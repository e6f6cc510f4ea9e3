"""A case: a description of a crusher, where its pins start, and the programs that judge it."""

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import equinox as eqx
from jaxtyping import Scalar

import jaxcrusher as jc
from benchmarks.peers.crusher_bodies import PREFIXES
from benchmarks.stability.peer import AbstractPeer, Pins
from jaxcrusher.basics.plane import Vector, scalar
from jaxcrusher.joint.friction import AmbrosioFriction
from jaxcrusher.mechanism.named import Named
from jaxcrusher.mechanism.starts import Given, InContact
from jaxcrusher.scenes.parameters import PE250X400

Formulation = Literal["eccentricity", "multiplier"]
FORMULATIONS: tuple[Formulation, ...] = ("eccentricity", "multiplier")
Numbers = dict[str, float | str]


@dataclass(frozen=True)
class Case:
    """A crusher and a start; `axis`, `value` and `start` are its labels."""

    axis: str
    value: str
    start: str
    numbers: tuple[tuple[str, float | str], ...]  # a description, as items
    peer: AbstractPeer  # the same crusher of the other programs
    given: Pins | None  # the start; None rests in contact

    @cached_property
    def pins(self) -> Pins:
        """The start, the same for all programs."""
        if self.given is not None:
            return self.given
        e, rates = _resting(_scene(dict(self.numbers), "eccentricity"))
        return Pins(_complexes(e), _complexes(rates))

    def scene(self, formulation: Formulation, pins: Pins | None = None) -> jc.Scene:
        """Return our scene, from other `pins` if given. ValueError as `jaxcrusher.build_scene`.

        All cases have scenes of one structure, so that one compiled program serves them.
        """
        at = self.pins if pins is None else pins
        scene, starts, rates = _scene(dict(self.numbers), formulation), {}, {}
        for (name, joint), e, rate in zip(scene.joints.items(), at.e, at.rates, strict=True):
            relative = e / float(joint.clearance)
            starts[name] = Vector(relative.real, relative.imag)
            rates[name] = Vector(rate.real, rate.imag)
        return eqx.tree_at(lambda s: s.start, scene, Given(starts, rates))


def _scene(values: Numbers, formulation: Formulation) -> jc.Scene:
    jc.build_scene(values)  # as a user would, with every check
    loose = [p for p in PREFIXES.values() if p + "friction" in values]
    # A friction of zero would be left out, and be another program.
    standing = {prefix + "friction": PE250X400["friction"] for prefix in loose}
    scene = jc.build_scene({**values, **standing, "formulation": formulation})
    coefficients = [scalar(values[prefix + "friction"]) for prefix in loose]
    return eqx.tree_at(_frictions, scene, coefficients)


def _frictions(scene: jc.Scene) -> list[Scalar]:
    laws = (joint.friction for _, joint in scene.joints.items())
    return [law.coefficient for law in laws if isinstance(law, AmbrosioFriction)]


def _complexes(of: Named[Vector]) -> tuple[complex, ...]:
    return tuple(complex(v.x, v.y) for v in of.values)


@eqx.filter_jit
def _resting(scene: jc.Scene) -> tuple[Named[Vector], Named[Vector]]:
    return InContact().eccentricities(scene)

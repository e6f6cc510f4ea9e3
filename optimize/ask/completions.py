"""Numbers of a design that follow from its other ones: equal stroke, a counterweight's moment.

Each is called with all numbers of a description, and returns them with those that follow, its
`outputs`, and without names that are none of `jaxcrusher.PARAMETERS`.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
from jaxtyping import Scalar

from jaxcrusher.basics.checks import nan_unless
from jaxcrusher.crusher.capacity import stroke
from jaxcrusher.crusher.machine import lengths_of
from jaxcrusher.scenes.build import build_linkage
from jaxcrusher.scenes.parameters import MOMENTS, PE250X400

# Newton steps on the eccentricity, to which the stroke is nearly proportional.
STEPS = 5
# Least and greatest eccentricity that are looked at, as multiples of the machine's own.
MULTIPLES = 0.4, 4.0


@dataclass(frozen=True)
class CounterweightMoment:
    """The counterweight by its first moment about O (kg m), along and across O-A.

    By mass and angle it would have a trap: a mass that comes to zero no longer feels its angle,
    and a descent stays there although another angle would help.
    """

    inputs: ClassVar[tuple[str, ...]] = tuple(MOMENTS)
    outputs: ClassVar[tuple[str, ...]] = ("counterweight.mass", "counterweight.angle")

    def __call__(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Mass and angle, at the description's `counterweight.radius`."""
        rest = dict(values)
        along, across = (rest.pop(name) for name in self.inputs)
        # At zero the length of the moment has no slope: that towards O-A is taken.
        along = along + jnp.where((along == 0) & (across == 0), 1e-12, 0.0)
        radius = rest.get("counterweight.radius", PE250X400["counterweight.radius"])
        rest["counterweight.mass"] = jnp.sqrt(along**2 + across**2) / radius
        rest["counterweight.angle"] = jnp.arctan2(across, along)
        return rest

    def of(self, values: Mapping[str, Any]) -> dict[str, float]:
        """Return the moment of a description by mass, radius and angle."""
        mass, radius, angle = (values[f"counterweight.{n}"] for n in ("mass", "radius", "angle"))
        moment = mass * radius
        parts = moment * jnp.cos(angle), moment * jnp.sin(angle)
        return {name: float(part) for name, part in zip(self.inputs, parts, strict=True)}


@dataclass(frozen=True)
class EqualStroke:
    """Completes a description by the eccentricity that gives B the horizontal travel `target` (m).

    Where that is not inside `limits` (m), or the linkage does not close, it is NaN, and so is
    every number of a motion made with it. With a given discharge opening the capacity by
    (21)-(25) depends on speed and stroke alone, and so is equal too.
    """

    target: float
    limits: tuple[float, float]
    outputs: ClassVar[tuple[str, ...]] = ("shaft.eccentricity",)

    @classmethod
    def of(cls, values: Mapping[str, Any]) -> "EqualStroke":
        """With the stroke of a description; limits are `MULTIPLES` of its eccentricity."""
        linkage = build_linkage(values)
        eccentricity = float(lengths_of(linkage)["shaft.eccentricity"])
        low, high = (eccentricity * multiple for multiple in MULTIPLES)
        return cls(float(jax.jit(stroke)(linkage)), (low, high))

    def __call__(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """The numbers with the eccentricity added; differentiable."""

        def excess(eccentricity: Scalar, values: Mapping[str, Any]) -> Scalar:
            links = build_linkage({**values, "shaft.eccentricity": eccentricity})
            return stroke(links) - self.target

        held = jax.lax.stop_gradient(jax.tree.map(jnp.asarray, dict(values)))

        def newton(_, eccentricity):
            now, slope = jax.value_and_grad(excess)(eccentricity, held)
            return eccentricity - now / slope

        start = jnp.asarray(sum(self.limits) / 2)
        solved = jax.lax.stop_gradient(jax.lax.fori_loop(0, STEPS, newton, start))
        # A step, differentiated by the links only, has the derivative of the root, and a second one
        # has the second derivative too.
        slope = jax.lax.stop_gradient(jax.grad(excess)(solved, held))
        for _ in range(2):
            solved = solved - excess(solved, values) / slope
        inside = (solved > self.limits[0]) & (solved < self.limits[1])
        return {**values, "shaft.eccentricity": nan_unless(inside, solved)}

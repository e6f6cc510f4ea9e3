"""A design: named parameters with bounds, the unit box of the search, and the scenes of its points.

A completion computes dependent numbers: for equal stroke, or from a counterweight's moment. It
takes all numbers of a description. It returns them with its `outputs`, and without names that are
not in `jaxcrusher.PARAMETERS`.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float, Scalar

import jaxcrusher as jc
from jaxcrusher.basics.checks import concrete, nan_unless, require, require_known
from jaxcrusher.crusher.capacity import stroke
from jaxcrusher.crusher.machine import lengths_of
from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.scenes.build import build_linkage
from jaxcrusher.scenes.parameters import MOMENTS, PE250X400, check_number

# With more free numbers than this, a Sobol sequence replaces the grid.
GRID_DIMENSIONS = 2
# Newton steps for the eccentricity; the stroke is nearly proportional to the eccentricity.
STEPS = 5
# Least and greatest eccentricity of the search, as multiples of the machine's own.
MULTIPLES = 0.4, 4.0


@dataclass(frozen=True)
class CounterweightMoment:
    """The counterweight by its first moment about O (kg m), along and across O-A.

    With mass and angle as parameters a descent could stop at a mass of zero: the objective does not
    depend on the angle there, although another angle would lower it.
    """

    inputs: ClassVar[tuple[str, ...]] = tuple(MOMENTS)
    outputs: ClassVar[tuple[str, ...]] = ("counterweight.mass", "counterweight.angle")

    def __call__(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Return the numbers with mass and angle, at the given `counterweight.radius`."""
        rest = dict(values)
        along, across = (rest.pop(name) for name in self.inputs)
        # The length of a zero moment has no slope: the slope towards O-A replaces it.
        along = along + jnp.where((along == 0) & (across == 0), 1e-12, 0.0)
        radius = rest.get("counterweight.radius", PE250X400["counterweight.radius"])
        rest["counterweight.mass"] = jnp.sqrt(along**2 + across**2) / radius
        rest["counterweight.angle"] = jnp.arctan2(across, along)
        return rest

    def of(self, values: Mapping[str, Any]) -> dict[str, float]:
        """Return both parts of the moment of a description with mass, radius and angle."""
        mass, radius, angle = (values[f"counterweight.{n}"] for n in ("mass", "radius", "angle"))
        moment = mass * radius
        parts = moment * jnp.cos(angle), moment * jnp.sin(angle)
        return {name: float(part) for name, part in zip(self.inputs, parts, strict=True)}


@dataclass(frozen=True)
class EqualStroke:
    """Completes a description by the eccentricity that gives B the horizontal travel `target` (m).

    If the eccentricity is outside `limits` (m), or the linkage does not close, it is NaN, and so is
    every number of the motion. At a given discharge opening the capacity by (21)-(25) depends only
    on speed and stroke, so equal strokes mean equal capacities.
    """

    target: float
    limits: tuple[float, float]
    outputs: ClassVar[tuple[str, ...]] = ("shaft.eccentricity",)

    @classmethod
    def of(cls, values: Mapping[str, Any]) -> "EqualStroke":
        """Keep the stroke of a description; the limits are `MULTIPLES` of its eccentricity."""
        linkage = build_linkage(values)
        eccentricity = float(lengths_of(linkage)["shaft.eccentricity"])
        low, high = (eccentricity * multiple for multiple in MULTIPLES)
        return cls(float(jax.jit(stroke)(linkage)), (low, high))

    def __call__(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Return the numbers with the eccentricity, which is differentiable."""

        def excess(eccentricity: Scalar, values: Mapping[str, Any]) -> Scalar:
            links = build_linkage({**values, "shaft.eccentricity": eccentricity})
            return stroke(links) - self.target

        held = jax.lax.stop_gradient(jax.tree.map(jnp.asarray, dict(values)))

        def newton(_, eccentricity):
            now, slope = jax.value_and_grad(excess)(eccentricity, held)
            return eccentricity - now / slope

        start = jnp.asarray(sum(self.limits) / 2)
        solved = jax.lax.stop_gradient(jax.lax.fori_loop(0, STEPS, newton, start))
        # One Newton step, differentiated only by the links, has the first derivative of the root. A
        # second step has the second derivative too.
        slope = jax.lax.stop_gradient(jax.grad(excess)(solved, held))
        for _ in range(2):
            solved = solved - excess(solved, values) / slope
        inside = (solved > self.limits[0]) & (solved < self.limits[1])
        return {**values, "shaft.eccentricity": nan_unless(inside, solved)}


@dataclass(frozen=True, eq=False)
class Design:
    """The free parameters of a machine with their bounds.

    **Arguments:**

    - `bounds`: names of the machine's numbers, or both of `CounterweightMoment.inputs`, with their
      lowest and highest value in SI units.
    - `machine`: the machine, whose other numbers are fixed.
    - `kept_stroke`: the completion that computes the eccentricity, or None.

    Raises ValueError for unknown names, bounds that are not LOW < HIGH inside the parameter's
    limits, a dependent number among the free ones, and one part of the moment alone.
    """

    bounds: Mapping[str, tuple[float, float]]
    machine: jc.Machine = field(default_factory=jc.paper_machine)
    kept_stroke: EqualStroke | None = None

    def __post_init__(self):
        require(len(self.bounds) > 0, "bounds", "name a parameter", dict(self.bounds))
        known = {**self.machine.numbers, **MOMENTS}
        for name, (low, high) in self.bounds.items():
            require_known(name, known)
            good = bool(np.isfinite([low, high]).all()) and low < high
            require(good, f"bounds of {name}", "be finite, LOW < HIGH", (low, high))
            check_number(name, np.array([low, high]), known)
            require(name not in self.following, "bounds", "name nothing that follows", name)
        moment = [name for name in CounterweightMoment.inputs if name in self.bounds]
        require(len(moment) != 1, "bounds", "name both parts of the moment", moment)

    @cached_property
    def fixed(self) -> dict[str, Any]:
        """Return the given numbers and choices that are neither free nor dependent."""
        apart = {*self.bounds, *self.following}
        return {name: value for name, value in self.machine.given.items() if name not in apart}

    @property
    def names(self) -> tuple[str, ...]:
        """Return the names of the free parameters, in the order of the unit box."""
        return tuple(self.bounds)

    @property
    def completions(self) -> tuple[CounterweightMoment | EqualStroke, ...]:
        """Return the completions, in the order of their calls."""
        by_moment = bool({*CounterweightMoment.inputs} & {*self.bounds})
        found = (CounterweightMoment() if by_moment else None, self.kept_stroke)
        return tuple(one for one in found if one is not None)

    @property
    def following(self) -> tuple[str, ...]:
        """Return the names of the dependent numbers."""
        return tuple(name for completion in self.completions for name in completion.outputs)

    def values(self, unit: Float[Array | np.ndarray, "*batch n"]) -> dict[str, Any]:
        """Return the free parameters at points of the unit box, in SI units."""
        low, high = np.array(list(self.bounds.values())).T
        numbers = low + unit * (high - low)
        return {name: numbers[..., i] for i, name in enumerate(self.names)}

    def numbers(self, unit: Float[np.ndarray, " n"]) -> dict[str, float]:
        """Return the `values` of one point as Python floats."""
        return {name: float(value) for name, value in self.values(unit).items()}

    def unit(self, values: Mapping[str, ArrayLike]) -> np.ndarray:
        """Return the point of the unit box, the inverse of `values`; it may lie outside the box."""
        rows = [
            (np.asarray(values[name]) - low) / (high - low)
            for name, (low, high) in self.bounds.items()
        ]
        return np.stack(rows, axis=-1)

    def description(self, unit: Float[Array | np.ndarray, " n"]) -> dict[str, Any]:
        """Return the completed description of a point; ValueError if it is outside the box."""
        point = concrete(unit)
        if point is not None:
            good = point.shape == (len(self.bounds),) and bool(((point >= 0) & (point <= 1)).all())
            require(good, "unit", f"be {len(self.bounds)} numbers in [0, 1]", point)
        return self.completed(self.values(unit))

    def completed(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Return the completed description of the free parameters' values, which may be traced."""
        described = {**self.fixed, **values}
        if not self.completions:
            return described
        choices = {name: value for name, value in described.items() if isinstance(value, str)}
        numbers = {name: value for name, value in described.items() if name not in choices}
        known = all(concrete(value) is not None for value in numbers.values())
        complete = self._compiled if known else self._complete
        return {**choices, **complete(numbers)}

    def _complete(self, numbers: dict[str, Any]) -> dict[str, Any]:
        for completion in self.completions:
            numbers = completion(numbers)
        return numbers

    @cached_property
    def _compiled(self):
        """The completions, jitted once: otherwise each call would compile Newton's loop."""
        return jax.jit(self._complete)

    def scene(self, unit: Float[Array | np.ndarray, " n"]) -> Scene:
        """Return the scene at a point of the unit box, which may be traced.

        Raises ValueError for a concrete point outside the box, and for a concrete machine that
        cannot be built. Every number of the motion is NaN if such a machine is traced.
        """
        return self.build(self.description(unit))

    def build(self, described: Mapping[str, Any]) -> Scene:
        """Return the scene of a completed description; ValueError as in `scene`."""
        return self.machine.structure.scene(described)

    def whole(self, described: Mapping[str, Any]) -> dict[str, Any]:
        """Return the description with the machine's values for missing names."""
        return {**self.machine.values, **described}

"""A design: named parameters with bounds, the unit box the search works on, and its scenes.

Numbers that follow from the others are completions: equal stroke, and a counterweight's moment.
Each is called with all numbers of a description, and returns them with those that follow, its
`outputs`, and without names that are none of `jaxcrusher.PARAMETERS`.
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

# More free numbers than these get a Sobol sequence instead of a grid.
GRID_DIMENSIONS = 2
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


@dataclass(frozen=True, eq=False)
class Design:
    """The free parameters of a machine with their bounds.

    **Arguments:**

    - `bounds`: names of the machine's numbers, or both of `CounterweightMoment.inputs`, with their
      lowest and highest value in SI units.
    - `machine`: what is not free of it is fixed.
    - `kept_stroke`: by which the eccentricity follows from the other numbers, if anything.

    Raises ValueError for unknown names, bounds that are not LOW < HIGH inside the parameter's
    limits, and a name that is free and follows.
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
        """Return the numbers and choices that are given, and neither free nor follow."""
        apart = {*self.bounds, *self.following}
        return {name: value for name, value in self.machine.given.items() if name not in apart}

    @property
    def names(self) -> tuple[str, ...]:
        """Return the names of the free parameters, in the order of the unit box."""
        return tuple(self.bounds)

    @property
    def completions(self) -> tuple[CounterweightMoment | EqualStroke, ...]:
        """Return what is called one after the other with all numbers of the description."""
        by_moment = bool({*CounterweightMoment.inputs} & {*self.bounds})
        found = (CounterweightMoment() if by_moment else None, self.kept_stroke)
        return tuple(one for one in found if one is not None)

    @property
    def following(self) -> tuple[str, ...]:
        """Return the names of the numbers that follow from the others."""
        return tuple(name for completion in self.completions for name in completion.outputs)

    def values(self, unit: Float[Array | np.ndarray, "*batch n"]) -> dict[str, Any]:
        """The free parameters at a point of the unit box, in SI units."""
        low, high = np.array(list(self.bounds.values())).T
        numbers = low + unit * (high - low)
        return {name: numbers[..., i] for i, name in enumerate(self.names)}

    def numbers(self, unit: Float[np.ndarray, " n"]) -> dict[str, float]:
        """`values` of one point, as Python's numbers."""
        return {name: float(value) for name, value in self.values(unit).items()}

    def unit(self, values: Mapping[str, ArrayLike]) -> np.ndarray:
        """The inverse of `values`, with every free name; outside the bounds, outside the box."""
        rows = [
            (np.asarray(values[name]) - low) / (high - low)
            for name, (low, high) in self.bounds.items()
        ]
        return np.stack(rows, axis=-1)

    def description(self, unit: Float[Array | np.ndarray, " n"]) -> dict[str, Any]:
        """The completed description at a point; ValueError for a concrete one outside the box."""
        point = concrete(unit)
        if point is not None:
            good = point.shape == (len(self.bounds),) and bool(((point >= 0) & (point <= 1)).all())
            require(good, "unit", f"be {len(self.bounds)} numbers in [0, 1]", point)
        return self.completed(self.values(unit))

    def completed(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """The completed description of the free parameters' values, which may be traced."""
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
        """For concrete points: a loop that is not compiled once is compiled at every call."""
        return jax.jit(self._complete)

    def scene(self, unit: Float[Array | np.ndarray, " n"]) -> Scene:
        """The scene at a point of the unit box, which may be traced.

        Raises ValueError (concrete points only) outside the box and for a machine that cannot
        be built; a traced one has NaN in every number of its motion.
        """
        return self.build(self.description(unit))

    def build(self, described: Mapping[str, Any]) -> Scene:
        """The scene of a completed description; raises as `scene` does."""
        return self.machine.structure.scene(described)

    def whole(self, described: Mapping[str, Any]) -> dict[str, Any]:
        """The description with what it leaves to the machine."""
        return {**self.machine.values, **described}
